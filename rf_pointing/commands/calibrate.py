"""Executable `calibrate`: a campaign on the live station, from plan to accepted model.

The sky of a simulated station is filled with beacons; a station whose drive is not simulated tracks
the satellites of --elements in real time.  The campaign that fills the 36 sectors in the least time
is planned.  The graph is brought up as `track` does it, the calibrator runs the campaign and fits.
More beacons are tracked with the new model in the shadow of the old one, and it is accepted if it
is better there.  The report shows the observations of the fit. Exit code 0: the better of the two
models is in force; 1: interrupted, stopped by a fault of the antenna, or no model to decide about;
2: not started.
"""

import argparse
import sys
from functools import partial

from rf_pointing.api import live
from rf_pointing.api.requests import CALIBRATION_START, DEFAULT_MODELS, CalibrateRequest
from rf_pointing.api.target import ELEMENTS_HELP
from rf_pointing.commands.options import add_options, between, command, ending_with_reason, named, requested
from rf_pointing.commands.track import RUN
from rf_pointing.core.modes import Sensor
from rf_pointing.tracking.sensors import SENSORS


def arguments() -> argparse.ArgumentParser:
    """Return the parser of the command line."""
    parser = command("calibrate", "Calibrate the pointing model of a station, simulated or real.")
    add = parser.add_argument
    add_options(parser, "station band")
    sensors = (*SENSORS, Sensor.AUTO)
    add("--sensor", type=named(sensors), choices=sensors, help="(default: that of the station's band)")
    add_options(
        parser, "elements start",
        elements=f"satellites that the station receives, for a real drive: {ELEMENTS_HELP}",
        start=f"begin (default: {CALIBRATION_START}, of a real drive the present)",
    )  # fmt: skip
    add("--longest", dest="longest_s", metavar="S", type=between(60.0, 86400.0),
        help="length of the campaign at most (default: 4800, real: 86400)")  # fmt: skip
    add("--fewest", type=int, default=25, help="observations in each sector (default: 25)")
    add("--orbit-prior", dest="orbit_prior_m", metavar="M", type=between(0.01, 1e6), default=5.0,
        help="error of the beacons' orbits that the fit allows for in each pass (default: 5)")  # fmt: skip
    add("--resume", action="store_true", help="continue an interrupted campaign: only what its observations left thin")
    add("--shadow", dest="acceptance_passes", metavar="N", type=int, choices=range(2, 21), default=3,
        help="passes with the new model in the shadow before it is accepted (default: 3)")  # fmt: skip
    add_options(
        parser, RUN, models={"default": DEFAULT_MODELS, "help": f"(default: {DEFAULT_MODELS})"},
        ephemeris_error="of the beacons (default: 0)",
        output="folder of bag and report (default: runs/calibration-TIME-NUMBER)",
    )  # fmt: skip
    return parser


request_of = partial(requested, arguments, CalibrateRequest)
"""Returns the request of a command line; ValueError with the reason where it cannot be."""


def main(argv: list[str] | None = None) -> None:
    """Entry point of `ros2 run rf_pointing calibrate`."""
    with ending_with_reason("calibrate"):
        ready = live.prepare_calibration(request_of(argv))
    sys.exit(ready.observe().code)
