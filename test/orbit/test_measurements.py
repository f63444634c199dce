import math

import erfa
import numpy as np
import pytest

from rf_pointing.core.constants import EARTH_MU_M3_S2, EARTH_RADIUS_M
from rf_pointing.orbit.forces import sidereal_angle_rad
from rf_pointing.papers.satcal_looks import look, secular_states, visits
from rf_pointing.papers.satcal_motion import (
    Elements,
    Gravity,
    Site,
    measured,
    partials,
    propagate,
    to_earth_fixed,
    to_inertial,
)
from test.orbit.test_motion import ORBIT as CALIBRATED

MAURITIUS = Site(name="Mauritius", latitude_rad=math.radians(-20.34), longitude_rad=math.radians(57.45), height_m=50.0)
EPOCH, GRAVITY = 827385062.07, Gravity()
SEA_LEVEL = Site(name="Mauritius", latitude_rad=math.radians(-20.34), longitude_rad=math.radians(57.45))
ORBIT = Elements(
    semi_major_axis_m=7195e3, eccentricity=0.0012, inclination_rad=math.radians(98.7),
    node_rad=math.radians(156.6), perigee_rad=math.radians(243.5),
    mean_anomaly_rad=math.radians(325.0),
)  # fmt: skip
LOWEST_RAD = math.radians(10.0)


def test_elements_and_state_are_inverses_for_random_orbits(random):
    for _ in range(50):
        given = Elements(
            semi_major_axis_m=random.uniform(6.8e6, 4.2e7), eccentricity=random.uniform(0.001, 0.7),
            inclination_rad=random.uniform(0.05, 3.0), node_rad=random.uniform(0.0, 6.28),
            perigee_rad=random.uniform(0.0, 6.28), mean_anomaly_rad=random.uniform(0.0, 6.28),
        )  # fmt: skip
        back = Elements.from_state(given.state())
        assert np.allclose(back.state(), given.state(), rtol=1e-11)
        assert back.semi_major_axis_m == pytest.approx(given.semi_major_axis_m, rel=1e-12)
        assert back.node_rad == pytest.approx(given.node_rad, abs=1e-10)


def test_an_open_orbit_is_refused():
    with pytest.raises(ValueError, match="not a closed orbit"):
        Elements.from_state([7e6, 0.0, 0.0, 0.0, 12000.0, 100.0])


@pytest.fixture(scope="module")
def orbit():
    start = CALIBRATED.state()
    return propagate(EPOCH, start, EPOCH + np.arange(-200.0, 201.0, 1.0), Gravity())


def test_sidereal_angle_agrees_with_sofa_to_a_microradian():
    for t_s in (EPOCH, 1.8e9):
        days = t_s / 86400.0
        assert float(sidereal_angle_rad(t_s)) == pytest.approx(erfa.gmst82(2440587.5, days), abs=1e-6)


def test_station_position_agrees_with_sofa():
    expected = erfa.gd2gc(1, MAURITIUS.longitude_rad, MAURITIUS.latitude_rad, MAURITIUS.height_m)
    assert MAURITIUS.position_m() == pytest.approx(expected, abs=1e-6)


def test_inertial_and_earth_fixed_axes_are_inverses(random):
    vector, times = random.normal(size=(5, 3)), EPOCH + np.arange(5.0)
    assert np.allclose(to_inertial(to_earth_fixed(vector, times), times), vector, atol=1e-15)


def test_rates_and_accelerations_are_the_derivatives_of_the_angles(orbit):
    seen = look(orbit.t_s, orbit.states, MAURITIUS, Gravity())
    for name, slope, tolerance in (
        ("azimuth_rad", "azimuth_rate_rad_s", 1e-11),
        ("elevation_rad", "elevation_rate_rad_s", 1e-11),
        ("azimuth_rate_rad_s", "azimuth_acceleration_rad_s2", 1e-12),
        ("elevation_rate_rad_s", "elevation_acceleration_rad_s2", 1e-12),
        ("range_m", "range_rate_m_s", 1e-5),
    ):
        value = getattr(seen, name)
        numeric = (8.0 * (value[3:-1] - value[1:-3]) - (value[4:] - value[:-4])) / 12.0
        assert np.max(np.abs(numeric - getattr(seen, slope)[2:-2])) < tolerance


