"""Executable `reproduce PAPER [--json]`: the paper's published numbers beside ours; needs no running graph.

`--workers N` shares a paper's sweeps out to N processes; `--trials N` and `--music-inside` are doa's, whose tables are
printed from two trials a row unless asked for all 200.  Exit code 0 only if every row holds or carries a measured
explanation.
"""

import argparse
import importlib
import inspect
import json
import pkgutil
import sys
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from contextlib import ExitStack
from dataclasses import asdict
from typing import Any

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
    parser.add_argument("--workers", type=int, metavar="N", help="processes for the paper's sweeps (default: none)")
    parser.add_argument("--trials", type=int, metavar="N", help="doa: trials of every row (the paper's: 200)")
    parser.add_argument("--music-inside", action="store_true", default=None, help="doa: MUSIC at every step and trial")
    options = parser.parse_args(argv)
    rows = _rows(parser, options)
    if options.json:
        print(json.dumps([{**asdict(row), "holds": row.holds} for row in rows], indent=1))
    else:
        print(as_table(rows))
    sys.exit(0 if all(row.accepted for row in rows) else 1)


def _rows(parser: argparse.ArgumentParser, options: argparse.Namespace) -> list[Row]:
    """Return the paper's rows, computed as the options say; refuse an option that the paper has no use for."""
    function: Callable[..., list[Row]] = importlib.import_module(f"rf_pointing.reproduce.{options.paper}").rows
    wanted: dict[str, Any] = {name: getattr(options, name) for name in ("trials", "music_inside")}
    chosen = {name: value for name, value in wanted.items() if value is not None}
    for name, least in (("workers", 1), ("trials", 1)):
        value = getattr(options, name)
        if value is not None and value < least:
            parser.error(f"--{name}={value} must be >= {least}")
    with ExitStack() as stack:
        if options.workers is not None:
            chosen["executor"] = stack.enter_context(ProcessPoolExecutor(options.workers))
        unused = chosen.keys() - inspect.signature(function).parameters.keys()
        if unused:
            flags = {"executor": "--workers", "trials": "--trials", "music_inside": "--music-inside"}
            parser.error(f"{options.paper} has no use for {', '.join(sorted(flags[name] for name in unused))}")
        return function(options.seed, **chosen)
