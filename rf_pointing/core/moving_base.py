"""A base that moves: its attitude from an IMU, and the angles of the axes that hold a beam on it.

The deck (starboard, bow, up) is turned against the sky (east, north, up) by the rotation A(t).  So
a moving base is one more rotation at the front of the chain B of a mount (`kinematics.py`):

    u_axes = M u_level,   M = B' A' B,   dM/dt = -[w] M

with u_level the direction by the axes that a base at rest would have, level and with its bow to the
north, and w the rate of the base in the frame of the mount.  Everybody above the control unit works
with the axes of the base at rest.

The attitude is predicted from its time on by the rates of the gyro.  An IMU that is silent is
predicted for `AHEAD_S`; then its rates fade, and after `coast_s` the base is lost.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from rf_pointing.core.checks import as_finite_array, require_finite
from rf_pointing.core.kinematics import LEVEL, Kinematics, motion_of_vectors, vectors_of_motion
from rf_pointing.core.parameters import Params, parameter
from rf_pointing.core.types import Array, Pair

AHEAD_S, FADING_S = 0.2, 0.3
"""Time that the rates of a sample hold, and in which they fade afterwards."""
UNIT_TOLERANCE = 0.01
EARLY_S, LATE_S = 0.01, 0.5
"""By how much a sample may be stamped after its arrival, and how old it may be then."""
SMOOTHING_S, BEND_S = 0.3, 0.1
"""Times in which the attitude follows that of the IMU, and the acceleration the gyro's."""
SHARE = 0.1
"""Share of a new latency in the mean."""
OF_ROS = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
"""The rotation from x forward, y left, z up of ROS to starboard, bow and up of the deck."""
_UNIT = np.eye(3)


@dataclass(frozen=True, kw_only=True)
class BaseParams(Params):
    """Base of the antenna, and the trust in what measures its motion."""

    moves: bool = parameter(
        False, "whether the base of the antenna moves, as on a ship or a vehicle"
    )
    coast_s: float = parameter(
        2.0, "silence of the IMU after which the antenna is stowed", 0.2, 60.0
    )
    jump_rad: float = parameter(
        math.radians(2.0), "departure from the prediction that is a jump", 1e-3, 1.0
    )
    fastest_rad_s: float = parameter(
        math.radians(60.0), "rate from which a sample is refused", 1e-3, 10.0
    )
    imu_rad: tuple[float, ...] = parameter(
        (0.0, 0.0, 0.0),
        "roll, pitch and yaw of the IMU on the base, about x forward, y left, z up",
        -4.0,
        4.0,
    )

    def check_together(self) -> None:
        """Refuse anything but three angles of the IMU."""
        if len(self.imu_rad) != 3:
            raise ValueError(f"imu_rad={self.imu_rad} must have 3 values (roll, pitch, yaw)")


@dataclass(frozen=True, slots=True, kw_only=True)
class BaseSample:
    """Attitude of an IMU against east, north, up as x, y, z, w, and rates about its own axes."""

    t_s: float
    quaternion: tuple[float, float, float, float]
    rate_rad_s: Array

    def __post_init__(self) -> None:
        require_finite("t_s", self.t_s)
        as_finite_array("quaternion", self.quaternion, (4,))
        object.__setattr__(self, "rate_rad_s", as_finite_array("rate_rad_s", self.rate_rad_s, (3,)))
        length = math.hypot(*self.quaternion)
        if abs(length - 1.0) > UNIT_TOLERANCE:
            raise ValueError(
                f"quaternion has length {length:.4g}, must be within {UNIT_TOLERANCE} of 1"
            )


class BaseState(NamedTuple):
    """Attitude (3, 3) of the deck at `t_s`, its rate and acceleration (3,) about its own axes."""

    t_s: float
    attitude: Array
    rate_rad_s: Array
    acceleration_rad_s2: Array


def matrix_of_quaternion(quaternion: Sequence[float]) -> Array:
    """Return the rotation (3, 3) of a quaternion x, y, z, w of any length."""
    x, y, z, w = np.asarray(quaternion) / math.hypot(*quaternion)
    return np.array([
        [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - z * w), 2.0 * (x * z + y * w)],
        [2.0 * (x * y + z * w), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - x * w)],
        [2.0 * (x * z - y * w), 2.0 * (y * z + x * w), 1.0 - 2.0 * (x * x + y * y)],
    ])  # fmt: skip


def quaternion_of_matrix(matrix: Array) -> tuple[float, float, float, float]:
    """Return x, y, z, w of a rotation (3, 3), as the eigenvector of the largest eigenvalue."""
    m = np.asarray(matrix)
    off = np.array([m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1]])
    form = np.zeros((4, 4))
    form[:3, :3], form[3, :3], form[:3, 3] = m + m.T - np.trace(m) * np.eye(3), off, off
    form[3, 3] = np.trace(m)
    x, y, z, w = np.linalg.eigh(form)[1][:, -1].tolist()
    return x, y, z, w


