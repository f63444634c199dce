"""The receivers by name: those of this package, and those that register an entry point.

A package of one's own registers a factory in its setup.cfg, which takes `SignalReceiverParams` and
the clock:

    [options.entry_points]
    rf_pointing.receivers =
        my_radio = my_package.my_radio:MyRadio
"""

import re
from collections.abc import Callable
from typing import TYPE_CHECKING

from rf_pointing.core.lazy import installed
from rf_pointing.receiver.params import LEVELS, PREAMBLE, SignalReceiverParams
from rf_pointing.receiver.preamble import constellation

if TYPE_CHECKING:
    from rf_pointing.receiver.source import Source

ENTRY_POINTS = "rf_pointing.receivers"
SIMULATED, TOPIC = "simulated", "topic"
SAMPLES = ("rtl_tcp", "soapy", "sigmf", "zmq", "vita49")
TYPES = (SIMULATED, TOPIC, *SAMPLES, *LEVELS)
_MODULES = {
    "rtl_tcp": "iq_sources.RtlTcp", "soapy": "iq_sources.Soapy", "sigmf": "iq_sources.SigMf",
    "zmq": "iq_sources.Zmq", "vita49": "vita49.Vita49", "scpi": "level_sources.Scpi",
    "rigctl": "level_sources.Rigctl", "level": "level_sources.TextLevel",
}  # fmt: skip


def known_types() -> list[str]:
    """Return the names of the receivers that a description may name here."""
    return [*TYPES, *installed(ENTRY_POINTS)]


def make_source(params: SignalReceiverParams, now_s: Callable[[], float]) -> "Source":
    """Return the source of the parameters.

    Raises ValueError for a type that does not exist, a pattern that is not one, and what the
    factory of an entry point refuses.
    """
    check_params(params)
    if params.type in _MODULES:
        from importlib import import_module

        module, name = _MODULES[params.type].split(".")
        source: Source = getattr(import_module(f"rf_pointing.receiver.{module}"), name)(
            params, now_s
        )
        return source
    if point := installed(ENTRY_POINTS).get(params.type):
        made: Source = point.load()(params, now_s)
        return made
    if params.type in (SIMULATED, TOPIC):
        raise ValueError(
            f"receiver.type={params.type} needs no signal_receiver: its topics come from elsewhere"
        )
    raise ValueError(f"receiver.type={params.type!r} must be one of {', '.join(known_types())}")


def check_params(params: SignalReceiverParams) -> None:
    """Raise ValueError for what a receiver of these parameters could never do."""
    if params.signal.channels == 2:
        raise ValueError("signal.channels=2 must be 1 (sum) or 3 (sum and both differences)")
    if params.signal.kind == PREAMBLE and params.type not in LEVELS:
        constellation(params.signal.preamble)
    if params.type in LEVELS:
        try:
            groups = re.compile(params.level.pattern).groupindex
        except re.error as error:
            raise ValueError(
                f"level.pattern={params.level.pattern!r} is not a regular expression: {error}"
            ) from error
        if "level" not in groups:
            raise ValueError(
                f"level.pattern={params.level.pattern!r} must have a group level: (?P<level>...)"
            )
