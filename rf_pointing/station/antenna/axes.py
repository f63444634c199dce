"""The axes of the antenna in closed loop: path, laws and drives; no mode is known here.

    table, own goal or rest -> next free corner -> preprocessor -> position laws -> drives

The preprocessor makes any command feasible: a step becomes a slew, a stop decelerates at the
limits.
"""

import math
from typing import Protocol

import numpy as np

from rf_pointing.controllers import CommandPreprocessor, CommandPreprocessorParams, TrajectoryBuffer, TrajectorySample
from rf_pointing.core import Array, JointTrajectory, Motion, Pair
from rf_pointing.planning import CornerPath
from rf_pointing.servo import PlantParams
from rf_pointing.station.antenna.loops import AxisLoops, LoopParams
from rf_pointing.station.antenna.safety import AntennaSafety

Corners = tuple[Pair, ...]
# Brakes may be set below this without shaking the structure.
MOVING_RAD_S = math.radians(0.1)
Following = tuple[Motion, Motion]
"""A feasible motion, and the command that it chases."""
REST_RAD_S = math.radians(1e-3)
NEAR_RAD = math.radians(0.3)
"""How near to a corner the encoders must be for the next leg to begin."""
NEW_PATH_RAD = math.radians(0.5)
"""A command this far from the present path is a place to slew to, past what is forbidden."""


class Hardware(Protocol):
    """Drives, brakes and sensors of a control unit, in the order azimuth, elevation.

    `velocity_rad_s` (2,) are the tachometer rates and `switch_rad` the angles at the limit
    switches, which do not depend on the encoders; `at_stop` says which axis touches a hard stop.
    `encoders` and `anemometer_m_s` read a sensor, NaN from one that is silent; None is a station
    without an anemometer.  `move` gives the drives their rate commands (2,) for one tick, or, where
    the drive `takes_positions`, the motion to follow, or None; `brake` cuts the drives
    too, and `release_brake` leaves that of one axis set (-1: none).  `fault` is why the drives must
    be cut, "" if not, and `settled_rad` how near to its goal an axis comes to rest.  The newest
    sample is `lag_s` old and came `sampled_s` after the one before; 0: this tick has no new one.
    """

    takes_positions: bool
    settled_rad: float

    @property
    def sampled_s(self) -> float: ...
    @property
    def lag_s(self) -> float: ...
    @property
    def velocity_rad_s(self) -> Array: ...
    @property
    def switch_rad(self) -> Pair: ...
    @property
    def powered(self) -> bool: ...
    @property
    def at_stop(self) -> tuple[bool, bool]: ...
    @property
    def fault(self) -> str: ...

    def encoders(self) -> Pair: ...
    def anemometer_m_s(self) -> float | None: ...
    def move(self, rate_command_rad_s: Array, following: Following | None = None) -> None: ...
    def brake(self) -> None: ...
    def release_brake(self, held_axis: int = -1, /) -> None: ...


class SlewPath:
    """Path of both axes: a commander's table, a goal of the antenna's own, or rest."""

    def __init__(self, loops: LoopParams, start_rad: Pair, settled_rad: float) -> None:
        self.table = TrajectoryBuffer(loops.table)
        # The only place where motion is made: whatever is commanded comes out within travel, rates
        # and accelerations.
        self.preprocessor = CommandPreprocessor(loops.preprocessor)
        self.preprocessor.reset(start_rad)
        self.goal_rad = np.array(start_rad)
        self.following: Following | None = None
        """The motion of the latest step and what it chases, for a drive that takes positions."""
        # A drive that comes to rest a step of its own away has reached a corner.
        self._near_rad = max(NEAR_RAD, settled_rad)
        self.go_round(())

    def hold(self, position_rad: Array) -> None:
        """Make this position (2,) the command, with nothing left of earlier ones."""
        self.goal_rad = position_rad.copy()
        self.preprocessor.reset(self.goal_rad)
        self.table.clear()
        self.go_round(())

    def stop(self) -> None:
        """Forget the commands and decelerate at the limits."""
        self.table.clear()
        self.go_round(())
        self.preprocessor.stop()

    def go(self, goal_rad: Pair, corners: Corners) -> None:
        """Go to a position by these corners."""
        self.table.clear()
        self.goal_rad = np.array(goal_rad)
        self.go_round(corners)
        self.preprocessor.follow()

    def leaves(self, trajectory: JointTrajectory, encoder_rad: Array, following: bool) -> bool:
        """Return whether a table begins away from the present path and needs corners of its own."""
        # A table may move on ahead of the axes: it is compared with the table that it replaces.
        follows = following and not self.table.empty
        from_rad = self.table.at(float(trajectory.t_s[0])).position_rad if follows else encoder_rad
        return bool(max(map(abs, (trajectory.position_rad[0] - from_rad).tolist())) > NEW_PATH_RAD)

    def go_round(self, corners: Corners) -> None:
        """Reach what comes next by these corners."""
        path = CornerPath(corners, near_rad=self._near_rad, rest_rad_s=REST_RAD_S)
        self._corners: CornerPath | None = path if corners else None

    @staticmethod
    def at_rest(sample: TrajectorySample) -> bool:
        """Return whether a sample of the table stands still."""
        return float(np.max(np.abs(sample.velocity_rad_s))) < REST_RAD_S

    def step(self, sample: TrajectorySample | None, encoder_rad: Pair, tick_s: float) -> Motion:
        """Return the feasible motion to the next corner, the sample or the goal, one tick on."""
        # The command rests, and by the encoders the axes have been at a corner to be past it.
        corner = self._corners.next(encoder_rad, self.preprocessor.velocity_rad_s) if self._corners else None
        if corner is None and sample is not None:
            command = sample.position_rad, sample.velocity_rad_s, sample.acceleration_rad_s2
        else:
            command = self.goal_rad if corner is None else np.array(corner), np.zeros(2), np.zeros(2)
        motion = Motion(*self.preprocessor.step(*command, tick_s))
        # A stop has no goal but its own end.
        self.following = motion, motion if self.preprocessor.stopping else Motion(*command)
        return motion


