"""Circle and spiral: geometry, rates and accelerations."""

import math
from collections.abc import Callable

import numpy as np
import pytest

from rf_pointing.core import MDEG
from rf_pointing.tracking import SpiralParams, SpiralSearch
from rf_pointing.tracking.scan import Offset, ScanParams

STEP_S = 1e-4


def rates_by_difference(offset: Callable[[float], Offset], t_s: float) -> tuple[float, float]:
    before, after = offset(t_s - STEP_S), offset(t_s + STEP_S)
    return (
        (after.cross_elevation_rad - before.cross_elevation_rad) / (2.0 * STEP_S),
        (after.elevation_rad - before.elevation_rad) / (2.0 * STEP_S),
    )


@pytest.mark.parametrize("t_s", [0.7, 2.3, 3.99, 4.5, 17.0])
def test_circle_rates_are_the_derivative_of_the_circle(t_s: float) -> None:
    params = ScanParams(radius_rad=6.0 * MDEG, period_s=10.0, ramp_s=4.0)
    now = params.offset(t_s)
    assert now[2:] == pytest.approx(rates_by_difference(lambda t: params.offset(t), t_s), abs=1e-6 * MDEG)


def test_circle_has_its_radius_and_period_after_the_ramp_and_rests_at_the_start() -> None:
    params = ScanParams(radius_rad=6.0 * MDEG, period_s=10.0, ramp_s=4.0)
    later = params.offset(7.3)
    assert math.hypot(later.cross_elevation_rad, later.elevation_rad) == pytest.approx(6.0 * MDEG, rel=1e-12)
    assert params.offset(17.3) == pytest.approx(later, abs=1e-12 * MDEG)
    assert params.offset(0.0) == Offset(0.0, 0.0, 0.0, 0.0)
    assert params.offset(1e-3)[2:] == pytest.approx((0.0, 0.0), abs=1e-4 * MDEG)


SPIRALS = (
    SpiralParams(),
    SpiralParams(half_power_beamwidth_rad=17.0 * MDEG, uncertainty_rad=30.0 * MDEG, acceleration_rad_s2=200.0 * MDEG),
)


@pytest.mark.parametrize("params", SPIRALS)
def test_spiral_rates_are_the_derivative_of_the_spiral(params: SpiralParams) -> None:
    search = SpiralSearch(params)
    for t_s in np.linspace(0.31, search.duration_s - 0.31, 23):
        expected = rates_by_difference(search.offset, float(t_s))
        assert search.offset(float(t_s))[2:] == pytest.approx(expected, abs=0.05 * MDEG)


@pytest.mark.parametrize("params", SPIRALS)
def test_spiral_keeps_its_speed_and_acceleration(params: SpiralParams) -> None:
    search = SpiralSearch(params)
    times = np.linspace(0.0, search.duration_s, 20001)
    rates = np.array([search.offset(float(t))[2:] for t in times])
    assert np.hypot(*rates.T).max() <= params.rate_rad_s * (1.0 + 1e-12)
    acceleration = np.hypot(*np.gradient(rates, times, axis=0).T)
    assert acceleration.max() <= params.acceleration_rad_s2 * 1.02


def test_speed_is_constant_between_the_start_and_the_end() -> None:
    search = SpiralSearch(SPIRALS[0])
    speeds = [math.hypot(*search.offset(share * search.duration_s)[2:]) for share in (0.3, 0.5, 0.7, 0.9)]
    assert speeds == pytest.approx([SPIRALS[0].rate_rad_s] * 4, rel=1e-9)


@pytest.mark.parametrize("params", SPIRALS)
def test_every_direction_within_the_radius_comes_within_half_a_pitch(params: SpiralParams) -> None:
    search = SpiralSearch(params)
    path = np.array([search.offset(float(t))[:2] for t in np.linspace(0.0, search.duration_s, 20001)])
    pitch = params.pitch_beamwidths * params.half_power_beamwidth_rad
    rng = np.random.default_rng(11)
    reach, angle = params.radius_rad * np.sqrt(rng.uniform(0.0, 1.0, 300)), rng.uniform(0.0, 6.3, 300)
    for x, y in zip(reach * np.cos(angle), reach * np.sin(angle), strict=True):
        assert np.hypot(path[:, 0] - x, path[:, 1] - y).min() <= 0.5 * pitch * 1.02


def test_spiral_goes_out_from_rest_to_rest_half_a_pitch_beyond_the_radius_and_comes_back_the_same_way() -> None:
    search = SpiralSearch(SpiralParams())
    assert search.offset(-1.0) == pytest.approx((0.0, 0.0, 0.0, 0.0), abs=1e-15)
    end = search.offset(search.duration_s)
    assert math.hypot(*end[:2]) == pytest.approx((195.0 + 0.5 * 39.0) * MDEG, rel=1e-9)
    assert end[2:] == pytest.approx((0.0, 0.0), abs=1e-6 * MDEG)
    out, back = search.offset(search.duration_s - 3.0), search.offset(search.duration_s + 3.0)
    assert back[:2] == pytest.approx(out[:2], abs=1e-9 * MDEG)
    assert back[2:] == pytest.approx((-out[2], -out[3]), abs=1e-6 * MDEG)
    again = search.offset(2.0 * search.duration_s + 4.0)
    assert again == pytest.approx(search.offset(4.0), abs=1e-9 * MDEG)


def test_three_beamwidths_at_x_band_are_searched_in_30_s() -> None:
    assert SpiralSearch(SpiralParams()).params.radius_rad == pytest.approx(3.0 * 65.0 * MDEG)
    assert SpiralSearch(SpiralParams()).duration_s <= 30.0


def test_search_of_thousands_of_turns_is_refused() -> None:
    with pytest.raises(ValueError, match="needs 29412 turns of the spiral, must be <= 200"):
        SpiralParams(half_power_beamwidth_rad=1.0 * MDEG, uncertainty_rad=5882.4 * MDEG)
