#!/usr/bin/env python3
"""Run the array sensors on a live graph, record them, and draw what they found beside the truth.

    scripts/run-python examples/array_sensors.py [--system tripulse] [--seconds 25] [--output runs/array_sensors]

For every system: its nodes as processes of their own, a bag of all its topics, and one picture.
"""

import argparse
import sys
from pathlib import Path

import numpy as np
import rclpy

from rf_pointing.nodes.array_graph import ArrayGraph
from rf_pointing.nodes.array_systems import ARRAY_SYSTEMS
from rf_pointing.nodes.managed import make_executor
from rf_pointing.nodes.recorder import Recorder
from rf_pointing.report.array_pictures import draw_attitude, draw_pose
from rf_pointing.report.array_series import ArraySeries, read_attitude_series, read_pose_series

SPEEDS = {"tripulse": 20.0, "doa": 10.0, "interferometer": 20.0}
TITLES = {
    "tripulse": "Tripulse: attitude of a geosynchronous satellite's array from two stations",
    "doa": "DOA: attitude of a satellite that hears ground stations, from 45 deg off",
    "interferometer": "Polarized interferometer: pose of the passive spacecraft, approach from 2 km",
}


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


def show(name: str, bag: Path, picture: Path) -> None:
    """Draw the picture of one bag and print what it shows."""
    if name == "interferometer":
        series = read_pose_series(bag, f"/{name}")
        draw_pose(series, picture, TITLES[name])
        report(f"{name} position", series.position_error_m, series.position_sigma_m, series, "m")
    else:
        series = read_attitude_series(bag, f"/{name}")
        draw_attitude(series, picture, TITLES[name])
    report(
        f"{name} attitude", np.degrees(series.rotation_error_rad), np.degrees(series.rotation_sigma_rad), series, "deg"
    )
    print(f"{name}: picture {picture}")


def report(what: str, error: np.ndarray, sigma: np.ndarray, series: ArraySeries, unit: str) -> None:
    """Print rms errors, median sigmas and the share inside three sigma of the valid epochs."""
    valid = series.valid
    if not valid.any():
        print(f"{what}: none of {len(valid)} epochs is valid")
        return
    rms, middle = np.sqrt(np.mean(error[valid] ** 2, axis=0)), np.median(sigma[valid], axis=0)
    inside = float(np.mean(np.abs(error[valid]) <= 3.0 * sigma[valid]))
    print(
        f"{what}: {int(valid.sum())} of {len(valid)} epochs valid, rms {np.array2string(rms, precision=3)} {unit}, "
        f"median sigma {np.array2string(middle, precision=3)} {unit}, {100.0 * inside:.1f} % inside 3 sigma"
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
        show(name, record(name, options.seconds, options.output), options.output / f"{name}.png")
    rclpy.shutdown()


if __name__ == "__main__":
    main()
