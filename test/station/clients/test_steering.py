"""Whom the antenna obeys, what it makes of points, when a pass begins and ends: without ROS, on clocks of the test."""

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, precondition, rule

from rf_pointing.calibration import BiasModel
from rf_pointing.core import JointReading, JointTrajectory, angular_distance_rad, unit_vector_from_azel
from rf_pointing.drives.line_server import IO_ERROR, REJECTED, TIMED_OUT, Inquiry, Order, Session
from rf_pointing.drives.rotctld import Habit, StationView
from rf_pointing.station.clients.points import Follower, FollowParams, MatchParams
from rf_pointing.station.clients.steering import Answer, Steering, SteeringParams, steering_rows
from rf_pointing.station.description import read_station
from rf_pointing.station.parameters import controller_params
from rf_pointing.station.pointing.status import Level

CLIENT, RIVAL, NODE = "127.0.0.1:5001", "127.0.0.1:5002", "/gs1/rotctld_server"
STATION = read_station("dss13")
CONTROLLER = controller_params(STATION)
"""Travel -220 to 220 and 4 to 89.5 deg, acceleration 0.8 deg/s^2."""
OTHER_MOUNTS = {name: controller_params(read_station(name)) for name in ("xy_7m3", "polar_3m")}
RATE_DEG_S = 0.5


class Sky:
    """One satellite, at azimuth 100 deg at the beginning and with the motion of `Desk.fly`."""

    def __init__(self, begin_s: float, number: int = 25544) -> None:
        self.begin_s, self.elements = begin_s, [SimpleNamespace(name="BIRD", catalogue_number=number)]

    def directions(self, t_s: np.ndarray, rows: list[int] | None = None) -> tuple[np.ndarray, np.ndarray]:
        azimuth = np.radians(100.0 + RATE_DEG_S * (np.asarray(t_s) - self.begin_s))
        ways = unit_vector_from_azel(azimuth, np.full(len(t_s), math.radians(40.0)))
        return np.stack([ways] * (1 if rows is None else len(rows))), np.ones(1 if rows is None else len(rows), bool)


