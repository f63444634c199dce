"""Going over the top: within the axes' limits, from one side's path to the other's, and no further off than it must be."""

import math

import numpy as np
import pytest

from rf_pointing.planning import AxisLimits, MachineParams, plunged
from rf_pointing.planning.branch_motion import branch_motions, no_lag
from rf_pointing.planning.crossing import MARGIN_S, AxisMotionLimits, cross
from rf_pointing.planning.forbidden_sky import angle_between
from rf_pointing.planning.over_the_top import _between, _line, _rate_between, _Sides, cross_over
from test.planning.test_crossing import LIMITS, STEP_S, beam, overhead

Array = np.ndarray
DEG = math.pi / 180.0


def sides(miss_deg: float, side: float) -> tuple[Array, tuple[Array, ...], tuple[Array, ...]]:
    t, *path = overhead(miss_deg)
    first = tuple(part * np.array([side, 1.0]) for part in path)
    return t, first, plunged(*first)


@pytest.mark.parametrize("miss_deg", [0.05, 0.4, 1.0, 4.0])
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_the_dish_goes_over_within_the_limits_and_joins_both_paths(miss_deg: float, side: float) -> None:
    t, first, second = sides(miss_deg, side)
    found = cross_over(t, first, second, LIMITS, beam(0.264))
    assert found is not None
    rates = np.diff(found.position_rad, axis=0) / STEP_S
    bends = np.diff(rates, axis=0) / STEP_S
    assert np.all(np.abs(rates).max(axis=0) <= np.array(LIMITS.rate_rad_s) * 1.001)
    assert np.all(np.abs(bends).max(axis=0) <= np.array(LIMITS.acceleration_rad_s2) * 1.1)
    row = round((found.t_s[0] - t[0]) / STEP_S)
    last = row + len(found.t_s) - 1
    np.testing.assert_allclose(found.position_rad[0], first[0][row], atol=1e-9)
    np.testing.assert_allclose(found.position_rad[-1], second[0][last] + [found.turn_rad, 0.0], atol=1e-9)
    assert found.t_s[0] < found.over_t_s < found.t_s[-1]
    over = found.t_s >= found.over_t_s
    assert found.position_rad[over, 1].min() >= 0.5 * math.pi - 1e-9
    # The azimuth makes what is left of the target's half turn, not the half turn.
    assert np.ptp(found.position_rad[:, 0]) < 0.75 * math.pi


@pytest.mark.parametrize("miss_deg", [0.05, 0.4, 1.0, 4.0])
def test_the_error_is_the_true_angle_and_at_least_what_the_target_misses_the_zenith_by(miss_deg: float) -> None:
    t, first, second = sides(miss_deg, 1.0)
    found = cross_over(t, first, second, LIMITS, beam(0.264))
    part = slice(round((found.t_s[0] - t[0]) / STEP_S), None)
    target = first[0][part][: len(found.t_s)]
    np.testing.assert_allclose(found.error_rad, angle_between(found.position_rad, target), atol=2e-6)
    assert found.error_rad.max() >= 0.98 * miss_deg * DEG
    assert found.error_rad.max() <= 1.2 * miss_deg * DEG


@pytest.mark.parametrize(("miss_deg", "share"), [(0.05, 0.02), (1.0, 0.3), (4.0, 0.6)])
def test_it_loses_less_than_turning_on_one_side(miss_deg: float, share: float) -> None:
    t, first, second = sides(miss_deg, 1.0)
    gain = beam(0.264)
    over, aside = cross_over(t, first, second, LIMITS, gain), cross(t, *first, LIMITS, gain)
    lost = [float(np.sum(1.0 - gain(found.error_rad)) * STEP_S) for found in (over, aside)]
    assert lost[0] < share * lost[1]


def test_an_elevation_axis_that_is_too_slow_cannot_go_over() -> None:
    t, first, second = sides(0.4, 1.0)
    slow = AxisMotionLimits(LIMITS.rate_rad_s, (LIMITS.rate_rad_s[0], 1e-5 * DEG), LIMITS.elevation_max_rad)
    assert cross_over(t, first, second, slow, beam(0.264)) is None


