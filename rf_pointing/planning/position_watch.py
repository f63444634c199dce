"""Watch of a device that moves to positions by itself: what it reads against what it was sent.

Three things are no longer the device's own, with thresholds from its resolution q, its speed v and
the time P between two readings:

* a jump: a reading further than 1.5 v dt + 2 q from the one before, dt the longest time that may
  lie between them.  One is bridged, the second in a row is a fault;
* a motion that was not commanded: away from the range between where it was and its set point, by
  more than 2 q and what it moves in P and the latency;
* a standstill: no step while the set point is two steps or the dead band away, of a device at rest
  for `still_s` and twice P (at least `busy_s`) beyond the latency.  One that has moved that way in
  the last second has its motor running: it must show a step within the latency and twice P, or two
  steps of its speed.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from rf_pointing.core import AXES, Pair

JUMP = 1.5
STEPS = 2.0
RUNNING_S = 1.0
"""Between two set points of a motion a device may stand so long."""
FAR_STEPS = 2.1
"""Two steps between set point and read-back are normal, not a stall."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PositionLimits:
    """Limits of the device's own motion, per axis."""

    resolution_rad: Pair
    rate_rad_s: Pair
    dead_band_rad: Pair = (0.0, 0.0)
    period_s: float = 0.2
    still_s: float = 1.0
    busy_s: float = 0.4
    """Least time that a moving device may stand: a set point may wait on a busy computer."""


class _Axis:
    """One axis: trusted reading, allowed range, and since when it stands still."""

    def __init__(self, t_s: float, angle: float, set_point: float | None, within_s: float) -> None:
        self.t_s = self.still_since_s = self.moved_s = t_s
        self.trusted, self.within_s = angle, within_s
        self.bad = False
        self.moved = 0.0
        self.lead_to(set_point, angle)

    def lead_to(self, set_point: float | None, angle: float) -> None:
        """Allow what lies from `angle` to a new set point; None: it was stopped."""
        goal = angle if set_point is None else set_point
        self.low, self.high, self.set_point = min(angle, goal), max(angle, goal), set_point


class PositionWatch:
    """Both axes, of these names; `step` at every new reading."""

    def __init__(self, limits: PositionLimits, names: Sequence[str] = AXES) -> None:
        self.limits, self._names = limits, names
        self.reset()

    def reset(self) -> None:
        """Trust the next reading as it comes."""
        self._axes: list[_Axis | None] = [None, None]
        self.reason = ""

    @property
    def doubted(self) -> bool:
        """Whether an axis is bridged: its newest reading is not confirmed yet."""
        return any(axis is not None and axis.bad for axis in self._axes)

    def step(
        self, t_s: float, position_rad: Pair, set_point_rad: tuple[float | None, float | None],
        latency_s: float, within_s: float = 0.0,
    ) -> tuple[Pair, str]:  # fmt: skip
        """Return the angles to use, bridged where one jumped, and "" or what is wrong.

        `set_point_rad` are those in force, None for an axis that was stopped.  The angles were
        measured within +-`within_s` of `t_s`.
        """
        used, found = [], []
        for index, name in enumerate(self._names):
            angle, reason = self._check(index, t_s, position_rad[index], set_point_rad[index], latency_s, within_s)
            used.append(angle)
            if reason:
                found.append(f"{name} {reason}")
        self.reason = "; ".join(found)
        return (used[0], used[1]), self.reason

    def _check(
        self, index: int, t_s: float, angle: float, set_point: float | None, latency_s: float, within_s: float
    ) -> tuple[float, str]:
        limits, axis = self.limits, self._axes[index]
        step, rate = limits.resolution_rad[index], limits.rate_rad_s[index]
        if axis is None:
            self._axes[index] = _Axis(t_s, angle, set_point, within_s)
            return angle, ""
        away = angle - axis.trusted
        # Written so that NaN counts as a jump.
        apart_s = max(t_s - axis.t_s, 0.0) + axis.within_s + within_s
        axis.within_s = within_s
        reach = JUMP * rate * apart_s + STEPS * step
        if not abs(away) <= reach:
            if not axis.bad:
                axis.bad = True
                return axis.trusted, ""
            # From the second on this is where the device says it is: a reset goes on from there.
            axis.bad, axis.t_s, axis.trusted = False, t_s, angle
            axis.low = axis.high = angle
            return angle, (
                f"encoder jumped by {math.degrees(away):.2f} deg in {apart_s:.2f} s, at most {math.degrees(reach):.2f} deg"
            )
        axis.bad = False
        moved = abs(away) >= 0.99 * step
        margin = STEPS * step + rate * (latency_s + limits.period_s)
        far = max(FAR_STEPS * step, limits.dead_band_rad[index] + step)
        arrived = axis.set_point is None or abs(axis.set_point - angle) <= far
        if moved:
            axis.moved_s, axis.moved = t_s, away
        # New set points come all the time: only one for a device that had arrived begins anew.
        if moved or arrived:
            # At the latest: while this process was held up, it neither read nor sent a set point.
            axis.still_since_s = t_s + max(0.0, within_s - limits.period_s)
        if set_point != axis.set_point:
            # The margin covers what is left of the motion before.
            axis.lead_to(set_point, angle)
        axis.t_s, axis.trusted = t_s, angle
        if not axis.low - margin <= angle <= axis.high + margin:
            past = max(axis.low - angle, angle - axis.high)
            if not moved:
                # As after a jump: one that stands there can be reset.
                axis.low = axis.high = angle
            return angle, (
                f"moves without a command, {math.degrees(past):.2f} deg beyond its set point, "
                f"at most {math.degrees(margin):.2f} deg"
            )
        if set_point is not None:
            off = abs(set_point - angle)
            still_s = t_s - axis.still_since_s
            running = axis.still_since_s - axis.moved_s <= RUNNING_S and (set_point - angle) * axis.moved > 0.0
            polls_s = max(2.0 * limits.period_s, limits.busy_s)
            start_s = latency_s + (max(polls_s, 2.0 * step / rate) if running else limits.still_s + polls_s)
            if off > far and still_s > start_s:
                return angle, (
                    f"stands still for {still_s:.2f} s, at most {start_s:.2f} s, "
                    f"{math.degrees(off):.2f} deg from its set point"
                )
        return angle, ""
