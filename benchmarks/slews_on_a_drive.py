"""Slew an antenna_servo on a real drive in wall time, with stalls and a busy machine; count faults.

    scripts/run-python benchmarks/slews_on_a_drive.py [--drive rotctld pty topic] [--slews 200]
                                                      [--busy 2] [--stalls]

Every slew is a `go_to` of 4 to 16 deg at 6 deg/s.  With --stalls the servo is stopped (SIGSTOP) for
0.1 to 0.9 s somewhere in each; --busy processes compute meanwhile.  A fault is false: nobody has
touched the device.  The drives: Debian's `rotctld -m 1`; an Easycomm controller on a pseudo
terminal; examples/topic_drive_node.py.  The exit code is 1 where a fault or a lost slew was seen.
"""

import argparse
import json
import math
import os
import random
import signal
import sys
import tempfile
import time
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import rclpy
from real_station import DEVICES, PATIENCE_S, SPEED_DEG_S, busy, write_station
from rf_pointing_msgs.msg import AntennaStatus
from rf_pointing_msgs.srv import GoTo
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger

from rf_pointing.ros.main_loop import DRIVE_PRIORITY, make_executor
from rf_pointing.ros.managed_graph import NodeProcesses
from rf_pointing.ros.qos import STREAM
from rf_pointing.ros.repeated_call import AGAIN_S, RepeatedCall

NAMESPACE = "/slews"
LEAST_DEG, MOST_DEG = 4.0, 16.0
ARRIVED_DEG = 0.2


class Slews:
    """A running antenna_servo and what it publishes."""

    def __init__(self, folder: Path, drive: str, ends: ExitStack) -> None:
        device = DEVICES[drive](folder, NAMESPACE)
        ends.callback(device.kill)
        station = write_station(folder, device)
        parameters = folder / "parameters.yaml"
        # As single_antenna.launch.py starts it.
        given = {"station": str(station), "lifecycle.realtime_priority": DRIVE_PRIORITY}
        parameters.write_text(json.dumps({"/**": {"ros__parameters": given}}))
        self.context = rclpy.Context()
        rclpy.init(context=self.context)
        ends.callback(rclpy.try_shutdown, context=self.context)
        self.node = rclpy.create_node("slews", namespace=NAMESPACE, context=self.context)
        self.executor = make_executor(self.context)
        self.executor.add_node(self.node)
        self.status, self.place_deg = AntennaStatus(), (math.nan, math.nan)
        self.node.create_subscription(AntennaStatus, "antenna_status", self._on_status, STREAM)
        self.node.create_subscription(JointState, "joint_states", self._on_joints, STREAM)
        self.calls = {
            name: self.node.create_client(kind, f"antenna_servo/{name}")
            for name, kind in (("go_to", GoTo), ("reset_fault", Trigger))
        }
        self.servo = NodeProcesses(NAMESPACE, [parameters], folder / "logs")
        ends.callback(self.servo.stop)
        self.servo.start(["antenna_servo"], simulated_time=False, autostart=True)
        self.until(lambda: self.status.mode == "holding" and self.calls["go_to"].service_is_ready())
        self.until(lambda: not math.isnan(self.place_deg[0]))

    def slew(self, goal_deg: tuple[float, float], stall: tuple[float, float] | None) -> str:
        """Slew, stalled `stall` = (s after the start, s long); return "" or what was wrong."""
        begun_s = time.monotonic()
        way_deg = max(abs(goal - here) for goal, here in zip(goal_deg, self.place_deg, strict=True))
        request = GoTo.Request(azimuth=math.radians(goal_deg[0]), elevation=math.radians(goal_deg[1]))
        answer = self.call("go_to", request)
        if not answer.success and not self.status.fault:
            return f"refused: {answer.message}"
        if stall is not None:
            self.until(lambda: time.monotonic() - begun_s > stall[0])
            os.kill(self.servo.process_id("antenna_servo"), signal.SIGSTOP)
            time.sleep(stall[1])
            os.kill(self.servo.process_id("antenna_servo"), signal.SIGCONT)
        longest_s = 2.0 * way_deg / SPEED_DEG_S + 20.0
        self.until(
            lambda: bool(self.status.fault) or self.off_deg(goal_deg) < ARRIVED_DEG
            or time.monotonic() - begun_s > longest_s
        )  # fmt: skip
        if self.status.fault:
            fault = str(self.status.fault)
            while not (answer := self.call("reset_fault", Trigger.Request())).success:
                if time.monotonic() - begun_s > PATIENCE_S:
                    raise TimeoutError(f"{fault}: not reset: {answer.message}")
                self.executor.spin_once(timeout_sec=0.1)
            self.until(lambda: self.status.mode == "holding")
            return fault
        off_deg = self.off_deg(goal_deg)
        return "" if off_deg < ARRIVED_DEG else f"not there after {longest_s:.0f} s: {off_deg:.2f} deg off"

    def off_deg(self, goal_deg: tuple[float, float]) -> float:
        return max(abs(goal - here) for goal, here in zip(goal_deg, self.place_deg, strict=True))

    def call(self, name: str, request: Any) -> Any:
        # The answer of a node that is stopped meanwhile may be lost.
        call = RepeatedCall(self.calls[name], request, after_s=AGAIN_S)
        self.until(call.done)
        return call.result()

    def until(self, condition: Callable[[], bool]) -> None:
        end_s = time.monotonic() + PATIENCE_S
        while not condition():
            if time.monotonic() > end_s:
                raise TimeoutError(f"{self.status.mode}, {self.status.fault}, {self.servo.complaint('antenna_servo')}")
            self.executor.spin_once(timeout_sec=0.02)

    def _on_status(self, message: AntennaStatus) -> None:
        self.status = message

    def _on_joints(self, message: JointState) -> None:
        self.place_deg = math.degrees(message.position[0]), math.degrees(message.position[1])


