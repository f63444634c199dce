"""An antenna at rest in the path of the Sun: when it will be in the beam, and where to turn.

The Sun moves by 15 deg an hour; an antenna that stands, or moves slower than that, is overtaken by
it.  The entry into the zone is found along the Sun's path ahead.  The place to turn to is the one
that the axes reach first of all that stay clear for `clear_s`, by a way that the safety gate
allows.
"""

import math
from dataclasses import dataclass

import numpy as np

from rf_pointing.core import Array, Pair, Params, parameter, utc_text
from rf_pointing.ephemeris.solar import PATH_STEP_S, SolarDirection
from rf_pointing.planning import Gate
from rf_pointing.planning.forbidden_sky import EARTH_RATE_RAD_S, angle_between

# Axes slower than this are overtaken by the Sun.
AT_REST_RAD_S = 0.5 * EARTH_RATE_RAD_S
# Time between two looks at the Sun's path.
EVERY_S = 1.0
# The place to turn to is so much further from the Sun than its zone reaches.
MARGIN_RAD = math.radians(0.1)
# Directions, and places in each beyond the zone, that are looked at for one to turn to.
BEARINGS, STEPS, FARTHEST_RAD = 16, 24, math.radians(20.0)
# Places whose way is looked for: each costs milliseconds of a control tick.
TRIED = 20


@dataclass(frozen=True, kw_only=True)
class SunAtRestParams(Params):
    """Warning and escape of an antenna at rest into whose beam the Sun drifts."""

    escapes: bool = parameter(True, "whether it turns away by itself; false: it only warns")
    warning_s: float = parameter(300.0, "it warns so long before", 10.0, 3600.0)
    escape_s: float = parameter(60.0, "it turns away so long before", 0.0, 3600.0)
    clear_s: float = parameter(1800.0, "where it turns to stays clear for so long", 60.0, 14400.0)

    @property
    def span_s(self) -> float:
        """Time for which the path of the Sun is looked at."""
        return max(self.warning_s, self.clear_s)

    def check_together(self) -> None:
        """Refuse a warning that comes after the motion."""
        if self.escape_s > self.warning_s:
            raise ValueError(f"escape_s={self.escape_s} must be <= {self.warning_s}, warning_s")


@dataclass(frozen=True, slots=True)
class SunEntry:
    """Entry of the Sun into its zone about a direction at rest, and how near it comes."""

    t_s: float
    nearest_rad: float
    radius_rad: float

    @property
    def text(self) -> str:
        """Say when, how near, and the bound; the same words each second until it is there."""
        return (
            f"the Sun comes to {math.degrees(self.nearest_rad):.1f} deg from the antenna at rest, "
            f"must be >= {math.degrees(self.radius_rad):.3f} deg (sun.radius_deg), "
            f"from {utc_text(self.t_s)[:19]} on"
        )


def sun_entry(
    sun: SolarDirection, radius_rad: float, params: SunAtRestParams, direction: Pair, t_s: float
) -> SunEntry | None:
    """Return the entry of the Sun about a direction at rest, None if it is not due to be warned of.

    While it is permitted only what follows the end of the permission counts.
    """
    if radius_rad == 0.0:
        return None
    times, path = sun.ahead(t_s, params.span_s)
    apart = angle_between(path, np.array(direction))
    permit = sun.permitted(t_s)
    inside = np.flatnonzero((apart < radius_rad) & (times >= (permit.until_t_s if permit else t_s)))
    if not len(inside):
        return None
    first = int(inside[0])
    entry_s = float(times[first])
    if first > 0 and apart[first - 1] >= radius_rad:
        before, after = float(apart[first - 1]), float(apart[first])
        entry_s -= (radius_rad - after) / (before - after) * PATH_STEP_S
    if entry_s > t_s + params.warning_s:
        return None
    return SunEntry(entry_s, float(apart[inside].min()), radius_rad)


def way_out(gate: Gate, kind: str, here: Pair, path: Array) -> tuple[Pair, tuple[Pair, ...]] | None:
    """Return the place that is reached first of those clear of a path (n, 2) of the Sun.

    With the corners of the way to it; None if the gate allows none.
    """
    clear_rad = gate.params.sun_radius_rad + MARGIN_RAD
    bearing = np.arange(BEARINGS) * (math.tau / BEARINGS)
    # Close to the edge of the zone first, then in growing steps.
    steps = np.geomspace(0.2 * clear_rad, 2.0 * clear_rad + FARTHEST_RAD, STEPS)
    wide = 1.0 / max(abs(math.cos(here[1])), 0.05)
    right, up = np.outer(steps, wide * np.sin(bearing)), np.outer(steps, np.cos(bearing))
    places = np.array(here) + np.column_stack([right.ravel(), up.ravel()])
    apart = angle_between(places[:, None, :], path[None, :, :]).min(axis=1)
    ends: list[Pair] = list(map(tuple, places[apart >= clear_rad].tolist()))
    sun = (float(path[0, 0]), float(path[0, 1]))
    ends = [each for each in ends if not gate.position(*each, here, sun)]
    near = sorted(ends, key=lambda end: gate.axes.slew_s(here, end))
    for end in near[:TRIED]:
        found = gate.check(kind, here, np.array([end]), sun_rad=sun)
        if found.allowed:
            return end, found.way
    return None
