"""Passes of a target over a site: rise, closest approach, set, and what they require.

Elevation is cut at its turning points, which are the roots of the elevation rate; between two of
them it is monotonic, so each crossing of the mask is bracketed and none is missed that the step of
the search resolves.  A horizon that depends on the azimuth cuts the stays above its lowest point
again, at a step of a second (longer in stays of hours): every stay above it is a pass.
"""

import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from rf_pointing.core import require_between
from rf_pointing.core.dates import utc_text
from rf_pointing.core.roots import roots_between
from rf_pointing.core.types import Array
from rf_pointing.ephemeris.look_angles import LookAngles
from rf_pointing.ephemeris.track import TopocentricTrack

# Lowest elevation (n,) at azimuths (n,) on any turn.
Horizon = Callable[[Array], Array]

# A stay of less than 30 s between two turning points is not a pass that anyone would track.
_STEP_S = 30.0
_TIME_TOLERANCE_S = 1e-4
_PROFILE_STEP_S = 1.0
_PROFILE_POINTS = 5000
_HORIZON_POINTS, _HORIZON_MARGIN_RAD = 3601, 0.01
# How far back the rise of a pass that is going on is looked for: a low orbit's, then any other's.
_LOOK_BACK_S = (3600.0, 43200.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Pass:
    """One stay above the mask; angles apparent, azimuths continuous over the pass.

    `rises_before` and `sets_after` tell that the pass runs on beyond the searched interval, where
    it is cut off.
    """

    name: str
    aos_t_s: float
    tca_t_s: float
    los_t_s: float
    peak_elevation_rad: float
    aos_azimuth_rad: float
    aos_elevation_rad: float
    los_azimuth_rad: float
    azimuth_min_rad: float
    azimuth_max_rad: float
    peak_azimuth_rate_rad_s: float
    peak_elevation_rate_rad_s: float
    peak_azimuth_acceleration_rad_s2: float
    smallest_range_m: float
    rises_before: bool
    sets_after: bool

    @property
    def duration_s(self) -> float:
        """Time above the mask."""
        return self.los_t_s - self.aos_t_s

    @property
    def crosses_north(self) -> bool:
        """Whether the azimuth passes north, where a 0-360 deg display jumps."""
        return bool(np.floor(self.azimuth_min_rad / (2 * np.pi)) != np.floor(self.azimuth_max_rad / (2 * np.pi)))


def find_passes(
    track: TopocentricTrack, start_t_s: float, duration_s: float, min_elevation_rad: float | Horizon
) -> list[Pass]:
    """Return the passes above an elevation or a horizon (apparent) in a time, in time order.

    Times are found to 0.1 ms.  A pass that is going on at either end is cut off there and says so.
    A target is searched where it is known: an ephemeris without its gaps, a decaying object to its
    end.  A search that lies outside all of it is an error.
    """
    require_between("duration_s", duration_s, 1.0, None)
    parts = _known(track, start_t_s, duration_s)
    return [found for part in parts for found in _passes_of(track, *part, min_elevation_rad)]


def _passes_of(
    track: TopocentricTrack, start_t_s: float, duration_s: float, min_elevation_rad: float | Horizon
) -> list[Pass]:
    """Return the passes in a time for which the target is known throughout."""
    # A horizon by azimuth is searched in two stages: above its lowest point, then above itself.
    if callable(min_elevation_rad):
        horizon, flat_rad = min_elevation_rad, _below(min_elevation_rad)
        require_between("min_elevation_rad", flat_rad, -0.2, np.pi / 2)
    else:
        horizon, flat_rad = None, min_elevation_rad
        require_between("min_elevation_rad", flat_rad, -0.01, np.pi / 2)
    grid = np.linspace(start_t_s, start_t_s + duration_s, int(np.ceil(duration_s / _STEP_S)) + 1)
    turning = _sign_changes(track, track.sample(grid), "elevation_rate_rad_s")
    knots = np.concatenate([grid[:1], turning, grid[-1:]])
    elevation = track.sample(knots).elevation_rad
    above = elevation > flat_rad
    change = np.flatnonzero(above[1:] != above[:-1])
    crossings = roots_between(
        lambda t_s: track.sample(t_s).elevation_rad - flat_rad, knots[change], knots[change + 1], _TIME_TOLERANCE_S
    )
    rises = np.concatenate([knots[:1][above[:1]], crossings[above[change + 1]]]).tolist()
    sets = np.concatenate([crossings[above[change]], knots[-1:][above[-1:]]]).tolist()
    stays = [stay for stay in zip(rises, sets, strict=True) if stay[1] > stay[0]]
    if horizon is not None:
        stays = [part for stay in stays for part in _stays_above(track, *stay, horizon, knots)]
    return [_pass(track, a, b, knots, elevation) for a, b in stays]


def _below(horizon: Horizon) -> float:
    """Return an elevation below all of a horizon, so that every crossing of it is found."""
    return float(np.min(horizon(np.linspace(0.0, 2.0 * np.pi, _HORIZON_POINTS)))) - _HORIZON_MARGIN_RAD


def _stays_above(
    track: TopocentricTrack, rise_s: float, set_s: float, horizon: Horizon, knots: Array
) -> list[tuple[float, float]]:
    """Return the parts of a stay above the horizon's lowest point that are above the horizon."""
    # With the turning points, so that a short peak above a hill is not stepped over.
    times = np.unique(np.concatenate([_even(rise_s, set_s), knots[(knots > rise_s) & (knots < set_s)]]))

    def height(t_s: Array) -> Array:
        looks = track.sample(t_s)
        return np.asarray(looks.elevation_rad - horizon(looks.azimuth_rad))

    above = height(times) > 0.0
    change = np.flatnonzero(above[1:] != above[:-1])
    edges = roots_between(height, times[change], times[change + 1], _TIME_TOLERANCE_S).tolist()
    ends = [rise_s, *edges, set_s]
    # Between two edges the target is above or below throughout; they alternate.
    inside = [bool(above[0]) == (number % 2 == 0) for number in range(len(ends) - 1)]
    return [(a, b) for (a, b), clear in zip(itertools.pairwise(ends), inside, strict=True) if clear and b > a]


def passes_with_present(
    track: TopocentricTrack, t_s: float, duration_s: float, min_elevation_rad: float | Horizon
) -> list[Pass]:
    """Return the passes as `find_passes`; a pass going on at `t_s` has its own rise."""
    found = find_passes(track, t_s, duration_s, min_elevation_rad)
    if not found or not found[0].rises_before:
        return found
    # A little beyond its set, so that the pass found again is the same one.
    end_s = min(found[0].los_t_s + 2.0 * _STEP_S, t_s + duration_s)
    # First an hour: elements of a low orbit are not propagated half a day for nothing.
    for back_s in _LOOK_BACK_S:
        earlier = find_passes(track, t_s - back_s, back_s + end_s - t_s, min_elevation_rad)
        whole = next(one for one in earlier if one.aos_t_s <= t_s < one.los_t_s)
        if not whole.rises_before:
            return [whole, *found[1:]]
    return found


def first_pass_above(
    track: TopocentricTrack, start_t_s: float, peak_rad: float, min_elevation_rad: float | Horizon, duration_s: float
) -> Pass:
    """Return the first pass after `start_t_s` that peaks at `peak_rad` or higher, or ValueError."""
    passes = find_passes(track, start_t_s, duration_s, min_elevation_rad)
    for found in passes:
        if found.peak_elevation_rad >= peak_rad:
            return found
    # The reason says how near the best one comes: often a lower peak is all that is wanted.
    best = max((p.peak_elevation_rad for p in passes), default=None)
    reached = "none rises above the mask" if best is None else f"the highest reaches {np.degrees(best):.2f} deg"
    raise ValueError(
        f"{track.name} has no pass above {np.degrees(peak_rad):.2f} deg in {duration_s / 3600.0:.2f} h after "
        f"{utc_text(start_t_s)}: {len(passes)} passes, {reached}"
    )


def _known(track: TopocentricTrack, start_t_s: float, duration_s: float) -> list[tuple[float, float]]:
    """Return starts and durations of the parts of a search in which the target is known."""
    ends = [(max(start_t_s, first), min(start_t_s + duration_s, last)) for first, last in track.spans_t_s]
    parts = [(low, high - low) for low, high in ends if high > low]
    if not parts:
        spans = ", ".join(f"{_edge(first)} to {_edge(last)}" for first, last in track.spans_t_s)
        raise ValueError(
            f"the search from {utc_text(start_t_s)} is outside the usable span of {track.name}: {spans or 'none'}"
        )
    return parts


def part_searched(track: TopocentricTrack, start_t_s: float, duration_s: float) -> str:
    """Return "" or the only parts of a search in which the target is known, and why."""
    parts = _known(track, start_t_s, duration_s)
    if sum(length_s for _, length_s in parts) >= duration_s - 1.0:
        return ""
    spans = ", ".join(f"{utc_text(first)} to {utc_text(first + length_s)}" for first, length_s in parts)
    # Elements know every time but those on the ground.
    why = "its elements end there: it decays" if hasattr(track.target, "elements") else "its ephemeris ends there"
    return f"was searched only from {spans}: {why}"


def _edge(t_s: float) -> str:
    return utc_text(t_s) if math.isfinite(t_s) else "any time"


def _pass(track: TopocentricTrack, aos_t_s: float, los_t_s: float, knots: Array, elevation: Array) -> Pass:
    profile = track.sample(_profile_times(track, aos_t_s, los_t_s))
    # The highest point is a turning point, or an end where a hill hides it.
    inside = (knots >= aos_t_s) & (knots <= los_t_s)
    times = np.concatenate([knots[inside], [aos_t_s, los_t_s]])
    heights = np.concatenate([elevation[inside], profile.elevation_rad[[0, -1]]])
    highest = int(np.argmax(heights))
    return Pass(
        name=track.name,
        aos_t_s=aos_t_s,
        tca_t_s=float(times[highest]),
        los_t_s=los_t_s,
        peak_elevation_rad=float(heights[highest]),
        aos_azimuth_rad=float(profile.azimuth_rad[0]),
        aos_elevation_rad=float(profile.elevation_rad[0]),
        los_azimuth_rad=float(profile.azimuth_rad[-1]),
        azimuth_min_rad=float(profile.azimuth_rad.min()),
        azimuth_max_rad=float(profile.azimuth_rad.max()),
        peak_azimuth_rate_rad_s=float(np.abs(profile.azimuth_rate_rad_s).max()),
        peak_elevation_rate_rad_s=float(np.abs(profile.elevation_rate_rad_s).max()),
        peak_azimuth_acceleration_rad_s2=float(np.abs(profile.azimuth_acceleration_rad_s2).max()),
        smallest_range_m=float(profile.range_m.min()),
        rises_before=bool(aos_t_s == knots[0]),
        sets_after=bool(los_t_s == knots[-1]),
    )


def _profile_times(track: TopocentricTrack, aos_t_s: float, los_t_s: float) -> Array:
    """Return even steps plus the instants of the largest rates, for spikes near the zenith."""
    looks = track.sample(_even(aos_t_s, los_t_s))
    names = ("azimuth_acceleration_rad_s2", "elevation_acceleration_rad_s2", "azimuth_rate_rad_s")
    return np.unique(np.concatenate([looks.t_s, *(_sign_changes(track, looks, name) for name in names)]))


def _even(aos_t_s: float, los_t_s: float) -> Array:
    count = int(np.clip(np.ceil((los_t_s - aos_t_s) / _PROFILE_STEP_S) + 1, 2, _PROFILE_POINTS))
    return np.linspace(aos_t_s, los_t_s, count)


def _sign_changes(track: TopocentricTrack, looks: LookAngles, name: str) -> Array:
    """Return the times at which one quantity of `looks` goes through zero between two of them."""
    signs = np.sign(getattr(looks, name))
    change = np.flatnonzero(signs[1:] != signs[:-1])
    low, high = looks.t_s[change], looks.t_s[change + 1]
    return roots_between(lambda t_s: np.asarray(getattr(track.sample(t_s), name)), low, high, _TIME_TOLERANCE_S)
