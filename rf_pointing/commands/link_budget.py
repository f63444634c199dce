"""Executable `link_budget`: system noise, G/T and C/N0 of a band, over elevation or along a pass.

    scripts/run link_budget --station my_dish.yaml --band S
    scripts/run link_budget --station my_dish.yaml --along-pass --satellite 25544 --picture x.png

The numbers are those that the simulated receiver and the certificate count with.  No graph is
needed.
"""

import argparse
from pathlib import Path

from rf_pointing.api.link_budget import LinkBudgetTable
from rf_pointing.commands.options import add_options, command, ending_with_reason, requested, say_of_elements, written

PROGRAM = "link_budget"


def arguments() -> argparse.ArgumentParser:
    """Return the parser of the command line."""
    parser = command(PROGRAM, "Print the link budget of a band of a station.")
    add_options(parser, "elements interpolation satellite station band start mask")
    add = parser.add_argument
    add("--along-pass", action="store_true", help="along the first pass of --satellite, Sun and Moon included")
    add("--json", action="store_true", help="print JSON")
    add("--picture", type=Path, metavar="FILE", help="draw the budget into this PNG")
    return parser


def main(argv: list[str] | None = None) -> None:
    """Entry point of `ros2 run rf_pointing link_budget`."""
    with ending_with_reason(PROGRAM):
        given = requested(arguments, dict, argv)
        station, target, found = given["station"], given["target"], [None]
        if given["along_pass"]:
            say_of_elements(target)
            found = station.passes(target, start_t_s=given["start_s"], mask_deg=given["mask_deg"])
        if not found:
            raise ValueError(f"{target.name} has no pass over {station.name} in the 24 h after --start")
        table = LinkBudgetTable.of(station, found[0])
        print(table.to_json() if given["json"] else table)
        written(PROGRAM, given["picture"], table.draw)
