"""The zenith crossing: within the axes' limits, better than clipping, no worse than a free search.

What a crossing costs, in closed form: an error that grows and falls in straight lines.
"""

import math

import numpy as np
import pytest
from scipy.optimize import minimize

from rf_pointing.planning.crossing import MARGIN_S, ON_TARGET_RAD, AxisMotionLimits, Crossing, CrossingLoss, cross
from rf_pointing.planning.forbidden_sky import angle_between

Array = np.ndarray
DEG = math.pi / 180.0
LIMITS = AxisMotionLimits((2.0 * DEG, 2.0 * DEG), (1.0 * DEG, 1.0 * DEG), 90.0 * DEG)
STEP_S = 0.1


def overhead(miss_deg: float, rate_deg_s: float = 0.5, seconds: float = 400.0) -> tuple[Array, Array, Array, Array]:
    """A straight track past the zenith at a distance: the closed form of every overhead pass."""
    t = np.linspace(-0.5 * seconds, 0.5 * seconds, round(seconds / STEP_S) + 1)
    c, w = math.tan(miss_deg * DEG), rate_deg_s * DEG
    x = w * t
    azimuth = np.arctan2(x, c)
    rate = w * c / (c**2 + x**2)
    bend = -2.0 * w**2 * c * x / (c**2 + x**2) ** 2
    level = np.hypot(x, c)
    elevation = np.arctan2(1.0, level)
    climb = -x * w / (level * (1.0 + level**2))
    curve = np.gradient(climb, STEP_S)
    return t, np.column_stack([azimuth, elevation]), np.column_stack([rate, climb]), np.column_stack([bend, curve])


def beam(width_deg: float):
    return lambda error: np.exp(-4.0 * math.log(2.0) * (error / (width_deg * DEG)) ** 2)


def clipped(t: Array, position: Array) -> Array:
    """What an axis does that follows as fast as it can, without foresight."""
    azimuth = position[:, 0].copy()
    for index in range(1, len(t)):
        step = np.clip(
            position[index, 0] - azimuth[index - 1], -LIMITS.rate_rad_s[0] * STEP_S, LIMITS.rate_rad_s[0] * STEP_S
        )
        azimuth[index] = azimuth[index - 1] + step
    return azimuth


@pytest.mark.parametrize("miss_deg", [0.05, 0.4])
def test_an_end_of_travel_below_the_zenith_takes_the_axes_off_the_target_no_longer(miss_deg: float) -> None:
    """The azimuth decides how long it takes; the elevation waits at its end."""
    found = {}
    for top_deg in (88.0, 90.0):
        limits = AxisMotionLimits(LIMITS.rate_rad_s, LIMITS.acceleration_rad_s2, top_deg * DEG)
        found[top_deg] = cross(*overhead(miss_deg), limits, beam(0.264))
        assert found[top_deg].position_rad[:, 1].max() <= top_deg * DEG + 1e-9
    assert found[88.0].position_rad[:, 1].max() == pytest.approx(88.0 * DEG)
    assert found[88.0].duration_s <= found[90.0].duration_s + 1.0


def test_a_path_within_the_limits_needs_no_crossing() -> None:
    assert cross(*overhead(20.0), LIMITS, beam(0.264)) is None


@pytest.mark.parametrize("miss_deg", [0.05, 0.4, 1.0, 4.0, 9.0, 13.0])
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_the_crossing_keeps_the_limits_and_joins_the_path(miss_deg: float, side: float) -> None:
    t, position, velocity, acceleration = overhead(miss_deg)
    turn = np.array([side, 1.0])
    path = (position * turn, velocity * turn, acceleration * turn)
    found = cross(t, *path, LIMITS, beam(0.264))
    assert found is not None
    rates = np.diff(found.position_rad, axis=0) / STEP_S
    bends = np.diff(rates, axis=0) / STEP_S
    assert np.max(np.abs(rates)) <= 2.0 * DEG * 1.001
    assert np.max(np.abs(bends)) <= 1.0 * DEG * 1.05
    assert np.max(found.position_rad[:, 1]) <= LIMITS.elevation_max_rad + 1e-9
    first = int(np.searchsorted(t, found.t_s[0]))
    assert found.duration_s == pytest.approx(STEP_S * (len(found.t_s) - 1))
    # It is on the target for the margin at both ends, and off it from there on.
    away = np.max(np.abs(found.position_rad - path[0][first : first + len(found.t_s)]), axis=1) > ON_TARGET_RAD
    assert np.flatnonzero(away)[[0, -1]].tolist() == [
        round(MARGIN_S / STEP_S),
        len(away) - 1 - round(MARGIN_S / STEP_S),
    ]
    np.testing.assert_allclose(found.position_rad[0], path[0][first], atol=5e-4 * DEG)
    np.testing.assert_allclose(found.position_rad[-1], path[0][first + len(found.t_s) - 1], atol=5e-4 * DEG)


@pytest.mark.parametrize(("miss_deg", "width_deg"), [(9.0, 1.0), (12.0, 1.0), (4.0, 5.0), (1.0, 10.0)])
def test_foresight_loses_less_than_clipping(miss_deg: float, width_deg: float) -> None:
    t, position, velocity, acceleration = overhead(miss_deg)
    found = cross(t, position, velocity, acceleration, LIMITS, beam(width_deg))
    assert found is not None
    late = clipped(t, position)
    off = 2.0 * np.arcsin(np.cos(position[:, 1]) * np.abs(np.sin(0.5 * (late - position[:, 0]))))
    lost_late = np.sum(1.0 - beam(width_deg)(off)) * STEP_S
    lost = np.sum(1.0 - beam(width_deg)(found.error_rad)) * STEP_S
    assert lost < lost_late


