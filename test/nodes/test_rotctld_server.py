"""What the server makes of its clients' orders: whom it obeys, where the axes go, and when a pass begins and ends.

The node runs in this process.  Its port, its clocks and the other nodes are replaced, so every time is exact.
"""

import math
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from rcl_interfaces.msg import ParameterValue
from rcl_interfaces.srv import GetParameters
from rclpy.lifecycle import LifecycleState, TransitionCallbackReturn
from rclpy.parameter import Parameter
from rf_pointing_msgs.msg import AntennaStatus, ExecutiveStatus, Pass, TrackingStatus
from rf_pointing_msgs.srv import GoTo, SelectTarget
from std_srvs.srv import Trigger

from rf_pointing.calibration import BiasModel
from rf_pointing.core import JointReading, Motion
from rf_pointing.drives.rotctld import IO_ERROR, REJECTED, TIMED_OUT, Inquiry, Order, ServerCounts
from rf_pointing.nodes import rotctld_server
from rf_pointing.nodes.rotctld_server import RotctldServerNode
from rf_pointing.planning import AxisLimits
from rf_pointing.ros.command_key import CommandKey, CommandKeyParams
from rf_pointing.ros.diagnostics import OK, WARN
from rf_pointing.ros.stamps import seconds_from_stamp, stamp_from_seconds
from rf_pointing.station.pointing.client_points import Match

ANY_STATE = LifecycleState(state_id=1, label="unconfigured")
CLIENT, RIVAL = "127.0.0.1:5001", "127.0.0.1:5002"
STEP_RAD = 1e-6
"""Resolution of the stamps times the fastest motion here."""
GO_TO, PARK, RESUME = "antenna_servo/go_to", "antenna_servo/park", "antenna_servo/resume"
STOP, SELECT = "pointing_controller/stop", "ephemeris_publisher/select_target"
ELEMENTS = "ephemeris_publisher/get_parameters"
BIRD = Match(0, "BIRD", 25544, math.radians(0.1), 1.5)
DONE, REFUSED = Trigger.Response(success=True), Trigger.Response(success=False, message="not now")


class Future:
    """An answer that comes when the test gives it."""

    def __init__(self) -> None:
        self.answers: list[Any] = []

    def done(self) -> bool:
        return bool(self.answers)

    def result(self) -> Any:
        return self.answers[0]


class Service:
    """A service of another node: what it was sent, and what it answers."""

    def __init__(self) -> None:
        self.ready = True
        self.requests: list[Any] = []
        self.futures: list[Future] = []

    def service_is_ready(self) -> bool:
        return self.ready

    server_is_ready = service_is_ready

    def call_async(self, request: Any) -> Future:
        self.requests.append(request)
        self.futures.append(Future())
        return self.futures[-1]

    send_goal_async = call_async


class Port:
    """The TCP port, without a network."""

    def __init__(
        self, _params: Any, view: Any, inbox: Callable[[Inquiry], None], refused: Callable[[str], Any]
    ) -> None:
        self.port, self.view, self.inbox, self.refused = 4533, view, inbox, refused
        self.counts = ServerCounts(connected={CLIENT: 0.0, RIVAL: 0.0})
        self.last_s: dict[str, float] = {}
        self.closed = False

    def heard_s(self, client: str) -> float:
        return self.last_s.get(client, -math.inf)

    def close(self) -> None:
        self.closed = True


