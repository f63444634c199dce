"""A branch as the controller carries it out: side of the zenith, crossing, turns.

The controller thinks in direct axis angles.  While the dish is over the top its angles are turned
on the way out and back on the way in; on a branch that goes over in the middle of the pass that
begins at one instant, `crossing.over_t_s`.
"""

import dataclasses
import math

import numpy as np
from numpy.typing import NDArray

from rf_pointing.core import Array, BoolArray, JointReading, JointTrajectory, Motion, Quintic
from rf_pointing.planning import Branch, plunged, unplunged

# Over the top the elevation axis turns the other way for the same motion on the sky.
MIRROR = np.array([1.0, -1.0])


class TrackingBranch:
    """The course of one branch; without one the dish is direct and follows the target."""

    def __init__(self, branch: Branch | None = None) -> None:
        self._branch, self._found = branch, branch.crossing if branch else None
        # The dish never goes over the top and never leaves the target: most passes, every period.
        self.direct = branch is None or (not branch.plunge and branch.crossing is None)

    @property
    def turns_rad(self) -> float:
        """Whole turns of the branch."""
        return 2.0 * math.pi * self._branch.turns if self._branch else 0.0

    def plunge_at(self, t_s: float) -> bool:
        """Whether the dish is over the top at `t_s`."""
        over_t_s = self._found.over_t_s if self._found else None
        over = over_t_s is not None and t_s >= over_t_s
        return self._branch is not None and self._branch.plunge != over

    def turned_rad(self, t_s: float) -> float:
        """Return the turns that going over the top, or unwinding, has added before `t_s`."""
        at_s = self._found.turn_t_s if self._found else None
        return self._found.turn_rad if self._found and at_s is not None and t_s >= at_s else 0.0

    def crossing(self, t_s: float) -> bool:
        """Whether the antenna leaves the target at `t_s` because its axes are too slow for it."""
        return self._found is not None and bool(self._found.t_s[0] <= t_s <= self._found.t_s[-1])

    def planned_error_rad(self, t_s: float) -> float:
        """Return how far the crossing leaves the target at `t_s`, 0 outside of it."""
        if self._found is None or not self.crossing(t_s):
            return 0.0
        return float(np.interp(t_s, self._found.t_s, self._found.error_rad))

    def signs(self, times: Array) -> Array:
        """Return the signs (n, 2) between rates in direct angles and rates of the axes."""
        over = np.array([self.plunge_at(float(t)) for t in times])
        return np.where(over[:, None], MIRROR, 1.0)

    def to_axes(self, trajectory: JointTrajectory) -> JointTrajectory:
        """Return a trajectory in direct angles as the axes must move."""
        over = np.array([self.plunge_at(float(t)) for t in trajectory.t_s])[:, None]
        if not over.any():
            return trajectory
        own = (trajectory.position_rad, trajectory.velocity_rad_s, trajectory.acceleration_rad_s2)
        position, velocity, acceleration = (
            np.where(over, there, here) for here, there in zip(own, plunged(*own), strict=True)
        )
        return dataclasses.replace(
            trajectory, position_rad=position, velocity_rad_s=velocity, acceleration_rad_s2=acceleration
        )

    def axes_rad(self, t_s: float, direct_rad: Array) -> Array:
        """Return direct angles (2,) at `t_s` as the encoders show them."""
        still = np.zeros(2)
        return plunged(direct_rad, still, still)[0] if self.plunge_at(t_s) else direct_rad

    def from_axes(self, reading: JointReading) -> JointReading:
        """Return a reading of the axes in direct angles; undoes `to_axes`."""
        if not self.plunge_at(reading.t_s):
            return reading
        position, velocity, _ = unplunged(reading.position_rad, reading.velocity_rad_s, np.zeros(2))
        return dataclasses.replace(reading, position_rad=position, velocity_rad_s=velocity)

    def detour(self, times: Array, motion: Motion) -> Motion:
        """Return the motion (n, 2) in direct angles, the crossing's while it lasts."""
        rows = [part.copy() for part in motion]
        for index in self._inside(times):
            for row, part in zip(rows, self._table_at(float(times[index])), strict=True):
                row[index] = part
        return Motion(*rows)

    def ends_of_crossing(self, times: Array) -> tuple[Motion, BoolArray] | None:
        """Return the motion (2, 2) at both ends of the crossing, and which are over the top (2,).

        None when none of the times (n,) lies within the crossing.
        """
        if self._found is None or len(self._inside(times)) == 0:
            return None
        ends = self._found.t_s[[0, -1]]
        table = [self._table_at(float(t)) for t in ends]
        over = np.array([self.plunge_at(float(t)) for t in ends])
        return Motion(*(np.array(rows) for rows in zip(*table, strict=True))), over

    def carry(self, times: Array, predicted: Motion, corrected: Motion, offsets_rad: Array) -> Motion:
        """Return `corrected` (n, 2), during the crossing `predicted` with offsets carried along.

        `offsets_rad` (2, 2) is by how much the axes must be off the predicted motion at its two
        ends; they go over from one to the other.  Close to the zenith an offset on the sky would be
        any azimuth.
        """
        assert self._found is not None
        ends = self._found.t_s[[0, -1]]
        first, last = offsets_rad * self.signs(ends)
        begin_s, duration_s = float(ends[0]), self._found.duration_s
        signs = self.signs(times)
        rows = [part.copy() for part in corrected]
        for index in self._inside(times):
            eased = _eased((float(times[index]) - begin_s) / duration_s, duration_s)
            for order, (row, part, gone) in enumerate(zip(rows, predicted, eased, strict=True)):
                row[index] = part[index] + signs[index] * (gone * (last - first) + (first if order == 0 else 0.0))
        return Motion(*rows)

    def _inside(self, times: Array) -> NDArray[np.intp]:
        if self._found is None:
            return np.zeros(0, dtype=np.intp)
        return np.flatnonzero((times >= self._found.t_s[0]) & (times <= self._found.t_s[-1]))

    def _table_at(self, t_s: float) -> Motion:
        """Return the motion (2,) of the crossing at one instant, in direct angles."""
        assert self._found is not None
        known = self._found
        step_s = float(known.t_s[1] - known.t_s[0])
        # The last instant belongs to the last interval.
        row = min(int((t_s - float(known.t_s[0])) / step_s), len(known.t_s) - 2)
        table = (known.position_rad, known.velocity_rad_s, known.acceleration_rad_s2)
        start, end = (Motion(*(part[index] for part in table)) for index in (row, row + 1))
        here = Quintic(start, end, step_s).at(t_s - float(known.t_s[row]))
        return Motion(*unplunged(*here)) if self.plunge_at(t_s) else here


def _eased(share: float, duration_s: float) -> tuple[float, float, float]:
    """Return 3 x^2 - 2 x^3, a step whose rate does not jump, and its two derivatives in time."""
    return (
        share**2 * (3.0 - 2.0 * share),
        6.0 * share * (1.0 - share) / duration_s,
        6.0 * (1.0 - 2.0 * share) / duration_s**2,
    )
