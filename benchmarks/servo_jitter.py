"""Lateness of antenna_servo's ticks, and of its stop, while two processes take all processors.

    python3 benchmarks/servo_jitter.py [SECONDS]

Prints median, 99 % and largest lateness in ms as `antenna_status` shows it (10 Hz), and the same of
the time to the answer of ~/stop behind 100 calls that are sent at once: at the priority that the
node was started with and at a real-time one, and "not permitted" where it is not.  The caller has
the real-time priority, where it is permitted, so that its own waiting does not count.
"""

import os
import subprocess
import sys
import tempfile
import time
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import rclpy
from rf_pointing_msgs.msg import AntennaStatus
from std_srvs.srv import Trigger

from rf_pointing.ros.main_loop import DRIVE_PRIORITY, make_executor
from rf_pointing.ros.managed_graph import NodeProcesses
from rf_pointing.ros.qos import SERVICE, STATUS

HOGS = 2
STOPS, CLIENTS, CALLS_EACH = 30, 10, 10
SETTLE_S = 3.0


def stops_s(node: Any, executor: Any) -> list[float]:
    """Return the times from the request of a stop to its answer, each behind 100 other calls."""
    space, found = f"{node.get_namespace()}/antenna_servo", list[float]()
    clients = [node.create_client(Trigger, f"{space}/resume", qos_profile=SERVICE) for _ in range(CLIENTS)]
    stop = node.create_client(Trigger, f"{space}/stop", qos_profile=SERVICE)
    while not all(client.service_is_ready() for client in (*clients, stop)):
        executor.spin_once(timeout_sec=0.1)
    with suppress(PermissionError):
        os.sched_setscheduler(0, os.SCHED_FIFO | os.SCHED_RESET_ON_FORK, os.sched_param(DRIVE_PRIORITY))
    try:
        for _ in range(STOPS):
            answers = [client.call_async(Trigger.Request()) for client in clients for _ in range(CALLS_EACH)]
            begun_s, stopped = time.monotonic(), stop.call_async(Trigger.Request())
            while not stopped.done():
                executor.spin_once(timeout_sec=0.001)
            found.append(time.monotonic() - begun_s)
            while not all(answer.done() for answer in answers):
                executor.spin_once(timeout_sec=0.01)
    finally:
        os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
    return found


def measured_s(priority: int, seconds: float) -> tuple[list[float], list[float]]:
    """Return the lateness of the ticks that the statuses show, and the times of the stops."""
    found: list[float] = []
    with tempfile.TemporaryDirectory() as folder:
        yaml = Path(folder) / "priority.yaml"
        yaml.write_text(f"/**: {{ros__parameters: {{lifecycle: {{realtime_priority: {priority}}}}}}}")
        processes = NodeProcesses(f"/jitter{priority}", [yaml], Path(folder) / "logs")
        node = rclpy.create_node("probe", namespace=processes.namespace)
        executor = make_executor()
        executor.add_node(node)
        node.create_subscription(AntennaStatus, "antenna_status", lambda m: found.append(m.tick_lateness), STATUS)
        processes.start(["antenna_servo"], simulated_time=False, autostart=True)
        hogs = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(HOGS)]
        end_s = time.monotonic() + 60.0
        while len(found) < 10 * (SETTLE_S + seconds) and time.monotonic() < end_s + seconds:
            executor.spin_once(timeout_sec=0.1)
        late_s = found[int(10 * SETTLE_S) :]
        stops = stops_s(node, executor)
        for hog in hogs:
            hog.kill()
        if "not permitted" in (Path(folder) / "logs" / "antenna_servo.log").read_text():
            print("not permitted:", end=" ")
        processes.stop()
        executor.shutdown()
        node.destroy_node()
    return late_s, stops


def main() -> None:
    """Measure both."""
    seconds = float(sys.argv[1]) if len(sys.argv) > 1 else 60.0
    rclpy.init()
    for priority in (0, DRIVE_PRIORITY):
        for name, times_s in zip(("ticks", "stop"), measured_s(priority, seconds), strict=True):
            late_ms = 1e3 * np.abs(times_s)
            median, most = np.percentile(late_ms, (50, 99))
            print(
                f"priority {priority:2d}, {name}: median {median:.2f}, 99 % {most:.2f}, largest {late_ms.max():.2f} ms"
            )
    rclpy.shutdown()


if __name__ == "__main__":
    main()
