"""A service: a target that never sets, held with few starts of the motors and with the brakes set.

The antenna rests while its target drifts through the beam, and moves on when it is `hold_beams` off
the axis, to where it may rest longest.  Every move is a measurement: the level before it and after
it tells where the target is (`sidereal.py`).  Where that is not enough, a peak is taken:
three short moves, one axis after the other, as often as the covariance requires.  What is learned
carries the service through loss of the beacon and the Sun's noise.

Directions are apparent azimuth and elevation; offsets from the base direction are azimuth times
the cosine of its elevation, and elevation.
"""

import math
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from rf_pointing.core import Array, KeptState, Pair, Params, angular_distance_rad, parameter
from rf_pointing.core.dates import DAY_S as DAY_LENGTH_S
from rf_pointing.station.service.sidereal import Sample, SiderealMotion

# Times at which a resting place is tried: close together at first, for fast targets.
AHEAD_S = np.geomspace(5.0, 6.0 * 3600.0, 120)
DAY_S = np.linspace(0.0, 86164.0, 97)
FEWEST_WIDTHS_A_DAY, SHARED_S = 0.05, 1800.0
CHOICES = np.linspace(-1.0, 1.0, 9)
# The Sun's radius; its noise comes in through this share of the beam beyond it.
SUN_RADIUS_RAD, SUN_BEAMS = math.radians(0.27), 0.8
# A mean needs this many samples.
FEWEST = 3
REFERENCE_SHARE = 0.02


@dataclass(frozen=True, kw_only=True)
class ServiceParams(Params):
    """How closely a service holds its target, and how often it looks where that is."""

    hold_beams: float = parameter(0.18, "target off the axis at which the antenna moves", 0.02, 0.5)
    peak_beams: float = parameter(0.25, "length of the moves of a peak", 0.05, 0.5)
    sigma_beams: float = parameter(
        0.06, "uncertainty of the target at which a peak is taken", 0.01, 0.3
    )
    shortest_s: float = parameter(60.0, "least time between two peaks", 10.0, 86400.0)
    longest_s: float = parameter(21600.0, "longest time between two peaks", 60.0, 864000.0)
    settle_s: float = parameter(
        3.0, "time from the end of a move to the first level that counts", 0.0, 60.0
    )
    measure_s: float = parameter(12.0, "time over which a level is averaged", 1.0, 600.0)
    level_db: float = parameter(
        0.15, "one sigma of a difference of levels: noise and weather", 0.01, 3.0
    )
    lost_db: float = parameter(
        8.0, "level below the usual one at which the beacon counts as lost", 3.0, 40.0
    )

    ordered = ("shortest_s <= longest_s",)


