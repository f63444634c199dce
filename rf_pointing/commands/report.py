"""Executable `report BAG [--output DIR]`: the report of any recorded pass, or its data.

The bag is one of ours, or of `ros2 bag record -a`.  `--export csv|parquet|mat` writes the topics as
tables with a data dictionary, `--export tdm` the tracked angles as a CCSDS message.  `--ledger`
accounts for the pointing loss first, in minutes.  Other packages add pages, see
`rf_pointing.api.recording`.
"""

import argparse
from collections.abc import Callable
from pathlib import Path

from rf_pointing.api.recording import EXPORTS, Recording
from rf_pointing.commands.options import command, ending_with_reason


def request_from(argv: list[str] | None = None) -> Callable[[], list[Path]]:
    """Return the request of a command line: what writes files and returns them."""
    what = "Write the HTML report and the summary of a recorded bag, or export its data."
    parser = command("report", what)
    add = parser.add_argument
    add("bag", type=Path, help="directory of a rosbag2 bag")
    add("--output", type=Path, help="folder to write to (default: the folder of the bag; export below it)")
    add("--export", choices=EXPORTS, help="write the data instead of the report")
    add("--namespace", help="which antenna; needed where the bag holds several")
    add("--ledger", action="store_true", help="find what the loss comes from, in minutes")
    add("--station", metavar="FILE|NAME", help="description for --ledger")
    options = parser.parse_args(argv)
    recording = Recording(options.bag, namespace=options.namespace)
    if options.export:
        return lambda: recording.export(options.export, options.output)
    if options.ledger:
        return lambda: accounted(options, recording)
    return lambda: recording.report(options.output)


def accounted(options: argparse.Namespace, recording: Recording) -> list[Path]:
    """Write the ledger of the pass and the report with it; return the files."""
    # Imported here: a report alone needs no simulation.
    from rf_pointing.api.ledger import ledger

    found = ledger(options.bag, station=options.station, namespace=options.namespace)
    print(found, flush=True)
    return [*found.write(options.output or options.bag.parent), *recording.report(options.output)]


def main(argv: list[str] | None = None) -> None:
    """Entry point of `ros2 run rf_pointing report`."""
    write = request_from(argv)
    with ending_with_reason("report"):
        print(*write(), sep="\n")
