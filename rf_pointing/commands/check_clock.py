"""Executable `check_clock BAG...`: whether the clock is right, and what is late in the station.

    scripts/run check_clock runs/*/bag
    scripts/run check_clock night/ --station my_dish.yaml

Exit code 0: no error of the clock is seen; 1: the clock is wrong; 2: refused, or no recording
shows anything.  No graph is needed.
"""

import argparse
import sys
from pathlib import Path

from rf_pointing.api.clock import check_clock
from rf_pointing.api.replay import bags_of
from rf_pointing.commands.options import command, ending_with_reason

PROGRAM = "check_clock"


def arguments() -> argparse.ArgumentParser:
    """Return the parser of the command line."""
    what = "Find the error of a station's clock in recorded passes, and how late its parts are."
    parser = command(PROGRAM, what)
    add = parser.add_argument
    add("bags", type=Path, nargs="+", metavar="BAG|FOLDER", help="recordings, or folders of them")
    add("--station", metavar="FILE|NAME", help="description (default: that next to the bag)")
    add("--namespace", help="which antenna; needed where a bag holds several")
    return parser


def main(argv: list[str] | None = None) -> None:
    """Entry point of `ros2 run rf_pointing check_clock`."""
    options = arguments().parse_args(argv)
    with ending_with_reason(PROGRAM):
        bags = [bag for each in options.bags for bag in bags_of(each)]
        found = check_clock(bags, station=options.station, namespace=options.namespace)
        print(found)
        sys.exit(1 if found.wrong else 0 if found.passes else 2)
