"""Any command becomes feasible; a feasible one is not touched."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rf_pointing.controllers import CommandPreprocessor, CommandPreprocessorParams
from rf_pointing.core import MDEG

DT_S = 0.02
RATE, ACCELERATION = math.radians(1.8), math.radians(0.8)
ROUNDING = 1e-9


def preprocessor(**changes: tuple[float, float]) -> CommandPreprocessor:
    return CommandPreprocessor(CommandPreprocessorParams(**changes))


def pass_at(t_s: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A fast overhead pass: azimuth swings by 150 deg within a minute and a half."""
    w, a = 0.012, 1.3
    x = w * (t_s - 150.0)
    azimuth = (a * math.tanh(x), a * w / math.cosh(x) ** 2, -2.0 * a * w**2 * math.tanh(x) / math.cosh(x) ** 2)
    u = 0.008 * (t_s - 150.0)
    bell = math.exp(-0.5 * u * u)
    elevation = (0.2 + bell, -0.008 * u * bell, 0.008**2 * (u * u - 1.0) * bell)
    rows = np.array([azimuth, elevation])
    return rows[:, 0], rows[:, 1], rows[:, 2]


def test_a_feasible_smooth_pass_passes_through_within_a_hundredth_of_a_millidegree() -> None:
    shaper = preprocessor()
    position, velocity, _ = pass_at(0.0)
    shaper.reset(position, velocity)
    worst = 0.0
    for k in range(1, 15_000):
        command = pass_at(k * DT_S)
        out = shaper.step(*command, DT_S)
        worst = max(worst, np.max(np.abs(out[0] - command[0])))
        assert shaper.state.transparent == (True, True)
    assert worst < 0.01 * MDEG


def test_a_pass_within_the_jerk_limit_passes_through_too() -> None:
    shaper, jerk = preprocessor(jerk_limit_rad_s3=(0.02, 0.02)), 0.02
    shaper.reset(*pass_at(100.0)[:2])
    for k in range(1, 2000):
        command = pass_at(100.0 + k * DT_S)
        out = shaper.step(*command, DT_S)
        assert shaper.state.transparent == (True, True)
        np.testing.assert_array_equal(out[0], command[0])
    # An acceleration that jumps by ten times what a tick allows is smoothed instead.
    bent = shaper.step(command[0] + DT_S * command[1], command[1], command[2] + 10.0 * jerk * DT_S, DT_S)
    assert shaper.state.transparent == (False, False)
    assert np.all(np.abs(bent[2] - command[2]) <= 1.01 * jerk * DT_S)


def test_a_step_becomes_a_bang_coast_bang_slew_without_overshoot() -> None:
    shaper = preprocessor()
    shaper.reset((0.0, 0.5))
    track = [shaper.step((0.5, 0.9), (0.0, 0.0), (0.0, 0.0), DT_S) for _ in range(2500)]
    position, velocity, acceleration = (np.array([row[i] for row in track]) for i in range(3))
    assert np.max(position[:, 0]) <= 0.5 + ROUNDING
    np.testing.assert_allclose(position[-1], (0.5, 0.9), atol=ROUNDING)
    assert np.max(np.abs(velocity)) <= RATE + ROUNDING
    assert np.max(np.abs(acceleration)) <= ACCELERATION * (1.0 + 1e-9)
    optimal_s = 0.5 / RATE + RATE / ACCELERATION
    arrival_s = DT_S * np.argmax(position[:, 0] > 0.5 - 1e-6)
    assert arrival_s < 1.15 * optimal_s


def test_a_slew_brakes_with_eight_tenths_of_the_limit_until_it_is_there() -> None:
    """Steady to rounding: only the first tick of braking is a part of one."""
    shaper = preprocessor()
    shaper.reset((0.0, 0.5))
    acceleration = np.array([shaper.step((0.5, 0.5), (0.0, 0.0), (0.0, 0.0), DT_S)[2][0] for _ in range(2500)])
    braking = acceleration[acceleration < -1e-9] / ACCELERATION
    assert len(braking) > 100
    np.testing.assert_allclose(braking[1:], -0.8, atol=1e-6)
    assert braking[0] + 1e-6 >= -0.8


