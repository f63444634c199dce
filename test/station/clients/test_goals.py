"""Goals of the controller: one at a time, each ends once, a refused one has moved nothing, no period is lost."""

import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, precondition, rule, run_state_machine_as_test

from rf_pointing.calibration import BiasModel
from rf_pointing.core import LOSS_OF_SIGNAL, JointReading, JointTrajectory
from rf_pointing.ephemeris import Pass, TopocentricTrack
from rf_pointing.station.clients.goals import FEEDBACK_S, NEAR_S, PATIENCE_WALL_S, PassGoal, PassGoals, nearest_pass
from rf_pointing.station.pointing.certificates import StoreParams
from rf_pointing.station.pointing.controller import PointingController, WiderBand
from rf_pointing.station.pointing.status import Level, TrackingStatus

PERIOD_S = 0.1
MakeController = Callable[..., PointingController]


@dataclass
class Search:
    """An answer of the ephemeris that comes when the test gives it; a text is a refusal."""

    goal: PassGoal
    from_s: float
    made: bool = True
    answer: list[Pass] | str | None = None

    def done(self) -> bool:
        return self.answer is not None

    def passes(self) -> list[Pass]:
        if isinstance(self.answer, str):
            raise ValueError(self.answer)
        return self.answer or []


@dataclass
class World:
    """What is around the goals: axes that are where they were sent, and lists of what was sent."""

    standing_rad: np.ndarray
    t_s: float
    wall_s: float = 1000.0
    moves: bool = True
    different: str = ""
    in_use: str = "X"
    events: list[tuple[str, Any]] = field(default_factory=list)
    searches: list[Search] = field(default_factory=list)
    statuses: list[TrackingStatus] = field(default_factory=list)
    fed_back: list[tuple[TrackingStatus, float]] = field(default_factory=list)
    latest: JointTrajectory | None = None
    changed: Callable[[], None] = lambda: None

    def joints(self, until_s: float) -> JointReading | None:
        place_rad, rate_rad_s = self.standing_rad, np.zeros(2)
        if self.latest is not None:
            row = int(np.argmin(np.abs(self.latest.t_s - until_s)))
            place_rad, rate_rad_s = self.latest.position_rad[row], self.latest.velocity_rad_s[row]
        return JointReading(t_s=until_s, position_rad=place_rad, velocity_rad_s=rate_rad_s) if self.moves else None

    def difference(self) -> str:
        return self.different

    def band(self) -> str:
        return self.in_use

    def use_band(self, goal: PassGoal) -> bool:
        if goal.band not in ("", "S", "X"):
            raise ValueError(f"Dish: band={goal.band!r} must be one of S, X")
        changed, self.in_use = goal.band not in ("", self.in_use), goal.band or self.in_use
        if changed:
            self.different = f"rf_receiver on another than {self.in_use}"
            self.changed()
        return changed

    def find(self, goal: PassGoal, from_s: float) -> Search:
        self.searches.append(Search(goal, from_s))
        return self.searches[-1]

    def publish(self, t_s: float, trajectory: JointTrajectory | None, status: TrackingStatus) -> None:
        self.statuses.append(status)
        self.events.append(("period", t_s))
        self.latest = trajectory or self.latest
        if trajectory is not None:
            self.events.append(("command", t_s))

    def show(self, certificate: Any) -> None:
        self.events.append(("certificate", certificate))

    def feed_back(self, progress: float) -> None:
        self.fed_back.append((self.statuses[-1], progress))

    def warn(self, alarm: str) -> None:
        self.events.append(("alarm", alarm))

    def error(self, words: str) -> None:
        self.events.append(("error", words))

    def end_goal(self) -> None:
        self.events.append(("end", None))

    def of(self, kind: str) -> list[Any]:
        return [value for name, value in self.events if name == kind]


