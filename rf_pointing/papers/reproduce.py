"""Executable `reproduce PAPER [--json]`: a paper's published numbers and ours; needs no graph.

`--workers N` distributes a paper's sweeps over N processes, `--dask ADDRESS` over the cluster of
that scheduler.  `--trials N` and `--music-inside` belong to doa, whose tables default to two trials
a row instead of 200.  The exit code is 0 only if every row holds or carries a measured explanation.
"""

import argparse
import importlib
import inspect
import json
import sys
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import asdict
from typing import Any

from rf_pointing.commands.options import seed
from rf_pointing.papers import Row, as_table
from rf_pointing.papers.sweeps import processes

# A wrong address must end the command soon; the cluster itself may take hours afterwards.
DASK_TIMEOUT_S = "10s"


PAPERS = (
    "autotrack",
    "conscan",
    "doa",
    "interferometer",
    "monopulse",
    "nco",
    "network",
    "orbit",
    "receive",
    "satcal",
    "sensors",
    "servo",
    "tripulse",
)
"""The papers by the name of the module with their rows."""


def main(argv: list[str] | None = None) -> None:
    """Entry point of `ros2 run rf_pointing reproduce`."""
    parser = argparse.ArgumentParser(
        allow_abbrev=False,
        prog="reproduce",
        description="Print a paper's published numbers and ours.",
    )
    parser.add_argument("paper", choices=PAPERS, help="which paper's tables")
    parser.add_argument("--json", action="store_true", help="print the rows as JSON")
    parser.add_argument(
        "--seed", type=seed, default=1, help="seed of every random number (default: 1)"
    )
    parser.add_argument(
        "--workers", type=int, metavar="N", help="processes for the paper's sweeps (default: none)"
    )
    parser.add_argument(
        "--dask",
        metavar="ADDRESS",
        help="scheduler of a Dask cluster for the sweeps (extra `sweep`)",
    )
    parser.add_argument(
        "--trials", type=int, metavar="N", help="doa: trials of every row (the paper's: 200)"
    )
    parser.add_argument(
        "--music-inside",
        action="store_true",
        default=None,
        help="doa: MUSIC at every step and trial",
    )
    options = parser.parse_args(argv)
    rows = _rows(parser, options)
    if options.json:
        print(
            json.dumps(
                [{**asdict(row), "holds": row.holds, "explained": row.explained} for row in rows],
                indent=1,
            )
        )
    else:
        print(as_table(rows))
    # Explained rows count: the exit code is for scripts that watch for a regression.
    sys.exit(0 if all(row.accepted for row in rows) else 1)


def _rows(parser: argparse.ArgumentParser, options: argparse.Namespace) -> list[Row]:
    """Return the paper's rows, computed as the options say."""
    # Imported by name: a paper with heavy libraries costs nothing until it is requested.
    function: Callable[..., list[Row]] = importlib.import_module(
        f"rf_pointing.papers.{options.paper}"
    ).rows
    _refuse_misuse(parser, options, set(inspect.signature(function).parameters))
    wanted: dict[str, Any] = {name: getattr(options, name) for name in ("trials", "music_inside")}
    chosen = {name: value for name, value in wanted.items() if value is not None}
    with ExitStack() as stack:
        if options.workers is not None:
            chosen["executor"] = stack.enter_context(processes(options.workers))
        elif options.dask is not None:
            chosen["executor"] = stack.enter_context(
                _dask_client(parser, options.dask)
            ).get_executor()
        return function(options.seed, **chosen)


def _refuse_misuse(
    parser: argparse.ArgumentParser, options: argparse.Namespace, understood: set[str]
) -> None:
    """End with exit code 2 on numbers below one, two places for the sweeps, or options the paper
    has no use for.
    """
    for name in ("workers", "trials"):
        value = getattr(options, name)
        if value is not None and value < 1:
            parser.error(f"--{name}={value} must be >= 1")
    if options.workers is not None and options.dask is not None:
        parser.error("--workers and --dask are two places for the same sweeps: choose one")
    parameters = {
        "workers": "executor",
        "dask": "executor",
        "trials": "trials",
        "music_inside": "music_inside",
    }
    given = [name for name in parameters if getattr(options, name) is not None]
    # An option that the paper ignores would make its numbers look like those requested.
    unused = [f"--{name.replace('_', '-')}" for name in given if parameters[name] not in understood]
    if unused:
        parser.error(f"{options.paper} has no use for {', '.join(unused)}")


def _dask_client(parser: argparse.ArgumentParser, address: str) -> Any:
    """Return a client of the Dask scheduler at `address`."""
    try:
        return importlib.import_module("distributed").Client(address, timeout=DASK_TIMEOUT_S)
    except ImportError:
        parser.error("--dask needs the extra `sweep`: pip install dask distributed")
    except (OSError, ValueError) as error:
        parser.error(f"--dask={address}: {error}")


if __name__ == "__main__":
    main()