def test_a_goal_beyond_the_travel_is_approached_as_its_end() -> None:
    motions = []
    for goal in (0.6, 2.0):
        shaper = preprocessor(travel_max_rad=(0.6, 1.6))
        shaper.reset((0.0, 0.5))
        motions.append([shaper.step((goal, 0.5), (0.0, 0.0), (0.0, 0.0), DT_S)[0][0] for _ in range(2500)])
    np.testing.assert_allclose(motions[1], motions[0], atol=1e-9)


def test_a_moving_target_is_caught_and_then_passed_through() -> None:
    shaper = preprocessor()
    shaper.reset((0.3, 0.9))
    for k in range(6000):
        command = pass_at(60.0 + k * DT_S)
        out = shaper.step(*command, DT_S)
    assert shaper.state.transparent == (True, True)
    np.testing.assert_allclose(out[0], command[0], atol=1e-12)


def test_controlled_stop_takes_rate_over_acceleration_and_holds() -> None:
    shaper = preprocessor()
    shaper.reset((0.0, 0.5), (0.03, -0.02))
    shaper.stop()
    times = []
    for k in range(300):
        position, velocity, _ = shaper.step((9.0, 1.5), (0.01, 0.01), (0.0, 0.0), DT_S)
        if np.any(velocity != 0.0):
            times.append(k * DT_S)
    assert times[-1] == pytest.approx(0.03 / ACCELERATION, abs=2 * DT_S)
    held, _, _ = shaper.step((9.0, 1.5), (0.01, 0.01), (0.0, 0.0), DT_S)
    np.testing.assert_array_equal(held, position)
    shaper.follow()
    moved, _, _ = shaper.step((0.5, 1.0), (0.0, 0.0), (0.0, 0.0), DT_S)
    assert np.all(moved > held)


def seven_segments_s(way: float, rate: float, acceleration: float, jerk: float) -> float:
    """The least time from rest to rest: jerk, hold, jerk, coast, and the same backwards."""
    top = min(acceleration, math.sqrt(rate * jerk))
    if way >= rate * (rate / top + top / jerk):
        return way / rate + rate / top + top / jerk
    if way <= 2.0 * acceleration**3 / jerk**2:
        return 4.0 * (0.5 * way / jerk) ** (1.0 / 3.0)
    ramps = acceleration**2 / jerk
    return (math.sqrt(ramps**2 + 4.0 * acceleration * way) - ramps) / acceleration + 2.0 * acceleration / jerk


@settings(max_examples=40, deadline=None)
@given(
    way_deg=st.floats(0.01, 30.0), rate_deg_s=st.floats(0.3, 8.0), acceleration_deg_s2=st.floats(0.2, 4.0),
    jerk_deg_s3=st.floats(0.2, 16.0), side=st.sampled_from([1.0, -1.0]),
)  # fmt: skip
def test_a_soft_slew_takes_at_most_a_twentieth_longer_than_the_seven_segments(
    way_deg: float, rate_deg_s: float, acceleration_deg_s2: float, jerk_deg_s3: float, side: float
) -> None:
    """Besides two ticks; it was up to 4.9 times as long."""
    way, rate, acceleration, jerk = np.radians([way_deg, rate_deg_s, acceleration_deg_s2, jerk_deg_s3]).tolist()
    shaper = preprocessor(rate_limit_rad_s=(rate,) * 2, acceleration_limit_rad_s2=(acceleration,) * 2,
                          jerk_limit_rad_s3=(jerk,) * 2)  # fmt: skip
    shaper.reset((0.0, 0.5))
    least, count, before = seven_segments_s(way, rate, acceleration, jerk), 0, 0.0
    while not shaper.state.transparent[0]:
        place, speed, pull = (side * one[0] for one in shaper.step((side * way, 0.5), (0.0, 0.0), (0.0, 0.0), DT_S))
        count += 1
        assert place <= way + 0.02 * MDEG
        assert abs(speed) <= rate * (1.0 + 1e-6)
        assert abs(pull) <= acceleration * (1.0 + 1e-6)
        assert shaper.state.transparent[0] or abs(pull - before) <= jerk * DT_S * (1.0 + 1e-6)
        before = pull
        assert count * DT_S <= 1.05 * least + 2.0 * DT_S


