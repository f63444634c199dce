"""The bias calibrator as a live process: observations survive SIGKILL, and a fit of them waits to be accepted."""

import math
import os
import signal
import time
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from rclpy.action import ActionClient
from rf_pointing_msgs.action import FitModel
from rf_pointing_msgs.msg import PointingError, PointingModel, Target
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger

from rf_pointing.core import MDEG
from rf_pointing.ros.qos import LATCHED, STREAM
from rf_pointing.ros.stamps import stamp_from_seconds

from .conftest import ask

pytestmark = pytest.mark.graph

OFFSET_RAD = 50.0 * MDEG
NODE, AGAIN = "bias_calibrator", "again"


class Pass:
    """Publishes a target, encoders that are off by `OFFSET_RAD` in azimuth, and errors of a sensor on the beam."""

    def __init__(self, live: SimpleNamespace, namespace: str) -> None:
        self._live = live
        node = live.node
        self._target = node.create_publisher(Target, f"{namespace}/target", STREAM)
        self._joints = node.create_publisher(JointState, f"{namespace}/joint_states", STREAM)
        self._error = node.create_publisher(PointingError, f"{namespace}/pointing_error", STREAM)
        self._began_s = math.floor(time.time())
        self._count = 0
        self.target = "bird"

    def matched(self) -> bool:
        return all(p.get_subscription_count() > 0 for p in (self._target, self._joints, self._error))

    def publish(self) -> None:
        """Publish what belongs to the next second of the pass."""
        self._count += 1
        t_s = self._began_s + float(self._count)
        for ahead_s in (0.0, 1.0):
            sky = Target(target=self.target, azimuth=1.0 + 2e-3 * (self._count + ahead_s), elevation=0.7, range=1e6)
            sky.azimuth_rate, sky.sequence = 2e-3, 2 * self._count + int(ahead_s)
            sky.header.stamp = stamp_from_seconds(t_s + ahead_s)
            self._target.publish(sky)
        joints = JointState(name=["azimuth", "elevation"], velocity=[2e-3, 0.0])
        joints.position = [1.0 + 2e-3 * self._count + OFFSET_RAD, 0.7]
        joints.header.stamp = stamp_from_seconds(t_s)
        self._joints.publish(joints)
        # The encoders are read when an error comes: they must have arrived before it.
        self._live.executor.spin_once(timeout_sec=0.02)
        error = PointingError(sensor="monopulse", valid=True, sequence=self._count)
        error.header.stamp = stamp_from_seconds(t_s)
        self._error.publish(error)
        self._live.executor.spin_once(timeout_sec=0.02)


def lines(path: Path) -> int:
    """Return the whole lines of points in a journal."""
    if not path.exists():
        return 0
    return sum(not line.startswith(b"#") for line in path.read_bytes().split(b"\n")[:-1]) - 1


def fit(live: SimpleNamespace) -> Any:
    client = ActionClient(live.node, FitModel, f"{live.namespace}/{AGAIN}/{NODE}/fit_model")
    live.spin_until(client.server_is_ready, "fit_model")
    goal = client.send_goal_async(FitModel.Goal(terms=["azimuth_offset"]))
    live.spin_until(goal.done, "the answer to the goal")
    assert goal.result().accepted
    result = goal.result().get_result_async()
    live.spin_until(result.done, "the fit")
    client.destroy()
    return result.result().result


NO_MODEL = {"bands.X.bias_model": ""}
"""Of the station: the fit begins at a perfect mount."""


def test_a_killed_calibrator_goes_on_with_every_observation_and_its_fit_waits_for_acceptance(
    live: SimpleNamespace, tmp_path: Path
) -> None:
    parameters = f"""
/**/{NODE}:
  ros__parameters:
    calibrator: {{folder: "{tmp_path}", spacing_s: 0.5}}
"""
    journal = tmp_path / "goldstone_dss_13" / "X" / "observations.csv"
    started = live.start([NODE], parameters, station=NO_MODEL)
    sky = Pass(live, live.namespace)
    live.spin_until(sky.matched, "the subscriptions")
    while lines(journal) < 25:
        sky.publish()
    os.kill(started.processes.process_id(NODE), signal.SIGKILL)
    live.spin_until(lambda: bool(started.processes.ended()), "the end of the process")
    kept = lines(journal)
    assert kept >= 25

    # In a namespace below: the dead node's services stay visible for 20 s and would be asked instead.
    live.start([f"{AGAIN}/{NODE}"], parameters, station=NO_MODEL)
    again = Pass(live, f"{live.namespace}/{AGAIN}")
    live.spin_until(again.matched, "the subscriptions")
    while lines(journal) < kept + 10:
        again.publish()
    models: list[PointingModel] = []
    live.node.create_subscription(PointingModel, f"{live.namespace}/{AGAIN}/pointing_model", models.append, LATCHED)

    result = fit(live)
    assert result.success, result.message
    assert result.observations + result.rejected >= kept + 10
    value = dict(zip(result.model.terms, result.model.values, strict=True))["azimuth_offset"]
    assert value == pytest.approx(OFFSET_RAD, abs=0.1 * MDEG)
    early = ask(live, Trigger, f"{AGAIN}/{NODE}/accept", Trigger.Request())
    assert not early.success
    assert "not yet observed in shadow; it must be better after fewest_passes=3" in early.message
    assert models == []
