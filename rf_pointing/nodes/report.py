"""Executable `report BAG [--output DIR]`: the HTML report and summary of any recorded pass, ours or `ros2 bag record -a`."""

import argparse
import sys
from pathlib import Path

from rf_pointing.report import write_report


def main(argv: list[str] | None = None) -> None:
    """Entry point of `ros2 run rf_pointing report`."""
    parser = argparse.ArgumentParser(prog="report", description="Write report.html and summary.json of a recorded bag.")
    parser.add_argument("bag", type=Path, help="directory of a rosbag2 bag")
    parser.add_argument("--output", type=Path, help="folder to write to (default: beside the bag)")
    options = parser.parse_args(argv)
    folder: Path = options.output or options.bag.parent
    try:
        write_report(options.bag, folder)
    except (ValueError, OSError) as error:
        print(f"report: {error}", file=sys.stderr)
        sys.exit(2)
    print(folder / "report.html")
