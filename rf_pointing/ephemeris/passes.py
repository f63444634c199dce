"""Passes of a target over a site: rise, closest approach, set, and what they require.

The motion is interpolated between nodes by position, velocity and acceleration (quintic Hermite).
With 0.4 rad of the orbit from node to node the error is 0.4^6/46080 r, 0.6 m or 0.08 ms in a low
orbit.  Elevation is cut at its turning points; between two of them it is monotonic, so each
crossing of the mask is bracketed and none is missed that the step of the search resolves.  A
horizon that depends on the azimuth cuts the stays above its lowest point again, at a step of a
second (longer in stays of hours): every stay above it is a pass.
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
from rf_pointing.ephemeris.elements import Elements
from rf_pointing.ephemeris.look_angles import angles_and_rates
from rf_pointing.ephemeris.state_vector import StateVector, norm
from rf_pointing.ephemeris.track import TopocentricTrack

# Lowest elevation (n,) at azimuths (n,) on any turn.
Horizon = Callable[[Array], Array]

# A stay of less than 30 s between two turning points is not a pass that anyone would track.
_STEP_S = 30.0
_TIME_TOLERANCE_S = 1e-4
# From node to node of the interpolation, at the fastest place of the orbit; no longer than an hour
# of the turning Earth.
_NODE_RAD, _LONGEST_NODE_S = 0.4, 1200.0
# Points of a pass on either side of its peak, denser towards it by e^5: 0.1 s where it is overhead.
_PROFILE = np.sinh(np.linspace(0.0, 5.0, 41)[1:]) / np.sinh(5.0)
_ORDER = np.arange(1.0, 6.0)
# More than the interpolation is off where the elevation crosses the mask, however slowly.
_LATEST_S = 0.05
_CLOSER = 21
_PROFILE_STEP_S = 1.0
_PROFILE_POINTS = 5000
_HORIZON_POINTS, _HORIZON_MARGIN_RAD = 3601, 0.01
# How far back the rise of a pass that is going on is looked for: a low orbit's, then any other's.
_LOOK_BACK_S = (3600.0, 43200.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Pass:
    """One stay above the mask; angles apparent, azimuths continuous over the pass.

    `rises_before` and `sets_after` tell that the pass runs on beyond the searched interval, where
    it is cut off.  `smallest_range_m` leaves out the motion of the site during the light's
    travel, 3 m in a low orbit.
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
    motion = _Motion.of(track, start_t_s, duration_s)
    air = track.refraction
    sine = math.sin(float(air.remove(flat_rad)) if air else flat_rad)
    grid, height, rate = motion.grid(_STEP_S)
    # A turning point that the tangents keep on one side of the mask cuts nothing.
    step_s = grid[1] - grid[0]
    turns = np.flatnonzero((rate[1:] > 0.0) != (rate[:-1] > 0.0))
    reach = height[turns] + rate[turns] * step_s, height[turns + 1] - rate[turns + 1] * step_s
    turns = turns[np.where(rate[turns] > 0.0, np.maximum(*reach) > sine, np.minimum(*reach) < sine)]
    between = grid[turns], grid[turns + 1]
    turning = roots_between(lambda t_s: motion.height(t_s)[1], *between, _TIME_TOLERANCE_S)
    peaks = turning[rate[turns] > 0.0]
    knots = np.insert(grid, turns + 1, turning)
    heights = np.insert(height, turns + 1, motion.height(turning)[0]) - sine
    above = heights > 0.0
    change = np.flatnonzero(above[1:] != above[:-1])
    around = (knots[change], knots[change + 1]), (heights[change], heights[change + 1])
    crossings = _crossings(track, motion, sine, *around)
    rises = np.concatenate([knots[:1][above[:1]], crossings[above[change + 1]]]).tolist()
    sets = np.concatenate([crossings[above[change]], knots[-1:][above[-1:]]]).tolist()
    stays = [stay for stay in zip(rises, sets, strict=True) if stay[1] > stay[0]]
    if horizon is not None:
        stays = [part for stay in stays for part in _stays_above(track, *stay, horizon, peaks)]
    ends = float(grid[0]), float(grid[-1])
    return _described(track, motion, stays, peaks, ends)


