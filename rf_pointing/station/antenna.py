"""The simulated antenna as its control unit shows it: commands in, encoder angles and status out, truth beside.

Per control tick: command table -> preprocessor -> position law of each axis -> rate command -> plant with wind.  In
manual-rate mode an identification experiment gives the rate commands instead.  A loop that oscillates has its drives cut
and the brakes set, and the fault latches.  The encoders read the true direction plus the mount's own errors; where the
beam really points is `Boresight`.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rf_pointing.calibration import BiasModel
from rf_pointing.controllers import CommandPreprocessor, OscillationDetector, TrajectoryBuffer
from rf_pointing.geometry import Boresight, JointReading, JointTrajectory, Motion, Params, parameter, random_stream
from rf_pointing.identification import IdentificationExperiment
from rf_pointing.servo import AntennaPlant, PlantParams, Wind, WindParams
from rf_pointing.station.axis_loops import AxisLoops, LoopParams
from rf_pointing.station.mount import MountError
from rf_pointing.station.status import AntennaStatus

__all__ = ["AntennaParams", "LoopParams", "SimulatedAntenna"]

Array = NDArray[np.float64]
REST_RAD_S = math.radians(1e-3)
MOVING_RAD_S = math.radians(0.1)
LONGEST_STOP_S = 30.0


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
        self._experiment: IdentificationExperiment | None = None
        self._loops = AxisLoops(loops, plant, params.tick_s)
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
        """inactive, holding, tracking, manual_rate, stopping or fault."""
        return self._mode

    def enable(self) -> None:
        """Release the brakes and hold where the axes are; nothing moves.  After an oscillation they stay set."""
        self._mode = "fault" if self._fault else "holding"
        if not self._loops.oscillation:
            self._hold_here()
            self._plant.release_brake()

    def disable(self) -> None:
        """Decelerate at the limits, then set the brakes; the seconds that this takes pass at once."""
        self.stop()
        for _ in range(round(LONGEST_STOP_S / self.params.tick_s)):
            if self._mode != "stopping":
                break
            self.step(self._newest_s + self.params.tick_s)
        self._plant.brake()
        self._mode = "inactive"

    def check(self, plant: PlantParams, loops: LoopParams) -> None:
        """Raise ValueError, saying why, if `retune` would refuse these; changes nothing."""
        self._plant.check(plant)
        if loops != self._loops.params:
            self._loops.check(loops, plant)

    def retune(self, plant: PlantParams, loops: LoopParams) -> None:
        """Take new laws, gains and limits between two ticks, without a jump; refused as a whole if one is impossible.

        Another plant stands for an antenna that changes in the middle of its motion: laws that were in force before stay
        in force, and how they take it is theirs to find out.
        """
        self.check(plant, loops)
        if plant != self._plant.params:
            self._plant.reconfigure(plant)
        if loops != self._loops.params:
            self._loops.retune(loops, plant)
            self._preprocessor.retune(loops.preprocessor)
            self._limits = loops.preprocessor

    @property
    def travel_rad(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """Lower and upper end of the commanded travel of azimuth and elevation."""
        azimuth, elevation = zip(self._limits.travel_min_rad, self._limits.travel_max_rad, strict=True)
        return azimuth, elevation

    @property
    def oscillation_watch(self) -> tuple[OscillationDetector, ...]:
        """The oscillation detectors of azimuth and elevation."""
        return self._loops.watch

    def stop(self, reason: str = "") -> None:
        """Decelerate both axes at their limits; with a reason the stop latches as a fault."""
        self._table.clear()
        self._preprocessor.stop()
        if reason:
            self._fault = reason
        if self._mode == "manual_rate":
            self._leave_manual_rate(reason or "stop was requested")
        if self._mode in ("tracking", "holding"):
            self._mode = "stopping"

    def identify(self, experiment: IdentificationExperiment) -> str:
        """Let an experiment drive the axes until it has finished or `stop`; return why not, "" when it runs."""
        if self._mode != "holding":
            return f"the antenna is {self._fault or self._mode}, must be holding"
        if abs(experiment.sample_s - self.params.tick_s) > 1e-9:
            return f"sample_s={experiment.sample_s} must be {self.params.tick_s}, the control period"
        if experiment.peak_rad_s > min(self._limits.rate_limit_rad_s):
            limit = min(self._limits.rate_limit_rad_s)
            return f"peak_rad_s={experiment.peak_rad_s} must be <= {limit}, the rate limit"
        self._experiment, self._mode = experiment, "manual_rate"
        return ""

    def reset_fault(self) -> str:
        """Clear a latched fault; return why not, "" when it is cleared."""
        if not self._fault:
            return "no fault is latched"
        if self._mode == "stopping" or float(np.max(np.abs(self._plant.velocity_rad_s))) > MOVING_RAD_S:
            return "the axes are still moving"
        self._fault = ""
        if self._loops.oscillation:
            self._hold_here()
            if self._mode == "fault":
                self._plant.release_brake()
        if self._mode == "fault":
            self._mode = "holding"
        return ""

    def accept(self, trajectory: JointTrajectory, now_s: float) -> str:
        """Take a command; return "" or why it was rejected. A rejected command changes nothing but the count."""
        if self._fault:
            return self.reject(f"fault latched ({self._fault}); reset it first")
        if self._mode == "inactive":
            return self.reject("the antenna is not active")
        if self._mode == "manual_rate":
            return self.reject("an identification drives the antenna")
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
        self._rate_command = np.zeros(2) if self._plant.braked else self._rates(t_s, measured)
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
        if self._mode == "manual_rate" and self._experiment is not None:
            if not self._experiment.finished:
                rates = self._experiment.command(measured)
                if not self._experiment.abort_reason:
                    return rates
            self._leave_manual_rate(self._experiment.abort_reason or "complete")
        position, velocity, acceleration = self._command(t_s)
        feasible = self._preprocessor.step(position, velocity, acceleration, self.params.tick_s)
        if self._mode == "stopping" and float(np.max(np.abs(feasible[1]))) == 0.0:
            self._hold = feasible[0]
            self._mode = "fault" if self._fault else "holding"
        rates = self._loops.rates(Motion(*feasible), measured)
        if not self._loops.oscillation:
            return rates
        self._table.clear()
        self._plant.brake()
        self._preprocessor.reset(measured)
        self._fault, self._mode = f"drives cut: {self._loops.oscillation}", "fault"
        return np.zeros(2)

    def _leave_manual_rate(self, reason: str) -> None:
        """Hand the moving axes back to the loops without a jump and bring them to rest."""
        if self._experiment is not None and not self._experiment.finished:
            self._experiment.abort(reason)
        position, velocity = self._plant.encoder_rad, self._plant.velocity_rad_s
        self._preprocessor.reset(position, velocity)
        self._preprocessor.stop()
        self._loops.reset(position, position, velocity, self._rate_command)
        self._table.clear()
        self._experiment, self._mode = None, "stopping"

    def _hold_here(self) -> None:
        """Make the present angles the command, with the laws at rest and nothing left of earlier commands."""
        self._hold = self._plant.encoder_rad
        self._preprocessor.reset(self._hold)
        self._loops.reset(self._hold, self._hold)
        self._table.clear()

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
