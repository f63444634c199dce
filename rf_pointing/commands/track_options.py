"""The options that `track` and `calibrate` share, and the fields of a request that they become."""

import argparse
from pathlib import Path
from typing import Any

from rf_pointing.api.requests import DEFAULT_MODELS
from rf_pointing.api.station import Station
from rf_pointing.commands.options import add_namespace_option, between, seed
from rf_pointing.core.dates import parse_utc


def add_run_options(parser: argparse.ArgumentParser, *, models: str, ephemeris_error: str, output: str) -> None:
    """Add the options of a run that starts nodes; the texts are helps."""
    add = parser.add_argument
    add("--speed", help="of a simulated antenna: factor of real time, or max (default)")
    add("--receiver", metavar="ADDRESS", default="", help="receiver in place of the station's, with further keys "
        "after ?: rtl_tcp://localhost:1234?iq.rate_hz=240000; a simulated antenna serves its samples there")  # fmt: skip
    add("--seed", type=seed, help="of a simulated antenna: seed of every noise source (default: 1)")
    add("--reset-fault", action="store_true", help="of a real antenna: reset the fault that an earlier run has "
        "latched, after you have looked at the antenna")  # fmt: skip
    add("--processes", type=int, choices=(1, 2, 8), default=2, help="processes of the nodes: 1, 2 (what moves, and "
        "the others) or 8, one for each node (default: 2); a real drive's control unit always has its own")  # fmt: skip
    add("--ephemeris-error", metavar="S", type=between(-60.0, 60.0), help=ephemeris_error)
    add("--models", metavar="DIR", default=DEFAULT_MODELS, help=models)
    add_namespace_option(parser)
    add("--params-file", action="append", default=[], help="further ROS parameter file, may be repeated")
    add("--output", metavar="DIR", help=output)


def run_fields(given: dict[str, Any]) -> dict[str, Any]:
    """Return the fields of a `RunRequest` that the parsed options `given` mean.

    Raises ValueError for a station, a time or a number that cannot be read.
    """
    return {
        "station": Station(given["station"], given["band"]),
        "sensor": given["sensor"] or "",
        "start_s": parse_utc(given["start"]) if given["start"] else None,
        "speed": _speed(given["speed"]),
        "seed": given["seed"],
        "receiver": given["receiver"],
        "ephemeris_error_s": given["ephemeris_error"],
        "reset_fault": given["reset_fault"],
        "processes": given["processes"],
        "models": given["models"],
        "namespace": given["namespace"],
        "parameter_files": tuple(map(Path, given["params_file"])),
        "output": Path(given["output"]) if given["output"] else None,
    }


def _speed(text: str | None) -> float | str | None:
    if text in (None, "max"):
        return text
    try:
        return float(text)
    except ValueError as error:
        raise ValueError(f"speed={text!r} must be a factor or max") from error