class Desk:
    """A steering desk at a holding antenna, whose axes are at azimuth 100 and elevation 40 deg."""

    def __init__(self, known: bool = False, **params: Any) -> None:
        self.t_s, self.wall_s = 1.8e9, 1000.0
        self.asked: dict[int, tuple[str, dict[str, Any], float]] = {}
        """Directives without an answer, with their times."""
        self.log: list[str] = []
        self.sent: list[str] = []
        self.offered = set(steering_rows())
        self.heard = {CLIENT: 0.0, RIVAL: 0.0}
        self.known = SimpleNamespace(sky=Sky(self.t_s) if known else None, problem="")
        self.steering = Steering(
            SteeringParams(**params), MatchParams(), Follower(CONTROLLER, FollowParams()), self.known,
            StationView("a dish"), node=NODE, send=self.send, heard_s=lambda client: self.heard.get(client, -math.inf),
            inform=self.log.append, warn=lambda subject, words: self.log.append(f"{subject}: {words}"),
        )  # fmt: skip
        self.steering.turn(self.t_s, self.wall_s)
        self.tracked = ("", 0)
        """Target of the controller, and how many commands it has sent."""
        self.track()
        self.antenna()
        self.axes(100.0, 40.0)

    def send(self, number: int, name: str, arguments: Any) -> None:
        self.sent.append(name)
        if name in self.offered:
            self.asked[number] = name, dict(arguments), self.wall_s
        else:
            self.steering.answered(number, Answer(IO_ERROR, f"{name} is not offered"))

    def answer(self, name: str, code: int = 0, text: str = "", passes: Any = ()) -> dict[str, Any]:
        """Answer the oldest directive of a name; return its arguments."""
        number = next(number for number, (asked, *_) in self.asked.items() if asked == name)
        arguments = self.asked.pop(number)[1]
        self.steering.answered(number, Answer(code, text, tuple(passes)))
        self.number = number
        return arguments

    def track(self, *tracked: Any) -> None:
        """Report what the controller tracks."""
        self.tracked = tracked or self.tracked
        self.steering.note_tracking(*self.tracked)

    def antenna(
        self, mode: str = "", fault: str = "", commander: str = "", rejected: int = 0, reason: str = ""
    ) -> None:
        """Report the antenna, by default one that obeys."""
        mode = mode or ("tracking" if self.steering.in_pass or self.steering.follower.points.moving else "holding")
        self.steering.note_antenna(mode, fault, commander, rejected, reason)

    def axes(self, azimuth_deg: float, elevation_deg: float, rates_deg_s: tuple[float, float] = (0.0, 0.0)) -> None:
        self.steering.note_axes(reading(azimuth_deg, elevation_deg, rates_deg_s))

    def order(self, name: str, *values: float, client: str = CLIENT, age_s: float = 0.0) -> list[int]:
        """Give an order; return the list in which its code arrives."""
        codes: list[int] = []
        self.steering.order(Inquiry(Order(name, values), client, self.wall_s - age_s, codes.append))
        return codes

    def point(self, azimuth_deg: float, elevation_deg: float = 40.0, **how: Any) -> list[int]:
        return self.order("set_pos", azimuth_deg, elevation_deg, **how)

    def wait(self, seconds: float, silent: bool = False) -> None:
        self.t_s, self.wall_s = self.t_s + seconds, self.wall_s + seconds
        self.steering.turn(self.t_s, self.wall_s)
        if not silent:
            self.track()
            self.antenna()

    def step(self) -> JointTrajectory | None:
        return self.steering.step(self.t_s, self.wall_s)

    def command(self) -> JointTrajectory:
        found = self.step()
        assert found is not None
        return found

    def report(self) -> tuple[Level, str]:
        server: Any = SimpleNamespace(values=dict)
        return self.steering.report(server)[:2]

    def fly(self, points: int = 3, azimuth_deg: float = 100.0, elevation_deg: float = 40.0) -> list[int]:
        """Send points of a motion in azimuth, one a second; return the codes of the last."""
        for index in range(points):
            if index:
                self.wait(1.0)
            codes = self.point(azimuth_deg + RATE_DEG_S * index, elevation_deg)
        return codes

    def start_pass(self) -> int:
        """Fly until the pass of the satellite is accepted; return its number."""
        self.fly(4)
        self.answer("select_target", passes=[(self.t_s - 60.0, self.t_s + 300.0, "the pass")])
        assert self.answer("track") == {"target_pass": "the pass", "sensor": "program"}
        number = self.number
        self.track("BIRD", 0)
        return number


def reading(azimuth_deg: float, elevation_deg: float, rates_deg_s: tuple[float, float] = (0.0, 0.0)) -> JointReading:
    return JointReading(
        t_s=1.8e9, position_rad=np.radians([azimuth_deg, elevation_deg]), velocity_rad_s=np.radians(rates_deg_s)
    )


@pytest.fixture
def desk() -> Desk:
    return Desk()


@pytest.fixture
def known() -> Desk:
    """Return a desk that knows the satellite of the points."""
    return Desk(known=True)


