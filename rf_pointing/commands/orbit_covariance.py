"""Executable `orbit_covariance`: how well a network would know an orbit, before it is built.

    scripts/run orbit_covariance --stations leo_3m7 Svalbard=78.2,15.4 --tracking angle_mdeg=3

It answers which network, which noise, how long: sigma in radius, along and across the track while
it is tracked and predicted, what else spoils it, and how well it is known at the first station's
next passes.

Exit code 0: the covariance was printed; 2: the tracking does not determine the orbit, or is wrong.
"""

import argparse
from pathlib import Path

from rf_pointing.api.orbit_study import UNITS, Place, orbit_covariance
from rf_pointing.api.station import Station
from rf_pointing.api.target import Target
from rf_pointing.commands.options import add_options, between, command, ending_with_reason, refusing, say_of_elements
from rf_pointing.orbit.study import Considered
from rf_pointing.station.log_lines import say

PROGRAM = "orbit_covariance"


def _place(text: str) -> Place:
    name, sign, rest = text.partition("=")
    if not sign:
        return Station(text)
    try:
        latitude, longitude = map(float, rest.split(","))
    except ValueError:
        why = f"stations={text!r} must be a description, or NAME=LATITUDE,LONGITUDE in deg"
        raise ValueError(why) from None
    return name, latitude, longitude


def _word(text: str) -> tuple[str, float]:
    name, _, value = text.partition("=")
    try:
        return name, float(value)
    except ValueError:
        why = f"tracking={text!r} must be a word and its number, as range_m=10"
        raise ValueError(why) from None


def arguments() -> argparse.ArgumentParser:
    """Return the parser of the command line."""
    parser = command(PROGRAM, "Print what a network would know of an orbit.")
    add = parser.add_argument
    add("--stations", nargs="+", required=True, type=refusing(_place),
    metavar="FILE|NAME|NAME=LAT,LON",
        help="descriptions, or places; the first one looks at the satellite again")  # fmt: skip
    add("--tracking", nargs="+", required=True, type=refusing(_word), metavar="WORD=NUMBER",
        help=f"what each measures: {', '.join(UNITS)}")  # fmt: skip
    add_options(parser, "elements satellite start",
        start="begin of the tracking (default: the elements' epoch)")  # fmt: skip
    add("--hours", type=between(0.1, 240.0), default=24.0, help="of tracking (default: 24)")
    add("--predict", type=between(0.0, 240.0), default=24.0, metavar="HOURS",
        help="after the tracking (default: 24)")  # fmt: skip
    add("--station-error", type=between(0.0, 1e4), default=0.1, metavar="M",
        help="of coordinates (default: 0.1)")  # fmt: skip
    add("--clock-error", type=between(0.0, 10.0), default=0.0, metavar="S",
        help="of stations (default: 0)")  # fmt: skip
    add("--json", action="store_true", help="print JSON")
    add("--picture", type=Path, metavar="FILE", help="draw the sigmas into this PNG")
    return parser


def main(argv: list[str] | None = None) -> None:
    """Entry point of `ros2 run rf_pointing orbit_covariance`."""
    with ending_with_reason(PROGRAM):
        options = arguments().parse_args(argv)
        target = Target(location=options.elements, satellite=options.satellite)
        say_of_elements(target)
        known = orbit_covariance(
            target, options.stations, dict(options.tracking), start_t_s=options.start_s,
            hours=options.hours,
            predict_hours=options.predict,
            considered=Considered(station_m=options.station_error, clock_s=options.clock_error),
        )  # fmt: skip
        print(known.to_json() if options.json else known)
        if options.picture:
            known.draw(options.picture)
            say(PROGRAM, str(options.picture))
