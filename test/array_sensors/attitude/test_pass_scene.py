"""The scene of a pass: the satellite's view of a station is the station's view of the satellite, turned round."""

import math

import numpy as np
import pytest

from rf_pointing.array_sensors.attitude.ground_stations import GroundNetworkParams, view_stations
from rf_pointing.array_sensors.attitude.multiplicative_filter import GateParams, ProcessNoiseParams
from rf_pointing.array_sensors.attitude.orbits import SunSynchronousOrbitParams
from rf_pointing.array_sensors.attitude.pass_scene import ElementOrbit, PassSceneParams, pass_scene
from rf_pointing.array_sensors.attitude.quaternion import conjugate, multiply, quaternion_to_rotation_vector
from rf_pointing.array_sensors.attitude.rigid_body import SatelliteParams
from rf_pointing.array_sensors.doa.array import CircularArrayParams
from rf_pointing.array_sensors.doa.array_source import ArraySourceParams
from rf_pointing.array_sensors.doa.attitude_chain import DoaAttitude, DoaChainParams
from rf_pointing.array_sensors.doa.attitude_filter import DoaAttitudeParams
from rf_pointing.array_sensors.doa.attitude_start import StartParams
from rf_pointing.array_sensors.doa.estimator import DoaEstimatorParams
from rf_pointing.array_sensors.doa.innovation_watch import WatchParams
from rf_pointing.array_sensors.doa.simulated_doa import DoaScenarioParams, SimulatedDoa
from rf_pointing.array_sensors.doa.simulated_satellite import NadirHoldParams
from rf_pointing.array_sensors.tripulse.geostationary_scene import GeostationaryParams, WobbleParams, scene_moment
from rf_pointing.core import unit_vector_from_azel
from rf_pointing.ephemeris import TopocentricTrack, find_passes
from rf_pointing.ephemeris.source import SourceParams, load_elements
from rf_pointing.station.description import read_station
from test.ephemeris.test_satellite_antenna import skyfield_directions

STATIONS = ("dss13", "rotator_2m")
SCENE = PassSceneParams(satellite="28057", descriptions=STATIONS)
CIRCULAR, NETWORK = SunSynchronousOrbitParams(), GroundNetworkParams()
EPOCH_S = load_elements(SourceParams(satellite="28057")).epoch_t_s


def test_directions_ranges_and_elevations_are_those_of_the_track() -> None:
    orbit, stations = pass_scene(SCENE, CIRCULAR, NETWORK)
    t_s = EPOCH_S + np.arange(0.0, 86400.0, 61.0)
    view = view_stations(orbit, stations, t_s)
    assert [each.name for each in stations] == list(STATIONS)
    for k, name in enumerate(STATIONS):
        site = read_station(name).site
        track = TopocentricTrack(load_elements(SourceParams()), site, refraction=None, light_time="none")
        looks = track.sample(t_s)
        np.testing.assert_allclose(view.elevation_rad[:, k], looks.elevation_rad, atol=1e-9)
        np.testing.assert_allclose(view.range_m[:, k], looks.range_m, atol=1e-3)
        # From the station's horizon back into Earth-fixed axes, and round.
        earth = unit_vector_from_azel(looks.azimuth_rad, looks.elevation_rad) @ np.array(site.axes)
        frame = orbit.point(t_s).frame
        np.testing.assert_allclose(view.reference[:, k], -np.einsum("nij,nj->ni", frame, earth), atol=1e-9)
    # Independent of every line of ours: skyfield knows neither the frame nor the site.  UT1 moves it by 1e-5.
    np.testing.assert_allclose(view.reference[:, 0], skyfield_directions("28057", t_s), atol=2e-5)


