import math

import numpy as np
import pytest

from rf_pointing.papers.orbit import Elements, Gravity, Site, look, propagate
from rf_pointing.papers.orbit.visits import secular_states, visits

EPOCH, GRAVITY = 827385062.07, Gravity()
MAURITIUS = Site(name="Mauritius", latitude_rad=math.radians(-20.34), longitude_rad=math.radians(57.45))
ORBIT = Elements(
    semi_major_axis_m=7195e3,
    eccentricity=0.0012,
    inclination_rad=math.radians(98.7),
    node_rad=math.radians(156.6),
    perigee_rad=math.radians(243.5),
    mean_anomaly_rad=math.radians(325.0),
)
LOWEST_RAD = math.radians(10.0)


@pytest.fixture(scope="module")
def found():
    return visits(MAURITIUS, ORBIT, EPOCH, 1.0, GRAVITY, step_s=10.0, lowest_rad=LOWEST_RAD)


def test_every_pass_of_the_integrated_orbit_is_found(found):
    times = EPOCH + np.arange(0.0, 86400.0, 30.0)
    seen = look(times, propagate(EPOCH, ORBIT.state(), times, GRAVITY).states, MAURITIUS, GRAVITY)
    up = np.flatnonzero(seen.elevation_rad > LOWEST_RAD + math.radians(2.0))
    groups = np.split(up, np.flatnonzero(np.diff(up) > 1) + 1)
    assert len(groups) >= 3
    for rows in groups:
        middle = float(np.mean(times[rows]))
        assert any(p.t_s[0] - 60.0 < middle < p.t_s[-1] + 60.0 for p in found)


def test_passes_lie_above_the_limit_and_have_consistent_rates(found):
    for one in found:
        assert np.min(one.elevation_rad) >= LOWEST_RAD
        slope = np.gradient(one.elevation_rad, one.t_s)[1:-1]
        assert np.max(np.abs(slope - one.elevation_rate_rad_s[1:-1])) < 5e-4


def test_secular_states_start_at_the_elements():
    assert secular_states(ORBIT, np.array([0.0]), GRAVITY)[0] == pytest.approx(ORBIT.state(), rel=1e-12)


def test_a_satellite_that_never_rises_has_no_passes():
    equatorial = ORBIT.replace(inclination_rad=0.01)
    pole = MAURITIUS.replace(latitude_rad=1.5)
    assert visits(pole, equatorial, EPOCH, 0.5, GRAVITY, step_s=10.0, lowest_rad=LOWEST_RAD) == []