class Desk:
    """Goals on a controller, 30 s before the loss of signal, with the axes on the target."""

    def __init__(
        self, make_controller: MakeController, track: TopocentricTrack, window: Pass, folder: str = ""
    ) -> None:
        self.track, self.window = track, window
        begin_s = round(window.los_t_s - 30.0, 1)
        sky = track.target_at(begin_s)
        # The pass crosses north on its way: the turn that it is tracked on.
        azimuth_rad = math.remainder(sky.azimuth_rad, 2.0 * math.pi)
        self.world = World(np.array([azimuth_rad, sky.elevation_rad]), begin_s)
        store = StoreParams(certificate_folder=folder)
        self.goals = PassGoals(make_controller(), self.world, lambda sensor: sensor or "program", store)

        self.world.changed = lambda: self.goals.use_band(
            self.controller.params, BiasModel.zero(), calibrated=self.calibrated
        )
        self.calibrated = False

    @property
    def controller(self) -> PointingController:
        return self.goals.controller

    def begin(self, goal: PassGoal | None = None) -> None:
        self.goals.begin(goal or PassGoal(window=self.window), self.world.t_s, self.world.wall_s)

    def period(self, count: int = 1) -> None:
        world = self.world
        for _ in range(count):
            world.t_s, world.wall_s = round(world.t_s + PERIOD_S, 6), world.wall_s + PERIOD_S
            self.controller.take_target(self.track.target_at(round(world.t_s + 2.0, 6)))
            self.goals.due(world.t_s, world.t_s, world.wall_s)
            self.turn()

    def turn(self) -> float:
        return self.goals.turn(self.world.t_s, self.world.wall_s)

    @property
    def message(self) -> str:
        return str(self.goals.outcome()["message"])


@pytest.fixture
def desk(make_controller: MakeController, track: TopocentricTrack, window: Pass) -> Desk:
    return Desk(make_controller, track, window)


class Machine(RuleBasedStateMachine):
    """Any order of goals, answers, faults and patience."""

    def __init__(self, make: Callable[[], Desk]) -> None:
        super().__init__()
        self.desk = make()
        self.world, self.goals = self.desk.world, self.desk.goals
        self.profiles = [self.desk.controller.plan.profile_of(self.desk.window)]
        self.begun, self.begun_at = 0, 0

    @precondition(lambda self: not self.goals.busy)
    @rule(
        by_name=st.booleans(),
        sensor=st.sampled_from(["", "program", "monopulse"]),
        band=st.sampled_from(["", "X", "S", "Q"]),
        calibrated=st.booleans(),
    )
    def begin(self, by_name: bool, sensor: str, band: str, calibrated: bool) -> None:
        self.desk.calibrated = calibrated
        self.begun, self.begun_at = self.begun + 1, len(self.world.events)
        goal = (
            PassGoal(satellite="BIRD", sensor=sensor, band=band)
            if by_name
            else PassGoal(window=self.desk.window, sensor=sensor, band=band)
        )
        self.desk.begin(goal)

    @precondition(lambda self: self.world.searches)
    @rule(found=st.booleans())
    def answer(self, found: bool) -> None:
        self.world.searches[-1].answer = [self.desk.window] if found else "no such satellite"
        self.desk.turn()

    @rule(count=st.integers(1, 30))
    def periods(self, count: int) -> None:
        self.desk.period(count)

    @rule(wall_s=st.sampled_from([0.02, 1.0, PATIENCE_WALL_S + 1.0]))
    def wait(self, wall_s: float) -> None:
        self.world.wall_s += wall_s
        self.desk.turn()

    @rule(how=st.sampled_from(["stop", "cancel", "deactivate"]))
    def stop(self, how: str) -> None:
        had = self.goals.busy
        if how == "stop":
            assert self.goals.stop("stop was requested") == had
        elif how == "cancel" and had:
            self.goals.cancel()
            self.desk.turn()
        elif how == "deactivate":
            self.goals.deactivate(self.world.t_s)
            assert not self.goals.busy

    @rule(axes=st.booleans(), profile=st.booleans(), different=st.booleans(), fault=st.booleans())
    def surroundings(self, axes: bool, profile: bool, different: bool, fault: bool) -> None:
        self.world.moves, self.world.different = axes, "rf_receiver on Other" * different
        self.desk.controller.plan.take_profiles(self.profiles if profile else [])
        self.desk.controller.take_antenna("holding", "the door is open" * fault)

    @rule(band=st.sampled_from(["X", "S"]))
    def model(self, band: str) -> None:
        if band == self.world.in_use:
            self.goals.take_model(BiasModel.zero(), band)

    @invariant()
    def each_goal_ends_once(self) -> None:
        assert self.begun - len(self.world.of("end")) == self.goals.busy

    @invariant()
    def no_goal_is_left_without_words(self) -> None:
        if self.begun and not self.goals.busy:
            assert self.desk.message

    @invariant()
    def periods_come_in_order(self) -> None:
        times = self.world.of("period")
        assert times == sorted(times)

    @invariant()
    def nothing_moves_without_a_certificate_of_a_branch_that_works(self) -> None:
        kinds = [kind for kind, _ in self.world.events[self.begun_at :]]
        if "command" in kinds:
            assert "certificate" in kinds[: kinds.index("command")]
            assert self.world.of("certificate")[-1].chosen is not None
            assert self.world.of("certificate")[-1].band == self.world.in_use


