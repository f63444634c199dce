"""The gate: one function says of every motion that it is allowed, or which limit it breaks and by how much.

Tiers of the travel: the warning begins `warning_rad` inside a soft limit, commands end at the soft limit, the drives are cut
`hard_rad` beyond it.  From outside, every motion that does not go further out stays allowed.  Along the way to a position the
axes move side by side, each at its own rate, so the path between two points bends; the horizon mask and the Sun are held
against that path, not against its ends.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rf_pointing.geometry import Params, parameter, require_choice, require_finite
from rf_pointing.planning.limits import AxisLimits
from rf_pointing.planning.mask import HorizonMask

__all__ = ["MOTIONS", "Decision", "Gate", "GateParams"]

Array = NDArray[np.float64]

MOTIONS = ("track", "slew", "preset", "unwind", "park", "stow", "scan", "flip", "calibration", "manual")
TO_SAFETY = ("stow",)
"""Motions that go on in high wind and through the Sun's zone: to leave the antenna out would do more harm."""
BETWEEN_POINTS = ("slew", "preset", "unwind", "park", "stow", "flip")
PATH_STEP_RAD = math.radians(0.25)
CLEARANCE_RAD = math.radians(0.5)
AXES = ("azimuth", "elevation")
ROUNDING_RAD = 1e-9


@dataclass(frozen=True, kw_only=True)
class GateParams(Params):
    """Width of the tiers, and the zones of the sky."""

    warning_rad: float = parameter(math.radians(2.0), "the warning begins this far inside a limit", low=0.0, high=0.5)
    hard_rad: float = parameter(math.radians(0.25), "the drives are cut this far beyond a limit", low=1e-4, high=0.5)
    sun_radius_rad: float = parameter(math.radians(1.0), "the beam stays this far from the Sun", low=0.0, high=0.5)
    transmit_elevation_rad: float = parameter(
        math.radians(10.0), "lowest elevation at which the transmitter may be on", low=-0.2, high=1.6
    )
    rate_limit_rad_s: tuple[float, float] = parameter((0.036, 0.036), "largest commanded rates", low=1e-6, high=10.0)
    deceleration_rad_s2: tuple[float, float] = parameter(
        (0.0175, 0.0175), "decelerations that can be relied on", low=1e-6, high=100.0
    )


@dataclass(frozen=True, slots=True)
class Decision:
    """Whether a motion may be made; if not, `reason` names the limit and by how much, else it may carry a warning.

    `way` are the corners (n, 2) by which a slew must go, empty for the straight way.
    """

    allowed: bool
    reason: str = ""
    way: tuple[tuple[float, float], ...] = ()

    @property
    def reason_of_refusal(self) -> str:
        """The reason of a motion that is not allowed, "" of one that is."""
        return "" if self.allowed else self.reason