@pytest.mark.parametrize("axis", [0, 1])
def test_an_axis_of_little_rate_crosses_within_it_or_not_at_all(axis: int) -> None:
    """From far below to just above the rate that a fast antenna takes; accelerations are ample."""
    t, first, second = sides(1.0, 1.0)
    ample = AxisMotionLimits((2.0 * DEG, 2.0 * DEG), (5.0 * DEG, 5.0 * DEG), LIMITS.elevation_max_rad)
    free = cross_over(t, first, second, ample, beam(0.264))
    assert free is not None
    taken = float(np.abs(np.diff(free.position_rad[:, axis])).max()) / STEP_S
    outcomes = []
    for share in (0.05, 0.7, 1.05):
        rate = [2.0 * DEG, 2.0 * DEG]
        rate[axis] = share * taken
        slow = AxisMotionLimits((rate[0], rate[1]), ample.acceleration_rad_s2, ample.elevation_max_rad)
        found = cross_over(t, first, second, slow, beam(0.264))
        outcomes.append(found is not None)
        if found is not None:
            assert np.abs(np.diff(found.position_rad[:, axis])).max() / STEP_S <= 1.001 * rate[axis]
    assert outcomes[-1]


def test_an_azimuth_error_of_the_mount_is_blended_in_within_the_limits() -> None:
    """Half a degree on the far side costs the beam nothing: it is the axis that it moves."""
    t, first, second = sides(0.4, 1.0)
    found = cross_over(t, first, (second[0] + np.array([0.5 * DEG, 0.0]), *second[1:]), LIMITS, beam(0.264))
    assert found is not None
    rates = np.diff(found.position_rad, axis=0) / STEP_S
    assert np.all(np.abs(rates).max(axis=0) <= np.array(LIMITS.rate_rad_s) * 1.001)
    assert found.error_rad.max() == pytest.approx(0.4 * DEG, rel=0.01)


def test_a_crossing_does_not_depend_on_the_zero_of_time() -> None:
    """The mount's errors change along the pass, so the lines that blend them in have slopes."""
    t, first, second = sides(0.4, 1.0)
    slope = np.column_stack([1e-5 * t, -4e-6 * t])
    mount = (second[0] + slope, second[1] + np.array([1e-5, -4e-6]), second[2])
    here, late = (cross_over(times, first, mount, LIMITS, beam(0.264)) for times in (t, t + 5e4))
    assert here is not None
    assert late is not None
    np.testing.assert_allclose(late.position_rad, here.position_rad, atol=1e-6)
    np.testing.assert_allclose(late.error_rad, here.error_rad, atol=1e-6)
    assert late.over_t_s - here.over_t_s == pytest.approx(5e4)


def test_only_an_elevation_axis_that_passes_the_zenith_goes_over_it() -> None:
    t, first, second = sides(0.4, 1.0)
    machine = MachineParams(rate_limit_rad_s=LIMITS.rate_rad_s, acceleration_limit_rad_s2=LIMITS.acceleration_rad_s2)
    for most_deg, over in ((89.0, False), (95.0, True)):
        travel = AxisLimits(elevation_max_rad=most_deg * DEG)
        found = branch_motions(t, {False: first, True: second}, machine, travel, beam(0.264), no_lag)
        assert any(one.crossing is not None and one.crossing.over_t_s is not None for one in found) is over


def made_sides(
    miss_deg: float = 1.0, before: Array | None = None, after: Array | None = None, turn: float = 0.0, side: float = 1.0
) -> _Sides:
    """Both paths, with errors of the mount on either: rows of offset and of slope (2,) each."""
    t, first, second = sides(miss_deg, side)
    shifts = [np.zeros((2, 2)) if one is None else one for one in (before, after)]
    first, second = (
        (part[0] + shift[0] + t[:, None] * shift[1], part[1] + shift[1], part[2])
        for part, shift in zip((first, second), shifts, strict=True)
    )
    return _Sides(t, first, (second[0] + np.array([turn, 0.0]), *second[1:]), LIMITS, beam(0.264))


