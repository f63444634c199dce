"""Matching of directions to stations.

Snapshots and known torques become attitude and rate; what does not fit together is refused with its reason.
"""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from rf_pointing.array_sensors.attitude.ground_stations import GroundStation, stations_along_track
from rf_pointing.array_sensors.attitude.multiplicative_filter import GateParams, ProcessNoiseParams
from rf_pointing.array_sensors.attitude.orbits import SunSynchronousOrbitParams
from rf_pointing.array_sensors.attitude.quaternion import (
    conjugate,
    multiply,
    quaternion_to_rotation_vector,
    rotation_angle_between_rad,
)
from rf_pointing.array_sensors.attitude.rigid_body import KnownTorque, SatelliteParams
from rf_pointing.array_sensors.doa.array import ArrayResponse, CircularArrayParams
from rf_pointing.array_sensors.doa.array_source import ArraySource, ArraySourceParams, SnapshotBlock
from rf_pointing.array_sensors.doa.attitude_chain import (
    ChannelBlock,
    DoaAttitude,
    DoaAttitudeReport,
    DoaChainParams,
    HeldTorque,
    match_directions,
)
from rf_pointing.array_sensors.doa.attitude_filter import DoaAttitudeParams
from rf_pointing.array_sensors.doa.attitude_start import StartParams
from rf_pointing.array_sensors.doa.estimator import DoaEstimatorParams
from rf_pointing.array_sensors.doa.innovation_watch import WatchParams
from rf_pointing.array_sensors.doa.simulated_doa import DoaMoment, DoaScenarioParams, SimulatedDoa
from rf_pointing.array_sensors.doa.simulated_satellite import NadirHoldParams

START_S = 1_767_225_600.0
ARRAY, ORBIT = CircularArrayParams(), SunSynchronousOrbitParams()
STATIONS = stations_along_track(ORBIT, START_S - 600.0, spacing_s=300.0, aside_rad=0.06)
NO_TORQUE = KnownTorque(control_n_m=np.zeros(3), wheel_momentum_n_m_s=np.zeros(3), wheel_momentum_rate_n_m=np.zeros(3))
SIGMAS = 4.5


@pytest.fixture
def expected() -> np.ndarray:
    v = np.random.default_rng(2).standard_normal((4, 3))
    return v / np.linalg.norm(v, axis=1, keepdims=True)


def test_shuffled_directions_find_their_stations(expected: np.ndarray) -> None:
    order = [2, 0, 3, 1]
    noisy = expected[order] + 0.01
    noisy /= np.linalg.norm(noisy, axis=1, keepdims=True)
    assert sorted(match_directions(noisy, expected, 0.2)) == [(i, j) for i, j in enumerate(order)]


def test_direction_without_a_station_in_reach_stays_unmatched(expected: np.ndarray) -> None:
    stray = np.concatenate([expected[:2], -expected[2:3]])
    assert sorted(match_directions(stray, expected[:2], 0.1)) == [(0, 0), (1, 1)]


def test_total_angle_decides_where_the_nearest_would_collide() -> None:
    def at(angle: float) -> list[float]:
        return [np.cos(angle), np.sin(angle), 0.0]

    measured, expected = np.array([at(0.0), at(0.10)]), np.array([at(0.06), at(0.20)])
    assert match_directions(measured, expected, 0.5) == [(0, 0), (1, 1)]


def simulated(
    stations: list[GroundStation] = STATIONS, response: ArrayResponse | None = None, **scenario: Any
) -> SimulatedDoa:
    return SimulatedDoa(
        ARRAY, ArraySourceParams(), ORBIT, stations, SatelliteParams(), NadirHoldParams(),
        ProcessNoiseParams(), DoaScenarioParams(**scenario), 5, response=response,
    )  # fmt: skip


def chain(
    stations: list[GroundStation] = STATIONS, estimator: DoaEstimatorParams | None = None,
    noise: ProcessNoiseParams | None = None, response: ArrayResponse | None = None, **params: Any,
) -> DoaAttitude:  # fmt: skip
    noise = noise or ProcessNoiseParams()
    filtering = (DoaAttitudeParams(), StartParams(settle_s=10.0), noise, GateParams(), WatchParams())
    return DoaAttitude(
        ARRAY, estimator or DoaEstimatorParams(), ORBIT, stations, SatelliteParams(), filtering,
        DoaChainParams(**params), response=response,
    )  # fmt: skip


