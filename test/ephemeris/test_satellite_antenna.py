"""The satellite's antenna towards the station: orbital frame against skyfield, attitude and pattern by hand."""

import math

import numpy as np
import pytest
from skyfield.api import EarthSatellite, load, wgs84

from rf_pointing.array_sensors.attitude.quaternion import quaternion_from_roll_pitch_yaw, quaternion_to_matrix
from rf_pointing.ephemeris import SITES, SatelliteAntennaParams, TopocentricTrack, find_elements, verification_elements
from rf_pointing.ephemeris.satellite_antenna import orbital_axes, orbital_rate_rad_s
from rf_pointing.ephemeris.state_vector import StateVector
from test.ephemeris.test_track import tle_lines

SITE = SITES["Goldstone DSS-13"]
WIDTH_RAD = math.radians(60.0)


def track(number: str = "28057", **antenna: float) -> TopocentricTrack:
    params = SatelliteAntennaParams(half_power_beamwidth_rad=WIDTH_RAD, **antenna)
    return TopocentricTrack(find_elements(verification_elements(), number), SITE, refraction=None, antenna=params)


def skyfield_directions(number: str, t_s: np.ndarray) -> np.ndarray:
    """Return unit vectors (n, 3) from the satellite to the site in the orbital frame, all in inertial axes."""
    scale = load.timescale(builtin=True)
    times = scale.utc(1970, 1, 1 + t_s // 86400.0, 0, 0, t_s % 86400.0)
    body = EarthSatellite(*tle_lines(number), "", scale).at(times)
    place = wgs84.latlon(math.degrees(SITE.latitude_rad), math.degrees(SITE.longitude_rad), SITE.altitude_m).at(times)
    r, v = body.position.m.T, body.velocity.m_per_s.T
    down, normal = -r, np.cross(v, r)
    rows = [np.cross(normal, down), normal, down]
    axes = np.stack([row / np.linalg.norm(row, axis=1, keepdims=True) for row in rows], axis=1)
    line = place.position.m.T - r
    return np.einsum("nij,nj->ni", axes, line / np.linalg.norm(line, axis=1, keepdims=True))


@pytest.mark.parametrize("number", ["28057", "8195"])
def test_gain_of_a_turned_satellite_is_that_of_skyfield_s_geometry(number: str) -> None:
    turn = {"roll_rad": 0.5, "pitch_rad": -0.3, "yaw_rad": 1.1}
    satellite = track(number, **turn)
    t_s = find_elements(verification_elements(), number).epoch_t_s + np.arange(0.0, 86400.0, 61.0)
    axis = quaternion_to_matrix(quaternion_from_roll_pitch_yaw(list(turn.values())))[:, 2]
    off = np.arccos(np.clip(skyfield_directions(number, t_s) @ axis, -1.0, 1.0))
    wanted = np.maximum(-3.0 * (off / (0.5 * WIDTH_RAD)) ** 2, -20.0)
    gain = satellite.sample(t_s).satellite_gain_db
    # Half a beamwidth and more off the axis a millidegree is 1e-3 dB.
    np.testing.assert_allclose(gain, wanted, atol=2e-3)
    assert gain.max() > -1.5
    assert gain.min() < -10.0
    assert satellite.target_at(float(t_s[7])).satellite_gain_db == pytest.approx(float(gain[7]))


def test_a_satellite_that_holds_nadir_is_off_by_the_angle_of_the_triangle() -> None:
    satellite = track()
    t_s = find_elements(verification_elements(), "28057").epoch_t_s + np.arange(0.0, 86400.0, 61.0)
    looks = satellite.sample(t_s)
    place = np.linalg.norm(SITE.position_m)
    position = np.linalg.norm(np.stack(satellite.target.motion_at(t_s).position), axis=0)
    # Law of cosines at the satellite; the light time moves the range by some metres.
    cosine = (position**2 + looks.range_m**2 - place**2) / (2.0 * position * looks.range_m)
    wanted = np.maximum(-12.0 * (np.arccos(cosine) / WIDTH_RAD) ** 2, -20.0)
    np.testing.assert_allclose(looks.satellite_gain_db, wanted, atol=5e-3)


def test_a_measured_attitude_takes_the_place_of_the_stated_one() -> None:
    turn = (0.4, -0.7, 2.5)
    antenna = SatelliteAntennaParams(half_power_beamwidth_rad=WIDTH_RAD)
    found = antenna.turned(tuple(quaternion_from_roll_pitch_yaw(list(turn)).tolist()))
    assert (found.roll_rad, found.pitch_rad, found.yaw_rad) == pytest.approx(turn)
    assert found.half_power_beamwidth_rad == WIDTH_RAD


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_an_attitude_straight_up_is_taken_with_the_rounding_of_its_file(side: float) -> None:
    """Eight digits make this quaternion 1.3e-8 too long: the sine of its pitch exceeds 1."""
    found = SatelliteAntennaParams(half_power_beamwidth_rad=WIDTH_RAD).turned((0.0, side * 0.70710679, 0.0, 0.70710679))
    assert found.pitch_rad == pytest.approx(side * 0.5 * math.pi)


def test_without_a_width_the_satellite_sends_alike_in_all_directions() -> None:
    plain = TopocentricTrack(find_elements(verification_elements(), "28057"), SITE)
    t_s = find_elements(verification_elements(), "28057").epoch_t_s + np.arange(0.0, 6000.0, 60.0)
    assert np.all(plain.sample(t_s).satellite_gain_db == 0.0)
    moved = track().with_offsets(along_track_offset_s=1.0, cross_track_offset_rad=0.0)
    assert np.any(moved.sample(t_s).satellite_gain_db < 0.0)


def test_the_orbital_frame_turns_as_the_differences_of_its_axes(random: np.random.Generator) -> None:
    """Along a path that is no plane: a cubic with an acceleration across the orbit too."""
    powers = np.array([[7e6, 1e5, -2e5], [300.0, 6500.0, 3500.0], [-8.0, 1.0, 2.0], [1e-3, -2e-3, 3e-3]])
    powers = powers * (1.0 + 0.1 * random.standard_normal(powers.shape))
    curves = [np.polynomial.Polynomial(column) for column in powers.T]

    def motion(t_s: float) -> StateVector:
        return StateVector(*(tuple(float(curve.deriv(k)(t_s)) for curve in curves) for k in range(4)))

    def axes(t_s: float) -> np.ndarray:
        return np.array(orbital_axes(motion(t_s)))

    here, step_s = axes(3.0), 0.01
    np.testing.assert_allclose(here @ here.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(here) == pytest.approx(1.0)
    position, velocity = (np.array(part) for part in motion(3.0).derivatives()[:2])
    assert here[2] @ position == pytest.approx(-np.linalg.norm(position))
    assert here[1] @ np.cross(position, velocity) == pytest.approx(-np.linalg.norm(np.cross(position, velocity)))
    # Rows turn as d(row)/dt = w x row; in the rows' own components.
    change = (axes(3.0 + step_s) - axes(3.0 - step_s)) / (2.0 * step_s) @ here.T
    wanted = np.array([change[1, 2], change[2, 0], change[0, 1]])
    np.testing.assert_allclose(orbital_rate_rad_s(motion(3.0)), wanted, rtol=1e-6, atol=1e-11)
