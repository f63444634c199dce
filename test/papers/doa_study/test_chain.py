"""The chain a graph runs: satellite, array, estimator, filter, from snapshots to attitude."""

import numpy as np
import pytest

from rf_pointing.array_sensors.attitude.ground_stations import stations_along_track, view_stations
from rf_pointing.array_sensors.attitude.multiplicative_filter import GateParams, ProcessNoiseParams
from rf_pointing.array_sensors.attitude.orbits import SunSynchronousOrbitParams, orbit_point
from rf_pointing.array_sensors.attitude.quaternion import quaternion_to_matrix, rotation_angle_between_rad
from rf_pointing.array_sensors.attitude.rigid_body import SatelliteParams
from rf_pointing.array_sensors.doa.array import CircularArrayParams
from rf_pointing.array_sensors.doa.array_source import ArraySource, ArraySourceParams
from rf_pointing.array_sensors.doa.attitude_chain import match_directions
from rf_pointing.array_sensors.doa.attitude_filter import DoaAttitudeFilter, DoaAttitudeParams, StationDirection
from rf_pointing.array_sensors.doa.attitude_start import StartParams
from rf_pointing.array_sensors.doa.estimator import DoaEstimator, DoaEstimatorParams
from rf_pointing.array_sensors.doa.innovation_watch import WatchParams
from rf_pointing.array_sensors.doa.simulated_satellite import NadirHoldParams, SimulatedSatellite

ORBIT = SunSynchronousOrbitParams()
DT_S = 0.25
SNR_DB = np.array([0.0, 0.0])


def test_two_stations_around_a_hand_off_give_the_attitude_from_snapshots() -> None:
    array, noise, stations = CircularArrayParams(), ProcessNoiseParams(), stations_along_track(ORBIT, 0.0)[:2]
    t_s, upright = 620.0, np.array([0.0, 0.0, 0.0, 1.0])
    rate = orbit_point(ORBIT, t_s).frame_rate_rad_s
    satellite = SimulatedSatellite(
        SatelliteParams(), NadirHoldParams(), noise, t_s=t_s, quaternion=upright, rate_rad_s=rate, seed=1
    )
    source = ArraySource(array, ArraySourceParams(), seed=2)
    estimator = DoaEstimator(array, DoaEstimatorParams(sources=2))
    attitude = DoaAttitudeFilter(
        SatelliteParams(),
        DoaAttitudeParams(),
        StartParams(),
        noise,
        GateParams(),
        WatchParams(),
        t_s=t_s,
        quaternion=upright,
        rate_rad_s=rate,
    )
    for k in range(40):
        if k:
            frame_rate = orbit_point(ORBIT, t_s).frame_rate_rad_s
            known = satellite.hold_torque(frame_rate)
            satellite.step(DT_S, known, frame_rate)
            t_s += DT_S
            attitude.predict_to(t_s, known, frame_rate)
        reference = view_stations(ORBIT, stations, t_s).reference
        truth = quaternion_to_matrix(satellite.state.quaternion).T
        found = estimator.estimate(source.step(t_s, reference @ truth.T, SNR_DB))
        expected = reference @ quaternion_to_matrix(attitude.output().quaternion)
        pairs = match_directions(np.stack([each.direction for each in found]), expected, np.radians(20.0))
        directions = [
            StationDirection(
                station=stations[j].name,
                measured=found[i].direction,
                covariance_rad2=found[i].covariance_rad2,
                reference=reference[j],
            )
            for i, j in pairs
            if found[i].valid
        ]
        if k == 0:
            attitude.start_from_directions(directions, rate)
        else:
            assert all(attitude.observe(each) for each in directions)
    result = attitude.output()
    error = float(rotation_angle_between_rad(result.quaternion, satellite.state.quaternion))
    assert result.valid
    assert result.t_s == pytest.approx(620.0 + 39 * DT_S)
    assert error < 4.0 * np.sqrt(np.trace(result.covariance[:3, :3]))
    assert np.degrees(error) < 0.3
