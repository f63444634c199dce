"""Points that a client sends as time goes on: a place, a motion to predict, or a known satellite.

Programs that drive rotators send the direction of now, once a second or when it has changed by a
threshold, with two decimals.  Followed as they come they are stairs, late by half a step.  Here the
last points are fitted by a parabola of the unit vector, which has no wrap and no zenith, and the
motion between the points is that of the fit.  A new point changes the fit by its rounding; the
change is blended in.

`identify` finds the satellite whose track holds every point, with the same lead in time for all:
a client with a threshold points ahead of the satellite.
"""

import math
from collections import deque
from collections.abc import Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from rf_pointing.calibration import BiasModel
from rf_pointing.core import (
    JointReading,
    JointTrajectory,
    Motion,
    Params,
    azel_from_unit_vector,
    nearest_turn_rad,
    parameter,
    unit_vector_from_azel,
)
from rf_pointing.core.types import TURN, Array, Pair
from rf_pointing.ephemeris import CatalogueSky, Site, StateVector, load_catalogue
from rf_pointing.ephemeris.look_angles import angles_and_rates
from rf_pointing.planning import AxisLimits, HorizonMask, choose_turns
from rf_pointing.station.pointing.params import ControllerParams
from rf_pointing.station.pointing.prediction import axis_motion

AHEAD_S = 0.1 * np.arange(1, 11)
# Three steps of the coarsest client with decimals; less is its rounding and no motion.
MOVES_RAD = math.radians(0.03)
# Below it two points are one that was sent twice.
SAME_S = 0.05
KEPT_POINTS = 40
ZENITH = np.array([0.0, 0.0, 1.0])
# `angles_and_rates` takes metres; any distance beyond its least horizontal one will do.
_DISTANCE = 1e6


@dataclass(frozen=True, kw_only=True)
class FollowParams(Params):
    """When points are a motion, and how long it goes on without new ones."""

    window_s: float = parameter(8.0, "the motion is fitted to the points of so long", 2.0, 60.0)
    interval_s: float = parameter(3.0, "points farther apart than this are places, each held", 0.2, 30.0)
    coast_s: float = parameter(3.0, "the motion goes on for so long after the last point", 0.5, 30.0)
    jump_rad: float = parameter(
        math.radians(5.0), "a point this far from what was expected begins a new motion", 0.001, 1.0
    )
    blend_s: float = parameter(0.8, "the change by a new point is spread over", 0.0, 5.0)
    clear_rad: float = parameter(
        math.radians(0.1), "points are raised to this far above horizon and least elevation", 0.0, 0.2
    )


@dataclass(frozen=True, kw_only=True)
class MatchParams(Params):
    """When points are a known satellite."""

    points: int = parameter(4, "points that must lie on its track", 3, 30)
    tolerance_rad: float = parameter(
        math.radians(0.4), "distance of each from the track; a client may leave out refraction", 1e-4, 0.1
    )
    motion_rad: float = parameter(math.radians(1.0), "way that the points must have made", 1e-3, 1.0)
    threshold_rad: float = parameter(
        math.radians(5.5), "how far from the satellite, along its track, a client's threshold lets it point", 1e-3, 0.5
    )
    lead_s: float = parameter(60.0, "longest time that a client points ahead", 0.0, 300.0)
    silence_s: float = parameter(30.0, "a pass ends when its client has sent nothing for so long", 2.0, 600.0)


