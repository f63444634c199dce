"""The stepped filter: verdict with reasons, refusals that change nothing, resume, and a start by Wahba's problem."""

from dataclasses import replace

import numpy as np
import pytest

from rf_pointing.array_sensors.attitude.multiplicative_filter import GateParams, ProcessNoiseParams
from rf_pointing.array_sensors.attitude.quaternion import (
    quaternion_from_rotation_vector,
    quaternion_to_matrix,
    rotation_angle_between_rad,
)
from rf_pointing.array_sensors.attitude.rigid_body import KnownTorque, SatelliteParams
from rf_pointing.array_sensors.doa.attitude_filter import DoaAttitudeFilter, DoaAttitudeParams, StationDirection
from rf_pointing.array_sensors.doa.attitude_start import StartParams
from rf_pointing.array_sensors.doa.innovation_watch import WatchParams

ORBIT_RATE = np.array([0.0, -1.038e-3, 0.0])
NONE = KnownTorque(control_n_m=np.zeros(3), wheel_momentum_n_m_s=np.zeros(3), wheel_momentum_rate_n_m=np.zeros(3))
TRUTH = quaternion_from_rotation_vector([0.3, -0.5, 0.2])
SIGMA = 0.004


def doa_filter(**changes: float) -> DoaAttitudeFilter:
    return DoaAttitudeFilter(
        SatelliteParams(),
        DoaAttitudeParams(**changes),
        StartParams(),
        ProcessNoiseParams(),
        GateParams(),
        WatchParams(),
        t_s=0.0,
        quaternion=np.array([0.0, 0.0, 0.0, 1.0]),
        rate_rad_s=quaternion_to_matrix(TRUTH).T @ ORBIT_RATE,
    )


def direction(station: str, reference: list[float], sigma: float = SIGMA) -> StationDirection:
    towards = np.array(reference) / np.linalg.norm(reference)
    measured = quaternion_to_matrix(TRUTH).T @ towards
    covariance = sigma**2 * (np.eye(3) - np.outer(measured, measured))
    return StationDirection(station=station, measured=measured, covariance_rad2=covariance, reference=towards)


AHEAD, ASIDE = direction("ahead", [0.7, 0.1, 0.7]), direction("aside", [-0.2, 0.8, 0.6])


def test_two_directions_start_the_filter_at_the_truth_without_convergence() -> None:
    running = doa_filter()
    running.start_from_directions([AHEAD, ASIDE], np.zeros(3))
    found = running.output()
    assert float(rotation_angle_between_rad(found.quaternion, TRUTH)) < 1e-6
    assert found.valid
    assert np.sqrt(np.diag(found.covariance)[:3]).max() < 3 * SIGMA


def test_one_direction_cannot_start_the_filter() -> None:
    with pytest.raises(ValueError, match="at least 2"):
        doa_filter().start_from_directions([AHEAD], np.zeros(3))


def test_collinear_stations_cannot_start_the_filter() -> None:
    running = doa_filter()
    before = running.state
    with pytest.raises(ValueError, match="collinear"):
        running.start_from_directions([AHEAD, replace(AHEAD, station="same place")], np.zeros(3))
    assert running.state is before


def test_output_says_why_it_is_not_valid() -> None:
    running = doa_filter(silence_s=10.0)
    assert running.output().reason == "no direction accepted yet"
    running.observe(AHEAD)
    assert "1 of 2 stations received" in running.output().reason
    assert "12 hypotheses of the start still open" in running.output().reason
    assert "attitude sigma" in running.output().reason
    running.start_from_directions([AHEAD, ASIDE], ORBIT_RATE)
    assert running.output().valid
    running.predict_to(11.0, NONE, ORBIT_RATE)
    assert "no direction for 11 s" in running.output().reason


def test_one_hypothesis_is_kept_once_a_second_station_has_settled() -> None:
    running = doa_filter()
    running.observe(AHEAD)
    for k in range(1, 40):
        running.predict_to(1.0 * k, NONE, ORBIT_RATE)
        running.observe(ASIDE)
        running.observe(AHEAD)
    found = running.output()
    assert len(running.state.bank.misfit) == 1
    assert found.valid
    assert float(rotation_angle_between_rad(found.quaternion, TRUTH)) < 0.02


def test_directions_that_keep_missing_put_the_attitude_in_doubt() -> None:
    running = doa_filter()
    running.start_from_directions([AHEAD, ASIDE], np.zeros(3))
    for _ in range(200):
        running.observe(AHEAD)
        running.observe(ASIDE)
    turned = replace(AHEAD, measured=ASIDE.measured, covariance_rad2=ASIDE.covariance_rad2)
    assert [running.observe(turned) for _ in range(9)] == [False] * 9
    assert "outside the gate" in running.output().reason


