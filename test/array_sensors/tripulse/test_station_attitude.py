"""Attitude from the lines of sight of the stations: the fit, its residual, its covariances, and what is refused."""

import dataclasses

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from rf_pointing.array_sensors.attitude.quaternion import (
    multiply,
    quaternion_from_rotation_vector,
    quaternion_to_matrix,
    quaternion_to_rotation_vector,
)
from rf_pointing.array_sensors.attitude.wahba import fit_rotation
from rf_pointing.array_sensors.tripulse.station_attitude import (
    StationAttitudeEstimator,
    StationAttitudeParams,
    StationObservation,
    bisector_rotation,
    direction_covariances,
    directions_from_projections,
    shared_covariance,
)
from rf_pointing.core import random_stream

ROUNDING = 1e-12
SIGMA = 6e-5
REFERENCES = {
    "usingen": np.array([-0.02, -0.11, 0.0]),
    "hartebeesthoek": np.array([0.03, 0.06, 0.0]),
    "kourou": np.array([-0.12, 0.01, 0.0]),
}


def directions(rng: np.random.Generator, count: int) -> np.ndarray:
    t = rng.normal(size=(count, 2, 3))
    return np.asarray(t / np.linalg.norm(t, axis=-1, keepdims=True))


def test_bisector_equals_the_svd_for_two_noisy_stations() -> None:
    rng = random_stream(1, "bisector")
    reference = directions(rng, 500)
    turned = np.einsum("nij,nlj->nli", Rotation.random(500, rng).as_matrix(), reference)
    noisy = turned + 0.1 * rng.normal(size=turned.shape)
    measured = noisy / np.linalg.norm(noisy, axis=-1, keepdims=True)
    svd = fit_rotation(reference, measured).rotation
    gap = np.linalg.norm(bisector_rotation(reference, measured) - svd, axis=(1, 2))
    # Nearly opposite pairs make both ill-conditioned; the rest agree to rounding.
    assert np.median(gap) < ROUNDING
    assert np.max(gap) < 1e-8


