"""What DOA leaves to future work, measured: consistency, any starting attitude, two sources at once, mutual coupling."""

import numpy as np
from numpy.typing import NDArray

from rf_pointing.array_sensors.arrays.circular_array import CircularArrayParams
from rf_pointing.array_sensors.arrays.coupling_calibration import fit_response
from rf_pointing.array_sensors.arrays.covariance import sample_covariance
from rf_pointing.array_sensors.arrays.cramer_rao import cosine_sigma_rad, direction_bound_rad2
from rf_pointing.array_sensors.arrays.music import estimate_directions
from rf_pointing.array_sensors.arrays.mutual_coupling import ArrayResponse
from rf_pointing.array_sensors.arrays.polar_direction import direction_from_polar, polar_basis
from rf_pointing.array_sensors.arrays.several_sources import estimate_several
from rf_pointing.array_sensors.arrays.snapshots import complex_normal, draw_snapshots
from rf_pointing.array_sensors.attitude.attitude_start import StartParams, best_of_bank, start_bank
from rf_pointing.array_sensors.attitude.consistency import nees
from rf_pointing.array_sensors.attitude.match_directions import match_directions
from rf_pointing.array_sensors.attitude.multiplicative_filter import (
    DirectionObservation,
    GateParams,
    attitude_error,
    predict,
    start_state,
    update,
)
from rf_pointing.array_sensors.attitude.process_noise import ProcessNoiseParams
from rf_pointing.array_sensors.attitude.quaternion import (
    quaternion_from_matrix,
    quaternion_from_rotation_vector,
    quaternion_to_matrix,
    quaternion_to_rotation_vector,
)
from rf_pointing.array_sensors.attitude.rigid_body import KnownTorque, SatelliteParams
from rf_pointing.array_sensors.attitude.simulated_satellite import NadirHoldParams, SimulatedSatellite
from rf_pointing.array_sensors.attitude.wahba import attitude_covariance, fit_rotation
from rf_pointing.core import cosine_slopes, random_stream
from rf_pointing.papers.doa_study.scene import STEP_S, nadir_scene

__all__ = ["any_start_error_deg", "coupling_rmse_deg", "mean_nees", "two_source_attitude_ratio"]

Array = NDArray[np.float64]

ARRAY = CircularArrayParams()
GATE = GateParams()
COUPLING = np.array([0.25 * np.exp(1.1j), 0.12 * np.exp(-2.0j), 0.06 * np.exp(0.4j), 0.04, 0.02j, 0.02])
"""Coupling of -12, -18, -24 dB to the nearest neighbours: that of close quadrifilar helices, in kind."""


def mean_nees(runs: int, seed: int, duration_s: float = 400.0) -> Array:
    """Return the mean NEES of `runs` filters every 10 s over a hand-off, MUSIC's accuracy at 0 dB and 100 snapshots.

    The truth is driven by the filter's own process noise and starts inside the filter's covariance.
    """
    scene = nadir_scene(duration_s, start_s=400.0)
    stream, sigma, noise = random_stream(seed, "doa_nees"), cosine_sigma_rad(ARRAY, 100, 1.0), ProcessNoiseParams()
    upright = np.tile([0.0, 0.0, 0.0, 1.0], (runs, 1))
    satellite = SimulatedSatellite(
        SatelliteParams(),
        NadirHoldParams(),
        noise,
        t_s=0.0,
        quaternion=upright,
        rate_rad_s=np.tile(scene.frame_rate[0], (runs, 1)),
        seed=seed,
    )
    start = quaternion_from_rotation_vector(0.01 * stream.standard_normal((runs, 3)))
    rate = scene.frame_rate[0] + 1e-4 * stream.standard_normal((runs, 3))
    state = start_state(start, rate, 0.01, 1e-4, GATE)
    scores = []
    for k in range(len(scene.t_s)):
        if k:
            frame_rate = scene.frame_rate[k - 1]
            known = satellite.hold_torque(frame_rate)
            satellite.step(STEP_S, known, frame_rate)
            state = predict(scene.inertia, noise, state, known, frame_rate, STEP_S)
        truth = satellite.state
        expected = np.einsum("nji,j->ni", quaternion_to_matrix(truth.quaternion), scene.reference[k])
        state = update(state, _observe(expected, scene.reference[k], sigma, stream), GATE)
        if k % 40 == 39:
            error = attitude_error(state, truth.quaternion, truth.rate_rad_s)
            scores.append(float(np.mean(nees(error, state.covariance))))
    return np.array(scores)