def test_station_that_is_elsewhere_is_named_although_another_cancels_it() -> None:
    running, stream = doa_filter(), np.random.default_rng(8)
    rate = quaternion_to_matrix(TRUTH).T @ ORBIT_RATE
    running.start_from_directions([AHEAD, ASIDE], rate)
    normal = np.cross(AHEAD.reference, ASIDE.reference)
    turns = {"ahead": 0.6 * SIGMA * normal / np.linalg.norm(normal), "aside": np.zeros(3)}
    turns["aside"] = -turns["ahead"]
    for _ in range(150):
        for seen in (AHEAD, ASIDE):
            # Each is off in the plane of both, towards the other: no attitude explains that.
            axis = turns[seen.station] + SIGMA * stream.standard_normal(3)
            turned = quaternion_to_matrix(quaternion_from_rotation_vector(axis)) @ seen.reference
            running.observe(replace(seen, measured=quaternion_to_matrix(TRUTH).T @ turned))
    reason = running.output().reason
    assert "ahead: innovations have a common mean" in reason
    assert "aside: innovations have a common mean" in reason
    assert not reason.startswith("innovations have")


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"measured": np.array([np.nan, 0.0, 1.0])}, "measured"),
        ({"measured": np.array([0.0, 0.0, 1.1])}, "measured"),
        ({"reference": np.array([0.0, 0.0, 0.0])}, "reference"),
        ({"covariance_rad2": -np.eye(3)}, "eigenvalues"),
        ({"covariance_rad2": np.zeros((3, 3))}, "eigenvalues"),
        ({"covariance_rad2": np.full((3, 3), np.inf)}, "covariance_rad2"),
    ],
)
def test_unusable_direction_is_refused_and_changes_nothing(changes: dict[str, np.ndarray], words: str) -> None:
    running = doa_filter()
    before = running.state
    with pytest.raises(ValueError, match=words):
        running.observe(replace(AHEAD, **changes))
    assert running.state is before


@pytest.mark.parametrize(
    ("t_s", "known", "words"),
    [
        (-1.0, NONE, "must be >= the filter's time"),
        (np.nan, NONE, "t_s=nan must be finite"),
        (1.0, replace(NONE, control_n_m=np.array([np.nan, 0.0, 0.0])), "control_n_m"),
    ],
)
def test_unusable_prediction_is_refused_and_changes_nothing(t_s: float, known: KnownTorque, words: str) -> None:
    running = doa_filter()
    before = running.state
    with pytest.raises(ValueError, match=words):
        running.predict_to(t_s, known, ORBIT_RATE)
    assert running.state is before


def test_non_unit_start_is_refused() -> None:
    with pytest.raises(ValueError, match="norm"):
        DoaAttitudeFilter(
            SatelliteParams(),
            DoaAttitudeParams(),
            StartParams(),
            ProcessNoiseParams(),
            GateParams(),
            WatchParams(),
            t_s=0.0,
            quaternion=np.array([0.0, 0.0, 0.0, 2.0]),
            rate_rad_s=np.zeros(3),
        )


def test_attitude_of_half_a_turn_is_handled() -> None:
    running = doa_filter()
    half_turn = quaternion_from_rotation_vector([np.pi, 0.0, 0.0])
    seen = []
    for each in (AHEAD, ASIDE):
        measured = quaternion_to_matrix(half_turn).T @ each.reference
        covariance = SIGMA**2 * (np.eye(3) - np.outer(measured, measured))
        seen.append(replace(each, measured=measured, covariance_rad2=covariance))
    running.start_from_directions(seen, np.zeros(3))
    assert float(rotation_angle_between_rad(running.output().quaternion, half_turn)) < 1e-6


def test_resuming_from_the_state_gives_the_same_output() -> None:
    running = doa_filter()
    running.observe(AHEAD)
    resumed = doa_filter()
    resumed.restore(running.state)
    for each in (running, resumed):
        each.predict_to(0.6, NONE, ORBIT_RATE)
        each.observe(ASIDE)
    assert np.array_equal(running.output().quaternion, resumed.output().quaternion)
    assert np.array_equal(running.output().covariance, resumed.output().covariance)


def test_one_long_prediction_is_made_of_short_steps() -> None:
    once, often = doa_filter(), doa_filter()
    for each in (once, often):
        each.observe(AHEAD)
    once.predict_to(5.0, NONE, ORBIT_RATE)
    for k in range(1, 21):
        often.predict_to(0.25 * k, NONE, ORBIT_RATE)
    assert once.output().quaternion == pytest.approx(often.output().quaternion, abs=1e-12)
    assert once.output().covariance == pytest.approx(often.output().covariance, rel=1e-9)
