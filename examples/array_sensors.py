#!/usr/bin/env python3
"""Run the array sensors on a live graph, record them, and report estimates and truth.

    scripts/run-python examples/array_sensors.py [--system tripulse] [--seconds 25] [--output runs/array_sensors]

For every system: its nodes as processes of their own, a bag of all its topics, and the report of that bag.
"""

import argparse
import sys
from pathlib import Path

import rclpy

from rf_pointing.array_sensors.nodes.array_graph import ARRAY_SYSTEMS, record_system
from rf_pointing.array_sensors.report.page import ArrayErrors, write_array_report


def summary(found: ArrayErrors) -> str:
    """Return one line on the errors of a sensor."""
    if found.rms is None:
        return f"{found.sensor} {found.quantity}: none of {found.epochs} epochs is valid"
    rms, claimed = (" ".join(f"{value:.3g}" for value in values) for values in (found.rms, found.claimed or ()))
    return (
        f"{found.sensor} {found.quantity}: {found.valid} of {found.epochs} epochs valid, rms {rms} {found.unit}, "
        f"claimed {claimed} {found.unit}, {100.0 * (found.inside or 0.0):.1f} % inside 3 sigma"
    )


def main() -> None:
    """Run the chosen systems one after the other."""
    parser = argparse.ArgumentParser(description="Record the array sensors on a live graph and draw their errors.")
    parser.add_argument("--system", choices=tuple(ARRAY_SYSTEMS), action="append", help="which (default: all)")
    parser.add_argument("--seconds", type=float, default=25.0, help="length of each recording, at least (default: 25)")
    parser.add_argument(
        "--output", type=Path, default=Path("runs/array_sensors"), help="new folder (default: %(default)s)"
    )
    options = parser.parse_args()
    if options.output.exists():
        sys.exit(f"array_sensors: output={options.output} exists already")
    options.output.mkdir(parents=True)
    rclpy.init()
    for name in options.system or ARRAY_SYSTEMS:
        recorded = record_system(name, options.seconds, options.output)
        problem = f"; {recorded.problem}" if recorded.problem else ""
        print(f"{name}: {recorded.message_count} messages in {recorded.path}{problem}")
        for errors in write_array_report(recorded.path, options.output / name):
            print(summary(errors))
        print(options.output / name / "array_report.html")
    rclpy.shutdown()


if __name__ == "__main__":
    main()
