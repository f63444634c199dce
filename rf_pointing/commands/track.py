"""Executable `track`: bring up an antenna, track one pass, record it and report on it.

The nodes run in two processes, or as `--processes` says.  During the pass one line shows what the
antenna does: redrawn in place on a terminal, or repeated every ten seconds in a log.  A station
whose drive is not simulated is flown in real time, without simulation_clock and rf_receiver:
`track` waits for the pass, and begins early enough for the antenna to be at its start.
Exit code 0: the pass was tracked, as `core/pass_outcome.py` defines it; 1: it was not; 2: it could
not be started.
"""

import argparse
import sys
from functools import partial
from pathlib import Path
from typing import Any

from rf_pointing.api import live
from rf_pointing.api.requests import DEFAULT_MODELS, DesignateRequest, TrackRequest
from rf_pointing.api.target import Target
from rf_pointing.commands.options import add_options, command, ending_with_reason, named, requested
from rf_pointing.tracking.sensors import SENSOR_CHOICES, load_trackers

RUN = "speed seed reset-fault receiver processes ephemeris-error models namespace params-file output"
"""Options of every run that starts the nodes of a station."""


def arguments() -> argparse.ArgumentParser:
    """Return the parser of the command line."""
    load_trackers()
    parser = command("track", "Track one satellite pass with a station, simulated or real.")
    add_options(
        parser, "elements interpolation satellite station band start mask min-peak",
        min_peak={"default": 40.0, "help": "least peak elevation in deg (default: 40)"},
    )  # fmt: skip
    add = parser.add_argument
    add("--designate", nargs="+", metavar=("ADDRESS", "KIND"), default=argparse.SUPPRESS,
        help="in place of a satellite, what others report: adsb:HOST:PORT/ICAO24, sonde:ADDRESS:PORT/CALLSIGN, "
        "mavlink:ADDRESS:PORT/SYSTEM, several with commas for one target, or a flight of a table:FILE; aircraft "
        "(default), balloon, rocket or ship")  # fmt: skip
    add("--sensor", type=named(SENSOR_CHOICES), choices=tuple(SENSOR_CHOICES),
        help="(default: that of the station's band)")  # fmt: skip
    add("--scan-sigma", dest="scan_sigma_mdeg", metavar="MDEG", type=float, help="accuracy of the scan per axis at "
        "the pass's weakest carrier: chooses radius and period (default: the station's)")  # fmt: skip
    add_options(
        parser,
        RUN,
        models={
            "default": DEFAULT_MODELS,
            "help": f"folder of accepted pointing models (default: {DEFAULT_MODELS}); empty or none in it: the "
            "station's bias model",
        },
        ephemeris_error="time by which the satellite is ahead of its elements (default: the station's, "
        "simulation.along_track_offset_s)",
        output="folder of the report (default: runs/SATELLITE-AOS)",
    )
    add("--record", type=Path, metavar="DIR", help="bag directory (default: OUTPUT/bag)")
    return parser


def designated(**given: Any) -> DesignateRequest:
    """Return the request of a line with --designate; ValueError for options of a satellite."""
    usual = vars(arguments().parse_args([]))
    for name in ("start_s", "mask_deg", "min_peak_deg", "scan_sigma_mdeg"):
        if given.pop(name) != usual[name]:
            raise ValueError(f"{name.rpartition('_')[0]} is for a satellite, and --designate leads to another target")
    if given.pop("target") != Target():
        raise ValueError("elements and satellite are given, and --designate leads to another target")
    address, kind = [*given.pop("designate"), "aircraft"][:2]
    return DesignateRequest(**given, designate=address, kind=kind)


request_of = partial(requested, arguments, TrackRequest)
"""Returns the request of a command line; ValueError with the reason where it cannot be."""


def main(argv: list[str] | None = None) -> None:
    """Entry point of `ros2 run rf_pointing track`."""
    with ending_with_reason("track"):
        led = any(each.startswith("--designate") for each in argv or sys.argv[1:])
        if led:
            ready = live.prepare_designate(requested(arguments, designated, argv))
        else:
            ready = live.prepare_track(request_of(argv))
    sys.exit(ready.fly().code)