def test_no_free_search_over_azimuth_paths_finds_a_better_crossing() -> None:
    """60 free azimuths within the same limits, improved by sequential quadratic programming from two starts."""
    t, position, velocity, acceleration = overhead(9.0)
    gain = beam(3.0)
    found = cross(t, position, velocity, acceleration, LIMITS, gain)
    assert found is not None
    lost = float(np.sum(1.0 - gain(found.error_rad)) * STEP_S)
    every = 15
    part = np.abs(t) < 45.0
    times, path = t[part][::every], position[part][::every]
    step_s = every * STEP_S

    def loss(azimuth: Array) -> float:
        off = 2.0 * np.arcsin(np.clip(np.cos(path[:, 1]) * np.sin(0.5 * (azimuth - path[:, 0])), -1.0, 1.0))
        return float(np.sum(1.0 - gain(np.abs(off))) * step_s)

    def room(azimuth: Array) -> Array:
        rates = np.diff(azimuth) / step_s
        bends = np.diff(rates) / step_s
        return np.concatenate([2.0 * DEG - rates, 2.0 * DEG + rates, 1.0 * DEG - bends, 1.0 * DEG + bends])

    ours = np.interp(times, found.t_s, found.position_rad[:, 0], left=np.nan, right=np.nan)
    ours = np.where(np.isnan(ours), path[:, 0], ours)
    best = min(
        minimize(loss, start, constraints={"type": "ineq", "fun": room}, method="SLSQP", options={"maxiter": 60}).fun
        for start in (ours, np.linspace(path[0, 0], path[-1, 0], len(times)))
    )
    # The elevation helps ours, and does not help the search: it may only be as good.
    assert lost <= best * 1.02


BEAM_RAD = 0.001
RISE_S, PEAK_RAD = 20.0, 0.002


def gain(error: np.ndarray) -> np.ndarray:
    return np.exp(-4.0 * math.log(2.0) * (error / BEAM_RAD) ** 2)


def test_a_triangle_of_error_has_the_loss_of_its_integrals() -> None:
    t = np.arange(0.0, 2.0 * RISE_S + 1e-9, 0.01)
    error = PEAK_RAD * (1.0 - np.abs(t / RISE_S - 1.0))
    still = np.zeros((len(t), 2))
    crossing = Crossing(t, still, still, still, error)
    loss = CrossingLoss.of(crossing, gain)
    assert loss.keyhole_s == pytest.approx(2.0 * RISE_S * 0.95, abs=0.03)
    assert loss.lost_s == pytest.approx(2.0 * RISE_S * (1.0 - 0.5 * BEAM_RAD / PEAK_RAD), abs=0.03)
    received_s = 2.0 * RISE_S * BEAM_RAD / PEAK_RAD * 0.5 * math.sqrt(math.pi / (4.0 * math.log(2.0)))
    assert loss.lost_signal_s == pytest.approx(2.0 * RISE_S - received_s, abs=0.01)
    assert loss.peak_loss_db == 40.0, "the sidelobes, where the Gaussian would be 48 dB down"
    half = CrossingLoss.of(crossing, gain, begin_s=RISE_S)
    for name in ("keyhole_s", "lost_s", "lost_signal_s"):
        assert getattr(half, name) == pytest.approx(0.5 * getattr(loss, name), abs=0.02), "what is behind is past"
    assert CrossingLoss.of(crossing, gain, begin_s=2.0 * RISE_S + 1.0) == CrossingLoss()


def test_without_a_crossing_nothing_is_lost() -> None:
    assert CrossingLoss.of(None, gain) == CrossingLoss(0.0, 0.0, 0.0, 0.0)


@pytest.mark.parametrize(
    ("rate", "bend", "height", "needed"),
    [(1.99, 0.99, 89.9, False), (2.01, 0.0, 50.0, True), (0.0, -1.01, 50.0, True), (0.0, 0.0, 90.1, True)],
)
def test_a_crossing_is_needed_where_any_limit_is_exceeded(
    rate: float, bend: float, height: float, needed: bool
) -> None:
    t = np.arange(0.0, 60.0, STEP_S)
    position, velocity, acceleration = np.zeros((len(t), 2)), np.zeros((len(t), 2)), np.zeros((len(t), 2))
    position[:, 0] = 0.1 * DEG * t
    velocity[300, 0], acceleration[300, 0], position[300, 1] = rate * DEG, bend * DEG, height * DEG
    assert (cross(t, position, velocity, acceleration, LIMITS, beam(1.0)) is not None) is needed


@pytest.mark.parametrize("miss_deg", [0.4, 4.0])
def test_a_crossing_has_the_rates_of_its_positions_and_the_targets_own_at_its_ends(miss_deg: float) -> None:
    t, *path = overhead(miss_deg)
    found = cross(t, *path, LIMITS, beam(1.0))
    assert found is not None
    first = round((found.t_s[0] - t[0]) / STEP_S)
    rows = [first, first + len(found.t_s) - 1]
    np.testing.assert_array_equal(found.velocity_rad_s[[0, -1]], path[1][rows])
    np.testing.assert_array_equal(found.acceleration_rad_s2[[0, -1]], path[2][rows])
    moved, rates = found.position_rad, found.velocity_rad_s
    np.testing.assert_allclose(rates[1:-1], (moved[2:] - moved[:-2]) / (2.0 * STEP_S), atol=1e-12)
    np.testing.assert_allclose(
        found.acceleration_rad_s2[2:-2], (rates[3:-1] - rates[1:-3]) / (2.0 * STEP_S), atol=1e-12
    )
    np.testing.assert_allclose(found.error_rad, angle_between(moved, path[0][rows[0] : rows[1] + 1]), atol=1e-12)
