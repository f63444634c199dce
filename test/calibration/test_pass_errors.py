import math
from dataclasses import replace

import numpy as np
import pytest

from rf_pointing.calibration import TERM_NAMES, Observations, PassPriors, fit_bias_model, held_at_zero
from rf_pointing.calibration.pass_errors import (
    SharedErrors,
    Sharing,
    motion_partials,
    pass_partials,
    seen_from,
    shift_by,
    site_partials,
    track_axes,
)
from rf_pointing.calibration.reference import ReferenceTrack
from rf_pointing.core import angular_distance_rad, azel_from_unit_vector, unit_vector_from_azel, wrap_rad
from rf_pointing.ephemeris import TopocentricTrack, find_elements, find_passes, site, verification_elements
from rf_pointing.station.campaign.wrong_causes import moved
from test.calibration.conftest import fly_by

TABLE_1_TERMS = tuple(name for name in TERM_NAMES if not name.endswith("acceleration_lag"))
ORBIT = PassPriors(along_track_m=180.0, cross_track_m=70.0, radial_m=50.0)


def displaced(data, metres):
    """Return azimuth and elevation shifts of a satellite moved along, across and up, from vectors."""
    position = data.range_m[:, np.newaxis] * unit_vector_from_azel(data.true_azimuth_rad, data.true_elevation_rad)
    moved = position + sum(m * axis for m, axis in zip(metres, track_axes(data), strict=True))
    azimuth, elevation = azel_from_unit_vector(moved)
    shift = np.angle(np.exp(1j * (azimuth - data.true_azimuth_rad)))
    return shift, elevation - data.true_elevation_rad


def neighbouring(data, kind, metres):
    """Return the displacement (n,) along, across and up of a neighbouring orbit (Clohessy-Wiltshire)."""
    middle = np.array([0.5 * np.sum(data.t_s[data.pass_id == p][[0, -1]]) for p in data.pass_id])
    height = data.range_m * np.sin(data.true_elevation_rad)
    radius = np.hypot(6.371e6 + height, data.range_m * np.cos(data.true_elevation_rad))
    turn = np.sqrt(3.986004418e14 / radius**3) * (data.t_s - middle)
    zero, one = np.zeros(len(data)), np.ones(len(data))
    shares = {
        "along_track_m": (one, zero, zero),
        "cross_track_m": (zero, np.cos(turn), zero),
        "radial_m": (-2.0 * np.sin(turn), zero, np.cos(turn)),
    }
    return [metres * share[:, np.newaxis] for share in shares[kind]]


def with_pass_errors(data, metres_of):
    azimuth, elevation = data.observed_azimuth_rad.copy(), data.observed_elevation_rad.copy()
    for number in data.passes:
        rows = data.pass_id == number
        shift = displaced(data.select(rows), metres_of[number])
        azimuth[rows] += shift[0]
        elevation[rows] += shift[1]
    return replace(data, observed_azimuth_rad=azimuth, observed_elevation_rad=elevation)


def test_track_axes_are_orthonormal_and_along_the_velocity(campaign, table_1):
    data = campaign(table_1, passes=1)
    axes = np.stack(track_axes(data), axis=1)
    assert np.allclose(axes @ np.swapaxes(axes, 1, 2), np.eye(3), atol=1e-12)
    position = data.range_m[:, np.newaxis] * unit_vector_from_azel(data.true_azimuth_rad, data.true_elevation_rad)
    velocity = np.gradient(position, data.t_s, axis=0)
    assert np.max(np.abs(np.sum(velocity * axes[:, 1], axis=1))) < 1e-6 * np.linalg.norm(velocity[0])
    assert np.all(np.sum(velocity * axes[:, 0], axis=1) > 0.0)