def moments(seconds: int, **scenario: Any) -> list[DoaMoment]:
    satellite = simulated(**scenario)
    return [satellite.step(START_S + k) for k in range(seconds)]


def run(running: DoaAttitude, lived: list[DoaMoment]) -> list[DoaAttitudeReport]:
    found = []
    for moment in lived:
        running.take_torque(moment.torque, moment.truth.t_s)
        found.append(running.take_block(moment.heard, moment.truth.t_s))
    return found


@pytest.fixture(scope="module")
def lived() -> list[DoaMoment]:
    return moments(60)


def require_true(found: list[DoaAttitudeReport], lived: list[DoaMoment]) -> None:
    """Every valid report agrees with the truth within its covariance."""
    for report, moment in zip(found, lived, strict=True):
        if report.attitude.valid:
            turn = turn_between(moment, report)
            assert np.all(np.abs(turn) < SIGMAS * np.sqrt(np.diag(report.attitude.covariance_rad2)))
            drift = moment.truth.rate_rad_s - report.rate.rate_rad_s
            assert np.all(np.abs(drift) < SIGMAS * np.sqrt(np.diag(report.rate.covariance_rad2_s2)))


def turn_between(moment: DoaMoment, report: DoaAttitudeReport) -> np.ndarray:
    return quaternion_to_rotation_vector(multiply(moment.truth.quaternion, conjugate(report.attitude.quaternion)))


def test_attitude_and_rate_agree_with_the_truth_from_any_start() -> None:
    lived = moments(60)
    assert {len(moment.heard.transmitters) for moment in lived} == {1}
    found = run(chain(), lived)
    assert all(report.attitude.valid for report in found[20:])
    require_true(found, lived)


# Roll, pitch and yaw in degrees; with the first the swapped pairing fits better for 44 s.
@pytest.mark.parametrize("start_deg", [(15, -10, 40), (-30, 10, 170)])
def test_stations_of_one_channel_are_told_apart_by_their_motion(start_deg: tuple[float, float, float]) -> None:
    roll, pitch, yaw = np.radians(start_deg)
    lived = moments(100, access="together", roll_rad=roll, pitch_rad=pitch, yaw_rad=yaw)
    assert {len(moment.heard.transmitters) for moment in lived} == {2}
    found = run(chain(), lived)
    assert found[-1].attitude.valid
    require_true(found, lived)


def test_swapped_pairing_is_open_until_the_data_rule_it_out() -> None:
    lived = moments(60, access="together")
    found = run(chain(), lived)
    swapped = [k for k in range(10, 60) if np.linalg.norm(turn_between(lived[k], found[k])) > 1.0]
    assert len(swapped) > 10
    assert all("hypotheses of the start still open" in found[k].attitude.reason for k in swapped)


@pytest.mark.parametrize(("apart_deg", "count"), [(0.01, 1), (3.0, 2)])
def test_two_transmitters_on_one_site_count_as_one_station(apart_deg: float, count: int) -> None:
    site = STATIONS[1]
    other = replace(site, name="beside", latitude_rad=site.latitude_rad + np.radians(apart_deg))
    satellite, running = simulated([site, other]), chain([site, other])
    lived = [satellite.step(START_S + k) for k in range(80)]
    assert {moment.heard.transmitters for moment in lived} == {("station_2",), ("beside",)}
    found = run(running, lived)
    assert any(report.attitude.valid for report in found) == (count == 2)
    assert ("1 of 2 stations received" in found[-1].attitude.reason) == (count == 1)
    require_true(found, lived)


def test_torque_that_the_filter_does_not_know_is_found_by_its_innovations() -> None:
    lived = moments(200, unknown_torque_n_m=2e-5)
    found = run(chain(noise=ProcessNoiseParams(torque_n_m=0.0)), lived)
    last = found[-1].attitude
    assert not last.valid
    assert "a torque, a phase or a place is not as known" in last.reason
    # Without the watch it claims 0.1 deg of 0.7 deg at the end, and is valid.
    for moment, report in zip(lived, found, strict=True):
        if report.attitude.valid or report is found[-1]:
            sigma = np.sqrt(np.diag(report.attitude.covariance_rad2))
            assert np.all(np.abs(turn_between(moment, report)) < SIGMAS * sigma)