class Steered(RuleBasedStateMachine):
    """Any orders of two clients, answers and states of the station, in any order."""

    def __init__(self) -> None:
        super().__init__()
        self.desk = Desk(known=True)
        self.codes: list[list[int]] = []
        self.state = {"mode": "", "fault": "", "executive": "", "target": ""}
        self.steered: tuple[str, float] = ("", -math.inf)

    def refuses(self, client: str) -> bool:
        """Return whether a client may not move the antenna now."""
        desk, (holder, since_s) = self.desk, self.steered
        due_s = {"select_target": 2.5, "track": 20.0}
        matched = any(desk.wall_s - since <= due_s.get(asked, -1.0) for asked, _, since in desk.asked.values())
        others = self.state["target"] and not desk.steering.in_pass and not matched
        leased = holder not in ("", client) and desk.wall_s - since_s < 10.0
        return bool(self.state["fault"] or self.state["executive"] == "running" or others or leased)

    @rule(
        client=st.sampled_from([CLIENT, RIVAL]), name=st.sampled_from(["set_pos", "set_pos", "set_pos", "park"]),
        ahead_deg=st.sampled_from([0.0, 0.0, 0.0, 30.0, 150.0]), elevation_deg=st.sampled_from([40.0, 40.0, 1.0]),
    )  # fmt: skip
    def an_order_moves_the_antenna_only_where_it_may(
        self, client: str, name: str, ahead_deg: float, elevation_deg: float
    ) -> None:
        desk, refuses = self.desk, self.refuses(client)
        values = (100.0 + ahead_deg + RATE_DEG_S * (desk.t_s - 1.8e9), elevation_deg) if name == "set_pos" else ()
        count = len(desk.sent)
        codes = desk.order(name, *values, client=client)
        self.codes.append(codes)
        if refuses:
            assert codes == [REJECTED]
            assert len(desk.sent) == count
        else:
            assert codes in ([], [0], [REJECTED])
            assert codes != [REJECTED] or self.state["mode"], "an antenna that obeys"
            self.steered = (client, desk.wall_s) if name == "set_pos" else self.steered

    @rule(client=st.sampled_from([CLIENT, RIVAL]))
    def a_client_follows_the_satellite(self, client: str) -> None:
        for _ in range(4):
            self.an_order_moves_the_antenna_only_where_it_may(client, "set_pos", 0.0, 40.0)
            self.time_goes_on(1.0)
            self.the_station_reports()

    @rule(client=st.sampled_from([CLIENT, RIVAL]))
    def a_stop_of_who_may_leaves_nothing_to_follow(self, client: str) -> None:
        desk, (holder, since_s) = self.desk, self.steered
        count, passing = len(desk.sent), desk.steering.in_pass
        leased = holder not in ("", client) and desk.wall_s - since_s < 10.0
        refuses = leased if passing else self.refuses(client)
        self.codes.append(desk.order("stop", client=client))
        assert desk.sent[count:] == ([] if refuses else ["stop_pass" if passing else "go_to"])
        assert refuses or desk.step() is None

    @precondition(lambda self: self.desk.asked)
    @rule(refused=st.booleans(), rises_s=st.sampled_from([-60.0, 1000.0]))
    def another_node_answers(self, refused: bool, rises_s: float) -> None:
        name = next(iter(self.desk.asked.values()))[0]
        begin_s = self.desk.t_s + rises_s
        self.desk.answer(name, REJECTED if refused else 0, "words", [(begin_s, begin_s + 300.0, "pass")])

    @rule(what=st.sampled_from(["fault", "executive", "target", "mode"]), on=st.booleans())
    def the_station_changes(self, what: str, on: bool) -> None:
        states = {"fault": "stop", "executive": "running", "target": "OTHER", "mode": "holding"}
        self.state[what] = states[what] if on else ""

    @rule(seconds=st.sampled_from([0.1, 1.0, 1.0, 1.0, 4.0, 11.0]))
    def time_goes_on(self, seconds: float) -> None:
        self.desk.wait(seconds, silent=True)

    @precondition(lambda self: self.desk.steering.in_pass)
    @rule()
    def a_pass_ends(self) -> None:
        self.desk.steering.ended(self.desk.number, "over", 1.0)

    @invariant()
    def the_station_reports(self) -> None:
        self.desk.antenna(self.state["mode"], self.state["fault"])
        self.desk.steering.note_executive(self.state["executive"])
        self.desk.steering.note_tracking(self.state["target"], 0)

    @invariant()
    def commands_stay_inside_the_travel(self) -> None:
        command = self.desk.step()
        if command is not None:
            low, high = CONTROLLER.limits.lowest_rad, CONTROLLER.limits.highest_rad
            assert np.all(command.position_rad >= np.array(low) - 1e-9)
            assert np.all(command.position_rad <= np.array(high) + 1e-9)

    def teardown(self) -> None:
        """Every order has one code by the time that its services have to answer in."""
        for _ in range(4):
            self.desk.wait(20.1)
        assert [len(codes) for codes in self.codes] == [1] * len(self.codes)


TestSteered = Steered.TestCase
TestSteered.settings = settings(max_examples=60, stateful_step_count=30, deadline=None)


# Places and motions

LIMITS = CONTROLLER.limits
AZIMUTHS = st.floats(-180.0, 450.0)
MODEL = BiasModel.zero().replace(
    azimuth_offset=0.005, elevation_offset=-0.003, azimuth_velocity_lag=0.5, elevation_velocity_lag=0.25
)


