"""How late the ticks of antenna_servo start in wall time while two processes take all processors.

    python3 benchmarks/servo_jitter.py [SECONDS]

Prints median, 99 % and largest lateness in ms as `antenna_status` shows it (10 Hz), at the
priority that the node was started with and at a real-time one, and "not permitted" where it is not.
"""

import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import rclpy
from rf_pointing_msgs.msg import AntennaStatus

from rf_pointing.commands.managed_graph import NodeProcesses
from rf_pointing.nodes.main_loop import DRIVE_PRIORITY, make_executor
from rf_pointing.nodes.qos import STATUS

HOGS = 2
SETTLE_S = 3.0


def lateness_s(priority: int, seconds: float) -> list[float]:
    """Return the lateness of the ticks that the statuses show."""
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
        for hog in hogs:
            hog.kill()
        if "not permitted" in (Path(folder) / "logs" / "antenna_servo.log").read_text():
            print("not permitted:", end=" ")
        processes.stop()
        executor.shutdown()
        node.destroy_node()
    return found[int(10 * SETTLE_S) :]


def main() -> None:
    """Measure both."""
    seconds = float(sys.argv[1]) if len(sys.argv) > 1 else 60.0
    rclpy.init()
    for priority in (0, DRIVE_PRIORITY):
        late_ms = 1e3 * np.abs(lateness_s(priority, seconds))
        median, most = np.percentile(late_ms, (50, 99))
        print(f"priority {priority:2d}: median {median:.2f}, 99 % {most:.2f}, largest {late_ms.max():.2f} ms")
    rclpy.shutdown()


if __name__ == "__main__":
    main()
