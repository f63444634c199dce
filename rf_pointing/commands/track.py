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
from pathlib import Path

from rf_pointing.api import live
from rf_pointing.api.requests import DEFAULT_MODELS, TrackRequest
from rf_pointing.api.target import Target
from rf_pointing.commands.options import (
    add_target_options,
    between,
    ending_with_reason,
    interpolation_of,
    named,
)
from rf_pointing.commands.track_options import add_run_options, run_fields
from rf_pointing.tracking.sensors import SENSOR_CHOICES, load_trackers


def request_of(argv: list[str] | None = None) -> TrackRequest:
    """Return the request of a command line; ValueError with the reason where it cannot be."""
    load_trackers()
    parser = argparse.ArgumentParser(
        prog="track", description="Track one satellite pass with a station, simulated or real."
    )
    add_target_options(parser)
    add = parser.add_argument
    add("--min-peak", type=between(0.0, 90.0), default=40.0, help="least peak elevation in deg (default: 40)")
    add(
        "--sensor",
        type=named(SENSOR_CHOICES),
        choices=tuple(SENSOR_CHOICES),
        help="(default: that of the station's band)",
    )
    add("--scan-sigma", metavar="MDEG", type=float, help="accuracy of the scan per axis at the pass's weakest "
        "carrier: chooses radius and period (default: the station's)")  # fmt: skip
    add_run_options(
        parser,
        models=f"folder of accepted pointing models (default: {DEFAULT_MODELS}); empty or none in it: the station's "
        "bias model",
        ephemeris_error="time by which the satellite is ahead of its elements (default: the station's, "
        "simulation.along_track_offset_s)",
        output="folder of the report (default: runs/SATELLITE-AOS)",
    )
    add("--record", metavar="DIR", help="bag directory (default: OUTPUT/bag)")
    given = parser.parse_args(argv)
    method, degree = interpolation_of(given.interpolation)
    return TrackRequest(
        **run_fields(vars(given)),
        target=Target(
            location=given.elements, satellite=given.satellite, interpolation=method, interpolation_degree=degree
        ),
        min_peak_deg=given.min_peak,
        mask_deg=given.mask,
        scan_sigma_mdeg=given.scan_sigma,
        record=Path(given.record) if given.record else None,
    )


def main(argv: list[str] | None = None) -> None:
    """Entry point of `ros2 run rf_pointing track`."""
    with ending_with_reason("track"):
        ready = live.prepare_track(request_of(argv))
    sys.exit(ready.fly().code)
