"""Executable `orbit_from_passes FILE...`: the orbit of a satellite from passes of your own.

    scripts/run orbit_from_passes pass1/bag pass2.tdm --station my_dish.yaml --elements my.tle

Input: rosbag2 recordings, CCSDS TDM and CSV of raw tracking, of one satellite and any stations.
It writes STEM.oem, states with covariances from the first pass to --hours after the last, and
STEM.omm, refined elements; `track --elements` flies either.

Exit code 0: the orbit was determined; 1: with --if-better it was, but the elements predict
at least as well; 2: it was not.  With 1 and 2 nothing is written.
"""

import argparse
import sys
import time
from pathlib import Path

from rf_pointing.api.orbits import orbit_from_passes
from rf_pointing.api.station import Station
from rf_pointing.api.target import Target
from rf_pointing.commands.options import add_options, between, command, ending_with_reason, refusing, say_of_elements
from rf_pointing.core.dates import DAY_S, parse_utc
from rf_pointing.station.log_lines import say

PROGRAM = "orbit_from_passes"


def arguments() -> argparse.ArgumentParser:
    """Return the parser of the command line."""
    parser = command(PROGRAM, "Determine an orbit from your own passes.")
    add = parser.add_argument
    add("files", nargs="+", type=Path, metavar="FILE", help="recording, TDM or CSV")
    add_options(
        parser, "station band elements satellite",
        station={"nargs": "+", "default": None, "required": True,
        "help": "descriptions of the stations of the files"},
    )  # fmt: skip
    add("--max-age", type=between(0.1, 60.0), default=14.0, metavar="DAYS",
        help="of the elements (default: 14)")  # fmt: skip
    add("--manoeuvre", type=refusing(parse_utc), metavar="UTC",
        help="its change of velocity is estimated")  # fmt: skip
    add("--hours", type=between(0.1, 240.0), default=24.0,
        help="prediction after the last pass (default: 24)")  # fmt: skip
    add("--clock", type=between(1e-6, 60.0), default=0.01, metavar="S",
        help="sigma of the clocks (default: 0.01)")  # fmt: skip
    add("--bias", type=between(0.01, 5000.0), metavar="MDEG",
    help="sigma of the angle biases that are left "
        "(default: 5 with a bias model, else a tenth of the beam)")  # fmt: skip
    add("--refraction-removed", action="store_true",
        help="the angles of CSV and TDM data are free of it")  # fmt: skip
    add("--allow-damage", action="store_true", help="use the sound part of damaged recordings")
    add("--if-better", action="store_true",
        help="write only what predicts better than the elements, by the law of their errors")  # fmt: skip
    add("--output", default="orbit", metavar="STEM",
        help="writes STEM.oem and STEM.omm (default: orbit)")  # fmt: skip
    return parser


def main(argv: list[str] | None = None) -> None:
    """Entry point of `ros2 run rf_pointing orbit_from_passes`."""
    with ending_with_reason(PROGRAM):
        options = arguments().parse_args(argv)
        target = Target(location=options.elements, satellite=options.satellite)
        say_of_elements(target)
        stations = [Station(one, options.band) for one in options.station]
        orbit = orbit_from_passes(
            options.files, stations, target, manoeuvre_t_s=options.manoeuvre,
            predict_hours=options.hours, clock_s=options.clock, bias_mdeg=options.bias,
            max_age_s=options.max_age * DAY_S, refraction_removed=options.refraction_removed,
            allow_damage=options.allow_damage,
        )  # fmt: skip
        print(orbit)
        if options.if_better and (why := orbit.reason_not_better):
            say(PROGRAM, f"not written: {why}")
            sys.exit(1)
        oem, omm = orbit.write(options.output, created_t_s=time.time())
        say(PROGRAM, f"{oem}, {omm}")