def test_a_target_on_its_way_is_caught_without_overshoot_within_a_jerk_limit_too() -> None:
    """From rest 0.1 rad behind a target that runs away at half the rate of the axis, and one that comes nearer."""
    for side in (1.0, -1.0):
        shaper = preprocessor(jerk_limit_rad_s3=(0.02, 0.02))
        shaper.reset((0.0, 0.5))
        rate, ahead = 0.5 * side * RATE, []
        for k in range(1, 1500):
            target = 0.1 + rate * k * DT_S
            out = shaper.step((target, 0.5), (rate, 0.0), (0.0, 0.0), DT_S)
            ahead.append(float(out[0][0]) - target)
        assert max(ahead) < 0.3 * MDEG
        assert abs(ahead[-1]) < 1e-6
        # At what its rate leaves over the axis closes 0.1 rad in 6.4 s; the rest is the soft end.
        assert DT_S * int(np.argmax(np.abs(ahead) < 0.1 * MDEG)) < 25.0


@settings(max_examples=40, deadline=None)
@given(
    targets=st.lists(
        st.tuples(st.floats(-6.0, 6.0), st.floats(-2.0, 3.0), st.floats(-0.2, 0.2), st.integers(1, 60)),
        min_size=1,
        max_size=6,
    ),
    dt_s=st.sampled_from([0.01, 0.02, 0.033]),
)
def test_every_command_whatsoever_comes_out_feasible(
    targets: list[tuple[float, float, float, int]], dt_s: float
) -> None:
    shaper = preprocessor()
    shaper.reset((0.0, 0.5))
    before = np.zeros(2)
    for azimuth, elevation, rate, count in targets:
        for _ in range(count):
            position, velocity, _ = shaper.step((azimuth, elevation), (rate, -rate), (0.0, 0.0), dt_s)
            assert np.all(np.abs(velocity) <= RATE + ROUNDING)
            assert np.all(np.abs(velocity - before) <= ACCELERATION * dt_s * (1.0 + 1e-6) + 1e-12)
            assert np.all(position >= np.array([-3.9, 0.04]) - ROUNDING)
            assert np.all(position <= np.array([3.9, 1.6]) + ROUNDING)
            before = velocity


def test_a_non_finite_command_is_refused_and_the_motion_kept() -> None:
    shaper = preprocessor()
    shaper.reset((0.0, 0.5), (0.01, 0.0))
    before = shaper.state
    with pytest.raises(ValueError, match="position_rad"):
        shaper.step((math.nan, 0.5), (0.0, 0.0), (0.0, 0.0), DT_S)
    np.testing.assert_array_equal(shaper.state.position_rad, before.position_rad)


def test_outside_its_travel_an_axis_stands_still_or_comes_in_and_goes_no_further_out() -> None:
    shaper = preprocessor(travel_max_rad=(0.6, 1.6))
    shaper.reset((0.61, 0.8))
    for _ in range(100):
        assert shaper.step((0.61, 0.8), (0.0, 0.0), (0.0, 0.0), 0.02)[0].tolist() == [0.61, 0.8]
    for _ in range(100):
        assert shaper.step((0.7, 0.8), (0.0, 0.0), (0.0, 0.0), 0.02)[0][0] == 0.61
    for _ in range(400):
        position, *_ = shaper.step((0.605, 0.8), (0.0, 0.0), (0.0, 0.0), 0.02)
    assert position[0] == pytest.approx(0.605, abs=1e-6)
    for _ in range(400):
        position, *_ = shaper.step((0.5, 0.8), (0.0, 0.0), (0.0, 0.0), 0.02)
    assert position[0] == pytest.approx(0.5, abs=1e-6)


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_outside_its_travel_an_axis_that_is_sent_further_out_does_not_start_by_itself(side: float) -> None:
    shaper = preprocessor(travel_min_rad=(-1.0, -1.0), travel_max_rad=(1.0, 1.0))
    place = np.array([1.1, 1.2]) * side
    shaper.reset(place)
    for _ in range(100):
        position, velocity, _ = shaper.step(1.5 * place, (0.0, 0.0), (0.0, 0.0), DT_S)
    np.testing.assert_array_equal(position, place)
    np.testing.assert_array_equal(velocity, np.zeros(2))