def test_torque_within_its_stated_sigma_is_estimated_and_the_attitude_stays_valid() -> None:
    lived = moments(200, unknown_torque_n_m=2e-5)
    found = run(chain(), lived)
    assert found[-1].attitude.valid
    for moment, report in zip(lived[40:], found[40:], strict=True):
        sigma = np.sqrt(np.diag(report.attitude.covariance_rad2))
        assert np.all(np.abs(turn_between(moment, report)) < SIGMAS * sigma)


def test_phases_known_to_ten_degrees_are_in_the_covariance() -> None:
    scores = []
    for seed in range(4):
        phases = np.radians(10.0) * np.random.default_rng(seed).standard_normal(12)
        response = ArrayResponse(gain=np.exp(1j * phases), coupling=np.zeros(6, complex))
        satellite = simulated(response=response)
        lived = [satellite.step(START_S + k) for k in range(70)]
        found = run(chain(estimator=DoaEstimatorParams(phase_sigma_rad=np.radians(10.0))), lived)
        for moment, report in zip(lived[40:], found[40:], strict=True):
            turn = turn_between(moment, report)
            scores.append(turn @ np.linalg.solve(report.attitude.covariance_rad2, turn))
    # Four arrays of three components; without the phases in the filter it is 165.
    assert np.mean(scores) < 9.0


def farthest_sigmas(found: list[DoaAttitudeReport], lived: list[DoaMoment]) -> float:
    """Return the largest error of any axis of the valid attitudes, in claimed sigmas."""
    valid = [(m, r) for m, r in zip(lived, found, strict=True) if r.attitude.valid]
    assert valid
    ratios = [turn_between(m, r) / np.sqrt(np.diag(r.attitude.covariance_rad2)) for m, r in valid]
    return float(np.max(np.abs(ratios)))


def test_clock_within_its_stated_sigma_is_in_the_covariance(lived: list[DoaMoment]) -> None:
    ahead_s, sizes = 4.0, []
    for sigma_s in (0.0, ahead_s):
        running, found = chain(time_sigma_s=sigma_s), []
        for moment in lived:
            stamp_s = moment.truth.t_s + ahead_s
            assert moment.heard is not None
            running.take_torque(replace(moment.torque, t_s=stamp_s), stamp_s)
            block = replace(moment.heard.block, t_s=stamp_s)
            found.append(running.take_block(replace(moment.heard, block=block), stamp_s))
        sizes.append(farthest_sigmas(found, lived))
    assert sizes[0] > 1.5 * SIGMAS
    assert sizes[1] < SIGMAS


def test_place_of_a_station_within_its_stated_sigma_is_in_the_covariance(lived: list[DoaMoment]) -> None:
    by_m, moved = 40e3, list(STATIONS)
    moved[2] = replace(moved[2], longitude_rad=moved[2].longitude_rad + by_m / 6371e3 / np.cos(moved[2].latitude_rad))
    sizes = [farthest_sigmas(run(chain(moved, place_sigma_m=sigma_m), lived), lived) for sigma_m in (0.0, by_m)]
    assert sizes[0] > 2.0 * SIGMAS
    assert sizes[1] < SIGMAS


@pytest.mark.parametrize("access", ["in_turn", "together"])
def test_unknown_coupling_of_the_elements_is_found_and_a_calibrated_one_is_not(access: str) -> None:
    coupling = np.array([0.18j, 0.09, 0.0, 0.0, 0.0, 0.0])
    response = ArrayResponse(gain=np.ones(12, complex), coupling=coupling)
    satellite = simulated(response=response, access=access)
    seen = [satellite.step(START_S + k) for k in range(20)]
    found = run(chain(), seen)
    assert "off their known response" in found[-1].attitude.reason
    known = run(chain(response=response), seen)
    assert not any("known response" in report.attitude.reason for report in known)


def test_stations_that_have_one_maximum_between_them_move_nothing() -> None:
    running, names = chain(), (STATIONS[0].name, STATIONS[1].name)
    source = ArraySource(ARRAY, ArraySourceParams(), seed=3)
    for k, apart in enumerate((0.13, 0.13, 0.3)):
        towards = np.array([[x, 0.2, np.sqrt(0.96 - x**2)] for x in (0.3, 0.3 + apart)])
        block = source.step(START_S + k, towards, np.zeros(2))
        running.take_torque(HeldTorque(t_s=START_S + k, known=NO_TORQUE), START_S + k)
        found = running.take_block(ChannelBlock(transmitters=names, block=block), START_S + k)
        merged = any("have one between them" in each for each in found.refused)
        assert merged == (apart < 0.2)
        assert ("no direction accepted yet" in found.attitude.reason) == (apart < 0.2)


