"""Executable `tune`: position loops from identified models, or from the plant of a description.

    scripts/run tune --station my_dish.yaml
    scripts/run tune runs/identification/models.json --station my_dish.yaml --law lqg

Prints margins and wind error, before and after, and the block to paste into the description; block,
picture and LQG designs go to a folder.  Exit code 0: tuned; 2: refused, with the reason.  No graph
is needed.
"""

import argparse
from pathlib import Path

from rf_pointing.api.station import Station
from rf_pointing.api.tuning import tune
from rf_pointing.commands.options import between, command, ending_with_reason, say
from rf_pointing.station.antenna.tuning import MOST_SENSITIVE, USUAL_WIND_M_S
from rf_pointing.station.description import shipped_stations

PROGRAM = "tune"


def arguments() -> argparse.ArgumentParser:
    """Return the parser of the command line."""
    parser = command(PROGRAM, "Tune the position loops of an antenna.")
    add = parser.add_argument
    add("models", metavar="MODELS", nargs="?", type=Path, help="models.json of identify_antenna")
    add("--station", metavar="FILE|NAME", help=f"station description: your file, or {', '.join(shipped_stations())}")
    add("--band", metavar="NAME", help="band of the station (default: the station's)")
    add("--law", choices=("pi", "lqg"), default="pi", help="(default: pi)")
    wind = between(0.5, 60.0)
    add("--wind", type=wind, metavar="M/S", default=USUAL_WIND_M_S, help=f"mean wind (default: {USUAL_WIND_M_S:g})")
    add(
        "--sensitivity", type=between(1.2, 4.0), metavar="PEAK", default=MOST_SENSITIVE,
        help=f"largest |S|, also with the modes 10 %% off (default: {MOST_SENSITIVE:g})",
    )  # fmt: skip
    add("--output", type=Path, default=Path("runs/tuning"), help="folder of the results (default: runs/tuning)")
    return parser


def main(argv: list[str] | None = None) -> None:
    """Entry point of `ros2 run rf_pointing tune`."""
    options = arguments().parse_args(argv)
    with ending_with_reason(PROGRAM):
        station = Station(options.station, options.band) if options.station else None
        tuning = tune(
            station, models=options.models, law=options.law, wind_m_s=options.wind, most_sensitive=options.sensitivity
        )
        files = tuning.write(options.output)
        print(f"{tuning}\n\n{tuning.block(options.output / 'lqg.json')}", end="")
        say(PROGRAM, ", ".join(map(str, files)))
