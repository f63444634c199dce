"""Attitude and rate from directions to ground signals: multiplicative error-state Kalman filter.

State: quaternion (body in orbital frame) and inertial body rate w.  Error: rotation e in the
ORBITAL frame, C_true = exp([e x]) C, and rate error.  In this frame the reference direction S_o is
known exactly, so the measured direction turned by the estimate, C m, misses S_o by

    z = rotation vector that takes C m to S_o = e across S_o,   H = [E, 0],

with E two rows orthogonal to S_o.  The observed and the unobserved axes never depend on the
estimate (the invariant form of the extended Kalman filter, Barrau and Bonnabel 2017).  `doa`
contains its start from any attitude, `papers.doa_study` the filter as DOA prints it.  All functions
accept leading batch axes.

Process noise: DOA adds Q = q E_6 every 250 ms to the rate (rad/s)^2 and to the vector part of the
quaternion.  A rotation is twice the vector part, so per second that is 4 q / dt on the attitude and
q / dt on the rate.

A constant torque that the satellite does not know, and constant errors of the sensor, are not white
noise: they are estimated along (`Biases`), because they bias the attitude by many claimed sigmas
otherwise.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from rf_pointing.array_sensors.attitude.quaternion import (
    conjugate,
    multiply,
    quaternion_to_rotation_vector,
    unit_quaternion,
)
from rf_pointing.array_sensors.attitude.rigid_body import (
    KnownTorque,
    RigidInertia,
    gravity_jacobian,
    propagate,
    rate_jacobian,
)
from rf_pointing.array_sensors.attitude.rotations import (
    cosine_slopes,
    cross_matrix,
    cross_product,
    matrix_from_quaternion,
    quaternion_from_turn,
    quaternion_product,
    tangent_rows,
)
from rf_pointing.core import Params, parameter, require_between
from rf_pointing.core.types import Array

PRINTED_Q = 1e-9
# With the printed q the filter itself predicts an error of degrees; this one gives tables of the
# size that DOA prints.
TABLE_Q = 1e-12

# Biases of the sensor first, then those of the torque, then those of the references.
_SENSOR, _TORQUE = slice(0, 2), slice(2, 5)
_BEFORE_REFERENCES = 5
LARGEST_SQUARE = 1.0 - 1e-6
"""Largest sum of squares of the two cosines of a direction above the plane of the array."""
SMALLEST_DETERMINANT = 1e-12
"""Least determinant of an innovation covariance, scaled to a unit diagonal."""
# Rounding leaves 1e-16 of an exact zero.


@dataclass(frozen=True, kw_only=True)
class ProcessNoiseParams(Params):
    """Random walk added per second to the attitude and to the rate, each axis; unknown torque."""

    attitude_rad2_s: float = parameter(
        1.6e-11, "variance of the attitude per second, rad^2/s", low=0.0, high=1.0
    )
    rate_rad2_s3: float = parameter(
        4e-12, "variance of the rate per second, rad^2/s^3", low=0.0, high=1.0
    )
    # Drag, sunlight and the residual dipole of a satellite of this size.
    torque_n_m: float = parameter(
        2e-5,
        "sigma of a constant torque on each axis that the satellite does not know",
        low=0.0,
        high=1.0,
    )


def process_noise_from_q(q: float, dt_s: float = 0.25) -> ProcessNoiseParams:
    """Return the noise equal to DOA's Q = q E_6 added every `dt_s`."""
    require_between("q", q, 0.0, 1e-3)
    require_between("dt_s", dt_s, 1e-6, 10.0)
    return ProcessNoiseParams(attitude_rad2_s=4.0 * q / dt_s, rate_rad2_s3=q / dt_s, torque_n_m=0.0)


@dataclass(frozen=True, kw_only=True)
class GateParams(Params):
    """When a direction is taken for an outlier, and when the filter itself is."""

    # 30 is wide for two degrees of freedom (3e-7): a start that is still wrong must not lose good
    # directions.
    largest: float = parameter(
        30.0, "largest normalised squared innovation, chi-square of 2 degrees", low=4.0, high=1e12
    )
    # Eight directions are 2 s at one each 250 ms: an outlier or two must not open the gate.
    doubt_after: int = parameter(
        8, "rejections in a row after which the filter doubts itself", low=1, high=10**6
    )