def measure(name: str, count: int, stalls: bool, seed: int) -> int:
    """Fly the slews of one drive and print what was seen; return how many went wrong."""
    random_ = random.Random(seed)
    wrong, begun_s = list[str](), time.monotonic()
    with ExitStack() as ends:
        folder = Path(ends.enter_context(tempfile.TemporaryDirectory()))
        os.environ["XDG_STATE_HOME"] = str(folder)
        slews = Slews(folder, name, ends)
        for _ in range(count):
            side = [1.0 if here < middle else -1.0 for here, middle in zip(slews.place_deg, (0.0, 45.0), strict=True)]
            way_deg = random_.uniform(LEAST_DEG, MOST_DEG)
            goal_deg = slews.place_deg[0] + side[0] * way_deg, slews.place_deg[1] + side[1] * 0.5 * way_deg
            stall = (random_.uniform(0.2, way_deg / SPEED_DEG_S), random_.uniform(0.1, 0.9)) if stalls else None
            found = slews.slew(goal_deg, stall)
            if found:
                wrong.append(found)
                stalled = f", stalled {stall[1]:.2f} s after {stall[0]:.2f} s" if stall else ""
                print(f"  {name}: {way_deg:.1f} deg{stalled}: {found}", flush=True)
    load, took_s = os.getloadavg()[0], time.monotonic() - begun_s
    print(f"{name}: {len(wrong)} of {count} slews went wrong, {took_s:.0f} s, load {load:.0f}", flush=True)
    return len(wrong)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--drive", nargs="+", choices=DEVICES, default=list(DEVICES))
    parser.add_argument("--slews", type=int, default=200)
    parser.add_argument("--busy", type=int, default=0, help="processes that compute meanwhile")
    parser.add_argument("--stalls", action="store_true", help="stop the servo for 0.1 to 0.9 s in every slew")
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    # An end by a signal ends the devices, too.
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(2))
    os.environ["ROS_DOMAIN_ID"] = str(random.randrange(1, 100))
    # As the nodes: a stopped process leaves no shared memory for which others would wait.
    os.environ["FASTDDS_BUILTIN_TRANSPORTS"] = "UDPv4"
    with busy(options.busy):
        wrong = sum(measure(name, options.slews, options.stalls, options.seed) for name in options.drive)
    sys.exit(1 if wrong else 0)


if __name__ == "__main__":
    main()