def any_start_error_deg(starts: int, seed: int, settle_s: float = 30.0) -> Array:
    """Return the attitude errors (starts,) `settle_s` after the first hand-off, from uniformly random attitudes."""
    scene = nadir_scene(325.0 + settle_s, start_s=300.0)
    stream, sigma = random_stream(seed, "doa_any_start"), cosine_sigma_rad(ARRAY, 100, 1.0)
    known_none = np.zeros(3)
    errors = []
    for _ in range(starts):
        guess = stream.standard_normal(4)
        seen = _observe(scene.reference[:1], scene.reference[0], sigma, stream)
        first = DirectionObservation(seen.measured[0], seen.covariance_rad2[0], scene.reference[0])
        rate = scene.frame_rate[0] + np.radians(0.5) * stream.standard_normal(3)
        bank = start_bank(StartParams(), GATE, guess / np.linalg.norm(guess), rate, first)
        for k in range(1, len(scene.t_s)):
            known = KnownTorque(
                control_n_m=scene.control_n_m[k - 1],
                wheel_momentum_n_m_s=known_none,
                wheel_momentum_rate_n_m=known_none,
            )
            bank = predict(scene.inertia, ProcessNoiseParams(), bank, known, scene.frame_rate[k - 1], STEP_S)
            bank = update(bank, _observe(scene.reference[k][None], scene.reference[k], sigma, stream), GATE)
        best = best_of_bank(bank)
        error = attitude_error(best, np.array([[0.0, 0.0, 0.0, 1.0]]), scene.frame_rate[-1:])
        errors.append(float(np.degrees(np.linalg.norm(error[0, :3]))))
    return np.array(errors)


def two_source_attitude_ratio(trials: int, seed: int) -> tuple[float, float]:
    """Return RMSE (deg) of the attitude from one instant of two sources, and its ratio to the predicted sigma.

    Two stations on opposite horizons, 0 dB each, 100 snapshots: MUSIC for two sources, matching, Wahba's problem.
    """
    stream = random_stream(seed, "doa_two_sources")
    reference = direction_from_polar(np.radians([55.0, 50.0]), np.radians([10.0, 170.0]))
    powers = np.eye(2, dtype=np.complex128)
    bound = direction_bound_rad2(ARRAY, reference, powers, 100)
    slopes = cosine_slopes(reference)
    covariances = slopes @ np.stack([bound[i::2, i::2] for i in range(2)]) @ slopes.swapaxes(-1, -2)
    predicted = float(np.trace(attitude_covariance(reference, covariances)))
    squares = []
    for _ in range(trials):
        samples = draw_snapshots(ARRAY, reference, powers, 100, stream)
        found = estimate_several(ARRAY, sample_covariance(samples, 2), 2)
        if not found.complete:
            raise ValueError(f"two stations at 0 dB: {found.reason}")
        pairs = sorted(match_directions(found.direction, reference, np.radians(20.0)), key=lambda pair: pair[1])
        measured = found.direction[[pair[0] for pair in pairs]]
        turn = quaternion_to_rotation_vector(quaternion_from_matrix(fit_rotation(reference, measured).rotation))
        squares.append(float(np.sum(turn**2)))
    rmse = float(np.sqrt(np.mean(squares)))
    return float(np.degrees(rmse)), rmse / float(np.sqrt(predicted))


def coupling_rmse_deg(trials: int, seed: int) -> tuple[float, float, float]:
    """Return the RMSE on the sky (deg) uncalibrated and calibrated with 24 pilots, and the calibrated ratio to the bound.

    Coupling of a quarter to the next element and 10 % gain errors; 10 dB, 100 snapshots, theta 12 to 57 deg.
    """
    stream = random_stream(seed, "doa_coupling")
    gain = 1.0 + 0.1 * complex_normal(stream, (ARRAY.elements,))
    response = ArrayResponse(gain=gain / gain[0], coupling=COUPLING)

    def received(towards: Array, snr: float) -> NDArray[np.complex128]:
        power = np.array([[snr + 0j]])
        return sample_covariance(draw_snapshots(ARRAY, towards[:, None], power, 100, stream, response=response.matrix))

    pilots, truth = (
        direction_from_polar(stream.uniform(0.2, 1.0, count), stream.uniform(0.0, 2.0 * np.pi, count))
        for count in (24, trials)
    )
    fit = fit_response(ARRAY, pilots, received(pilots, 1000.0))
    covariance = received(truth, 10.0)
    bare = estimate_directions(ARRAY, covariance).direction - truth
    matched = estimate_directions(ARRAY, covariance, fit.response.matrix).direction - truth
    power = np.array([[10.0 + 0j]])
    bound = np.mean([np.trace(direction_bound_rad2(ARRAY, s[None], power, 100, response.matrix)) for s in truth])
    ratio = float(np.sqrt(np.mean(np.sum(matched[:, :2] ** 2, axis=1)) / bound))
    sky = [float(np.degrees(np.sqrt(np.mean(np.sum(error**2, axis=1))))) for error in (bare, matched)]
    return sky[0], sky[1], ratio


def _observe(expected: Array, reference: Array, sigma: float, stream: np.random.Generator) -> DirectionObservation:
    """Return directions (n, 3) with MUSIC's error: `sigma` in each direction cosine."""
    basis = polar_basis(expected)
    sizes = sigma / np.stack([basis[:, 2, 2], np.ones(len(expected))], axis=-1)
    rows = basis[:, :2]
    shift = np.einsum("ni,nij->nj", sizes * stream.standard_normal(sizes.shape), rows)
    measured = expected + shift
    measured /= np.linalg.norm(measured, axis=-1, keepdims=True)
    scaled = rows * sizes[:, :, None]
    covariance = scaled.swapaxes(-1, -2) @ scaled
    return DirectionObservation(measured, covariance, np.broadcast_to(reference, measured.shape))