@dataclass(frozen=True, slots=True)
class AttitudeState:
    """State of one filter or of a batch of them.

    quaternion (..., 4), rate_rad_s (..., 3), covariance (..., 6, 6) of [orbital-frame rotation,
    rate], refused (...): directions outside the gate in a row, misfit (...): sum of the normalised
    squared innovations, each at most the gate.
    """

    quaternion: Array
    rate_rad_s: Array
    covariance: Array
    refused: NDArray[np.int64]
    misfit: Array
    biases: "Biases | None" = None


@dataclass(frozen=True, slots=True)
class Biases:
    """Constants in units of their first sigma, estimated with the state: two biases of the sensor,
    the unknown torque on the three axes of the body, then k of the references (clock, places).

    Without them the innovations would not be white, and no hypothesis could be weighed by them.
    With n = 5 + k: estimate (..., n), covariance (..., n, n), correlation (..., 6, n): covariance
    of the errors of attitude and rate with theirs.
    """

    estimate: Array
    covariance: Array
    correlation: Array


def _unknown_biases(lead: tuple[int, ...], count: int = _BEFORE_REFERENCES) -> Biases:
    unit = np.broadcast_to(np.eye(count), (*lead, count, count))
    return Biases(np.zeros((*lead, count)), unit, np.zeros((*lead, 6, count)))


def _at_least(biases: Biases | None, lead: tuple[int, ...], count: int) -> Biases:
    """Return `biases` with `count` of them; those of references not met before are unknown."""
    known = 0 if biases is None else biases.estimate.shape[-1]
    if biases is not None and known >= count:
        return biases
    found = _unknown_biases(lead, count)
    if biases is None:
        return found
    covariance = found.covariance.copy()
    found.estimate[..., :known] = biases.estimate
    covariance[..., :known, :known] = biases.covariance
    found.correlation[..., :known] = biases.correlation
    return replace(found, covariance=covariance)


@dataclass(frozen=True, slots=True)
class DirectionObservation:
    """Measured direction in the body (..., 3), the covariance of its noise (..., 3, 3), and the
    reference in the orbital frame.

    `bias_rad` (..., 3, 2): error of the direction for one sigma of each of two constant biases.
    `reference_bias_rad` (..., 3, k): what one sigma of each constant of orbit and stations adds to
    the reference.
    """

    measured: Array
    covariance_rad2: Array
    reference: Array
    bias_rad: Array | None = None
    reference_bias_rad: Array | None = None


def start_state(
    quaternion: Array,
    rate_rad_s: Array,
    attitude_sigma_rad: float,
    rate_sigma_rad_s: float,
    gate: GateParams,
) -> AttitudeState:
    """Return the state starting at `quaternion` (..., 4), `rate_rad_s` (..., 3) with equal
    uncertainty of all axes.

    A start may be wrong, so the filter begins in doubt: it accepts every direction until one falls
    into its gate.
    """
    lead = np.shape(quaternion)[:-1]
    covariance = np.diag(np.repeat([attitude_sigma_rad**2, rate_sigma_rad_s**2], 3))
    return AttitudeState(
        unit_quaternion(quaternion),
        np.array(rate_rad_s, dtype=np.float64),
        np.broadcast_to(covariance, (*lead, 6, 6)).copy(),
        np.full(lead, gate.doubt_after, dtype=np.int64),
        np.zeros(lead),
    )