@given(AZIMUTHS, st.floats(4.2, 80.0), st.floats(-219.0, 219.0), st.booleans())
def test_the_beam_of_the_axes_at_a_place_is_that_place_on_the_nearest_turn(
    azimuth_deg: float, elevation_deg: float, encoder_deg: float, modelled: bool
) -> None:
    follower = Follower(CONTROLLER, FollowParams())
    follower.model = MODEL if modelled else None
    follower.points.add(0.0, math.radians(azimuth_deg), math.radians(elevation_deg))
    place_deg = np.degrees(follower.place_rad(reading(encoder_deg, 40.0)))
    beam_deg = np.degrees(follower.beam_rad(reading(*place_deg)))
    assert math.remainder(beam_deg[0] - azimuth_deg, 360.0) == pytest.approx(0.0, abs=1e-6)
    assert beam_deg[1] == pytest.approx(elevation_deg, abs=1e-6)
    assert -220.0 <= beam_deg[0] <= 220.0
    for other_deg in (beam_deg[0] - 360.0, beam_deg[0] + 360.0):
        outside = abs(other_deg) > 220.0
        assert outside or abs(beam_deg[0] - encoder_deg) <= abs(other_deg - encoder_deg) + 1e-6


@pytest.mark.parametrize("name", ["xy_7m3", "polar_3m"])
@given(azimuth_deg=st.floats(0.0, 359.0), elevation_deg=st.floats(8.0, 80.0))
def test_a_place_on_the_sky_is_held_by_the_axes_of_any_mount(
    name: str, azimuth_deg: float, elevation_deg: float
) -> None:
    controller = OTHER_MOUNTS[name]
    follower = Follower(controller, FollowParams())
    follower.points.add(0.0, math.radians(azimuth_deg), math.radians(elevation_deg))
    place = follower.place_rad(reading(0.0, 0.0))
    beam = follower.beam_rad(reading(*np.degrees(place)))
    assert np.degrees(beam) == pytest.approx((azimuth_deg, elevation_deg), abs=1e-6)
    assert controller.kinematics.sky_at(*place.tolist()) == pytest.approx(beam, abs=1e-9)


@pytest.mark.parametrize("name", ["xy_7m3", "polar_3m"])
def test_points_of_a_pass_are_followed_by_the_axes_of_any_mount(name: str) -> None:
    """Straight over the sky at 0.5 deg/s: the commanded axes look where the points go."""
    controller = OTHER_MOUNTS[name]
    follower, rows, last = Follower(controller, FollowParams()), [], 60
    along = lambda t: (math.radians(200.0 + 0.2 * t), math.radians(30.0 + 0.5 * t))  # noqa: E731
    axes = reading(0.0, 0.0)
    for t_s in range(last):
        follower.points.add(float(t_s), *along(t_s))
        if follower.points.moving:
            command = follower.command(float(t_s), axes)
            rows.append((command.t_s, command.position_rad))
            axes = reading(*np.degrees(command.position_rad[0]))
    assert not follower.unwinds
    assert len(rows) > 50
    for times, positions in rows[20:]:
        wanted = np.array([along(t) for t in times])
        apart = angular_distance_rad(*controller.kinematics.skies(positions).T, *wanted.T)
        assert np.degrees(apart).max() < 0.02


@given(st.floats(-221.0, 221.0), st.floats(3.0, 90.0), st.tuples(st.floats(-2.0, 2.0), st.floats(-2.0, 2.0)))
def test_axes_come_to_rest_after_v_squared_over_2a_or_at_the_end_of_their_travel(
    azimuth_deg: float, elevation_deg: float, rates_deg_s: tuple[float, float]
) -> None:
    now, rates = np.array([azimuth_deg, elevation_deg]), np.array(rates_deg_s)
    rest = np.degrees(Follower(CONTROLLER, FollowParams()).rest_rad(reading(azimuth_deg, elevation_deg, rates_deg_s)))
    free = now + rates * np.abs(rates) / (2.0 * 0.8)
    inside = (np.degrees(LIMITS.lowest_rad) <= free) & (free <= np.degrees(LIMITS.highest_rad))
    assert rest[inside] == pytest.approx(free[inside], abs=1e-9)
    # Beyond its travel an axis goes no farther.
    lowest, highest = np.minimum(now, np.degrees(LIMITS.lowest_rad)), np.maximum(now, np.degrees(LIMITS.highest_rad))
    assert np.all((rest >= lowest - 1e-9) & (rest <= highest + 1e-9))


