"""What the axes follow: a commander's table, a position of the antenna's own, or rest; each by a way that is free.

The preprocessor makes it feasible, so a step becomes a slew and a stop decelerates at the limits.
"""

import math

import numpy as np
from numpy.typing import NDArray

from rf_pointing.controllers import CommandPreprocessor, TrajectoryBuffer, TrajectorySample
from rf_pointing.core import JointTrajectory
from rf_pointing.planning import CornerPath
from rf_pointing.station.antenna.loops import LoopParams

__all__ = ["NEW_COURSE_RAD", "SlewPath"]

Array = NDArray[np.float64]
Pair = tuple[float, float]
Corners = tuple[Pair, ...]
REST_RAD_S = math.radians(1e-3)
NEW_COURSE_RAD = math.radians(0.5)
"""A command this far from the present course is a position to go to, by a way that the gate must find."""


class SlewPath:
    """The command of both axes; begins at rest at `start_rad`."""

    def __init__(self, loops: LoopParams, start_rad: Pair) -> None:
        self.table = TrajectoryBuffer(loops.table)
        self.preprocessor = CommandPreprocessor(loops.preprocessor)
        self.preprocessor.reset(start_rad)
        self.goal_rad = np.array(start_rad)
        self._way = CornerPath()

    def stand(self, position_rad: Array) -> None:
        """Make this position the command, with nothing left of earlier ones."""
        self.goal_rad = position_rad.copy()
        self.preprocessor.reset(self.goal_rad)
        self.table.clear()
        self._way = CornerPath()

    def stop(self) -> None:
        """Forget the commands and decelerate at the limits."""
        self.table.clear()
        self._way = CornerPath()
        self.preprocessor.stop()

    def go(self, goal_rad: Pair, way: Corners) -> None:
        """Go to a position by these corners."""
        self.table.clear()
        self.goal_rad, self._way = np.array(goal_rad), CornerPath(way)
        self.preprocessor.follow()

    def leaves(self, trajectory: JointTrajectory, present_rad: Array, following: bool) -> bool:
        """Return whether a table begins away from the present course: it then needs a way of its own."""
        follows = following and not self.table.empty
        course = self.table.at(float(trajectory.t_s[0])).position_rad if follows else present_rad
        return float(np.max(np.abs(trajectory.position_rad[0] - course))) > NEW_COURSE_RAD

    def take_way(self, way: Corners) -> None:
        """Reach the next table by these corners."""
        self._way = CornerPath(way)

    def ends_at_rest(self, t_s: float) -> bool:
        """Return whether the table's last point stands."""
        last = self.table.at(t_s + self.table.lead_s(t_s))
        return float(np.max(np.abs(last.velocity_rad_s))) < REST_RAD_S

    def step(self, sample: TrajectorySample | None, present_rad: Pair, tick_s: float) -> tuple[Array, Array, Array]:
        """Return the feasible position, velocity, acceleration towards the next corner, the table's sample or the goal."""
        corner = self._way.next(present_rad)
        if corner is None and sample is not None:
            command = sample.position_rad, sample.velocity_rad_s, sample.acceleration_rad_s2
        else:
            command = self.goal_rad if corner is None else np.array(corner), np.zeros(2), np.zeros(2)
        return self.preprocessor.step(*command, tick_s)
