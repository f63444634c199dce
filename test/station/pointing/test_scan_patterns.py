"""What an array costs: the loop that the certificate flies is that of the controller, and C/N0 decides where it has one."""

import dataclasses

import numpy as np
import pytest

from rf_pointing.controllers import TrackerIntegrator, TrackerIntegratorParams
from rf_pointing.core import random_stream
from rf_pointing.planning import SensorCost
from rf_pointing.rf.dish_array import DishArrayParams
from rf_pointing.station.pointing.scan_patterns import UNDERWAY_S, array_cost, loop_offsets_rad
from rf_pointing.tracking import AutotrackParams

WIDTH_RAD = 0.077
PROGRAM = SensorCost(power=0.6)
ARRAY = DishArrayParams()


@pytest.mark.parametrize(
    "changes", [{}, {"mean_of": 5, "mean_within_rad": 4e-3}, {"bandwidth_hz": 0.5}, {"offset_limit_rad": 2e-3}]
)
def test_the_loops_are_those_of_the_tracking_integrator(changes: dict[str, float]) -> None:
    params = dataclasses.replace(TrackerIntegratorParams(bandwidth_hz=0.2, offset_limit_rad=0.1), **changes)
    noise = 0.01 * random_stream(4, "loops").standard_normal((300, 2, 3))
    found, underway = loop_offsets_rad(params, noise), round(UNDERWAY_S / params.sample_s)
    for column in range(3):
        loop, offsets = TrackerIntegrator(params), np.zeros((300, 2))
        loop.reset(0.0)
        for k in range(300):
            t_s = k * params.sample_s
            seen = offsets[k - underway] if k >= underway else np.zeros(2)
            loop.update(t_s, noise[k, :, column] - seen)
            offsets[k] = loop.at(t_s)[0]
        np.testing.assert_allclose(found[:, :, column], offsets, atol=1e-12)
        assert np.abs(offsets).max() > 1e-3


def cost(level_db_hz: float, **changes: float) -> float:
    table = AutotrackParams(array_gain_db=-14.0, array_on_db_hz=31.3, array_off_db_hz=29.3)
    loop = TrackerIntegratorParams(bandwidth_hz=0.2, offset_limit_rad=0.1, **changes)
    return array_cost(ARRAY, loop, table, [level_db_hz] * 100, WIDTH_RAD, PROGRAM).power


def test_a_weak_array_costs_more_until_it_has_no_carrier() -> None:
    powers = [cost(level) for level in (80.0, 60.0, 50.0, 44.0)]
    assert powers == sorted(powers, reverse=True)
    # What is left are the phases that the calibration does not know.
    assert powers[0] > 0.997
    assert powers[-1] < 0.97
    # 43.3 dB-Hz of the dish are the 29.3 dB-Hz of the array below which it has no direction.
    assert cost(43.2) == PROGRAM.power < cost(43.4)


def test_a_linear_loop_loses_what_its_noise_bandwidth_says() -> None:
    """a / (2 - a) of the variance of white noise, a = 2 pi f T, for a loop that is slow against its delay."""
    params = TrackerIntegratorParams(bandwidth_hz=0.02, offset_limit_rad=0.1, acceleration_rad_s2=1.0)
    noise = 1e-3 * random_stream(4, "loops").standard_normal((6000, 2, 40))
    gain = 2.0 * np.pi * params.bandwidth_hz * params.sample_s
    variance = np.mean(np.square(loop_offsets_rad(params, noise)[1000:]))
    assert variance == pytest.approx(1e-6 * gain / (2.0 - gain), rel=0.1)
