"""Executable `report BAG [--output DIR]`: report and summary of any recorded pass, ours or `ros2 bag record -a`.

A bag with array sensors gets theirs, `array_report.html`, besides that of its antenna, `report.html`, if it holds one.
"""

import argparse
import sys
from pathlib import Path

from rf_pointing.report import antennas, array_sensors, write_array_report, write_report


def main(argv: list[str] | None = None) -> None:
    """Entry point of `ros2 run rf_pointing report`."""
    parser = argparse.ArgumentParser(
        prog="report", description="Write the HTML report and the summary of a recorded bag."
    )
    parser.add_argument("bag", type=Path, help="directory of a rosbag2 bag")
    parser.add_argument("--output", type=Path, help="folder to write to (default: beside the bag)")
    options = parser.parse_args(argv)
    try:
        written = _write(options.bag, options.output or options.bag.parent)
    except (ValueError, OSError) as error:
        print(f"report: {error}", file=sys.stderr)
        sys.exit(2)
    print(*written, sep="\n")


def _write(bag: Path, folder: Path) -> list[Path]:
    written = []
    if array_sensors(bag):
        write_array_report(bag, folder)
        written.append(folder / "array_report.html")
    if antennas(bag) or not written:
        write_report(bag, folder)
        written.append(folder / "report.html")
    return written
