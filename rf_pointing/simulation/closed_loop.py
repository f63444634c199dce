"""The time loop of every simulation: an antenna moves, then everything else acts.

`ticks` is the loop.  The simulations of the station run an antenna with the controller that points
it, `PointedAntenna`.
"""

import itertools
import math
from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple, Protocol, TypeVar

from rf_pointing.core import Boresight, JointReading, JointTrajectory, SkyUncertainty, Target
from rf_pointing.ephemeris import ElementUncertainty, TopocentricTrack, sky_uncertainty
from rf_pointing.station.antenna.drive_antenna import DriveAntenna
from rf_pointing.station.antenna.simulated_antenna import SimulatedAntenna
from rf_pointing.station.pointing.controller import PointingController
from rf_pointing.station.pointing.status import TrackingStatus

Output = TypeVar("Output", covariant=True)

TARGET_LEAD_S = 2.0
"""How far ahead the controller gets the target: its trajectories reach 1 s ahead."""


UNCERTAINTY_STEP_S = 1.0
"""Steps in which the uncertainty of the target is computed."""


class TickedAntenna(Protocol[Output]):
    """An antenna that the time loop can move."""

    def step(self, k: int) -> Output:
        """Move through tick `k` and return what came of it."""
        ...


def ticks(
    antenna: TickedAntenna[Output], count: int | None = None, first: int = 0
) -> Iterator[tuple[int, Output]]:
    """Yield the number of each tick and what the antenna returned for it.

    The caller acts between two ticks: what it changes then is in force in the next tick.
    Without `count` it ends the loop.
    """
    for k in itertools.count(first) if count is None else range(first, first + count):
        yield k, antenna.step(k)


class PointedTick(NamedTuple):
    """One tick at `t_s`; `status`, `trajectory` and `target` only in the controller's periods."""

    t_s: float
    reading: JointReading
    boresight: Boresight
    status: TrackingStatus | None
    trajectory: JointTrajectory | None
    target: Target | None = None


class PointedAntenna:
    """An antenna and the controller that points it; tick `k` is at `start_s` + k periods.

    The controller gets the target once a period, `TARGET_LEAD_S` ahead, the first one not before
    `targets_from_s`, with the uncertainty that the `law` gives to it.

    The order within a tick is the order in which messages arrive in the graph: first the antenna,
    then, when its period is due, the controller, whose trajectory begins in the future.
    """

    def __init__(
        self,
        antenna: SimulatedAntenna | DriveAntenna,
        controller: PointingController,
        track: TopocentricTrack,
        start_s: float,
        targets_from_s: float = -math.inf,
        law: ElementUncertainty | None = None,
    ) -> None:
        self.antenna, self.controller = antenna, controller
        self._track, self._start_s, self._targets_from_s = track, start_s, targets_from_s
        self._law, self._known_at_s = law, -math.inf
        self._uncertainty: SkyUncertainty | None = None
        self._every = round(controller.params.pointing.period_s / antenna.params.tick_s)
        self._known = antenna.reading(start_s)
        controller.take_joints(self._known)

    def step(self, k: int) -> PointedTick:
        """Move through tick `k`; in the controller's period let it send its trajectory."""
        # Stamps on whole microseconds, as on the wire: a sum of ticks would drift off the grid of
        # the periods.
        t_s = round(self._start_s + k * self.antenna.params.tick_s, 6)
        reading, boresight = self.antenna.step(t_s)
        if reading is None or boresight is None:
            raise ValueError("a simulated antenna must read its axes, and say where its beam is")
        # The controller's period is a few ticks long, 5 at 10 and 50 Hz.
        if k % self._every:
            return PointedTick(t_s, reading, boresight, None, None)
        # As on the graph, a period knows where the axes were when the one before began.
        self.controller.take_joints(self._known)
        self._known = reading
        # A real publisher predicts no target long before the pass.
        target = None
        if t_s + TARGET_LEAD_S >= self._targets_from_s:
            target = self._target_at(round(t_s + TARGET_LEAD_S, 6))
            self.controller.take_target(target)
        self.controller.take_antenna(
            self.antenna.published_mode(t_s), self.antenna.safety.latch.text
        )
        trajectory, status = self.controller.step(t_s)
        # Accepted at once: it begins a tenth of a second ahead, longer than any transport.
        if trajectory is not None:
            self.antenna.accept(trajectory, t_s)
        return PointedTick(t_s, reading, boresight, status, trajectory, target)

    def _target_at(self, t_s: float) -> Target:
        # It changes slowly, and costs as much as the target.
        if self._law is not None and t_s - self._known_at_s >= UNCERTAINTY_STEP_S:
            self._known_at_s, self._uncertainty = t_s, sky_uncertainty(self._track, t_s, self._law)
        target = self._track.target_at(t_s)
        return (
            target if self._uncertainty is None else replace(target, uncertainty=self._uncertainty)
        )
