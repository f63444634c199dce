import math

import erfa
import numpy as np
import pytest

from rf_pointing.papers.orbit import Elements, Gravity, Site, look, propagate
from rf_pointing.papers.orbit.earth import sidereal_angle_rad, to_earth_fixed, to_inertial
from rf_pointing.papers.orbit.measurements import measured, partials

MAURITIUS = Site(name="Mauritius", latitude_rad=math.radians(-20.34), longitude_rad=math.radians(57.45), height_m=50.0)
EPOCH = 827385062.07


@pytest.fixture(scope="module")
def orbit():
    start = Elements(
        semi_major_axis_m=7205497.854,
        eccentricity=0.002332,
        inclination_rad=math.radians(98.789565),
        node_rad=math.radians(156.612388),
        perigee_rad=math.radians(243.5181),
        mean_anomaly_rad=math.radians(325.4653),
    ).state()
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