def test_partials_are_the_shift_of_a_displaced_satellite(campaign, table_1):
    data = campaign(table_1, passes=3)
    names = ("along_track_m", "cross_track_m", "radial_m")
    azimuth, elevation = pass_partials(data, names)
    for k in range(3):
        shift = displaced(data, neighbouring(data, names[k], 10.0))
        assert 10.0 * azimuth[:, k] == pytest.approx(shift[0], abs=1e-9)
        assert 10.0 * elevation[:, k] == pytest.approx(shift[1], abs=1e-9)


def test_a_track_seen_from_elsewhere_is_that_of_a_site_there():
    here, away_m = site("Goldstone DSS-13"), np.array([2000.0, -3000.0, 0.0])
    there = moved(here, away_m)
    elements = find_elements(verification_elements(), "28057")
    track = TopocentricTrack(elements, here, refraction=None)
    one = find_passes(track, elements.epoch_t_s, 86400.0, math.radians(20.0))[0]
    times = np.arange(one.aos_t_s, one.los_t_s)
    at, other = (
        ReferenceTrack.of(seen.sample(times)) for seen in (track, TopocentricTrack(elements, there, refraction=None))
    )
    seen = seen_from(at, away_m).at(times)
    # The vertical turns by 0.1 mdeg for 11 m; the rest is that of an ellipsoid.
    turned = np.hypot(*away_m[:2]) / 6.371e6
    off = angular_distance_rad(seen.azimuth_rad, seen.elevation_rad, other.azimuth_rad, other.elevation_rad)
    assert np.max(off) < 1.2 * turned
    assert np.max(np.abs(seen.range_m - other.range_m)) < 0.02 * np.linalg.norm(away_m)


def test_the_moon_and_beyond_have_no_error_of_an_orbit(campaign, table_1):
    data = campaign(table_1, passes=2)
    near, far = (replace(data, range_m=np.full(len(data), range_m)) for range_m in (3e8, 3.6e8))
    assert np.abs(pass_partials(near, ("radial_drift_m_s",))[1]).max() > 1e-4
    assert not np.any(pass_partials(far, PassPriors.of_orbit(1.0).names))


def test_orbit_errors_without_range_are_refused(campaign, table_1):
    data = replace(campaign(table_1, passes=2), range_m=None)
    with pytest.raises(ValueError, match="range_m=None"):
        pass_partials(data, ("radial_m",))


def test_planted_pass_errors_are_recovered_and_stay_out_of_the_terms(campaign, table_1, random):
    clean = campaign(table_1, passes=16)
    metres = random.normal(size=(16, 3)) * [180.0, 70.0, 50.0]
    data = with_pass_errors(clean, metres)
    held = held_at_zero(TABLE_1_TERMS)
    honest = fit_bias_model(data, terms=TABLE_1_TERMS, held=held, pass_priors=ORBIT)
    naive = fit_bias_model(data, terms=TABLE_1_TERMS, held=held)
    truth = np.array([table_1.coefficients[name] for name in TABLE_1_TERMS])
    assert np.max(np.abs(honest.values - truth) / honest.sigma) < 4.0
    assert np.max(np.abs(naive.values - truth) / naive.sigma) > 6.0
    found = {item.pass_id: item for item in honest.pass_errors}
    for number in range(16):
        for k, name in enumerate(("along_track_m", "cross_track_m", "radial_m")):
            assert abs(found[number].values[name] - metres[number, k]) < 4.5 * found[number].sigma[name]


def test_an_almost_free_clock_per_pass_leaves_the_velocity_lags_undetermined(campaign, table_1):
    data = campaign(table_1)
    lags = ("azimuth_velocity_lag", "elevation_velocity_lag")
    terms = ("azimuth_offset", "elevation_offset", *lags)
    tight = fit_bias_model(data, terms=terms, held=held_at_zero(terms), pass_priors=PassPriors(clock_s=1e-6))
    free = fit_bias_model(data, terms=terms, held=held_at_zero(terms), pass_priors=PassPriors(clock_s=10.0))
    assert free.sigma_of(lags[0]) > 100.0 * tight.sigma_of(lags[0])
    assert {lags[0], lags[1]} == set(free.inseparable(0.99)[0][:2])