def test_the_frame_turns_as_it_says() -> None:
    orbit, _ = pass_scene(PassSceneParams(satellite="8195"), CIRCULAR, NETWORK)
    assert isinstance(orbit, ElementOrbit)
    t_s, step_s, earth = load_elements(SourceParams(satellite="8195")).epoch_t_s + 5000.0, 0.5, 7.292115e-5

    def inertial(at_s: float) -> np.ndarray:
        angle = earth * (at_s - t_s)
        turn = np.array([[math.cos(angle), math.sin(angle), 0.0], [-math.sin(angle), math.cos(angle), 0.0], [0, 0, 1]])
        return orbit.point(at_s).frame @ turn

    before, here, after = (inertial(t_s + k * step_s) for k in (-1.0, 0.0, 1.0))
    cross = here @ ((after - before) / (2.0 * step_s)).T
    found = np.array([cross[1, 2], cross[2, 0], cross[0, 1]])
    wanted = orbit.point(t_s).frame_rate_rad_s
    assert np.abs(np.abs(found) - np.abs(wanted)).max() < 1e-8
    # -y is the orbit's momentum: 2 pi in 718 min on average.
    assert wanted[1] < -1e-5


def test_without_a_satellite_the_circular_orbit_stays() -> None:
    orbit, stations = pass_scene(PassSceneParams(), CIRCULAR, NETWORK)
    assert orbit is CIRCULAR
    assert [each.name for each in stations] == list(NETWORK.names)


@pytest.mark.parametrize(
    ("changes", "word"),
    [
        ({"satellite": "Sun"}, "satellite='Sun' is not a satellite"),
        ({"satellite": "99999"}, "99999"),
        ({"descriptions": ("dss13", "dss13")}, "must be different"),
        ({"descriptions": ("nowhere",)}, "nowhere"),
    ],
)
def test_what_is_not_there_is_refused_by_its_name(changes: dict[str, object], word: str) -> None:
    with pytest.raises(ValueError, match=word):
        pass_scene(PassSceneParams(**changes), CIRCULAR, NETWORK)


def test_doa_finds_the_attitude_over_the_stations_of_a_real_pass() -> None:
    """CBERS-2 over two stations of California, which the array tells apart by 20 deg."""
    from rf_pointing.array_sensors.attitude.ground_stations import SurveyedStation
    from rf_pointing.ephemeris import Site

    orbit, (first, _) = pass_scene(SCENE, CIRCULAR, NETWORK)
    north = SurveyedStation(name="north", site=Site.from_degrees(39.0, -112.0, 1500.0))
    stations = [first, north]
    track = TopocentricTrack(load_elements(SourceParams()), first.site)
    window = next(p for p in find_passes(track, EPOCH_S, 3 * 86400.0, math.radians(20.0)) if p.peak_elevation_rad > 0.8)
    array, satellite, noise = CircularArrayParams(), SatelliteParams(), ProcessNoiseParams()
    truth = SimulatedDoa(
        array, ArraySourceParams(), orbit, stations, satellite, NadirHoldParams(), noise, DoaScenarioParams(), 1
    )
    filtering = (DoaAttitudeParams(), StartParams(), noise, GateParams(), WatchParams())
    chain = DoaAttitude(array, DoaEstimatorParams(), orbit, stations, satellite, filtering, DoaChainParams())
    start_s, valid = round(window.aos_t_s), []
    for k in range(180):
        moment = truth.step(start_s + k)
        chain.take_torque(moment.torque, moment.truth.t_s)
        if moment.heard is not None:
            found = chain.take_block(moment.heard, moment.truth.t_s).attitude
            turn = quaternion_to_rotation_vector(multiply(moment.truth.quaternion, conjugate(found.quaternion)))
            if found.valid:
                valid.append(float(turn @ np.linalg.solve(found.covariance_rad2, turn)))
    assert len(valid) > 60
    assert max(valid) < 25.0


def test_tripulse_sees_the_stations_from_a_geostationary_satellite_of_the_elements() -> None:
    orbit, stations = pass_scene(
        PassSceneParams(satellite="24208", descriptions=STATIONS), GeostationaryParams(), NETWORK
    )
    t_s = load_elements(SourceParams(satellite="24208")).epoch_t_s + 1000.0
    moment = scene_moment(orbit, WobbleParams(), stations, t_s)
    for k, name in enumerate(STATIONS):
        track = TopocentricTrack(
            load_elements(SourceParams(satellite="24208")), read_station(name).site, refraction=None, light_time="none"
        )
        look = track.target_at(t_s)
        assert moment.view.range_m[k] == pytest.approx(look.range_m, abs=1e-3)
        assert moment.range_rate_m_s[k] == pytest.approx(look.range_rate_m_s, abs=1e-3)
