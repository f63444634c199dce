"""Protection of an antenna: safety gate, watches, wind, authority, latched faults.

The safety gate here is the last one before the drives.  It trusts no commander: a command must pass
it when it arrives, and so must every tick of the motion that follows from it.
"""

import math
from dataclasses import dataclass

import numpy as np

from rf_pointing.controllers import CommandPreprocessorParams
from rf_pointing.core import Array, Kinematics, Pair, Params, parameter
from rf_pointing.core.modes import antenna_is
from rf_pointing.core.moving_base import BaseParams, MovingBase
from rf_pointing.ephemeris.solar import SolarDirection, SunParams
from rf_pointing.planning import (
    Authority,
    AxisLimits,
    AxisRates,
    AxisWatch,
    AxisWatchParams,
    Decision,
    DriveWatch,
    DriveWatchParams,
    FaultLatch,
    Gate,
    GateParams,
    HorizonMask,
    WindWatch,
    WindWatchParams,
)
from rf_pointing.station.antenna.modes import AntennaMode
from rf_pointing.station.antenna.sun_at_rest import SunAtRestParams

COMMAND_PERIOD_S = 0.1
LATE_S = 0.1
"""A command this late gets a warning; commands reach a second ahead, so it is not a fault."""
LOWEST_RAD = -0.2
"""Smallest elevation to which an axis of elevation may go; other axes have their own zero."""


@dataclass(frozen=True, kw_only=True)
class SafetyParams(Params):
    """Limits of trust, and where the antenna goes when it is not used."""

    watch: AxisWatchParams = parameter(AxisWatchParams(), "watch over the encoders")
    drive: DriveWatchParams = parameter(DriveWatchParams(), "watch over the drives")
    wind: WindWatchParams = parameter(WindWatchParams(), "wind in which the antenna is stowed")
    gate: GateParams = parameter(GateParams(), "margins of the limits")
    mask: HorizonMask = parameter(HorizonMask(), "horizon that the antenna does not look below")
    kinematics: Kinematics = parameter(Kinematics(), "how the axes lie")
    base: BaseParams = parameter(BaseParams(), "base that moves")
    sun: SunParams = parameter(SunParams(), "the Sun that the antenna does not look into")
    at_rest: SunAtRestParams = parameter(SunAtRestParams(), "the Sun that comes to it at rest")
    park_azimuth_rad: float = parameter(0.0, "azimuth of the park position", -20.0, 20.0)
    park_elevation_rad: float = parameter(math.radians(45.0), "elevation of the park position", -3.2, 3.2)
    stow_elevation_rad: float = parameter(math.radians(90.0), "elevation at which the wind does least", -3.2, 3.2)
    unsigned_commands: bool = parameter(
        False, "whether commands without a signature of the antenna's key are taken, as of another commander"
    )
    authority_s: float = parameter(1.0, "silence after which another may command", 0.1, 60.0)

    def check_together(self) -> None:
        """Refuse to park or to stow below the horizon."""
        for name in ("park_elevation_rad", "stow_elevation_rad"):
            if self.kinematics.level and getattr(self, name) < 0.0:
                key, degrees = name.replace("_rad", "_deg"), math.degrees(getattr(self, name))
                raise ValueError(f"{key}={degrees:g} must be >= 0.0")


