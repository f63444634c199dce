"""Executable `budget`: what will cost pointing loss in a pass, before the first one is tracked.

    scripts/run budget --station my_dish.yaml
    scripts/run budget --station leo_3m7 --wind 12 --late 0.3 --output runs/budget

The pass is simulated some seven times, each time without one more cause.  No graph is needed.
"""

import argparse
from typing import Any

from rf_pointing.api.ledger import budget
from rf_pointing.commands.options import add_options, command, ending_with_reason, requested, say

PROGRAM = "budget"


def arguments() -> argparse.ArgumentParser:
    """Return the parser of the command line."""
    parser = command(PROGRAM, "Predict what the pointing loss of a pass will come from.")
    add_options(
        parser, "elements interpolation satellite station band start mask min-peak seed output",
        min_peak="take the first pass that rises to this elevation, in deg (default: 40)",
        output="write ledger.json and ledger.png into this folder",
    )  # fmt: skip
    parser.set_defaults(min_peak_deg=40.0, seed=1)
    add = parser.add_argument
    add("--sensor", help="of the pass (default: the station's)")
    add("--minutes", type=float, help="only the first minutes of the pass")
    add("--late", dest="late_s", metavar="S", type=float, help="satellite ahead of its elements by")
    add("--wind", dest="wind_m_s", metavar="M_S", type=float, help="mean wind")
    return parser


def main(argv: list[str] | None = None) -> None:
    """Entry point of `ros2 run rf_pointing budget`."""
    with ending_with_reason(PROGRAM):
        given: dict[str, Any] = requested(arguments, dict, argv)
        station, target, output = (given.pop(name) for name in ("station", "target", "output"))
        search = {"start_t_s": given.pop("start_s"), "days": 3.0}
        search |= {name: given.pop(name) for name in ("mask_deg", "min_peak_deg")}
        passes = station.passes(target, **search)
        if not passes:
            raise ValueError(f"{target.name} does not rise that high within 3 days")
        found = budget(passes[0], **given)
        print(found)
        if output is not None:
            say(PROGRAM, ", ".join(map(str, found.write(output))))
