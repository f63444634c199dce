"""The servo of a live antenna: identified through its topics, retuned while it runs, stopped when its loop oscillates."""

import json
import signal
import subprocess
from pathlib import Path
from types import SimpleNamespace

import pytest

rclpy = pytest.importorskip("rclpy", reason="the graph needs ROS 2")
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
from rcl_interfaces.srv import SetParametersAtomically
from rf_pointing_msgs.msg import AntennaStatus

from rf_pointing.ros.qos import STREAM

from .conftest import DEADLINE_S, ask, executable

pytestmark = pytest.mark.graph

MODE_HZ = 2.12


def test_the_live_antenna_is_identified_through_its_topics(tmp_path: Path, ros_domain: int) -> None:
    command = [
        executable("identify_antenna"), "--simulated", "--axes", "elevation", "--sequences", "2", "--held-out", "1",
        "--samples", "1024", "--namespace", "/identified", "--output", str(tmp_path),
    ]  # fmt: skip
    done = subprocess.run(command, capture_output=True, text=True, timeout=4.0 * DEADLINE_S)
    assert done.returncode == 0, done.stderr
    (row,) = json.loads((tmp_path / "errors.json").read_text())
    assert min(abs(frequency - MODE_HZ) for frequency in row["modes_hz"]) < 0.02 * MODE_HZ
    assert row["worst_error"] < 0.01
    assert {path.name for path in tmp_path.iterdir()} >= {
        "models.json", "errors.txt", "recordings.npz", "elevation_to_elevation.png",
    }  # fmt: skip


class Watched:
    """A live antenna_servo in light wind, whose drives are known to be slow: its status, its diagnostics, its parameters."""

    def __init__(self, live: SimpleNamespace) -> None:
        self.live, self.status, self.health = live, AntennaStatus(), {}
        live.node.create_subscription(AntennaStatus, "antenna_status", self._on_status, STREAM)
        live.node.create_subscription(DiagnosticArray, "/diagnostics", self._on_diagnostics, STREAM)
        live.start(
            ["antenna_servo"],
            "/**/antenna_servo: {ros__parameters: {wind: {mean_speed_m_s: 4.0}}}",
            station={"tuning.safety.drive": {"delay_s": 0.4, "excess_deg_s": 50.0}},
        )
        live.spin_until(lambda: self.status.mode == "holding", "the antenna to hold")

    def _on_status(self, message: AntennaStatus) -> None:
        self.status = message

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        self.health |= {each.name: each for each in message.status if self.live.namespace[1:] in each.name}

    def change(self, **values: float | str) -> str:
        """Set parameters as one; return why not, "" when they were taken."""
        parameters = []
        for name, value in values.items():
            text = isinstance(value, str)
            kind = ParameterType.PARAMETER_STRING if text else ParameterType.PARAMETER_DOUBLE
            content = {"string_value": value} if text else {"double_value": value}
            parameters.append(Parameter(name=name.replace("__", "."), value=ParameterValue(type=kind, **content)))
        request = SetParametersAtomically.Request(parameters=parameters)
        answer = ask(self.live, SetParametersAtomically, "antenna_servo/set_parameters_atomically", request).result
        return "" if answer.successful else str(answer.reason)


def test_a_live_antenna_is_retuned_interrupted_and_cut_off_when_it_oscillates(
    live: SimpleNamespace, tmp_path: Path
) -> None:
    antenna = Watched(live)
    assert antenna.change(loops__law="lqg") == ""
    refusal = antenna.change(loops__law="pi", loops__elevation__proportional_gain=40.0)
    assert "elevation.proportional_gain=40.0" in refusal
    assert "must be <= 1" in refusal
    assert "must be < 25.0" in antenna.change(loops__law="pi", loops__azimuth__notch_frequency_hz=26.0)

    command = [executable("identify_antenna"), "--namespace", live.namespace, "--output", str(tmp_path)]
    client = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
    live.spin_until(lambda: antenna.status.mode == "manual_rate", "the experiment")
    client.send_signal(signal.SIGINT)
    live.spin_until(lambda: antenna.status.mode == "holding", "the antenna to hold again")
    _, said = client.communicate(timeout=DEADLINE_S)
    assert client.returncode == 1
    assert "azimuth: the goal was cancelled" in said

    assert antenna.change(plant__elevation__drive_delay_s=0.3) == ""
    live.spin_until(lambda: antenna.status.mode == "fault", "the fault")
    assert antenna.status.fault.startswith("drives cut: elevation: oscillation of ")
    live.spin_until(
        lambda: any(n.endswith("oscillation") and h.level == DiagnosticStatus.ERROR for n, h in antenna.health.items()),
        "the diagnostic",
    )
    assert list(antenna.status.rate_command) == [0.0, 0.0]