def ramped(way: float, duration_s: float, leaving: float, joining: float, limit: float) -> float:
    """How far off a rate is from the one that makes the way, by the closed form of the module."""
    rate = _rate_between(way, duration_s, leaving, joining, limit)
    assert rate is not None
    bends = sum((v - rate) * abs(v - rate) for v in (leaving, joining)) / (2.0 * limit)
    return rate * duration_s + bends - way


def test_the_rate_between_two_others_makes_the_way(random: np.random.Generator) -> None:
    for way, duration_s, leaving, joining in random.uniform(
        (-1.0, 20.0, -0.02, -0.02), (1.0, 60.0, 0.02, 0.02), (50, 4)
    ):
        assert ramped(way, duration_s, leaving, joining, 0.02) == pytest.approx(0.0, abs=1e-10)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_no_rate_makes_a_way_for_which_time_is_short(side: float) -> None:
    """From rest to rest at a limit A a way W takes 2 sqrt(W / A); a little later there is one rate."""
    way, limit = 0.5, 0.02
    shortest_s = 2.0 * math.sqrt(way / limit)
    assert _rate_between(side * way, 0.999 * shortest_s, 0.0, 0.0, limit) is None
    duration_s = 1.05 * shortest_s
    wanted = 0.5 * limit * (duration_s - math.sqrt(duration_s**2 - shortest_s**2))
    assert _rate_between(side * way, duration_s, 0.0, 0.0, limit) == pytest.approx(side * wanted, rel=1e-9)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_the_azimuth_leaves_at_its_rate_runs_evenly_and_joins_at_the_other_rate(side: float) -> None:
    made = made_sides(side=side)
    start, end = 1900, 2150
    azimuth = made._azimuth(start, end)
    assert azimuth is not None
    leaving, joining = made.first[1][start, 0], made.second[1][end, 0]
    assert azimuth[0] == made.first[0][start, 0]
    assert azimuth[-1] == pytest.approx(made.second[0][end, 0], abs=1e-9)
    rates, t_s = np.diff(azimuth) / STEP_S, STEP_S * (np.arange(end - start) + 0.5)
    even = np.median(rates)
    wanted = [
        v + np.sign(even - v) * np.minimum(abs(even - v), LIMITS.acceleration_rad_s2[0] * since_s)
        for v, since_s in ((leaving, t_s), (joining, t_s[::-1]))
    ]
    middle = len(rates) // 2
    # A step holds the mean of its rates: where a ramp ends within one, half of its change of rate.
    np.testing.assert_allclose(rates[:middle], wanted[0][:middle], atol=0.26 * LIMITS.acceleration_rad_s2[0] * STEP_S)
    np.testing.assert_allclose(rates[middle:], wanted[1][middle:], atol=0.26 * LIMITS.acceleration_rad_s2[0] * STEP_S)
    assert np.ptp(rates) > 0.005


@pytest.mark.parametrize("which", ["leaving", "even", "joining"])
def test_an_azimuth_that_is_anywhere_faster_than_its_axis_is_none(which: str) -> None:
    """Asymmetric, so that each of the three rates is the largest once."""
    start, end = {"leaving": (1990, 2300), "even": (1900, 2100), "joining": (1700, 2010)}[which]
    made, limit = made_sides(), (1.0 if which == "even" else 5.0) * DEG
    rates = {"leaving": made.first[1][start, 0], "joining": made.second[1][end, 0]}
    way = float(made.second[0][end, 0] - made.first[0][start, 0])
    rates["even"] = _rate_between(way, (end - start) * STEP_S, rates["leaving"], rates["joining"], limit)
    assert max(rates, key=lambda name: abs(rates[name])) == which
    most = abs(rates[which])
    for share, free in ((1.001, True), (0.999, False)):
        made.limits = AxisMotionLimits((share * most, 9.0), (limit, 9.0), 9.0)
        assert (made._azimuth(start, end) is not None) is free