@pytest.mark.parametrize(
    ("reference", "message"),
    [
        ([[0.0, 0.0, 1.0], [0.0, 0.0, 1.0]], "collinear"),
        ([[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]], "collinear"),
        ([[0.0, 0.0, 1.0], [0.0, 1.0, 1.0]], "unit length"),
        ([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]], "shape"),
    ],
)
def test_stations_that_do_not_make_a_frame_are_refused(reference: list[list[float]], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        bisector_rotation(reference, np.eye(3)[:2])


def test_directions_have_unit_length_and_their_projections() -> None:
    t = directions_from_projections([[0.3, -0.4], [0.0, 0.0]])
    np.testing.assert_allclose(t, [[0.3, -0.4, np.sqrt(0.75)], [0.0, 0.0, 1.0]])


def test_direction_covariance_follows_monte_carlo() -> None:
    rng, projection = random_stream(1, "direction covariance"), np.array([0.3, -0.4])
    covariance = 1e-8 * np.array([[2.0, 0.5], [0.5, 1.0]])
    draws = rng.multivariate_normal(projection, covariance, size=50_000)
    found = np.cov(directions_from_projections(draws).T)
    np.testing.assert_allclose(direction_covariances(projection, covariance), found, atol=0.03 * 1e-8)


@pytest.mark.parametrize("projection", [[0.8, 0.6], [1.0, 0.5], [np.nan, 0.0]])
def test_projections_without_a_direction_in_front_of_the_array_are_refused(projection: list[float]) -> None:
    with pytest.raises(ValueError, match="projections"):
        directions_from_projections(projection)


def test_a_covariance_that_is_singular_if_but_for_rounding_is_refused() -> None:
    lines = random_stream(2, "singular covariance").normal(size=(50, 2, 1))
    for covariance in (*(lines @ lines.swapaxes(1, 2)), np.zeros((2, 2)), np.array([[1.0, 2.0], [2.0, 1.0]])):
        with pytest.raises(ValueError, match="singular covariance"):
            direction_covariances([0.0, 0.0], covariance)


for _t in REFERENCES.values():
    _t[2] = np.sqrt(1.0 - _t @ _t)


def observations(
    rotation: np.ndarray, t_s: float, rng: np.random.Generator, names: list[str],
    scale: float = 1.0, shared: float = 0.0,
) -> list[StationObservation]:  # fmt: skip
    found, bias = [], shared * rng.normal(size=2)
    for index, name in enumerate(names):
        sigma = SIGMA * scale * (1.0 + index)
        projections = (rotation @ REFERENCES[name])[:2] + bias + sigma * rng.normal(size=2)
        found.append(
            StationObservation(
                t_s=t_s, station=name, projections=projections, covariance=sigma**2 * np.eye(2),
                reference=REFERENCES[name],
            )
        )  # fmt: skip
    return found


def filled(seen: list[StationObservation], **changes: float) -> StationAttitudeEstimator:
    estimator = StationAttitudeEstimator(StationAttitudeParams(**changes))
    for observation in seen:
        estimator.observe(observation)
    return estimator


@pytest.mark.parametrize("shared", [0.0, 6e-4])
@pytest.mark.parametrize("names", [["usingen", "hartebeesthoek"], ["usingen", "hartebeesthoek", "kourou"]])
def test_attitude_is_recovered_with_honest_covariance_in_both_frames(names: list[str], shared: float) -> None:
    rng, trials = random_stream(1, "station attitude"), 400
    scores, array_scores, residuals = [], [], []
    for _ in range(trials):
        truth = quaternion_from_rotation_vector(0.05 * rng.normal(size=3))
        rotation = quaternion_to_matrix(truth).T
        found = filled(observations(rotation, 1.0, rng, names, shared=shared), shared_sigma=shared).estimate(1.0)
        assert found.valid
        residuals.append(found.residual)
        # C_hat = (I + [e]) C about the reference axes, C_hat = C (I + [d]) about the array axes.
        inverse = truth * [-1.0, -1.0, -1.0, 1.0]
        error = quaternion_to_rotation_vector(multiply(found.quaternion, inverse))
        scores.append(error @ np.linalg.solve(found.covariance_rad2, error))
        array_error = quaternion_to_rotation_vector(multiply(inverse, found.quaternion))
        array_scores.append(array_error @ np.linalg.solve(found.covariance_array_rad2, array_error))
    # Mean of 400 chi-square values of three degrees of freedom: 3 +- 0.12.
    assert np.mean(scores) == pytest.approx(3.0, abs=0.45)
    assert np.mean(array_scores) == pytest.approx(3.0, abs=0.45)
    assert np.mean(residuals) == pytest.approx(2 * len(names) - 3, abs=0.45)


def test_a_station_a_lobe_away_is_found_by_the_residual() -> None:
    seen = observations(np.eye(3), 1.0, random_stream(1, "lobe"), ["usingen", "hartebeesthoek"])
    # The first null of a 16 x 16 array of 3 wavelengths lies 1/48 away; the next lobe's alias twice that.
    apart = REFERENCES["usingen"] - REFERENCES["hartebeesthoek"]
    wrong = seen[0].projections + 2.0 / 48.0 * apart[:2] / np.linalg.norm(apart[:2])
    found = filled([dataclasses.replace(seen[0], projections=wrong), seen[1]]).estimate(1.0)
    assert not found.valid
    assert "lobe away" in found.reason
    assert found.residual > 1e4


def test_one_station_alone_is_not_enough_and_the_reason_names_the_others() -> None:
    seen = observations(np.eye(3), 1.0, random_stream(1, "one"), ["usingen", "hartebeesthoek"])
    lost = dataclasses.replace(seen[1], valid=False, reason="lost lock between segments 3 and 4")
    found = filled([seen[0], lost]).estimate(1.0)
    assert not found.valid
    assert "1 of 2 stations usable" in found.reason
    assert "hartebeesthoek: lost lock" in found.reason
    assert filled([]).estimate(1.0).reason.startswith("0 of 0")


def test_sign_of_the_quaternion_continues_through_half_a_turn() -> None:
    rng, estimator, last = random_stream(1, "half turn"), StationAttitudeEstimator(StationAttitudeParams()), None
    for index, yaw_deg in enumerate(np.arange(0.0, 540.0, 9.0)):
        rotation = Rotation.from_euler("z", yaw_deg, degrees=True).as_matrix().T
        for observation in observations(rotation, float(index), rng, ["usingen", "hartebeesthoek"]):
            estimator.observe(observation)
        found = estimator.estimate(float(index))
        assert found.valid
        if last is not None:
            assert found.quaternion @ last > 0.99
        last = found.quaternion


def test_stopped_and_resumed_estimator_gives_identical_output() -> None:
    rng = random_stream(1, "resume")
    first = filled(observations(np.eye(3), 1.0, rng, ["usingen", "hartebeesthoek"]))
    first.estimate(1.0)
    second = StationAttitudeEstimator(first.params)
    second.restore(first.state)
    newer = observations(np.eye(3), 2.0, rng, ["usingen"])[0]
    for estimator in (first, second):
        estimator.observe(newer)
    a, b = first.estimate(2.5), second.estimate(2.5)
    np.testing.assert_array_equal(a.quaternion, b.quaternion)
    np.testing.assert_array_equal(a.covariance_rad2, b.covariance_rad2)


def test_reports_out_of_order_are_refused() -> None:
    rng = random_stream(1, "order")
    estimator = filled(observations(np.eye(3), 2.0, rng, ["usingen"]))
    with pytest.raises(ValueError, match=r"must be > 2\.0"):
        estimator.observe(observations(np.eye(3), 1.0, rng, ["usingen"])[0])


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"projections": np.array([np.nan, 0.0])}, "finite"),
        ({"covariance": np.zeros((2, 2))}, "singular covariance"),
        ({"reference": np.array([0.0, 0.0, 2.0])}, "unit length"),
        ({"t_s": np.inf}, "t_s"),
    ],
)
def test_observations_that_would_poison_the_fit_are_refused(changes: dict[str, object], message: str) -> None:
    good = observations(np.eye(3), 1.0, random_stream(1, "bad"), ["usingen"])[0]
    with pytest.raises(ValueError, match=message):
        dataclasses.replace(good, **changes)