class Bench:
    """A server at a holding antenna, whose axes are at azimuth 100 and elevation 40 deg."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, **given: Any) -> None:
        self.wall_s, self.t_s = 1000.0, 1.8e9
        self.readings: list[JointReading] = []
        self.commands: list[Any] = []
        monkeypatch.setattr(rotctld_server, "time", SimpleNamespace(monotonic=lambda: self.wall_s))
        monkeypatch.setattr(rotctld_server, "RotctldServer", Port)
        self.node = RotctldServerNode()
        self.node.set_parameters([Parameter(name, value=value) for name, value in given.items()])
        self.node.now_s = lambda: self.t_s
        assert self.node.on_configure(ANY_STATE) == TransitionCallbackReturn.SUCCESS, self.node._reason
        self.services = {name: Service() for name in self.node._called}
        self.services[ELEMENTS].ready = False
        self.node._called = self.services
        self.passes = self.node._passes = Service()
        self.node._latest = SimpleNamespace(take=lambda: self.readings.pop() if self.readings else None)
        self.node._commands = SimpleNamespace(publish=self.commands.append)
        assert self.node.on_activate(ANY_STATE) == TransitionCallbackReturn.SUCCESS, self.node._reason
        self.port: Any = self.node._server
        self.antenna()
        self.axes(100.0, 40.0)
        self.node._step(self.t_s)

    def antenna(self, mode: str = "holding", **fields: Any) -> None:
        self.node._on_antenna(AntennaStatus(mode=mode, **fields))

    def axes(self, azimuth_deg: float, elevation_deg: float, rates_rad_s: tuple[float, float] = (0.0, 0.0)) -> None:
        self.readings.append(
            JointReading(
                t_s=self.t_s, position_rad=np.radians([azimuth_deg, elevation_deg]),
                velocity_rad_s=np.array(rates_rad_s),
            )
        )  # fmt: skip

    def order(self, name: str, *values: float, client: str = CLIENT, age_s: float = 0.0) -> list[int]:
        """Send an order; return the list in which its code arrives."""
        codes: list[int] = []
        self.port.inbox(Inquiry(Order(name, values), client, self.wall_s - age_s, codes.append))
        self.node.turn()
        return codes

    def point(self, azimuth_deg: float, elevation_deg: float, **how: Any) -> list[int]:
        return self.order("set_pos", azimuth_deg, elevation_deg, **how)

    def wait(self, seconds: float) -> None:
        """Let both clocks go on, with an antenna that reports."""
        self.wall_s, self.t_s = self.wall_s + seconds, self.t_s + seconds
        self.antenna(self.node._antenna.mode)

    def fly(
        self, points: int = 3, rate_deg_s: float = 0.5, azimuth_deg: float = 100.0, elevation_deg: float = 40.0
    ) -> list[int]:
        """Send points of a motion in azimuth, one a second; return the code of the last."""
        for index in range(points):
            if index:
                self.wait(1.0)
            codes = self.point(azimuth_deg + index * rate_deg_s, elevation_deg)
        return codes

    def answer(self, name: str, response: Any = DONE) -> Any:
        """Answer the latest request of a service; return the request."""
        service = self.services[name]
        service.futures[-1].answers.append(response)
        self.node.turn()
        return service.requests[-1]

    def went_deg(self) -> tuple[float, float]:
        """Return the place of the latest go_to."""
        request = self.services[GO_TO].requests[-1]
        return math.degrees(request.azimuth), math.degrees(request.elevation)

    def counts(self) -> dict[str, int]:
        """Return how often each service was called, without those that were not."""
        return {name: len(each.requests) for name, each in self.services.items() if each.requests}

    def match(self, monkeypatch: pytest.MonkeyPatch, found: Match | None = BIRD) -> None:
        """Let the points be those of a satellite."""
        self.node._sky = SimpleNamespace(elements=[0, 1, 2])
        monkeypatch.setattr(rotctld_server, "identify", lambda *_: found)

    def selected(self, rises_s: float = -60.0, sets_s: float = 300.0, **fields: Any) -> SelectTarget.Response:
        window = Pass(
            target="BIRD", aos=stamp_from_seconds(self.t_s + rises_s), los=stamp_from_seconds(self.t_s + sets_s)
        )
        return SelectTarget.Response(**{"success": True, "passes": [window], **fields})

    def start_pass(self, monkeypatch: pytest.MonkeyPatch) -> Any:
        """Bring a pass about, up to the goal that the controller has accepted; return its handle."""
        self.fly(3)
        self.match(monkeypatch)
        self.wait(1.0)
        self.point(101.5, 40.0)
        self.answer(SELECT, self.selected())
        handle = SimpleNamespace(accepted=True, result=Future(), cancelled=[])
        handle.get_result_async = lambda: handle.result
        handle.cancel_goal_async = lambda: handle.cancelled.append(True)
        self.passes.futures[-1].answers.append(handle)
        self.node.turn()
        return handle

    def track(self, sent: int = 1, target: str = "BIRD") -> None:
        self.node._on_tracking(TrackingStatus(target=target, commands_sent=sent))

    def end_pass(self, handle: Any) -> None:
        result = SimpleNamespace(message="loss of signal", seconds_tracked=12.0)
        handle.result.answers.append(SimpleNamespace(result=result))
        self.node.turn()

    def close(self) -> None:
        self.node.end()
        self.node.lock.release()
        self.node.destroy_node()


@pytest.fixture
def make(default_context: None, monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[..., Bench]]:
    """Yield a maker of servers."""
    made: list[Bench] = []

    def one(**given: Any) -> Bench:
        made.append(Bench(monkeypatch, **given))
        return made[-1]

    yield one
    for each in made:
        each.close()


@pytest.fixture
def bench(make: Callable[..., Bench]) -> Bench:
    """Return a server with its defaults."""
    return make()


# What clients read


def test_clients_read_where_the_beam_is_and_which_way_it_moves(bench: Bench) -> None:
    assert bench.node._view.position_deg == pytest.approx((100.0, 40.0))
    assert bench.node._view.moving == (0, 0)
    bench.axes(-30.0, 50.0, (1e-4, -1e-4))
    bench.node._step(bench.t_s)
    assert bench.node._view.position_deg == pytest.approx((-30.0, 50.0))
    assert bench.node._view.moving == (1, -1)
    bench.axes(-30.0, 50.0, (-0.99e-4, 0.99e-4))
    bench.node._step(bench.t_s)
    assert bench.node._view.moving == (0, 0)


def test_the_pointing_model_is_taken_off_the_axes_and_put_on_what_is_commanded(bench: Bench) -> None:
    offsets = {"azimuth_offset": math.radians(0.3), "elevation_offset": math.radians(-0.2)}
    bench.node._model = BiasModel.zero().replace(**offsets)
    bench.axes(100.0, 40.0)
    bench.node._step(bench.t_s)
    assert bench.node._view.position_deg == pytest.approx((99.7, 40.2))
    bench.point(120.0, 30.0)
    assert bench.went_deg() == pytest.approx((120.3, 29.8))


def test_the_lags_of_a_moving_mount_are_taken_off_with_its_rates(bench: Bench) -> None:
    model = BiasModel.zero().replace(
        azimuth_velocity_lag=0.5, azimuth_acceleration_lag=2.0, elevation_velocity_lag=0.25
    )
    bench.node._model = model
    bench.axes(100.0, 40.0, (0.02, -0.01))
    bench.node._step(bench.t_s)
    azimuth, elevation = np.radians(bench.node._view.position_deg)
    axes = np.degrees(model.apply(azimuth, elevation, 0.02, -0.01, 0.0, 0.0))
    assert axes == pytest.approx([100.0, 40.0])
    assert abs(bench.node._view.position_deg[0] - 100.0) > 0.1


def test_where_the_model_has_no_inverse_the_axes_are_shown(bench: Bench) -> None:
    def remove(*_: Any) -> Any:
        raise ValueError("no inverse at the zenith")

    bench.node._model = SimpleNamespace(remove=remove)
    bench.axes(10.0, 89.4)
    bench.node._step(bench.t_s)
    assert bench.node._view.position_deg == pytest.approx((10.0, 89.4))


def test_the_position_of_an_antenna_silent_for_more_than_2_s_is_unknown(bench: Bench) -> None:
    bench.wall_s += 2.0
    bench.node._step(bench.t_s)
    assert bench.node._view.position_deg is not None
    bench.wall_s += 0.01
    bench.node._step(bench.t_s)
    assert bench.node._view.position_deg is None


# Who may move the antenna


def silent(bench: Bench) -> None:
    bench.wall_s += 2.01


def still_there(bench: Bench) -> None:
    bench.wall_s += 2.0


def without_axes(bench: Bench) -> None:
    bench.node._joints = None


def faulty(bench: Bench) -> None:
    bench.antenna("fault", fault="encoder frozen")


def night(bench: Bench) -> None:
    bench.node._executive = ExecutiveStatus(state="running")


def no_state(bench: Bench) -> None:
    bench.node._executive = ExecutiveStatus(state="")


def others_pass(bench: Bench) -> None:
    bench.track(target="OTHER")


def parked(bench: Bench) -> None:
    bench.antenna("parked")


def parking(bench: Bench) -> None:
    bench.antenna("parking")


@pytest.mark.parametrize(
    ("state", "code"),
    [(silent, IO_ERROR), (still_there, 0), (without_axes, IO_ERROR), (faulty, REJECTED), (night, REJECTED), (no_state, 0),
     (others_pass, REJECTED), (parked, REJECTED), (parking, 0)],
)  # fmt: skip
@pytest.mark.parametrize("order", ["set_pos", "park"])
def test_an_order_is_refused_in_a_state_in_which_nobody_may_move_the_antenna(
    bench: Bench, state: Callable[[Bench], None], code: int, order: str
) -> None:
    state(bench)
    codes = bench.order(order, 100.0, 50.0)
    service = GO_TO if order == "set_pos" else PARK
    if code:
        assert (codes, bench.counts()) == ([code], {})
    else:
        assert (codes, bench.counts()) == ([], {service: 1})
        bench.answer(service)
        assert codes == [0]


def test_another_client_steers_after_10_s_of_silence_or_when_the_first_is_gone(bench: Bench) -> None:
    bench.point(100.0, 50.0)
    bench.wait(9.9)
    assert bench.point(100.0, 60.0, client=RIVAL) == [REJECTED]
    assert bench.point(100.0, 55.0) == []
    bench.wait(9.9)
    assert bench.point(100.0, 60.0, client=RIVAL) == [REJECTED]
    bench.wait(0.1)
    assert bench.point(100.0, 60.0, client=RIVAL) == []
    assert bench.went_deg() == pytest.approx((100.0, 60.0))
    del bench.port.counts.connected[RIVAL]
    assert bench.point(100.0, 70.0) == []
    assert bench.counts() == {GO_TO: 4}


def test_the_lease_is_that_of_who_steered_last_not_of_who_connected(bench: Bench) -> None:
    assert bench.point(100.0, 50.0, client=RIVAL) == []
    assert bench.point(100.0, 55.0) == [REJECTED]


# Places


@pytest.mark.parametrize(
    ("axes_deg", "point_deg", "went_deg"),
    [((100.0, 40.0), (120.0, 50.0), (120.0, 50.0)),
     ((200.0, 40.0), (350.0, 50.0), (-10.0, 50.0)),  # 350 is outside the travel of 220 deg
     ((-200.0, 40.0), (100.0, 50.0), (100.0, 50.0)),  # so is -260
     ((200.0, 40.0), (210.0, 50.0), (210.0, 50.0)),
     ((-100.0, 40.0), (210.0, 50.0), (-150.0, 50.0)),
     ((100.0, 40.0), (120.0, 1.0), (120.0, 4.1)),  # raised to the least elevation of 4 deg and 0.1 deg more
     ((100.0, 40.0), (120.0, 90.0), (120.0, 89.5)),
     ((100.0, 40.0), (300.0, 120.0), (120.0, 60.0))],
)  # fmt: skip
def test_the_axes_go_to_a_place_on_the_nearest_turn_inside_their_travel(
    bench: Bench, axes_deg: tuple[float, float], point_deg: tuple[float, float], went_deg: tuple[float, float]
) -> None:
    bench.axes(*axes_deg)
    bench.node._step(bench.t_s)
    codes = bench.point(*point_deg)
    assert bench.went_deg() == pytest.approx(went_deg)
    bench.answer(GO_TO)
    assert codes == [0]


@pytest.mark.parametrize(
    ("travel_deg", "point_deg", "went_deg"),
    [((650.0, 790.0), 0.0, 720.0), ((-790.0, -650.0), 0.0, -720.0), ((300.0, 400.0), 0.0, 360.0),
     ((-400.0, -300.0), 0.0, -360.0),
     ((10.0, 60.0), 170.0, 170.0), ((10.0, 60.0), 60.0, 60.0), ((10.0, 60.0), 10.0, 10.0), ((-220.0, 580.0), 170.0, 170.0)],
)  # fmt: skip
def test_a_place_is_reached_on_any_turn_that_the_travel_holds(
    bench: Bench, travel_deg: tuple[float, float], point_deg: float, went_deg: float
) -> None:
    low, high = np.radians(travel_deg)
    bench.node._limits = AxisLimits(azimuth_min_rad=low, azimuth_max_rad=high, elevation_min_rad=0.07)
    azimuth_rad = bench.node._inside(math.radians(point_deg))
    assert math.degrees(azimuth_rad) == pytest.approx(went_deg)


def test_a_place_sent_again_moves_nothing_within_5_mdeg(bench: Bench) -> None:
    bench.point(100.0, 50.0)
    bench.answer(GO_TO)
    assert bench.point(100.004, 50.0) == [0]
    assert bench.point(100.0, 50.004) == [0]
    assert bench.counts() == {GO_TO: 1}
    bench.wait(5.0)
    assert bench.point(100.0, 50.006) == []
    assert bench.counts() == {GO_TO: 2}


def test_a_place_that_the_antenna_refuses_is_requested_again(bench: Bench) -> None:
    codes = bench.point(100.0, 50.0)
    bench.answer(GO_TO, GoTo.Response(success=False, message="high wind"))
    assert codes == [REJECTED]
    assert bench.point(100.0, 50.0) == []
    assert bench.counts() == {GO_TO: 2}


def test_the_operator_is_warned_of_what_the_antenna_refuses_and_of_nothing_else(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    warnings: list[str] = []
    log = SimpleNamespace(warning=lambda text, **_: warnings.append(text))
    monkeypatch.setattr(bench.node, "get_logger", lambda: log)
    bench.point(100.0, 50.0)
    bench.answer(GO_TO)
    assert warnings == []
    bench.point(100.0, 60.0)
    bench.answer(GO_TO, GoTo.Response(success=False, message="high wind"))
    (warning,) = warnings
    assert warning.endswith("refused: high wind")


def test_an_antenna_that_a_client_parked_is_released_by_the_next_place(bench: Bench) -> None:
    codes = bench.order("park")
    bench.antenna("parking")
    bench.answer(PARK)
    bench.antenna("parked")
    assert codes == [0]
    codes = bench.point(100.0, 50.0)
    assert (codes, bench.counts()) == ([], {PARK: 1, RESUME: 1})
    bench.answer(RESUME)
    assert bench.counts() == {PARK: 1, RESUME: 1, GO_TO: 1}
    bench.answer(GO_TO)
    assert codes == [0]
    # Released: whoever parks it next is another.
    bench.antenna("holding")
    bench.antenna("parked")
    assert bench.point(100.0, 50.0) == [REJECTED]


def test_a_refused_park_does_not_make_the_antenna_this_servers(bench: Bench) -> None:
    codes = bench.order("park")
    bench.answer(PARK, REFUSED)
    bench.antenna("parked")
    assert codes == [REJECTED]
    assert bench.point(100.0, 50.0) == [REJECTED]


def test_a_second_refusal_to_park_takes_nothing_back(bench: Bench) -> None:
    bench.order("park")
    bench.answer(PARK)
    bench.antenna("parked")
    bench.order("park")
    bench.answer(PARK, REFUSED)
    assert bench.point(100.0, 50.0) == []


# Services that do not answer


@pytest.mark.parametrize(("order", "service"), [("set_pos", GO_TO), ("park", PARK), ("stop", GO_TO)])
def test_a_service_that_is_missing_or_silent_for_2500_ms_is_the_clients_error(
    bench: Bench, order: str, service: str
) -> None:
    bench.services[service].ready = False
    assert bench.order(order, 100.0, 50.0) == [IO_ERROR]
    bench.services[service].ready = True
    codes = bench.order(order, 100.0, 60.0)
    bench.wait(2.5)
    bench.node.turn()
    assert codes == []
    bench.wait(0.01)
    bench.node.turn()
    assert codes == [TIMED_OUT]
    # An answer after that reaches nobody.
    bench.answer(service)
    assert codes == [TIMED_OUT]


def test_a_turn_is_short_while_a_client_is_connected(bench: Bench) -> None:
    bench.node._words.append("a line is longer than 1000 bytes")
    assert bench.node.turn() == 0.01
    assert not bench.node._words
    bench.port.counts.connected.clear()
    assert bench.node.turn() == 0.1


# Coming to rest


@pytest.mark.parametrize(
    ("axes_deg", "rates_deg_s", "rest_deg"),
    [((100.0, 40.0), (0.0, 0.0), (100.0, 40.0)),
     ((100.0, 40.0), (0.8, -0.4), (100.4, 39.9)),  # v^2/2a with 0.8 deg/s^2
     ((100.0, 40.0), (-0.8, 0.4), (99.6, 40.1)),
     ((219.9, 4.05), (0.8, -0.4), (220.0, 4.0)),
     ((-219.9, 89.45), (-0.8, 0.4), (-220.0, 89.5)),
     ((220.3, 3.8), (0.8, -0.4), (220.3, 3.8)),  # beyond the travel no farther
     ((-220.3, 89.9), (-0.8, 0.4), (-220.3, 89.9))],
)  # fmt: skip
def test_a_stop_is_where_the_axes_can_come_to_rest(
    bench: Bench, axes_deg: tuple[float, float], rates_deg_s: tuple[float, float], rest_deg: tuple[float, float]
) -> None:
    bench.axes(*axes_deg, tuple(np.radians(rates_deg_s)))
    bench.node._step(bench.t_s)
    codes = bench.order("stop")
    assert bench.went_deg() == pytest.approx(rest_deg)
    bench.answer(GO_TO, GoTo.Response(success=False, message="parked"))
    assert codes == [REJECTED]


def test_a_stop_ends_whatever_is_tracked_and_is_an_error_without_axes(bench: Bench) -> None:
    bench.track(target="OTHER")
    codes = bench.order("stop", client=RIVAL)
    assert bench.counts() == {STOP: 1}
    bench.answer(STOP, REFUSED)
    assert codes == [0]
    bench.track(target="")
    bench.node._joints = None
    assert bench.order("stop") == [IO_ERROR]


def test_a_stop_ends_the_motion_and_forgets_its_points(bench: Bench) -> None:
    bench.fly()
    bench.node._step(bench.t_s)
    assert len(bench.commands) == 1
    bench.order("stop")
    bench.node._step(bench.t_s + 0.1)
    assert len(bench.commands) == 1
    assert bench.node._place is None
    # Nor is the same place taken for one that was reached.
    assert bench.point(100.0, 40.0) == []


# Motion


def test_three_points_are_followed_ahead_of_time(bench: Bench) -> None:
    assert bench.fly() == [0]
    assert bench.counts() == {GO_TO: 2}
    bench.node._step(bench.t_s)
    (command,) = bench.commands
    assert seconds_from_stamp(command.header.stamp) == pytest.approx(bench.t_s, abs=STEP_RAD)
    assert command.header.frame_id == "/rotctld_server"
    since = [point.time_from_start.sec + 1e-9 * point.time_from_start.nanosec for point in command.points]
    assert since == pytest.approx(0.1 * np.arange(1, 11), abs=STEP_RAD)
    azimuth = np.degrees([point.positions[0] for point in command.points])
    # A straight fit of three unit vectors leaves the arc by less than 4 mdeg.
    assert azimuth == pytest.approx(101.0 + 0.5 * np.array(since), abs=1e-3)
    assert np.degrees([point.positions[1] for point in command.points]) == pytest.approx(np.full(10, 40.0), abs=4e-3)
    assert np.degrees([point.velocities[0] for point in command.points]) == pytest.approx(np.full(10, 0.5), abs=1e-3)


def test_commands_are_signed_with_the_key_of_the_antenna(make: Callable[..., Bench], tmp_path: Path) -> None:
    bench = make(command_key_file=str(tmp_path / "command.key"))
    bench.fly()
    bench.node._step(bench.t_s)
    servo = CommandKey(CommandKeyParams(command_key_file=str(tmp_path / "command.key")), "/joint_trajectory")
    assert servo.check(bench.commands[0]) == "/rotctld_server"


def test_the_time_of_a_point_is_that_of_its_arrival(bench: Bench) -> None:
    for index in range(3):
        bench.wait(1.0)
        bench.point(100.0 + 0.5 * index, 40.0, age_s=0.4)
    assert bench.t_s - bench.node._points.newest_s == pytest.approx(0.4, abs=STEP_RAD)


def test_a_motion_without_new_points_ends_after_3_s_at_rest(bench: Bench) -> None:
    bench.fly()
    bench.node._step(bench.t_s)
    bench.wait(3.0)
    bench.node._step(bench.t_s)
    assert len(bench.commands) == 2
    bench.axes(102.0, 40.0, (math.radians(0.8), 0.0))
    bench.node._step(bench.t_s + 0.1)
    assert len(bench.commands) == 2
    assert bench.went_deg() == pytest.approx((102.4, 40.0))
    bench.node._step(bench.t_s + 0.2)
    assert bench.counts() == {GO_TO: 3}


def test_the_motion_goes_on_past_the_last_point_on_the_turn_of_the_axes(bench: Bench) -> None:
    bench.axes(-100.0, 40.0)
    bench.node._step(bench.t_s)
    bench.fly(azimuth_deg=250.0)
    bench.node._step(bench.t_s)
    assert math.degrees(bench.commands[-1].points[0].positions[0]) == pytest.approx(-108.95, abs=0.01)


def test_of_two_turns_that_hold_the_motion_the_one_nearer_to_the_azimuth_axis_is_taken(bench: Bench) -> None:
    bench.axes(-150.0, 40.0)
    bench.node._step(bench.t_s)
    bench.fly(azimuth_deg=200.0)
    bench.node._step(bench.t_s)
    assert math.degrees(bench.commands[-1].points[0].positions[0]) == pytest.approx(-158.95, abs=0.01)


def test_at_the_end_of_its_travel_the_azimuth_unwinds_and_goes_on(bench: Bench) -> None:
    bench.axes(219.0, 40.0)
    bench.node._step(bench.t_s)
    # So near to the end of the travel that the rest of the motion is on the other turn.
    bench.fly(azimuth_deg=218.0)
    bench.node._azimuth_rad = math.radians(219.4)
    bench.node._step(bench.t_s)
    assert math.degrees(bench.commands[-1].points[-1].positions[0]) == pytest.approx(219.5, abs=0.01)
    bench.wait(1.0)
    bench.point(219.9, 40.0)
    bench.node._azimuth_rad = math.radians(219.9)
    bench.node._step(bench.t_s)
    azimuth = np.degrees([point.positions[0] for point in bench.commands[-1].points])
    assert azimuth == pytest.approx(-140.0, abs=1.0)
    assert math.degrees(bench.node._azimuth_rad) == pytest.approx(azimuth[0])


def test_the_last_point_of_a_command_decides_whether_the_azimuth_unwinds(bench: Bench) -> None:
    bench.axes(219.0, 40.0)
    bench.node._step(bench.t_s)
    # The last point of the next second is at 220.02 deg, the one before it at 219.97 deg.
    bench.fly(azimuth_deg=218.52)
    bench.node._azimuth_rad = math.radians(219.52)
    bench.node._step(bench.t_s)
    assert math.degrees(bench.commands[-1].points[0].positions[0]) == pytest.approx(-140.43, abs=0.01)


def test_below_the_least_elevation_the_axes_wait_at_it_and_follow_in_azimuth(bench: Bench) -> None:
    bench.fly(elevation_deg=1.0)
    bench.node._step(bench.t_s)
    points = bench.commands[-1].points
    assert np.degrees([point.positions[1] for point in points]) == pytest.approx(np.full(10, 4.1))
    assert np.array([point.velocities[1] for point in points]) == pytest.approx(np.zeros(10), abs=1e-9)
    assert np.array([point.accelerations[1] for point in points]) == pytest.approx(np.zeros(10), abs=1e-12)
    assert np.degrees([point.velocities[0] for point in points]) == pytest.approx(np.full(10, 0.5), abs=1e-3)


def test_what_leaves_the_travel_is_held_at_its_end_without_acceleration(bench: Bench) -> None:
    times = np.array([0.0, 1.0, 2.0, 3.0])
    position = np.radians([[218.0, 30.0], [219.0, 30.0], [221.0, 30.0], [224.0, 30.0]])
    found = bench.node._within(times, Motion(position.copy(), np.full((4, 2), 0.02), np.full((4, 2), 0.01)))
    assert np.degrees(found.position[:, 0]) == pytest.approx([218.0, 219.0, 220.0, 220.0])
    # From the end of the travel on, the velocity is that of the positions sent.
    assert np.degrees(found.velocity[2:, 0]) == pytest.approx([0.5, 0.0])
    assert found.velocity[:2, 0] == pytest.approx([0.02, 0.02])
    assert found.velocity[:, 1] == pytest.approx(np.full(4, 0.02))
    assert found.acceleration[:, 0] == pytest.approx([0.01, 0.01, 0.0, 0.0])
    low = bench.node._within(times, Motion(-position, np.full((4, 2), 0.02), np.full((4, 2), 0.01)))
    assert np.degrees(low.position[:, 0]) == pytest.approx([-218.0, -219.0, -220.0, -220.0])
    assert np.degrees(low.position[:, 1]) == pytest.approx(np.full(4, 4.1))


def test_points_that_the_antenna_refuses_are_refused_until_it_obeys(bench: Bench) -> None:
    bench.antenna(commands_rejected=4, last_rejection="old")
    assert bench.fly() == [0]
    bench.node._step(bench.t_s)
    assert bench.node._health().message == "follows points"
    bench.antenna(commands_rejected=4, commander="/other")
    assert bench.node._health().level == OK
    bench.antenna(commands_rejected=5, last_rejection="too fast")
    assert (bench.node._health().level, bench.node._health().message) == (WARN, "too fast")
    bench.antenna(commands_rejected=5)
    assert bench.point(101.1, 40.0) == [REJECTED]
    bench.antenna(commands_rejected=6, commander="/rotctld_server")
    assert bench.point(101.2, 40.0) == [0]


def test_a_refusal_while_nothing_is_followed_is_none_of_this_server(bench: Bench) -> None:
    bench.antenna(commands_rejected=5, last_rejection="too fast")
    assert bench.node._health().level == OK
    # The count goes on from there.
    bench.fly()
    bench.node._step(bench.t_s)
    bench.antenna(commands_rejected=5)
    assert bench.node._health().level == OK


# Passes


def test_points_of_a_known_satellite_become_its_pass(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    handle = bench.start_pass(monkeypatch)
    assert bench.services[SELECT].requests[-1].target == "25544"
    (goal,) = bench.passes.requests
    assert (goal.sensor, goal.target_pass.target) == ("program", "BIRD")
    # Until the controller commands, the points are followed.
    bench.node._step(bench.t_s)
    assert len(bench.commands) == 1
    bench.track(sent=0)
    bench.node._step(bench.t_s + 0.1)
    assert len(bench.commands) == 2
    bench.track(sent=1, target="OTHER")
    bench.node._step(bench.t_s + 0.2)
    assert len(bench.commands) == 3
    assert bench.node._health().message == "follows points"
    bench.track(sent=1)
    bench.node._step(bench.t_s + 0.3)
    assert len(bench.commands) == 3
    health = bench.node._health()
    assert (health.level, health.message, health.values["satellites"]) == (OK, "tracks BIRD", 3)
    bench.end_pass(handle)
    assert bench.node._health().message == "holds"


def test_a_satellite_is_not_tried_again_for_120_s_after_its_pass(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    bench.end_pass(bench.start_pass(monkeypatch))
    bench.wait(119.9)
    bench.fly(1)
    assert len(bench.services[SELECT].requests) == 1
    bench.wait(0.1)
    bench.fly(1)
    assert len(bench.services[SELECT].requests) == 2


@pytest.mark.parametrize(
    "fields",
    [{"success": False, "message": "unknown"}, {"passes": []}, {"sets_s": 0.0}, {"rises_s": 120.1}],
)
def test_a_satellite_without_a_pass_now_is_followed_by_its_points_for_120_s(
    bench: Bench, monkeypatch: pytest.MonkeyPatch, fields: dict[str, Any]
) -> None:
    bench.match(monkeypatch)
    bench.fly(3)
    bench.answer(SELECT, bench.selected(**fields))
    assert bench.passes.requests == []
    bench.node._step(bench.t_s)
    assert len(bench.commands) == 1
    bench.wait(119.9)
    bench.fly(1)
    assert len(bench.services[SELECT].requests) == 1
    bench.wait(0.1)
    bench.fly(1)
    assert len(bench.services[SELECT].requests) == 2


def test_a_pass_that_rises_within_120_s_is_tracked(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    bench.match(monkeypatch)
    bench.fly(3)
    bench.answer(SELECT, bench.selected(rises_s=119.9))
    assert len(bench.passes.requests) == 1


@pytest.mark.parametrize("missing", ["select", "silent", "passes", "refused"])
def test_without_the_other_nodes_the_points_are_followed(
    bench: Bench, monkeypatch: pytest.MonkeyPatch, missing: str
) -> None:
    bench.match(monkeypatch)
    bench.services[SELECT].ready = missing != "select"
    bench.passes.ready = missing != "passes"
    bench.fly(1)
    if missing == "silent":
        bench.wait(2.6)
        bench.node.turn()
    elif missing != "select":
        bench.answer(SELECT, bench.selected())
    if missing == "refused":
        bench.passes.futures[-1].answers.append(SimpleNamespace(accepted=False))
        bench.node.turn()
    assert bench.node._match is None
    assert bench.node._refused[25544] == bench.t_s + 120.0


def test_a_goal_that_the_controller_takes_too_late_is_cancelled(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    bench.match(monkeypatch)
    bench.fly(1)
    bench.answer(SELECT, bench.selected())
    bench.node._no_pass("no answer")
    handle = SimpleNamespace(accepted=True, cancelled=[])
    handle.cancel_goal_async = lambda: handle.cancelled.append(True)
    bench.passes.futures[-1].answers.append(handle)
    bench.node.turn()
    assert handle.cancelled == [True]
    assert bench.node._goal is None


def test_an_answer_about_a_satellite_that_is_given_up_is_ignored(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    bench.match(monkeypatch)
    bench.fly(1)
    bench.node._no_pass("no answer")
    bench.answer(SELECT, bench.selected())
    assert bench.passes.requests == []


def test_two_points_in_a_row_off_its_track_end_a_pass(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    handle = bench.start_pass(monkeypatch)
    bench.track()
    answers = [False, True, False, False]
    questions: list[Any] = []

    def on_track(_sky: Any, row: int, t_s: float, direction: Any, _params: Any) -> bool:
        questions.append((row, t_s, direction))
        return answers.pop(0)

    monkeypatch.setattr(rotctld_server, "on_track", on_track)
    for _ in range(3):
        assert bench.point(20.0, 30.0) == [0]
    row, t_s, direction = questions[-1]
    assert (row, t_s) == (0, bench.t_s)
    east, up = math.sin(math.radians(20.0)) * math.cos(math.radians(30.0)), 0.5
    assert (direction[0], direction[2]) == pytest.approx((east, up))
    codes = bench.point(20.0, 30.0)
    assert (codes, bench.services[STOP].requests != []) == ([], True)
    bench.answer(STOP)
    assert codes == [0]
    calls = bench.counts()[GO_TO]
    bench.end_pass(handle)
    # The place that the client named meanwhile is gone to, once.
    bench.node._step(bench.t_s)
    bench.node._step(bench.t_s + 0.1)
    assert bench.counts()[GO_TO] == calls + 1
    assert bench.went_deg() == pytest.approx((20.0, 30.0))
    bench.answer(GO_TO, GoTo.Response(success=False, message="high wind"))
    bench.node._step(bench.t_s + 0.2)
    assert bench.counts()[GO_TO] == calls + 1


def test_the_points_before_a_pass_mean_nothing_after_it(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    handle = bench.start_pass(monkeypatch)
    bench.track()
    bench.end_pass(handle)
    bench.node._step(bench.t_s)
    assert bench.commands == []
    assert bench.node._points.newest_s == -math.inf


def test_a_pass_refused_before_it_commands_leaves_the_points_in_force(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    bench.end_pass(bench.start_pass(monkeypatch))
    bench.node._step(bench.t_s)
    assert len(bench.commands) == 1


def test_a_pass_ends_when_its_client_is_silent_for_30_s(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    bench.start_pass(monkeypatch)
    bench.track()
    bench.wait(20.0)
    bench.port.last_s[CLIENT] = bench.wall_s
    bench.wait(30.0)
    bench.node._step(bench.t_s)
    assert bench.services[STOP].requests == []
    bench.wait(0.1)
    bench.node._step(bench.t_s)
    bench.node._step(bench.t_s)
    assert len(bench.services[STOP].requests) == 1


def test_the_last_command_of_a_client_that_is_gone_counts_too(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    bench.start_pass(monkeypatch)
    bench.track()
    bench.wait(29.9)
    bench.node._step(bench.t_s)
    assert bench.services[STOP].requests == []
    bench.wait(0.2)
    bench.node._step(bench.t_s)
    assert len(bench.services[STOP].requests) == 1


@pytest.mark.parametrize("order", ["park", "stop"])
def test_a_pass_is_stopped_before_the_antenna_parks_or_rests(
    bench: Bench, monkeypatch: pytest.MonkeyPatch, order: str
) -> None:
    bench.start_pass(monkeypatch)
    codes = bench.order(order)
    assert (len(bench.services[STOP].requests), len(bench.services[PARK].requests)) == (1, 0)
    bench.answer(STOP)
    if order == "park":
        assert (codes, len(bench.services[PARK].requests)) == ([], 1)
        bench.answer(PARK)
    assert codes == [0]


def test_a_satellite_is_looked_for_only_with_elements_and_once(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    bench.match(monkeypatch)
    sky, bench.node._sky = bench.node._sky, None
    bench.fly(3)
    assert SELECT not in bench.counts()
    bench.node._sky = sky
    bench.fly(2)
    assert bench.counts()[SELECT] == 1
    # One that is refused is let be, another is not.
    bench.answer(SELECT, bench.selected(success=False))
    monkeypatch.setattr(rotctld_server, "identify", lambda *_: Match(1, "OTHER", 7, 0.0, 0.0))
    bench.fly(1)
    assert bench.services[SELECT].requests[-1].target == "7"


# Elements


def elements(path: str) -> GetParameters.Response:
    return GetParameters.Response(values=[ParameterValue(type=4, string_value=path)])


def test_the_elements_of_the_publisher_are_loaded_again_every_600_s(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    loaded: list[Any] = []
    monkeypatch.setattr(rotctld_server, "load_catalogue", lambda path: loaded.append(path) or ["one", "two"])
    monkeypatch.setattr(
        rotctld_server, "CatalogueSky", lambda rows, site, t_s: SimpleNamespace(elements=rows, site=site, t_s=t_s)
    )
    service = bench.services[ELEMENTS]
    bench.node._step(bench.t_s)
    assert service.requests == []
    service.ready = True
    bench.node._step(bench.t_s)
    bench.node._step(bench.t_s)
    assert [request.names for request in service.requests] == [["source.elements"]]
    bench.answer(ELEMENTS, elements("/a.tle"))
    bench.node._loading.result(timeout=5.0)
    bench.node._step(bench.t_s)
    assert (loaded, bench.node._health().values["satellites"]) == (["/a.tle"], 2)
    assert (bench.node._sky.t_s, bench.node._sky.site) == (bench.t_s, bench.node.station.site)
    bench.wait(600.0)
    bench.node._step(bench.t_s)
    assert len(service.requests) == 1
    bench.wait(0.1)
    bench.node._step(bench.t_s)
    assert len(service.requests) == 2


def test_no_elements_are_loaded_during_a_pass_or_where_none_is_identified(
    bench: Bench, make: Callable[..., Bench], monkeypatch: pytest.MonkeyPatch
) -> None:
    bench.start_pass(monkeypatch)
    bench.services[ELEMENTS].ready = True
    bench.node._step(bench.t_s)
    assert bench.services[ELEMENTS].requests == []
    bench.close()
    other = make(identify=False)
    other.services[ELEMENTS].ready = True
    other.node._step(other.t_s)
    assert other.services[ELEMENTS].requests == []


def test_elements_that_cannot_be_read_are_a_warning_until_they_can(bench: Bench, tmp_path: Path) -> None:
    bench.services[ELEMENTS].ready = True
    bench.node._step(bench.t_s)
    bench.answer(ELEMENTS, elements(str(tmp_path / "none.tle")))
    with pytest.raises(ValueError, match=r"none\.tle"):
        bench.node._loading.result(timeout=5.0)
    bench.node._step(bench.t_s)
    health = bench.node._health()
    assert health.level == WARN
    assert "none.tle" in health.message
    assert bench.node._loading is None


# The node itself


def test_work_is_timed_while_the_node_is_active(bench: Bench) -> None:
    timers = len(list(bench.node.timers))
    bench.node.on_deactivate(ANY_STATE)
    assert len(list(bench.node.timers)) == timers - 1


def test_the_health_says_who_steers_and_what_was_refused(bench: Bench) -> None:
    bench.port.counts.refused_lines = 3
    bench.port.counts.last_refusal = "a line"
    bench.port.counts.refused_clients = 2
    health = bench.node._health()
    assert (health.level, health.message) == (OK, "waits")
    assert health.values == {
        "port": 4533, "clients": 2, "steering": "", "refused lines": 3, "last refused": "a line",
        "refused clients": 2, "satellites": 0,
    }  # fmt: skip
    bench.point(100.0, 50.0)
    assert (bench.node._health().message, bench.node._health().values["steering"]) == ("holds", CLIENT)


@pytest.mark.parametrize("state", ["rest", "motion", "pass"])
def test_deactivation_brings_what_moves_to_rest_and_closes_the_port(
    bench: Bench, monkeypatch: pytest.MonkeyPatch, state: str
) -> None:
    if state == "motion":
        bench.fly()
    elif state == "pass":
        bench.start_pass(monkeypatch)
    before = {GO_TO: 0, STOP: 0} | bench.counts()
    bench.node.on_deactivate(ANY_STATE)
    after = {GO_TO: 0, STOP: 0} | bench.counts()
    assert after[GO_TO] - before[GO_TO] == (state == "motion")
    assert after[STOP] - before[STOP] == (state == "pass")
    assert bench.port.closed
    assert bench.node._health().message == "not served"
    assert bench.node.turn() == 0.1


def test_the_server_is_connected_while_it_is_configured(default_context: None) -> None:
    node = RotctldServerNode()
    before = [len(list(kind)) for kind in (node.subscriptions, node.publishers, node.clients, node.waitables)]
    assert node.on_configure(ANY_STATE) == TransitionCallbackReturn.SUCCESS
    topics = {"joint_states", "antenna_status", "tracking_status", "executive_status", "pointing_model"}
    assert topics <= {each.topic_name.lstrip("/") for each in node.subscriptions}
    assert {GO_TO, PARK, RESUME, STOP, SELECT, ELEMENTS} <= {each.srv_name.lstrip("/") for each in node.clients}
    assert [name for name in node.diagnostics._checks if name == "clients"]
    node.on_cleanup(ANY_STATE)
    after = [len(list(kind)) for kind in (node.subscriptions, node.publishers, node.clients, node.waitables)]
    # `StationInUse` and the watches of the base go with the others.
    assert after == before
    node.end()
    node.lock.release()
    node.destroy_node()


def test_a_sensor_that_is_none_refuses_the_configuration(default_context: None) -> None:
    node = RotctldServerNode()
    node.set_parameters([Parameter("sensor", value="sextant")])
    assert node.on_configure(ANY_STATE) == TransitionCallbackReturn.FAILURE
    assert "sextant" in node._reason
    node.end()
    node.lock.release()
    node.destroy_node()
