import numpy as np
import pytest

from rf_pointing.core import random_stream
from rf_pointing.papers.satcal_campaign import (
    APRIL_T_S,
    IRS_P3_APRIL,
    MAURITIUS,
    SITES,
    observed,
    orbit_error,
    orbit_error_m,
    points_of,
)
from rf_pointing.papers.satcal_looks import visits
from rf_pointing.papers.satcal_motion import Gravity


@pytest.fixture(scope="module")
def points():
    lowest = np.radians(10.0)
    found = visits(SITES["Mauritius"], IRS_P3_APRIL, APRIL_T_S, 6.0, Gravity(), step_s=10.0, lowest_rad=lowest)
    return points_of(found, np.radians(0.01))


def test_simulated_reference_orbit_is_off_by_200_m_rms(points):
    random = random_stream(1, "satcal test orbit")
    squares = [np.mean(np.sum(orbit_error_m(points, random) ** 2, axis=1)) for _ in range(60)]
    assert np.sqrt(np.mean(squares)) == pytest.approx(200.0, rel=0.05)


def test_simulated_orbit_error_is_common_to_a_pass_and_independent_between_passes(points):
    random = random_stream(1, "satcal test correlation")
    draws = np.array([orbit_error_m(points, random)[:, 0] for _ in range(300)])
    ends = [np.flatnonzero(points.pass_id == number)[[0, -1]] for number in points.passes[:2]]
    within = np.corrcoef(draws[:, ends[0][0]], draws[:, ends[0][1]])[0, 1]
    between = np.corrcoef(draws[:, ends[0][0]], draws[:, ends[1][0]])[0, 1]
    assert within > 0.9
    assert abs(between) < 0.2


def test_simulated_observations_differ_from_the_truth_by_bias_orbit_and_noise(points):
    random = random_stream(1, "satcal test noise")
    shift = orbit_error(points, random)
    data = observed(points, MAURITIUS, random, shift)
    left = data.residual_elevation_rad - MAURITIUS.offset_rad(*points.motion())[1] - shift[1]
    assert np.std(left) == pytest.approx(np.radians(0.01), rel=0.1)
