"""A calibration in the angles of other axes: what is observed, its file, and the fit of the file."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import rf_pointing as rp
from rf_pointing.calibration import BiasModel, Observations, RawTracking, read_model, write_observations, write_tdm
from rf_pointing.calibration.terms import names_of
from rf_pointing.core import MDEG, JointReading, PointingError, random_stream, wrap_rad
from rf_pointing.ephemeris import TopocentricTrack
from rf_pointing.station.campaign.log import CalibrationLog
from rf_pointing.station.campaign.plan import ArcRules, beacons, candidate_arcs
from rf_pointing.station.campaign.recorded_input import read_raw

START_S = 1_780_000_000.0
NOISE_RAD = 2.0 * MDEG


@pytest.fixture(params=["xy_7m3", "polar_3m"])
def station(request: pytest.FixtureRequest) -> rp.Station:
    return rp.Station(request.param)


@pytest.fixture
def planted(station: rp.Station) -> BiasModel:
    """A mount that is off by some hundredths of a degree and lags by tenths of a second."""
    mount, random = station.controller.kinematics, random_stream(3, "planted")
    terms = BiasModel.zero(mount).terms
    sizes = {"rad": 50.0 * MDEG, "s": 0.2, "s^2": 0.1}
    return BiasModel({term.name: sizes[term.unit] * random.standard_normal() for term in terms}, mount)


def observed(station: rp.Station, planted: BiasModel) -> Observations:
    """Return points of pieces of passes all over the sky, with noise."""
    mount, random = station.controller.kinematics, random_stream(4, "noise")
    rules = ArcRules(spacing_s=10.0, sigma_rad=NOISE_RAD)
    found, _ = candidate_arcs(beacons(START_S)[::6], station.site, START_S, 1500.0, rules, mount)
    # Near a keyhole of the mount nothing is calibrated.
    kept = [each for each in found if np.max(np.abs(each.track.elevation_rad)) < math.radians(80.0)]
    points = Observations.concatenate(
        [each.observations(station.name, station.band, number) for number, each in enumerate(kept)]
    )
    first, second = planted.apply(*points.motion())
    across = NOISE_RAD / np.cos(points.true_elevation_rad)
    noise = random.standard_normal((2, len(points)))
    return replace(
        points, observed_azimuth_rad=first + across * noise[0], observed_elevation_rad=second + NOISE_RAD * noise[1],
        sigma_azimuth_rad=across, range_m=None, range_rate_m_s=None,
    )  # fmt: skip


def test_the_planted_mount_is_that_of_a_fit_of_its_file(
    station: rp.Station, planted: BiasModel, tmp_path: Path
) -> None:
    points = observed(station, planted)
    write_observations(tmp_path / "points.csv", points)
    found = rp.fit(tmp_path / "points.csv", station)
    assert found.result.names == names_of(station.controller.kinematics.type)
    pull = (found.result.values - list(planted.coefficients.values())) / found.result.sigma
    assert np.max(np.abs(pull)) < 4.0
    assert 0.3 < float(np.sqrt(np.mean(pull**2))) < 1.7
    found.write(tmp_path / "model.yaml")
    back = read_model(tmp_path / "model.yaml").model
    assert back.mount is not None
    assert back.mount.same_axes(station.controller.kinematics)
    assert dict(back.coefficients) == pytest.approx(dict(found.model.coefficients), rel=1e-12)
    other = rp.Station("polar_3m" if station.name.startswith("XY") else "xy_7m3")
    with pytest.raises(ValueError, match="unknown column 'observed_"):
        rp.fit(tmp_path / "points.csv", other)
    with pytest.raises(ValueError, match="is of a mount of type .*, must be of one of type"):
        _ = rp.Station(other.description, model=tmp_path / "model.yaml").model


def test_a_message_has_the_angles_of_the_mount_or_of_the_sky_and_is_read_in_those_of_the_axes(
    station: rp.Station, planted: BiasModel, tmp_path: Path
) -> None:
    mount, points = station.controller.kinematics, observed(station, planted)
    one = points.select(points.pass_id == points.pass_id[0])
    place = {"azimuth_rad": one.observed_azimuth_rad, "elevation_rad": one.observed_elevation_rad, "t_s": one.t_s}
    known = {"range_m": None, "range_rate_m_s": None, "good": one.t_s > 0.0, "target": "bird"}
    raw = RawTracking(station=station.name, band=station.band, **place, **known)
    write_tdm(tmp_path / "a.tdm", [raw], originator="test", created_t_s=START_S, mount=mount)
    assert f"ANGLE_TYPE = {'XSYE' if mount.type == 'x_y' else 'AZEL'}" in (tmp_path / "a.tdm").read_text()
    (back,) = read_raw(tmp_path / "a.tdm", station.band, mount)
    assert np.max(np.abs(wrap_rad(back.azimuth_rad - raw.azimuth_rad))) < 1e-9
    np.testing.assert_allclose(back.elevation_rad, raw.elevation_rad, atol=1e-10)


def test_what_is_observed_in_a_pass_is_what_the_model_says_of_the_axes(station: rp.Station, planted: BiasModel) -> None:
    mount = station.controller.kinematics
    track = TopocentricTrack(beacons(START_S)[100], station.site)
    log = CalibrationLog(station.name, station.band, 1.0, NOISE_RAD, mount=mount)
    times = START_S + np.arange(0.0, 60.0, 0.5)
    targets = [track.target_at(t_s) for t_s in times.tolist()]
    for target in targets[:4]:
        log.take_target(target)
    for target, later in zip(targets, targets[4:], strict=False):
        log.take_target(later)
        own = mount.of_axes(target)
        axes = np.array([float(each) for each in planted.apply(*own.motion)])
        log.take_joints(JointReading(t_s=target.t_s, position_rad=axes, velocity_rad_s=np.array(own.motion[2:4])))
        log.take_error(PointingError(t_s=target.t_s, sensor="monopulse", cross_elevation_rad=0.0, elevation_rad=0.0,
                                     carrier_to_noise_db_hz=60.0, valid=True))  # fmt: skip
    points = log.observations()
    assert len(points) > 20
    found = np.stack([points.residual_azimuth_rad, points.residual_elevation_rad])
    np.testing.assert_allclose(found, np.stack(planted.apply(*points.motion())) - points.motion()[:2], atol=1e-9)
