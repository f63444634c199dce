"""Air drag and the tides of Sun and Moon, against closed forms and an independent ephemeris."""

import math

import erfa
import numpy as np
import pytest

from rf_pointing.core.constants import EARTH_MU_M3_S2, EARTH_RADIUS_M
from rf_pointing.orbit.forces import EARTH_RATE_RAD_S, MOON_MU_M3_S2, SUN_MU_M3_S2, Disturbances, moon_m, sun_m
from rf_pointing.orbit.motion import point_mass, propagate_together
from rf_pointing.papers.satcal_batch import Arc, fit_orbit
from rf_pointing.papers.satcal_looks import look
from rf_pointing.papers.satcal_motion import Elements, Gravity, Site, propagate

EPOCH = 827385062.07
ROUND = Gravity(j2=0.0, j3=0.0, j4=0.0)
RADIUS_M = EARTH_RADIUS_M + 8.0e5
ORBIT = Elements(
    semi_major_axis_m=7205497.854, eccentricity=0.002332, inclination_rad=math.radians(98.789565),
    node_rad=math.radians(156.612388), perigee_rad=math.radians(243.5181),
    mean_anomaly_rad=math.radians(325.4653),
)  # fmt: skip


@pytest.mark.parametrize("days", [0.0, 1234.5, 9876.5])
def test_sun_and_moon_stand_where_sofa_puts_them(days):
    """Within a tenth of a degree and 0.2 % of the distance of the Sun, 0.4 % of the Moon's."""
    t_s = EPOCH + 86400.0 * days
    julian = (2440587.5, t_s / 86400.0)
    earth = erfa.epv00(*julian)[0]
    unit_m = 1.495978707e11
    for found, expected, share in (
        (sun_m(t_s), -np.asarray(earth["p"]) * unit_m, 2e-3),
        (moon_m(t_s), np.asarray(erfa.moon98(*julian)["p"]) * unit_m, 4e-3),
    ):
        distance = np.linalg.norm(expected)
        between = math.acos(np.clip(found @ expected / np.linalg.norm(found) / distance, -1.0, 1.0))
        assert math.degrees(between) < 0.1
        assert np.linalg.norm(found) == pytest.approx(distance, rel=share)


def test_drag_shrinks_an_equatorial_circle_at_its_closed_rate():
    """da/dt = -rho B a^2 v_r^2 v / GM, with v_r = v - w a."""
    air = Disturbances(ballistic_m2_kg=1.0, air_density_kg_m3=1e-13)
    speed = math.sqrt(EARTH_MU_M3_S2 / RADIUS_M)
    start, elapsed = np.array([RADIUS_M, 0.0, 0.0, 0.0, speed, 0.0]), 6000.0
    states = propagate(EPOCH, start, [EPOCH, EPOCH + elapsed], ROUND, disturbances=air).states
    axes = 1.0 / (2.0 / np.linalg.norm(states[:, :3], axis=1) - np.sum(states[:, 3:] ** 2, axis=1) / EARTH_MU_M3_S2)
    through = speed - EARTH_RATE_RAD_S * RADIUS_M
    expected = -1e-13 * RADIUS_M**2 * through**2 * speed / EARTH_MU_M3_S2 * elapsed
    assert axes[1] - axes[0] == pytest.approx(expected, rel=1e-3)


@pytest.mark.parametrize(("name", "place", "strength"), [("sun", sun_m, SUN_MU_M3_S2), ("moon", moon_m, MOON_MU_M3_S2)])
def test_a_tide_pulls_twice_as_hard_along_the_line_to_the_body_as_it_presses_across(name, place, strength):
    tide = Disturbances(**{name: True})
    body = place(EPOCH)
    toward = body / np.linalg.norm(body)
    across = np.cross(toward, [0.0, 0.0, 1.0])
    across /= np.linalg.norm(across)
    states = np.zeros((2, 6))
    states[:, :3] = RADIUS_M * np.stack([toward, across])
    pull = tide.acceleration(EPOCH, states)
    size = strength * RADIUS_M / np.linalg.norm(body) ** 3
    assert pull[0] @ toward == pytest.approx(2.0 * size, rel=0.06)
    assert pull[1] @ across == pytest.approx(-size, rel=0.06)


