"""Passes of a target over a site: rise, closest approach, set, and what they require.

The motion is interpolated between nodes by position, velocity and acceleration (quintic Hermite).
With 0.5 rad of the orbit from node to node the error is 0.5^6/46080 r, 2.4 m or 0.3 ms in a low
orbit; ends and peak are those of the track itself.  The search is that of `stays_above`; a horizon
is looked at in steps of a second (longer in stays of hours).
"""

import math
from dataclasses import dataclass

import numpy as np

from rf_pointing.core import Array, BoolArray, Pair, require_between, utc_text
from rf_pointing.ephemeris.elements import Elements
from rf_pointing.ephemeris.look_angles import angles_and_rates
from rf_pointing.ephemeris.state_vector import StateVector, norm, rows_of
from rf_pointing.ephemeris.stays import Horizon, SkyMotion, Stays, height_of, mask_of, parts_above, stays_above
from rf_pointing.ephemeris.track import TopocentricTrack

# A stay of less than 30 s between two turning points is not a pass that anyone would track.
_STEP_S = 30.0
# From node to node of the interpolation, at the fastest place of the orbit; no longer than an hour
# of the turning Earth.
_NODE_RAD, _LONGEST_NODE_S = 0.5, 1200.0
_TURN = 2.0 * np.pi
# Points of a pass on either side of its peak, denser towards it by e^5: 0.1 s where it is overhead.
_PROFILE = np.sinh(np.linspace(0.0, 5.0, 41)[1:]) / np.sinh(5.0)
# Coefficients of the third to fifth power, from what position, velocity and acceleration lack.
_QUINTIC = np.array([[10.0, -4.0, 0.5], [-15.0, 7.0, -1.0], [6.0, -3.0, 0.5]])
# More than the interpolation is off where the elevation crosses the mask, however slowly.
_LATEST_S, _MOST_EXACT = 0.05, 5
_CLOSER = np.linspace(0.0, 1.0, 21)[:, np.newaxis]
_PROFILE_STEP_S = 1.0
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
    horizon, sine = mask_of(min_elevation_rad, track.refraction)
    motion = _motion(track, start_t_s, duration_s)
    stays = stays_above(motion, sine, _STEP_S)
    if horizon is None:
        return _described(track, motion, stays, sine)

    def clearance(t_s: Array) -> Array:
        looks = track.sample(t_s)
        return np.asarray(looks.elevation_rad - horizon(looks.azimuth_rad))

    return _described(track, motion, parts_above(stays, clearance, _PROFILE_STEP_S), None)


def _motion(track: TopocentricTrack, start_t_s: float, duration_s: float) -> SkyMotion:
    count = math.ceil(duration_s / _node_step_s(track)) + 1
    times = np.linspace(start_t_s, start_t_s + duration_s, max(count, 2))
    h = float(times[1] - times[0])
    p, v, a = (part * h**k for k, part in enumerate(_seen(track, times)[0]))
    first, gained = 0.5 * a[:, :-1], v[:, 1:] - v[:, :-1] - a[:, :-1]
    moved, bent = p[:, 1:] - p[:, :-1] - v[:, :-1] - first, a[:, 1:] - a[:, :-1]
    rest = np.tensordot(_QUINTIC, np.array([moved, gained, bent]), axes=1)
    return SkyMotion(start_t_s, h, np.concatenate([np.array([p[:, :-1], v[:, :-1], first]), rest]))


def _seen(track: TopocentricTrack, t_s: Array) -> tuple[list[Array], Array]:
    """Return position, velocity and acceleration (3, n) of the track itself, and range by light."""
    held = track.hold_t_s is not None
    seen, range_m, _ = track.relative_motion_at(np.full_like(t_s, track.hold_t_s) if held else t_s)
    parts = [rows_of(part, len(t_s)) for part in (seen.position, seen.velocity, seen.acceleration)]
    return [parts[0], *(np.zeros_like(part) if held else part for part in parts[1:])], range_m


def _node_step_s(track: TopocentricTrack) -> float:
    elements = getattr(track.target, "elements", None)
    if not isinstance(elements, Elements) or track.hold_t_s is not None:
        # What flies may turn between two nodes of an orbit.
        return getattr(track.target, "node_step_s", _STEP_S)
    e = elements.eccentricity
    fastest_rad_s: float = elements.mean_motion_rad_s * (1.0 + e) ** 2 / (1.0 - e * e) ** 1.5
    return min(_NODE_RAD / fastest_rad_s, _LONGEST_NODE_S)


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


def _known(track: TopocentricTrack, start_t_s: float, duration_s: float) -> list[Pair]:
    """Return starts and durations of the parts of a search in which the target is known."""
    ends = [(max(start_t_s, first), min(start_t_s + duration_s, last)) for first, last in track.spans_t_s]
    parts = [(low, high - low) for low, high in ends if high > low]
    if not parts:
        spans = ", ".join(f"{_edge(first)} to {_edge(last)}" for first, last in track.spans_t_s)
        outside = f"is outside the usable span of {track.name}: {spans or 'none'}"
        raise ValueError(f"the search from {utc_text(start_t_s)} {outside}")
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


