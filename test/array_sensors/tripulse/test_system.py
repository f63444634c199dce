"""Measurements of several stations become attitudes epoch by epoch, whatever order they arrive in."""

from dataclasses import replace

import numpy as np
import pytest

from rf_pointing.array_sensors.attitude.ground_stations import GroundNetworkParams
from rf_pointing.array_sensors.attitude.quaternion import conjugate, multiply, quaternion_to_rotation_vector
from rf_pointing.array_sensors.tripulse.array import TripulseArrayParams
from rf_pointing.array_sensors.tripulse.geostationary_scene import GeostationaryParams, SceneMoment, WobbleParams
from rf_pointing.array_sensors.tripulse.receiver import TripulseMeasurement, TripulseReceiver
from rf_pointing.array_sensors.tripulse.signal import TripulseSignalParams
from rf_pointing.array_sensors.tripulse.source import TripulseSourceParams
from rf_pointing.array_sensors.tripulse.station_attitude import StationAttitude, StationAttitudeParams
from rf_pointing.array_sensors.tripulse.system import EpochParams, SimulatedTripulse, TripulseAttitude, attitude_report

START_S = 1_767_225_600.0
ORBIT, STATIONS = GeostationaryParams(), GroundNetworkParams().stations()
ARRAY, SIGNAL = TripulseArrayParams(), TripulseSignalParams()
SIGMAS = 4.5
"""Largest error of 30 normal deviates: exceeded in one of 5000 seeds."""


@pytest.fixture(scope="module")
def epochs() -> list[tuple[SceneMoment, list[TripulseMeasurement]]]:
    link = TripulseSourceParams()
    sender = SimulatedTripulse(ARRAY, SIGNAL, link, ORBIT, WobbleParams(), STATIONS, 3)
    receiver = TripulseReceiver(array=ARRAY, signal=SIGNAL)
    sent = [sender.step(START_S + k) for k in range(10)]
    return [(each.moment, [receiver.measure(frame) for frame in each.frames]) for each in sent]


def solver(wait_s: float = 2.0) -> TripulseAttitude:
    return TripulseAttitude(StationAttitudeParams(), EpochParams(wait_s=wait_s), ORBIT, STATIONS)


def take_all(measurements: list[TripulseMeasurement], wait_s: float = 2.0) -> list[StationAttitude]:
    running = solver(wait_s)
    return [found for each in measurements for found in running.take(each, START_S + 60.0)]


def test_attitudes_follow_the_truth_within_their_covariance(epochs) -> None:
    found = take_all([each for _, measured in epochs for each in measured])
    assert [attitude.valid for attitude in found] == [True] * 10
    for attitude, (moment, _) in zip(found, epochs, strict=True):
        assert attitude.t_s == moment.t_s
        error = quaternion_to_rotation_vector(multiply(attitude.quaternion, conjugate(moment.quaternion)))
        assert np.all(np.abs(error) < SIGMAS * np.sqrt(np.diag(attitude.covariance_rad2)))


def test_a_station_that_lags_by_an_epoch_costs_nothing(epochs) -> None:
    first, second = ([measured[station] for _, measured in epochs] for station in (0, 1))
    lagging = [first[0]]
    for k in range(1, 10):
        lagging += [first[k], second[k - 1]]
    found = take_all([*lagging, second[-1]])
    in_order = take_all([each for _, measured in epochs for each in measured])
    assert [f.t_s for f in found] == [f.t_s for f in in_order]
    for a, b in zip(found, in_order, strict=True):
        assert np.array_equal(a.quaternion, b.quaternion)


def test_a_silent_station_makes_invalid_attitudes_with_their_reason(epochs) -> None:
    found = take_all([measured[0] for _, measured in epochs])
    assert [f.t_s for f in found] == [START_S + k for k in range(7)]
    assert not any(f.valid for f in found)
    assert all("1 of 1 stations usable, must be at least 2" in f.reason for f in found)


def test_a_complete_epoch_closes_the_incomplete_one_before_it(epochs) -> None:
    found = take_all([epochs[0][1][0], *epochs[1][1]], wait_s=100.0)
    assert [(f.t_s - START_S, f.valid) for f in found] == [(0.0, False), (1.0, True)]


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"station": "nowhere"}, "station='nowhere' must be one of usingen, hartebeesthoek"),
        ({"t_s": START_S}, "is late"),
        ({"t_s": START_S + 1e4}, "ahead of the clock"),
        ({"t_s": START_S + 2.0}, "was reported before"),
        ({"covariance": np.zeros((2, 2))}, "singular covariance"),
        ({"projections": np.array([0.8, 0.8])}, "projections"),
    ],
)
def test_unusable_measurement_is_refused_and_the_next_is_used(epochs, changes, words: str) -> None:
    running = solver()
    for each in [*epochs[0][1], *epochs[1][1], epochs[2][1][0]]:
        running.take(each, START_S + 2.0)
    with pytest.raises(ValueError, match=words):
        running.take(replace(epochs[2][1][0], **({"t_s": START_S + 3.0} | changes)), START_S + 2.0)
    (found,) = running.take(epochs[2][1][1], START_S + 2.0)
    assert found.valid


def test_report_has_the_symmetric_covariance_of_the_attitude(epochs) -> None:
    (found,) = take_all(epochs[0][1])
    report = attitude_report(found)
    assert report.valid
    np.testing.assert_allclose(report.covariance_rad2, found.covariance_rad2, rtol=1e-12, atol=1e-20)


def test_frames_of_one_epoch_are_those_within_a_millisecond(epochs) -> None:
    first, second = epochs[0][1]
    for apart_s, together in ((0.9e-3, True), (-0.9e-3, True), (1.5e-3, False), (-1.5e-3, False)):
        running = solver()
        assert running.take(first, START_S + 5.0) == []
        found = running.take(replace(second, t_s=START_S + apart_s), START_S + 5.0)
        assert bool(found) is together
        if together:
            (attitude,) = found
            assert attitude.valid
            assert attitude.t_s == pytest.approx(START_S + 0.5 * max(apart_s, 0.0) + 0.5 * min(apart_s, 0.0), abs=1e-6)
            # The newest stamp of the epoch is what later ones are measured against.
            newest = START_S + max(apart_s, 0.0)
            with pytest.raises(ValueError, match="is late"):
                running.take(replace(first, t_s=newest + 0.9e-3), START_S + 5.0)
            assert running.take(replace(first, t_s=newest + 1.5e-3), START_S + 5.0) == []


def test_an_epoch_waits_as_long_as_it_may_in_the_time_of_the_frames(epochs) -> None:
    first = epochs[0][1][0]
    running = solver(wait_s=2.0)
    running.take(first, START_S + 60.0)
    assert running.take(replace(first, t_s=START_S + 2.0), START_S + 60.0) == []
    (late,) = running.take(replace(first, t_s=START_S + 2.25), START_S + 60.0)
    assert (late.t_s, late.valid) == (START_S, False)
    closed = running.take(replace(first, t_s=START_S + 9.0), START_S + 60.0)
    assert [each.t_s for each in closed] == [START_S + 2.0, START_S + 2.25]