class ClientPoints:
    """The latest points, and the motion that they mean; angles are of the sky."""

    def __init__(self, params: FollowParams) -> None:
        self.params = params
        self.clear()

    def clear(self) -> None:
        """Forget everything."""
        self._points: deque[tuple[float, Array]] = deque(maxlen=KEPT_POINTS)
        self._fit: Array | None = None
        self._origin_s = -math.inf
        self._blend: tuple[float, Array] | None = None

    @property
    def newest_s(self) -> float:
        """Time of the latest point, minus infinity without any."""
        return self._points[-1][0] if self._points else -math.inf

    @property
    def moving(self) -> bool:
        """Whether the latest points are a motion."""
        return self._fit is not None

    @property
    def history(self) -> tuple[Array, Array]:
        """Times (n,) and unit vectors (n, 3) of the points that are kept."""
        times, directions = zip(*self._points, strict=True) if self._points else ((), ())
        return np.array(times), np.array(directions).reshape(len(times), 3)

    def add(self, t_s: float, azimuth_rad: float, elevation_rad: float) -> bool:
        """Take a point; return whether it begins anew, away from what was expected."""
        direction = unit_vector_from_azel(azimuth_rad, elevation_rad)
        late_s = t_s - self.newest_s
        if self._points and late_s < SAME_S:
            self._points.pop()
        jumped = self._jumps(t_s, direction)
        if jumped:
            self.clear()
        before = self._expected(t_s) if self._fit is not None else None
        gap = late_s > self.params.interval_s
        self._points.append((t_s, direction))
        self._fit_motion(None if gap else before, t_s)
        return jumped

    def motion(self, t_s: Array, near_azimuth_rad: float) -> Motion:
        """Return the motion (n, 2) on the sky, its first azimuth on the turn next to this one."""
        assert self._fit is not None
        ahead = t_s - self._origin_s
        constant, rate, bend = self._fit[0], self._fit[1], self._fit[2]
        position = constant + ahead[:, None] * rate + 0.5 * ahead[:, None] ** 2 * bend
        velocity = rate + ahead[:, None] * bend
        acceleration = np.broadcast_to(bend, position.shape)
        # A direction has no length: what the fit says of it cancels in the angles.
        x, v, a = (
            (column[0], column[1], column[2])
            for column in (_DISTANCE * m.T for m in (position, velocity, acceleration))
        )
        azimuth, elevation, *rates = angles_and_rates(StateVector(x, v, a, (0.0, 0.0, 0.0)))
        azimuth = np.unwrap(azimuth)
        azimuth += nearest_turn_rad(float(azimuth[0]), near_azimuth_rad) - azimuth[0]
        found = Motion(np.column_stack([azimuth, elevation]), np.column_stack(rates[:2]), np.column_stack(rates[2:]))
        return self._blended(t_s, found)

    def _jumps(self, t_s: float, direction: Array) -> bool:
        if not self._points:
            return False
        expected = self._points[-1][1] if self._fit is None else self._fit_at(t_s)
        # A client with a threshold steps by it, also before its points are a motion.
        allowed = self.params.jump_rad * (1.0 if self._fit is not None else 2.0)
        return _apart(expected, direction) > allowed

    def _fit_at(self, t_s: float) -> Array:
        assert self._fit is not None
        ahead = t_s - self._origin_s
        found: Array = self._fit[0] + ahead * self._fit[1] + 0.5 * ahead**2 * self._fit[2]
        return found / float(np.linalg.norm(found))

    def _expected(self, t_s: float) -> Array:
        """Return the present azimuth and elevation (2,), with what is still being blended."""
        expected: Array = self.motion(np.array([t_s]), 0.0).position[0]
        return expected

    def _fit_motion(self, before: Array | None, t_s: float) -> None:
        """Fit the points of the window; `before` (2,) is where the fit so far is at `t_s`."""
        self._fit, self._blend = None, None
        times, directions = self.history
        steps = np.diff(times)
        gaps = np.flatnonzero(steps > self.params.interval_s)
        first = int(gaps[-1]) + 1 if len(gaps) else 0
        first = max(first, int(np.searchsorted(times, t_s - self.params.window_s - 1e-6)))
        times, directions = times[first:], directions[first:]
        if len(times) < 3 or _apart(directions[0], directions[-1]) < MOVES_RAD:
            return
        since = times - t_s
        columns = [np.ones_like(since), since, 0.5 * since**2]
        # Three points give a straight motion with a check; a parabola through them has none.
        wanted = 2 if len(times) < 4 else 3
        found = np.linalg.lstsq(np.column_stack(columns[:wanted]), directions, rcond=None)[0]
        self._fit, self._origin_s = np.vstack([found, np.zeros((3 - wanted, 3))]), t_s
        if before is not None and self.params.blend_s > 0.0:
            step = before - self.motion(np.array([t_s]), 0.0).position[0]
            step[0] = math.remainder(step[0], TURN)
            self._blend = t_s, step

    def _blended(self, t_s: Array, motion: Motion) -> Motion:
        """Return a motion with what is left of the step that the latest point has made."""
        if self._blend is None:
            return motion
        begun_s, step = self._blend
        blend_s = self.params.blend_s
        x = np.clip((t_s - begun_s) / blend_s, 0.0, 1.0)[:, None]
        # 1 - 10 x^3 + 15 x^4 - 6 x^5 begins and ends without rate or acceleration.
        left = 1.0 - x**3 * (10.0 - 15.0 * x + 6.0 * x**2)
        rate = -30.0 * x**2 * (1.0 - x) ** 2 / blend_s
        bend = -60.0 * x * (1.0 - x) * (1.0 - 2.0 * x) / blend_s**2
        return Motion(motion.position + left * step, motion.velocity + rate * step, motion.acceleration + bend * step)


