"""A simulated rotator: constant speed, steps, dead band, latency; no structure and no wind.

`RotatorModel` is the physics, `SimulatedRotator` a drive with it.
"""

import math
from collections import Counter, deque
from operator import sub

from rf_pointing.core.types import Pair
from rf_pointing.drives.drive import Drive, DriveReading
from rf_pointing.drives.params import DriveParams, RotatorParams


class RotatorModel:
    """Both axes of a relay rotator, exact at any step; counts starts and reversals."""

    def __init__(self, params: RotatorParams, resolution_rad: Pair, position_rad: Pair) -> None:
        self.params, self.resolution_rad = params, resolution_rad
        self.position_rad = list(position_rad)
        self.starts, self.reversals = [0, 0], [0, 0]
        self._t_s = 0.0
        self._goal: list[float | None] = [None, None]
        self._direction = [0.0, 0.0]
        self._due: deque[tuple[float, Pair]] = deque()

    @property
    def moving(self) -> bool:
        """Whether an axis moves."""
        return any(goal is not None for goal in self._goal)

    def command(self, t_s: float, position_rad: Pair | None) -> None:
        """Take a set point that acts after the latency; a stop acts at once."""
        if position_rad is None:
            self.step(t_s)
            self._due.clear()
            self._goal = [None, None]
        else:
            self._due.append((t_s + self.params.latency_s, position_rad))

    def step(self, t_s: float) -> None:
        """Move until `t_s`."""
        while self._due and self._due[0][0] <= t_s:
            due_s, goal = self._due.popleft()
            self._move(due_s)
            for axis, angle in enumerate(goal):
                self._aim(axis, angle)
        self._move(t_s)

    def encoders(self) -> Pair:
        """Return what the device shows: whole steps."""
        steps = zip(self.position_rad, self.resolution_rad, strict=True)
        first, second = (round(angle / step) * step for angle, step in steps)
        return first, second

    def _aim(self, axis: int, goal: float) -> None:
        params, step, zero = self.params, self.resolution_rad[axis], self.params.zero_rad[axis]
        goal = max(round(goal / step) * step, params.travel_min_rad[axis] - zero)
        goal = min(goal, params.travel_max_rad[axis] - zero)
        away = goal - self.position_rad[axis]
        if abs(away) <= self.params.dead_band_rad[axis]:
            self._goal[axis] = None
            return
        direction = math.copysign(1.0, away)
        if self._goal[axis] is None or direction != self._direction[axis]:
            self.starts[axis] += 1
            self.reversals[axis] += direction == -self._direction[axis]
        self._goal[axis], self._direction[axis] = goal, direction

    def _move(self, t_s: float) -> None:
        # A negative time step is a clock that went back: nothing has moved.
        elapsed, self._t_s = max(0.0, t_s - self._t_s), t_s
        for axis, goal in enumerate(self._goal):
            if goal is None:
                continue
            reach, away = elapsed * self.params.rate_rad_s[axis], goal - self.position_rad[axis]
            if abs(away) <= reach:
                self.position_rad[axis], self._goal[axis] = goal, None
            else:
                self.position_rad[axis] += math.copysign(reach, away)


class SimulatedRotator(Drive):
    """A rotator that needs no device; it is read once a poll period."""

    def __init__(self, params: DriveParams, position_rad: Pair) -> None:
        azimuth, elevation = map(sub, position_rad, params.rotator.zero_rad)
        self.capabilities = params.capabilities((1.0, 1.0))
        steps_rad = self.capabilities.resolution_rad
        self.model = RotatorModel(params.rotator, steps_rad, (azimuth, elevation))
        self.losses: Counter[str] = Counter()
        self._t_s = 0.0
        self._reading: DriveReading | None = None

    @property
    def truth_rad(self) -> Pair:  # type: ignore[override]
        azimuth, elevation = self.model.position_rad
        return azimuth, elevation

    def step(self, t_s: float) -> DriveReading | None:
        self.model.step(t_s)
        self._t_s = t_s
        newest = self._reading
        # On a grid of time: when the drive was first looked at depends on how busy the machine is.
        if newest is None or self._poll(newest.t_s) != self._poll(t_s):
            azimuth, elevation = self.model.encoders()
            if self.capabilities.one_turn:
                azimuth %= 2.0 * math.pi
            self._reading = DriveReading(t_s=t_s, position_rad=(azimuth, elevation))
        return self._reading

    def _poll(self, t_s: float) -> int:
        return math.floor(t_s / self.capabilities.period_s + 1e-6)

    def go_to(self, position_rad: Pair) -> None:
        self.model.command(self._t_s, position_rad)

    def stop(self) -> None:
        self.model.command(self._t_s, None)