def predict(
    inertia: RigidInertia,
    noise: ProcessNoiseParams,
    state: AttitudeState,
    known: KnownTorque,
    frame_rate: Array,
    dt_s: float,
) -> AttitudeState:
    """Return the state `dt_s` later.

    `frame_rate` (..., 3) is the orbital frame's inertial rate in its own axes.
    """
    rotation, biases = matrix_from_quaternion(state.quaternion), state.biases
    if biases is None and noise.torque_n_m > 0.0:
        biases = _unknown_biases(state.quaternion.shape[:-1])
    known = _with_unknown(noise, biases, known)
    quaternion, rate = propagate(
        inertia, state.quaternion, state.rate_rad_s, known, frame_rate, dt_s, rotation
    )
    by_rate = rate_jacobian(inertia, state.rate_rad_s, known.wheel_momentum_n_m_s)
    by_attitude = inertia.inverse @ gravity_jacobian(inertia, rotation, frame_rate)
    slope = np.zeros((*by_rate.shape[:-2], 6, 6))
    # The error is kept in the orbital frame, which itself turns: hence minus the frame rate, not
    # the body rate.
    slope[..., :3, :3] = -cross_matrix(frame_rate)
    # Mean of the rotations at both ends: the body turns by degrees in a step of 250 ms right after
    # a bad start.
    slope[..., :3, 3:] = 0.5 * (rotation + matrix_from_quaternion(quaternion))
    slope[..., 3:, :3] = by_attitude @ _transposed(rotation)
    slope[..., 3:, 3:] = by_rate
    step = slope * dt_s
    # Second order of the exponential: in a step of 250 ms the first alone would leave rate and
    # attitude uncorrelated.
    transition = np.eye(6) + step + 0.5 * step @ step
    covariance = transition @ state.covariance @ _transposed(transition)
    if biases is not None:
        covariance, biases = _carried(inertia, noise, biases, transition, covariance, slope, dt_s)
    # A writable view of the diagonal: the noise is added in place.
    variance = np.einsum("...ii->...i", covariance)
    variance += dt_s * np.repeat([noise.attitude_rad2_s, noise.rate_rad2_s3], 3)
    return AttitudeState(quaternion, rate, covariance, state.refused, state.misfit, biases)


def carried_back(
    inertia: RigidInertia,
    noise: ProcessNoiseParams,
    state: AttitudeState,
    known: KnownTorque,
    frame_rate: Array,
    dt_s: float,
) -> AttitudeState:
    """Return `state` with the attitude and the rate of `dt_s` before; the rest stays as it is."""
    known = _with_unknown(noise, state.biases, known)
    rotation = matrix_from_quaternion(state.quaternion)
    quaternion, rate = propagate(
        inertia, state.quaternion, state.rate_rad_s, known, frame_rate, -dt_s, rotation
    )
    return replace(state, quaternion=quaternion, rate_rad_s=rate)


def _with_unknown(
    noise: ProcessNoiseParams, biases: Biases | None, known: KnownTorque
) -> KnownTorque:
    """Return the torque with what is estimated of the unknown one."""
    if biases is None:
        return known
    return replace(
        known, control_n_m=known.control_n_m + noise.torque_n_m * biases.estimate[..., _TORQUE]
    )


def _carried(
    inertia: RigidInertia,
    noise: ProcessNoiseParams,
    biases: Biases,
    transition: Array,
    covariance: Array,
    slope: Array,
    dt_s: float,
) -> tuple[Array, Biases]:
    """Return the covariance of attitude and rate with what the unknown torque adds in `dt_s`, and
    the biases with their correlation.
    """
    by_torque = np.zeros((*slope.shape[:-2], 6, biases.estimate.shape[-1]))
    by_torque[..., 3:, _TORQUE] = noise.torque_n_m * dt_s * inertia.inverse
    # Half a step of the rate on the attitude: the second order of the exponential.
    by_torque += 0.5 * dt_s * slope @ by_torque
    carried = transition @ biases.correlation
    mixed = carried @ _transposed(by_torque)
    added = mixed + _transposed(mixed) + by_torque @ biases.covariance @ _transposed(by_torque)
    return covariance + added, replace(biases, correlation=carried + by_torque @ biases.covariance)


def innovation(
    state: AttitudeState, observation: DirectionObservation
) -> tuple[Array, Array, Array]:
    """Return z (..., 2), its covariance (..., 2, 2) and the rows E (..., 2, 3) orthogonal to the
    reference.
    """
    z, spread, rows, _, _ = _innovation(state, observation)
    return z, spread, rows