def azimuth_still_to_come(motion: Motion, zenith: Array = ZENITH) -> Pair:
    """Return the least and largest azimuth of the rest of a pass, from its motion (1, 2) now.

    The satellite goes straight on: its direction runs along the great circle of its motion until
    that sets.  Azimuths are continuous from the motion's.  In the angles of other axes the `zenith`
    (3,) is where these see it.
    """
    azimuth, elevation = motion.position[0]
    up = unit_vector_from_azel(azimuth, elevation)
    east = np.array([math.cos(azimuth), -math.sin(azimuth), 0.0])
    north = unit_vector_from_azel(azimuth, elevation + 0.5 * math.pi)
    across = motion.velocity[0, 0] * math.cos(elevation) * east + motion.velocity[0, 1] * north
    speed = float(np.linalg.norm(across))
    if speed == 0.0:
        return float(azimuth), float(azimuth)
    ahead = across / speed
    setting = max(math.atan2(float(up @ zenith), -float(ahead @ zenith)), 0.0)
    set_azimuth, _ = azel_from_unit_vector(up * math.cos(setting) + ahead * math.sin(setting))
    # It is half a turn at most, in the sense of the present motion.
    way = math.copysign(math.remainder(float(set_azimuth) - azimuth, TURN), motion.velocity[0, 0])
    return float(min(azimuth, azimuth + way)), float(max(azimuth, azimuth + way))


def turn_for(limits: AxisLimits, azimuth_range_rad: Pair, encoder_rad: float) -> float:
    """Return the whole turns (rad) on which a motion through these azimuths has its travel.

    Where no turn holds all of it, the one with the most of the motion inside the travel.
    """
    low, high = azimuth_range_rad
    try:
        return TURN * choose_turns(limits, low, high, encoder_rad)
    except ValueError:
        first = math.floor((limits.azimuth_min_rad - high) / TURN)
        last = math.ceil((limits.azimuth_max_rad - low) / TURN)

    def inside(turns: int) -> float:
        begin, end = max(low + turns * TURN, limits.azimuth_min_rad), min(high + turns * TURN, limits.azimuth_max_rad)
        return end - begin

    return TURN * max(range(first, last + 1), key=inside)


def raised(position_rad: Array, limits: AxisLimits, mask: HorizonMask, clear_rad: float) -> Array:
    """Return directions (n, 2) with elevations inside the travel and above the horizon.

    Clients send elevation 0 while a satellite is below the horizon.
    """
    low = np.maximum(mask.lowest_all(position_rad[:, 0]), limits.elevation_min_rad) + clear_rad
    # A travel over the top ends above 90 deg, a direction does not.
    high = min(limits.elevation_max_rad, 0.5 * math.pi)
    return np.column_stack([position_rad[:, 0], np.clip(position_rad[:, 1], low, np.maximum(high, low))])


