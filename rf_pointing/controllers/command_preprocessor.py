"""Makes any command feasible: steps, gaps and mode changes become slews.

A command that the axis can follow passes through unchanged.  Otherwise the output chases it within
the rate, acceleration and, if given, jerk limits; the rule v = sqrt(2 a d) guards the ends of the
travel.  From outside the travel every motion that does not lead further out is made as it is
commanded.

Without a jerk limit an axis chases with the largest rate from which it can still stop in the
distance that is left, the sampled form of v = sqrt(2 a d).  With one, it chases with the largest
acceleration from which it can: the stop is that of least time, whose deceleration grows, holds and
fades within the limits.
"""

import copy
import math
from dataclasses import asdict, dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike

from rf_pointing.core import Params, as_finite_array, as_finite_pair, parameter, require_between
from rf_pointing.core.types import Array

# A chase brakes with less than the limit: the rest corrects what the target's own acceleration
# takes away.
_MARGIN = 0.8
# Along the way of least time a chase may plan with nearly all.
_SOFT_MARGIN = 0.97
_RAMP_TICKS = 4.0
# Halvings of the accelerations that one step of the jerk limit allows.
_HALVINGS = 30
# A command exactly at a limit, computed twice, must not be called infeasible by its last bit.
_ROUNDING = 1e-9

_AxisMotion = tuple[float, float, float]
"""Position (rad), velocity (rad/s) and acceleration (rad/s^2) of one axis."""


@dataclass(frozen=True, kw_only=True)
class CommandPreprocessorParams(Params):
    """Limits per axis (azimuth, elevation); `jerk_limit_rad_s3` of 0 means no jerk limit.

    They stay below the drive's own (2 deg/s, 1 deg/s^2): what is left of the drive is the loop's,
    to act against wind.  A command at the drive's limit leaves a loop that winds up, overshoots by
    degrees, and can go on swinging.
    """

    rate_limit_rad_s: tuple[float, float] = parameter(
        (math.radians(1.8),) * 2, "largest commanded rates", low=1e-6, high=10.0
    )
    acceleration_limit_rad_s2: tuple[float, float] = parameter(
        (math.radians(0.8),) * 2, "largest commanded accelerations", low=1e-6, high=100.0
    )
    jerk_limit_rad_s3: tuple[float, float] = parameter((0.0, 0.0), "largest jerks, 0 for none", low=0.0, high=1e4)
    travel_min_rad: tuple[float, float] = parameter((-3.9, 0.04), "lower ends of travel", low=-50.0, high=50.0)
    travel_max_rad: tuple[float, float] = parameter((3.9, 1.6), "upper ends of travel", low=-50.0, high=50.0)

    ordered = ("travel_min_rad < travel_max_rad",)

    def check_together(self) -> None:
        """Refuse anything but one value per axis."""
        for name, values in asdict(self).items():
            if len(values) != 2:
                raise ValueError(f"{name}={values} must have 2 values (azimuth, elevation)")


@dataclass(slots=True)
class CommandPreprocessorState:
    """Output (2,), whether it is stopping, and whether each axis passes through."""

    position_rad: Array = field(default_factory=lambda: np.zeros(2))
    velocity_rad_s: Array = field(default_factory=lambda: np.zeros(2))
    acceleration_rad_s2: Array = field(default_factory=lambda: np.zeros(2))
    stopping: bool = False
    transparent: tuple[bool, bool] = (False, False)


@dataclass(frozen=True, slots=True)
class _AxisLimits:
    """Limits of one axis in the order of the parameters; a jerk of 0 stands for no jerk limit."""

    rate: float
    acceleration: float
    jerk: float
    low: float
    high: float