@dataclass(frozen=True, eq=False)
class _Motion:
    """Motion from the site between even nodes: coefficients (n, 6, 3), east-north-up, metres."""

    start_t_s: float
    step_s: float
    coefficients: Array

    @classmethod
    def of(cls, track: TopocentricTrack, start_t_s: float, duration_s: float) -> "_Motion":
        count = math.ceil(duration_s / _node_step_s(track)) + 1
        times = np.linspace(start_t_s, start_t_s + duration_s, max(count, 2))
        h = float(times[1] - times[0])
        held = track.hold_t_s is not None
        seen = track.relative_motion_at(np.full_like(times, track.hold_t_s) if held else times)[0]
        still = 0.0 if held else 1.0
        p, v, a = (
            np.stack(np.broadcast_arrays(*part), axis=-1) * scale
            for part, scale in ((seen.position, 1.0), (seen.velocity, h * still), (seen.acceleration, h * h * still))
        )
        first, gained = 0.5 * a[:-1], v[1:] - v[:-1] - a[:-1]
        moved, bent = p[1:] - p[:-1] - v[:-1] - first, a[1:] - a[:-1]
        rest = (10.0 * moved - 4.0 * gained + 0.5 * bent, -15.0 * moved + 7.0 * gained - bent,
                6.0 * moved - 3.0 * gained + 0.5 * bent)  # fmt: skip
        return cls(start_t_s, h, np.stack([p[:-1], v[:-1], first, *rest], axis=1))

    def at(self, t_s: Array, orders: int) -> list[Array]:
        """Return position (3, n) and its first derivatives, `orders` in all."""
        place = (t_s - self.start_t_s) / self.step_s
        node = np.minimum(np.maximum(place, 0.0).astype(np.int64), len(self.coefficients) - 1)
        here = self.coefficients[node]
        return [
            np.einsum("nk,nkc->cn", basis, here) / self.step_s**order
            for order, basis in enumerate(_bases(place - node, orders))
        ]

    def grid(self, step_s: float) -> tuple[Array, Array, Array]:
        """Return even times, nodes among them, no more than `step_s` apart, and `height` there."""
        count, parts = len(self.coefficients), math.ceil(self.step_s / step_s)
        steps = np.arange(count * parts + 1, dtype=np.float64)
        times = self.start_t_s + self.step_s / parts * steps
        bases = _bases(np.arange(parts) / parts, 2)
        even = [np.moveaxis(basis @ self.coefficients, -1, 0).reshape(3, -1) for basis in bases]
        ends = self.at(times[-1:], 2)
        position, velocity = (
            np.concatenate([inside / self.step_s**order, end], axis=1)
            for order, (inside, end) in enumerate(zip(even, ends, strict=True))
        )
        return times, *_height(position, velocity)

    def height(self, t_s: Array) -> tuple[Array, Array]:
        """Return the sine of the true elevation and its rate, 1/s."""
        position, velocity = self.at(t_s, 2)
        return _height(position, velocity)


def _bases(s: Array, orders: int) -> list[Array]:
    """Return the powers (n, 6) of `s` and their derivatives, `orders` in all."""
    powers = np.ones((len(s), 6))
    for k in range(1, 6):
        powers[:, k] = powers[:, k - 1] * s
    found = [powers]
    for _ in range(1, orders):
        slope = np.zeros_like(powers)
        slope[:, 1:] = found[-1][:, :-1] * _ORDER
        found.append(slope)
    return found


def _height(position: Array, velocity: Array) -> tuple[Array, Array]:
    square = np.einsum("cn,cn->n", position, position)
    away = np.einsum("cn,cn->n", position, velocity)
    length = np.sqrt(square)
    return np.asarray(position[2] / length), (velocity[2] - position[2] * away / square) / length


def _crossings(
    track: TopocentricTrack, motion: _Motion, sine: float, ends: tuple[Array, Array], heights: tuple[Array, Array]
) -> Array:
    """Return where the height crosses the mask between `ends` (n,), above it by `heights` there."""
    low, high = ends
    if not len(low):
        return low
    crossings = low + (high - low) * heights[0] / (heights[0] - heights[1])
    # The track has the last word: a low pass crosses slowly, and the interpolation is off by more.
    for of, times in ((motion.height, 2), (lambda t_s: _exact_height(track, t_s), 1)):
        for _ in range(times):
            height, rate = of(crossings)
            late_s = (height - sine) / np.where(rate == 0.0, 1e-30, rate)
            crossings = np.minimum(np.maximum(crossings - late_s, low), high)
    if np.all(np.abs(late_s) < _LATEST_S):
        return crossings
    # Newton's steps went astray near a peak at the mask.
    exact = lambda t_s: _exact_height(track, t_s)[0] - sine  # noqa: E731
    return roots_between(exact, low, high, _TIME_TOLERANCE_S)


def _exact_height(track: TopocentricTrack, t_s: Array) -> tuple[Array, Array]:
    seen = track.relative_motion_at(t_s)[0]
    return _height(np.array(seen.position), np.array(seen.velocity))


