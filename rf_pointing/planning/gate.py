"""The safety gate: whether a motion is allowed, or which limit it breaks and by how much.

The travel has tiers: the warning begins `warning_rad` inside a soft limit, commands end at the soft
limit, the drives are cut `hard_rad` beyond it.  From outside, every motion that does not go further
out stays allowed.  On the path to a position both axes move at once, each at its own rate, so the
path between two points bends; the horizon mask and the Sun are checked along that path, not at its
ends.
"""

import math
from dataclasses import dataclass

from rf_pointing.core import Array, Pair, Params, parameter, require_choice, require_finite
from rf_pointing.core.kinematics import LEVEL, Kinematics
from rf_pointing.planning.forbidden_sky import ForbiddenSky
from rf_pointing.planning.horizon import HorizonMask
from rf_pointing.planning.limits import AxisLimits, AxisRates
from rf_pointing.planning.slew import HALTING_SHARES, PathFinder

# The words that a motion may be called by, on the wire too.
MOTIONS = ("track", "slew", "preset", "unwind", "park", "stow", "scan", "flip", "calibration", "manual")
# Motions that go on in high wind and through the Sun's zone: to leave the antenna out would do
# more harm.
TO_SAFETY = ("stow",)
# The antenna finds the path of these itself; the others come as tables, checked point by point.
BETWEEN_POINTS = ("slew", "preset", "unwind", "park", "stow", "flip")
# A profile that brakes exactly at the limit must not fail by its rounding.
ROUNDING_RAD = 1e-9
# What a control tick lets pass beyond a limit before it stops the axes: rounding, and the
# corrections of a loop.
GUARD_RAD = math.radians(0.05)


@dataclass(frozen=True, kw_only=True)
class GateParams(Params):
    """Width of the tiers, and the zones of the sky."""

    warning_rad: float = parameter(math.radians(2.0), "the warning begins this far inside a limit", 0.0, 0.5)
    hard_rad: float = parameter(math.radians(0.25), "the drives are cut this far beyond a limit", 1e-4, 0.5)
    sun_radius_rad: float = parameter(math.radians(1.0), "the beam stays this far from the Sun", 0.0, 0.5)
    transmit_elevation_rad: float = parameter(
        math.radians(10.0), "lowest elevation at which the transmitter may be on", -0.2, 1.6
    )


@dataclass(frozen=True, slots=True)
class Decision:
    """Decision of the safety gate: the `reason` why a motion may not be made, with the excess.

    A motion without a reason against it may carry a `warning` of a limit nearby.  `way` holds the
    corners (n, 2) by which a slew must go, empty for the straight path.
    """

    reason: str = ""
    warning: str = ""
    way: tuple[Pair, ...] = ()

    @property
    def allowed(self) -> bool:
        """Whether the motion may be made."""
        return not self.reason


def motion_between(encoder_rad: Pair, goal_rad: Pair) -> str:
    """Return what a slew is: a flip over the top, an unwinding of the cables, or a plain slew."""
    if (encoder_rad[1] > 0.5 * math.pi) != (goal_rad[1] > 0.5 * math.pi):
        return "flip"
    return "unwind" if abs(goal_rad[0] - encoder_rad[0]) > math.pi else "slew"


