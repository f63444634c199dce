"""The simulated antenna as its control unit shows it: commands in, encoder angles and status out, truth beside.

Per control tick: command table -> preprocessor -> position law of each axis -> rate command -> plant with wind.  In
manual-rate mode an identification experiment gives the rate commands instead.  A loop that oscillates has its drives cut
and the brakes set, and the fault latches.  What is driven is `antenna_hardware.py`, what is followed `course.py`, what
must not happen `antenna_safety.py`.
"""

import math

import numpy as np
from numpy.typing import NDArray

from rf_pointing.calibration import BiasModel
from rf_pointing.controllers import OscillationDetector, TrajectorySample
from rf_pointing.geometry import Boresight, JointReading, JointTrajectory, Motion
from rf_pointing.identification import IdentificationExperiment
from rf_pointing.servo import PlantParams, WindParams
from rf_pointing.station.antenna_hardware import AntennaHardware, AntennaParams
from rf_pointing.station.antenna_safety import AntennaSafety, SafetyParams
from rf_pointing.station.axis_loops import AxisLoops, LoopParams
from rf_pointing.station.course import Course
from rf_pointing.station.injected_faults import InjectedFaults
from rf_pointing.station.status import AntennaStatus

__all__ = ["AntennaParams", "LoopParams", "SimulatedAntenna"]

Array = NDArray[np.float64]
MOVING_RAD_S = math.radians(0.1)
LONGEST_STOP_S = 30.0
WIND_EVERY = 5
"""Ticks between two readings of the anemometer."""
ARRIVED_RAD = math.radians(0.02)
RESTING = {"parking": "parked", "stowing": "stowed", "disabling": "disabled"}
"""Modes that end at rest with the brakes set, and the modes they end in."""
KINDS = {"tracking": "track", "parking": "park", "stowing": "stow", "holding": "preset"}
"""What the gate calls the motion of a mode that follows a command."""
MOVABLE = ("tracking", "holding", "stopping", "paused", "parking", "stowing")


