"""Executable `replay BAG|FOLDER`: recorded passes once more, as they were and with changes.

    scripts/run replay runs/28057-20060627T045843-01 --law lqg
    scripts/run replay nights/ --params new_gains.yaml --allow "rms elevation=0.2"

A folder of bags is a suite.  Exit code 0: every pass is reproduced and none got worse; 1: one is
not reproduced, or worse than allowed; 2: refused, or nothing could be replayed; 130: interrupted.
Tables and pictures go to a folder; one that cannot be written costs them alone.  No graph is
needed.
"""

import argparse
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from rf_pointing.api.replay import WINDS, WORSE, bags_of, replay
from rf_pointing.commands.options import command, ending_with_reason, named, refusing, say

PROGRAM = "replay"
OWN = ("station", "params", "model", "law", "estimator", "sensor", "wind", "namespace")


def _allowed(text: str) -> tuple[str, float]:
    """Return metric and amount of `METRIC=AMOUNT`."""
    name, _, amount = text.partition("=")
    if name not in WORSE:
        raise ValueError(f"{name!r} must be one of {', '.join(WORSE)}")
    return name, float(amount)


def arguments() -> argparse.ArgumentParser:
    """Return the parser of the command line."""
    usual = ", ".join(f"{name}={amount:g}" for name, amount in WORSE.items())
    parser = command(PROGRAM, "Replay recorded passes, as they were and with other parameters.")
    add = parser.add_argument
    add("bag", type=Path, metavar="BAG|FOLDER", help="a recording, or a folder of them")
    add("--params", type=Path, metavar="FILE", help="changed parameters, a ROS parameter file")
    add("--model", type=Path, metavar="FILE", help="changed bias model")
    add("--law", choices=("pi", "lqg"), help="changed position law")
    add("--estimator", choices=("linear", "likelihood"), help="changed estimator of the scan")
    add("--sensor", help="changed sensor of the pass")
    add("--station", metavar="FILE|NAME", help="description (default: station.yaml next to the bag)")
    add("--wind", type=named(WINDS), default="auto", help=f"{', '.join(WINDS)} (default: auto)")
    add("--namespace", help="which antenna; needed where the bag holds several")
    add(
        "--allow", type=refusing(_allowed), action="append", default=[], metavar="METRIC=AMOUNT",
        help=f"by how much a metric may get worse, may be repeated (default: {usual})",
    )  # fmt: skip
    place = Path("runs/replay")
    add("--output", type=Path, metavar="DIR", default=place, help=f"of results (default: {place})")
    return parser


def replayed(
    bag: Path, given: Mapping[str, Any], allowed: Mapping[str, float], folder: Path
) -> int:  # fmt: skip
    """Replay one bag, print and keep it; return 0, or 1 where it does not pass, 2 if refused."""
    try:
        found = replay(bag, **given)
    except (ValueError, OSError) as error:
        say(PROGRAM, f"{bag}: {error}", "ERROR")
        return 2
    print(found, flush=True)
    try:
        say(PROGRAM, ", ".join(map(str, found.write(folder))))
    except OSError as error:
        say(PROGRAM, f"not written: {error}", "ERROR")
    other = [each for each in found.checks if not each.same]
    said = [f"{each.loop} loop, {each.topic}: {each.reason}" for each in other]
    said += found.worse(allowed)
    for text in said:
        say(PROGRAM, f"{bag}: {text}", "ERROR")
    return 1 if said else 0


def main(argv: list[str] | None = None) -> None:
    """Entry point of `ros2 run rf_pointing replay`."""
    options = arguments().parse_args(argv)
    given, allowed = {name: getattr(options, name) for name in OWN}, WORSE | dict(options.allow)
    codes: dict[Path, int] = {}
    with ending_with_reason(PROGRAM):
        bags = bags_of(options.bag)
        try:
            for bag in bags:
                alone = len(bags) == 1
                place = bag if bag == options.bag else bag.relative_to(options.bag)
                folder = options.output if alone else options.output / place
                codes[bag] = replayed(bag, given, allowed, folder)
        except KeyboardInterrupt:
            say(PROGRAM, f"interrupted after {len(codes)} of {len(bags)} recordings", "ERROR")
            sys.exit(130)
    passed = sum(code == 0 for code in codes.values())
    refused = sum(code == 2 for code in codes.values())
    say(PROGRAM, f"{passed} of {len(codes)} recordings passed, {refused} could not be replayed")
    # A suite of which one recording is refused has not passed; one that is all refused is nothing.
    sys.exit(2 if refused == len(codes) else 1 if passed < len(codes) else 0)
