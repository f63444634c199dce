"""The simulated antenna as its control unit shows it: commands in, encoder angles and status out, truth beside.

Per control tick: command table -> preprocessor -> position loop of each axis -> rate command -> plant with wind.  The
encoders read the true direction plus the mount's own errors; where the beam really points is `Boresight`.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rf_pointing.calibration import BiasModel
from rf_pointing.controllers import (
    CommandPreprocessor,
    CommandPreprocessorParams,
    PositionLoop,
    PositionLoopParams,
    TrajectoryBuffer,
    TrajectoryBufferParams,
)
from rf_pointing.geometry import Boresight, JointReading, JointTrajectory, Params, parameter, random_stream
from rf_pointing.servo import AntennaPlant, PlantParams, Wind, WindParams
from rf_pointing.station.mount import MountError
from rf_pointing.station.status import AntennaStatus

__all__ = ["AntennaParams", "LoopParams", "SimulatedAntenna"]

Array = NDArray[np.float64]
REST_RAD_S = math.radians(1e-3)
LONGEST_STOP_S = 30.0


@dataclass(frozen=True, kw_only=True)
class LoopParams(Params):
    """Position loops of both axes and the limits that every command is brought within."""

    azimuth: PositionLoopParams = parameter(PositionLoopParams(), "azimuth position loop")
    elevation: PositionLoopParams = parameter(PositionLoopParams(), "elevation position loop")
    preprocessor: CommandPreprocessorParams = parameter(CommandPreprocessorParams(), "limits of the commands")
    table: TrajectoryBufferParams = parameter(TrajectoryBufferParams(), "trust in the command table")


@dataclass(frozen=True, kw_only=True)
class AntennaParams(Params):
    """Tick, start and randomness of the simulated antenna."""

    tick_s: float = parameter(0.02, "control period", low=0.001, high=0.1)
    lag_averaging_s: float = parameter(
        10.0, "time over which rates are averaged for the mount's lag terms", low=0.1, high=100.0
    )
    start_azimuth_rad: float = parameter(math.radians(120.0), "azimuth at the start", low=-20.0, high=20.0)
    start_elevation_rad: float = parameter(math.radians(60.0), "elevation at the start", low=0.0, high=1.6)
    seed: int = parameter(1, "seed of every noise source", low=0, high=2**31 - 1)


class SimulatedAntenna:
    """One antenna; `enable` it, then `step` once a tick. Outputs of `step` are those at the tick's beginning."""

    def __init__(
        self, params: AntennaParams, plant: PlantParams, loops: LoopParams, wind: WindParams, mount: BiasModel
    ) -> None:
        self.params = params
        start = (params.start_azimuth_rad, params.start_elevation_rad)
        self._plant = AntennaPlant(plant, random_stream(params.seed, "encoder"), start)
        self._plant.brake()
        self._wind = Wind(wind, random_stream(params.seed, "wind"))
        self._table = TrajectoryBuffer(loops.table)
        self._preprocessor = CommandPreprocessor(loops.preprocessor)
        self._preprocessor.reset(start)
        self._loops = tuple(PositionLoop(loop, params.tick_s) for loop in (loops.azimuth, loops.elevation))
        self._limits = loops.preprocessor
        self._mode, self._fault, self._rejection = "inactive", "", ""
        self._accepted = self._rejected = 0
        self._hold = np.array(start)
        self._rate_command = np.zeros(2)
        self._mean_rate = np.zeros(2)
        self._mount_error = MountError(mount)
        self._newest_s = 0.0

    @property
    def mode(self) -> str:
        """inactive, holding, tracking, stopping or fault."""
        return self._mode

    def enable(self) -> None:
        """Release the brakes and hold where the axes are; nothing moves."""
        self._hold = self._plant.encoder_rad
        self._preprocessor.reset(self._hold)
        for axis, loop in enumerate(self._loops):
            loop.reset(float(self._hold[axis]), 0.0, float(self._hold[axis]), 0.0)
        self._table.clear()
        self._plant.release_brake()
        self._mode = "fault" if self._fault else "holding"

    def disable(self) -> None:
        """Decelerate at the limits, then set the brakes; the seconds that this takes pass at once."""
        self.stop()
        for _ in range(round(LONGEST_STOP_S / self.params.tick_s)):
            if self._mode != "stopping":
                break
            self.step(self._newest_s + self.params.tick_s)
        self._plant.brake()
        self._mode = "inactive"

    def retune(self, loops: LoopParams) -> None:
        """Take new gains and limits between two ticks; refused as a whole if one is impossible."""
        for loop, params in zip(self._loops, (loops.azimuth, loops.elevation), strict=True):
            loop.retune(params)
        self._preprocessor.retune(loops.preprocessor)
        self._limits = loops.preprocessor

    def stop(self, reason: str = "") -> None:
        """Decelerate both axes at their limits; with a reason the stop latches as a fault."""
        self._table.clear()
        self._preprocessor.stop()
        if reason:
            self._fault = reason
        if self._mode in ("tracking", "holding"):
            self._mode = "stopping"

    def reset_fault(self) -> str:
        """Clear a latched fault; return why not, "" when it is cleared."""
        if not self._fault:
            return "no fault is latched"
        if self._mode == "stopping":
            return "the axes are still moving"
        self._fault = ""
        if self._mode == "fault":
            self._mode = "holding"
        return ""

    def accept(self, trajectory: JointTrajectory, now_s: float) -> str:
        """Take a command; return "" or why it was rejected. A rejected command changes nothing but the count."""
        if self._fault:
            return self.reject(f"fault latched ({self._fault}); reset it first")
        if self._mode == "inactive":
            return self.reject("the antenna is not active")
        answer = self._table.accept(trajectory, now_s)
        if not answer.accepted:
            return self.reject(answer.reason)
        self._accepted += 1
        self._preprocessor.follow()
        if self._mode != "tracking":
            self._mode = "tracking"
        return ""

    def reject(self, reason: str) -> str:
        """Count a command that could not be used, and return the reason."""
        self._rejected += 1
        self._rejection = reason
        return reason

    def reading(self, t_s: float) -> JointReading:
        """Return the encoders as they stand, stamped `t_s`."""
        return JointReading(t_s=t_s, position_rad=self._plant.encoder_rad, velocity_rad_s=self._plant.velocity_rad_s)

    def step(self, t_s: float) -> tuple[JointReading, Boresight]:
        """Return encoder reading and true boresight at `t_s`, then advance by one tick."""
        self._newest_s = t_s
        reading = self.reading(t_s)
        measured = reading.position_rad
        boresight = self._boresight(t_s, reading.velocity_rad_s)
        torque = self._wind.step(self.params.tick_s, boresight.azimuth_rad, boresight.elevation_rad)
        self._rate_command = self._rates(t_s, measured) if self._mode != "inactive" else np.zeros(2)
        self._plant.step(self._rate_command, torque, self.params.tick_s)
        return reading, boresight

    def status(self, t_s: float) -> AntennaStatus:
        """Return the status at `t_s`."""
        return AntennaStatus(
            t_s=t_s,
            mode=self._mode,
            fault=self._fault,
            commanded_rad=self._preprocessor.state.position_rad,
            rate_command_rad_s=self._rate_command,
            rate_limit_rad_s=np.array(self._limits.rate_limit_rad_s),
            acceleration_limit_rad_s2=np.array(self._limits.acceleration_limit_rad_s2),
            at_limit=self._plant.at_stop,
            command_lead_s=0.0 if self._table.empty else self._table.lead_s(t_s),
            commands_accepted=self._accepted,
            commands_rejected=self._rejected,
            last_rejection=self._rejection,
        )

    def _rates(self, t_s: float, measured: Array) -> Array:
        position, velocity, acceleration = self._command(t_s)
        feasible = self._preprocessor.step(position, velocity, acceleration, self.params.tick_s)
        if self._mode == "stopping" and float(np.max(np.abs(feasible[1]))) == 0.0:
            self._hold = feasible[0]
            self._mode = "fault" if self._fault else "holding"
        rates = np.zeros(2)
        for axis, loop in enumerate(self._loops):
            rates[axis] = loop.output(
                float(feasible[0][axis]), float(feasible[1][axis]), float(measured[axis]), float(feasible[2][axis])
            )
            loop.update(self.params.tick_s, float(rates[axis]))
        return rates

    def _command(self, t_s: float) -> tuple[Array, Array, Array]:
        """Return what to follow at `t_s`: the table, or the held position when there is none."""
        if self._mode == "tracking":
            sample = self._table.at(t_s)
            if sample.source != "dry":
                return sample.position_rad, sample.velocity_rad_s, sample.acceleration_rad_s2
            if self._ends_at_rest(sample.t_s):
                self._hold, self._mode = sample.position_rad, "holding"
            else:
                self.stop(f"commands ran dry {-self._table.lead_s(t_s):.1f} s ago while moving")
        return self._hold, np.zeros(2), np.zeros(2)

    def _ends_at_rest(self, t_s: float) -> bool:
        last = self._table.at(t_s + self._table.lead_s(t_s))
        return float(np.max(np.abs(last.velocity_rad_s))) < REST_RAD_S

    def _boresight(self, t_s: float, velocity: Array) -> Boresight:
        """Return the true direction of the beam.

        The mount's lags stand for what drags behind at a steady rate.  On the momentary rate, vibration included, a lag
        of seconds would be a prediction, and no loop could be closed on it.
        """
        acceleration = (velocity - self._mean_rate) / self.params.lag_averaging_s
        sky = self._mount_error.remove(t_s, self._plant.beam_rad, self._mean_rate, acceleration)
        self._mean_rate = self._mean_rate + acceleration * self.params.tick_s
        azimuth, elevation = sky.tolist()
        if elevation > 0.5 * math.pi:
            azimuth, elevation = azimuth - math.pi, math.pi - elevation
        return Boresight(t_s=t_s, azimuth_rad=azimuth, elevation_rad=elevation)
