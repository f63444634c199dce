#!/usr/bin/env python3
"""Run the array sensors on a live graph, record them, and report estimates and truth.

    scripts/run-python examples/array_sensors.py [--system tripulse] [--seconds 25] [--output runs/array_sensors]

For every system: its nodes as processes of their own, a bag of all its topics, and the report of that bag.
"""

import argparse
import sys
from pathlib import Path

import rclpy

from rf_pointing.array_sensors.nodes.array_graph import ARRAY_SYSTEMS, ArrayGraph
from rf_pointing.array_sensors.report.page import ArrayErrors, write_array_report
from rf_pointing.ros.main_loop import make_executor
from rf_pointing.ros.recorder import Recorder

SPEEDS = {"tripulse": 20.0, "doa": 10.0, "interferometer": 20.0}


def record(name: str, seconds: float, output: Path) -> Path:
    """Run one system for `seconds` at its speed and return its bag."""
    node = rclpy.create_node(f"{name}_example")
    executor = make_executor()
    executor.add_node(node)
    system = ARRAY_SYSTEMS[name]

    def spin(timeout_s: float) -> None:
        executor.spin_once(timeout_sec=timeout_s)

    recorder = Recorder(node, f"/{name}", output / f"{name}_bag", system.topics)
    try:
        with ArrayGraph(system, node, spin, output / "logs" / name, speed=SPEEDS[name]) as graph:
            graph.bring_up()
            graph.run_time()
            end_s = graph.now_s + seconds * SPEEDS[name]
            while graph.now_s < end_s:
                graph.check()
                graph.spin(0.05)
    finally:
        recorded = recorder.close()
        executor.shutdown()
        node.destroy_node()
    print(
        f"{name}: {recorded.message_count} messages in {recorded.path}{'; ' + recorded.problem if recorded.problem else ''}"
    )
    return recorded.path


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
        bag = record(name, options.seconds, options.output)
        for errors in write_array_report(bag, options.output / name):
            print(summary(errors))
        print(options.output / name / "array_report.html")
    rclpy.shutdown()


if __name__ == "__main__":
    main()
