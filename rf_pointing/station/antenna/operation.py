"""An antenna in operation: its ticks, what it remembers, and what may change while it works.

A command that was issued between a tick and the clock waits for its tick.  A fault is kept in the
file before anyone is informed of it.  A jump of the clock latches a fault; a process that stalled
stops until the next command.
"""

import math
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass
from operator import attrgetter
from typing import Any

import numpy as np

from rf_pointing.core import AXES, Boresight, JointReading, JointTrajectory, Params, parameter
from rf_pointing.core.signals import LONGEST_GAP_S
from rf_pointing.station.antenna.control_unit import AntennaStatus
from rf_pointing.station.antenna.drive_antenna import DriveAntenna
from rf_pointing.station.antenna.loops import LoopParams
from rf_pointing.station.antenna.memory import AntennaMemory, TurnMemory
from rf_pointing.station.antenna.simulated_antenna import SimulatedAntenna
from rf_pointing.station.pointing.status import Level, Report

LIVE = ("plant", "loops")
"""Parameter sets that may change while the antenna moves."""
GUARDS = {
    "preprocessor": "travel, rates and accelerations",
    "table": "the trust in commands far ahead",
    "oscillation": "what counts as an oscillation",
    **{f"{axis}.rate_limit_rad_s": "the largest rates" for axis in (*AXES, *(f"lqg_{axis}" for axis in AXES))},
}
"""Parameters of the loops that guard the antenna, and what they bound."""
STATUS_PERIOD_S = 0.1
WRAP_EVERY = 10
"""Statuses after which the azimuth's turn is written if it has changed."""
ROUNDING = 1e-3
"""Share of a status period by which a tick may come early."""
WAITING = 10
"""Commands that wait for their tick."""


@dataclass(frozen=True, kw_only=True)
class ServoNodeParams(Params):
    """Files of the antenna, and whether faults are injected."""

    wrap_file: str = parameter("", "file that keeps the azimuth's turn over a restart; empty: not kept")
    state_file: str = parameter("", "file that keeps position, fault and rest over a restart; empty: not kept")
    enable_fault_injection: bool = parameter(False, "whether ~/inject_fault is offered")


@dataclass(frozen=True, slots=True)
class Tick:
    """Result of a tick: readings, and news for the operator.

    `status` is None between two of them, `fault` where it has not changed; `refused` are commands
    that waited for this tick.
    """

    reading: JointReading | None
    boresight: Boresight | None = None
    status: AntennaStatus | None = None
    fault: str | None = None
    refused: tuple[str, ...] = ()