class Follower:
    """The motion of the axes that the points of a client mean, inside travel and horizon.

    `azimuth_rad` is the azimuth of the newest command, None while none is sent; `unwinds` whether
    that command goes on on another turn.  `model` lies between beam and axes.
    """

    def __init__(self, controller: ControllerParams, params: FollowParams) -> None:
        self.params, self.points, self.mount = params, ClientPoints(params), controller.kinematics
        self.model: BiasModel | None = None
        self.azimuth_rad: float | None = None
        self.unwinds = False
        self._limits, self._mask = controller.limits, controller.mask
        self._stop_rad_s2 = np.array(controller.machine.axes.acceleration_rad_s2)

    def clear(self) -> None:
        """Forget the points and the motion."""
        self.points.clear()
        self.azimuth_rad = None

    def beam_rad(self, axes: JointReading) -> Pair:
        """Return azimuth and elevation of the beam, on the side of the zenith of such axes."""
        beam = tuple(axes.position_rad)
        azimuth = float(beam[0])
        if self.model is not None:
            # At the mount's zenith the model has no inverse: the axes are near enough.
            with suppress(ValueError):
                beam = self.model.beam_at(*beam, *axes.velocity_rad_s, 0.0, 0.0)
        if math.cos(beam[0] - azimuth) < 0.0:
            beam = beam[0] + math.pi, math.pi - beam[1]
        if not self.mount.level:
            return self.mount.sky_at(float(beam[0]), float(beam[1]))
        return float(beam[0]), float(beam[1])

    def place_rad(self, axes: JointReading) -> Array:
        """Return where the axes (2,) hold the latest point, on the nearest turn of the travel."""
        east, north, up = self.points.history[1][-1]
        place = np.array([[math.atan2(east, north), math.asin(up)]])
        still = np.zeros((1, 2))
        first, second = self._seen(Motion(place, still, still)).position[0].tolist()
        first = nearest_turn_rad(first, float(axes.position_rad[0]))
        low, high = self._limits.azimuth_min_rad, self._limits.azimuth_max_rad
        turns = [first + TURN * k for k in (0, -1, 1, -2, 2)]
        first = next((each for each in turns if low <= each <= high), first)
        goal = np.array([[first, second]])
        if self.mount.level:
            goal = raised(goal, self._limits, self._mask, self.params.clear_rad)
        found: Array = self._on_axes(Motion(goal, still, still)).position[0]
        return found

    def rest_rad(self, axes: JointReading) -> Array:
        """Return where the axes (2,) can come to rest."""
        now, rate = axes.position_rad, axes.velocity_rad_s
        goal = now + rate * np.abs(rate) / (2.0 * self._stop_rad_s2)
        return np.clip(goal, np.minimum(self._limits.lowest_rad, now), np.maximum(self._limits.highest_rad, now))

    def command(self, t_s: float, axes: JointReading) -> JointTrajectory:
        """Return the motion of the second after `t_s`."""
        times = np.round(t_s + AHEAD_S, 6)
        if self.azimuth_rad is None:
            self.azimuth_rad = self._azimuth_for_the_rest(t_s, axes)
        sky, self.unwinds = self._motion(times, self.azimuth_rad), False
        if not self._limits.azimuth_min_rad <= sky.position[-1, 0] <= self._limits.azimuth_max_rad:
            other = self._azimuth_for_the_rest(t_s, axes)
            self.unwinds = abs(other - self.azimuth_rad) > math.pi
            sky = self._motion(times, other)
        self.azimuth_rad = float(sky.position[0, 0])
        motion = self._on_axes(self._within(times, sky))
        return JointTrajectory(
            t_s=times, position_rad=motion.position, velocity_rad_s=motion.velocity,
            acceleration_rad_s2=motion.acceleration,
        )  # fmt: skip

    def _azimuth_for_the_rest(self, t_s: float, axes: JointReading) -> float:
        """Return the azimuth now on the turn that holds the rest of the motion."""
        encoder = float(axes.position_rad[0])
        now = self._motion(np.array([t_s]), encoder)
        coming = azimuth_still_to_come(now, self.mount.matrix[2])
        return float(now.position[0, 0]) + turn_for(self._limits, coming, encoder)

    def _motion(self, t_s: Array, near_rad: float) -> Motion:
        """Return the motion of the points on the axes, its first angle next to this one."""
        motion = self.points.motion(t_s, near_rad)
        if self.mount.level:
            return motion
        seen = self._seen(motion)
        first = float(seen.position[0, 0])
        shift = np.array([nearest_turn_rad(first, near_rad) - first, 0.0])
        return seen._replace(position=seen.position + shift)

    def _seen(self, sky: Motion) -> Motion:
        """Return a motion on the sky, above the horizon on other mounts, as the axes see it."""
        if self.mount.level:
            return sky
        lowest = self._mask.lowest_all(sky.position[:, 0]) + self.params.clear_rad
        low = sky.position[:, 1] < lowest
        position, *rates = (np.array(each) for each in sky)
        position[low, 1] = lowest[low]
        # What is raised goes along the horizon.
        for each in rates:
            each[low, 1] = 0.0
        return Motion(*self.mount.to_axes(position, *rates))

    def _within(self, t_s: Array, motion: Motion) -> Motion:
        """Return a motion inside the travel and above the horizon."""
        limits = self._limits
        if self.mount.level:
            position = raised(motion.position, limits, self._mask, self.params.clear_rad)
            position[:, 0] = np.clip(position[:, 0], limits.azimuth_min_rad, limits.azimuth_max_rad)
        else:
            position = np.clip(motion.position, limits.lowest_rad, limits.highest_rad)
        changed, slopes = position != motion.position, np.gradient(position, t_s, axis=0)
        still = np.where(changed, 0.0, motion.acceleration)
        return Motion(position, np.where(changed, slopes, motion.velocity), still)

    def _on_axes(self, sky: Motion) -> Motion:
        return sky if self.model is None else axis_motion(sky, self.model)