def _innovation(
    state: AttitudeState, observation: DirectionObservation
) -> tuple[Array, Array, Array, Array, tuple[Biases, Array] | None]:
    """Return z, its covariance, E, cov(x, z) (..., 6, 2), and the biases with cov(b, z) (..., n,
    2).
    """
    rotation = matrix_from_quaternion(state.quaternion)
    if state.biases is not None and observation.bias_rad is not None:
        observation = _unbiased(observation, state.biases.estimate[..., _SENSOR])
    turned = np.einsum("...ij,...j->...i", rotation, observation.measured)
    gap = rotation_between(turned, observation.reference)
    rows = tangent_rows(observation.reference)
    carried = rows @ matrix_from_quaternion(quaternion_from_turn(gap)) @ rotation
    # The sensor's covariance belongs to the direction in the body; z belongs to the rotation that
    # carries it onto the reference.
    noise_map = carried @ cross_matrix(observation.measured)
    noise = noise_map @ observation.covariance_rad2 @ _transposed(noise_map)
    spread = rows @ state.covariance[..., :3, :3] @ _transposed(rows) + noise
    z, crossed = (
        np.einsum("...ij,...j->...i", rows, gap),
        state.covariance[..., :, :3] @ _transposed(rows),
    )
    of_reference = observation.reference_bias_rad
    if state.biases is None and observation.bias_rad is None and of_reference is None:
        return z, spread, rows, crossed, None
    count = _BEFORE_REFERENCES + (0 if of_reference is None else of_reference.shape[-1])
    biases = _at_least(state.biases, state.quaternion.shape[:-1], count)
    slope = np.zeros((*z.shape, biases.estimate.shape[-1]))
    if observation.bias_rad is not None:
        slope[..., _SENSOR] = -noise_map @ observation.bias_rad
    if of_reference is not None:
        # The direction is that of the true reference; z turns it onto the one that is known.
        slope[..., _BEFORE_REFERENCES:count] = (
            -rows @ cross_matrix(observation.reference) @ of_reference
        )
    crossed = crossed + biases.correlation @ _transposed(slope)
    bias_crossed = _transposed(
        rows @ biases.correlation[..., :3, :]
    ) + biases.covariance @ _transposed(slope)
    common = rows @ biases.correlation[..., :3, :] @ _transposed(slope)
    spread = spread + common + _transposed(common) + slope @ biases.covariance @ _transposed(slope)
    # The sensor's are taken off already.
    others = slice(_SENSOR.stop, None)
    z = z - np.einsum("...ij,...j->...i", slope[..., others], biases.estimate[..., others])
    return z, spread, rows, crossed, (biases, bias_crossed)


def _unbiased(observation: DirectionObservation, sensor: Array) -> DirectionObservation:
    """Return the direction less the biases `sensor` (..., 2) of its cosines.

    Near the plane of the array a bias of the cosines turns by far more than its slope there says.
    """
    assert observation.bias_rad is not None
    by_bias, noise = observation.bias_rad[..., :2, :], observation.covariance_rad2[..., :2, :2]
    cosines = observation.measured[..., :2] - np.einsum("...ij,...j->...i", by_bias, sensor)
    size = np.sum(cosines**2, axis=-1, keepdims=True)
    cosines = cosines * np.sqrt(np.minimum(1.0, LARGEST_SQUARE / np.maximum(size, LARGEST_SQUARE)))
    height = np.sqrt(1.0 - np.sum(cosines**2, axis=-1, keepdims=True))
    slopes = cosine_slopes(np.concatenate([cosines, height], axis=-1))
    return replace(
        observation,
        measured=np.concatenate([cosines, height], axis=-1),
        covariance_rad2=slopes @ noise @ _transposed(slopes),
        bias_rad=slopes @ by_bias,
    )


def squared_innovation(state: AttitudeState, observation: DirectionObservation) -> Array:
    """Return the normalised squared innovation (...), chi-square of two degrees of freedom."""
    z, spread, _ = innovation(state, observation)
    return np.asarray(np.einsum("...i,...ij,...j->...", z, _inverse_spread(spread), z))