def test_three_points_are_followed_ahead_of_time_by_when_they_arrived(desk: Desk) -> None:
    assert desk.fly() == [0]
    assert desk.sent == ["go_to", "go_to"]
    command = desk.command()
    ahead = command.t_s - desk.t_s
    assert ahead == pytest.approx(0.1 * np.arange(1, 11), abs=1e-6)
    # A straight fit of three unit vectors leaves the arc by less than 4 mdeg.
    assert np.degrees(command.position_rad[:, 0]) == pytest.approx(101.0 + 0.5 * ahead, abs=1e-3)
    assert np.degrees(command.position_rad[:, 1]) == pytest.approx(np.full(10, 40.0), abs=4e-3)
    assert np.degrees(command.velocity_rad_s[:, 0]) == pytest.approx(np.full(10, 0.5), abs=1e-3)
    desk.wait(1.0)
    desk.point(101.5, age_s=0.4)
    assert desk.t_s - desk.steering.follower.points.newest_s == pytest.approx(0.4, abs=1e-6)


def test_at_the_end_of_its_travel_the_azimuth_unwinds_and_goes_on(desk: Desk) -> None:
    desk.axes(218.0, 40.0)
    desk.fly(azimuth_deg=217.9)
    follower = desk.steering.follower
    # The rest of the motion is on the other turn, but an azimuth that is under way stays on its own.
    for azimuth_deg, first_deg in ((218.9, 218.95), (219.4, 219.45), (219.9, -140.05)):
        follower.azimuth_rad = math.radians(218.9)
        assert math.degrees(desk.command().position_rad[0, 0]) == pytest.approx(first_deg, abs=0.02)
        assert follower.unwinds is (first_deg < 0.0)
        desk.wait(1.0)
        desk.point(azimuth_deg + 0.5)
    assert "unwinding" in desk.log[-1]


def test_a_motion_without_new_points_ends_after_3_s_where_the_axes_can_stop(desk: Desk) -> None:
    desk.fly()
    desk.wait(3.0)
    assert desk.step() is not None
    desk.wait(0.1)
    desk.axes(102.0, 40.0, (0.8, 0.0))
    desk.asked.clear()
    assert desk.step() is None
    assert desk.step() is None
    assert math.degrees(desk.answer("go_to")["azimuth"]) == pytest.approx(102.4)
    assert "holding: no further point for 3.1 s" in desk.log
    assert not desk.asked


def test_a_place_sent_again_moves_nothing_within_5_mdeg_unless_it_was_not_reached(desk: Desk) -> None:
    for code, azimuth_deg, asked in ((0, 110.0, True), (0, 110.004, False), (REJECTED, 115.0, True), (0, 115.0, True)):
        codes = desk.point(azimuth_deg)
        assert bool(desk.asked) is asked
        if asked:
            desk.answer("go_to", code, "high wind")
        assert codes == [code]
        desk.wait(5.0)
    assert desk.log == ["P refused: high wind"]
    # A motion has left it.
    desk.fly()
    desk.command()
    desk.wait(5.0)
    desk.asked.clear()
    assert desk.point(100.5) == []
    desk.answer("go_to")


def test_points_that_the_antenna_refuses_are_refused_until_it_obeys(desk: Desk) -> None:
    desk.antenna(rejected=4, reason="old")
    desk.fly()
    desk.antenna(rejected=4)
    assert desk.report() == (Level.OK, "holds")
    desk.step()
    assert desk.report() == (Level.OK, "follows points")
    desk.antenna(rejected=5, reason="too fast")
    assert desk.report() == (Level.WARN, "too fast")
    desk.antenna(rejected=5)
    assert desk.point(101.1) == [REJECTED]
    desk.antenna(rejected=6, commander=NODE)
    assert desk.point(101.2) == [0]
    # A jump is a place again.
    desk.point(20.0)
    assert desk.report() == (Level.OK, "holds")


# Who may move the antenna


@pytest.mark.parametrize(("silent_s", "code"), [(2.0, None), (2.01, IO_ERROR)])
@pytest.mark.parametrize("name", ["set_pos", "park"])
def test_clients_read_where_the_beam_is_until_the_antenna_is_silent_for_2_s(
    desk: Desk, silent_s: float, code: int | None, name: str
) -> None:
    desk.axes(100.0, 40.0, (0.01, -0.005))
    assert (desk.steering.view.position_deg, desk.steering.view.moving) == (pytest.approx((100.0, 40.0)), (1, 0))
    desk.axes(100.0, 40.0, (0.005, -0.01))
    assert desk.steering.view.moving == (0, -1)
    desk.wait(silent_s, silent=True)
    assert desk.order(name, *((100.0, 50.0) if name == "set_pos" else ())) == ([] if code is None else [code])
    desk.step()
    assert (desk.steering.view.position_deg is None) is (code is not None)


