"""From a receiver's samples and levels to carrier powers and clusters; signals to test it with."""

from typing import TYPE_CHECKING

from rf_pointing.core.lazy import lazily

if TYPE_CHECKING:
    from rf_pointing.receiver.generator import SignalGenerator
    from rf_pointing.receiver.meter import Measurement, SignalMeter
    from rf_pointing.receiver.params import GeneratorParams, SignalReceiverParams
    from rf_pointing.receiver.receiver import SignalReceiver
    from rf_pointing.receiver.registry import check_params, known_types, make_source
    from rf_pointing.receiver.source import ByteSource, Level, Source
    from rf_pointing.receiver.spectrum import IqSamples

__getattr__ = lazily(__name__, __file__)