def test_goals_in_any_order_end_once_and_move_nothing_without_a_certificate(
    make_controller: MakeController, track: TopocentricTrack, window: Pass
) -> None:
    limits = settings(max_examples=25, stateful_step_count=25, deadline=None)
    run_state_machine_as_test(lambda: Machine(lambda: Desk(make_controller, track, window)), settings=limits)


def test_a_pass_that_is_held_to_its_end_succeeds_and_tells_its_progress(desk: Desk) -> None:
    desk.begin()
    desk.period(310)
    outcome = desk.goals.outcome()
    assert (outcome["success"], outcome["message"], outcome["fault"]) == (True, LOSS_OF_SIGNAL, "")
    assert outcome["seconds_tracked"] + outcome["seconds_lost"] == pytest.approx(30.0, abs=0.3)
    certificate = desk.world.of("certificate")[0]
    assert outcome["predicted_loss"] == certificate.chosen.mean_loss_db
    for status, progress in desk.world.fed_back:
        share = (status.t_s - desk.window.aos_t_s) / desk.window.duration_s
        assert progress == pytest.approx(min(share, 1.0), abs=1e-9)
    fed = [status for status, _ in desk.world.fed_back]
    changed = [new for old, new in itertools.pairwise(desk.world.statuses)
               if (new.mode, new.level) != (old.mode, old.level)]  # fmt: skip
    assert all(status in fed for status in changed), "a change is told at once"
    assert max(np.diff([status.t_s for status in fed])) <= FEEDBACK_S + 1e-6
    assert len(fed) <= len(changed) + 30.0 / FEEDBACK_S + 2
    assert len(desk.world.of("period")) == 310


def test_a_pass_that_was_stopped_fails_and_says_why(desk: Desk) -> None:
    desk.begin()
    desk.period(50)
    assert desk.goals.stop("stop was requested")
    assert not desk.world.of("end"), "under control, with the next period"
    desk.period(2)
    assert (desk.message, desk.goals.outcome()["success"], desk.world.latest.velocity_rad_s[-1].tolist()) == (
        "stop was requested", False, [0.0, 0.0],
    )  # fmt: skip
    assert not desk.goals.stop("again")


def test_certificates_are_stored_once_and_a_full_disk_ends_no_pass(
    make_controller: MakeController, track: TopocentricTrack, window: Pass, tmp_path: Any
) -> None:
    desk = Desk(make_controller, track, window, str(tmp_path / "kept"))
    desk.begin()
    desk.period(3)
    (file,) = (tmp_path / "kept").iterdir()
    assert window.name in file.read_text()
    (tmp_path / "file").write_text("")
    desk.goals.stop("enough")
    desk.period()
    desk.goals.retune(desk.controller.params, StoreParams(certificate_folder=str(tmp_path / "file" / "below")))
    desk.begin()
    desk.period(5)
    assert desk.goals.busy
    assert desk.world.of("error")[-1].startswith("certificate not stored: ")


