"""Executable `link_budget`: system noise, G/T and C/N0 of a band, over elevation or along a pass.

    scripts/run link_budget --station my_dish.yaml --band S
    scripts/run link_budget --station my_dish.yaml --along-pass --satellite 25544 --picture x.png

The numbers are those that the simulated receiver and the certificate count with.  No graph is
needed.
"""

import argparse

from rf_pointing.api.link_budget import LinkBudgetTable
from rf_pointing.api.station import Station
from rf_pointing.commands.options import add_target_options, ending_with_reason, say, target_from
from rf_pointing.core.dates import parse_utc

PROGRAM = "link_budget"


def main(argv: list[str] | None = None) -> None:
    """Entry point of `ros2 run rf_pointing link_budget`."""
    parser = argparse.ArgumentParser(prog=PROGRAM, description="Print the link budget of a band of a station.")
    add_target_options(parser)
    add = parser.add_argument
    add("--along-pass", action="store_true", help="along the first pass of --satellite, Sun and Moon included")
    add("--json", action="store_true", help="print JSON")
    add("--picture", metavar="FILE", help="draw the budget into this PNG")
    options = parser.parse_args(argv)
    with ending_with_reason(PROGRAM):
        station, one = Station(options.station, options.band), None
        if options.along_pass:
            target = target_from(options.elements, options.satellite, options.interpolation)
            start_t_s = parse_utc(options.start) if options.start else None
            found = station.passes(target, start_t_s=start_t_s, mask_deg=options.mask)
            if not found:
                raise ValueError(f"{target.name} has no pass over {station.name} in the 24 h after --start")
            one = found[0]
        table = LinkBudgetTable.of(station, one)
        print(table.to_json() if options.json else table)
        if options.picture:
            table.draw(options.picture)
            say(PROGRAM, options.picture)
