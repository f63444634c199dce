"""Executable `simulate`: passes of days or years of a station that need not exist yet.

    scripts/run simulate --station my_dish.yaml --days 30 --trials 10
    scripts/run simulate --station my_dish.yaml --days 365 --satellites list.txt --output year.jsonl

Availability, loss, what the zenith and late slews cost, starts of the motors: for choosing a mount,
a band or a site.  Ctrl-C keeps what is done, and the same command goes on.  No graph is needed.
"""

import argparse
import sys
from pathlib import Path
from typing import Any

from rf_pointing.api.ensemble import ensemble
from rf_pointing.api.satellite_list import satellites
from rf_pointing.commands.options import add_options, command, ending_with_reason, requested, say

PROGRAM = "simulate"


def arguments() -> argparse.ArgumentParser:
    """Return the parser of the command line."""
    parser = command(PROGRAM, "Fly every pass of some days with wind, noise and old elements.")
    add_options(
        parser, "elements satellite station band start min-peak seed output",
        min_peak="only passes that rise to this elevation, in deg",
        output={"metavar": "FILE", "help": "keep a line of JSON for every pass, and go on"},
    )  # fmt: skip
    parser.set_defaults(min_peak_deg=0.0, seed=1)
    add = parser.add_argument
    add("--days", type=float, default=1.0, help="length in days (default: 1)")
    add("--trials", type=int, default=1, help="how often each pass is flown (default: 1)")
    add("--satellites", type=Path, metavar="LIST", help="satellites in place of --satellite")
    add("--sensor", help="of the passes (default: the station's)")
    add("--workers", type=int, help="processes (default: one for each processor)")
    return parser


def main(argv: list[str] | None = None) -> None:
    """Entry point of `ros2 run rf_pointing simulate`."""
    with ending_with_reason(PROGRAM):
        given: dict[str, Any] = requested(arguments, dict, argv)
        target, listed = given.pop("target"), given.pop("satellites")
        targets = [target] if listed is None else satellites(target.location, [str(listed)])
        given["start_t_s"] = given.pop("start_s")
        found = ensemble(
            given.pop("station"), targets, **given,
            progress=lambda done, whole: say(PROGRAM, f"{done} of {whole} passes"),
        )  # fmt: skip
        print(found)
    if len(found.rows) < found.planned:
        say(PROGRAM, f"interrupted after {len(found.rows)} of {found.planned} passes", "ERROR")
        sys.exit(130)