@pytest.mark.parametrize(("age_s", "used"), [(0.0, True), (2.0, True), (2.001, False), (-0.001, False)])
def test_an_observation_is_used_from_its_time_until_it_is_two_seconds_old(age_s: float, used: bool) -> None:
    found = filled(observations(np.eye(3), 10.0, random_stream(3, "age"), ["usingen", "hartebeesthoek"])).estimate(
        10.0 + age_s
    )
    assert found.valid is used
    assert ("age " in found.reason) is not used
    assert found.t_s == (10.0 if used else 10.0 + age_s)


def test_the_residual_is_the_normalised_miss_of_the_projections() -> None:
    seen = observations(np.eye(3), 10.0, random_stream(5, "residual"), list(REFERENCES))
    found = filled(seen).estimate(10.0)
    rotation = quaternion_to_matrix(found.quaternion).T
    misses = [each.projections - (rotation @ each.reference)[:2] for each in seen]
    expected = sum(miss @ np.linalg.inv(each.covariance) @ miss for miss, each in zip(misses, seen, strict=True))
    assert found.residual == pytest.approx(expected, rel=1e-6)
    np.testing.assert_allclose(
        found.covariance_rad2, rotation.T @ found.covariance_array_rad2 @ rotation, rtol=1e-9, atol=1e-20
    )