def test_empty_pass_priors_are_refused():
    with pytest.raises(ValueError, match="all zero"):
        PassPriors()


def seen(fly, t_s):
    """Return observations without a bias of a fly-by `fly` (names and arrays) at `t_s`."""
    none = np.full(len(t_s), 1e-4)
    return Observations(
        station="gs1", band="S", t_s=1e9 + t_s, pass_id=np.zeros(len(t_s), dtype=int), sigma_azimuth_rad=none,
        sigma_elevation_rad=none, observed_azimuth_rad=fly["true_azimuth_rad"],
        observed_elevation_rad=fly["true_elevation_rad"], **fly,
    )  # fmt: skip


@pytest.mark.parametrize("lags_s", [(0.5, -0.8), (-1.5, -1.5)])
def test_lags_show_the_errors_of_a_pass_that_much_ahead(lags_s):
    """Against the closed form of the fly-by at the later times.

    What is left is the jerk of the angles and, for what points along the track, that the range rate is taken as constant.
    """
    t_s = np.arange(-300.0, 301.0, 10.0)
    names = PassPriors(
        along_track_m=1.0, cross_track_m=1.0, radial_m=1.0, along_track_drift_m_s=1.0, cross_track_drift_m_s=1.0,
        radial_drift_m_s=1.0, clock_s=1.0,
    ).names  # fmt: skip
    found = pass_partials(seen(fly_by(500e3, 0.7, t_s), t_s), names, lags_s)
    for axis, lag_s in enumerate(lags_s):
        later = seen(fly_by(500e3, 0.7, t_s + lag_s), t_s + lag_s)
        # Drifts count from the middle of the pass, which a lag does not move.
        later = motion_partials(t_s + lag_s, later.motion(), later.range_m, later.range_rate_m_s, names, (0.0, 0.0))
        now = pass_partials(seen(fly_by(500e3, 0.7, t_s), t_s), names)
        for k in range(len(names)):
            missed, moved = (np.max(np.abs(one[axis][:, k] - later[axis][:, k])) for one in (found, now))
            assert missed < (0.04 if names[k] == "clock_s" else 0.28) * moved
            assert moved > 1e-4 * np.max(np.abs(later[axis][:, k]))


def test_a_site_that_is_off_by_metres_sees_every_target_displaced_by_their_opposite(campaign, table_1):
    data = campaign(table_1, passes=2)
    position = data.range_m[:, np.newaxis] * unit_vector_from_azel(data.true_azimuth_rad, data.true_elevation_rad)
    partials = site_partials(data)
    for k, axis in enumerate(10.0 * np.eye(3)):
        azimuth, elevation = azel_from_unit_vector(position - axis)
        assert 10.0 * partials[0][:, k] == pytest.approx(wrap_rad(azimuth - data.true_azimuth_rad), abs=1e-9)
        assert 10.0 * partials[1][:, k] == pytest.approx(elevation - data.true_elevation_rad, abs=1e-9)


def test_metres_along_across_and_up_shift_a_target_as_vectors_do(campaign, table_1, random):
    data = campaign(table_1, passes=2)
    metres = 20.0 * random.normal(size=(len(data), 3))
    azimuth, elevation = displaced(data, [m[:, np.newaxis] for m in metres.T])
    found = shift_by(data, metres)
    assert found[0] == pytest.approx(azimuth, abs=1e-8)
    assert found[1] == pytest.approx(elevation, abs=1e-8)
    with pytest.raises(ValueError, match="range_rate_m_s=None"):
        shift_by(replace(data, range_rate_m_s=None), metres)