def test_an_empty_travel_is_refused() -> None:
    with pytest.raises(ValueError, match=r"travel_min_rad=1.0 must be < travel_max_rad=0.5"):
        CommandPreprocessorParams(travel_min_rad=(1.0, 0.0), travel_max_rad=(0.5, 1.0))


def stop_way(speed: float, braking: float, dt_s: float) -> float:
    """The way to rest step by step: each takes the mean of its two rates."""
    way = 0.0
    while speed > 0.0:
        slower = max(speed - braking * dt_s, 0.0)
        way, speed = way + 0.5 * (speed + slower) * dt_s, slower
    return way


def passes(target: tuple[float, float, float], rate: float = 0.0, dt_s: float = DT_S, place: float = 0.3) -> bool:
    """Whether a target, relative to `place` and as seen from there, passes through on the azimuth."""
    shaper = preprocessor(travel_max_rad=(0.6, 1.6))
    shaper.reset((place, 0.5), (rate, 0.0))
    shaper.step((place + target[0] + rate * dt_s, 0.5), (target[1] + rate, 0.0), (target[2], 0.0), dt_s)
    assert shaper.state.transparent[1]
    return shaper.state.transparent[0]


def test_one_axis_passes_through_while_the_other_slews() -> None:
    shaper = preprocessor()
    shaper.reset((0.0, 0.5))
    for azimuth, elevation, passed in ((1.0, 0.5, (False, True)), (0.0, 1.5, (False, False))):
        shaper.step((azimuth, elevation), (0.0, 0.0), (0.0, 0.0), DT_S)
        assert shaper.state.transparent == passed
    shaper.reset((0.0, 0.5))
    shaper.step((0.0, 1.5), (0.0, 0.0), (0.0, 0.0), DT_S)
    assert shaper.state.transparent == (True, False)
    shaper.stop()
    shaper.step((0.0, 0.5), (0.0, 0.0), (0.0, 0.0), DT_S)
    assert shaper.state.transparent == (False, False), "a stop follows nothing"


@pytest.mark.parametrize("speed", [0.03, 0.0201, 0.003])
@pytest.mark.parametrize("dt_s", [0.02, 0.5])
def test_a_target_passes_through_until_the_room_to_the_end_is_the_way_to_rest(speed: float, dt_s: float) -> None:
    way = stop_way(speed, ACCELERATION, dt_s)
    for room, passed in ((1.0001 * way, True), (0.9999 * way, False)):
        assert passes((0.0, 0.0, 0.0), speed, dt_s, 0.6 - room - speed * dt_s) is passed
    # At the lower end, and away from an end there is no need of room.
    shaper = preprocessor(travel_min_rad=(-0.6, 0.0))
    for room, passed in ((1.0001 * way, True), (0.9999 * way, False)):
        shaper.reset((-0.6 + room + speed * dt_s, 0.5), (-speed, 0.0))
        shaper.step((-0.6 + room, 0.5), (-speed, 0.0), (0.0, 0.0), dt_s)
        assert shaper.state.transparent[0] is passed
    assert passes((0.0, 0.0, 0.0), -speed, dt_s, 0.6)