def test_look_and_measured_agree(orbit):
    seen = look(orbit.t_s, orbit.states, MAURITIUS, Gravity())
    direct = measured(orbit.t_s, orbit.states, MAURITIUS)
    assert np.allclose(np.angle(np.exp(1j * (seen.azimuth_rad - direct[:, 0]))), 0.0, atol=1e-12)
    assert seen.elevation_rad == pytest.approx(direct[:, 1], abs=1e-12)
    assert seen.range_rate_m_s == pytest.approx(direct[:, 3], abs=1e-7)


def test_partials_are_the_differences_of_the_measurements(orbit):
    analytic = partials(orbit.t_s, orbit.states, MAURITIUS)
    for j, size in enumerate([1.0] * 3 + [1e-3] * 3):
        step = np.zeros(6)
        step[j] = size
        forward = measured(orbit.t_s, orbit.states + step, MAURITIUS)
        numeric = (forward - measured(orbit.t_s, orbit.states - step, MAURITIUS)) / (2.0 * size)
        assert np.allclose(numeric, analytic[:, :, j], rtol=1e-6, atol=1e-12)


@pytest.fixture(scope="module")
def found():
    return visits(SEA_LEVEL, ORBIT, EPOCH, 1.0, GRAVITY, step_s=10.0, lowest_rad=LOWEST_RAD)


def test_every_pass_of_the_integrated_orbit_is_found(found):
    times = EPOCH + np.arange(0.0, 86400.0, 30.0)
    seen = look(times, propagate(EPOCH, ORBIT.state(), times, GRAVITY).states, SEA_LEVEL, GRAVITY)
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
    pole = SEA_LEVEL.replace(latitude_rad=1.5)
    assert visits(pole, equatorial, EPOCH, 0.5, GRAVITY, step_s=10.0, lowest_rad=LOWEST_RAD) == []


def test_secular_drift_is_that_of_j2_in_node_perigee_and_anomaly():
    gravity, elapsed = Gravity(j2=1e-3), 864000.0
    a, e, i = ORBIT.semi_major_axis_m, ORBIT.eccentricity, ORBIT.inclination_rad
    motion = math.sqrt(EARTH_MU_M3_S2 / a**3)
    drift = 1.5 * 1e-3 * motion * (EARTH_RADIUS_M / (a * (1.0 - e**2))) ** 2 * elapsed
    later = ORBIT.replace(
        node_rad=ORBIT.node_rad - drift * math.cos(i),
        perigee_rad=ORBIT.perigee_rad + drift * (2.0 - 2.5 * math.sin(i) ** 2),
        mean_anomaly_rad=(
            ORBIT.mean_anomaly_rad + motion * elapsed + drift * math.sqrt(1.0 - e**2) * (1.0 - 1.5 * math.sin(i) ** 2)
        ) % (2.0 * math.pi),
    )  # fmt: skip
    assert secular_states(ORBIT, np.array([elapsed]), gravity)[0] == pytest.approx(later.state(), rel=1e-7)


def test_passes_are_within_their_days_and_half_an_hour_long_at_most(found):
    assert [one.t_s[0] < EPOCH + 86400.0 + 900.0 for one in found] == [True] * len(found)
    assert max(one.t_s[-1] - one.t_s[0] for one in found) <= 1800.0
    assert all(np.allclose(np.diff(one.t_s), 10.0) for one in found)
    with pytest.raises(ValueError, match="days=1000.5 must be <= 1000"):
        visits(SEA_LEVEL, ORBIT, EPOCH, 1000.5, GRAVITY, step_s=10.0, lowest_rad=LOWEST_RAD)
    assert visits(SEA_LEVEL, ORBIT, EPOCH, 0.0, GRAVITY, step_s=10.0, lowest_rad=LOWEST_RAD) == []


def test_azimuth_of_a_look_is_continuous_through_north():
    times = EPOCH + np.arange(0.0, 86400.0, 20.0)
    seen = look(times, propagate(EPOCH, ORBIT.state(), times, GRAVITY).states, SEA_LEVEL, GRAVITY)
    assert np.max(np.abs(np.diff(seen.azimuth_rad))) < math.pi
    assert np.ptp(seen.azimuth_rad) > 2.0 * math.pi