def test_a_client_that_sees_a_code_alone_can_ask_for_the_reason(desk: Desk) -> None:
    desk.antenna("parked")
    assert desk.point(110.0) == [REJECTED]
    view = desk.steering.view
    assert view.reason.endswith("the antenna was parked by somebody else; release it first")
    assert view.reason in view.fields("get_info", Habit())[0][0]
    order = Order("set_pos", (110.0, 40.0), "110 40", "\n")
    asked = Session.answer(order, REJECTED, (), view.reason).decode().splitlines()
    assert asked == ["set_pos: 110 40", f"Reason: {view.reason}", "RPRT -9"]
    # The next order that is carried out has none.
    desk.antenna("holding")
    desk.point(110.0)
    assert view.reason == ""


@given(azimuth_deg=st.floats(-170.0, 170.0), elevation_deg=st.floats(89.0, 90.0), bias_deg=st.floats(-0.5, 0.5))
@settings(deadline=None, max_examples=30)
def test_near_the_zenith_a_client_reads_the_azimuth_of_the_axes(
    azimuth_deg: float, elevation_deg: float, bias_deg: float
) -> None:
    desk = Desk()
    zero = dict(BiasModel.zero().coefficients)
    desk.steering.follower.model = BiasModel(zero | {"elevation_offset": math.radians(bias_deg)})
    desk.axes(azimuth_deg, elevation_deg)
    azimuth, elevation = Habit(negative=True).shown_deg(*desk.steering.view.position_deg)
    assert azimuth == pytest.approx(azimuth_deg, abs=0.006)
    assert elevation == pytest.approx(min(90.0, elevation_deg - bias_deg), abs=0.006)


def test_an_antenna_that_a_client_parked_is_released_by_the_next_place(desk: Desk) -> None:
    refused = desk.order("park")
    desk.answer("park", REJECTED)
    desk.antenna("parked")
    assert refused + desk.point(100.0, 50.0) == [REJECTED, REJECTED]
    desk.antenna("holding")
    codes = desk.order("park")
    desk.antenna("parking")
    desk.answer("park")
    desk.antenna("parked")
    # A second request that is refused takes nothing back.
    assert desk.order("park") == []
    desk.answer("park", REJECTED)
    codes += desk.point(100.0, 50.0)
    desk.answer("release")
    desk.answer("go_to")
    assert (codes, desk.sent) == ([0], ["park", "park", "park", "release", "go_to"])
    # Released: whoever parks it next is another.
    desk.antenna("holding")
    desk.antenna("parked")
    assert desk.point(100.0, 50.0) == [REJECTED]


@pytest.mark.parametrize(("order", "name"), [("set_pos", "go_to"), ("park", "park"), ("stop", "go_to")])
def test_a_service_that_is_missing_or_silent_for_2500_ms_is_the_clients_error(
    desk: Desk, order: str, name: str
) -> None:
    values = (110.0, 50.0) if order == "set_pos" else ()
    desk.offered.remove(name)
    assert desk.order(order, *values) == [IO_ERROR]
    desk.offered.add(name)
    codes = desk.order(order, *values)
    desk.wait(2.5)
    assert codes == []
    desk.wait(0.01)
    assert codes == [TIMED_OUT]
    # An answer after that reaches nobody.
    desk.answer(name)
    assert codes == [TIMED_OUT]


# Passes of known satellites


def test_points_of_a_known_satellite_become_its_pass_once_the_controller_commands(known: Desk) -> None:
    number = known.start_pass()
    assert any("the points are those of BIRD (25544)" in line for line in known.log)
    for target, sent, follows in (("BIRD", 0, True), ("OTHER", 1, True), ("BIRD", 1, False)):
        known.track(target, sent)
        assert (known.step() is not None) is follows
    assert known.report() == (Level.OK, "tracks BIRD")
    known.wait(1.0)
    known.steering.ended(number, "loss of signal", 12.0)
    assert known.report() == (Level.OK, "holds")
    # What was sent for the pass is over with it.
    assert known.steering.follower.points.newest_s == -math.inf
    assert "BIRD: loss of signal; 12 s tracked" in known.log