def test_coasting_carries_the_attitude_on_by_the_known_torques(lived: list[DoaMoment]) -> None:
    running = chain()
    assert running.coast(START_S) is None
    run(running, lived[:40])
    for moment in lived[40:44]:
        running.take_torque(moment.torque, moment.truth.t_s)
    report = running.coast(START_S + 43.0)
    assert report is not None
    assert report.attitude.valid
    turn = turn_between(lived[43], report)
    assert np.all(np.abs(turn) < SIGMAS * np.sqrt(np.diag(report.attitude.covariance_rad2)))


def test_a_filter_without_a_torque_stops_with_a_reason(lived: list[DoaMoment]) -> None:
    unaware = chain()
    unaware.take_block(lived[0].heard, START_S)
    with pytest.raises(ValueError, match="no torque is known"):
        unaware.take_block(lived[1].heard, START_S + 1.0)


def test_filter_that_every_direction_contradicts_starts_anew_and_finds_the_truth(lived: list[DoaMoment]) -> None:
    running = chain()
    assert run(running, lived[:30])[-1].attitude.valid
    elsewhere = moments(75, roll_rad=-0.5, yaw_rad=-2.4)[30:]
    found = run(running, elsewhere)
    assert "no direction inside the gate" in found[0].refused[0]
    assert not any(report.attitude.valid for report in found[8:26])
    assert "attitude in doubt" in found[8].attitude.reason
    assert found[-1].attitude.valid
    turn = turn_between(elsewhere[-1], found[-1])
    assert np.all(np.abs(turn) < SIGMAS * np.sqrt(np.diag(found[-1].attitude.covariance_rad2)))


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"transmitters": ("nobody",)}, "transmitters="),
        ({"transmitters": ()}, "at least one"),
        ({"transmitters": ("station_2", "station_2")}, "different"),
        ({"block": SnapshotBlock(t_s=START_S + 20.0, snapshots=np.ones((5, 100), complex))}, "5 elements, must be 12"),
        ({"block": SnapshotBlock(t_s=START_S + 20.0, snapshots=np.ones((12, 1), complex))}, "snapshots=1 must be > "),
        ({"block": SnapshotBlock(t_s=START_S + 1e4, snapshots=np.ones((12, 100), complex))}, "ahead of the clock"),
    ],
)
def test_unusable_block_is_refused_and_the_next_is_used(lived: list[DoaMoment], changes: Any, words: str) -> None:
    running = chain()
    run(running, lived[:20])
    running.take_torque(lived[20].torque, START_S + 20.0)
    with pytest.raises(ValueError, match=words):
        running.take_block(replace(lived[20].heard, **changes), START_S + 20.0)
    assert running.take_block(lived[20].heard, START_S + 20.0).attitude.valid


def test_a_late_block_and_a_late_torque_are_refused(lived: list[DoaMoment]) -> None:
    running = chain()
    run(running, lived[:20])
    with pytest.raises(ValueError, match="is late"):
        running.take_block(lived[10].heard, START_S + 20.0)
    with pytest.raises(ValueError, match="must be > the last one"):
        running.take_torque(lived[10].torque, START_S + 20.0)


def test_weak_signals_are_named_and_change_nothing(lived: list[DoaMoment]) -> None:
    running = chain()
    before = run(running, lived[:20])[-1]
    noise = np.random.Generator(np.random.PCG64(1)).normal(size=(12, 100, 2)) @ [1.0, 1j]
    block = SnapshotBlock(t_s=lived[19].truth.t_s, snapshots=noise)
    report = running.take_block(ChannelBlock(transmitters=("station_2",), block=block), START_S + 19.0)
    assert "station_2: effective_snr" in report.refused[0]
    assert np.array_equal(report.attitude.quaternion, before.attitude.quaternion)


def test_stations_where_none_is_expected_are_refused_in_a_shared_channel() -> None:
    lived = moments(81, access="together")
    running = chain()
    before = run(running, lived[:80])[-1]
    assert before.attitude.valid
    running.take_torque(lived[80].torque, lived[80].truth.t_s)
    strangers = replace(lived[80].heard, transmitters=("station_5", "station_6"))
    report = running.take_block(strangers, lived[80].truth.t_s)
    assert report.refused == ("station_5: no direction inside the gate", "station_6: no direction inside the gate")
    carried = rotation_angle_between_rad(before.attitude.quaternion, report.attitude.quaternion)
    assert float(carried) < 0.02


