"""The axis motion that holds the beam on the target, predicted through the bias model.

The target's motion is collected from messages that arrive ahead of time (`TargetBuffer`).  The
exact bias model costs the same for one instant as for twenty, so `Prediction` computes a block of
coming instants at once and keeps it until it is used up or something changes.

Where the branch of a pass leaves the target, the beam's motion is the branch's.  The lags of the
mount are those of the motion that the beam has really made since the axes began to move
(`calibration.LagHistory`), or with `lag_averaging_s` = 0 those of the target's momentary one.
"""

import bisect
import itertools
import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from rf_pointing.calibration import BiasModel, LagHistory, LagState, without_lags
from rf_pointing.core import JointReading, Motion, Quintic, Target, nearest_turn_rad
from rf_pointing.core.types import TURN, Array, Pair
from rf_pointing.planning import PassProfile, plunged

if TYPE_CHECKING:
    from rf_pointing.station.pointing.plan import PassPlan

# Samples of the target farther apart than this are not joined: a quintic over them would be a
# guess.
LARGEST_GAP_S = 2.5
KEPT_S = 5.0
# Half a period of the target, and its silence after which it has ended.
LATE_S, ENDED_S = 0.05, 1.0
RIM_RAD = math.radians(85.0)
# Shorter than what a crossing holds on either side of the instant at which the dish goes over the
# top.
LONGEST_BLOCK_S = 2.0
# Readings farther apart than this leave open how the axes have moved between them.
UNSEEN_S = 0.5
# Axes that are this near to the path of a pass have followed it; several times what is learned.
ON_PATH_RAD = math.radians(1.0)


class TargetBuffer:
    """Holds the samples of one target, joined by quintics.

    `received_until_s` is the time of the latest sample that was received; later ones are filled in.
    `offsets` of the operator are those of the newest sample.
    """

    def __init__(self) -> None:
        self.clear()

    def clear(self) -> None:
        """Forget everything, for a new target."""
        self._times: list[float] = []
        self._motions: list[Motion] = []
        self._ranges: list[float] = []
        self._gains: list[float] = []
        self.received_until_s = self._ahead_s = -math.inf
        self.offsets = ""

    def add(self, target: Target) -> None:
        """Take one sample; a later one for the same time replaces the earlier."""
        motion = Motion(*np.reshape(target.motion, (3, 2)))
        # On the turn of the sample before: a step of 2 pi would be a slew.
        if self._motions:
            motion.position[0] = nearest_turn_rad(target.azimuth_rad, float(self._motions[-1].position[0]))
        self.received_until_s, self.offsets = max(self.received_until_s, target.t_s), target.offsets
        self._insert(target.t_s, motion, target.range_m, target.satellite_gain_db)

    def late(self, t_s: float) -> bool:
        """Whether the newest sample was further ahead of another period, and has not ended.

        With it, how far a prediction is computed ahead does not depend on what arrives first.
        """
        ahead_s = self.received_until_s - t_s
        self._ahead_s = max(self._ahead_s, ahead_s)
        return LATE_S < self._ahead_s - ahead_s < ENDED_S

    def fill(self, profile: PassProfile, start_s: float, end_s: float, range_m: float) -> None:
        """Take the profile of the pass where nothing is known between two times.

        The profile is moved to where the last sample is: an offset that the operator has set since
        it was made stays.  The distance goes on as it changed; `range_m` without any sample.
        """
        shift, rate = np.zeros(2), 0.0
        from_s, from_m = (self._times[-1], self._ranges[-1]) if self._times else (start_s, range_m)
        if self._times and profile.t_s[0] <= from_s <= profile.t_s[-1]:
            there = [np.interp(from_s, profile.t_s, column) for column in profile.position_rad.T]
            shift = self._motions[-1].position - np.array(there)
        if len(self._times) > 1:
            rate = (self._ranges[-1] - self._ranges[-2]) / (self._times[-1] - self._times[-2])
        first = max(int(np.searchsorted(profile.t_s, start_s)) - 1, 0)
        last = min(int(np.searchsorted(profile.t_s, end_s)) + 1, len(profile.t_s))
        for row in range(first, last):
            t_s = round(float(profile.t_s[row]), 6)
            if self.covers(t_s, t_s):
                continue
            motion = Motion(
                profile.position_rad[row] + shift, profile.velocity_rad_s[row], profile.acceleration_rad_s2[row]
            )
            gain_db = float(profile.satellite_gain_db[row])
            self._insert(t_s, motion, max(from_m + rate * (t_s - from_s), 1.0), gain_db)

    def _insert(self, t_s: float, motion: Motion, range_m: float, gain_db: float) -> None:
        # Messages may overtake each other.
        place = bisect.bisect_left(self._times, t_s - 1e-6)
        if place < len(self._times) and abs(self._times[place] - t_s) <= 1e-6:
            self._motions[place], self._ranges[place], self._gains[place] = motion, range_m, gain_db
        else:
            self._times.insert(place, t_s)
            self._motions.insert(place, motion)
            self._ranges.insert(place, range_m)
            self._gains.insert(place, gain_db)
        while self._times[-1] - self._times[0] > KEPT_S and len(self._times) > 2:
            del self._times[0], self._motions[0], self._ranges[0], self._gains[0]

    @property
    def known_until_s(self) -> float:
        """Time of the last sample, minus infinity without any."""
        return self._times[-1] if self._times else -math.inf

    def covers(self, start_s: float, end_s: float) -> bool:
        """Whether the motion is known all the way from `start_s` to `end_s`."""
        if not self._times or start_s < self._times[0] - 1e-6 or end_s > self._times[-1] + 1e-6:
            return False
        first = max(bisect.bisect_right(self._times, start_s) - 1, 0)
        last = bisect.bisect_left(self._times, end_s - 1e-6)
        inside = self._times[first : last + 1]
        # Two samples about one instant: the common case without a generator.
        if len(inside) == 2:
            return inside[1] - inside[0] <= LARGEST_GAP_S
        return all(b - a <= LARGEST_GAP_S for a, b in itertools.pairwise(inside))

    def at(self, t_s: ArrayLike) -> Motion:
        """Return the motion (n, 2) at the times (n,), all of which must be covered."""
        rows = [self._one(t) for t in np.atleast_1d(np.asarray(t_s, dtype=np.float64)).tolist()]
        return Motion(*(np.array([row[part] for row in rows]) for part in range(3)))

    def range_m(self, t_s: ArrayLike) -> Array:
        """Return the distances (n,), linear between samples, the nearest one outside."""
        return np.asarray(np.interp(np.asarray(t_s, dtype=np.float64), self._times, self._ranges))

    def path(self, t_s: float) -> Pair:
        """Return the distance, and the gain (dB) of the target's antenna, like `range_m`."""
        gain_db = np.interp(t_s, self._times, self._gains)
        return float(np.interp(t_s, self._times, self._ranges)), float(gain_db)

    def _one(self, t_s: float) -> Motion:
        if not self.covers(t_s, t_s):
            raise ValueError(f"t_s={t_s} is outside the known motion of the target")
        after = bisect.bisect_left(self._times, t_s - 1e-6)
        if abs(self._times[after] - t_s) <= 1e-6:
            return self._motions[after]
        before, span_s = after - 1, self._times[after] - self._times[after - 1]
        return Quintic(self._motions[before], self._motions[after], span_s).at(t_s - self._times[before])