def _node_step_s(track: TopocentricTrack) -> float:
    elements = getattr(track.target, "elements", None)
    if not isinstance(elements, Elements) or track.hold_t_s is not None:
        return _STEP_S
    e = elements.eccentricity
    fastest_rad_s: float = elements.mean_motion_rad_s * (1.0 + e) ** 2 / (1.0 - e * e) ** 1.5
    return min(_NODE_RAD / fastest_rad_s, _LONGEST_NODE_S)


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


def _described(
    track: TopocentricTrack, motion: _Motion, stays: list[tuple[float, float]], peaks: Array, ends: tuple[float, float]
) -> list[Pass]:
    """Return the stays with their extremes, all sampled together."""
    if not stays:
        return []
    rows, highest = [], []
    for rise_s, set_s in stays:
        inside = peaks[(peaks > rise_s) & (peaks < set_s)]
        places = np.concatenate([inside, [rise_s, set_s]])
        top = float(places[np.argmax(motion.height(places)[0])])
        highest.append(top)
        # Where the peak is an end, half of the points coincide there.
        before, after = (rise_s - top) * _PROFILE[::-1], (set_s - top) * _PROFILE
        rows.append(top + np.concatenate([before, [0.0], after]))
    times = np.array(rows)
    found = _angles(track, _state(motion, times.ravel()))
    azimuth, elevation, *rates, length = (one.reshape(times.shape) for one in found)
    # The ends are where an antenna waits: of the track itself.
    ends_s = times[:, [0, -1]]
    exact = _angles(track, track.relative_motion_at(ends_s.ravel())[0])
    azimuth[:, [0, -1]], elevation[:, [0, -1]] = (one.reshape(ends_s.shape) for one in exact[:2])
    azimuth = np.unwrap(azimuth, axis=1)
    azimuth += 2.0 * np.pi * (azimuth[:, :1] < 0.0)
    # Rates peak where their derivative, nearly straight between two points, goes through zero.
    turning = [np.nonzero((one[:, 1:] > 0.0) != (one[:, :-1] > 0.0)) for one in rates[2:]]
    at = [
        times[place] + np.diff(times)[place] * one[place] / (one[place] - one[:, 1:][place])
        for one, place in zip(rates[2:], turning, strict=True)
    ]
    # The acceleration is looked at more closely around its largest value.
    number = np.arange(len(times))
    largest = np.clip(np.argmax(np.abs(rates[2]), axis=1), 1, times.shape[1] - 2)
    around = times[number, largest - 1], times[number, largest + 1]
    at.append(np.linspace(*around, _CLOSER).ravel())
    most = np.abs(np.array(rates)).max(axis=2)
    _, _, *further, _ = _angles(track, _state(motion, np.concatenate(at)))
    row = np.concatenate([*(place[0] for place in turning), np.tile(number, _CLOSER)])
    for peak, values in zip(most, further, strict=True):
        np.maximum.at(peak, row, np.abs(values))
    extremes = zip(stays, highest, azimuth, elevation, most.T.tolist(), length.min(axis=1).tolist(), strict=True)
    return [
        Pass(
            name=track.name, aos_t_s=rise_s, tca_t_s=top, los_t_s=set_s,
            peak_elevation_rad=float(up[len(_PROFILE)]), aos_azimuth_rad=float(around[0]),
            aos_elevation_rad=float(up[0]), los_azimuth_rad=float(around[-1]),
            azimuth_min_rad=float(around.min()), azimuth_max_rad=float(around.max()),
            peak_azimuth_rate_rad_s=peak[0], peak_elevation_rate_rad_s=peak[1],
            peak_azimuth_acceleration_rad_s2=peak[2], smallest_range_m=nearest,
            rises_before=rise_s == ends[0], sets_after=set_s == ends[1],
        )
        for (rise_s, set_s), top, around, up, peak, nearest in extremes
    ]  # fmt: skip


def _state(motion: _Motion, times: Array) -> StateVector:
    position, velocity, acceleration = ((v[0], v[1], v[2]) for v in motion.at(times, 3))
    return StateVector(position, velocity, acceleration, position)


def _angles(track: TopocentricTrack, seen: StateVector) -> list[Array]:
    """Return azimuth, apparent elevation, their rates and accelerations, and distance [m]."""
    azimuth, up, turning, rate, bend, rise = angles_and_rates(seen)
    if track.refraction is not None:
        up, rate, rise = track.refraction.apply_with_rates(up, rate, rise)
    return [azimuth, up, turning, rate, bend, rise, norm(seen.position)]


def _even(aos_t_s: float, los_t_s: float) -> Array:
    count = int(np.clip(np.ceil((los_t_s - aos_t_s) / _PROFILE_STEP_S) + 1, 2, _PROFILE_POINTS))
    return np.linspace(aos_t_s, los_t_s, count)