class KnownSatellites:
    """The satellites that points may be of: `sky`, None before any are loaded.

    `problem` says why the newest elements cannot be used.
    """

    def __init__(self, site: Site) -> None:
        self.sky: CatalogueSky | None = None
        self.problem = ""
        self._site = site
        self._loading: Future[CatalogueSky] | None = None
        self._pool = ThreadPoolExecutor(1, thread_name_prefix="elements")

    def load(self, elements: str, t_s: float) -> None:
        """Begin to load a file of elements, in another thread; `look` takes it."""
        self._loading = self._pool.submit(lambda: CatalogueSky(load_catalogue(elements), self._site, t_s))

    def look(self) -> None:
        """Take what has been loaded."""
        if self._loading is not None and self._loading.done():
            try:
                self.sky, self.problem = self._loading.result(), ""
            except (ValueError, OSError) as error:
                self.problem = f"satellites cannot be identified: {error}"

    def close(self) -> None:
        """Load nothing more."""
        self._pool.shutdown(wait=False, cancel_futures=True)


@dataclass(frozen=True, slots=True)
class Match:
    """A known satellite: its row in the catalogue, and how the points lie on its track.

    `distance_rad` is the largest distance of a point from the track, `lead_s` the mean time by
    which the points are ahead of the satellite.
    """

    row: int
    name: str
    catalogue_number: int
    distance_rad: float
    lead_s: float


def identify(sky: CatalogueSky, t_s: Array, directions: Array, params: MatchParams) -> Match | None:
    """Return the satellite on whose track the latest points (n,), (n, 3) lie, None without one.

    Of several, the one that is nearest to the points at their times; None where two are as near.
    """
    count = _enough(directions, params)
    if not count:
        return None
    t_s, directions = t_s[-count:], directions[-count:]
    now, known = sky.directions(t_s[-1:])
    near = _angle(now[:, 0], directions[-1]) < params.threshold_rad + params.tolerance_rad
    rows = np.flatnonzero(known & near).tolist()
    found = sorted(_on_track(sky, rows, t_s, directions, params), key=lambda each: each[0])
    if len(found) > 1 and found[1][0] < 2.0 * found[0][0] + 0.25 * params.tolerance_rad:
        return None
    return found[0][1] if found else None


def on_track(sky: CatalogueSky, row: int, t_s: float, direction: Array, params: MatchParams) -> bool:
    """Return whether a further point (3,) is one of this satellite's."""
    return bool(_on_track(sky, [row], np.array([t_s]), direction[None, :], params))


def _on_track(
    sky: CatalogueSky, rows: Sequence[int], t_s: Array, directions: Array, params: MatchParams
) -> list[tuple[float, Match]]:
    """Return the satellites whose tracks hold all points, each behind its mean distance then."""
    if not rows:
        return []
    # A client's clock may be late; more than a few seconds is another satellite of a train.
    grid = np.arange(t_s[0] - 3.0, t_s[-1] + params.lead_s + 1.0, 1.0)
    tracks, known = sky.directions(grid, rows)
    at_time, _ = sky.directions(t_s, rows)
    found = []
    for index, row in enumerate(rows):
        if not known[index]:
            continue
        offsets = _angle(at_time[index], directions)
        begin, way = tracks[index][:-1], np.diff(tracks[index], axis=0)
        aside, leads = [], []
        for point, when, here in zip(directions, t_s, at_time[index], strict=True):
            share = np.clip(((point - begin) * way).sum(axis=1) / (way**2).sum(axis=1), 0.0, 1.0)
            place = begin + share[:, None] * way
            distance = np.linalg.norm(place - point, axis=1)
            within = (_angle(place, here) <= params.threshold_rad) & (grid[:-1] >= when - 3.0)
            if not np.any(within):
                break
            best = int(np.argmin(np.where(within, distance, np.inf)))
            aside.append(float(distance[best]))
            leads.append(float(grid[best] + share[best] - when))
        else:
            if max(aside) <= params.tolerance_rad:
                one = sky.elements[row]
                match = Match(row, one.name, one.catalogue_number, max(aside), float(np.mean(leads)))
                found.append((float(np.mean(offsets)), match))
    return found


def _enough(directions: Array, params: MatchParams) -> int:
    """Return how many of the latest points are needed for the least way; 0 if there are too few."""
    for count in range(params.points, len(directions) + 1):
        if _apart(directions[-count], directions[-1]) >= params.motion_rad:
            return count
    return 0


def _apart(one: Array, other: Array) -> float:
    return float(_angle(one[None, :], other)[0])


def _angle(rows: Array, other: Array) -> Array:
    """Return the angles (n,) between unit vectors (n, 3) and (3,) or (n, 3)."""
    # By the chord: the arc cosine has no digits left for small angles.
    chord = np.linalg.norm(rows - other, axis=-1)
    return np.asarray(2.0 * np.arcsin(np.minimum(0.5 * chord, 1.0)))
