"""Speed of the servo.  Run: scripts/run-python -m benchmarks.servo [--runs N] [--workers N]

Prints each figure with the ratio asked for, all measured in this run, in processor time: what others do on the same
machine changes little.  The exit status says whether every ratio that could be measured is kept.  Without rclpy the
node's figures are left out and named.
"""

import argparse
import importlib.util
import os
import sys
import time
from collections.abc import Callable

import numpy as np

from rf_pointing.controllers import dss13_loops
from rf_pointing.core import JointTrajectory
from rf_pointing.papers.headless_servo import ServoRunSetup, run_servo, servo_monte_carlo
from rf_pointing.papers.servo_trajectory import LowOrbitPass
from rf_pointing.servo import WindParams, dss13_plant
from rf_pointing.station.antenna.simulated_antenna import AntennaParams, SimulatedAntenna

TICK_S, STEP_S = 0.02, 0.001
PLAIN_RATIO, TICK_SHARE = 25.0, 0.10
TICKS = 3000


def processor_s() -> float:
    """Return the processor time of this process with its threads, and of the processes that it has waited for."""
    times = os.times()
    return time.process_time() + times.children_user + times.children_system


def seconds(task: Callable[[], object], repeats: int = 3) -> float:
    """Return the least processor time of some runs."""
    times = []
    for _ in range(repeats):
        start = processor_s()
        task()
        times.append(processor_s() - start)
    return min(times)


def setup(duration_s: float) -> ServoRunSetup:
    """All effects, 1-kHz plant steps, 50-Hz loops, 8 m/s of wind, on a pass."""
    motion = LowOrbitPass().at(-60.0 + TICK_S * np.arange(round(duration_s / TICK_S)))
    return ServoRunSetup(
        position_rad=motion.position_rad,
        velocity_rad_s=motion.velocity_rad_s,
        acceleration_rad_s2=motion.acceleration_rad_s2,
        plant=dss13_plant().replace(substep_s=STEP_S),
        loops=dss13_loops("tuned"),
        wind=WindParams(mean_speed_m_s=8.0),
    )


def line(name: str, value: float, asked: float | None, unit: str) -> bool:
    """Print one figure; return whether it is at least what is asked (None: for information)."""
    kept = asked is None or value >= asked
    wish = "" if asked is None else f"   asked >= {asked:g}   {'kept' if kept else 'MISSED'}"
    print(f"{name:<68} {value:10.4g} {unit}{wish}", flush=True)
    return kept


def closed_loop() -> bool:
    """Headless two-axis closed loop against real time."""
    case = setup(40.0)
    return line("closed loop, 1-kHz plant", 40.0 / seconds(lambda: run_servo(case)), PLAIN_RATIO, "x real time")


def monte_carlo(runs: int, workers: int) -> bool:
    """Batched runs on one worker and on several: the work must not grow with the workers, then cores divide its time."""
    case = setup(10.0)
    alone = seconds(lambda: servo_monte_carlo(case, range(runs), workers=1), 1)
    began_s = time.perf_counter()
    shared = seconds(lambda: servo_monte_carlo(case, range(runs), workers=workers), 1)
    wall_s = time.perf_counter() - began_s
    line(f"Monte Carlo, {runs} runs of 10 s, one worker", alone, None, "s")
    line(f"Monte Carlo, {runs} runs of 10 s, {workers} workers, of all cores together", shared, None, "s")
    line("  cores kept busy, on average (wall clock)", shared / wall_s, None, "cores")
    return line("  work on one worker over work on several", alone / shared, 0.8, "1")


def tick() -> bool:
    """What the simulated antenna spends per 50-Hz tick while it follows commands in wind, as the node runs it."""
    antenna = SimulatedAntenna(AntennaParams(wind=WindParams(mean_speed_m_s=8.0)))
    antenna.enable()
    return tick_lines("antenna", lambda k: antenna.step(TICK_S * k), lambda k: antenna.accept(ramp(k), TICK_S * k))