class AntennaOperation:
    """Operates one antenna between `start` and `stop`; `tick` once a control period.

    Raises ValueError for files that cannot be written.
    """

    def __init__(self, antenna: SimulatedAntenna | DriveAntenna, memory: AntennaMemory, wrap_file: str) -> None:
        self.antenna, self._memory = antenna, memory
        self._turn = TurnMemory(wrap_file, antenna)
        self.tick_s = antenna.params.tick_s
        self._status_s = self.tick_s * max(1, round(STATUS_PERIOD_S / self.tick_s))
        self._statuses, self._fault, self._period = 0, "", 0
        self._tick_wall_s: float | None = None
        self._ticked_s = math.inf
        self.lateness_s = 0.0
        """Wall time between the last two ticks beyond the period."""
        self._early: deque[tuple[float, JointTrajectory, str]] = deque(maxlen=WAITING)

    def start(self, t_s: float) -> Tick:
        """Release the brakes and hold, or rest as before a restart; ValueError for a lost drive."""
        antenna = self.antenna
        if isinstance(antenna, DriveAntenna):
            antenna.hardware.look(t_s)
            if not antenna.hardware.current:
                raise ValueError(antenna.hardware.fault)
            antenna.t_s = t_s
        antenna.enable()
        self._memory.restore(antenna)
        self._tick_wall_s, self._ticked_s, self._period = None, t_s, self._period_at(t_s)
        self._early.clear()
        return Tick(antenna.reading(t_s), status=antenna.status(t_s))

    def _period_at(self, t_s: float) -> int:
        return math.floor(t_s / self._status_s + ROUNDING)

    def stop(self) -> None:
        """Stop under control and set the brakes."""
        self._ticked_s = math.inf
        try:
            self.antenna.deactivate()
        except Exception as error:
            # The stop itself has failed: only the brakes are left.
            self.antenna.trip(f"the stop has failed: {error}")
            raise
        self._turn.keep()

    def fail(self, reason: str) -> None:
        """Latch the fault of a program that has failed."""
        # The fault goes into the file first: whatever raised may raise again in the stop.
        self.antenna.stop(reason)
        self._memory.keep(self.antenna, self.antenna.t_s)

    def tick(
        self, t_s: float, now_s: float, wall_s: float, jumped_s: float = 0.0, stalled_s: float = 0.0, stepped_s: float = 0.0
    ) -> Tick:  # fmt: skip
        """Do the tick at `t_s`; `now_s` is the clock that was read, `wall_s` a steady one."""
        antenna = self.antenna
        if by_s := stepped_s or jumped_s:
            antenna.clock_stepped(by_s)
        if jumped_s:
            # Every time in the command table means another direction now.
            antenna.stop(f"the clock jumped by {jumped_s:+.2f} s, at most {LONGEST_GAP_S:.2f} s")
        elif stalled_s:
            antenna.stall()
        # At another speed than 1 the wall time between two ticks is another than the period.
        if self._tick_wall_s is not None:
            self.lateness_s = wall_s - self._tick_wall_s - self.tick_s
        self._tick_wall_s, self._ticked_s = wall_s, t_s
        reading, boresight = antenna.step(t_s)
        fault, status = antenna.safety.latch.text, None
        news, self._fault = fault != self._fault, fault
        period, self._period = self._period, self._period_at(t_s)
        if news or period != self._period:
            self._memory.keep(antenna, t_s)
            status = antenna.status(t_s)
            self._statuses += 1
            if self._statuses % WRAP_EVERY == 0:
                self._turn.keep()
        refused = []
        while self._early and self._early[0][0] <= t_s:
            _, command, commander = self._early.popleft()
            refused.append(antenna.accept(command, now_s, commander))
        return Tick(reading, boresight, status, fault if news else None, tuple(filter(None, refused)))

    def take(self, command: JointTrajectory, commander: str, issued_s: float, now_s: float) -> str:
        """Take a command; return "" or why it is refused.

        One issued at an instant between tick and clock waits for its tick.
        """
        # Which of clock and command arrives first is chance; taken at once the same run would give
        # another pass.
        if self._ticked_s < issued_s <= now_s:
            self._early.append((issued_s, command, commander))
            return ""
        return self.antenna.accept(command, now_s, commander)

    def note_wind(self, speed_m_s: float, age_s: float) -> None:
        """Take the speed of the wind, unless it is so old that it counts as silence."""
        if isinstance(self.antenna, DriveAntenna) and age_s <= self.antenna.safety.wind.params.silence_s:
            self.antenna.hardware.note_wind(speed_m_s)

    def check(self, present: LoopParams, sets: Mapping[str, Any], *, active: bool, holder: str) -> None:
        """Raise ValueError if the sets by prefix cannot replace what is in force now.

        What guards the antenna changes only while its drives are disabled; `holder` is the signed
        commander that has it.
        """
        for name, words in GUARDS.items():
            guard = attrgetter(name)
            if guard(sets["loops"]) == guard(present):
                continue
            # Anybody may deactivate the node, which disables the drives.
            if not active and holder:
                raise ValueError(f"loops.{name} guards the antenna: {words} cannot change while {holder} commands it")
            if active and (reason := self.antenna.in_use):
                raise ValueError(f"loops.{name} guards the antenna: {words} cannot change while {reason}")
        self.antenna.check(sets["plant"], sets["loops"])

    # What /diagnostics shows

    def drive_report(self, now_s: float) -> Report:
        """Return mode or fault, and what became of the commands."""
        status = self.antenna.status(now_s)
        level = Level.ERROR if status.fault else Level.WARN if any(status.at_limit) or status.warning else Level.OK
        fault = self.antenna.safety.latch.fault
        values: dict[str, object] = {
            "commands_accepted": status.commands_accepted, "commander": status.commander,
            "commands_rejected": status.commands_rejected, "last_rejection": status.last_rejection,
        }  # fmt: skip
        if fault:
            values |= {"fault_at_s": f"{fault.t_s:.3f}", "last_commands": " | ".join(fault.lines())}
        return Report(level, status.fault or status.warning or status.mode, values)

    def base_report(self, now_s: float) -> Report:
        """Return how old the attitude of a base that moves is, and what was refused."""
        base = self.antenna.safety.base
        assert base is not None
        count, reason = base.refused
        values: dict[str, object] = {
            "age_s": f"{base.age_s(now_s):.3f}", "latency_s": f"{base.latency_s:.3f}",
            "refused": count, "last_refusal": reason,
        }  # fmt: skip
        if lost := base.lost(now_s):
            return Report(Level.ERROR, lost, values)
        return Report(Level.OK, "the attitude of the base is known", values)

    def device_report(self, now_s: float) -> Report:
        """Return what a real drive was sent, and how it answers."""
        assert isinstance(self.antenna, DriveAntenna)
        hardware, rotator = self.antenna.hardware, self.antenna.hardware.rotator
        reading, counts = rotator.reading, rotator.counts
        assert reading is not None
        values: dict[str, object] = {f"lost {name}": count for name, count in hardware.drive.losses.items()} | {
            "set_points": counts.commands,
            **{f"{axis}_starts": count for axis, count in zip(AXES, counts.starts, strict=True)},
            **{f"{axis}_reversals": count for axis, count in zip(AXES, counts.reversals, strict=True)},
            "latency_s": f"{rotator.latency_s:.2f}",
            "age_s": f"{reading.age_s(now_s):.2f}",
            "status": reading.status,
        }
        if reading.temperature_k is not None:
            values["temperature_k"] = f"{reading.temperature_k:.1f}"
        level = Level.ERROR if hardware.fault else Level.OK
        return Report(level, hardware.fault or self.antenna.drive_params.type, values)

    def stage_report(self) -> Report:
        """Return whether a second stage follows, and where it is."""
        assert self.antenna.stage is not None
        stage = self.antenna.stage
        right, up = np.degrees(stage.device.deflection_rad).tolist()
        level = Level.WARN if stage.warning else Level.OK
        values: dict[str, object] = {"right_deg": f"{right:.5f}", "up_deg": f"{up:.5f}"}
        return Report(level, stage.warning or stage.mode, values)

    def memory_report(self) -> Report:
        """Return whether the files hold what they should."""
        problems = "; ".join(filter(None, (self._memory.problem, self._turn.problem)))
        return Report(Level.WARN if problems else Level.OK, problems or "kept", {})

    def oscillation_report(self) -> Report:
        """Return which axes oscillate."""
        loops = self.antenna.axes.loops
        rows = zip(AXES, loops.watch, strict=True)
        swings: dict[str, object] = {f"{axis}_swings_in_a_row": len(seen.state.row) for axis, seen in rows}
        return Report(Level.ERROR if loops.oscillation else Level.OK, loops.oscillation or "none", swings)
