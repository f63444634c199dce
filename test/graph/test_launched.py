"""Every launch file as it is started: its processes come up by themselves, and a user's own TLE is flown by name.

Where `ros2 launch` is installed it starts them, and `ros2 action` and `ros2 bag` do the rest.  The wheels have
none of the three: there the package's own command starts them, the goal is sent by rclpy, and the package's own
recorder records.
"""

import importlib.util
import shutil
import signal
import subprocess
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
import yaml

rclpy = pytest.importorskip("rclpy", reason="the graph needs ROS 2")
from lifecycle_msgs.msg import State
from lifecycle_msgs.srv import GetState
from rcl_interfaces.srv import GetParameters
from rclpy.action import ActionClient
from rclpy.parameter import parameter_value_to_python
from rf_pointing_msgs.action import TrackPass
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState

from rf_pointing.ephemeris import tle_lines
from rf_pointing.report import write_report
from rf_pointing.ros.graph import NODES, STATION_NODES
from rf_pointing.ros.recorder import Recorder
from test.conftest import within
from test.ros.test_launching import FOLDER
from test.simulation.night_plan import orbits, small_night

from .conftest import ask, executable

pytestmark = [pytest.mark.graph, pytest.mark.alone]
ROS2, LAUNCH_TEST = shutil.which("ros2"), shutil.which("launch_test")
BAG = ROS2 is not None and importlib.util.find_spec("ros2bag") is not None
"""Each tool is a package of its own, so one may be there without another."""
SPEED = 8.0
ARRAYS = {
    "doa": ("doa_source", "doa_attitude"),
    "interferometer": ("interferometer_source", "interferometer_tracker"),
    "tripulse": ("tripulse_source", "tripulse_attitude"),
}


class Launched:
    """One launch file that runs, by `ros2 launch` or by this package's own command."""

    def __init__(self, live: SimpleNamespace, folder: Path) -> None:
        self._live, self._folder = live, folder
        self._running: list[subprocess.Popen[bytes]] = []

    def start(self, name: str, **arguments: str) -> None:
        arguments |= {"namespace": self._live.namespace.strip("/")}
        words = [f"{key}:={value}" for key, value in arguments.items()]
        command = [ROS2, "launch", str(FOLDER / f"{name}.launch.py")] if ROS2 else [executable("launch"), name]
        with (self._folder / "log").open("wb") as log:
            self._running.append(subprocess.Popen([*command, *words], stdout=log, stderr=log, stdin=subprocess.DEVNULL))

    def wait_active(self, names: tuple[str, ...]) -> None:
        def active(name: str) -> bool:
            answer = ask(self._live, GetState, f"{name}/get_state", GetState.Request(), again=True)
            return bool(answer.current_state.id == State.PRIMARY_STATE_ACTIVE)

        for name in names:
            self._live.spin_until(lambda name=name: active(name), f"{name} active")

    def stop(self) -> list[int]:
        """Interrupt what runs, as Ctrl-C does; return its exit code."""
        codes = []
        for process in self._running:
            process.send_signal(signal.SIGINT)
            with suppress(subprocess.TimeoutExpired):
                codes.append(process.wait(40.0))
            process.kill()
            process.wait()
        self._running.clear()
        return codes


@pytest.fixture
def launch_file(live: SimpleNamespace, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Launched]:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    one = Launched(live, tmp_path)
    yield one
    one.stop()


@pytest.mark.parametrize("name", ARRAYS)
def test_the_launch_file_of_an_array_sensor_comes_up_and_ends(launch_file: Launched, name: str) -> None:
    launch_file.start(name)
    launch_file.wait_active(ARRAYS[name])
    assert set(launch_file.stop()) == {0}


def test_a_station_of_its_own_comes_up_with_what_the_user_has_written_last(
    launch_file: Launched, live: SimpleNamespace, tmp_path: Path
) -> None:
    """Of the arguments and the user's file, the file is in force, whichever way it names the nodes."""
    own = tmp_path / "own.yaml"
    full = f"{live.namespace}/pointing_controller"
    own.write_text(
        yaml.safe_dump(
            {
                "/**": {"ros__parameters": {"band": "S"}},
                "/**/ephemeris_publisher": {"ros__parameters": {"source.satellite": "Moon"}},
                full: {"ros__parameters": {"certificate_folder": str(tmp_path / "certificates")}},
            }
        )
    )
    arguments = {"station": "leo_3m7", "band": "X", "satellite": "Sun", "params_file": str(own), "state_folder": "none"}
    launch_file.start("single_antenna", **arguments)
    # No band of the dish has monopulse.
    launch_file.wait_active(tuple(name for name in STATION_NODES if name != "monopulse_tracker"))
    wanted = {
        "ephemeris_publisher": {"band": "S", "source.satellite": "Moon", "use_sim_time": False},
        "pointing_controller": {"band": "S", "certificate_folder": str(tmp_path / "certificates")},
    }
    for name, values in wanted.items():
        answer = ask(live, GetParameters, f"{name}/get_parameters", GetParameters.Request(names=list(values)))
        assert [parameter_value_to_python(each) for each in answer.values] == list(values.values())
    assert set(launch_file.stop()) == {0}


