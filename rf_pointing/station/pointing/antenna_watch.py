"""How far the axes are from the command, and whether the antenna can be trusted.

The encoder angles of `joint_states` are compared with the command at their own time:

    axis error = (cos(el) d_az, d_el),  distance = great circle between both directions

Axes that have once settled on the command must go on following it.  They are

    silent    no reading is younger than `silence_s`
    frozen    for `window_s` an encoder has kept its angle while its command moved by `frozen_deg`
              longer than `reaction_s` ago, and the axes are outside the tolerance
    runaway   farther than `runaway_deg` from wherever the command was in the last `window_s`, and
              still leaving it: axes at the end of their rate or acceleration follow late

A silent antenna may only have stalled: the pass waits `patience_s` for it.  A frozen or runaway
one, or one that publishes a latched fault, ends the pass.
"""

import math
from dataclasses import dataclass, field

import numpy as np

from rf_pointing.core import AXES, Array, JointReading, Params, angular_distance_rad, parameter
from rf_pointing.core.angles import separation_rad
from rf_pointing.core.modes import antenna_is
from rf_pointing.core.pass_outcome import OF_ANTENNA
from rf_pointing.core.signals import TimeBuffer

UNREAD_S = 0.2
"""Readings further apart than this say nothing about a frozen encoder."""
# Share of `frozen_rad` that an encoder may toggle by and still keep its angle.
TOGGLE_SHARE = 0.25
# Share of the window: a gust pushes the axes off and lets them come back within it.
LEAVING_SHARE = 1.0 / 3.0
SAME_S = 1e-4
# Modes of `antenna_status` in which the axes do not follow commands, and why is known.
FOLLOWING = ("", "holding", "tracking")


@dataclass(frozen=True, kw_only=True)
class AntennaWatchParams(Params):
    """When the antenna counts as silent, frozen, running away, or on source."""

    silence_s: float = parameter(1.0, "age of joint_states from which the antenna is silent", 0.2, 60.0)
    patience_s: float = parameter(15.0, "age of joint_states at which the pass ends", 0.2, 600.0)
    window_s: float = parameter(1.0, "time over which frozen and runaway axes are judged", 0.2, 60.0)
    frozen_rad: float = parameter(math.radians(0.02), "commanded motion in which the encoders must move", 1e-6, 0.2)
    reaction_s: float = parameter(0.3, "longest time from a command to the motion of the axes", 0.0, 60.0)
    runaway_rad: float = parameter(
        math.radians(0.5), "distance from the command from which leaving it is a runaway", 1e-6, 1.0
    )
    settle_periods: int = parameter(5, "periods in a row on target until on source", 1, 1000)

    # A pass must not end before the antenna counts as silent.
    ordered = ("patience_s >= silence_s",)


@dataclass(frozen=True, slots=True, kw_only=True)
class AxisState:
    """The axes in one period: error (2,), distance from the command, `age_s` of the reading.

    `error_rad` is None where nothing is commanded or no encoder angle is known.  `fault` is why the
    pass must end, `doubt` why the axes are not trusted now, both empty for none.
    """

    age_s: float = math.inf
    error_rad: Array | None = None
    distance_rad: float = 0.0
    settle_count: int = 0
    on_source: bool = False
    fault: str = ""
    doubt: str = ""