@pytest.mark.parametrize(
    "reason", ["no target", "no pass", "over", "later", "refused", "absent", "silent", "no goal", "ended"]
)
def test_a_satellite_that_is_refused_is_followed_by_its_points_for_120_s_and_one_without_an_answer_for_less(
    known: Desk, reason: str
) -> None:
    if reason == "absent":
        known.offered.remove("select_target")
    known.fly(4)
    begin_s, end_s = {"over": (-300.0, 0.0), "later": (120.1, 500.0)}.get(reason, (119.9, 500.0))
    coming = [] if reason == "no pass" else [(known.t_s + begin_s, known.t_s + end_s, "pass")]
    if reason == "silent":
        known.wait(2.6)
    elif reason != "absent":
        known.answer("select_target", REJECTED if reason == "no target" else 0, "words", coming)
    if reason == "refused":
        known.answer("track", IO_ERROR, "the goal was refused")
    elif reason == "no goal":
        known.wait(20.1)
    elif reason == "ended":
        known.answer("track")
        known.steering.ended(known.number, "refused", 0.0)
    reported = any("BIRD is not tracked, its points are followed" in line for line in known.log)
    assert reported is (reason != "ended")
    assert (known.step() is None) is (reason == "no goal"), "20 s later the points are old"
    if reason in ("absent", "silent", "no goal"):
        known.offered.add("select_target")
        count = known.sent.count("select_target")
        known.wait(2.6)
        known.known.sky = Sky(known.t_s)
        known.fly(5)
        assert known.sent.count("select_target") == count + 1
        return
    again_s = known.t_s + 120.0
    count = known.sent.count("select_target")
    known.known.sky = Sky(again_s - 3.1)
    known.wait(again_s - 3.1 - known.t_s)
    known.fly(4)
    assert known.sent.count("select_target") == count
    # Another satellite is none of it.
    known.wait(0.2)
    known.point(101.55)
    assert known.sent.count("select_target") == count + 1


def test_two_points_in_a_row_off_its_track_end_a_pass_and_the_last_is_gone_to(known: Desk) -> None:
    number = known.start_pass()
    known.track("BIRD", 1)
    for azimuth_deg in (20.0, 102.0, 20.0):
        known.wait(1.0)
        assert known.point(azimuth_deg if azimuth_deg == 20.0 else 100.0 + RATE_DEG_S * (known.t_s - 1.8e9)) == [0]
    codes = known.point(20.0)
    known.answer("stop_pass")
    assert codes == [0]
    known.asked.clear()
    known.steering.ended(number, "stopped", 5.0)
    known.step()
    known.step()
    assert math.degrees(known.answer("go_to", REJECTED)["azimuth"]) == pytest.approx(20.0)
    known.step()
    assert not known.asked


@pytest.mark.parametrize("connected", [True, False])
def test_a_pass_ends_when_its_client_has_been_silent_for_30_s(known: Desk, connected: bool) -> None:
    known.start_pass()
    known.track("BIRD", 1)
    if connected:
        known.wait(20.0)
        known.heard[CLIENT] = known.wall_s
    else:
        known.heard.clear()
    for seconds, count in ((30.0, 0), (0.1, 1), (5.0, 1)):
        known.wait(seconds)
        known.step()
        assert known.sent.count("stop_pass") == count


@pytest.mark.parametrize("order", ["park", "stop"])
def test_a_pass_is_stopped_before_the_antenna_parks_or_rests(known: Desk, order: str) -> None:
    known.start_pass()
    known.asked.clear()
    codes = known.order(order)
    known.answer("stop_pass")
    if order == "park":
        known.answer("park")
    assert (codes, known.asked) == ([0], {})


