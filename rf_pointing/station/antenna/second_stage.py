"""The second stage in front of any device, simulated or real: its law, once a tick of the antenna.

It follows while the antenna tracks, and goes to its centre otherwise.  A device with a problem is
no longer commanded off its centre, and its last deflection counts: it stays where it was.
"""

import math
from typing import TYPE_CHECKING, Protocol

from rf_pointing.controllers.second_stage import SecondStage
from rf_pointing.core.second_stage import axes_from_sky, sky_from_axes
from rf_pointing.core.types import Array

if TYPE_CHECKING:
    from rf_pointing.station.antenna.stage_design import StageDesign

LONGEST_TICK_S = 1.0


class StageDevice(Protocol):
    """A stage that can be commanded; `deflection_rad` (2,) is the newest that is known of it."""

    @property
    def deflection_rad(self) -> Array: ...
    @property
    def problem(self) -> str: ...

    def command(self, deflection_rad: Array) -> None: ...


class StageLoop:
    """One antenna's stage; ValueError for one that would not serve this antenna."""

    def __init__(self, device: StageDevice, design: "StageDesign") -> None:
        design.require_useful()
        self.device, self._follows = device, False
        self._law = SecondStage(design.params, design.taps)

    def tick(self, dt_s: float, command_rad: Array, encoder_rad: Array, *, tracking: bool) -> None:
        """Command the device for the next `dt_s` by command and encoders (2,) of the axes."""
        residual = sky_from_axes(command_rad - encoder_rad, float(encoder_rad[1]))
        self._follows = tracking and not self.device.problem
        wanted = self._law.step(residual, min(dt_s, LONGEST_TICK_S), follow=self._follows)
        self.device.command(wanted)

    def axes_rad(self, upper_rad: float) -> Array:
        """Return the axis angles (2,) that the deflection is worth with the upper axis there."""
        return axes_from_sky(self.device.deflection_rad, upper_rad)

    @property
    def warning(self) -> str:
        """Why the mount is on its own while it tracks, "" if it is not."""
        if self.device.problem:
            return f"second stage: {self.device.problem}; the mount points alone"
        if self._law.state.handed_back:
            travel = f"its travel of {math.degrees(self._law.params.travel_rad):.4g} deg"
            return f"second stage: the mount is farther off than {travel}; it is centred"
        return ""

    @property
    def mode(self) -> str:
        """Word for the operator."""
        return "centred" if self.warning or not self._follows else "follows"