class Service:
    """Holds one target; `step` as often as levels come, `base(t_s)` is its direction (2,)."""

    def __init__(
        self, name: str, params: ServiceParams, motion: SiderealMotion, base: Callable[[float], Pair],
        sun: Callable[[float], Pair | None] = lambda _t_s: None,
    ) -> None:  # fmt: skip
        self.name, self.params, self.motion = name, params, motion
        self._base, self._sun = base, sun
        self.starts = np.zeros(2, dtype=int)
        self.peaks, self.state = 0, "waits for the position of the axes"
        self._levels: deque[Pair] = deque()
        self._before: Sample | None = None
        self._moved_s, self._peaked_s = -math.inf, -math.inf
        self._steps: list[Array] = []
        self._usual_db: float | None = None
        self._hold, self._shared_s = np.zeros(2), -math.inf
        self.learned = False

    @property
    def values(self) -> dict[str, Any]:
        """Base direction and motion, as they are kept over a restart."""
        return {"base_rad": list(self._base(self.motion.t_s)), **self.motion.values()}

    @property
    def busy(self) -> bool:
        """Whether it measures: levels count now."""
        return self._before is not None or bool(self._steps)

    def direction(self, t_s: float) -> Pair:
        """Return the apparent direction (2,) in which the target is believed."""
        return self._direction(t_s, self.motion.at(t_s))

    def step(
        self, t_s: float, axes_rad: Pair, level_db: float | None, *, moving: bool = False
    ) -> Pair | None:
        """Return where the beam shall go, None while it stays.

        Parameters
        ----------
        axes_rad : apparent direction (2,) of the beam.
        level_db : received level, None without a signal.
        moving : whether the axes are on their way.
        """
        base = self._base(t_s)
        beam = self._offset(base, axes_rad)
        if moving:
            self._levels.clear()
            self._moved_s = t_s
            return None
        # The Sun raises the noise, not the loss: levels would teach a wrong direction.
        outage = self._in_sun(t_s)
        seen = not outage and self._seen(level_db)
        if t_s - self._moved_s >= self.params.settle_s:
            if seen and level_db is not None:
                self._levels.append((t_s, level_db))
            else:
                self._levels.clear()
            while len(self._levels) > FEWEST and self._levels[0][0] < t_s - self.params.measure_s:
                self._levels.popleft()
        here = self._sample(beam)
        if self._before is not None or self._steps:
            longest_s = self.params.settle_s + 2.0 * self.params.measure_s
            if seen and here is None and t_s - self._moved_s < longest_s:
                self.state = "measures"
                return None
            if self._before is not None and here is not None:
                # Azimuths are narrower where the beam is higher than its base direction.
                stretch = np.array([math.cos(axes_rad[1]) / math.cos(base[1]), 1.0])
                self.learned |= self.motion.learn(self._before, here, stretch, self.params.level_db)
            # Without a level on either side a move has measured nothing.
            self._before = None
            if self._steps and seen:
                return self._go(t_s, beam, beam + self._steps.pop(0), here)
            self._steps.clear()
        target, sigma = self.motion.at(t_s), self._sigma_beams(t_s)
        since_s = t_s - self._peaked_s
        due = sigma > self.params.sigma_beams or since_s > self.params.longest_s
        if due and seen and here is not None and since_s > self.params.shortest_s:
            self._peaked_s, self.peaks = t_s, self.peaks + 1
            return self._peak(t_s, beam, target, here)
        off = np.abs(target - beam)
        kept = "from memory, the Sun is behind it" if outage else "from memory, no beacon"
        self.state = "rests" if seen else f"rests {kept}"
        far = off > self._hold_rad(t_s)
        if not np.any(far):
            return None
        return self._go(t_s, beam, np.where(far, self._resting(t_s), beam), here)

    def _peak(self, t_s: float, beam: Array, target: Array, here: Sample) -> Pair:
        """Move one axis across the target, then the other, then both to where the beam may rest."""
        # Towards the target, so that the peak is on the way and the loss of it the smaller.
        length = self.params.peak_beams * self.motion.half_power_beamwidth_rad
        across = np.where(target >= beam, length, -length)
        self._steps = [np.array([0.0, across[1]]), self._resting(t_s) - beam - across]
        return self._go(t_s, beam, beam + np.array([across[0], 0.0]), here)

    def _go(self, t_s: float, beam: Array, goal: Array, here: Sample | None) -> Pair:
        # Each axis has a motor of its own: it starts only where it moves.
        self.starts += np.abs(goal - beam) > 1e-3 * self.motion.half_power_beamwidth_rad
        self._before, self._moved_s = here, t_s
        self._levels.clear()
        self.state = "moves"
        return self._direction(t_s, goal)

    def _resting(self, t_s: float) -> Array:
        """Return the offset (2,) at which each axis may rest longest."""
        path, holds = self.motion.at(t_s + AHEAD_S), self._hold_rad(t_s)
        found = np.empty(2)
        for axis, hold in enumerate(holds.tolist()):
            # Slightly within the limit, so that noise does not begin the next move at once.
            places = path[0, axis] + 0.95 * hold * CHOICES
            outside = np.abs(path[None, :, axis] - places[:, None]) > hold
            rests = np.where(outside.any(axis=1), outside.argmax(axis=1), len(AHEAD_S))
            best = np.flatnonzero(rests == rests.max())
            found[axis] = places[best[np.argmin(np.abs(CHOICES[best]))]]
        return found

    def _hold_rad(self, t_s: float) -> Array:
        """Return how far each axis (2,) lets its target drift.

        The loss is that of both squares, the starts go with speed / distance: together they are
        least where the distance goes with the cube root of the speed.
        """
        if t_s - self._shared_s > SHARED_S:
            width_rad = self.motion.half_power_beamwidth_rad
            speed = np.abs(np.diff(self.motion.at(t_s + DAY_S), axis=0)).sum(axis=0)
            share = np.cbrt(np.maximum(speed, FEWEST_WIDTHS_A_DAY * width_rad))
            self._shared_s = t_s
            even = math.sqrt(2.0 / float(share @ share))
            self._hold = self.params.hold_beams * width_rad * share * even
        return self._hold

    def _sigma_beams(self, t_s: float) -> float:
        worst = float(np.linalg.eigvalsh(self.motion.covariance_rad2(t_s))[-1])
        return math.sqrt(max(worst, 0.0)) / self.motion.half_power_beamwidth_rad

    def _seen(self, level_db: float | None) -> bool:
        """Return whether the beacon is received; its usual level follows the weather."""
        if level_db is None or not math.isfinite(level_db):
            return False
        if self._usual_db is None:
            self._usual_db = level_db
        # A fade of the weather is less than this; beyond it nothing of the target is left.
        if level_db < self._usual_db - self.params.lost_db:
            return False
        self._usual_db += REFERENCE_SHARE * (level_db - self._usual_db)
        return True

    def _in_sun(self, t_s: float) -> bool:
        """Return whether the Sun's noise comes in with the target's signal."""
        sun = self._sun(t_s)
        if sun is None:
            return False
        apart = float(angular_distance_rad(*self.direction(t_s), *sun))
        return apart < SUN_RADIUS_RAD + SUN_BEAMS * self.motion.half_power_beamwidth_rad

    def _sample(self, beam: Array) -> Sample | None:
        """Return the mean level since the last move, None while it is not known."""
        levels = self._levels
        if len(levels) < FEWEST or levels[-1][0] - levels[0][0] < 0.7 * self.params.measure_s:
            return None
        times, values = np.array(levels).T
        return Sample(float(times.mean()), beam, float(values.mean()))

    def _offset(self, base: Pair, direction: Pair) -> Array:
        azimuth = math.remainder(direction[0] - base[0], math.tau)
        return np.array([azimuth * math.cos(base[1]), direction[1] - base[1]])

    def _direction(self, t_s: float, offset: Array) -> Pair:
        azimuth, elevation = self._base(t_s)
        return azimuth + float(offset[0]) / math.cos(elevation), elevation + float(offset[1])


class ServiceDesk:
    """Services by the hours of the day (UTC) from which they count; one at a time.

    What they have learned is kept in a state file.
    """

    def __init__(
        self, services: Sequence[Service], hours: Sequence[float], state: KeptState
    ) -> None:
        self._rows = sorted(zip(hours, services, strict=True), key=lambda row: row[0])
        if len({hour for hour, _ in self._rows}) < len(self._rows):
            raise ValueError(f"hours={list(hours)} must differ: one satellite is served at a time")
        self._state = state

    def active(self, t_s: float) -> Service:
        """Return the service of a time, the last of the day before the first hour."""
        hour = t_s % DAY_LENGTH_S / 3600.0
        return ([each for begin, each in self._rows if begin <= hour] or [self._rows[-1][1]])[-1]

    def keep(self) -> str:
        """Write what was learned; return why that is not possible, "" if it was."""
        learned = {each.name: each.values for _, each in self._rows}
        self._state.keep({**self._state.recover(), **learned})
        return self._state.problem
