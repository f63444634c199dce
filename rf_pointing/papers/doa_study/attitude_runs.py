"""Many attitude filters at once through the scene: cases x trials in one batch, 20 000 steps each.

Every filter starts 50 deg wrong in yaw, roll and pitch and 0.5 deg/s in each rate.  Errors are
rotation vectors of the estimate against the truth, in the body: x roll, y pitch, z yaw.

The filter as printed, DOA eqs. (26)-(33), runs for comparison.  State x = [w, q] with q the vector
part of the quaternion; P belongs to it.  A = (29), Phi = E + A dt (28), H = [0, 2 [S x]] (33) with
S = C_bo S_o, additive update of q.  What the paper leaves open is fixed here:

* (29) and the 2 in (33) are the derivatives by a multiplicative error, but the update adds to q:
  exact near q = 0 only.
* Six states have no scalar part: the propagation (27) carries it, and an update sets it to
  sqrt(1 - |q|^2); an update that leaves |q| > 1 is scaled back to 1 with scalar 0.
* R_W is diagonal, though the error of a unit vector has rank two.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rf_pointing.array_sensors.attitude.multiplicative_filter import (
    AttitudeState,
    DirectionObservation,
    GateParams,
    predict,
    process_noise_from_q,
    update,
)
from rf_pointing.array_sensors.attitude.quaternion import quaternion_from_roll_pitch_yaw
from rf_pointing.array_sensors.attitude.rigid_body import (
    KnownTorque,
    RigidInertia,
    propagate,
    rate_jacobian,
)
from rf_pointing.array_sensors.attitude.rotations import (
    cross_matrix,
    matrix_from_quaternion,
    turn_from_quaternion,
)
from rf_pointing.array_sensors.doa.array import CircularArrayParams
from rf_pointing.array_sensors.doa.attitude_start import StartParams, best_of_bank, start_bank
from rf_pointing.core import random_stream, require_between
from rf_pointing.core.types import Array
from rf_pointing.papers.doa_study.directions import (
    GRID_RAD,
    DirectionCase,
    ErrorPool,
    draw_directions,
    error_pool,
    measure_directions,
    nearest_node,
    polar_basis,
    polar_errors_rad,
)
from rf_pointing.papers.doa_study.scene import STEP_S, Scene, nadir_scene

ARRAY = CircularArrayParams()
GATE = GateParams()
START = StartParams(hypotheses=6)
"""Turns 60 deg apart leave the best at most 30 deg wrong; the filter converges from twice that."""
# Directions of 100 steps are drawn together; the filter still takes them one by one.
CHUNK_STEPS = 100
PER_SECOND = round(1.0 / STEP_S)
START_ERROR_RAD = np.radians(50.0)
START_RATE_ERROR_RAD_S = np.radians(0.5)


@dataclass(frozen=True, slots=True)
class PublishedState:
    """rate_rad_s (..., 3), quaternion (..., 4) scalar last, covariance (..., 6, 6) of [rate, vector
    part].
    """

    rate_rad_s: Array
    quaternion: Array
    covariance: Array


def published_predict(
    inertia: RigidInertia,
    process_noise: Array,
    state: PublishedState,
    known: KnownTorque,
    frame_rate: Array,
    dt_s: float,
) -> PublishedState:
    """Return the state after one step of (27)-(29).

    `process_noise` (6, 6) is Q, added once per step.
    """
    rate = state.rate_rad_s
    slope = np.zeros((*rate.shape[:-1], 6, 6))
    slope[..., :3, :3] = rate_jacobian(inertia, rate, known.wheel_momentum_n_m_s)
    slope[..., 3:, :3] = 0.5 * np.eye(3)
    slope[..., 3:, 3:] = -cross_matrix(rate)
    # First order, as (28) prints it.
    transition = np.eye(6) + dt_s * slope
    covariance = transition @ state.covariance @ transition.swapaxes(-1, -2) + process_noise
    quaternion, moved = propagate(inertia, state.quaternion, rate, known, frame_rate, dt_s)
    return PublishedState(moved, quaternion, covariance)


def published_update(
    state: PublishedState, measured: Array, measurement_noise: Array, reference: Array
) -> PublishedState:
    """Return the state after one direction (30)-(33).

    `measurement_noise` (..., 3, 3) is R_W of (22).
    """
    expected = np.einsum("...ji,...j->...i", matrix_from_quaternion(state.quaternion), reference)
    # The printed 2 belongs to the vector part, half of a rotation vector.
    slope = 2.0 * cross_matrix(expected)
    crossed = state.covariance[..., :, 3:] @ slope.swapaxes(-1, -2)
    spread = slope @ crossed[..., 3:, :] + measurement_noise
    gain = crossed @ np.linalg.inv(spread)
    change = np.einsum("...ij,...j->...i", gain, measured - expected)
    covariance = state.covariance - gain @ crossed.swapaxes(-1, -2)
    return PublishedState(
        state.rate_rad_s + change[..., :3],
        _with_scalar(state.quaternion, change[..., 3:]),
        0.5 * (covariance + covariance.swapaxes(-1, -2)),
    )


def _with_scalar(quaternion: Array, change: Array) -> Array:
    # q and -q are one attitude: add to the one whose scalar the square root will give back
    vector = quaternion[..., :3] * np.where(quaternion[..., 3:] < 0.0, -1.0, 1.0) + change
    squared = np.sum(vector**2, axis=-1, keepdims=True)
    vector = vector / np.sqrt(np.maximum(squared, 1.0))
    return np.concatenate([vector, np.sqrt(np.maximum(0.0, 1.0 - squared))], axis=-1)


@dataclass(frozen=True, slots=True, kw_only=True)
class RunTask:
    """Work of one worker; a plain value, so that any executor can carry it.

    `pool` real MUSIC estimates stand behind each case, or, with `music_inside`, MUSIC runs at every
    step of every trial; cases that differ in the search only get the same estimates.  Averages
    begin at `settled_s`.  All cases of one task with the multiplicative filter share one process
    noise.
    """

    cases: tuple[DirectionCase, ...]
    trials: int
    seed: int
    published: bool = False
    music_inside: bool = False
    start_s: float = 0.0
    duration_s: float = 5000.0
    settled_s: float = 2000.0
    pool: int = 20_000


@dataclass(frozen=True, slots=True, kw_only=True)
class CaseResult:
    """Root mean squares over trials and all steps after `settled_s`, degrees.

    `sigma_deg` is what the filter itself predicts (worst axis, same average).  `history_deg`
    (seconds, trials) is the total angle of the error once a second, `rate_history_deg_s` that of
    the rate.
    """

    case: DirectionCase
    theta_deg: float
    phi_deg: float
    roll_deg: float
    pitch_deg: float
    yaw_deg: float
    sigma_deg: float
    outliers: float
    history_deg: NDArray[np.float32]
    rate_history_deg_s: NDArray[np.float32]


def run(task: RunTask) -> list[CaseResult]:
    """Return one result per case of `task`."""
    require_between("trials", task.trials, 1, None)
    require_between("settled_s", task.settled_s, 0.0, task.duration_s - STEP_S)
    scene = nadir_scene(task.duration_s, task.start_s)
    # Named after the task: shared out over processes it draws the same numbers.
    stream = random_stream(task.seed, f"doa_{task.cases[0]}_{len(task.cases)}_{task.trials}")
    # Evenly over the scene, so that the pool has the directions that the filter meets.
    picks = np.linspace(0, len(scene.t_s) - 1, task.pool).astype(int)
    pools = _pools(task, scene.reference[picks], stream)
    batch = _PublishedBatch(task, scene, pools) if task.published else _Batch(task, scene, pools)
    totals = _Totals(task, len(scene.t_s))
    for start in range(0, len(scene.t_s), CHUNK_STEPS):
        truth = scene.reference[start : start + CHUNK_STEPS]
        measured = _measure(task, pools, truth, stream)
        totals.add_directions(start, measured, truth)
        for offset in range(len(truth)):
            batch.step(start + offset, measured[offset].reshape(-1, 3))
            totals.add_attitude(start + offset, batch)
    return totals.results(pools)


def _pools(task: RunTask, truth: Array, stream: np.random.Generator) -> list[ErrorPool]:
    """Return the pool of each case; cases that differ in the search only share one."""
    # Refined peak and grid node of one estimate: their difference is then the grid and not chance.
    made = {case.level: case for case in task.cases}
    pools = {level: error_pool(ARRAY, case, truth, stream) for level, case in made.items()}
    return [pools[case.level] for case in task.cases]


def _measure(
    task: RunTask, pools: list[ErrorPool], truth: Array, stream: np.random.Generator
) -> Array:
    """Return measured directions (steps, cases, trials, 3)."""
    found: dict[tuple[int, float], Array] = {}
    for case, pool in zip(task.cases, pools, strict=True):
        if case.level in found:
            continue
        if task.music_inside:
            repeated = np.repeat(truth, task.trials, axis=0)
            found[case.level] = measure_directions(ARRAY, case, repeated, stream).reshape(
                -1, task.trials, 3
            )
        else:
            found[case.level] = draw_directions(pool, truth, task.trials, stream)
    columns = [
        found[case.level] if case.refined else nearest_node(found[case.level], GRID_RAD)
        for case in task.cases
    ]
    return np.stack(columns, axis=1)


class _Batch:
    """The multiplicative filter for cases x trials."""

    def __init__(self, task: RunTask, scene: Scene, pools: list[ErrorPool]) -> None:
        self._scene = scene
        if len({case.q for case in task.cases}) > 1:
            raise ValueError(
                "cases differ in q: the multiplicative filter takes one process noise per task"
            )
        self._noise = process_noise_from_q(task.cases[0].q, STEP_S)
        self._count = len(task.cases) * task.trials
        self._sigma = np.repeat([pool.sigma_rad for pool in pools], task.trials)
        # The grid's rounding is an error of step / sqrt(12) that the bound does not contain.
        floor = [0.0 if case.refined else GRID_RAD**2 / 12.0 for case in task.cases]
        self._floor = np.repeat(floor, task.trials)
        self._state: AttitudeState | None = None
        # The second station shows which hypothesis was right.
        second = int(np.argmax(scene.station != scene.station[0]))
        self._choose = second + round(START.settle_s / STEP_S)

    def step(self, k: int, measured: Array) -> None:
        """Predict to step `k` and take its directions (n, 3)."""
        scene = self._scene
        if self._state is None:
            guess, rate = _start(self._count, scene)
            first = self._seen(k, measured)
            self._state = start_bank(START, GATE, guess, rate, first)
        else:
            if k == self._choose:
                self._state = best_of_bank(self._state)
            known = _known(scene, k - 1)
            self._state = predict(
                scene.inertia, self._noise, self._state, known, scene.frame_rate[k - 1], STEP_S
            )
        self._state = update(self._state, self._seen(k, measured[:, None]), GATE)

    def error_rad(self) -> Array:
        """Return the rotation vectors (n, 3) of the best estimates; the truth is the identity."""
        return turn_from_quaternion(self._best().quaternion)

    def rate_error_rad_s(self, k: int) -> Array:
        """Return the rate errors (n, 3) at step `k`."""
        return np.asarray(self._best().rate_rad_s - self._scene.frame_rate[k])

    def spread_rad2(self) -> Array:
        """Return the predicted variances (n, 3)."""
        return np.asarray(np.diagonal(self._best().covariance, axis1=-2, axis2=-1)[..., :3])

    def _best(self) -> AttitudeState:
        assert self._state is not None
        return self._state if self._state.misfit.shape[-1] == 1 else best_of_bank(self._state)

    def _seen(self, k: int, measured: Array) -> DirectionObservation:
        """Return the observation of directions (n, 3), or (n, 1, 3) for banks."""
        covariance = self._covariance(measured.reshape(-1, 3)).reshape(*measured.shape, 3)
        return DirectionObservation(
            measured, covariance, np.broadcast_to(self._scene.reference[k], measured.shape)
        )

    def _covariance(self, measured: Array) -> Array:
        basis = polar_basis(measured)
        across = np.hypot(measured[:, 0], measured[:, 1])
        # towards the array plane the bound grows without limit: no direction there is better than
        # 0.1 in cosine
        polar = (self._sigma / np.maximum(measured[:, 2], 0.1)) ** 2 + self._floor
        azimuth = self._sigma**2 + self._floor * across**2
        rows = basis[:, :2] * np.sqrt(np.stack([polar, azimuth], axis=-1))[:, :, None]
        return np.asarray(rows.swapaxes(-1, -2) @ rows)


class _PublishedBatch:
    """The printed filter for cases x trials."""

    def __init__(self, task: RunTask, scene: Scene, pools: list[ErrorPool]) -> None:
        self._scene = scene
        self._q = np.repeat([case.q * np.eye(6) for case in task.cases], task.trials, axis=0)
        # The paper's R_W: diagonal, from the errors of the estimates themselves.
        self._noise = np.repeat([np.diag(pool.variance) for pool in pools], task.trials, axis=0)
        count = len(task.cases) * task.trials
        guess, rate = _start(count, scene)
        # A rotation is twice the vector part: a quarter of its variance.
        spread = np.repeat([START_RATE_ERROR_RAD_S**2, START_ERROR_RAD**2 / 4.0], 3)
        self._state = PublishedState(rate, guess, np.tile(np.diag(spread), (count, 1, 1)))

    def step(self, k: int, measured: Array) -> None:
        """Predict to step `k` and take its directions (n, 3)."""
        scene = self._scene
        if k:
            known = _known(scene, k - 1)
            frame_rate = scene.frame_rate[k - 1]
            self._state = published_predict(
                scene.inertia, self._q, self._state, known, frame_rate, STEP_S
            )
        reference = np.broadcast_to(scene.reference[k], measured.shape)
        self._state = published_update(self._state, measured, self._noise, reference)

    def error_rad(self) -> Array:
        """Return the rotation vectors (n, 3) of the estimates; the truth is the identity."""
        return turn_from_quaternion(self._state.quaternion)

    def rate_error_rad_s(self, k: int) -> Array:
        """Return the rate errors (n, 3) at step `k`."""
        return np.asarray(self._state.rate_rad_s - self._scene.frame_rate[k])

    def spread_rad2(self) -> Array:
        """Return the predicted variances (n, 3) of the rotation.

        Four times those of the vector part.
        """
        # The reverse: from the vector part back to the rotation.
        return np.asarray(4.0 * np.diagonal(self._state.covariance, axis1=-2, axis2=-1)[:, 3:])


class _Totals:
    """Sums of squares after the transient, and the history of the total angle."""

    def __init__(self, task: RunTask, steps: int) -> None:
        self._task = task
        # The transient is left out: with it the average would only measure the start.
        self._first = round(task.settled_s / STEP_S)
        shape = (len(task.cases), task.trials)
        self._count = steps - self._first
        self._attitude = np.zeros((*shape, 3))
        self._spread = np.zeros((*shape, 3))
        self._direction = np.zeros((len(task.cases), 2))
        self._history = np.zeros(
            (2, len(task.cases), -(-steps // PER_SECOND), task.trials), dtype=np.float32
        )

    def add_directions(self, start: int, measured: Array, truth: Array) -> None:
        """Add measured directions (steps, cases, trials, 3)."""
        # The chunk in which the averages begin is counted from that step only.
        late = measured[max(0, self._first - start) :]
        theta, phi, _ = polar_errors_rad(late, truth[max(0, self._first - start) :, None, None])
        self._direction[:, 0] += np.sum(theta**2, axis=(0, 2))
        self._direction[:, 1] += np.sum(phi**2, axis=(0, 2))

    def add_attitude(self, k: int, batch: "_Batch | _PublishedBatch") -> None:
        """Add the errors and predicted variances of step `k`."""
        shape = self._attitude.shape
        if k % PER_SECOND == 0:
            for place, error in enumerate((batch.error_rad(), batch.rate_error_rad_s(k))):
                self._history[place, :, k // PER_SECOND] = np.degrees(
                    np.linalg.norm(error, axis=-1)
                ).reshape(shape[:2])
        if k >= self._first:
            self._attitude += np.reshape(batch.error_rad() ** 2, shape)
            self._spread += np.reshape(batch.spread_rad2(), shape)

    def results(self, pools: list[ErrorPool]) -> list[CaseResult]:
        """Return the root mean squares of each case."""
        attitude = np.degrees(np.sqrt(np.mean(self._attitude, axis=1) / self._count))
        spread = np.degrees(np.sqrt(np.mean(self._spread, axis=1) / self._count))
        direction = np.degrees(np.sqrt(self._direction / (self._count * self._task.trials)))
        return [
            CaseResult(
                case=case,
                theta_deg=float(direction[i, 0]),
                phi_deg=float(direction[i, 1]),
                roll_deg=float(attitude[i, 0]),
                pitch_deg=float(attitude[i, 1]),
                yaw_deg=float(attitude[i, 2]),
                sigma_deg=float(np.max(spread[i])),
                outliers=pools[i].outliers,
                history_deg=self._history[0, i],
                rate_history_deg_s=self._history[1, i],
            )
            for i, case in enumerate(self._task.cases)
        ]


def _start(count: int, scene: Scene) -> tuple[Array, Array]:
    guess = quaternion_from_roll_pitch_yaw(np.full((count, 3), START_ERROR_RAD))
    return guess, np.tile(scene.frame_rate[0] + START_RATE_ERROR_RAD_S, (count, 1))


def _known(scene: Scene, k: int) -> KnownTorque:
    none = np.zeros(3)
    return KnownTorque(
        control_n_m=scene.control_n_m[k], wheel_momentum_n_m_s=none, wheel_momentum_rate_n_m=none
    )