def test_a_pass_that_the_controller_no_longer_names_is_given_up_within_1_2_s_and_sent_again(known: Desk) -> None:
    known.start_pass()
    known.track("BIRD", 1)
    assert known.step() is None
    for silent_s, follows in ((1.1, False), (0.2, True)):
        known.wait(silent_s, silent=True)
        known.antenna("tracking")
        assert (known.step() is not None) is follows, "the points that have come meanwhile"
        known.point(100.0 + RATE_DEG_S * (known.t_s - 1.8e9))
    assert "pointing_controller has lost it, silent for 1.2 s" in known.log[-2] + known.log[-1]
    # Nobody is asked for a pass before a controller is heard again; then the same goal is.
    known.wait(1.0, silent=True)
    known.antenna("tracking")
    for count, tracked in ((1, ()), (2, ("", 0))):
        if tracked:
            known.track(*tracked)
        assert known.point(100.0 + RATE_DEG_S * (known.t_s - 1.8e9)) == [0]
        assert known.sent.count("select_target") == count
        known.wait(0.5, silent=True)
    known.answer("select_target", passes=[(known.t_s - 60.0, known.t_s + 300.0, "the pass")])
    assert known.answer("track")["target_pass"] == "the pass"
    assert known.steering.in_pass


@pytest.mark.parametrize("passing", [False, True])
def test_points_are_refused_while_the_antenna_has_rested_for_1_2_s(known: Desk, passing: bool) -> None:
    if passing:
        known.start_pass()
        known.track("BIRD", 1)
    else:
        known.known.sky = None
        known.fly(4)
    for mode, code in (("tracking", 0), ("holding", 0), ("holding", 0), ("paused", REJECTED), ("tracking", 0)):
        known.wait(0.55, silent=True)
        known.track()
        known.antenna(mode)
        assert known.point(100.0 + RATE_DEG_S * (known.t_s - 1.8e9)) == [code]
    assert "nothing is followed: the antenna has been paused for more than 1.2 s" in known.log


def test_points_of_the_satellite_that_is_tracked_for_somebody_else_are_accepted_and_move_nothing(known: Desk) -> None:
    known.track("BIRD", 5)
    answers = []
    for second in range(6):
        known.antenna("tracking")
        known.track()
        answers += known.point(100.0 + RATE_DEG_S * second) + known.order("stop")
        known.wait(1.0, silent=True)
    assert answers == 3 * [REJECTED] * 2 + 3 * [0, REJECTED]
    known.antenna("tracking")
    assert known.point(20.0) == [REJECTED]
    assert (known.sent, known.step()) == ([], None)
    # Without a controller nothing is tracked, whatever it said last.
    known.wait(2.1, silent=True)
    known.antenna()
    assert known.point(130.0) == []
    assert known.sent == ["go_to"]


def test_a_pass_of_somebody_else_takes_the_antenna_from_the_points(desk: Desk) -> None:
    desk.fly(4)
    desk.command()
    desk.track("OTHER", 1)
    assert desk.step() is None
    assert desk.point(102.0) == [REJECTED]
    assert desk.sent.count("stop_pass") == 0


def test_a_pass_whose_acceptance_is_lost_is_known_by_its_status(known: Desk) -> None:
    known.fly(4)
    known.answer("select_target", passes=[(known.t_s - 60.0, known.t_s + 300.0, "the pass")])
    known.wait(1.0)
    known.track("BIRD", 1)
    known.track("BIRD", 2)
    assert known.steering.in_pass
    assert known.step() is None, "the controller commands"


def test_a_stop_frees_from_a_controller_that_is_gone_and_from_a_pass_that_is_being_begun(known: Desk) -> None:
    known.start_pass()
    codes = known.order("stop")
    known.wait(1.1, silent=True)
    known.antenna("tracking")
    while not codes:
        known.answer("go_to")
    assert (codes, known.steering.in_pass) == ([0], False)
    known.track("", 0)
    known.wait(10.0)
    known.known.sky = Sky(known.t_s)
    known.fly(4)
    codes = known.order("stop")
    while not codes:
        known.answer("go_to")
    known.answer("select_target", passes=[(known.t_s - 60.0, known.t_s + 300.0, "the pass")])
    known.answer("track")
    assert (codes, known.sent[-1]) == ([0], "stop_pass")


@pytest.mark.parametrize("state", ["rest", "motion", "pass"])
def test_what_moves_for_clients_is_brought_to_rest(known: Desk, state: str) -> None:
    if state == "motion":
        known.fly()
    elif state == "pass":
        known.start_pass()
    known.sent.clear()
    known.steering.rest()
    assert known.sent == {"rest": [], "motion": ["go_to"], "pass": ["stop_pass"]}[state]