@dataclass
class AntennaWatch:
    """Compares readings with commands, once a period; times are those of the controller."""

    params: AntennaWatchParams
    tolerance_rad: float
    names: tuple[str, str] = AXES
    state: AxisState = field(default_factory=AxisState)
    fault: str = ""
    """Latched fault that the antenna itself publishes."""
    mode: str = ""
    """Mode that the antenna publishes, "" while it is not known."""
    _commands: TimeBuffer = field(default_factory=TimeBuffer)
    _distances: TimeBuffer = field(default_factory=TimeBuffer)
    _anchor: tuple[Array, Array, Array] | None = None
    """By axis (2,): since when its encoder keeps its angle, that angle, the command then."""
    _read_s: float = -math.inf
    """Time of the last reading that was judged."""
    _begun_s: float = 0.0
    _settled: bool = False

    def restart(self, t_s: float) -> None:
        """Begin a pass, or a slew to it: the axes may be anywhere."""
        for buffer in (self._commands, self._distances):
            # Windows of a minute are allowed; the buffers follow them.
            buffer.kept_s = 2.0 + self.params.window_s + self.params.reaction_s
            buffer.clear()
        self._begun_s, self.state = t_s, AxisState()
        self.unsettle()

    def unsettle(self) -> None:
        """Expect a slew: until the axes have settled again they may be anywhere."""
        self._settled, self._anchor = False, None
        self._distances.clear()

    def retune(self, params: AntennaWatchParams, tolerance_rad: float) -> None:
        """Take new thresholds from the next period on."""
        self.params, self.tolerance_rad = params, tolerance_rad

    def take_status(self, mode: str, fault: str) -> None:
        """Note what the antenna publishes of itself."""
        self.mode, self.fault = mode, fault

    def take_command(self, t_s: float, axes_rad: Array) -> None:
        """Note where the axes (2,) are commanded to be at `t_s`, scans included."""
        self._commands.add(t_s, axes_rad)

    def step(self, t_s: float, reading: JointReading | None) -> AxisState:
        """Return the state of the axes in the period at `t_s` with the newest reading."""
        age_s = t_s - max(self._begun_s, reading.t_s if reading else -math.inf)
        silent = age_s > self.params.silence_s
        command, error, distance = self._off_command(t_s, reading, silent)
        within = error is not None and not silent and distance <= self.tolerance_rad
        count = self.state.settle_count + 1 if within else 0
        self._settled = self._settled or count >= self.params.settle_periods
        doubt = f"joint_states has been silent for {age_s:.2f} s" if silent else ""
        fault = OF_ANTENNA + self.fault if self.fault else ""
        if silent and age_s > self.params.patience_s:
            fault = fault or f"{doubt}, at most {self.params.patience_s:.2f} s"
        if silent or self.mode not in FOLLOWING:
            # Pause, stow and park move the axes off the command on purpose; a stall stops them.
            self.unsettle()
            doubt = doubt or antenna_is(self.mode)
        elif reading is not None and command is not None and self._settled:
            fault = fault or self._frozen(reading, command, distance) or self._runaway(t_s, reading, distance)
        self.state = AxisState(
            age_s=t_s - reading.t_s if reading else math.inf, error_rad=error, distance_rad=distance,
            settle_count=count, on_source=count >= self.params.settle_periods, fault=fault, doubt=doubt,
        )  # fmt: skip
        return self.state

    def _off_command(
        self, t_s: float, reading: JointReading | None, silent: bool
    ) -> tuple[Array | None, Array | None, float]:
        """Return command, axis error (2,) and the distance, (None, None, 0) if one is not known."""
        if reading is None:
            return None, None, 0.0
        # Nobody knows where a silent antenna is now: its last angle is compared with the present
        # command.
        command = self._command_at(t_s if silent else reading.t_s)
        if command is None:
            return None, None, 0.0
        azimuth, elevation = reading.position_rad.tolist()
        across, up = command.tolist()
        turn = math.remainder(across - azimuth, 2.0 * math.pi)
        error = np.array([turn * math.cos(elevation), up - elevation])
        return command, error, separation_rad(azimuth, elevation, across, up)

    def _command_at(self, t_s: float) -> Array | None:
        # The newest command may lie a rounding of the stamps before the reading.
        newest_s = self._commands.times[-1] if self._commands.times else -math.inf
        return self._commands.at(min(t_s, newest_s) if t_s - newest_s < SAME_S else t_s)

    def _frozen(self, reading: JointReading, command: Array, distance: float) -> str:
        """Return why an encoder counts as frozen, "" while both move or need not."""
        # Axes that were not read may have stalled with their commands.
        unread_s, self._read_s = reading.t_s - self._read_s, reading.t_s
        if self._anchor is None or unread_s > self.params.reaction_s:
            self._anchor = np.full(2, reading.t_s), reading.position_rad.copy(), command.copy()
        since_s, kept, wanted = self._anchor
        # What was not read is not known to stand: a control unit that stalls sends no set points.
        since_s += unread_s if unread_s > UNREAD_S else 0.0
        turned = np.abs(reading.position_rad - kept) > TOGGLE_SHARE * self.params.frozen_rad
        since_s[turned], kept[turned], wanted[turned] = reading.t_s, reading.position_rad[turned], command[turned]
        asked = np.abs(command - wanted)
        # An encoder may stand as long as its command does.
        since_s[asked <= TOGGLE_SHARE * self.params.frozen_rad] = reading.t_s
        # A step of the command (a scan) is followed later.
        earlier = self._command_at(reading.t_s - self.params.reaction_s)
        asked = np.minimum(asked, np.abs(earlier - wanted)) if earlier is not None else np.zeros(2)
        still = (reading.t_s - since_s >= self.params.window_s) & (asked >= self.params.frozen_rad)
        if distance <= self.tolerance_rad or not still.any():
            return ""
        axis = int(np.argmax(still))
        return (
            f"the {self.names[axis]} encoder is frozen: at {math.degrees(kept[axis]):.4f} deg for "
            f"{reading.t_s - since_s[axis]:.1f} s, in which the command moved by {math.degrees(asked[axis]):.3f} deg, "
            f"at most {math.degrees(self.params.frozen_rad):.3f} deg"
        )

    def _behind_rad(self, reading: JointReading) -> float:
        """Return how far the axes are from the nearest of the commands of the last window."""
        passed = np.array([
            command for t_s, command in zip(self._commands.times, self._commands.values, strict=True)
            if reading.t_s - self.params.window_s <= t_s <= reading.t_s
        ])  # fmt: skip
        return float(angular_distance_rad(*reading.position_rad, *passed.T).min()) if len(passed) else math.inf

    def _runaway(self, t_s: float, reading: JointReading, distance: float) -> str:
        """Return why the axes count as running away, "" while they do not."""
        self._distances.add(t_s, np.array([distance]))
        before = self._distances.at(t_s - LEAVING_SHARE * self.params.window_s)
        if before is None or distance <= self.params.runaway_rad or distance <= float(before[0]):
            return ""
        distance = min(distance, self._behind_rad(reading))
        if distance <= self.params.runaway_rad:
            return ""
        return (
            f"the axes run away: {math.degrees(distance):.3f} deg from the command and leaving it, "
            f"must stay within {math.degrees(self.params.runaway_rad):.3f} deg"
        )
