"""The path of a slew: straight if it is free, else by corners past hills and Sun.

Each axis runs on its own at its limits, so a slew of both bends.  A path is free when the axes can
stop anywhere on it without leaving what is allowed: the whole curve counts, round its corners too,
and all that a stop in the middle would still run through.

Three kinds of path are tried: the straight one; one that turns the azimuth at another elevation,
the fastest first; and one through the free intervals of elevation at every azimuth, which exists
wherever there is room for the axes to move one at a time.
"""

import heapq
import itertools
import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from rf_pointing.core.types import Array, IntArray, Pair
from rf_pointing.planning.forbidden_sky import EARTH_RATE_RAD_S, ForbiddenSky, angle_between
from rf_pointing.planning.limits import AxisRates

# Shares of the stopping distance v^2 / 2a after a quarter, half and all of the time to stop.
HALTING_SHARES = (0.4375, 0.75, 1.0)
# The command preprocessor brakes with less than the limit, another antenna may use all of it.  The
# shorter axis then arrives at another time, which bends the path by half a degree.
BRAKING_SHARES = (1.0, 0.8)
# By how much the chords of the curve may miss it.
CHORD_RAD = math.radians(0.01)
# Above hills and around the Sun: more than axes that lag are off a corner.
CLEARANCE_RAD = math.radians(0.5)
# From the Sun's zone for axes that run after a target: another drive takes another way.
CHASE_RAD = math.radians(0.1)
# Part of the distance that the target itself keeps which a slew may use up.
TARGET_RAD = math.radians(0.02)
# Elevations to try in addition to the obvious ones.
HEIGHTS = 12
# Width of the columns of azimuth in which free elevations are listed.
COLUMN_RAD = math.radians(0.5)
# The Sun moves on while the axes go through the columns: how often that time is estimated anew.
ESTIMATES = 3
# Legs to try when a path is straightened: a control unit that looks for a path must answer soon.
LEGS = 120
# What corners add to the time that the axes need at their rates.
CORNERS_S = 20.0
# How far from start and goal the free elevations that the axes can reach are looked for.
NEAR_RAD = math.radians(4.0)


class AxisSlew(NamedTuple):
    """One axis from a place and rate to rest: it brakes first where it must, else is under way.

    It is at rest at `from_rad` at `begin_s`, before 0 when the axis is moving that way already, and
    ends at `end_s`; `first_s` and `first_rad_s` are time and rate of braking before that.
    """

    start_rad: float
    first_s: float
    first_rad_s: float
    from_rad: float
    begin_s: float
    distance_rad: float
    peak_rad_s: float
    acceleration_rad_s2: float
    braking_rad_s2: float

    @classmethod
    def between(
        cls, start: float, end: float, rate: float, limit: float, acceleration: float, share: float
    ) -> "AxisSlew":
        """Return the motion from `start` at `rate` to rest at `end`."""
        braking, run = share * acceleration, rate * abs(rate) / (2.0 * acceleration)
        # A rate that comes to rest at the end in exact numbers must not overshoot by rounding.
        overshoots = rate**2 > 2.0 * braking * abs(end - start) * (1.0 + 1e-9)
        if (end - start) * rate < 0.0 or overshoots:
            first_s, from_rad = abs(rate) / acceleration, start + run
            begin_s = first_s
        else:
            first_s, from_rad, begin_s = 0.0, start - run, -abs(rate) / acceleration
        distance = end - from_rad
        peak = min(limit, math.sqrt(2.0 * abs(distance) / (1.0 / acceleration + 1.0 / braking)))
        return cls(start, first_s, rate, from_rad, begin_s, distance, peak, acceleration, braking)

    @property
    def phases_s(self) -> tuple[float, float, float, float]:
        """Where it begins to rise, runs level, brakes, and is at rest."""
        peak = self.peak_rad_s
        if peak == 0.0:
            return (self.begin_s,) * 4
        rise, fall = peak / self.acceleration_rad_s2, peak / self.braking_rad_s2
        level = max(0.0, abs(self.distance_rad) / peak - 0.5 * (rise + fall))
        return self.begin_s, self.begin_s + rise, self.begin_s + rise + level, self.begin_s + rise + level + fall

    def knots_s(self) -> list[Array]:
        """Return times between which the motion is straight to within `CHORD_RAD`."""
        begin, level, brakes, end = self.phases_s
        knots = []
        for low, high, limit in (
            (0.0, self.first_s, self.acceleration_rad_s2),
            (begin, level, self.acceleration_rad_s2),
            (brakes, end, self.braking_rad_s2),
        ):
            # A parabola of a t^2 / 2 leaves its chord by a dt^2 / 8.
            count = math.ceil((high - low) * math.sqrt(limit / (8.0 * CHORD_RAD)))
            knots.append(np.linspace(low, high, count + 1))
        return knots

    def at(self, times: Array) -> tuple[Array, Array]:
        """Return positions and rates at `times` (n,)."""
        begin, level, brakes, end = self.phases_s
        side, up = math.copysign(1.0, self.distance_rad), self.acceleration_rad_s2
        rise, run = np.clip(times - begin, 0.0, level - begin), np.clip(times - level, 0.0, brakes - level)
        fall = np.clip(times - brakes, 0.0, end - brakes)
        travelled = 0.5 * up * rise**2 + self.peak_rad_s * (run + fall) - 0.5 * self.braking_rad_s2 * fall**2
        position = self.from_rad + side * travelled
        velocity = side * (up * rise - self.braking_rad_s2 * fall)
        if self.first_s == 0.0:
            return position, velocity
        braked = np.minimum(times, self.first_s)
        opposed = math.copysign(up, self.first_rad_s)
        early = times < self.first_s
        return (
            np.where(early, self.start_rad + self.first_rad_s * braked - 0.5 * opposed * braked**2, position),
            np.where(early, self.first_rad_s - opposed * braked, velocity),
        )


