"""The axes of the antenna in closed loop: what they follow, the laws that follow it, and the drives; no mode is known here.

`look` begins a tick, `drive` ends it and `watch` looks at the sensors after it.
"""

import math

import numpy as np
from numpy.typing import NDArray

from rf_pointing.calibration import BiasModel
from rf_pointing.controllers import CommandPreprocessorParams
from rf_pointing.core import Boresight
from rf_pointing.servo import PlantParams, WindParams
from rf_pointing.station.antenna.hardware import AntennaHardware, AntennaParams
from rf_pointing.station.antenna.loops import AxisLoops, LoopParams
from rf_pointing.station.antenna.safety import AntennaSafety
from rf_pointing.station.antenna.slew_path import SlewPath

__all__ = ["AntennaAxes", "pair"]

Array = NDArray[np.float64]
MOVING_RAD_S = math.radians(0.1)


class AntennaAxes:
    """Hardware, course and position laws of both axes.

    `used_rad` (2,) are the encoder angles with impossible readings bridged, `rate_command_rad_s` (2,) what the drives
    were told last, `t_s` the time of the latest tick.
    """

    def __init__(
        self,
        params: AntennaParams,
        plant: PlantParams,
        loops: LoopParams,
        wind: WindParams,
        mount: BiasModel,
        safety: AntennaSafety,
    ) -> None:
        self._safety = safety
        self.hardware = AntennaHardware(params, plant, wind, mount)
        self.course = SlewPath(loops, params.start_rad)
        self.loops = AxisLoops(loops, plant, params.tick_s)
        self.used_rad = self.hardware.plant.encoder_rad
        self.rate_command_rad_s = np.zeros(2)
        self.t_s = 0.0

    @property
    def limits(self) -> CommandPreprocessorParams:
        """The limits that every command is brought within."""
        return self.loops.params.preprocessor

    @property
    def travel_rad(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """Lower and upper end of the commanded travel of azimuth and elevation."""
        azimuth, elevation = zip(self.limits.travel_min_rad, self.limits.travel_max_rad, strict=True)
        return azimuth, elevation

    @property
    def moving(self) -> bool:
        """Whether an axis turns too fast to be left to its brakes or to an experiment."""
        return float(np.max(np.abs(self.hardware.plant.velocity_rad_s))) > MOVING_RAD_S

    def check(self, plant: PlantParams, loops: LoopParams) -> None:
        """Raise ValueError, saying why, if `retune` would refuse these; changes nothing."""
        self.hardware.plant.check(plant)
        if loops != self.loops.params:
            self.loops.check(loops, plant)

    def retune(self, plant: PlantParams, loops: LoopParams) -> None:
        """Take new laws, gains and limits between two ticks, without a jump; refused as a whole if one is impossible.

        Another plant stands for an antenna that changes in the middle of its motion: laws that were in force before stay
        in force, and how they take it is theirs to find out.
        """
        self.check(plant, loops)
        if plant != self.hardware.plant.params:
            self.hardware.plant.reconfigure(plant)
        if loops != self.loops.params:
            self.loops.retune(loops, plant)
            self.course.preprocessor.retune(loops.preprocessor)
            self._safety.retune(loops.preprocessor)

    def hold(self) -> None:
        """Make the present angles the command, with the laws at rest and nothing left of earlier commands."""
        self.course.stand(self.used_rad)
        self.loops.reset(self.used_rad, self.used_rad)

    def take_over(self) -> None:
        """Hand axes that rate commands have moved back to the laws without a jump, and bring them to rest."""
        position, velocity = self.hardware.plant.encoder_rad, self.hardware.plant.velocity_rad_s
        self.course.preprocessor.reset(position, velocity)
        self.course.stop()
        self.loops.reset(position, position, velocity, self.rate_command_rad_s)

    def cut(self) -> None:
        """Cut the drives and set the brakes at once."""
        self.hardware.plant.brake()
        self.course.stop()
        self.rate_command_rad_s = np.zeros(2)

    def look(self, t_s: float) -> Boresight:
        """Begin the tick at `t_s` and return the true direction of the beam."""
        self.t_s = t_s
        return self.hardware.look(t_s)

    def drive(self, rates_rad_s: Array) -> None:
        """Move the axes through this tick at these rate commands (2,)."""
        self.rate_command_rad_s = rates_rad_s
        self.hardware.move(rates_rad_s)

    def watch(self) -> str:
        """Look at the sensors after a tick: bridge what cannot be, and return why the drives must be cut, "" if not."""
        plant = self.hardware.plant
        used, reason = self._safety.tick(
            self.hardware.encoders(),
            pair(plant.true_joint_rad),
            pair(plant.velocity_rad_s),
            pair(self.rate_command_rad_s),
        )
        self.used_rad = np.array(used)
        return reason if plant.powered else ""


def pair(values: Array) -> tuple[float, float]:
    """Return the azimuth and elevation of an array (2,)."""
    azimuth, elevation = values.tolist()
    return azimuth, elevation
