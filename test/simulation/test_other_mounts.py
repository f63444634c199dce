"""Other mounts than azimuth and elevation fly a real pass with their default sensor, in one process."""

import dataclasses
import math

import numpy as np
import pytest

from rf_pointing.api.station import Station
from rf_pointing.api.target import elements
from rf_pointing.core import MDEG, Boresight, Target, angular_distance_rad, gaussian_gain
from rf_pointing.core.kinematics import Kinematics
from rf_pointing.core.mount_types import AZIMUTH_ELEVATION, MOUNTS
from rf_pointing.ephemeris import first_pass_above
from rf_pointing.ephemeris.solar import SolarDirection, SunParams
from rf_pointing.ephemeris.source import SourceParams, load_elements
from rf_pointing.simulation import StationSetup, simulate_pass
from rf_pointing.station.antenna.simulated_antenna import SimulatedAntenna
from rf_pointing.station.derive.axes import kinematics_of
from rf_pointing.station.description import read_station, shipped_stations
from rf_pointing.station.description.writing import leaning
from rf_pointing.tracking import TrackPath

DEG = math.pi / 180.0
TYPES = {name: read_station(name).content.mount.type for name in shipped_stations()}
FLOWN = sorted(name for name, kind in TYPES.items() if kind != AZIMUTH_ELEVATION)
ACQUIRED_S = 25.0


def test_there_are_stations_of_every_mount() -> None:
    assert set(TYPES.values()) == set(MOUNTS)


@pytest.mark.parametrize("sensor", ["", "program"])
@pytest.mark.parametrize("name", FLOWN)
def test_it_holds_a_pass_on_the_sky(name: str, sensor: str) -> None:
    """The truth is on the sky: where the beam of its axes points, and where the satellite is.

    A scan takes the offsets of the encoders out, with errors that it sees across and along the upper axis;
    program track alone leaves them.
    """
    station = Station(name)
    epoch_t_s, target = load_elements(SourceParams()).epoch_t_s, elements("CBERS 2")
    track = station.track_of(target)
    window = first_pass_above(track, epoch_t_s, 40.0 * DEG, 30.0 * DEG, 4.0 * 86400.0)
    description = station.leaning(target, window)
    plain = StationSetup(description)
    window = dataclasses.replace(window, los_t_s=window.aos_t_s + (50.0 if sensor else 100.0))
    mount = kinematics_of(plain.station.content)
    first, second = mount.axes_at(window.aos_azimuth_rad, window.aos_elevation_rad)
    start = {
        "antenna.start_azimuth_deg": math.remainder(first, math.tau) / DEG,
        "antenna.start_elevation_deg": second / DEG,
    }
    setup = StationSetup(description, changes={"antenna_servo": start})
    antenna = setup.antenna()
    assert isinstance(antenna, SimulatedAntenna)
    setup.antenna = lambda: antenna  # type: ignore[method-assign]
    seen: list[tuple[Boresight, float]] = []
    look = antenna.hardware.look

    def noted(t_s: float) -> Boresight:
        boresight = look(t_s)
        seen.append((boresight, t_s))
        return boresight

    antenna.hardware.look = noted  # type: ignore[method-assign]
    log = simulate_pass(setup, window, window.aos_t_s - 20.0, sensor)
    assert (antenna.safety.latch.text, log.fault) == ("", "")
    acquired = np.array(log.t_s) > window.aos_t_s + ACQUIRED_S
    wanted = "program_track" if sensor else setup.sensor
    assert set(np.array(log.mode)[acquired].tolist()) == {wanted}
    width_rad = setup.sets("pointing_controller")["machine"].half_power_beamwidth_rad
    offset = np.hypot(*log.errors_rad()[acquired].T)
    assert -10.0 * math.log10(float(np.mean(gaussian_gain(offset, width_rad)))) < 0.2
    last = [each for each, t_s in seen if t_s > window.los_t_s - (20.0 if sensor else 40.0)]
    real = StationSetup(description, changes={"ephemeris_publisher": {"source.along_track_offset_s": 0.05}}).track()
    there = real.sample(np.array([each.t_s for each in last]))
    beam = np.array([(each.azimuth_rad, each.elevation_rad) for each in last])
    across = (there.azimuth_rad - beam[:, 0] + math.pi) % math.tau - math.pi
    centre = np.hypot(np.mean(across * np.cos(beam[:, 1])), np.mean(there.elevation_rad - beam[:, 1]))
    left = math.radians(math.hypot(*setup.station.content.simulation.mount_errors.values()))
    if sensor:
        # The lower axis moves the beam less, the closer to its pole.
        assert 0.3 * left < centre < 1.5 * left
    else:
        assert centre < 0.25 * left


