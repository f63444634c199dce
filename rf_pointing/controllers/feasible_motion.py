"""One axis, one step: the fastest motion towards a moving target that stays within rate, acceleration and jerk.

Without a jerk limit the axis chases with the largest rate from which it can still stop in the way that is left, the
sampled form of v = sqrt(2 a d).  With one, the same curve is followed with less deceleration and ends in a straight
line, along which the deceleration fades within the jerk limit.
"""

import math
from dataclasses import dataclass

__all__ = ["AxisLimits", "AxisMotion", "chase", "halt", "reachable"]

_MARGIN = 0.8
_JERK_MARGIN = 0.6
_ROUNDING = 1e-9

AxisMotion = tuple[float, float, float]
"""Position (rad), velocity (rad/s) and acceleration (rad/s^2) of one axis."""


@dataclass(frozen=True, slots=True)
class AxisLimits:
    """Limits of one axis; a jerk of 0 stands for no jerk limit."""

    rate: float
    acceleration: float
    jerk: float
    low: float
    high: float


def reachable(now: AxisMotion, target: AxisMotion, limits: AxisLimits, dt_s: float) -> bool:
    """Say whether a cubic leads to the target within this step and all limits, with room to stop before the travel."""
    if not limits.low <= target[0] <= limits.high or abs(target[1]) > limits.rate:
        return False
    moved = 6.0 * (target[0] - now[0])
    first = (moved - (4.0 * now[1] + 2.0 * target[1]) * dt_s) / dt_s**2
    last = ((2.0 * now[1] + 4.0 * target[1]) * dt_s - moved) / dt_s**2
    if max(abs(first), abs(last), abs(target[2])) > limits.acceleration + _ROUNDING:
        return False
    room = limits.high - target[0] if target[1] > 0.0 else target[0] - limits.low
    if _stop_distance(target[1], limits, dt_s) > room:
        return False
    return limits.jerk == 0.0 or abs(target[2] - now[2]) <= limits.jerk * dt_s + _ROUNDING


def chase(now: AxisMotion, target: AxisMotion, limits: AxisLimits, dt_s: float) -> AxisMotion:
    """Return the motion after one step towards a target that cannot be reached in it."""
    if not limits.low <= target[0] <= limits.high:
        target = (min(max(target[0], limits.low), limits.high), 0.0, 0.0)
    braking = _MARGIN * max(limits.acceleration - abs(target[2]), (1.0 - _MARGIN) * limits.acceleration)
    gap = target[0] - target[1] * dt_s - now[0]
    side = math.copysign(1.0, gap)
    if limits.jerk > 0.0:
        return _advance(now, _soft_acceleration(now, target, gap, braking, limits, dt_s), limits, dt_s)
    closing = _stoppable_rate(abs(gap), side * (now[1] - target[1]), braking, dt_s)
    return _advance(now, (target[1] + side * closing - now[1]) / dt_s, limits, dt_s)


def halt(now: AxisMotion, limits: AxisLimits, dt_s: float) -> AxisMotion:
    """Return the motion after one step of a controlled stop."""
    if limits.jerk == 0.0:
        return _advance(now, -now[1] / dt_s, limits, dt_s)
    settle = min(abs(now[1]) / dt_s, math.sqrt(2.0 * _JERK_MARGIN * limits.jerk * abs(now[1])))
    return _advance(now, -math.copysign(settle, now[1]), limits, dt_s)


def _advance(now: AxisMotion, wanted: float, limits: AxisLimits, dt_s: float) -> AxisMotion:
    """Apply the acceleration `wanted` within the limits; the end of the travel comes before the jerk limit."""
    acceleration = min(max(wanted, -limits.acceleration), limits.acceleration)
    if limits.jerk > 0.0:
        change = limits.jerk * dt_s
        acceleration = min(max(acceleration, now[2] - change), now[2] + change)
    velocity = min(max(now[1] + acceleration * dt_s, -limits.rate), limits.rate)
    velocity = min(velocity, _stoppable_rate(limits.high - now[0], now[1], limits.acceleration, dt_s))
    velocity = max(velocity, -_stoppable_rate(now[0] - limits.low, -now[1], limits.acceleration, dt_s))
    change = limits.acceleration * dt_s
    velocity = min(max(velocity, now[1] - change), now[1] + change)
    return now[0] + 0.5 * (now[1] + velocity) * dt_s, velocity, (velocity - now[1]) / dt_s


def _stop_distance(velocity: float, limits: AxisLimits, dt_s: float) -> float:
    """Return the way to rest with one constant acceleration per step: whole steps at the limit, then a weaker one."""
    speed, brake = abs(velocity), limits.acceleration * dt_s
    whole = math.floor(speed / brake)
    rest = speed - whole * brake
    return dt_s * (0.5 * whole * whole * brake + whole * rest + 0.5 * rest)


def _stoppable_rate(distance: float, rate: float, braking: float, dt_s: float) -> float:
    """Return the largest rate at the end of this step from which the axis can still stop within `distance`.

    With k whole steps of braking and a weaker last one, this step and the stop together take
    v dt/2 + a dt^2 k (k + 1)/2 + (k + 1) dt rest: piecewise linear in the rate, solved for it.
    """
    left = (distance - 0.5 * rate * dt_s) / (braking * dt_s * dt_s)
    if left <= 0.0:
        return 0.0
    whole = math.floor(0.5 * (math.sqrt(1.0 + 8.0 * left) - 1.0))
    return braking * dt_s * (whole + (left - 0.5 * whole * (whole + 1)) / (whole + 1))


def _soft_acceleration(
    now: AxisMotion, target: AxisMotion, gap: float, braking: float, limits: AxisLimits, dt_s: float
) -> float:
    """Return the acceleration that follows the soft approach curve: its own slope plus a pull back onto it."""
    braking *= _JERK_MARGIN
    steepness = 0.25 * limits.jerk / braking
    knee = braking / steepness**2
    distance = abs(gap)
    if distance < knee:
        closing, slope = steepness * distance, steepness
    else:
        closing = math.sqrt(2.0 * braking * (distance - 0.5 * knee))
        slope = braking / closing
    wanted = target[1] + math.copysign(closing, gap)
    along = target[2] - (now[1] - target[1]) * slope if abs(wanted) < limits.rate else 0.0
    error = min(max(wanted, -limits.rate), limits.rate) - now[1]
    pull = min(3.0 * steepness, 0.45 / dt_s)
    strength = _JERK_MARGIN * limits.jerk
    turn = strength / pull**2
    size = abs(error)
    back = pull * size if size < turn else math.sqrt(2.0 * strength * (size - 0.5 * turn))
    return along + math.copysign(back, error)