class CommandPreprocessor:
    """Both axes; `reset` to the antenna's motion, then `step` once per tick."""

    def __init__(self, params: CommandPreprocessorParams) -> None:
        self._state = CommandPreprocessorState()
        self.retune(params)

    @property
    def state(self) -> CommandPreprocessorState:
        """A copy of the complete state."""
        return copy.deepcopy(self._state)

    @state.setter
    def state(self, state: CommandPreprocessorState) -> None:
        self._state = copy.deepcopy(state)

    @property
    def stopping(self) -> bool:
        """Whether it decelerates to rest, whatever is commanded."""
        return self._state.stopping

    @property
    def velocity_rad_s(self) -> tuple[float, float]:
        """Rates of the latest step."""
        first, second = self._state.velocity_rad_s.tolist()
        return first, second

    def retune(self, params: CommandPreprocessorParams) -> None:
        """Take new limits from the next step on."""
        self.params = params
        self._limits = [_AxisLimits(*row) for row in zip(*asdict(params).values(), strict=True)]

    def reset(self, position_rad: ArrayLike, velocity_rad_s: ArrayLike = (0.0, 0.0)) -> None:
        """Start from the antenna's own position and velocity (2,), following the command."""
        position = as_finite_array("position_rad", position_rad, (2,)).copy()
        velocity = as_finite_array("velocity_rad_s", velocity_rad_s, (2,)).copy()
        # Without the acceleration: the axes' own is noise of the encoders.
        self._state = CommandPreprocessorState(position, velocity)

    def stop(self) -> None:
        """Decelerate both axes at their limits and stay there."""
        self._state.stopping = True

    def follow(self) -> None:
        """End a stop: chase the command again."""
        self._state.stopping = False

    def step(
        self, position_rad: ArrayLike, velocity_rad_s: ArrayLike, acceleration_rad_s2: ArrayLike, dt_s: float
    ) -> tuple[Array, Array, Array]:
        """Return the feasible position, velocity, acceleration (2,) at the end of this `dt_s`.

        Raises
        ------
        ValueError
            For a non-finite command or `dt_s` outside [1e-4, 1] s.
        """
        if not 1e-4 <= dt_s <= 1.0:
            require_between("dt_s", dt_s, 1e-4, 1.0)
        position = as_finite_pair("position_rad", position_rad)
        velocity = as_finite_pair("velocity_rad_s", velocity_rad_s)
        acceleration = as_finite_pair("acceleration_rad_s2", acceleration_rad_s2)
        state, moved, transparent = self._state, [], [False, False]
        before = state.position_rad.tolist(), state.velocity_rad_s.tolist(), state.acceleration_rad_s2.tolist()
        for axis, limits in enumerate(self._limits):
            now = before[0][axis], before[1][axis], before[2][axis]
            target = (position[axis], velocity[axis], acceleration[axis])
            if not limits.low <= now[0] <= limits.high:
                # Outside its travel an axis stays where it is, or comes in; it never starts by
                # itself.
                limits = replace(limits, low=min(limits.low, now[0]), high=max(limits.high, now[0]))
            if state.stopping:
                moved.append(_halt(now, limits, dt_s))
            else:
                transparent[axis] = _reachable(now, target, limits, dt_s)
                moved.append(target if transparent[axis] else _chase(now, target, limits, dt_s))
        motion = np.array(moved).T
        state.position_rad, state.velocity_rad_s, state.acceleration_rad_s2 = motion
        state.transparent = (transparent[0], transparent[1])
        # Every step makes new arrays and writes into none, so the caller may keep these.
        return motion[0], motion[1], motion[2]


def _reachable(now: _AxisMotion, target: _AxisMotion, limits: _AxisLimits, dt_s: float) -> bool:
    """Return whether a cubic leads to the target within this step, all limits and the travel."""
    if not limits.low <= target[0] <= limits.high or not -limits.rate <= target[1] <= limits.rate:
        return False
    # The acceleration of a cubic is linear in time, so its largest value is at one of the two ends.
    moved = 6.0 * (target[0] - now[0])
    first = (moved - (4.0 * now[1] + 2.0 * target[1]) * dt_s) / dt_s**2
    last = ((2.0 * now[1] + 4.0 * target[1]) * dt_s - moved) / dt_s**2
    most = limits.acceleration + _ROUNDING
    if not (-most <= first <= most and -most <= last <= most and -most <= target[2] <= most):
        return False
    room = limits.high - target[0] if target[1] > 0.0 else target[0] - limits.low
    # A command that runs into the end of the travel is cut while there is still room to stop.
    if _stop_distance(target[1], limits, dt_s) > room:
        return False
    return limits.jerk == 0.0 or abs(target[2] - now[2]) <= limits.jerk * dt_s + _ROUNDING


def _chase(now: _AxisMotion, target: _AxisMotion, limits: _AxisLimits, dt_s: float) -> _AxisMotion:
    """Return the motion after one step towards a target that cannot be reached in it."""
    if not limits.low <= target[0] <= limits.high:
        # The end of the travel is a place to rest: chased at the target's rate it would be left
        # again at once.
        target = (min(max(target[0], limits.low), limits.high), 0.0, 0.0)
    margin = _MARGIN if limits.jerk == 0.0 else _SOFT_MARGIN
    left = max(limits.acceleration - abs(target[2]), (1.0 - _MARGIN) * limits.acceleration)
    braking = margin * left
    if limits.jerk > 0.0:
        return _advance(now, _soft_acceleration(now, target, braking, limits, dt_s), limits, dt_s)
    gap = target[0] - target[1] * dt_s - now[0]
    side = math.copysign(1.0, gap)
    # Measured from where the target was at the start of this step, both at its rate.
    closing = _stoppable_rate(abs(gap), side * (now[1] - target[1]), braking, dt_s)
    return _advance(now, (target[1] + side * closing - now[1]) / dt_s, limits, dt_s)


def _halt(now: _AxisMotion, limits: _AxisLimits, dt_s: float) -> _AxisMotion:
    """Return the motion after one step of a controlled stop."""
    wanted = -now[1] / dt_s if limits.jerk == 0.0 else _fading(-now[1], limits.jerk, dt_s)
    return _advance(now, wanted, limits, dt_s)