class AntennaSafety:
    """One antenna's guards; the control unit carries out what they decide."""

    def __init__(self, params: SafetyParams, motion: CommandPreprocessorParams, tick_s: float) -> None:
        self.params = params
        self.retune(motion)
        self.sun = SolarDirection(params.sun, params.kinematics)
        self.base = MovingBase(params.base, params.kinematics) if params.base.moves else None
        names = params.kinematics.axes
        self.watch, self.drive = AxisWatch(params.watch, tick_s, names), DriveWatch(params.drive, tick_s, names)
        self.wind = WindWatch(params.wind)
        self.latch = FaultLatch()
        self.authority = Authority(params.authority_s)
        self.commanded_s, self._tick_s = -math.inf, tick_s
        self._bridged: tuple[Pair, str] | None = None
        self._released_rad: Pair | None = None

    def retune(self, motion: CommandPreprocessorParams) -> None:
        """Take new limits of motion."""
        self.gate = self.gate_of(motion)

    def gate_of(self, motion: CommandPreprocessorParams) -> Gate:
        """Return the gate of these limits of motion, or raise ValueError."""
        lowest = motion.travel_min_rad[1]
        if self.params.kinematics.level and lowest < LOWEST_RAD:
            raise ValueError(f"elevation_min_rad={lowest:.6g} must be >= {LOWEST_RAD}")
        # One travel for gate and preprocessor, from one set of parameters.
        limits = AxisLimits(
            azimuth_min_rad=motion.travel_min_rad[0], azimuth_max_rad=motion.travel_max_rad[0],
            elevation_min_rad=motion.travel_min_rad[1], elevation_max_rad=motion.travel_max_rad[1],
        )  # fmt: skip
        axes = AxisRates(motion.rate_limit_rad_s, motion.acceleration_limit_rad_s2)
        return Gate(self.params.gate, limits, self.params.mask, axes, self.params.kinematics)

    def release(self, switch_rad: Pair) -> None:
        """Trust the sensors as they are, at the angles where the brakes are released."""
        self.watch.reset()
        self.drive.reset()
        self._bridged = None
        # An antenna found beyond a hard limit may move back: only motion further out from here is a
        # fault.
        self._released_rad = switch_rad

    def tick(self, encoder_rad: Pair, switch_rad: Pair, rate: Pair, command: Pair, passed_s: float) -> tuple[Pair, str]:
        """Return the bridged encoder angles, and why the drives must be cut, "" if not.

        `switch_rad` are the angles at the limit switches, which do not depend on the encoders;
        `passed_s` is the time since the sample before, 0 where there is no new one.
        """
        if passed_s > 0.0 or self._bridged is None:
            self._bridged = self.watch.step(encoder_rad, rate, passed_s)
        bridged, reason = self._bridged
        # Against a model of the rate loop a runaway is found within 40 ms, at 3 mdeg of motion.
        drives = self.drive.step(rate, command, passed_s)
        return bridged, reason or drives or self.beyond(switch_rad, rate)

    def beyond(self, switch_rad: Pair, rate: Pair) -> str:
        """Return which hard limit the axes are past and still leaving, "" for none."""
        return self.gate.hard(switch_rad, rate, self._released_rad)

    def check(self, kind: str, t_s: float, present: Pair, positions: Array) -> Decision:
        """Decide on a motion requested at `t_s`, from `present` through `positions` (n, 2)."""
        return self.gate.check(kind, present, positions, None, self._avoided(t_s), self.wind.reason)

    def _avoided(self, t_s: float) -> Pair | None:
        """Return the Sun to keep away from in the angles of the axes, also on a base that moves."""
        sun_rad = self.sun.avoided(t_s)
        if self.base is None or sun_rad is None:
            return sun_rad
        first, second = self.base.at(t_s).axes_of(np.array([sun_rad]))[0].tolist()
        return first, second

    def guard(self, kind: str, t_s: float, position: Pair, rate: Pair, acceleration: Pair = (0.0, 0.0)) -> str:
        """Return "" or why a motion must be stopped now, wherever it was allowed to go."""
        if rate == (0.0, 0.0):
            # At rest nothing is to be stopped, not even inside a forbidden region that has moved
            # over the antenna.
            return ""
        tick_s = self._tick_s
        # Looked at one tick ahead: a stop that begins inside the forbidden region begins too late.
        then = position[0] + tick_s * rate[0], position[1] + tick_s * rate[1]
        faster = rate[0] + tick_s * acceleration[0], rate[1] + tick_s * acceleration[1]
        return self.gate.guard(kind, position, then, faster, self._avoided(t_s))

    def clock_stepped(self, by_s: float) -> None:
        """Go on with a clock that was stepped: what was silent has been so as long as before."""
        self.wind.clock_stepped(by_s)
        if self.base is not None:
            self.base.clock_stepped(by_s)
        self.authority.clock_stepped(by_s)
        self.commanded_s += by_s

    def warning(self, t_s: float, mode: AntennaMode, commanded: Pair) -> str:
        """Return what is not a fault yet: high wind without stow, a late command, a near limit."""
        if self.base is not None and (lost := self.base.lost(t_s)):
            return f"{lost}: {antenna_is(mode)}"
        if self.wind.reason and mode not in (AntennaMode.STOWING, AntennaMode.STOWED):
            return f"{self.wind.reason}: the antenna is not stowed ({mode})"
        # The period belongs to it: a command that is due now is not late.
        late_s = t_s - self.commanded_s - COMMAND_PERIOD_S
        if mode == AntennaMode.TRACKING and late_s > LATE_S:
            return f"no command for {late_s + COMMAND_PERIOD_S:.2f} s"
        return self.gate.warning(*commanded)