class Moving(NamedTuple):
    """Both axes at one instant of a path, braking at a share of their limits."""

    share: float
    position_rad: Pair
    rate_rad_s: Pair = (0.0, 0.0)


def slew_path(start: Moving, end: Pair, axes: AxisRates) -> tuple[Array, Array, Array]:
    """Return times (n,), positions and rates (n, 2) of a slew, chords of which are the curve."""
    rows = zip(start.position_rad, end, start.rate_rad_s, *axes, strict=True)
    motions = [AxisSlew.between(*row, start.share) for row in rows]
    times = np.unique(np.concatenate([knots for motion in motions for knots in motion.knots_s()]))
    times = times[times >= 0.0]
    (p0, v0), (p1, v1) = (motion.at(times) for motion in motions)
    return times, np.column_stack([p0, p1]), np.column_stack([v0, v1])


def halting_points(positions: Array, rates: Array, acceleration_rad_s2: Pair) -> Array:
    """Return where axes stopped at any of these motions (n, 2) come by and to rest: (3, n, 2)."""
    stop = rates * np.abs(rates) / (2.0 * np.array(acceleration_rad_s2))
    return np.stack([positions + share * stop for share in HALTING_SHARES])


class PathFinder:
    """Finds free paths between positions of the axes, within a travel (low, high) of both axes."""

    def __init__(self, sky: ForbiddenSky, axes: AxisRates, travel_rad: tuple[Pair, Pair]) -> None:
        self._sky, self._axes, self._travel = sky, axes, travel_rad

    def find(self, start: Pair, end: Pair, sun: Pair | None) -> list[Pair] | str:
        """Return the corners of a free path, the end included, or why no path is free."""
        straight = self._barred(start, [end], sun)
        if not straight:
            return [end]
        for _, corners in sorted(self._over_heights(start, end, sun)):
            if not self._barred(start, corners, sun):
                return corners
        duration_s = self._axes.slew_s(start, end)
        for _ in range(ESTIMATES):
            columns = _FreeColumns(self, start, end, sun, duration_s)
            corners = columns.corners()
            if corners:
                return corners
            if columns.duration_s <= duration_s:
                break
            duration_s = columns.duration_s
        return f"{straight} on the way, and no detour is free"

    def barred(self, positions: Array, rates: Array, target: Array, sun: Pair | None) -> str:
        """Return "" or why axes moving so after a target, (n, 2) each, cannot stop everywhere.

        From the Sun they keep more than its zone, but not more than the target does.
        """
        margin = CHASE_RAD
        if sun is not None:
            nearest = float(np.min(angle_between(target, np.array(sun))))
            margin = min(margin, max(nearest - TARGET_RAD - self._sky.sun_radius_rad, 0.0))
        stops = halting_points(positions, rates, self._axes.acceleration_rad_s2)
        return self._sky.reason_of_path(np.concatenate([positions[None], stops]), sun, margin)

    def _over_heights(self, start: Pair, end: Pair, sun: Pair | None) -> Iterator[tuple[float, list[Pair]]]:
        """Return times and corners of paths that turn over hills, above or below the Sun."""
        west, east = sorted((start[0], end[0]))
        low, high = self._travel[0][1], self._travel[1][1]
        front = low - CLEARANCE_RAD
        if self._sky.mount.level:
            between = np.concatenate([self._sky.mask_azimuths(west, east, over=True), [west, east]])
            front, back = (float(np.max(self._sky.mask.lowest_all(between + turn))) for turn in (0.0, math.pi))
            low, high = max(low, front), min(high, math.pi - back)
        heights = [start[1], end[1], front + CLEARANCE_RAD]
        if sun is not None:
            beyond = self._sky.sun_radius_rad + 2.0 * CLEARANCE_RAD
            heights += [sun[1] - beyond, sun[1] + beyond]
        heights += np.linspace(self._travel[0][1], self._travel[1][1], HEIGHTS).tolist()
        for height in heights:
            if low <= height <= high:
                corners = [(start[0], height), (end[0], height), end]
                yield sum(self._axes.slew_s(a, b) for a, b in zip([start, *corners], corners, strict=False)), corners

    def _barred(self, start: Pair, corners: Sequence[Pair], sun: Pair | None) -> str:
        """Return "" or why the path from rest at `start` by these corners is not free."""
        leg = Leg.begin(start)
        for index, corner in enumerate(corners):
            leg = self.leg(leg, corner, sun, last=index == len(corners) - 1)
            if leg.reason:
                return leg.reason
        return ""

    def leg(self, before: "Leg", corner: Pair, sun: Pair | None, *, last: bool) -> "Leg":
        """Return the leg to a corner: why it is not free, or the axes at rest at its end."""
        if last and self._clear(before, corner, sun):
            return Leg("", (), before.end_s)
        longest_s = before.end_s
        for moving in before.moving:
            times, positions, rates = slew_path(moving, corner, self._axes)
            stops = halting_points(positions, rates, self._axes.acceleration_rad_s2)
            end_s = before.end_s + float(times[-1])
            # The Sun moves on until the axes arrive, so the path keeps as much more from it.
            reason = self._sky.reason_of_path(
                np.concatenate([positions[None], stops]), sun, EARTH_RATE_RAD_S * end_s, arrives=last
            )
            if reason:
                return Leg(reason, (), end_s)
            longest_s = max(longest_s, end_s)
        return Leg("", tuple(Moving(moving.share, corner) for moving in before.moving), longest_s)

    def _clear(self, before: "Leg", corner: Pair, sun: Pair | None) -> bool:
        """Return whether nothing is forbidden at the elevations of this leg: the cheapest test."""
        braking = self._axes.acceleration_rad_s2[1]
        heights = [corner[1]]
        for moving in before.moving:
            rate = moving.rate_rad_s[1]
            heights += [moving.position_rad[1], moving.position_rad[1] + rate * abs(rate) / (2.0 * braking)]
        end_s = before.end_s + max(self._axes.slew_s(moving.position_rad, corner) for moving in before.moving)
        return self._sky.clear(min(heights), max(heights), sun, EARTH_RATE_RAD_S * (end_s + CORNERS_S))


