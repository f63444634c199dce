"""Stays of many objects in closed form: cut by the search and by dips, and straight flights."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import pytest

from rf_pointing.ephemeris.stays import LEAN, SkyMotion, stays_above

STEP_S, COUNT = 60.0, 24
MIDDLE_S = STEP_S * (COUNT / 2 + 0.5)
"""Half way between two grid points."""
SINE_MASK, DIP_S, OUTER_S = 0.1, 20.0, 600.0
RANGE_M = 2e6


END_S = STEP_S * COUNT


class Found(NamedTuple):
    row: np.ndarray
    aos_s: np.ndarray
    tca_s: np.ndarray
    los_s: np.ndarray
    rises_before: np.ndarray
    sets_after: np.ndarray


def found_in(motion: SkyMotion, sine: float = SINE_MASK) -> Found:
    """Return the stays with times of their own objects."""
    stays = stays_above(motion, sine, motion.step_s / 4.0)
    row = motion.objects_at(stays.rise)
    own = (t_s - row * motion.period_s for t_s in (stays.rise, stays.highest(motion)[0], stays.fall))
    return Found(row, *own, *stays.cut_off)


def grid_s(step_s: float = STEP_S, count: int = COUNT) -> np.ndarray:
    return step_s * np.arange(-LEAN[0], count + LEAN[1])


def of_sines(sine: np.ndarray) -> SkyMotion:
    enu = RANGE_M * np.stack([np.zeros_like(sine), np.sqrt(1.0 - sine**2), sine], axis=-1)
    return SkyMotion.through(enu, 0.0, STEP_S)


def of_sine(sine_of: Callable[[np.ndarray], np.ndarray]) -> SkyMotion:
    return of_sines(sine_of(grid_s())[None])


@pytest.mark.parametrize(
    ("peak_s", "half_s", "wanted", "cut"),
    [
        (-200.0, 700.0, (0.0, 0.0, 500.0), (True, False)),
        (END_S + 200.0, 700.0, (END_S - 500.0, END_S, END_S), (False, True)),
        (500.0, 470.0, (30.0, 500.0, 970.0), (False, False)),
        (500.0, 500.0 + 1e-6, (0.0, 500.0, 1000.0), None),
        (END_S - 400.0, 370.0, (END_S - 770.0, END_S - 400.0, END_S - 30.0), (False, False)),
        (700.0, 2000.0, (0.0, 700.0, END_S), (True, True)),
        (613.0, 8.0, (605.0, 613.0, 621.0), (False, False)),
    ],
)
def test_a_stay_is_cut_at_the_ends_of_the_search_and_found_within_its_first_and_last_steps(
    peak_s: float, half_s: float, wanted: tuple[float, float, float], cut: tuple[bool, bool] | None
) -> None:
    """A parabola above the mask for `half_s` on both sides of its peak."""
    sky_ = of_sine(
        lambda x: (
            SINE_MASK
            + 0.1 * (1.0 - ((x - peak_s) / max(half_s, 400.0)) ** 2)
            - 0.1 * (1.0 - (half_s / max(half_s, 400.0)) ** 2)
        )
    )
    found = found_in(sky_)
    assert len(found.row) == 1
    assert (found.aos_s[0], found.los_s[0]) == pytest.approx((wanted[0], wanted[2]), abs=0.01)
    assert found.tca_s[0] == pytest.approx(wanted[1], abs=0.1)
    if cut is not None:
        assert (bool(found.rises_before[0]), bool(found.sets_after[0])) == cut


def test_positions_between_the_grid_points_are_those_of_a_polynomial_of_the_ninth_degree() -> None:
    rng = np.random.default_rng(6)
    curves = [np.polynomial.Polynomial(rng.standard_normal(10), domain=[0.0, END_S]) for _ in range(6)]
    x = grid_s()
    grid = np.array([[curves[3 * row + axis](x) for axis in range(3)] for row in range(2)])
    sampled = SkyMotion.through(1e6 * np.moveaxis(grid, 1, 2), 0.0, STEP_S)
    rows, times = np.array([0, 1, 1, 0, 1, 0]), np.array([0.0, 17.0, 700.3, END_S - 1.0, END_S, END_S])
    place, velocity = sampled.at(times + rows * sampled.period_s, 2)
    for order, ours in enumerate((place, velocity)):
        wanted = [
            [1e6 * curves[3 * row + axis].deriv(order)(t_s) for axis in range(3)]
            for row, t_s in zip(rows, times, strict=True)
        ]
        np.testing.assert_allclose(ours.T, wanted, rtol=1e-7, atol=1e-3)
    np.testing.assert_array_equal(sampled.objects_at(times + rows * sampled.period_s), rows)


def test_a_stay_with_two_maxima_is_one_pass_at_the_higher_one() -> None:
    """A dip that stays above the mask separates nothing."""
    for sign in (1.0, -1.0):

        def sine_of(x: np.ndarray, sign: float = sign) -> np.ndarray:
            off = x - MIDDLE_S
            return SINE_MASK + 4e-13 * (off**2 + 150.0**2) * (OUTER_S**2 - off**2) * (1.0 + sign * 2e-4 * off)

        found = found_in(of_sine(sine_of))
        assert len(found.row) == 1
        assert (found.aos_s[0], found.los_s[0]) == pytest.approx((MIDDLE_S - OUTER_S, MIDDLE_S + OUTER_S), abs=0.01)
        fine = np.arange(0.0, END_S, 0.1)
        assert found.tca_s[0] == pytest.approx(fine[np.argmax(sine_of(fine))], abs=0.3)
        assert (found.tca_s[0] > MIDDLE_S) == (sign > 0.0)


def test_each_of_many_objects_has_its_own_passes_whatever_the_others_do() -> None:
    """Two hundred of them, with one, two or no parabola above the mask."""
    rng, x = np.random.default_rng(8), grid_s()
    sines, wanted = [], []
    for row in range(200):
        first = rng.uniform(200.0, 450.0)
        tops = [first, first + rng.uniform(550.0, 800.0)][: int(rng.integers(0, 3))]
        # Waves of 700 s: between two tops the sine falls well below the mask.
        heights = rng.uniform(0.01, 0.2, len(tops))
        sine = np.full(len(x), -0.3)
        for top, height in zip(tops, heights, strict=True):
            sine = np.maximum(sine, SINE_MASK + height - 0.3 * ((x - top) / 300.0) ** 2)
        sines.append(sine)
        wanted += [(row, top, 300.0 * np.sqrt(height / 0.3)) for top, height in zip(tops, heights, strict=True)]
    found = found_in(of_sines(np.array(sines)))
    order = np.lexsort((found.tca_s, found.row))
    assert found.row[order].tolist() == [row for row, *_ in wanted]
    # The corner between two parabolas is none of a polynomial: it is felt four steps away.
    np.testing.assert_allclose(found.tca_s[order], [top for _, top, _ in wanted], atol=20.0)
    np.testing.assert_allclose(found.aos_s[order], [max(top - half, 0.0) for _, top, half in wanted], atol=25.0)
    np.testing.assert_allclose(found.los_s[order], [top + half for _, top, half in wanted], atol=25.0)


@pytest.mark.parametrize("mask_deg", [-2.0, 5.0, 45.0, 80.0, 88.0])
def test_straight_flights_overhead_are_found_above_any_mask_however_far_the_grid_points_are(mask_deg: float) -> None:
    """500 km high, 7.5 km/s, steps of 4 min, 1800 km: two minutes before its peak at 88 deg one is seen at 29 deg."""
    step_s, height_m, speed_m_s = 240.0, 5e5, 7500.0
    rng = np.random.default_rng(9)
    t_s = grid_s(step_s, 12)
    peak_s, miss_m = rng.uniform(900.0, 1900.0, 60), rng.uniform(-6e4, 6e4, 60)
    # On a path that sinks: below the horizon it goes on, as over a flat Earth that ends.
    along = speed_m_s * (t_s - peak_s[:, None])
    up = height_m - along**2 / (2.0 * 6.8e6)
    enu = np.stack([along, np.broadcast_to(miss_m[:, None], along.shape), up], axis=-1)
    sine = np.sin(np.radians(mask_deg))
    found = found_in(SkyMotion.through(enu, 0.0, step_s), sine)
    # Where up = sine * distance: the root of an even function of the way.
    halves = []
    for miss in miss_m.tolist():
        low, high = 0.0, 3.5e6
        for _ in range(80):
            way = 0.5 * (low + high)
            above = height_m - way**2 / 1.36e7
            low, high = (way, high) if above > sine * np.hypot(np.hypot(way, miss), above) else (low, way)
        halves.append(0.5 * (low + high) / speed_m_s)
    seen = np.array(halves) > 1e-3
    order = np.argsort(found.row)
    assert found.row[order].tolist() == np.flatnonzero(seen).tolist()
    assert 0 < np.count_nonzero(seen) <= 60
    np.testing.assert_allclose(found.tca_s[order], peak_s[seen], atol=0.05)
    np.testing.assert_allclose(found.aos_s[order], (peak_s - halves)[seen], atol=0.01)
    np.testing.assert_allclose(found.los_s[order], (peak_s + halves)[seen], atol=0.01)
    assert not np.any(found.rises_before | found.sets_after)


@pytest.mark.parametrize("dip_s", [MIDDLE_S - 360.0, MIDDLE_S, MIDDLE_S + 420.0])
def test_a_stay_that_is_on_throughout_is_cut_by_a_dip_between_two_grid_points(dip_s: float) -> None:
    """No grid point is below the mask: one part goes on from before the search, the other beyond it."""
    whole = of_sine(lambda x: SINE_MASK + 2e-7 * ((x - dip_s) ** 2 - DIP_S**2))
    found = found_in(whole)
    order = np.argsort(found.aos_s)
    assert found.aos_s[order] == pytest.approx([0.0, dip_s + DIP_S], abs=0.01)
    assert found.los_s[order] == pytest.approx([dip_s - DIP_S, END_S], abs=0.01)
    assert found.tca_s[order] == pytest.approx([0.0, END_S], abs=0.01)
    assert found.rises_before[order].tolist() == [True, False]
    assert found.sets_after[order].tolist() == [False, True]