def test_an_error_and_its_drift_share_one_size_and_those_along_the_track_do_not():
    every = PassPriors(
        along_track_m=1.0, cross_track_m=2.0, radial_m=3.0, along_track_drift_m_s=4.0, cross_track_drift_m_s=5.0,
        radial_drift_m_s=6.0, clock_s=7.0,
    )  # fmt: skip
    assert every.sigma.tolist() == [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0]
    assert every.groups == (0, 1, 2, 3, 1, 2, 6)
    assert every.replace(cross_track_m=0.0, along_track_m=0.0).groups == (0, 1, 2, 0, 4)
    orbit = PassPriors.of_orbit(300.0)
    assert dict(zip(orbit.names, orbit.sigma.tolist(), strict=True)) == pytest.approx(
        {
            "along_track_m": 300.0, "cross_track_m": 300.0, "radial_m": 300.0,
            "cross_track_drift_m_s": 0.3, "radial_drift_m_s": 0.3,
        }
    )  # fmt: skip
    assert PassPriors.of_orbit(0.0) is None


@pytest.mark.parametrize("inclination_deg", [55.0, 98.0])
def test_one_error_of_the_elements_turns_into_that_of_each_pass(inclination_deg):
    """By SGP4 with elements 300 m off in all directions: one shared error leaves 0.1 % of the shift in two days."""
    place = site("Madrid DSS-63")
    given = replace(find_elements(verification_elements(), "28057"), eccentricity=0.002,
                    inclination_rad=np.radians(inclination_deg))  # fmt: skip
    changed = replace(given, mean_anomaly_rad=given.mean_anomaly_rad + 4e-5, eccentricity=0.00203,
                      inclination_rad=given.inclination_rad + 4e-5,
                      ascending_node_rad=given.ascending_node_rad + 1.2e-5)  # fmt: skip
    tracks = [TopocentricTrack(one, place, refraction=None, light_time="none") for one in (given, changed)]
    parts, shifts = [], []
    for number, one in enumerate(find_passes(tracks[0], given.epoch_t_s, 2.0 * 86400.0, np.radians(15.0))):
        seen, moved = (track.sample(np.arange(one.aos_t_s, one.los_t_s, 5.0)) for track in tracks)
        zero, sigma = 0.0 * seen.t_s, np.full(len(seen.t_s), 1e-5)
        parts.append(Observations(
            station="s", band="X", t_s=seen.t_s, pass_id=zero.astype(int) + number,
            observed_azimuth_rad=seen.azimuth_rad, observed_elevation_rad=seen.elevation_rad,
            true_azimuth_rad=seen.azimuth_rad, true_elevation_rad=seen.elevation_rad,
            azimuth_rate_rad_s=seen.azimuth_rate_rad_s, elevation_rate_rad_s=seen.elevation_rate_rad_s,
            azimuth_acceleration_rad_s2=zero, elevation_acceleration_rad_s2=zero, sigma_azimuth_rad=sigma,
            sigma_elevation_rad=sigma, range_m=seen.range_m, range_rate_m_s=seen.range_rate_m_s,
        ))  # fmt: skip
        shifts.append([wrap_rad(moved.azimuth_rad - seen.azimuth_rad), moved.elevation_rad - seen.elevation_rad])
    data, priors = Observations.concatenate(parts), PassPriors.of_orbit(300.0)
    shared = SharedErrors(sets=dict.fromkeys(range(len(parts)), "one"), latitude_rad=place.latitude_rad, priors=priors)
    turns = Sharing.of(data, shared).turns[data.pass_id]
    cosine = np.cos(data.true_elevation_rad)[:, np.newaxis]
    azimuth, elevation = (np.einsum("nj,njk->nk", own, turns) for own in pass_partials(data, priors.names))
    rows = np.concatenate([azimuth * cosine, elevation])
    right = np.concatenate(shifts, axis=1) * np.stack([cosine[:, 0], 0.0 * cosine[:, 0] + 1.0])
    solved = np.linalg.lstsq(rows * priors.sigma, right.ravel(), rcond=None)[0]
    left = right.ravel() - rows * priors.sigma @ solved
    assert np.linalg.norm(left) < 0.0012 * np.linalg.norm(right)