def node_lines() -> bool:
    """Return whether the node, with its messages and publishers, keeps the same; print what a message costs."""
    if importlib.util.find_spec("rclpy") is None:
        print("50-Hz tick of the node: rclpy is not installed")
        return True
    import rclpy
    from rclpy.serialization import serialize_message
    from rf_pointing_msgs.msg import Target

    from rf_pointing.nodes.antenna_servo import AntennaServo
    from rf_pointing.ros import convert
    from rf_pointing.ros.lifecycle import Schedule
    from rf_pointing.ros.qos import STREAM

    class Ticked(AntennaServo):
        """Ticks when it is called, at its own time."""

        t_s = 1.2e9

        def now_s(self) -> float:
            return self.t_s

        def every(self, period_s: float, callback: Callable[[float], None], **_catches_up: bool) -> Schedule:
            self.tick = callback
            return Schedule(self.t_s, period_s)

    rclpy.init(args=["--ros-args", "-r", "__ns:=/benchmark", "-p", "station:=dss13"])
    node = Ticked()
    try:
        node.trigger_configure()
        node.trigger_activate()
        node.listen(Target, "target", str, STREAM)
        doors = {each.topic_name.rpartition("/")[2]: each.callback for each in node.subscriptions}

        def message(k: int) -> bytes:
            return bytes(serialize_message(convert.trajectory_to_message(ramp(k, 1.2e9), 1.2e9 + TICK_S * k)))

        def step(k: int) -> None:
            node.t_s = 1.2e9 + TICK_S * k
            node.tick(node.t_s)

        kept = tick_lines("node", step, lambda k: doors["joint_trajectory"](message(k)))
        target, count = bytes(serialize_message(Target(covariance=[0.0] * 9))), 2000
        spent = seconds(lambda: [doors["target"](target) for _ in range(count)])
        line("  a Target through the door of messages", 1e6 * spent / count, None, "us")
        return kept
    finally:
        node.destroy_node()
        rclpy.try_shutdown()


def ramp(k: int, start: float = 0.0) -> JointTrajectory:
    """Return the commands of the second after tick `k`: a slow drive of both axes."""
    ahead = TICK_S * k + 0.1 * np.arange(1, 11)
    rate = np.array([2e-3, -1e-3])
    position = np.radians([120.0, 60.0]) + ahead[:, None] * rate
    return JointTrajectory(
        t_s=start + ahead,
        position_rad=position,
        velocity_rad_s=np.tile(rate, (10, 1)),
        acceleration_rad_s2=np.zeros((10, 2)),
    )


def tick_lines(name: str, step: Callable[[int], object], command: Callable[[int], object]) -> bool:
    """Step some thousand ticks with a command every fifth, and print what they took."""
    spent, passed = [], []
    for k in range(TICKS):
        if k % 5 == 0:
            command(k)
        wall_s, busy_s = time.perf_counter(), time.thread_time()
        step(k)
        spent.append(time.thread_time() - busy_s)
        passed.append(time.perf_counter() - wall_s)
    line(f"50-Hz tick of the {name}, median", 1e3 * float(np.median(spent)), None, "ms")
    line("  99th percentile", 1e3 * float(np.percentile(spent, 99.0)), None, "ms")
    line("  99th percentile, wall clock of this machine now", 1e3 * float(np.percentile(passed, 99.0)), None, "ms")
    share = float(np.percentile(spent, 99.0)) / TICK_S
    return line("  a tenth of the period over the 99th percentile", TICK_SHARE / share, 1.0, "x")


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=40)
    parser.add_argument("--workers", type=int, default=2)
    options = parser.parse_args()
    kept = [closed_loop(), tick(), node_lines(), monte_carlo(options.runs, options.workers)]
    return 0 if all(kept) else 1


if __name__ == "__main__":
    sys.exit(main())
