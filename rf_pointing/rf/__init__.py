"""Beam, link and receiver: the radio signal of a target from where the beam really points."""

from typing import TYPE_CHECKING

from rf_pointing.core.lazy import lazily

if TYPE_CHECKING:
    from rf_pointing.rf.beam import HALF_POWER_BEAMWIDTH_RAD, Beam, BeamParams
    from rf_pointing.rf.disturbances import (
        DropoutParams,
        Dropouts,
        InterferenceParams,
        SpinParams,
        spin_gain_db,
    )
    from rf_pointing.rf.feed import MonopulseFeed, MonopulseFeedParams
    from rf_pointing.rf.link import Link, LinkParams
    from rf_pointing.rf.noise import AtmosphereParams, NoiseParams
    from rf_pointing.rf.receiver import Receiver, ReceiverParams

__getattr__ = lazily(__name__, __file__)