class Leg(NamedTuple):
    """One leg of a path: why it is not free, the axes at rest at its end, and when."""

    reason: str
    moving: tuple[Moving, ...]
    end_s: float

    @classmethod
    def begin(cls, start: Pair) -> "Leg":
        """Return the rest before a path."""
        return cls("", tuple(Moving(share, start) for share in BRAKING_SHARES), 0.0)


class _FreeColumns:
    """Free intervals of elevation in columns of azimuth, and a path through those that meet.

    A column is free between the horizon on this side and that on the other, over the top.  The Sun
    cuts it in two pieces at most.  Two pieces of neighbouring columns meet where they overlap.
    """

    def __init__(self, paths: PathFinder, start: Pair, end: Pair, sun: Pair | None, duration_s: float) -> None:
        self._paths, self._start, self._end, self._sun = paths, start, end, sun
        self.duration_s = 0.0
        """How long the path at the columns takes at most; 0 without one."""
        sky, ((west, low), (east, high)) = paths._sky, paths._travel
        west, east = min(west, start[0], end[0]), max(east, start[0], end[0])
        even = np.linspace(west, east, math.ceil((east - west) / COLUMN_RAD) + 1)
        points = sky.mask_azimuths(west, east, over=True) if sky.mount.level else np.empty(0)
        self._edges = edges = np.unique(np.concatenate([even, points, [start[0], end[0]]]))
        # Between two edges the horizon is straight: its highest is at one of them.  What a corner
        # may cut off belongs to a column too.
        horizon = sky.free_heights(edges, low, high)
        highest = _widest(edges, np.maximum(horizon[:, :-1], horizon[:, 1:])) + CLEARANCE_RAD
        bottom, top = np.maximum(highest[0], low), np.minimum(math.pi - highest[1], high)
        below, above = self._about_sun(duration_s)
        # Pieces (2, 2, n): below and above the Sun, lowest and highest elevation.
        self._pieces = np.array([[bottom, np.minimum(top, below)], [np.maximum(bottom, above), top]])

    def _about_sun(self, duration_s: float) -> tuple[Array, Array]:
        """Return the lowest and highest elevation of the Sun's zone in each column."""
        count = len(self._edges) - 1
        if self._sun is None or self._paths._sky.sun_radius_rad == 0.0:
            return np.full(count, math.inf), np.full(count, math.inf)
        radius = self._paths._sky.sun_radius_rad + EARTH_RATE_RAD_S * duration_s + 0.5 * CLEARANCE_RAD
        turn, rise = self._edges - self._sun[0], self._sun[1]
        # cos(distance) = R cos(elevation - middle) along one azimuth, to the other side too.
        east, north = math.cos(rise) * np.cos(turn), math.sin(rise)
        largest, middle = np.hypot(east, north), np.arctan2(north, east)
        half = np.arccos(np.minimum(math.cos(radius) / np.maximum(largest, 1e-12), 1.0))
        inside = largest > math.cos(radius)
        below, above = np.where(inside, middle - half, math.inf), np.where(inside, middle + half, -math.inf)
        wide = _widest(self._edges, np.stack([np.maximum(-below[:-1], -below[1:]), np.maximum(above[:-1], above[1:])]))
        below, above = -wide[0], wide[1]
        return below, np.where(np.isfinite(above), above, math.inf)

    def corners(self) -> list[Pair]:
        """Return the corners of a path, empty when none is found."""
        low, high = self._pieces[:, 0], self._pieces[:, 1]
        component = self._components(low, high)
        exits, entries = self._reached(component, forward=True), self._reached(component, forward=False)
        for label in exits.keys() & entries.keys():
            stairs = self._stairs(exits[label], entries[label])
            corners = self._straightened([self._start, *stairs, self._end])
            if corners:
                return corners
        return []

    def _components(self, low: Array, high: Array) -> IntArray:
        """Return which pieces (2, n) are connected, by a number; -1 where there is no piece."""
        index = np.arange(low.size).reshape(low.shape)
        rows, columns = [], []
        for here in (0, 1):
            for there in (0, 1):
                meet = np.maximum(low[here, :-1], low[there, 1:]) <= np.minimum(high[here, :-1], high[there, 1:])
                rows.append(index[here, :-1][meet])
                columns.append(index[there, 1:][meet])
        row, column = np.concatenate(rows), np.concatenate(columns)
        # The number of a piece is that of the first one that it is connected with.
        labels, before = np.arange(low.size), np.full(low.size, -1)
        while not np.array_equal(labels, before):
            before = labels.copy()
            np.minimum.at(labels, before[row], before[column])
            np.minimum.at(labels, before[column], before[row])
            labels = labels[labels]
        return np.where(low <= high, labels.reshape(low.shape), -1)

    def _reached(self, component: IntArray, *, forward: bool) -> dict[int, tuple[int, int, Pair]]:
        """Return by component the nearest piece, and place in it, with a free leg from or to it."""
        here, edges = self._start if forward else self._end, self._edges
        first = int(np.searchsorted(edges, here[0] - NEAR_RAD))
        last = int(np.searchsorted(edges, here[0] + NEAR_RAD))
        places = []
        for column in range(first, min(last, len(edges) - 1)):
            azimuth = min(max(here[0], float(edges[column])), float(edges[column + 1]))
            for piece in (0, 1):
                if component[piece, column] >= 0:
                    low, high = self._pieces[piece, :, column].tolist()
                    place = (azimuth, min(max(here[1], low), high))
                    away = max(abs(place[0] - here[0]), abs(place[1] - here[1]))
                    places.append((away, piece, column, place))
        found: dict[int, tuple[int, int, Pair]] = {}
        for _, piece, column, place in sorted(places):
            label = int(component[piece, column])
            if label not in found:
                begin, end = (here, place) if forward else (place, here)
                if not self._paths.leg(Leg.begin(begin), end, self._sun, last=not forward).reason:
                    found[label] = (piece, column, place)
        return found

    def _stairs(self, begin: tuple[int, int, Pair], end: tuple[int, int, Pair]) -> list[Pair]:
        """Return the places of a path between two pieces of one component, one axis at a time."""
        edges, pieces, (rate_az, rate_el) = self._edges, self._pieces.tolist(), self._paths._axes.rate_rad_s
        count = len(edges) - 1
        start, goal = begin[:2], end[:2]
        # From which piece each is entered, and at which elevation.
        came: dict[tuple[int, int], tuple[tuple[int, int], float]] = {start: (start, begin[2][1])}
        least, done = {start: 0.0}, set()
        queue = [(0.0, start)]
        while queue:
            spent, node = heapq.heappop(queue)
            if node == goal:
                break
            if node in done:
                continue
            done.add(node)
            (piece, column), elevation = node, came[node][1]
            for beyond in (column - 1, column + 1):
                for other in (0, 1) if 0 <= beyond < count else ():
                    low = max(pieces[piece][0][column], pieces[other][0][beyond])
                    high = min(pieces[piece][1][column], pieces[other][1][beyond])
                    level = min(max(elevation, low), high)
                    width = float(edges[beyond + 1] - edges[beyond])
                    cost = spent + width / rate_az + abs(level - elevation) / rate_el
                    if low <= high and cost < least.get((other, beyond), math.inf):
                        came[other, beyond], least[other, beyond] = (node, level), cost
                        heapq.heappush(queue, (cost, (other, beyond)))
        # The search ends at the height of its last step, the path further on.
        spent_s = least[goal] + abs(end[2][1] - came[goal][1]) / rate_el
        near_s = self._paths._axes.slew_s(self._start, begin[2]) + self._paths._axes.slew_s(end[2], self._end)
        self.duration_s = max(self.duration_s, 1.2 * spent_s + near_s + CORNERS_S)
        nodes = [goal]
        while nodes[-1] != start:
            nodes.append(came[nodes[-1]][0])
        stairs = [begin[2]]
        for before, after in itertools.pairwise(nodes[::-1]):
            level, elevation = came[after][1], came[before][1]
            if level != elevation:
                # The step in elevation is made on the edge between the two columns.
                edge = float(edges[max(before[1], after[1])])
                stairs += [(edge, elevation), (edge, level)]
        return [*stairs, (end[2][0], came[goal][1]), end[2]]

    def _straightened(self, places: list[Pair]) -> list[Pair]:
        """Return the few corners that long free legs leave of these places, empty if none do."""
        here, leg, corners, tried, last = 0, Leg.begin(places[0]), [], 0, len(places) - 1
        reach = last
        while here < last:
            reach, found, failed = min(reach, last - here), None, False
            # From the reach of the leg before: longer while that is free, or shorter until it is.
            while tried < LEGS:
                tried += 1
                ahead = self._paths.leg(leg, places[here + reach], self._sun, last=here + reach == last)
                if not ahead.reason:
                    found = reach, ahead
                    if failed or here + reach == last:
                        break
                    reach = min(2 * reach, last - here)
                elif found or reach == 1:
                    break
                else:
                    reach, failed = (reach + 1) // 2, True
            if found is None:
                return []
            reach, leg = found
            here += reach
            corners.append(places[here])
        return corners