class Gate:
    """Limits, horizon and Sun of one antenna whose axes move at `axes`' rates.

    All directions are angles of the axes of its `mount`, those of the Sun too.
    """

    def __init__(
        self, params: GateParams, limits: AxisLimits, mask: HorizonMask, axes: AxisRates, mount: Kinematics = LEVEL
    ) -> None:
        self.params, self.limits, self.mask, self.axes, self.mount = params, limits, mask, axes, mount
        self._low, self._high = limits.lowest_rad, limits.highest_rad
        self._sky = ForbiddenSky(mask, params.sun_radius_rad, mount)
        self._paths = PathFinder(self._sky, axes, (self._low, self._high))

    def check(
        self, kind: str, encoder_rad: Pair, positions: Array, velocities: Array | None = None,
        sun_rad: Pair | None = None, high_wind: str = "",
    ) -> Decision:  # fmt: skip
        """Answer for a motion of one of `MOTIONS` from `encoder_rad` through `positions` (n, 2).

        A motion between points is taken from the present position to each of them in turn, with a
        detour where the straight way is barred; another one must be allowed at every position and
        rate (n, 2) that it names.
        """
        require_choice("kind", kind, MOTIONS)
        require_finite("positions", positions)
        # In high wind nothing but the way to stow is allowed, however safe it is otherwise.
        if high_wind and kind not in TO_SAFETY:
            return Decision(high_wind)
        sun = None if kind in TO_SAFETY else sun_rad
        # Most trajectories are far from every limit: one comparison instead of one per point.
        doubtful_rad = [] if velocities is None and self._all_clear(positions, sun) else positions.tolist()
        for index, (azimuth, elevation) in enumerate(doubtful_rad):
            reason = self.position(azimuth, elevation, encoder_rad, sun)
            if not reason and velocities is not None:
                reason = self._rates(azimuth, elevation, velocities[index].tolist(), encoder_rad)
            if reason:
                return Decision(reason)
        if kind in BETWEEN_POINTS:
            return self._between(encoder_rad, positions, sun)
        return Decision(warning=self.warning(float(positions[-1, 0]), float(positions[-1, 1])))

    def _all_clear(self, positions: Array, sun_rad: Pair | None) -> bool:
        """Return whether all positions (n, 2) are within the limits and at zone-free elevations."""
        least, most = positions.min(axis=0).tolist(), positions.max(axis=0).tolist()
        rows = zip(self._low, least, most, self._high, strict=True)
        within = all(low <= lowest and highest <= high for low, lowest, highest, high in rows)
        return within and self._sky.clear(least[1], most[1], sun_rad)

    def slew(self, encoder_rad: Pair, goal_rad: Pair, sun_rad: Pair | None = None) -> tuple[float, str]:
        """Return the time from rest to rest by a free path, and "" or why no path is free."""
        found = self._paths.find(encoder_rad, goal_rad, sun_rad)
        corners = [goal_rad] if isinstance(found, str) else found
        # Without a free path the straight time is still the best guess for a certificate's table.
        legs = zip([encoder_rad, *corners[:-1]], corners, strict=True)
        return sum(self.axes.slew_s(a, b) for a, b in legs), found if isinstance(found, str) else ""

    def chase(self, positions: Array, rates: Array, target: Array, sun_rad: Pair | None = None) -> str:
        """Return "" or what axes at these positions and rates (n, 2) run into after a target."""
        return self._paths.barred(positions, rates, target, sun_rad)

    def position(
        self, azimuth_rad: float, elevation_rad: float, encoder_rad: Pair | None = None,
        sun_rad: Pair | None = None, tolerance_rad: float = 0.0,
    ) -> str:  # fmt: skip
        """Return "" when the position may be commanded, else the reason; plain floats."""
        return self.limits.reason(
            azimuth_rad, elevation_rad, encoder_rad, tolerance_rad, self.mount.axes
        ) or self._sky.reason(azimuth_rad, elevation_rad, encoder_rad, sun_rad, tolerance_rad)

    def guard(self, kind: str, encoder_rad: Pair, next_rad: Pair, rate_rad_s: Pair, sun_rad: Pair | None = None) -> str:
        """Return "" or what axes at `next_rad` after this tick, at these rates, would run into.

        The deceleration cone of travel, horizon and Sun: v |v| / 2a ahead of the axes must still be
        allowed.  Plain floats.
        """
        # A check when a command arrives is not what moves: a table is carried on for a second, or
        # followed late.  So every tick looks at where the axes would come to rest.
        (first, second), (azimuth, elevation), (_, limits) = rate_rad_s, next_rad, self.axes
        stop = first * abs(first) / (2.0 * limits[0]), second * abs(second) / (2.0 * limits[1])
        sun = None if kind in TO_SAFETY else sun_rad
        there = azimuth + stop[0], elevation + stop[1]
        (left, bottom), (right, top) = self._low, self._high
        inside = left <= azimuth <= right and left <= there[0] <= right and bottom <= elevation <= top
        low, high = (elevation, there[1]) if elevation <= there[1] else (there[1], elevation)
        if inside and bottom <= there[1] <= top and self._sky.clear(low, high, sun):
            return ""
        # Both axes brake at once, each from its own rate, so the path to rest bends.
        for share in HALTING_SHARES:
            azimuth, elevation = next_rad[0] + share * stop[0], next_rad[1] + share * stop[1]
            reason = self.position(azimuth, elevation, encoder_rad, sun, GUARD_RAD)
            if reason:
                return f"{kind} would not come to rest in time: {reason}"
        return ""

    def warning(self, azimuth_rad: float, elevation_rad: float) -> str:
        """Return "" or how near to which limit the position is; plain floats."""
        for axis, angle in enumerate((azimuth_rad, elevation_rad)):
            left = min(angle - self._low[axis], self._high[axis] - angle)
            if left < self.params.warning_rad:
                near = (
                    f"{math.degrees(left):.2f} deg inside" if left >= 0.0 else f"{-math.degrees(left):.2f} deg beyond"
                )
                return f"{self.mount.axes[axis]} {near} its limit"
        return ""

    def hard(self, joint_rad: Pair, rate_rad_s: Pair, released_rad: Pair | None = None) -> str:
        """Return "" or the hard limit that the axes are past and still leaving; plain floats.

        Axes that `released_rad` beyond it when they were released may swing there, and leave by
        themselves.
        """
        (low, bottom), (high, top), hard_rad = self._low, self._high, self.params.hard_rad
        if low - hard_rad <= joint_rad[0] <= high + hard_rad and bottom - hard_rad <= joint_rad[1] <= top + hard_rad:
            return ""
        for axis, (angle, rate) in enumerate(zip(joint_rad, rate_rad_s, strict=True)):
            name = self.mount.axes[axis]
            low, high = self._low[axis] - hard_rad, self._high[axis] + hard_rad
            # Brakes that let go beyond a limit would otherwise trip on the swing they cause.
            if released_rad is not None:
                low, high = min(low, released_rad[axis] - GUARD_RAD), max(high, released_rad[axis] + GUARD_RAD)
            if (angle > high and rate > 0.0) or (angle < low and rate < 0.0):
                bound = high if angle > high else low
                return (
                    f"{name} {math.degrees(angle):.3f} deg is {math.degrees(abs(angle - bound)):.3f} deg past the "
                    f"hard limit {math.degrees(bound):.3f} deg"
                )
        return ""

    def sun_in_beam(self, azimuth_rad: float, elevation_rad: float, sun_rad: Pair | None) -> str:
        """Return "" or how far inside its zone the Sun is; plain floats."""
        return self._sky.near_sun(azimuth_rad, elevation_rad, sun_rad)

    def too_low_to_send(self, first_rad: float, elevation_rad: float) -> str:
        """Return "" when the transmitter may be on at these angles of the axes, else why not."""
        lowest = self.params.transmit_elevation_rad
        if not self.mount.level:
            elevation_rad = self.mount.sky_at(first_rad, elevation_rad)[1]
        # Over the top the horizon is as near as on this side.
        over = min(elevation_rad, math.pi - elevation_rad)
        if over >= lowest:
            return ""
        return f"elevation {math.degrees(over):.2f} deg is below the {math.degrees(lowest):.2f} deg for transmitting"

    def _between(self, encoder_rad: Pair, positions: Array, sun_rad: Pair | None) -> Decision:
        way: list[Pair] = []
        here, detour = encoder_rad, False
        for goal in positions.tolist():
            found = self._paths.find(here, (goal[0], goal[1]), sun_rad)
            if isinstance(found, str):
                return Decision(found)
            detour = detour or len(found) > 1
            way += found
            here = (goal[0], goal[1])
        return Decision(warning=self.warning(*here), way=tuple(way) if detour else ())

    def _rates(self, azimuth: float, elevation: float, rates: list[float], encoder_rad: Pair) -> str:
        """Return why a rate is too fast for the axis, or to stop in time: v^2 <= 2 a d."""
        for axis, (angle, rate) in enumerate(zip((azimuth, elevation), rates, strict=True)):
            limit, name = self.axes.rate_rad_s[axis], self.mount.axes[axis]
            if abs(rate) > limit:
                fast, most = math.degrees(rate), math.degrees(limit)
                return f"{name} rate {fast:.3f} deg/s exceeds the axis limit {most:.3f} deg/s"
            bound = max(self._high[axis], encoder_rad[axis]) if rate > 0.0 else min(self._low[axis], encoder_rad[axis])
            needed = rate**2 / (2.0 * self.axes.acceleration_rad_s2[axis])
            left = abs(bound - angle)
            if needed > left + ROUNDING_RAD:
                return (
                    f"{name} rate {math.degrees(rate):.3f} deg/s needs {math.degrees(needed):.3f} deg to stop, "
                    f"{math.degrees(left):.3f} deg are left to the limit {math.degrees(bound):.3f} deg"
                )
        return ""
