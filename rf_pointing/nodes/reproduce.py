"""Executable `reproduce PAPER [--json]`: the paper's published numbers beside ours; needs no running graph.

Exit code 0 only if every row holds or carries a measured explanation.
"""

import argparse
import importlib
import json
import pkgutil
import sys
from dataclasses import asdict

from rf_pointing import reproduce
from rf_pointing.reproduce import Row, as_table


def papers() -> list[str]:
    """Return the names that can be reproduced; a module with an underscore in its name is a part of one."""
    names = [module.name for module in pkgutil.iter_modules(reproduce.__path__)]
    return sorted(name for name in names if name not in ("row", "table") and "_" not in name)


def main(argv: list[str] | None = None) -> None:
    """Entry point of `ros2 run rf_pointing reproduce`."""
    parser = argparse.ArgumentParser(prog="reproduce", description="Print a paper's published numbers beside ours.")
    parser.add_argument("paper", choices=papers(), help="which paper's tables")
    parser.add_argument("--json", action="store_true", help="print the rows as JSON")
    parser.add_argument("--seed", type=int, default=1, help="seed of every random number (default: 1)")
    options = parser.parse_args(argv)
    rows: list[Row] = importlib.import_module(f"rf_pointing.reproduce.{options.paper}").rows(options.seed)
    if options.json:
        print(json.dumps([{**asdict(row), "holds": row.holds} for row in rows], indent=1))
    else:
        print(as_table(rows))
    sys.exit(0 if all(row.accepted for row in rows) else 1)