def axis_motion(sky: Motion, model: BiasModel, *, plunge: bool = False) -> Motion:
    """Return the motion (n, 2) of the axes that holds the beam on `sky` (n, 2), azimuth continuous.

    In the exclusion cone about the mount's zenith the model has no solution: its correction at the
    rim is kept.
    """
    motion = Motion(*plunged(*sky)) if plunge else sky
    try:
        found = Motion(*model.apply_moving(*motion))
        # The upper axis of other mounts than azimuth and elevation goes on beyond 180 deg.
        found.position[:, 1] += TURN * np.round((motion.position[:, 1] - found.position[:, 1]) / TURN)
        return found
    except ValueError:
        # Model terms in tan(elevation) grow without bound towards the zenith.
        low = sky.position.copy()
        low[:, 1] = np.minimum(low[:, 1], RIM_RAD)
        still = np.zeros_like(low)
        rim = plunged(low, still, still)[0] if plunge else low
        return motion._replace(position=motion.position + model.apply_moving(rim, still, still)[0] - rim)


class Prediction:
    """Axis motion (n, 2) every `period_s`, on the turn next to `near_azimuth_rad`."""

    def __init__(self, period_s: float, plan: "PassPlan", lag_averaging_s: float = 0.0) -> None:
        self._period_s, self._plan = period_s, plan
        self.lag_averaging_s = lag_averaging_s
        self._known: dict[int, Array] = {}
        self._lagging: dict[int, LagState] = {}
        self._driven: LagState | None = None
        self._driven_rad, self._seen_from_s = np.zeros(2), math.inf
        self._start: Motion | None = None
        self._history: tuple[BiasModel, float, LagHistory] | None = None

    def _lags(self, model: BiasModel) -> LagHistory | None:
        """Return the lags of the model that are averaged, None without any."""
        known = self._history
        if known is not None and known[0] is model and known[1] == self.lag_averaging_s:
            return known[2]
        if not (self.lag_averaging_s > 0.0 and model.has_lags):
            return None
        self._history = model, self.lag_averaging_s, LagHistory(model, self.lag_averaging_s)
        return self._history[2]

    def clear(self) -> None:
        """Forget the block: the target, the model or the turn has changed."""
        self._known.clear()
        self._start = None

    def slew(self) -> None:
        """Let the axes lead until the next call of `at`: they are not where the prediction is.

        How they have moved until now is still known.
        """
        self.clear()
        self._lagging.clear()

    def take_axes(self, reading: JointReading, model: BiasModel) -> None:
        """Note how the axes move: the lags of a slew go on into the pass."""
        before, here, history = self._driven, reading.position_rad, self._lags(model)
        if history is None or (before and reading.t_s <= before.t_s):
            return
        if before is not None and reading.t_s - before.t_s > UNSEEN_S:
            self._driven = history.stopped(reading.t_s, reading.velocity_rad_s, here - self._driven_rad, before)
        else:
            self._driven = history.dragged(reading.t_s, reading.velocity_rad_s, before)
        self._driven_rad, self._seen_from_s = here.copy(), min(self._seen_from_s, reading.t_s)

    def followed(self, t_s: Array, sky: Motion, reading: JointReading, model: BiasModel) -> None:
        """Take axes that stand on the path of the pass (n, 2) for such as followed it until there.

        A controller that starts again in the middle of a pass knows no other reason for it.
        """
        course, history = self._plan.course, self._lags(model)
        if history is None or len(t_s) < 2 or self._seen_from_s <= t_s[0]:
            return
        path = course.detour(t_s, self._held(float(t_s[-1]), sky, model, float(reading.position_rad[0])))
        off = np.abs(path.position - course.from_axes(reading).position_rad)
        nearest = int(np.argmin(off[:, 0] * np.cos(path.position[:, 1]) + off[:, 1]))
        if float(np.max(off[nearest])) > ON_PATH_RAD:
            return
        signs, until = course.signs(t_s), slice(nearest + 1)
        moving = course.detour(t_s, sky)
        _, states = history.along(t_s[until], (signs * moving.velocity)[until], (signs * moving.acceleration)[until])
        state, still = states[-1], np.zeros(2)
        if reading.t_s > state.t_s:
            state = history.stopped(reading.t_s, reading.velocity_rad_s, still, state)
        self._driven, self._driven_rad = state, reading.position_rad.copy()

    def waiting(self, count: int, t_s: float, sky_rad: Array, model: BiasModel, near_azimuth_rad: float) -> Motion:
        """Return the motion of waiting for `count` instants where the target will rise (2,)."""
        if self._start is None:
            still = np.zeros((1, 2))
            self._start = self._held(t_s, Motion(sky_rad[None, :], still, still), model, near_azimuth_rad)
        return Motion(*(np.tile(part, (count, 1)) for part in self._start))

    def at(self, times: Array, targets: TargetBuffer, model: BiasModel, near_azimuth_rad: float) -> Motion:
        """Return the motion at `times` (n,), computed as far ahead as the target is known."""
        keys = [round(t_s * 1000.0) for t_s in times.tolist()]
        if not self._known.keys() >= set(keys):
            self._compute(times, targets, model, near_azimuth_rad)
        rows = np.array([self._known[key] for key in keys])
        return Motion(rows[:, 0:2], rows[:, 2:4], rows[:, 4:6])

    def _compute(self, times: Array, targets: TargetBuffer, model: BiasModel, near_azimuth_rad: float) -> None:
        ahead = min(targets.known_until_s - float(times[-1]), LONGEST_BLOCK_S)
        beyond = float(times[-1]) + self._period_s * np.arange(1, max(0, int(ahead / self._period_s)) + 1)
        # The same instant is the same number in every block: where one ends must not matter.
        block = np.concatenate([times, np.round(beyond, 6)])
        course, sky, last_s = self._plan.course, targets.at(block), float(block[-1])
        history = self._lags(model)
        if history is not None:
            beam = course.detour(block, self._held(last_s, sky, without_lags(model), near_azimuth_rad))
            motion = self._with_lags(block, beam, course.detour(block, sky), history)
        else:
            motion = course.detour(block, self._held(last_s, sky, model, near_azimuth_rad))
        rows = np.concatenate(motion, axis=1)
        self._known = {time_key(t): row for t, row in zip(block, rows, strict=True)}

    def _with_lags(self, block: Array, beam: Motion, moving: Motion, history: LagHistory) -> Motion:
        """Return the axes (n, 2) that hold a beam, with the lags of its motion so far."""
        # The lags act in the angles of the axes, which over the top run the other way.
        signs = self._plan.course.signs(block)
        # From the state at the block's start, or where the last block was left, or from the slew.
        earlier = [state for key, state in self._lagging.items() if key <= time_key(block[0])]
        before = earlier[-1] if earlier else self._driven if not self._lagging else None
        lags, states = history.along(block, signs * moving.velocity, signs * moving.acceleration, before)
        self._lagging = {time_key(state.t_s): state for state in states}
        return Motion(*(part + signs * lag for part, lag in zip(beam, lags, strict=True)))

    def _held(self, t_s: float, sky: Motion, model: BiasModel, near_azimuth_rad: float) -> Motion:
        """Return the axis motion (n, 2) for apparent directions, on the turn next to an azimuth."""
        position, velocity, acceleration = self._plan.model_motion(t_s, sky, model)
        first = float(position[0, 0])
        near = nearest_turn_rad(first, near_azimuth_rad + self._plan.course.turned_rad(t_s))
        return Motion(position + np.array([near - first, 0.0]), velocity, acceleration)


def time_key(t_s: float) -> int:
    """Return whole milliseconds: periods are compared without the rounding of floats."""
    return round(float(t_s) * 1000.0)