@pytest.mark.parametrize("name", FLOWN)
def test_park_and_stow_look_at_the_sky_and_stow_at_the_zenith(name: str) -> None:
    antenna = StationSetup(leaning(read_station(name), 0.5)).antenna()
    assert isinstance(antenna, SimulatedAntenna)
    antenna.enable()
    assert antenna.stow() == ""
    for k in range(round(120.0 / antenna.params.tick_s)):
        _, boresight = antenna.step(1.15e9 + k * antenna.params.tick_s)
    assert antenna.mode == "stowed"
    assert boresight.elevation_rad == pytest.approx(0.5 * math.pi, abs=0.3 * DEG)


MOUNTED = [Kinematics(type="x_y"), Kinematics(type="x_y", lower_axis="north_south"),
           Kinematics(type="ha_dec", latitude_rad=-0.6)]  # fmt: skip


@pytest.mark.parametrize("mount", MOUNTED)
def test_an_early_target_is_moved_on_the_axes_as_on_the_sky(mount: Kinematics) -> None:
    track = StationSetup("dss13").track()
    t = load_elements(SourceParams()).epoch_t_s + np.arange(0.0, 300.0, 0.5)
    looks = track.sample(t)
    sky = np.column_stack([np.unwrap(looks.azimuth_rad), looks.elevation_rad])
    still = np.zeros_like(sky)
    axes = mount.to_axes(sky, still, still)[0]
    latitude = track.site.latitude_rad
    times = t[100:110]
    on_sky, _ = TrackPath(t, sky, looks.range_m, latitude).moved(times, 0.2)
    on_axes, _ = TrackPath(t, axes, looks.range_m, latitude, mount).moved(times, 0.2)
    turned = [mount.across(*place) @ each for place, each in zip(sky[100:110].tolist(), on_sky, strict=True)]
    np.testing.assert_allclose(on_axes, turned, atol=1e-3 * float(np.max(np.abs(on_sky))))


@pytest.mark.parametrize("mount", MOUNTED)
def test_sun_and_target_are_given_in_the_angles_of_the_axes(mount: Kinematics) -> None:
    t_s = 1.15e9
    plain, other = SolarDirection(SunParams()), SolarDirection(SunParams(), mount)
    assert mount.sky_at(*other.at(t_s)) == pytest.approx(plain.at(t_s), abs=1e-9)
    _, path = other.ahead(t_s, 600.0)
    assert np.max(angular_distance_rad(*mount.skies(path).T, *plain.ahead(t_s, 600.0)[1].T)) < MDEG, (
        "as its docstring claims"
    )
    target = Target(
        t_s=0.0, name="a", azimuth_rad=1.0, elevation_rad=0.8, azimuth_rate_rad_s=0.01, elevation_rate_rad_s=-0.005,
        azimuth_acceleration_rad_s2=1e-4, elevation_acceleration_rad_s2=2e-4, range_m=1e6, range_rate_m_s=0.0,
        refraction_rad=0.0,
    )  # fmt: skip
    seen, step = mount.of_axes(target), 1e-3
    place = [mount.axes_at(1.0 + 0.01 * x + 0.5e-4 * x**2, 0.8 - 0.005 * x + 1e-4 * x**2) for x in (-step, 0.0, step)]
    rates = np.diff(np.unwrap(np.array(place), axis=0), axis=0)
    assert seen.motion[2:4] == pytest.approx(tuple(rates.mean(axis=0) / step), rel=1e-6)
    assert seen.motion[4:] == pytest.approx(tuple(np.diff(rates, axis=0)[0] / step**2), abs=1e-8)