def test_stations_below_their_horizon_or_behind_the_array_are_not_heard() -> None:
    far = [GroundStation(name="antipode", latitude_rad=0.9, longitude_rad=2.0)]
    assert simulated(far).step(START_S).heard is None
    assert simulated(roll_rad=3.0, pitch_rad=0.0, yaw_rad=0.0).step(START_S).heard is None


def test_simulation_refuses_time_that_does_not_advance() -> None:
    satellite = simulated()
    satellite.step(START_S)
    with pytest.raises(ValueError, match="must be > the last step's"):
        satellite.step(START_S)


def test_angles_are_those_between_the_vectors_up_to_the_reach() -> None:
    def at(angle: float) -> list[float]:
        return [np.cos(angle), np.sin(angle), 0.0]

    for apart in (1e-9, 0.3, 3.0):
        near, far = np.array([at(0.0)]), np.array([at(apart)])
        assert match_directions(near, far, 1.001 * apart) == [(0, 0)]
        assert match_directions(near, far, 0.999 * apart) == []
    for reach, words in ((-0.1, "largest_rad=-0.1 must be >= 0"), (3.2, "largest_rad=3.2 must be <= 3.14")):
        with pytest.raises(ValueError, match=words):
            match_directions(near, far, reach)
    with pytest.raises(ValueError, match="measured has shape"):
        match_directions(near[0], far, 0.1)
    with pytest.raises(ValueError, match="expected has shape"):
        match_directions(near, far[0], 0.1)


@pytest.mark.parametrize(("late_s", "goes_on"), [(5.0, True), (5.01, False)])
def test_a_torque_carries_the_filter_on_for_its_largest_age(
    lived: list[DoaMoment], late_s: float, goes_on: bool
) -> None:
    running = chain()
    running.take_torque(lived[0].torque, START_S)
    running.take_block(lived[0].heard, START_S)
    if goes_on:
        report = running.coast(START_S + late_s)
        assert report is not None
        assert report.attitude.t_s == running.time_s == START_S + late_s
        assert running.coast(START_S + late_s) is None
    else:
        with pytest.raises(ValueError, match=r"is 5\.01 s old, must be <= 5\.0 s"):
            running.coast(START_S + late_s)


@pytest.mark.parametrize(("gap_s", "anew"), [(7.0, False), (8.0, True)])
def test_a_gap_of_the_largest_length_is_bridged_and_a_longer_one_starts_anew(
    lived: list[DoaMoment], gap_s: float, anew: bool
) -> None:
    running = chain(gap_max_s=7.0)
    run(running, lived[:25])
    last = 24 + int(gap_s)
    for moment in lived[25 : last + 1]:
        running.take_torque(moment.torque, moment.truth.t_s)
    report = running.take_block(lived[last].heard, START_S + last)
    assert ("hypotheses" in report.attitude.reason) is anew


def test_between_two_torques_each_holds_from_its_own_time_on(lived: list[DoaMoment]) -> None:
    """Carried on over five torques at once, and in five steps: the same attitude."""
    at_once, stepped = chain(), chain()
    for running in (at_once, stepped):
        run(running, lived[:25])
    for moment in lived[25:30]:
        at_once.take_torque(moment.torque, START_S + 30.0)
        stepped.take_torque(moment.torque, START_S + 30.0)
        # The torque of this moment holds from it on: before it, that of the moment before.
        stepped.coast(moment.truth.t_s)
    for running in (at_once, stepped):
        running.coast(START_S + 29.5)
    first, second = (running.coast(START_S + 29.75) for running in (at_once, stepped))
    assert first is not None
    assert second is not None
    np.testing.assert_allclose(first.attitude.quaternion, second.attitude.quaternion, atol=1e-9)
    np.testing.assert_allclose(first.rate.rate_rad_s, second.rate.rate_rad_s, atol=1e-9)


def test_elements_and_gains_that_the_array_has_not_are_refused_before_the_first_block() -> None:
    with pytest.raises(ValueError, match="excluded='99' must be numbers from 0 to 11"):
        chain(estimator=DoaEstimatorParams(excluded="99"))
    other = ArrayResponse(gain=np.ones(10, complex), coupling=np.zeros(5, complex))
    with pytest.raises(ValueError, match="response has 10 gains, must be elements=12"):
        chain(response=other)
