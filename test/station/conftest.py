"""A real pass, and a pointing controller on an antenna that is always exactly where it was told to be."""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest

from rf_pointing.controllers import TrackerIntegratorParams
from rf_pointing.core import JointReading, JointTrajectory, PointingError
from rf_pointing.ephemeris import Pass, TopocentricTrack, first_pass_above
from rf_pointing.ephemeris.source import SourceParams, load_elements, load_track
from rf_pointing.station.pointing.certificates import pass_profile
from rf_pointing.station.pointing.controller import PointingController
from rf_pointing.station.pointing.params import ControllerParams
from rf_pointing.station.pointing.status import TrackingStatus

LEAD_S = 2.0
DEFAULTS = ControllerParams(integrator=TrackerIntegratorParams(bandwidth_hz=0.2, offset_limit_rad=math.radians(0.6)))


@pytest.fixture(scope="session")
def track() -> TopocentricTrack:
    """Return CBERS-2 seen from DSS-13."""
    return load_track(SourceParams())


@pytest.fixture(scope="session")
def window(track: TopocentricTrack) -> Pass:
    """Return its first pass above 40 deg: 12 minutes, north is crossed, peak 44 deg."""
    epoch_t_s = load_elements(SourceParams()).epoch_t_s
    return first_pass_above(track, epoch_t_s, math.radians(40.0), math.radians(5.0), 2.0 * 86400.0)


@dataclass
class Rig:
    """Steps a controller once a period; the axes are where the last trajectory puts them."""

    controller: PointingController
    track: TopocentricTrack
    position_rad: np.ndarray
    velocity_rad_s: np.ndarray = field(default_factory=lambda: np.zeros(2))
    latest: JointTrajectory | None = None

    def move(self, t_s: float) -> None:
        """Put the axes where they are commanded to be at `t_s`."""
        if self.latest is not None:
            row = int(np.argmin(np.abs(self.latest.t_s - t_s)))
            self.position_rad, self.velocity_rad_s = self.latest.position_rad[row], self.latest.velocity_rad_s[row]

    def period(
        self, t_s: float, errors: list[PointingError] | None = None
    ) -> tuple[JointTrajectory | None, TrackingStatus]:
        """Give the controller what it would have received by `t_s`, and step it."""
        self.move(t_s)
        self.controller.take_joints(
            JointReading(t_s=t_s, position_rad=self.position_rad, velocity_rad_s=self.velocity_rad_s)
        )
        self.controller.take_target(self.track.target_at(round(t_s + LEAD_S, 6)))
        for error in errors or []:
            self.controller.take_error(error)
        trajectory, status = self.controller.step(t_s)
        self.latest = trajectory or self.latest
        return trajectory, status

    def run(
        self, start_s: float, seconds: float, sense: Callable[[float, "Rig"], list[PointingError]] | None = None
    ) -> Iterator[tuple[float, JointTrajectory | None, TrackingStatus]]:
        """Step through `seconds`; `sense(t_s, rig)` gives the errors that arrive before each period."""
        for step in range(1, round(seconds * 10.0) + 1):
            t_s = round(start_s + 0.1 * step, 6)
            self.move(t_s)
            yield (t_s, *self.period(t_s, sense(t_s, self) if sense else None))


@pytest.fixture
def make_controller(track: TopocentricTrack, window: Pass) -> Callable[..., PointingController]:
    """Return a maker of controllers that have the profile of the pass; keywords replace single parameter sets."""
    profile = pass_profile(track, window)

    def make(**changes: Any) -> PointingController:
        made = PointingController(DEFAULTS.replace(**changes))
        made.plan.take_profiles([profile])
        return made

    return make


@pytest.fixture
def rig(
    track: TopocentricTrack, window: Pass, make_controller: Callable[..., PointingController]
) -> Callable[..., Rig]:
    """Return a maker of rigs that track the pass with `sensor`: run up to its beginning, or just started at `start_s`."""

    def make(
        sensor: str = "program", start_s: float | None = None,
        azimuth_rad: float = window.aos_azimuth_rad, **changes: Any,
    ) -> Rig:  # fmt: skip
        controller = make_controller(**changes)
        standing = np.array([azimuth_rad, window.aos_elevation_rad])
        made = Rig(controller, track, standing)
        begin_s = window.aos_t_s - 3.0 if start_s is None else start_s
        controller.take_joints(JointReading(t_s=begin_s, position_rad=standing, velocity_rad_s=np.zeros(2)))
        controller.start(begin_s, window, sensor)
        if start_s is None:
            list(made.run(begin_s, 3.0))
        return made

    return make