def update(
    state: AttitudeState,
    observation: DirectionObservation,
    gate: GateParams,
    *,
    in_doubt: bool = True,
) -> AttitudeState:
    """Return the state after one direction.

    A direction outside the gate is rejected and counted.  After `gate.doubt_after` rejections in a
    row the filter is taken to be wrong and not the sensor: it accepts every direction until one
    falls inside the gate again, unless `in_doubt` is false.
    """
    z, spread, _, crossed, biases = _innovation(state, observation)
    inverse = _inverse_spread(spread)
    # Normalised squared innovation, chi-square of two degrees of freedom where the filter is
    # consistent.
    squared = np.einsum("...i,...ij,...j->...", z, inverse, z)
    inside = squared <= gate.largest
    # A filter that rejects everything would never recover: in doubt it lets the direction in and
    # stays marked.
    believed = inside | (in_doubt & (state.refused >= gate.doubt_after))
    gain = crossed @ inverse * believed[..., None, None]
    change = np.einsum("...ij,...j->...i", gain, z)
    # no reset of the covariance: what is left unknown is the turn about the reference itself,
    # before and after
    covariance = state.covariance - gain @ _transposed(crossed)
    found = state.biases
    if biases is not None:
        found, bias_crossed = biases
        bias_gain = bias_crossed @ inverse * believed[..., None, None]
        found = Biases(
            found.estimate + np.einsum("...ij,...j->...i", bias_gain, z),
            found.covariance - bias_gain @ _transposed(bias_crossed),
            found.correlation - gain @ _transposed(bias_crossed),
        )
    quaternion = quaternion_product(quaternion_from_turn(change[..., :3]), state.quaternion)
    return AttitudeState(
        quaternion / np.linalg.norm(quaternion, axis=-1, keepdims=True),
        state.rate_rad_s + change[..., 3:],
        0.5 * (covariance + covariance.swapaxes(-1, -2)),
        np.where(inside, 0, state.refused + 1),
        # Bounded per direction, so that one outlier does not decide between the hypotheses of a
        # start.
        state.misfit + np.minimum(squared, gate.largest),
        found,
    )


def attitude_error(state: AttitudeState, quaternion: Array, rate_rad_s: Array) -> Array:
    """Return the error (..., 6) of `state` against the truth, in the axes of its covariance."""
    turn = quaternion_to_rotation_vector(multiply(quaternion, conjugate(state.quaternion)))
    return np.concatenate([turn, rate_rad_s - state.rate_rad_s], axis=-1)


def rotation_between(first: Array, second: Array) -> Array:
    """Return the shortest rotation vector (..., 3) taking unit vector `first` to `second`.

    At exactly opposite vectors every axis across them serves: one is chosen.
    """
    axis = cross_product(first, second)
    sine = np.linalg.norm(axis, axis=-1)
    angle = np.arctan2(sine, np.einsum("...i,...i->...", first, second))
    vector = axis * np.divide(angle, sine, out=np.ones_like(sine), where=sine > 1e-12)[..., None]
    # The cross product vanishes at half a turn too; without this case the filter would stand still
    # at exactly the wrong attitude.
    opposite = (sine <= 1e-12) & (angle > 1.0)
    if np.any(opposite):
        vector[opposite] = (
            np.pi * np.broadcast_to(tangent_rows(first)[..., 0, :], axis.shape)[opposite]
        )
    return np.asarray(vector)


def _transposed(matrix: Array) -> Array:
    """Return the transpose as a copy of its own.

    Stacked products with a view take three times as long.
    """
    return np.ascontiguousarray(matrix.swapaxes(-1, -2))


def _inverse_spread(spread: Array) -> Array:
    """Return the inverse (..., 2, 2) of innovation covariances; a singular one is refused."""
    a, b, c = spread[..., 0, 0], spread[..., 0, 1], spread[..., 1, 1]
    # Written out: a stack of 2 x 2 matrices is inverted at every step of every trial, where the
    # general routine costs most of the time.
    determinant = a * c - b * b
    if not np.all(determinant > SMALLEST_DETERMINANT * a * c):
        raise ValueError(
            f"innovation covariance has determinant {np.min(determinant)}, must be > 0: singular"
        )
    inverse = np.empty(spread.shape)
    inverse[..., 0, 0], inverse[..., 1, 1] = c / determinant, a / determinant
    inverse[..., 0, 1] = inverse[..., 1, 0] = -b / determinant
    return inverse