def test_an_orbit_with_drag_and_tides_is_fitted_exactly_with_them_and_badly_without():
    elements = Elements(
        semi_major_axis_m=7.2e6, eccentricity=0.002, inclination_rad=1.72, node_rad=2.7, perigee_rad=4.2,
        mean_anomaly_rad=5.7,
    )  # fmt: skip
    everything = Disturbances(ballistic_m2_kg=1.0, air_density_kg_m3=1e-11, sun=True, moon=True)
    site = Site(name="Mauritius", latitude_rad=math.radians(-20.3), longitude_rad=math.radians(57.5))
    times = EPOCH + np.concatenate([np.arange(0.0, 600.0, 60.0), np.arange(6000.0, 6600.0, 60.0)])
    states = propagate(EPOCH, elements.state(), times, Gravity(), disturbances=everything).states
    seen = look(times, states, site, Gravity())
    arcs = [Arc(site, kind, times, getattr(seen, kind), np.full(len(times), size))
            for kind, size in (("range_m", 10.0), ("azimuth_rad", 1e-4), ("elevation_rad", 1e-4))]  # fmt: skip
    guess = elements.state() + np.array([50.0, -50.0, 50.0, 0.05, 0.05, -0.05])
    with_them = fit_orbit(EPOCH, guess, arcs, Gravity(), disturbances=everything)
    without = fit_orbit(EPOCH, guess, arcs, Gravity())
    assert np.linalg.norm(with_them.state[:3] - elements.state()[:3]) < 0.01
    assert np.max(np.abs(with_them.residuals[0])) < 0.01
    assert np.max(np.abs(without.residuals[0])) > 10.0


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


def test_partials_predict_a_displaced_orbit_on_both_sides_of_the_epoch():
    times, change = [-3000.0, 0.0, 5000.0], np.array([5.0, -3.0, 2.0, 2e-3, 1e-3, -3e-3])
    nominal = propagate(0.0, ORBIT.state(), times, Gravity(), with_partials=True)
    displaced = propagate(0.0, ORBIT.state() + change, times, Gravity()).states
    for k in range(3):
        predicted = nominal.states[k] + nominal.partials[k] @ change
        assert np.linalg.norm((displaced[k] - predicted)[:3]) < 2e-3


def test_repeated_times_are_allowed_and_decreasing_ones_refused():
    twice = propagate(0.0, ORBIT.state(), [-5.0, -5.0, 0.0, 7.0, 7.0], Gravity()).states
    assert np.array_equal(twice[[0, 3]], twice[[1, 4]])
    with pytest.raises(ValueError, match="t_s must not decrease"):
        propagate(0.0, ORBIT.state(), [1.0, 0.0], Gravity())


def test_an_orbit_that_falls_into_the_earth_is_refused_with_its_time():
    with pytest.raises(ValueError, match=r"failed at 931 s: positions have not settled to 0.0001 m after 30 sweeps"):
        propagate_together([[7e6, 0.0, 0.0, 0.0, 0.0, 0.0]], [3000.0], point_mass)


def test_parts_of_a_second_on_both_sides_of_the_epoch_come_in_order():
    times = [-0.9, -0.2, 0.0, 0.3, 0.8]
    states = propagate(0.0, ORBIT.state(), times, Gravity()).states
    start = ORBIT.state()
    for t_s, state in zip(times, states, strict=True):
        expected = start[:3] + t_s * start[3:] + 0.5 * t_s**2 * Gravity().acceleration(start[:3])
        assert state[:3] == pytest.approx(expected, abs=0.01)