def test_the_simulated_station_flies_a_users_tle_by_its_name(
    launch_file: Launched, live: SimpleNamespace, tmp_path: Path
) -> None:
    """From the launch file to the report: nobody has copied a pass or written a parameter file."""
    _, _, passes = small_night(tmp_path)
    elements = tmp_path / "my.tle"
    elements.write_text("".join(f"{one.name}\n" + "\n".join(tle_lines(one)) + "\n" for one in orbits(2)))
    arguments = {"elements": str(elements), "station": str(tmp_path / "station.yaml"), "state_folder": "none"}
    # The nodes need some seconds of the simulated time to come up.
    start_s = round(passes[1].aos_t_s) - 12.0 * SPEED
    launch_file.start("simulated_station", start_s=str(start_s), speed=str(SPEED), **arguments)
    launch_file.wait_active(NODES)
    bag = record(live, tmp_path)
    goal = {"satellite": "sat 2"}
    if ROS2:
        words = [ROS2, "action", "send_goal", f"{live.namespace}/track_pass", "rf_pointing_msgs/action/TrackPass"]
        with subprocess.Popen([*words, yaml.safe_dump(goal)], stdout=subprocess.PIPE, text=True) as sent:
            fly(live, lambda: sent.poll() is not None)
            sent.kill()
            assert "success: true" in sent.communicate()[0]
    else:
        client = ActionClient(live.node, TrackPass, "track_pass")
        live.spin_until(client.server_is_ready, "track_pass")
        future = client.send_goal_async(TrackPass.Goal(**goal))
        live.spin_until(future.done, "an answer")
        ended = future.result().get_result_async()
        fly(live, ended.done)
        result = ended.result().result
        assert result.success, result.message
        assert result.target_pass.target == "sat 2"
    bag.close()
    assert set(launch_file.stop()) == {0}
    if BAG:
        play(live, tmp_path / "bag")
    summary = write_report(tmp_path / "bag", tmp_path / "report")
    assert summary.outcome.tracked
    assert (tmp_path / "report" / "report.html").is_file()


def fly(live: SimpleNamespace, ended: Callable[[], bool]) -> None:
    """Spin, for the recorder's sake too, until the pass has ended."""
    began_s = time.monotonic()
    while not ended() and within(time.monotonic() - began_s, 240.0):
        live.executor.spin_once(timeout_sec=0.1)


@pytest.mark.skipif(not LAUNCH_TEST, reason="the wheels have no launch_testing")
def test_the_simulated_station_under_launch_testing() -> None:
    """Of a ROS 2 install: `launch_test` starts the file, asks its nodes, ends it and looks at the exit codes."""
    tested = Path(__file__).with_name("launch_testing_station.py")
    done = subprocess.run([str(LAUNCH_TEST), str(tested)], capture_output=True, text=True, timeout=200)
    assert done.returncode == 0, done.stdout + done.stderr


def record(live: SimpleNamespace, folder: Path) -> Any:
    """Begin to record: with `ros2 bag record -a` where it is installed."""
    if not BAG:
        return Recorder(live.node, live.namespace, folder / "bag")
    process = subprocess.Popen([str(ROS2), "bag", "record", "-a", "-s", "mcap", "-o", str(folder / "bag")])

    def close() -> None:
        process.send_signal(signal.SIGINT)
        process.wait(30.0)

    return SimpleNamespace(close=close)


def play(live: SimpleNamespace, bag: Path) -> None:
    """Play a recording back with its own clock, which the recorded one must not meet: time and states arrive."""
    heard: dict[str, list[Any]] = {"/clock": [], "joint_states": []}
    topics = {"/clock": Clock, f"{live.namespace}/joint_states": JointState}
    subscriptions = [
        live.node.create_subscription(kind, name, heard[name.removeprefix(f"{live.namespace}/")].append, 10)
        for name, kind in topics.items()
    ]
    recorded = [f"{live.namespace}/joint_states", f"{live.namespace}/tracking_status"]
    process = subprocess.Popen([str(ROS2), "bag", "play", str(bag), "--clock", "100", "--topics", *recorded])
    try:
        live.spin_until(lambda: all(len(messages) > 10 for messages in heard.values()), "a clock and joint states")
    finally:
        process.send_signal(signal.SIGINT)
        process.wait(15.0)
        for subscription in subscriptions:
            live.node.destroy_subscription(subscription)