def _widest(edges: Array, values: Array) -> Array:
    """Return the largest of column values (k, n) within a clearance of each column."""
    first = np.searchsorted(edges, edges[:-1] - CLEARANCE_RAD, side="right") - 1
    last = np.searchsorted(edges, edges[1:] + CLEARANCE_RAD, side="left")
    padded = np.concatenate([values, np.full((len(values), 1), -math.inf)], axis=1)
    spans = np.column_stack([np.maximum(first, 0), np.minimum(last, values.shape[1])]).ravel()
    return np.asarray(np.maximum.reduceat(padded, spans, axis=1)[:, ::2])


class CornerPath:
    """The corners that are still ahead of a slew.

    A leg begins when the axes rest at the corner before it.  While they move each would come to
    rest at its own time, and the leg bend by what lies between: no plan knows how far axes lag.
    """

    def __init__(self, corners: Sequence[Pair], *, near_rad: float, rest_rad_s: float) -> None:
        self._corners, self._near_rad, self._rest_rad_s = list(corners), near_rad, rest_rad_s

    def next(self, encoder_rad: Pair, rate_rad_s: Pair) -> Pair | None:
        """Return the corner to go to, None once the axes rest at the last one."""
        if self._corners and max(map(abs, rate_rad_s)) < self._rest_rad_s:
            away = max(abs(a - b) for a, b in zip(self._corners[0], encoder_rad, strict=True))
            if away < self._near_rad:
                self._corners.pop(0)
        return self._corners[0] if self._corners else None