# What a goal waits for


def test_a_period_waits_50_ms_for_the_error_of_the_one_before(desk: Desk, monkeypatch: pytest.MonkeyPatch) -> None:
    awaited = [True]
    monkeypatch.setattr(desk.controller, "awaits_input", lambda _t_s: awaited[0])
    desk.goals.due(desk.world.t_s, desk.world.t_s, desk.world.wall_s)
    for left_s in (0.05, 0.01):
        assert desk.turn() == pytest.approx(left_s)
        desk.world.wall_s += 0.04
    assert (desk.turn(), desk.world.of("period")) == (0.0, [desk.world.t_s])
    desk.goals.due(desk.world.t_s + 0.1, desk.world.t_s, desk.world.wall_s)
    awaited[0] = False
    assert (desk.turn(), len(desk.world.of("period")), desk.turn()) == (0.0, 2, math.inf)


@pytest.mark.parametrize(("made", "why"), [(True, "does not answer"), (False, "is not active")])
def test_a_goal_by_name_waits_for_the_ephemeris_with_its_periods_held(desk: Desk, made: bool, why: str) -> None:
    desk.begin(PassGoal(satellite="BIRD"))
    desk.world.searches[0].made = made
    desk.goals.due(desk.world.t_s + 0.1, desk.world.t_s, desk.world.wall_s)
    desk.world.wall_s += PATIENCE_WALL_S
    assert (desk.turn(), desk.world.of("period"), desk.goals.busy) == (math.inf, [], True)
    desk.world.wall_s += 1.0
    desk.turn()
    assert desk.message == f"no pass of 'BIRD' is known: ephemeris_publisher {why}, waited 31 s"
    assert desk.world.of("period") == [desk.world.t_s + 0.1]


@pytest.mark.parametrize("missing", ["joint_states", "pass_profiles"])
def test_a_certificate_that_does_not_come_is_refused_although_time_is_held(desk: Desk, missing: str) -> None:
    desk.world.moves = missing != "joint_states"
    if missing == "pass_profiles":
        desk.controller.plan.take_profiles([])
    desk.begin()
    desk.world.wall_s += PATIENCE_WALL_S + 1.0
    desk.turn()
    assert f"({missing}) has not arrived in 31 s" in desk.message
    assert desk.world.of("command") == []


# What is refused


@pytest.mark.parametrize("by_name", [False, True])
def test_no_goal_starts_while_nodes_differ_or_a_model_lacks_its_temperature(desk: Desk, by_name: bool) -> None:
    goal = PassGoal(satellite="BIRD") if by_name else None
    desk.world.different = "rf_receiver on Other"
    desk.begin(goal)
    assert desk.message == "the nodes run on different station descriptions: rf_receiver on Other"
    desk.world.different = ""
    desk.goals.take_model(BiasModel.zero().replace(elevation_temperature=2e-5))
    desk.begin(goal)
    words = "the bias model has elevation_temperature, and no temperature has been received on weather/temperature"
    assert (desk.message, desk.world.searches, desk.goals.report().level) == (words, [], Level.WARN)
    desk.goals.take_temperature(298.15)
    desk.begin(goal)
    assert desk.goals.busy


# Which pass, and which model


@given(
    begins_s=st.lists(st.integers(-100_000, 100_000), min_size=1, max_size=6), length_s=st.integers(1, 2000),
    near_s=st.integers(-100_000, 100_000),
)  # fmt: skip
def test_the_pass_nearest_to_a_time_is_taken_if_it_is_within_an_hour(
    window: Pass, begins_s: list[int], length_s: int, near_s: int
) -> None:
    passes = [replace(window, aos_t_s=1e9 + begin_s, los_t_s=1e9 + begin_s + length_s) for begin_s in begins_s]
    assert nearest_pass(passes, 0.0) is passes[0]
    away_s = [max(one.aos_t_s - 1e9 - near_s, 1e9 + near_s - one.los_t_s, 0.0) for one in passes]
    if min(away_s) <= NEAR_S:
        assert nearest_pass(passes, 1e9 + near_s) is passes[away_s.index(min(away_s))]
    else:
        with pytest.raises(ValueError, match="no pass within 60 min of"):
            nearest_pass(passes, 1e9 + near_s)
    with pytest.raises(ValueError, match="has found no pass"):
        nearest_pass([], near_s)