def test_an_error_that_all_stations_share_turns_the_attitude_by_its_own_slope() -> None:
    """Every projection is moved alike along x, then along y; the fit turns, and the turns are the covariance."""
    projections = np.array([[0.05, -0.12], [-0.2, 0.07], [0.11, 0.3]])
    measured, weights = directions_from_projections(projections), np.array([1.0, 3.0, 0.5])
    reference = Rotation.from_rotvec([0.3, -0.2, 0.9]).apply(measured)
    sigma, step, turns = 6e-4, 1e-6, []
    for e in np.eye(2):
        ends = [
            fit_rotation(reference, directions_from_projections(projections + sign * step * e), weights).rotation
            for sign in (1.0, -1.0)
        ]
        turns.append(Rotation.from_matrix(ends[0] @ ends[1].T).as_rotvec() / (2.0 * step))
    expected = sigma**2 * sum(np.outer(turn, turn) for turn in turns)
    np.testing.assert_allclose(shared_covariance(measured, sigma, weights), expected, rtol=1e-4, atol=1e-12)


def test_pairs_are_as_close_as_they_are_allowed_to_be() -> None:
    pair = np.array([[np.sin(a), 0.0, np.cos(a)] for a in (0.0, 0.01)])
    np.testing.assert_allclose(bisector_rotation(pair, pair, smallest_separation_rad=0.0099), np.eye(3), atol=1e-9)
    for given in ((pair, np.eye(3)[:2]), (np.eye(3)[:2], pair)):
        with pytest.raises(ValueError, match="are collinear: separation 0.0[01]"):
            bisector_rotation(*given, smallest_separation_rad=0.0101)


def test_before_the_first_fit_the_array_is_said_to_stand_in_the_axes_of_the_reference() -> None:
    estimator = filled(observations(np.eye(3), 1.0, random_stream(1, "first"), ["usingen"]))
    found = estimator.estimate(1.0)
    np.testing.assert_array_equal(found.quaternion, [0.0, 0.0, 0.0, 1.0])
    assert (found.residual, found.stations, found.t_s) == (0.0, ("usingen",), 1.0)
    with pytest.raises(ValueError, match="t_s"):
        estimator.estimate(np.nan)


def test_a_residual_is_refused_from_the_chi_square_of_the_false_alarm_on() -> None:
    """Two stations leave one degree of freedom: the square of a normal deviate exceeds 3.8415 in one of twenty."""
    seen = observations(np.eye(3), 1.0, random_stream(1, "limit"), ["usingen", "hartebeesthoek"], scale=1e-6)
    apart = seen[0].reference - seen[1].reference
    along = apart[:2] / np.linalg.norm(apart[:2])
    wide = [dataclasses.replace(each, covariance=SIGMA**2 * np.eye(2)) for each in seen]
    for share, valid in ((0.97, True), (1.03, False)):
        # Both stations share the miss of the angle between them.
        miss = share * np.sqrt(2.0 * 3.8415) * SIGMA
        moved = [dataclasses.replace(wide[0], projections=wide[0].projections + miss * along), wide[1]]
        found = filled(moved, false_alarm=0.05).estimate(1.0)
        assert found.valid is valid
        assert found.residual == pytest.approx(share**2 * 3.8415, rel=0.02)
        assert ("lobe away" in found.reason) is not valid


def test_stations_are_told_apart_from_the_least_separation_on() -> None:
    seen = observations(np.eye(3), 1.0, random_stream(1, "apart"), ["usingen", "hartebeesthoek"])
    angle = np.arccos(seen[0].reference @ seen[1].reference)
    assert filled(seen, separation_min_rad=0.999 * angle).estimate(1.0).valid
    found = filled(seen, separation_min_rad=1.001 * angle).estimate(1.0)
    assert found.reason.startswith("stations are collinear: 0.17")


def test_a_direction_is_taken_down_to_a_thousandth_above_the_plane_of_the_array() -> None:
    for height, refused in ((1.02e-3, False), (0.98e-3, True)):
        place = np.sqrt(1.0 - height**2) * np.array([0.6, -0.8])
        if refused:
            with pytest.raises(ValueError, match=r"leave T_z below 0\.001"):
                directions_from_projections(place)
        else:
            np.testing.assert_allclose(directions_from_projections(place)[2], height, rtol=1e-6)