def _advance(now: _AxisMotion, wanted: float, limits: _AxisLimits, dt_s: float) -> _AxisMotion:
    """Return the motion after one step at the acceleration `wanted`, within the limits."""
    acceleration = min(max(wanted, -limits.acceleration), limits.acceleration)
    if limits.jerk > 0.0:
        change = limits.jerk * dt_s
        acceleration = min(max(acceleration, now[2] - change), now[2] + change)
    velocity = min(max(now[1] + acceleration * dt_s, -limits.rate), limits.rate)
    # Only now the ends of the travel: they come before the jerk limit and before what was wanted.
    velocity = min(velocity, _stoppable_rate(limits.high - now[0], now[1], limits.acceleration, dt_s))
    velocity = max(velocity, -_stoppable_rate(now[0] - limits.low, -now[1], limits.acceleration, dt_s))
    change = limits.acceleration * dt_s
    velocity = min(max(velocity, now[1] - change), now[1] + change)
    return now[0] + 0.5 * (now[1] + velocity) * dt_s, velocity, (velocity - now[1]) / dt_s


def _stop_distance(velocity: float, limits: _AxisLimits, dt_s: float) -> float:
    """Return the distance to rest: whole steps of braking at the limit, then a weaker one."""
    speed, brake = abs(velocity), limits.acceleration * dt_s
    whole = math.floor(speed / brake)
    rest = speed - whole * brake
    return dt_s * (0.5 * whole * whole * brake + whole * rest + 0.5 * rest)


def _stoppable_rate(distance: float, rate: float, braking: float, dt_s: float) -> float:
    """Return the largest rate after this step from which the axis stops within `distance`.

    With k whole steps of braking and a weaker last one, this step and the stop together take
    v dt/2 + a dt^2 k (k + 1)/2 + (k + 1) dt rest: piecewise linear in the rate, solved for it.
    """
    left = (distance - 0.5 * rate * dt_s) / (braking * dt_s * dt_s)
    if left <= 0.0:
        return 0.0
    whole = math.floor(0.5 * (math.sqrt(1.0 + 8.0 * left) - 1.0))
    return braking * dt_s * (whole + (left - 0.5 * whole * (whole + 1)) / (whole + 1))


def _soft_acceleration(
    now: _AxisMotion, target: _AxisMotion, braking: float, limits: _AxisLimits, dt_s: float
) -> float:
    """Return the largest acceleration of this step after which the axis stops at the target."""
    # A ramp takes some ticks at least: in a single one it would be missed.
    jerk = min(_SOFT_MARGIN * limits.jerk, braking / (_RAMP_TICKS * dt_s))
    rate = now[1] - target[1] + target[2] * dt_s
    gap = target[0] - now[0] - target[1] * dt_s + 0.5 * target[2] * dt_s**2
    change = limits.jerk * dt_s
    least = max(now[2] - change, -limits.acceleration)
    most = min(now[2] + change, limits.acceleration)
    # Where it stops grows with the acceleration.  The steps of a ramp lie on it in their middles.
    for _ in range(_HALVINGS):
        middle = 0.5 * (least + most)
        pull = middle - target[2]
        gained = 0.5 * pull * dt_s
        way = 0.5 * (rate + 0.5 * gained) * dt_s + _soft_stop(rate + gained, pull, braking, jerk)
        least, most = (middle, most) if way < gap else (least, middle)
    ends = (_fading(end - now[1], limits.jerk, dt_s) for end in (-limits.rate, limits.rate))
    slowest, fastest = ends
    return min(max(0.5 * (least + most), slowest), fastest)


def _soft_stop(rate: float, acceleration: float, braking: float, jerk: float) -> float:
    """Return the way to rest in least time: the deceleration grows, holds and fades."""
    side = math.copysign(1.0, rate + 0.5 * acceleration * abs(acceleration) / jerk)
    rate, acceleration = side * rate, side * acceleration
    brake = min(math.sqrt(max(0.5 * acceleration**2 + jerk * rate, 0.0)), braking)
    if brake == 0.0:
        return 0.0
    first = abs(acceleration + brake) / jerk
    bend = -math.copysign(jerk, acceleration + brake)
    held = rate + (acceleration + 0.5 * bend * first) * first
    way = (rate + (0.5 * acceleration + bend * first / 6.0) * first) * first
    hold = max(held - 0.5 * brake**2 / jerk, 0.0) / brake
    return side * (way + (held - 0.5 * brake * hold) * hold + brake**3 / (6.0 * jerk**2))


def _fading(change: float, jerk: float, dt_s: float) -> float:
    """Return the acceleration that, held for a step and then fading, changes the rate so much."""
    return math.copysign(jerk * (math.sqrt(dt_s**2 + 2.0 * abs(change) / jerk) - dt_s), change)