class Gate:
    """Limits, horizon and Sun of one antenna."""

    def __init__(self, params: GateParams, limits: AxisLimits, mask: HorizonMask) -> None:
        self.params, self.limits, self.mask = params, limits, mask
        self._low = (limits.azimuth_min_rad, limits.elevation_min_rad)
        self._high = (limits.azimuth_max_rad, limits.elevation_max_rad)

    def check(
        self,
        kind: str,
        present_rad: tuple[float, float],
        positions: Array,
        velocities: Array | None = None,
        sun_rad: tuple[float, float] | None = None,
        high_wind: str = "",
    ) -> Decision:
        """Answer for a motion of one of `MOTIONS` from `present_rad` through `positions` (n, 2).

        A motion between points is taken from the present position to each of them in turn, with a detour where the
        straight way is barred; another one must be allowed at every position and rate (n, 2) that it names.
        """
        require_choice("kind", kind, MOTIONS)
        require_finite("positions", positions)
        if high_wind and kind not in TO_SAFETY:
            return Decision(False, high_wind)
        sun = None if kind in TO_SAFETY else sun_rad
        for index, (azimuth, elevation) in enumerate(positions.tolist()):
            reason = self.position(azimuth, elevation, present_rad, sun)
            if not reason and velocities is not None:
                reason = self._rates(azimuth, elevation, velocities[index].tolist(), present_rad)
            if reason:
                return Decision(False, reason)
        if kind in BETWEEN_POINTS:
            return self._between(present_rad, positions, sun)
        return Decision(True, self.warning(float(positions[-1, 0]), float(positions[-1, 1])))

    def position(
        self,
        azimuth_rad: float,
        elevation_rad: float,
        present_rad: tuple[float, float] | None = None,
        sun_rad: tuple[float, float] | None = None,
    ) -> str:
        """Return "" when the position may be commanded, else which limit it breaks and by how much."""
        for axis, wanted in enumerate((azimuth_rad, elevation_rad)):
            low, high = self._low[axis], self._high[axis]
            if present_rad is not None:
                low, high = min(low, present_rad[axis]), max(high, present_rad[axis])
            if not low <= wanted <= high:
                bound, past = (low, low - wanted) if wanted < low else (high, wanted - high)
                return (
                    f"{AXES[axis]} {math.degrees(wanted):.3f} deg is {math.degrees(past):.3f} deg "
                    f"past the limit {math.degrees(bound):.3f} deg"
                )
        under = self._under_mask(azimuth_rad, elevation_rad)
        if under > 0.0 and (present_rad is None or under > self._under_mask(*present_rad) + ROUNDING_RAD):
            return (
                f"elevation {math.degrees(elevation_rad):.3f} deg at azimuth {math.degrees(azimuth_rad):.1f} deg is "
                f"{math.degrees(under):.3f} deg below the horizon mask"
            )
        if sun_rad is not None and self.params.sun_radius_rad > 0.0:
            near = self._sun_distance(azimuth_rad, elevation_rad, sun_rad)
            outward = present_rad is not None and near >= self._sun_distance(*present_rad, sun_rad) - ROUNDING_RAD
            if near < self.params.sun_radius_rad and not outward:
                return (
                    f"{math.degrees(near):.3f} deg from the Sun, must be >= "
                    f"{math.degrees(self.params.sun_radius_rad):.3f} deg"
                )
        return ""

    def warning(self, azimuth_rad: float, elevation_rad: float) -> str:
        """Return "" or how near to which limit the position is; plain floats, for a control tick."""
        for axis, angle in enumerate((azimuth_rad, elevation_rad)):
            left = min(angle - self._low[axis], self._high[axis] - angle)
            if left < self.params.warning_rad:
                near = (
                    f"{math.degrees(left):.2f} deg inside" if left >= 0.0 else f"{-math.degrees(left):.2f} deg beyond"
                )
                return f"{AXES[axis]} {near} its limit"
        return ""

    def hard(self, azimuth_rad: float, elevation_rad: float, azimuth_rate: float, elevation_rate: float) -> str:
        """Return "" or which hard limit the axes are past and still running out of; plain floats, for a control tick."""
        reach = self.params.hard_rad
        for axis, (angle, rate) in enumerate(((azimuth_rad, azimuth_rate), (elevation_rad, elevation_rate))):
            over, under = angle - self._high[axis] - reach, self._low[axis] - reach - angle
            if (over > 0.0 and rate > 0.0) or (under > 0.0 and rate < 0.0):
                bound = self._high[axis] + reach if over > 0.0 else self._low[axis] - reach
                return (
                    f"{AXES[axis]} {math.degrees(angle):.3f} deg is {math.degrees(max(over, under)):.3f} deg past the "
                    f"hard limit {math.degrees(bound):.3f} deg"
                )
        return ""

    def transmit_inhibit(self, elevation_rad: float) -> str:
        """Return "" when the transmitter may be on at this elevation, else why not."""
        lowest = self.params.transmit_elevation_rad
        over = min(elevation_rad, math.pi - elevation_rad)
        if over >= lowest:
            return ""
        return f"elevation {math.degrees(over):.2f} deg is below the {math.degrees(lowest):.2f} deg for transmitting"

    def path(self, start_rad: tuple[float, float], end_rad: tuple[float, float]) -> Array:
        """Return the positions (n, 2) that a slew runs through: both axes at their own rates until each is there."""
        rates = self.params.rate_limit_rad_s
        times = [abs(b - a) / rate for a, b, rate in zip(start_rad, end_rad, rates, strict=True)]
        length = max(abs(end_rad[0] - start_rad[0]), abs(end_rad[1] - start_rad[1]))
        t = np.linspace(0.0, max(times), max(2, math.ceil(length / PATH_STEP_RAD) + 1))
        shares = [np.minimum(t / time, 1.0) if time > 0.0 else np.ones_like(t) for time in times]
        return np.column_stack([a + (b - a) * s for a, b, s in zip(start_rad, end_rad, shares, strict=True)])

    def _between(
        self, present_rad: tuple[float, float], positions: Array, sun_rad: tuple[float, float] | None
    ) -> Decision:
        way: list[tuple[float, float]] = []
        here, detour = present_rad, False
        for goal in positions.tolist():
            found = self._route(here, (goal[0], goal[1]), sun_rad)
            if isinstance(found, str):
                return Decision(False, found)
            detour = detour or len(found) > 1
            way += found
            here = (goal[0], goal[1])
        return Decision(True, self.warning(*here), tuple(way) if detour else ())

    def _route(
        self, start: tuple[float, float], end: tuple[float, float], sun: tuple[float, float] | None
    ) -> list[tuple[float, float]] | str:
        """Return the corners to go by, the end included, or why there is no way: the straight one, else the quickest
        detour that moves the azimuth at another elevation."""
        straight = self._barred(start, end, sun)
        if not straight:
            return [end]
        heights = [start[1], end[1], float(np.max(self.mask.lowest_all(self.path(start, end)[:, 0]))) + CLEARANCE_RAD]
        if sun is not None:
            beyond = self.params.sun_radius_rad + CLEARANCE_RAD
            heights += [sun[1] - beyond, sun[1] + beyond]
        heights += np.linspace(self._low[1], self._high[1], 8).tolist()
        ways = []
        for height in heights:
            corners = [(start[0], height), (end[0], height), end]
            if not self._low[1] <= height <= self._high[1]:
                continue
            legs = list(zip([start, *corners[:-1]], corners, strict=True))
            if not any(self._barred(a, b, sun) for a, b in legs):
                ways.append((sum(self._time_s(a, b) for a, b in legs), corners))
        return min(ways)[1] if ways else f"{straight} on the way, and no detour is free"

    def _barred(self, start: tuple[float, float], end: tuple[float, float], sun: tuple[float, float] | None) -> str:
        path = self.path(start, end)
        under = self.mask.lowest_all(path[:, 0]) - path[:, 1]
        worst = int(np.argmax(under))
        if under[worst] > max(0.0, self._under_mask(*start)) + ROUNDING_RAD:
            return (
                f"elevation {math.degrees(path[worst, 1]):.3f} deg at azimuth {math.degrees(path[worst, 0]):.1f} deg is "
                f"{math.degrees(under[worst]):.3f} deg below the horizon mask"
            )
        if sun is not None and self.params.sun_radius_rad > 0.0:
            near = np.array([self._sun_distance(a, e, sun) for a, e in path.tolist()])
            if near.min() < min(self.params.sun_radius_rad, near[0] - ROUNDING_RAD):
                return (
                    f"{math.degrees(near.min()):.3f} deg from the Sun, must be >= "
                    f"{math.degrees(self.params.sun_radius_rad):.3f} deg"
                )
        return ""

    def _time_s(self, start: tuple[float, float], end: tuple[float, float]) -> float:
        rates = self.params.rate_limit_rad_s
        return max(abs(b - a) / rate for a, b, rate in zip(start, end, rates, strict=True))

    def _rates(self, azimuth: float, elevation: float, rates: list[float], present_rad: tuple[float, float]) -> str:
        """Refuse a rate above the axis's, or one from which the axis cannot stop before its limit: v^2 <= 2 a d."""
        for axis, (angle, rate) in enumerate(zip((azimuth, elevation), rates, strict=True)):
            limit = self.params.rate_limit_rad_s[axis]
            if abs(rate) > limit:
                fast, most = math.degrees(rate), math.degrees(limit)
                return f"{AXES[axis]} rate {fast:.3f} deg/s exceeds the axis limit {most:.3f} deg/s"
            bound = max(self._high[axis], present_rad[axis]) if rate > 0.0 else min(self._low[axis], present_rad[axis])
            needed = rate**2 / (2.0 * self.params.deceleration_rad_s2[axis])
            left = abs(bound - angle)
            if needed > left + ROUNDING_RAD:
                return (
                    f"{AXES[axis]} rate {math.degrees(rate):.3f} deg/s needs {math.degrees(needed):.3f} deg to stop, "
                    f"{math.degrees(left):.3f} deg are left to the limit {math.degrees(bound):.3f} deg"
                )
        return ""

    def _under_mask(self, azimuth_rad: float, elevation_rad: float) -> float:
        """Return how far a direction is below the horizon, negative above it; over the top the other side counts."""
        if elevation_rad > 0.5 * math.pi:
            azimuth_rad, elevation_rad = azimuth_rad + math.pi, math.pi - elevation_rad
        return self.mask.lowest_rad(azimuth_rad) - elevation_rad

    @staticmethod
    def _sun_distance(azimuth_rad: float, elevation_rad: float, sun_rad: tuple[float, float]) -> float:
        rise, turn = 0.5 * (elevation_rad - sun_rad[1]), 0.5 * (azimuth_rad - sun_rad[0])
        half = math.sin(rise) ** 2 + math.cos(elevation_rad) * math.cos(sun_rad[1]) * math.sin(turn) ** 2
        return 2.0 * math.asin(math.sqrt(min(max(half, 0.0), 1.0)))