def turned_by(rotation_rad: Array) -> Array:
    """Return the rotation (3, 3) about an axis by its length in rad (Rodrigues)."""
    x, y, z = rotation_rad.tolist()
    angle = math.sqrt(x * x + y * y + z * z)
    half = 0.5 * angle
    # Without a loss of digits at 0.
    first = math.sin(angle) / angle if angle > 1e-9 else 1.0
    second = 0.5 * (math.sin(half) / half) ** 2 if angle > 1e-9 else 0.5
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.asarray(_UNIT + first * cross + second * cross @ cross)


def deck_attitude(roll_rad: float, pitch_rad: float, yaw_rad: float) -> Array:
    """Return the rotation Rz(yaw) Ry(pitch) Rx(roll) of ROS, x forward against x east."""
    (sr, cr), (sp, cp), (sy, cy) = (
        (math.sin(each), math.cos(each)) for each in (roll_rad, pitch_rad, yaw_rad)
    )
    return np.array([
        [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
        [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
        [-sp, cp * sr, cp * cr],
    ])  # fmt: skip


def _rotation_between(before: Array, after: Array) -> Array:
    """Return the rotation vector (3,), in the frame of `before`, that leads to `after`."""
    (a, b, c), (d, e, f), (g, h, i) = (before.T @ after).tolist()
    vector = 0.5 * np.array([h - f, c - g, d - b])
    sine = float(np.linalg.norm(vector))
    angle = math.atan2(sine, 0.5 * (a + e + i - 1.0))
    # Half a turn has no axis by its sines; any axis tells that it is a jump.
    return vector * (angle / sine) if sine > 1e-12 else np.array([angle, 0.0, 0.0])


class MovingBase:
    """Attitude of one base; `take` samples as they come, `at` once a tick before anything else.

    Directions are angles of the axes of `mount`: by the base at rest ("level") or the real ones.
    """

    def __init__(self, params: BaseParams, mount: Kinematics = LEVEL) -> None:
        self.params, self._chain = params, mount.matrix
        # A left-handed chain turns the other way about its axes.
        self._spin = np.linalg.det(mount.matrix) * mount.matrix.T
        self._imu = deck_attitude(*params.imu_rad)
        self._known: BaseState | None = None
        self._refused: tuple[int, str] = (0, "")
        self.latency_s = 0.0
        """Mean time from a sample to its arrival."""
        self._now = BaseState(-math.inf, np.eye(3), np.zeros(3), np.zeros(3))
        self._turn = np.eye(3)

    @property
    def refused(self) -> tuple[int, str]:
        """How many samples were refused, and why the last one."""
        return self._refused

    def take(self, sample: BaseSample, now_s: float) -> str:
        """Take a sample that arrives at `now_s`; return "" or why it is refused."""
        attitude = matrix_of_quaternion(sample.quaternion) @ self._imu.T @ OF_ROS.T
        rate, known, age_s = OF_ROS @ self._imu @ sample.rate_rad_s, self._known, now_s - sample.t_s
        fastest, reason = float(np.max(np.abs(rate))), ""
        if not -EARLY_S <= age_s <= LATE_S:
            reason = f"the sample is {age_s:.3f} s old, must be {-EARLY_S:g} to {LATE_S:g} s"
        elif fastest > self.params.fastest_rad_s:
            turns, most = math.degrees(fastest), math.degrees(self.params.fastest_rad_s)
            reason = f"the base turns at {turns:.1f} deg/s, must be <= {most:.1f} deg/s"
        if known is None or sample.t_s - known.t_s > self.params.coast_s:
            new = BaseState(sample.t_s, attitude, rate, np.zeros(3))
        else:
            dt_s = sample.t_s - known.t_s
            if dt_s <= 0.0:
                reason = reason or f"the sample is {-dt_s:.3f} s before the last one"
                return self.refuse(reason)
            predicted = _ahead(known, sample.t_s)
            off = _rotation_between(predicted.attitude, attitude)
            # While nobody measures it a base may turn by more.
            most = self.params.jump_rad + max(0.0, dt_s - AHEAD_S) * self.params.fastest_rad_s
            if float(np.linalg.norm(off)) > most:
                jump, most = math.degrees(float(np.linalg.norm(off))), math.degrees(most)
                reason = (
                    reason or f"the attitude jumps by {jump:.2f} deg, must be <= {most:.2f} deg"
                )
            share = 1.0 if dt_s > AHEAD_S else -math.expm1(-dt_s / SMOOTHING_S)
            bend = known.acceleration_rad_s2
            bend = bend - math.expm1(-dt_s / BEND_S) * ((rate - known.rate_rad_s) / dt_s - bend)
            new = BaseState(sample.t_s, predicted.attitude @ turned_by(share * off), rate, bend)
        if reason:
            return self.refuse(reason)
        self._known = new
        self.latency_s += SHARE * (age_s - self.latency_s)
        return ""

    def refuse(self, reason: str) -> str:
        """Count a sample that cannot be used, and return the reason."""
        self._refused = self._refused[0] + 1, reason
        return reason

    @property
    def known(self) -> bool:
        """Whether a sample was ever taken."""
        return self._known is not None

    def age_s(self, t_s: float) -> float:
        """Return the time since the newest sample that was taken, infinite before the first one."""
        return math.inf if self._known is None else t_s - self._known.t_s

    def clock_stepped(self, by_s: float) -> None:
        """Go on with a clock that was stepped: a sample stays as old as it was."""
        if self._known is not None:
            self._known = self._known._replace(t_s=self._known.t_s + by_s)

    def lost(self, t_s: float) -> str:
        """Return "" or for how long the attitude of the base has not been known."""
        age_s = self.age_s(t_s)
        if age_s <= self.params.coast_s:
            return ""
        since = f"for {age_s:.1f} s" if math.isfinite(age_s) else "yet"
        why = f" ({self._refused[1]})" if self._refused[1] else ""
        return f"no attitude of the base {since}, at most {self.params.coast_s:g} s{why}"

    def at(self, t_s: float) -> "MovingBase":
        """Take the attitude that is predicted for `t_s` for all that is turned from now on."""
        if self._known is not None and self._now.t_s != t_s:
            self._now = now = _ahead(self._known, t_s)
            self._turn = self._chain.T @ now.attitude.T @ self._chain
        return self

    def to_axes(
        self, position: Array, velocity: Array, acceleration: Array
    ) -> tuple[Array, Array, Array]:
        """Return the motion (2,) each of the axes that holds a level one on the base; rates exact.

        The first angle is within half a turn of 0.
        """
        u, du, ddu = (
            each[0] @ self._turn.T
            for each in vectors_of_motion(position[None], velocity[None], acceleration[None])
        )
        w, bend = self._spin @ self._now.rate_rad_s, self._spin @ self._now.acceleration_rad_s2
        along = du - np.cross(w, u)
        curve = ddu - np.cross(bend, u) - np.cross(w, du) - np.cross(w, along)
        found = motion_of_vectors(u[None], along[None], curve[None])
        return found[0][0], found[1][0], found[2][0]

    def to_level(self, position: Array, velocity: Array) -> tuple[Array, Array]:
        """Return the level angles and rates (2,) of axes that move so; undoes `to_axes`."""
        still = np.zeros((1, 2))
        u, du, _ = (each[0] for each in vectors_of_motion(position[None], velocity[None], still))
        du = du + np.cross(self._spin @ self._now.rate_rad_s, u)
        found = motion_of_vectors((u @ self._turn)[None], (du @ self._turn)[None], np.zeros((1, 3)))
        return found[0][0], found[1][0]

    def axes_of(self, level_rad: Array) -> Array:
        """Return the angles (n, 2) of the axes for level ones (n, 2), the first continuous."""
        return _turned(level_rad, self._turn.T)

    def level_of(self, axes_rad: Pair) -> Pair:
        """Return the level angles of the axes, the first within half a turn of 0."""
        azimuth, elevation = _turned(np.array([axes_rad]), self._turn)[0].tolist()
        return azimuth, elevation


def _turned(angles: Array, matrix: Array) -> Array:
    still = np.zeros_like(angles)
    u = vectors_of_motion(angles, still, still)[0] @ matrix
    found = motion_of_vectors(u, np.zeros_like(u), np.zeros_like(u))[0]
    found[:, 0] = np.unwrap(found[:, 0])
    return found


def _ahead(known: BaseState, t_s: float) -> BaseState:
    """Return what a base does after a time: its rates hold for `AHEAD_S`, then they fade."""
    dt_s = t_s - known.t_s
    held_s = min(dt_s, AHEAD_S)
    fades = math.exp(-(dt_s - held_s) / FADING_S)
    rate = known.rate_rad_s + held_s * known.acceleration_rad_s2
    turned = held_s * (known.rate_rad_s + 0.5 * held_s * known.acceleration_rad_s2)
    attitude = known.attitude @ turned_by(turned + FADING_S * (1.0 - fades) * rate)
    bend = known.acceleration_rad_s2 if dt_s <= AHEAD_S else -fades / FADING_S * rate
    return BaseState(t_s, attitude, fades * rate, bend)
