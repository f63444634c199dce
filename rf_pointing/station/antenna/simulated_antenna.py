"""The simulated antenna as its control unit shows it: commands in, encoder angles and status out, truth beside.

Per control tick: command table -> preprocessor -> position law of each axis -> rate command -> plant with wind.  In
manual-rate mode an identification experiment gives the rate commands instead.  A loop that oscillates has its drives cut
and the brakes set, and the fault latches.  Which mode it is in and what may be asked for is `antenna_modes.py`, what
becomes of a command `command_intake.py`, what closes the loops `antenna_axes.py`, what must not happen `antenna_safety.py`.
"""

import numpy as np
from numpy.typing import NDArray

from rf_pointing.calibration import BiasModel
from rf_pointing.controllers import TrajectorySample
from rf_pointing.core import Boresight, JointReading, Motion
from rf_pointing.servo import PlantParams, WindParams
from rf_pointing.station.antenna.axes import AntennaAxes, pair
from rf_pointing.station.antenna.command_handler import CommandHandler
from rf_pointing.station.antenna.hardware import AntennaParams
from rf_pointing.station.antenna.injected_faults import InjectedFaults
from rf_pointing.station.antenna.loops import LoopParams
from rf_pointing.station.antenna.manual_rate import ManualRate
from rf_pointing.station.antenna.modes import AntennaModes
from rf_pointing.station.antenna.safety import AntennaSafety, SafetyParams
from rf_pointing.station.pointing.status import AntennaStatus

__all__ = ["AntennaParams", "LoopParams", "SimulatedAntenna"]

Array = NDArray[np.float64]
LONGEST_STOP_S = 30.0
WIND_EVERY = 5
"""Ticks between two readings of the anemometer."""
KINDS = {"tracking": "track", "parking": "park", "stowing": "stow", "holding": "preset"}
"""What the gate calls the motion of a mode that follows a command."""


class SimulatedAntenna:
    """One antenna: ask its `modes` to enable it, give its `commands` trajectories, and `step` it once a tick.

    Outputs of `step` are those at the tick's beginning.
    """

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
        self.axes = AntennaAxes(params, plant, loops, wind, mount, self.safety)
        self._manual = ManualRate(params.tick_s)
        self.modes = AntennaModes(self.axes, self.safety, self._manual)
        self.commands = CommandHandler(self.axes, self.modes, self.safety)
        self._ticks = 0

    @property
    def mode(self) -> str:
        """The mode that the antenna is in, see `AntennaModes`."""
        return self.modes.mode

    @property
    def injected(self) -> InjectedFaults:
        """The faults put into drives and sensors."""
        return self.axes.hardware.injected

    def disable(self) -> None:
        """Decelerate at the limits, then set the brakes; the seconds that this takes pass at once."""
        self.modes.stop()
        for _ in range(round(LONGEST_STOP_S / self.params.tick_s)):
            if self.mode != "stopping":
                break
            self.step(self.axes.t_s + self.params.tick_s)
        self.modes.rest("inactive")

    def reading(self, t_s: float) -> JointReading:
        """Return the encoders as they stand, stamped `t_s`."""
        velocity = self.axes.hardware.plant.velocity_rad_s
        return JointReading(t_s=t_s, position_rad=self.axes.used_rad.copy(), velocity_rad_s=velocity)

    def step(self, t_s: float) -> tuple[JointReading, Boresight]:
        """Return encoder reading and true boresight at `t_s`, then advance by one tick."""
        reading, boresight = self.reading(t_s), self.axes.look(t_s)
        self._watch_wind(t_s)
        powered = self.axes.hardware.plant.powered
        self.axes.drive(self._rates(t_s, reading.position_rad) if powered else np.zeros(2))
        self.modes.watch()
        return reading, boresight

    def status(self, t_s: float) -> AntennaStatus:
        """Return the status at `t_s`."""
        axes, course, safety, commands = self.axes, self.axes.course, self.safety, self.commands
        commanded = course.preprocessor.state.position_rad
        return AntennaStatus(
            t_s=t_s,
            mode=self.mode,
            fault=safety.latch.text,
            commanded_rad=commanded,
            rate_command_rad_s=axes.rate_command_rad_s,
            rate_limit_rad_s=np.array(axes.limits.rate_limit_rad_s),
            acceleration_limit_rad_s2=np.array(axes.limits.acceleration_limit_rad_s2),
            at_limit=axes.hardware.plant.at_stop,
            command_lead_s=0.0 if course.table.empty else course.table.lead_s(t_s),
            commands_accepted=commands.accepted,
            commands_rejected=commands.rejected,
            last_rejection=commands.last_rejection,
            warning=safety.warning(t_s, self.mode, pair(commanded)),
            transmit_inhibit=safety.transmit_inhibit(self.mode, float(axes.used_rad[1])),
            commander=safety.authority.holder,
        )

    def _watch_wind(self, t_s: float) -> None:
        self._ticks += 1
        if self._ticks % WIND_EVERY:
            return
        self.safety.wind.take(t_s, self.axes.hardware.anemometer_m_s())
        if self.safety.wind.step(t_s) and self.mode == "manual_rate":
            self.modes.stop()
        if self.safety.wind.reason and self.mode in ("holding", "tracking", "paused", "parking", "parked"):
            self.modes.stow()

    def _rates(self, t_s: float, measured: Array) -> Array:
        """Return the rate commands (2,) of this tick: those of an experiment, or of the laws on a guarded course."""
        if self.mode == "manual_rate":
            velocity = self.axes.hardware.plant.velocity_rad_s
            barred = self.safety.guard("manual", t_s, pair(measured), pair(velocity))
            rates, ended = self._manual.rates(measured, barred)
            if not ended:
                return rates
            self.modes.leave_manual_rate(ended)
        axes = self.axes
        feasible = axes.course.step(self._followed(t_s), pair(axes.used_rad), self.params.tick_s)
        if self.mode in KINDS:
            barred = self.safety.guard(KINDS[self.mode], t_s, *map(pair, feasible))
            if barred:
                self.modes.stop(barred)
        if self.mode not in ("tracking", "holding") and float(np.max(np.abs(feasible[1]))) == 0.0:
            self.modes.settle(feasible[0], measured)
        rates = axes.loops.rates(Motion(*feasible), measured)
        if not axes.loops.oscillation:
            return rates
        axes.course.preprocessor.reset(measured)
        self.modes.trip(f"drives cut: {axes.loops.oscillation}")
        return np.zeros(2)

    def _followed(self, t_s: float) -> TrajectorySample | None:
        """Return what the commands say for `t_s`, None where there are none: then the goal is kept."""
        if self.mode != "tracking":
            return None
        course = self.axes.course
        sample = course.table.at(t_s)
        if sample.source != "dry":
            return sample
        if course.ends_at_rest(sample.t_s):
            self.modes.come_to_rest(sample.position_rad)
        else:
            self.modes.stop(f"commands ran dry {-course.table.lead_s(t_s):.1f} s ago while moving")
        return None