def _described(track: TopocentricTrack, motion: SkyMotion, stays: Stays, sine: float | None) -> list[Pass]:
    """Return the stays with their extremes, all sampled together.

    Ends and peak, where an antenna waits and what a pass is chosen by, are those of the track; ends
    within the search are first moved to where it crosses the mask at `sine`, None if they do.
    """
    rise, fall = stays.rise, stays.fall
    if not len(rise):
        return []
    peak, turns = stays.highest(motion)
    before, after = stays.cut_off
    times, free = np.array([rise, peak, fall]), np.array([~before, turns, ~after])
    times, exact, range_m = _exact(track, times, free, sine)
    # Where the peak is an end, half of the points coincide there.
    rising, setting = (np.outer(times[k] - times[1], _PROFILE) for k in (0, 2))
    rows = times[1][:, np.newaxis] + np.concatenate([rising[:, ::-1], np.zeros((len(rise), 1)), setting], axis=1)
    sampled = [one.reshape(3, *rows.shape) for one in motion.at(rows.ravel(), 3)]
    # A square that is smallest is minus it largest.
    square, farther = (np.einsum("cnk,cnk->nk", sampled[0], one) for one in sampled[:2])
    off_m = range_m - np.sqrt(square[:, len(_PROFILE)])
    for one, at in zip(sampled, exact, strict=True):
        one[..., [0, len(_PROFILE), -1]] = at.transpose(0, 2, 1)
    azimuth, up, turning, rate, bend, lift = angles_and_rates(_without_jerk(*sampled))
    if track.refraction is not None:
        up, rate, lift = track.refraction.apply_with_rates(up, rate, lift)
    azimuth[:, 1:] -= _TURN * np.cumsum(np.rint(np.diff(azimuth) / _TURN), axis=1)
    azimuth += _TURN * (azimuth[:, :1] < 0.0)
    # The acceleration is looked at more closely around its largest value.
    number = np.arange(len(rows))
    largest = np.minimum(np.maximum(np.argmax(np.abs(bend), axis=1), 1), rows.shape[1] - 2)
    low, high = rows[number, largest - 1], rows[number, largest + 1]
    closer = (low + (high - low) * _CLOSER).ravel()
    bending = np.abs(angles_and_rates(_without_jerk(*motion.at(closer, 3)))[4])
    bending = bending.reshape(len(_CLOSER), -1)
    turn, lifting, near = _largest(
        rows, np.array([np.abs(turning), np.abs(rate), -square]),
        np.array([np.copysign(bend, bend * turning), np.copysign(lift, lift * rate), -2.0 * farther]),
    )  # fmt: skip
    most = turn, lifting, np.maximum(bending.max(axis=0), np.abs(bend).max(axis=1)), np.sqrt(-near) + off_m
    extremes = zip(
        *times.tolist(), before.tolist(), after.tolist(), azimuth, up, *(one.tolist() for one in most), strict=True
    )
    return [
        Pass(
            name=track.name, aos_t_s=rise_s, tca_t_s=top, los_t_s=set_s,
            peak_elevation_rad=float(high[len(_PROFILE)]), aos_azimuth_rad=float(around[0]),
            aos_elevation_rad=float(high[0]), los_azimuth_rad=float(around[-1]),
            azimuth_min_rad=float(around.min()), azimuth_max_rad=float(around.max()),
            peak_azimuth_rate_rad_s=turn, peak_elevation_rate_rad_s=lifting,
            peak_azimuth_acceleration_rad_s2=bent, smallest_range_m=near,
            rises_before=early, sets_after=late,
        )
        for rise_s, top, set_s, early, late, around, high, turn, lifting, bent, near in extremes
    ]  # fmt: skip


def _exact(
    track: TopocentricTrack, times: Array, free: BoolArray, sine: float | None
) -> tuple[Array, list[Array], Array]:
    """Return rise, peak and set (3, n) of the track, its motion there, and the range at the peaks.

    Those that are not `free` stay.
    """
    for _ in range(_MOST_EXACT):
        seen, range_m = _seen(track, times.ravel())
        height, rate, bend = (part.reshape(times.shape) for part in height_of(*seen))
        late_s = np.where(free, rate / np.where(bend == 0.0, 1e-30, bend), 0.0)
        late_s[::2] = 0.0
        if sine is not None:
            late_s[::2] = np.where(free, (height - sine) / np.where(rate == 0.0, 1e-30, rate), 0.0)[::2]
        moved = times - np.minimum(np.maximum(late_s, -_STEP_S), _STEP_S)
        moved[0], moved[2] = np.minimum(moved[0], moved[1]), np.maximum(moved[1], moved[2])
        on_s, times = moved - times, moved
        if np.all(np.abs(on_s) < _LATEST_S):
            break
    else:
        seen, range_m, on_s = *_seen(track, times.ravel()), np.zeros(times.shape)
    # The last step is so short that the motion is carried along it.
    position, velocity, acceleration = (part.reshape(3, *times.shape) for part in seen)
    exact = [position + on_s * (velocity + 0.5 * on_s * acceleration), velocity + on_s * acceleration, acceleration]
    farther_m = norm(exact[0][:, 1]) - norm(position[:, 1])
    return times, exact, range_m.reshape(times.shape)[1] + farther_m


def _largest(times: Array, value: Array, slope: Array) -> Array:
    """Return the largest values (m, n) of cubics by values and slopes (m, n, k) at (n, k)."""
    curve, row, k = np.nonzero((slope[..., 1:] < 0.0) & (slope[..., :-1] >= 0.0))
    h, y, last = times[row, k + 1] - times[row, k], value[curve, row, k], value[curve, row, k + 1]
    m, end = slope[curve, row, k], slope[curve, row, k + 1]
    s = m / (m - end)
    between = y + (last - y) * s * s * (3.0 - 2.0 * s) + h * s * (1.0 - s) * (m * (1.0 - s) - end * s)
    most = value.max(axis=2)
    np.maximum.at(most, (curve, row), between)
    return np.asarray(most)


def _without_jerk(position: Array, velocity: Array, acceleration: Array) -> StateVector:
    return StateVector(position, velocity, acceleration, position)