@pytest.mark.parametrize("turn", [-4.0 * math.pi, 0.0, 2.0 * math.pi])
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_the_other_side_is_met_on_whatever_turn_it_is_given(turn: float, side: float) -> None:
    made = made_sides(turn=turn, side=side)
    base = made_sides(side=side)
    np.testing.assert_allclose(made.second[0], base.second[0], atol=1e-12)
    assert made.turn_rad == pytest.approx(base.turn_rad - turn)
    # Both sides point to one direction, half a turn apart and over the top.
    np.testing.assert_allclose(made.target, base.first[0], atol=1e-9)
    assert made.half_turn_rad == pytest.approx(side * math.pi)
    np.testing.assert_allclose(made.second[0][:, 0], made.first[0][:, 0] - side * math.pi, atol=1e-9)
    np.testing.assert_allclose(made.before, 0.0, atol=1e-9)
    np.testing.assert_allclose(made.after, 0.0, atol=1e-9)


def test_the_target_lies_half_way_between_both_sides_and_the_mounts_errors_beside_it() -> None:
    before, after = np.array([[2e-4, -3e-4], [0.0, 0.0]]), np.array([[4e-4, 5e-4], [0.0, 0.0]])
    made = made_sides(20.0, before, after)
    truth = sides(20.0, 1.0)[1][0]
    # Of the plunged side's elevation error the direct one is the opposite.
    half = 0.5 * (before[0] + after[0] * [1.0, -1.0])
    np.testing.assert_allclose(made.target - truth, np.tile(half, (len(truth), 1)), atol=2e-7)
    np.testing.assert_allclose(made.before, made.first[0] - made.target, atol=1e-12)
    np.testing.assert_allclose(made.after[:, 0], 0.5 * (after[0, 0] - before[0, 0]), atol=2e-7)
    np.testing.assert_allclose(made.after[:, 1], 0.5 * (after[0, 1] + before[0, 1]), atol=2e-7)


def test_a_line_goes_through_two_rows_and_beyond() -> None:
    rows, since_s = np.array([[1.0, 2.0], [1.5, 1.0]]), np.array([-0.2, 0.0, 0.4])
    np.testing.assert_allclose(_line(rows, 0.2, since_s, 0), [[0.5, 3.0], [1.0, 2.0], [2.0, 0.0]])
    np.testing.assert_allclose(_line(rows, 0.2, since_s, 1), [[1.0, 2.0], [1.5, 1.0], [2.5, -1.0]])


BEFORE, AFTER = np.array([[3e-4, 1e-4], [2e-6, -1e-6]]), np.array([[-2e-4, 4e-4], [-1e-6, 3e-6]])


@pytest.mark.parametrize(("start", "end"), [(1900, 2150), (1860, 2090)])
def test_between_both_sides_the_axes_carry_the_mounts_errors_over_smoothly(start: int, end: int) -> None:
    """By x^3 (10 - 15 x + 6 x^2), each error on the straight line that it had at its end; the beam is what is left."""
    made = made_sides(1.0, BEFORE, AFTER)
    moved = made._moved(start, end)
    assert moved is not None
    axes, error = moved
    np.testing.assert_allclose(axes[0], made.first[0][start], atol=1e-9)
    np.testing.assert_allclose(axes[-1], made.second[0][end], atol=1e-9)
    x = np.linspace(0.0, 1.0, end - start + 1)[:, None]
    share, rows = 6.0 * x**5 - 15.0 * x**4 + 10.0 * x**3, np.arange(end - start + 1.0)[:, None]
    lines = [
        made.before[start] + rows * (made.before[start] - made.before[start - 1]),
        made.after[end] + (rows - rows[-1]) * (made.after[end + 1] - made.after[end]),
    ]
    beam_at = axes - (1.0 - share) * lines[0] - share * lines[1]
    np.testing.assert_allclose(error, angle_between(beam_at, made.target[start : end + 1]), atol=1e-9)
    assert error[[0, -1]] == pytest.approx(0.0, abs=1e-7)
    # The elevation nearest to the target, smoothed by 0.7 s in the middle and not at the ends.
    off = beam_at[:, 0] - made.target[start : end + 1, 0]
    target = made.target[start : end + 1, 1]
    nearest = np.arctan2(np.sin(target), np.cos(target) * np.cos(off)) + axes[:, 1] - beam_at[:, 1]
    around = np.concatenate([made.first[0][start - 21 : start, 1], nearest, made.second[0][end + 1 : end + 22, 1]])
    weights = np.exp(-0.5 * (STEP_S * np.arange(-21, 22) / 0.7) ** 2)
    soft = np.convolve(around, weights / weights.sum(), mode="valid")
    part = (4.0 * x[:, 0] * (1.0 - x[:, 0])) ** 2
    np.testing.assert_allclose(axes[:, 1], nearest + part * (soft - nearest), atol=1e-9)


