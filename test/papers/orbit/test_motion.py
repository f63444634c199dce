import math

import numpy as np
import pytest

from rf_pointing.core.constants import EARTH_MU_M3_S2, EARTH_RADIUS_M
from rf_pointing.papers.orbit import Elements, Gravity, propagate

ORBIT = Elements(
    semi_major_axis_m=7205497.854,
    eccentricity=0.002332,
    inclination_rad=math.radians(98.789565),
    node_rad=math.radians(156.612388),
    perigee_rad=math.radians(243.5181),
    mean_anomaly_rad=math.radians(325.4653),
)
ROUND = Gravity(j2=0.0, j3=0.0, j4=0.0)


def potential(position, gravity):
    radius = np.linalg.norm(position)
    s, q = position[2] / radius, EARTH_RADIUS_M / radius
    legendre = np.polynomial.legendre.Legendre
    zonal = sum(j * q**n * legendre.basis(n)(s) for n, j in ((2, gravity.j2), (3, gravity.j3), (4, gravity.j4)))
    return EARTH_MU_M3_S2 / radius * (1.0 - zonal)


def test_acceleration_is_the_gradient_of_the_zonal_potential(random):
    gravity = Gravity(j2=1e-3, j3=1e-4, j4=-1e-4)
    for _ in range(5):
        position = random.uniform(4e6, 6e6, 3)
        steps = 30.0 * np.eye(3)
        slope = [(potential(position + h, gravity) - potential(position - h, gravity)) / 60.0 for h in steps]
        assert gravity.acceleration(position) == pytest.approx(slope, rel=1e-8)


def test_two_body_motion_returns_the_kepler_solution_after_a_quarter_day():
    epoch, elapsed = 1e9, 21600.0
    rate = math.sqrt(EARTH_MU_M3_S2 / ORBIT.semi_major_axis_m**3)
    later = ORBIT.replace(mean_anomaly_rad=(ORBIT.mean_anomaly_rad + rate * elapsed) % (2.0 * math.pi))
    found = propagate(epoch, ORBIT.state(), [epoch + elapsed], ROUND).states[0]
    assert np.linalg.norm(found[:3] - later.state()[:3]) < 1e-3


def test_node_drifts_at_the_secular_rate_of_j2():
    gravity = Gravity(j2=1e-4, j3=0.0, j4=0.0)  # small, so that first-order theory is exact
    rate = math.sqrt(EARTH_MU_M3_S2 / ORBIT.semi_major_axis_m**3)
    revolutions = 15.0 * 2.0 * math.pi / rate  # whole ones, so that the periodic part is the same at both ends
    times = 1e9 + np.array([0.0, revolutions])
    nodes = [Elements.from_state(s).node_rad for s in propagate(1e9, ORBIT.state(), times, gravity).states]
    expected = -1.5 * gravity.j2 * rate * (EARTH_RADIUS_M / ORBIT.semi_major_axis_m) ** 2
    expected *= math.cos(ORBIT.inclination_rad) * revolutions
    assert nodes[1] - nodes[0] == pytest.approx(expected, rel=2e-3)


def test_there_and_back_returns_the_starting_state():
    there = propagate(0.0, ORBIT.state(), [0.0, 7000.0], Gravity()).states[1]
    back = propagate(7000.0, there, [0.0, 3500.0], Gravity()).states[0]
    assert np.linalg.norm(back[:3] - ORBIT.state()[:3]) < 1e-3


def test_partials_predict_a_displaced_orbit_on_both_sides_of_the_epoch():
    times, change = [-3000.0, 0.0, 5000.0], np.array([5.0, -3.0, 2.0, 2e-3, 1e-3, -3e-3])
    nominal = propagate(0.0, ORBIT.state(), times, Gravity(), with_partials=True)
    displaced = propagate(0.0, ORBIT.state() + change, times, Gravity()).states
    for k in range(3):
        predicted = nominal.states[k] + nominal.partials[k] @ change
        assert np.linalg.norm((displaced[k] - predicted)[:3]) < 2e-3


def test_repeated_times_are_allowed_and_decreasing_ones_refused():
    twice = propagate(0.0, ORBIT.state(), [-5.0, -5.0, 0.0, 7.0, 7.0], Gravity()).states
    assert np.array_equal(twice[0], twice[1])
    assert np.array_equal(twice[3], twice[4])
    with pytest.raises(ValueError, match="t_s must not decrease"):
        propagate(0.0, ORBIT.state(), [1.0, 0.0], Gravity())
