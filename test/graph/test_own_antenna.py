"""The graph without its simulated antenna: a station's own driver follows a pass as the simulated one would."""

import math
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from rclpy.action import ActionClient
from rf_pointing_msgs.action import TrackPass
from rf_pointing_msgs.msg import PassList, TrackingStatus
from sensor_msgs.msg import JointState

from rf_pointing.ephemeris.source import SourceParams, load_track
from rf_pointing.nodes.qos import LATCHED, STREAM
from rf_pointing.nodes.stamps import seconds_from_stamp
from test.faults.clocks import ManualClock

pytestmark = pytest.mark.graph

AOS_T_S = 1_151_384_324.0
"""A pass of CBERS-2 above 40 deg begins."""
DRIVER = Path(__file__).parents[2] / "examples" / "antenna_driver.py"
AWAY_DEG = 3.0
NODES = ["ephemeris_publisher", "pointing_controller"]


@pytest.fixture
def driver(live: SimpleNamespace) -> Iterator["subprocess.Popen[bytes]"]:
    """Run the driver of the examples, which waits close to where the target will be."""
    sky = load_track(SourceParams()).target_at(AOS_T_S)
    start = [math.degrees(sky.azimuth_rad) - AWAY_DEG, math.degrees(sky.elevation_rad) + AWAY_DEG]
    process = subprocess.Popen([
        sys.executable, str(DRIVER), "--ros-args", "-r", f"__ns:={live.namespace}", "-p", f"start_deg:={start}",
        "-r", f"/clock:={live.namespace}/clock", "-p", "use_sim_time:=true",
    ])  # fmt: skip
    yield process
    if process.poll() is None:
        process.send_signal(signal.SIGINT)
        assert process.wait(10.0) == 0


@pytest.mark.usefixtures("driver")
def test_a_driver_of_ones_own_tracks_a_pass_and_stops_when_the_controller_is_gone(live: SimpleNamespace) -> None:
    """Nothing else is needed: no antenna_status, no receiver, no model."""
    joints: list[JointState] = []
    clock = ManualClock(live, AOS_T_S - 15.0, lambda: seconds_from_stamp(joints[-1].header.stamp) if joints else 0.0)
    modes: list[TrackingStatus] = []
    passes: list[PassList] = []
    live.node.create_subscription(JointState, "joint_states", joints.append, STREAM)
    live.node.create_subscription(TrackingStatus, "tracking_status", modes.append, STREAM)
    live.node.create_subscription(PassList, "passes", passes.append, LATCHED)
    started = live.start(NODES, state="configure", simulated=True)
    assert started.refused == []
    waiting = list(NODES)
    for _ in range(100):
        clock.run(0.1)
        waiting = started.client.change(waiting, "activate", 20.0)
        if not waiting:
            break
    client = ActionClient(live.node, TrackPass, "track_pass")
    assert clock.run(20.0, lambda: bool(passes and joints) and client.server_is_ready())

    sent = client.send_goal_async(TrackPass.Goal(target_pass=passes[0].passes[0], sensor="program"))
    assert clock.run(10.0, sent.done)
    assert sent.result().accepted
    assert clock.run(30.0, lambda: bool(modes) and modes[-1].mode == "program_track"), {
        (m.mode, m.reason) for m in modes
    }
    clock.run(4.0)
    track = load_track(SourceParams())
    for message in joints[-50:]:
        sky = track.target_at(seconds_from_stamp(message.header.stamp))
        np.testing.assert_allclose(message.position, (sky.azimuth_rad, sky.elevation_rad), atol=math.radians(1e-3))
    assert np.hypot(*joints[-1].velocity) > math.radians(0.05), "the satellite moves, and the antenna with it"

    started.processes.stop()
    assert clock.run(10.0, lambda: np.max(np.abs(joints[-1].velocity)) == 0.0), "it coasts for a second, then stops"
    stood = joints[-1].position
    clock.run(1.0)
    assert joints[-1].position == stood