@pytest.mark.parametrize("room", [0, 1, 5, 20, 21, 22])
def test_near_the_ends_of_the_pass_the_elevation_is_smoothed_with_what_there_is(room: int) -> None:
    """Beyond the first row and the last one the elevation stays as it is there."""
    made = made_sides()
    count, rows = len(made.t_s), np.linspace(0.3, 0.5, 60) ** 2
    weights = np.exp(-0.5 * (STEP_S * np.arange(-21, 22) / 0.7) ** 2)
    before, after = made.first[0][:, 1], made.second[0][:, 1]
    for start in (room, count - 60 - room):
        around = np.concatenate([before[:start], rows, after[start + 60 :]])
        wanted = np.convolve(np.pad(around, 21, "edge"), weights / weights.sum(), mode="valid")[start : start + 60]
        np.testing.assert_allclose(made._soft(rows, start, start + 59), wanted, atol=1e-12)


def test_the_loss_of_a_way_is_finite_where_the_elevation_can_make_it_joints_included() -> None:
    made = made_sides(0.4)
    seen = set()
    for share_rate, share_bend in ((1.0, 1.0), (0.3, 1.0), (1.0, 0.5)):
        made.limits = AxisMotionLimits((2.0 * DEG, share_rate * DEG), (1.0 * DEG, share_bend * DEG), 9.0)
        for before, after in ((40, 60), (55, 41), (100, 150), (20, 21), (10, 12), (180, 33)):
            start, end = 2000 - before, 2000 + after
            moved = made._moved(start, end)
            lost = made.lost_s(start, end)
            if moved is None:
                assert lost == math.inf
                continue
            joined = [made.first[0][start - 1, 1], *moved[0][:, 1], made.second[0][end + 1, 1]]
            rates = np.diff(joined) / STEP_S
            bends = np.diff(rates) / STEP_S
            able = np.abs(rates).max() <= share_rate * DEG and np.abs(bends).max() <= share_bend * DEG
            seen.add(able)
            assert lost == pytest.approx(float(np.sum(1.0 - beam(0.264)(moved[1])) * STEP_S) if able else math.inf)
    assert seen == {True, False}


@pytest.mark.parametrize(("start", "end"), [(1900, 2150), (1860, 2090)])
def test_a_crossing_has_the_motion_of_both_sides_at_its_ends_and_its_own_between(start: int, end: int) -> None:
    made = made_sides(1.0, BEFORE, AFTER)
    found, moved = made.crossing(start, end), made._moved(start, end)
    assert moved is not None
    margin = round(MARGIN_S / STEP_S)
    assert (found.t_s[0], found.t_s[-1]) == (made.t_s[start - margin], made.t_s[end + margin])
    wanted = [made.first[0][start - margin : start], moved[0], made.second[0][end + 1 : end + 1 + margin]]
    np.testing.assert_array_equal(found.position_rad, np.concatenate(wanted))
    np.testing.assert_array_equal(
        found.velocity_rad_s[[0, -1]], [made.first[1][start - margin], made.second[1][end + margin]]
    )
    np.testing.assert_array_equal(
        found.acceleration_rad_s2[[0, -1]], [made.first[2][start - margin], made.second[2][end + margin]]
    )
    np.testing.assert_allclose(
        found.velocity_rad_s[1:-1], (found.position_rad[2:] - found.position_rad[:-2]) / (2.0 * STEP_S), atol=1e-12
    )
    np.testing.assert_allclose(
        found.acceleration_rad_s2[2:-2],
        (found.velocity_rad_s[3:-1] - found.velocity_rad_s[1:-3]) / (2.0 * STEP_S),
        atol=1e-12,
    )
    np.testing.assert_array_equal(found.error_rad[margin:-margin], moved[1])
    assert not found.error_rad[:margin].any()
    assert not found.error_rad[-margin:].any()
    over = found.position_rad[:, 1] >= 0.5 * math.pi
    assert found.over_t_s == found.t_s[int(np.argmax(over))]
    assert found.turn_rad == made.turn_rad