class SimulatedAntenna:
    """One antenna; `enable` it, then `step` once a tick. Outputs of `step` are those at the tick's beginning."""

    def __init__(
        self,
        params: AntennaParams,
        plant: PlantParams,
        loops: LoopParams,
        wind: WindParams,
        mount: BiasModel,
        safety: SafetyParams | None = None,
    ) -> None:
        self.params = params
        self.safety = AntennaSafety(safety or SafetyParams(), loops.preprocessor, params.tick_s)
        self._hardware = AntennaHardware(params, plant, wind, mount)
        self._plant = self._hardware.plant
        self._course = Course(loops, params.start_rad)
        self._experiment: IdentificationExperiment | None = None
        self._loops = AxisLoops(loops, plant, params.tick_s)
        self._limits = loops.preprocessor
        self._mode, self._rejection = "inactive", ""
        self._accepted = self._rejected = 0
        self._rate_command = np.zeros(2)
        self._newest_s = 0.0
        self._ticks = 0
        self._used = self._plant.encoder_rad

    @property
    def mode(self) -> str:
        """inactive, holding, tracking, manual_rate, paused, stopping, fault; parking, stowing, disabling and their ends."""
        return self._mode

    @property
    def injected(self) -> InjectedFaults:
        """The faults put into drives and sensors."""
        return self._hardware.injected

    @property
    def newest_t_s(self) -> float:
        """Time of the latest tick."""
        return self._newest_s

    @property
    def _moving(self) -> bool:
        return float(np.max(np.abs(self._plant.velocity_rad_s))) > MOVING_RAD_S

    @property
    def _fault(self) -> str:
        return self.safety.latch.text

    def enable(self) -> None:
        """Release the brakes and hold where the axes are; nothing moves.  After an oscillation they stay set."""
        self.safety.release(_pair(self._plant.joint_rad))
        self._rate_command = np.zeros(2)
        self._watch_axes()
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
            self._course.preprocessor.retune(loops.preprocessor)
            self._limits = loops.preprocessor
            self.safety.retune(loops.preprocessor)

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
        self._course.stop()
        self.safety.authority.release()
        if reason:
            self.safety.latch.latch(reason, self._newest_s)
        if self._mode == "manual_rate":
            self._leave_manual_rate(reason or "stop was requested")
        if self._mode in MOVABLE:
            self._mode = "stopping"

    def identify(self, experiment: IdentificationExperiment) -> str:
        """Let an experiment drive the axes until it has finished or `stop`; return why not, "" when it runs."""
        if self._mode != "holding":
            return f"the antenna is {self._fault or self._mode}, must be holding"
        if self._moving:
            return "the axes are still moving"
        if abs(experiment.sample_s - self.params.tick_s) > 1e-9:
            return f"sample_s={experiment.sample_s} must be {self.params.tick_s}, the control period"
        if experiment.peak_rad_s > min(self._limits.rate_limit_rad_s):
            limit = min(self._limits.rate_limit_rad_s)
            return f"peak_rad_s={experiment.peak_rad_s} must be <= {limit}, the rate limit"
        refused = self.safety.check("manual", self._newest_s, _pair(self._used), self._used[None, :]).reason_of_refusal
        if refused:
            return refused
        self._experiment, self._mode = experiment, "manual_rate"
        return ""

    def pause(self) -> str:
        """Stop where the axes are and keep taking commands; `resume` goes on with them. Return "" or why not."""
        if self._mode != "tracking":
            return f"nothing to pause, the antenna is {self._mode}"
        self._course.preprocessor.stop()
        self._mode = "paused"
        return ""

    def resume(self) -> str:
        """Go on after a pause, or leave park, stow or disable and hold; return "" or why not."""
        if self._mode == "paused":
            self._course.preprocessor.follow()
            self._mode = "tracking"
            return ""
        if self._mode not in RESTING.values():
            return f"nothing to resume, the antenna is {self._mode}"
        if self.safety.wind.reason:
            return self.safety.wind.reason
        self.enable()
        return ""

    def park(self) -> str:
        """Go to the park position and set the brakes there; return "" or why not."""
        place = self.safety.params
        return self._go("parking", (place.park_azimuth_rad, place.park_elevation_rad))

    def stow(self) -> str:
        """Go to the stow elevation at the present azimuth and set the brakes there; return "" or why not."""
        return self._go("stowing", (float(self._used[0]), self.safety.params.stow_elevation_rad))

    def release(self) -> str:
        """Stop under control and set the brakes where the axes then are; return "" or why not."""
        if self._mode not in MOVABLE:
            return f"nothing to disable, the antenna is {self._mode}"
        self.stop()
        self._mode = "disabling"
        return ""

    def remain(self, mode: str) -> None:
        """Stay at rest with the brakes set, in the rest mode that the antenna was in before a restart; `resume` ends it."""
        self._plant.brake()
        self._mode = mode

    def reset_fault(self) -> str:
        """Clear a latched fault; return why not, "" when it is cleared."""
        if self._fault and (self._mode == "stopping" or self._moving):
            return "the axes are still moving"
        refused = self.safety.latch.reset(self.safety.lasting_cause())
        if not refused and self._loops.oscillation:
            self._hold_here()
        if not refused and self._mode == "fault":
            self.enable()
        return refused

    def _go(self, mode: str, goal: tuple[float, float]) -> str:
        """Begin a motion of the antenna's own, through the gate."""
        if self._fault:
            return f"fault latched ({self._fault}); reset it first"
        if self._mode not in MOVABLE:
            return f"the antenna is {self._mode}"
        kind = "stow" if mode == "stowing" else "park"
        decision = self.safety.check(kind, self._newest_s, _pair(self._used), np.array([goal]))
        if not decision.allowed:
            return decision.reason
        self.safety.authority.release()
        self._course.go(goal, decision.way)
        self._mode = mode
        return ""

    def _trip(self, reason: str) -> None:
        """Cut the drives and set the brakes at once, and latch why."""
        self.safety.latch.latch(reason, self._newest_s)
        self._plant.brake()
        self._course.stop()
        self._rate_command = np.zeros(2)
        self._mode = "fault"

    def accept(self, trajectory: JointTrajectory, now_s: float, commander: str = "") -> str:
        """Take a command of `commander`; return "" or why it was rejected: then only the count has changed."""
        if self._fault:
            return self.reject(f"fault latched ({self._fault}); reset it first")
        if self._mode == "inactive":
            return self.reject("the antenna is not active")
        if self._mode == "manual_rate":
            return self.reject("an identification drives the antenna")
        if self._mode in RESTING or self._mode in RESTING.values():
            return self.reject(f"the antenna is {self._mode}; resume it first")
        refused = self.safety.authority.conflict(commander, now_s) or self._course.table.refusal(trajectory, now_s)
        if refused:
            return self.reject(refused)
        refused = self._take_way(trajectory, now_s)
        if refused:
            return self.reject(refused)
        self._course.table.accept(trajectory, now_s)
        self.safety.authority.claim(commander, now_s)
        self._accepted += 1
        self.safety.note_command(now_s)
        azimuth, elevation = trajectory.position_rad[-1].tolist()
        self.safety.latch.note_command((now_s, commander, azimuth, elevation))
        if self._mode != "paused":
            self._course.preprocessor.follow()
            self._mode = "tracking"
        return ""

    def _take_way(self, trajectory: JointTrajectory, now_s: float) -> str:
        """Pass a command through the gate and note the way to it; return "" or the refusal: then nothing has changed."""
        present, positions = _pair(self._used), trajectory.position_rad
        refused = self.safety.check("track", now_s, present, positions).reason_of_refusal
        if refused:
            return refused
        if self._course.leaves(trajectory, self._used, following=self._mode in ("tracking", "paused")):
            decision = self.safety.check("preset", now_s, present, positions[:1])
            if not decision.allowed:
                return decision.reason
            self._course.take_way(decision.way)
        return ""

    def reject(self, reason: str) -> str:
        """Count a command that could not be used, and return the reason."""
        self._rejected += 1
        self._rejection = reason
        return reason

    def reading(self, t_s: float) -> JointReading:
        """Return the encoders as they stand, stamped `t_s`."""
        return JointReading(t_s=t_s, position_rad=self._used.copy(), velocity_rad_s=self._plant.velocity_rad_s)

    def step(self, t_s: float) -> tuple[JointReading, Boresight]:
        """Return encoder reading and true boresight at `t_s`, then advance by one tick."""
        self._newest_s = t_s
        reading = self.reading(t_s)
        measured = reading.position_rad
        boresight = self._hardware.look(t_s)
        self._watch_wind(t_s)
        self._rate_command = self._rates(t_s, measured) if self._plant.powered else np.zeros(2)
        self._hardware.move(self._rate_command)
        self._watch_axes()
        return reading, boresight

    def status(self, t_s: float) -> AntennaStatus:
        """Return the status at `t_s`."""
        commanded = self._course.preprocessor.state.position_rad
        return AntennaStatus(
            t_s=t_s,
            mode=self._mode,
            fault=self._fault,
            commanded_rad=commanded,
            rate_command_rad_s=self._rate_command,
            rate_limit_rad_s=np.array(self._limits.rate_limit_rad_s),
            acceleration_limit_rad_s2=np.array(self._limits.acceleration_limit_rad_s2),
            at_limit=self._plant.at_stop,
            command_lead_s=0.0 if self._course.table.empty else self._course.table.lead_s(t_s),
            commands_accepted=self._accepted,
            commands_rejected=self._rejected,
            last_rejection=self._rejection,
            warning=self.safety.warning(t_s, self._mode, (float(commanded[0]), float(commanded[1]))),
            transmit_inhibit=self.safety.transmit_inhibit(self._mode, float(self._used[1])),
            commander=self.safety.authority.holder,
        )

    def _watch_axes(self) -> None:
        """Look at the sensors after a tick: bridge what cannot be, and cut the drives when it lasts."""
        plant = self._plant
        used, reason = self.safety.tick(
            self._hardware.encoders(), _pair(plant.joint_rad), _pair(plant.velocity_rad_s), _pair(self._rate_command)
        )
        self._used = np.array(used)
        if reason and self._plant.powered:
            self._trip(reason)

    def _watch_wind(self, t_s: float) -> None:
        self._ticks += 1
        if self._ticks % WIND_EVERY:
            return
        self.safety.wind.take(t_s, self._hardware.anemometer_m_s())
        if self.safety.wind.step(t_s) and self._mode == "manual_rate":
            self.stop()
        if self.safety.wind.reason and self._mode in ("holding", "tracking", "paused", "parking"):
            self.stow()

    def _rates(self, t_s: float, measured: Array) -> Array:
        if self._mode == "manual_rate" and self._experiment is not None:
            barred = self.safety.guard("manual", t_s, _pair(measured), _pair(self._plant.velocity_rad_s))
            if not self._experiment.finished and not barred:
                rates = self._experiment.command(measured)
                if not self._experiment.abort_reason:
                    return rates
            self._leave_manual_rate(self._experiment.abort_reason or barred or "complete")
        feasible = self._course.step(self._followed(t_s), _pair(self._used), self.params.tick_s)
        if self._mode in KINDS:
            barred = self.safety.guard(KINDS[self._mode], t_s, *map(_pair, feasible))
            if barred:
                self.stop(barred)
        if self._mode not in ("tracking", "holding") and float(np.max(np.abs(feasible[1]))) == 0.0:
            self._settle(feasible[0], measured)
        rates = self._loops.rates(Motion(*feasible), measured)
        if not self._loops.oscillation:
            return rates
        self._course.preprocessor.reset(measured)
        self._trip(f"drives cut: {self._loops.oscillation}")
        return np.zeros(2)

    def _leave_manual_rate(self, reason: str) -> None:
        """Hand the moving axes back to the loops without a jump and bring them to rest."""
        if self._experiment is not None and not self._experiment.finished:
            self._experiment.abort(reason)
        position, velocity = self._plant.encoder_rad, self._plant.velocity_rad_s
        self._course.preprocessor.reset(position, velocity)
        self._course.stop()
        self._loops.reset(position, position, velocity, self._rate_command)
        self._experiment, self._mode = None, "stopping"

    def _hold_here(self) -> None:
        """Make the present angles the command, with the laws at rest and nothing left of earlier commands."""
        self._course.stand(self._used)
        self._loops.reset(self._used, self._used)

    def _settle(self, position: Array, measured: Array) -> None:
        """End a mode whose motion has come to rest."""
        if self._mode == "stopping":
            self._course.goal_rad = position
            self._mode = "fault" if self._fault else "holding"
        arrived = float(np.max(np.abs(measured - self._course.goal_rad))) < ARRIVED_RAD
        if self._mode == "disabling" or (self._mode in ("parking", "stowing") and arrived):
            self._plant.brake()
            self._mode = RESTING[self._mode]

    def _followed(self, t_s: float) -> TrajectorySample | None:
        """Return what the commands say for `t_s`, None where there are none: then the goal is kept."""
        if self._mode != "tracking":
            return None
        table = self._course.table
        sample = table.at(t_s)
        if sample.source != "dry":
            return sample
        if self._course.ends_at_rest(sample.t_s):
            self._course.goal_rad, self._mode = sample.position_rad, "holding"
        else:
            self.stop(f"commands ran dry {-table.lead_s(t_s):.1f} s ago while moving")
        return None


def _pair(values: Array) -> tuple[float, float]:
    azimuth, elevation = values.tolist()
    return azimuth, elevation
