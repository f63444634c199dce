"""Executable `report BAG [--output DIR]`: the report of any recorded pass.

The bag is one of ours, or of `ros2 bag record -a`.

Other packages add pages through the entry point group `rf_pointing.reports`: a function of bag and
folder that writes its page and returns the path, or None if the bag has no data for it.
"""

import argparse
from importlib.metadata import entry_points
from pathlib import Path

from rf_pointing.commands.options import ending_with_reason
from rf_pointing.report import antennas, write_report


def main(argv: list[str] | None = None) -> None:
    """Entry point of `ros2 run rf_pointing report`."""
    what = "Write the HTML report and the summary of a recorded bag."
    parser = argparse.ArgumentParser(prog="report", description=what)
    parser.add_argument("bag", type=Path, help="directory of a rosbag2 bag")
    parser.add_argument("--output", type=Path, help="folder to write to (default: the folder of the bag)")
    options = parser.parse_args(argv)
    with ending_with_reason("report"):
        print(*_write(options.bag, options.output or options.bag.parent), sep="\n")


def _write(bag: Path, folder: Path) -> list[Path]:
    pages = [entry.load()(bag, folder) for entry in entry_points(group="rf_pointing.reports")]
    written = [page for page in pages if page is not None]
    # Without any page, `write_report` states what the bag lacks.
    if antennas(bag) or not written:
        write_report(bag, folder)
        written.append(folder / "report.html")
    return written