def test_a_crossing_at_the_ends_of_the_pass_has_no_rows_beyond_them() -> None:
    made = made_sides(4.0)
    count = len(made.t_s)
    found = made.crossing(10, count - 20)
    assert (found.t_s[0], found.t_s[-1], len(found.t_s)) == (made.t_s[0], made.t_s[-1], count)


@pytest.mark.parametrize(("before", "after"), [(3, 200), (57, 11), (301, 888), (1500, 1)])
def test_departure_and_return_are_found_each_on_its_own_scale(
    before: int, after: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """20 places on a logarithmic grid over 200 s of pass, then twice 7 from four to five quarters of the best."""
    t, first, second = sides(1.0, 1.0)
    tried: list[tuple[int, int]] = []

    def lost_s(self: _Sides, start: int, end: int) -> float:
        tried.append((2000 - start, end - 2000))
        return math.log((2000 - start) / before) ** 2 + math.log((end - 2000) / after) ** 2

    monkeypatch.setattr(_Sides, "lost_s", lost_s)
    monkeypatch.setattr(_Sides, "crossing", lambda _self, start, end: (2000 - start, end - 2000))
    found = cross_over(t, first, second, LIMITS, beam(0.264))
    assert found[0] == pytest.approx(before, rel=0.045, abs=0.5)
    assert found[1] == pytest.approx(after, rel=0.045, abs=0.5)
    coarse = np.unique(np.geomspace(1, 1998, 20).astype(int)).tolist()
    assert tried[: len(coarse) ** 2] == [(a, b) for a in coarse for b in coarse]
    rest = tried[len(coarse) ** 2 :]
    near = [min(coarse, key=lambda a: abs(math.log(a / wanted))) for wanted in (before, after)]
    grids = [np.unique(np.clip(np.geomspace(0.8 * a, 1.25 * a, 7), 1, 1998).astype(int)).tolist() for a in near]
    assert rest[: len(grids[0]) * len(grids[1])] == [(a, b) for a in grids[0] for b in grids[1]]
    assert len(rest) <= 2 * 49


def test_a_pass_with_no_room_beside_its_peak_is_not_gone_over() -> None:
    """Two rows before the departure and after the return must be there."""
    t, first, second = sides(4.0, 1.0)
    for rows, room in (
        (slice(1997, None), True),
        (slice(1998, None), False),
        (slice(0, 2004), True),
        (slice(0, 2003), False),
    ):
        part = [tuple(row[rows] for row in side) for side in (first, second)]
        made = _Sides(t[rows], *part, LIMITS, beam(0.264))
        middle = int(np.argmax(made.target[:, 1]))
        most = min(2400, middle - 2, len(made.t_s) - 3 - middle)
        assert (most >= 1) is room
        fast = AxisMotionLimits((99.0, 99.0), (999.0, 999.0), 9.0)
        assert (cross_over(t[rows], *part, fast, beam(0.264)) is not None) is room


def test_half_way_between_two_directions_is_on_the_turn_of_the_first() -> None:
    one = np.array([[7.0, 0.3], [7.1, 0.4]])
    np.testing.assert_allclose(_between(one, one), one, atol=1e-12)
    np.testing.assert_allclose(_between(one - [14.0, 0.0], one), one - [14.0, 0.0], atol=1.0)
    beside = _between(np.array([[0.1, 0.0]]), np.array([[0.5, 0.0]]))
    np.testing.assert_allclose(beside, [[0.3, 0.0]], atol=1e-12)
    above = _between(np.array([[0.1, 0.2]]), np.array([[0.1, 0.8]]))
    np.testing.assert_allclose(above, [[0.1, 0.5]], atol=1e-12)
