"""The simulated satellite over its stations: start, torques, steps, and which stations its array hears."""

from typing import Any

import numpy as np
import pytest

from rf_pointing.array_sensors.attitude.ground_stations import stations_along_track, view_stations
from rf_pointing.array_sensors.attitude.multiplicative_filter import ProcessNoiseParams
from rf_pointing.array_sensors.attitude.orbits import SunSynchronousOrbitParams
from rf_pointing.array_sensors.attitude.quaternion import quaternion_from_roll_pitch_yaw, quaternion_to_matrix
from rf_pointing.array_sensors.attitude.rigid_body import SatelliteParams, rigid_inertia
from rf_pointing.array_sensors.doa.array import CircularArrayParams
from rf_pointing.array_sensors.doa.array_source import ArraySourceParams
from rf_pointing.array_sensors.doa.simulated_doa import DoaScenarioParams, SimulatedDoa
from rf_pointing.array_sensors.doa.simulated_satellite import NadirHoldParams

START_S = 1_767_225_600.0
ORBIT, BODY = SunSynchronousOrbitParams(), SatelliteParams()
STATIONS = stations_along_track(ORBIT, START_S - 600.0, spacing_s=300.0, aside_rad=0.06)
SILENT = ProcessNoiseParams(attitude_rad2_s=0.0, rate_rad2_s3=0.0, torque_n_m=0.0)
LEVEL = {"roll_rad": 0.0, "pitch_rad": 0.0, "yaw_rad": 0.0, "rate_rad_s": 0.0}


def simulated(noise: ProcessNoiseParams = SILENT, seed: int = 5, snapshots: int = 100, **scenario: Any) -> SimulatedDoa:
    receiver, hold = ArraySourceParams(snapshots=snapshots), NadirHoldParams()
    return SimulatedDoa(
        CircularArrayParams(), receiver, ORBIT, STATIONS, BODY, hold, noise, DoaScenarioParams(**scenario), seed
    )


def test_the_satellite_starts_at_the_attitude_and_rate_of_its_scenario() -> None:
    truth = simulated(roll_rad=0.3, pitch_rad=-0.2, yaw_rad=1.1, rate_rad_s=0.004).step(START_S).truth
    expected = quaternion_from_roll_pitch_yaw([0.3, -0.2, 1.1])
    np.testing.assert_allclose(truth.quaternion, expected, atol=1e-12)
    frame_rate = ORBIT.point(START_S).frame_rate_rad_s
    np.testing.assert_allclose(truth.rate_rad_s, quaternion_to_matrix(expected).T @ frame_rate + 0.004, rtol=1e-9)
    assert truth.t_s == START_S


def test_the_torque_that_nobody_knows_acts_beside_the_one_that_is_reported() -> None:
    """A quarter of a second of 1 N m turns each axis by the inverse of the inertia."""
    rates = {}
    for torque_n_m in (0.0, 1e-3):
        satellite = simulated(**LEVEL, unknown_torque_n_m=torque_n_m)
        first = satellite.step(START_S)
        moment = satellite.step(START_S + 0.25)
        rates[torque_n_m] = moment.truth.rate_rad_s
        assert first.torque.t_s == START_S
        # What is reported holds the attitude, whatever else acts.
        np.testing.assert_allclose(
            first.torque.known.control_n_m, simulated(**LEVEL).step(START_S).torque.known.control_n_m
        )
    gained = 0.25 * 1e-3 * rigid_inertia(BODY).inverse @ np.ones(3)
    np.testing.assert_allclose(rates[1e-3] - rates[0.0], gained, rtol=1e-3)


def test_stations_take_turns_or_send_together() -> None:
    alone, shared = simulated(**LEVEL), simulated(**LEVEL, access="together")
    names, both = [], []
    for k in range(6):
        heard, together = alone.step(START_S + k).heard, shared.step(START_S + k).heard
        assert heard is not None
        assert together is not None
        names.append(heard.transmitters)
        both.append(together.transmitters)
        assert heard.block.t_s == together.block.t_s == START_S + k
    first, second = both[0]
    assert both == [(first, second)] * 6
    assert names == [(first,), (second,)] * 3


@pytest.mark.parametrize("limit", ["elevation_min_rad", "boresight_cosine_min"])
def test_a_station_is_heard_from_its_limit_on(limit: str) -> None:
    view = view_stations(ORBIT, STATIONS, START_S)
    turned = view.reference @ quaternion_to_matrix(quaternion_from_roll_pitch_yaw([0.0, 0.0, 0.0]))
    up = np.flatnonzero(view.elevation_rad > 0.0)
    values = view.elevation_rad[up] if limit == "elevation_min_rad" else turned[up, 2]
    open_limits = {"elevation_min_rad": 0.0, "boresight_cosine_min": 1e-3}
    for value in values:
        for margin, count in ((-1e-6, np.sum(values >= value)), (1e-6, np.sum(values > value))):
            scenario = {**LEVEL, **open_limits, "access": "together", limit: float(value) + margin}
            heard = simulated(**scenario).step(START_S).heard
            assert (0 if heard is None else len(heard.transmitters)) == count


def test_each_station_comes_with_the_stated_ratio_to_the_noise_of_an_element() -> None:
    heard = simulated(**LEVEL, snapshots=4000, snr_db=6.0).step(START_S).heard
    assert heard is not None
    assert np.mean(np.abs(heard.block.snapshots) ** 2) == pytest.approx(1.0 + 10.0**0.6, rel=0.03)