@given(celsius=st.lists(st.floats(-40.0, 50.0), min_size=1, max_size=20))
def test_the_model_in_use_is_that_of_the_temperature_within_100_mk(celsius: list[float]) -> None:
    taken: list[BiasModel] = []
    controller: Any = type("Controller", (), {"take_model": lambda _, model: taken.append(model)})()
    goals = PassGoals(controller, World(np.zeros(2), 0.0), str, StoreParams())
    goals.take_model(BiasModel.zero().replace(elevation_temperature=2e-5))
    for each in celsius:
        goals.take_temperature(each + 273.15)
        assert taken[-1].coefficients["elevation_offset"] == pytest.approx(2e-5 * (each - 15.0), abs=2e-6 + 1e-9)
    assert len(taken) <= len(celsius)


def test_a_goal_in_another_band_waits_for_every_node_and_for_the_model_of_the_band_with_its_periods_held(
    desk: Desk,
) -> None:
    desk.goals.take_model(BiasModel.zero(), "X")
    desk.calibrated = True
    before = desk.controller
    desk.begin(PassGoal(window=desk.window, band="S"))
    desk.goals.due(desk.world.t_s, desk.world.t_s, desk.world.wall_s)
    for step in (lambda: setattr(desk.world, "different", ""), lambda: desk.goals.take_model(BiasModel.zero(), "S")):
        assert (desk.turn(), desk.world.of("period"), desk.world.of("certificate")) == (math.inf, [], [])
        step()
    desk.turn()
    (certificate,) = desk.world.of("certificate")
    assert (certificate.band, desk.controller is before) == ("S", False)
    desk.period(50)
    assert desk.world.of("command")


@pytest.mark.parametrize(
    ("follow", "why"),
    [
        (False, "the nodes run on different station descriptions: rf_receiver on another than S, waited 31 s"),
        (True, "no bias model of the S band, waited 31 s"),
    ],
)
def test_a_band_that_is_not_taken_by_all_is_refused_with_who_lacks_it_and_an_unknown_one_at_once(
    desk: Desk, follow: bool, why: str
) -> None:
    desk.begin(PassGoal(window=desk.window, band="Q"))
    assert (desk.message, desk.world.in_use) == ("Dish: band='Q' must be one of S, X", "X")
    desk.calibrated = True
    desk.begin(PassGoal(window=desk.window, band="S"))
    desk.world.different = desk.world.different * (not follow)
    desk.world.wall_s += PATIENCE_WALL_S + 1.0
    desk.turn()
    assert (desk.message, desk.goals.busy, desk.world.of("command")) == (why, False, [])


def test_a_pass_that_changes_its_band_goes_on_with_its_periods_and_believes_no_sensor_until_every_node_follows(
    desk: Desk,
) -> None:
    params = desk.controller.params
    wider = WiderBand(own="X", name="S", params=params, sensors=("monopulse", "conscan"))
    desk.goals.use_band(params, BiasModel.zero(), wider, calibrated=False)
    desk.begin()
    desk.period(10)
    with pytest.MonkeyPatch.context() as patched:
        for band in ("S", "X"):
            patched.setattr(PointingController, "wanted_band", band)
            desk.period()
            patched.setattr(PointingController, "wanted_band", "")
            assert (desk.world.in_use, desk.controller.deaf) == (band, True)
            desk.period(5)
            assert desk.controller.deaf
            desk.world.different = ""
            desk.period()
            assert not desk.controller.deaf
            assert desk.world.statuses[-1].reason.startswith("S band: ") == (band == "S")
    periods = desk.world.of("period")
    assert len(desk.world.of("command")) == len(periods)
    assert np.diff(periods) == pytest.approx(PERIOD_S, abs=1e-6)