@pytest.mark.parametrize("share", [1.0001, 1.1, 1.24])
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_an_axis_with_just_the_room_to_stop_stops_at_the_end_of_its_travel(share: float, side: float) -> None:
    """Eight tenths of the limit would not do."""
    shaper = preprocessor(travel_min_rad=(-0.6, -0.6), travel_max_rad=(0.6, 0.6))
    room = share * stop_way(0.03, ACCELERATION, DT_S)
    shaper.reset((side * (0.6 - room), 0.0), (side * 0.03, 0.0))
    for _ in range(400):
        position, velocity, _ = shaper.step((side * 2.0, 0.0), (0.0, 0.0), (0.0, 0.0), DT_S)
        assert side * position[0] <= 0.6 + ROUNDING
        assert side * velocity[0] > -ROUNDING
    assert side * position[0] == pytest.approx(0.6, abs=1e-6)


def test_an_axis_too_fast_for_the_room_that_is_left_brakes_with_no_more_than_its_limit() -> None:
    shaper = preprocessor(travel_max_rad=(0.6, 1.6))
    shaper.reset((0.599, 0.5), (0.03, 0.0))
    for _ in range(50):
        _, _, acceleration = shaper.step((0.7, 0.5), (0.0, 0.0), (0.0, 0.0), DT_S)
        assert acceleration[0] == pytest.approx(-ACCELERATION, rel=1e-9)


@pytest.mark.parametrize(("share", "left"), [(0.5, 0.5), (0.9, 0.2), (-0.5, 0.5)])
def test_a_target_that_accelerates_is_met_with_what_it_leaves_of_the_limit(share: float, left: float) -> None:
    """Eight tenths of the rest, at least of a fifth of the limit: closing slows down by that much."""
    shaper = preprocessor(rate_limit_rad_s=(1.0, 1.0), travel_max_rad=(50.0, 1.6))
    shaper.reset((0.0, 0.5))
    target_acceleration, start_rate, rows = share * ACCELERATION, 0.01, []
    for k in range(1, 3000):
        t_s = k * DT_S
        target = 0.02 + start_rate * t_s + 0.5 * target_acceleration * t_s * t_s
        rate = start_rate + target_acceleration * t_s
        place, speed, acceleration = shaper.step((target, 0.5), (rate, 0.0), (target_acceleration, 0.0), DT_S)
        rows.append((target - place[0], speed[0] - rate, acceleration[0] - target_acceleration))
        if shaper.state.transparent[0]:
            break
    gap, closing, slowing = np.array(rows[:-1]).T
    braking = (closing > 0.001) & (slowing < 0.0) & (gap > 0.0)
    assert np.count_nonzero(braking) > 20
    assert abs(rows[-1][0]) < 2e-6
    assert np.median(slowing[braking]) == pytest.approx(-0.8 * left * ACCELERATION, rel=0.03)


@pytest.mark.parametrize("jerk", [0.002, 0.02, 0.2])
def test_a_stop_within_a_jerk_limit_takes_the_least_time(jerk: float) -> None:
    """The deceleration grows, holds and fades: 2 sqrt(v / j), or v / a + a / j where it reaches the limit."""
    shaper = preprocessor(jerk_limit_rad_s3=(jerk, jerk))
    shaper.reset((0.0, 0.8), (0.03, -0.02))
    shaper.stop()
    rows = np.array([shaper.step((9.0, 1.5), (0.0, 0.0), (0.0, 0.0), DT_S)[1:] for _ in range(800)])
    for axis, speed in enumerate((0.03, 0.02)):
        rate, acceleration = np.sign(0.5 - axis) * rows[:, :, axis].T
        top = min(ACCELERATION, math.sqrt(jerk * speed))
        assert np.max(np.abs(np.diff(acceleration))) <= jerk * DT_S * (1.0 + 1e-9)
        assert np.max(np.abs(acceleration)) <= ACCELERATION * (1.0 + 1e-9)
        assert np.all(rate >= -1e-4)
        assert abs(rate[-1]) < 1e-12
        assert DT_S * np.count_nonzero(rate > 1e-6) == pytest.approx(speed / top + top / jerk, abs=3.0 * DT_S)