class AntennaAxes:
    """Path, position laws and hardware of both axes.

    `encoder_rad` (2,) are the encoder angles with impossible readings bridged, `rate_command_rad_s`
    (2,) the latest commands of the drives.
    """

    def __init__(
        self, hardware: Hardware, loops: LoopParams, plant: PlantParams, safety: AntennaSafety,
        tick_s: float, start: Pair,
    ) -> None:  # fmt: skip
        self._safety = safety
        self.hardware = hardware
        self.path = SlewPath(loops, start, hardware.settled_rad)
        self.loops = AxisLoops(loops, plant, tick_s)
        self.encoder_rad = np.array(hardware.encoders())
        self.rate_command_rad_s = np.zeros(2)

    @property
    def limits(self) -> CommandPreprocessorParams:
        """The limits that every command is brought within."""
        return self.loops.params.preprocessor

    @property
    def travel_rad(self) -> tuple[Pair, Pair]:
        """Lower and upper end of the commanded travel of azimuth and elevation."""
        azimuth, elevation = zip(self.limits.travel_min_rad, self.limits.travel_max_rad, strict=True)
        return azimuth, elevation

    @property
    def moving(self) -> bool:
        """Whether an axis turns too fast to be left to its brakes or to an experiment."""
        return float(np.max(np.abs(self.hardware.velocity_rad_s))) > MOVING_RAD_S

    def check(self, loops: LoopParams, plant: PlantParams) -> None:
        """Raise ValueError if `retune` would refuse these laws on this plant; changes nothing."""
        if loops != self.loops.params:
            self.loops.check(loops, plant)
            self._safety.gate_of(loops.preprocessor)

    def retune(self, loops: LoopParams, plant: PlantParams) -> None:
        """Take new laws, gains and limits between two ticks, without a jump."""
        if loops != self.loops.params:
            self.loops.retune(loops, plant)
            self.path.preprocessor.retune(loops.preprocessor)
            self.path.table.params = loops.table
            # The gate must know the limits that the laws now move within, or it would guard others.
            self._safety.retune(loops.preprocessor)

    def hold(self) -> None:
        """Make the present angles the command, with the laws at rest and earlier commands gone."""
        self.path.hold(self.encoder_rad)
        self.loops.reset(self.encoder_rad, self.encoder_rad)

    def take_over(self) -> None:
        """Let the laws take over axes that rate commands have moved, and bring them to rest."""
        velocity = self.hardware.velocity_rad_s
        self.path.preprocessor.reset(self.encoder_rad, velocity)
        self.path.stop()
        self.loops.reset(self.encoder_rad, self.encoder_rad, velocity, self.rate_command_rad_s)

    def regain(self) -> None:
        """Go on from where the axes are now, after a time in which nobody looked."""
        preprocessor, stopping = self.path.preprocessor, self.path.preprocessor.stopping
        velocity = self.hardware.velocity_rad_s
        self.encoder_rad = self.hardware.lag_s * velocity + self.hardware.encoders()
        preprocessor.reset(self.encoder_rad, velocity)
        if stopping:
            preprocessor.stop()
        self.loops.reset(self.encoder_rad, self.encoder_rad, velocity, velocity)

    def cut(self) -> None:
        """Cut the drives and set the brakes at once."""
        self.hardware.brake()
        self.path.stop()
        self.rate_command_rad_s = np.zeros(2)

    def watch(self) -> str:
        """Bridge impossible encoder readings; return why the drives must be cut, "" if not."""
        hardware = self.hardware
        encoders, switches, velocity = hardware.encoders(), hardware.switch_rad, pair(hardware.velocity_rad_s)
        if hardware.takes_positions:
            # The hardware has a watch of its own, at its own steps and readings.
            bridged, reason = encoders, self._safety.beyond(switches, velocity)
        else:
            command = pair(self.rate_command_rad_s)
            bridged, reason = self._safety.tick(encoders, switches, velocity, command, hardware.sampled_s)
            if hardware.lag_s > 0.0:
                # The drive goes on at its rate while its newest sample waits.
                bridged = pair(np.array(bridged) + hardware.lag_s * np.array(velocity))
        reason = hardware.fault or reason
        self.encoder_rad = np.array(bridged)
        # With the brakes set there is nothing left to cut, and a sensor under repair must not latch
        # a fault.
        return reason if hardware.powered else ""


def pair(values: Array) -> Pair:
    """Return the azimuth and elevation of an array (2,)."""
    azimuth, elevation = values.tolist()
    return azimuth, elevation
