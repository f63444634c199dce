"""Makes any command feasible from past and present samples only: steps, gaps and mode changes become slews.

A command that the axis can follow passes through unchanged.  Otherwise the output chases it (`feasible_motion.py`)
within the rate, acceleration and, if given, jerk limits; the rule v = sqrt(2 a d) guards the ends of the travel.  From
outside the travel every motion that does not lead further out is made as it is asked for.
"""

import math
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rf_pointing.controllers.feasible_motion import AxisLimits, chase, halt, reachable
from rf_pointing.core import Params, as_finite_array, as_finite_pair, parameter, require_between

__all__ = ["CommandPreprocessor", "CommandPreprocessorParams", "CommandPreprocessorState"]

Array = NDArray[np.float64]

_FOLLOW, _STOP = "follow", "stop"


@dataclass(frozen=True, kw_only=True)
class CommandPreprocessorParams(Params):
    """Limits per axis (azimuth, elevation); `jerk_limit_rad_s3` of 0 means no jerk limit.

    They stay below the drive's own (2 deg/s, 1 deg/s^2): what is left of the drive is the loop's, to act against wind.
    A command at the drive's limit leaves a loop that winds up, overshoots by degrees, and can go on swinging.
    """

    rate_limit_rad_s: tuple[float, float] = parameter(
        (math.radians(1.8),) * 2, "largest commanded rates", low=1e-6, high=10.0
    )
    acceleration_limit_rad_s2: tuple[float, float] = parameter(
        (math.radians(0.8),) * 2, "largest commanded accelerations", low=1e-6, high=100.0
    )
    jerk_limit_rad_s3: tuple[float, float] = parameter((0.0, 0.0), "largest jerks, 0 for none", low=0.0, high=1e4)
    travel_min_rad: tuple[float, float] = parameter((-3.9, 0.04), "lower ends of travel", low=-50.0, high=50.0)
    travel_max_rad: tuple[float, float] = parameter((3.9, 1.6), "upper ends of travel", low=-50.0, high=50.0)

    def check_together(self) -> None:
        """Refuse an empty travel and anything but one value per axis."""
        for name in (
            "rate_limit_rad_s",
            "acceleration_limit_rad_s2",
            "jerk_limit_rad_s3",
            "travel_min_rad",
            "travel_max_rad",
        ):
            if len(getattr(self, name)) != 2:
                raise ValueError(f"{name}={getattr(self, name)} must have 2 values (azimuth, elevation)")
        for low, high in zip(self.travel_min_rad, self.travel_max_rad, strict=True):
            if low >= high:
                raise ValueError(f"travel_min_rad={low} must be < travel_max_rad={high}")


@dataclass(slots=True)
class CommandPreprocessorState:
    """Position, velocity, acceleration (2,) of the output; whether stopping; whether each axis passes through."""

    position_rad: Array = field(default_factory=lambda: np.zeros(2))
    velocity_rad_s: Array = field(default_factory=lambda: np.zeros(2))
    acceleration_rad_s2: Array = field(default_factory=lambda: np.zeros(2))
    mode: str = _FOLLOW
    transparent: tuple[bool, bool] = (False, False)


class CommandPreprocessor:
    """Both axes; `reset` to the antenna's motion, then `step` once per tick."""

    def __init__(self, params: CommandPreprocessorParams) -> None:
        self._params, self._limits = params, _axis_limits(params)
        self._state = CommandPreprocessorState()

    @property
    def params(self) -> CommandPreprocessorParams:
        """The parameter set in force."""
        return self._params

    @property
    def state(self) -> CommandPreprocessorState:
        """A copy of the complete state."""
        return _copy(self._state)

    @state.setter
    def state(self, state: CommandPreprocessorState) -> None:
        self._state = _copy(state)

    @property
    def stopping(self) -> bool:
        """Whether a controlled stop is in force (the command is ignored until `follow`)."""
        return self._state.mode == _STOP

    @property
    def transparent(self) -> tuple[bool, bool]:
        """Per axis: whether the latest command passed through unchanged."""
        return self._state.transparent

    def retune(self, params: CommandPreprocessorParams) -> None:
        """Take new limits from the next step on."""
        self._params, self._limits = params, _axis_limits(params)

    def reset(self, position_rad: ArrayLike, velocity_rad_s: ArrayLike = (0.0, 0.0)) -> None:
        """Start from the antenna's own position and velocity (2,), following the command."""
        position = as_finite_array("position_rad", position_rad, (2,)).copy()
        velocity = as_finite_array("velocity_rad_s", velocity_rad_s, (2,)).copy()
        self._state = CommandPreprocessorState(position, velocity)

    def stop(self) -> None:
        """Decelerate both axes at their limits and stay there."""
        self._state.mode = _STOP

    def follow(self) -> None:
        """End a stop: chase the command again."""
        self._state.mode = _FOLLOW

    def step(
        self,
        position_rad: ArrayLike,
        velocity_rad_s: ArrayLike,
        acceleration_rad_s2: ArrayLike,
        dt_s: float,
    ) -> tuple[Array, Array, Array]:
        """Return the feasible position, velocity and acceleration (2,) for the command at the end of this `dt_s`.

        Raises
        ------
        ValueError
            For a non-finite command or `dt_s` outside [1e-4, 1] s.
        """
        require_between("dt_s", dt_s, 1e-4, 1.0)
        position = as_finite_pair("position_rad", position_rad)
        velocity = as_finite_pair("velocity_rad_s", velocity_rad_s)
        acceleration = as_finite_pair("acceleration_rad_s2", acceleration_rad_s2)
        state, moved, transparent = self._state, [], [False, False]
        before = zip(
            state.position_rad.tolist(), state.velocity_rad_s.tolist(), state.acceleration_rad_s2.tolist(), strict=True
        )
        for axis, (limits, now) in enumerate(zip(self._limits, before, strict=True)):
            target = (position[axis], velocity[axis], acceleration[axis])
            if not limits.low <= now[0] <= limits.high:
                # Beside its travel an axis stays where it is, or comes in; it never starts by itself.
                limits = replace(limits, low=min(limits.low, now[0]), high=max(limits.high, now[0]))
            if state.mode == _STOP:
                moved.append(halt(now, limits, dt_s))
            else:
                transparent[axis] = reachable(now, target, limits, dt_s)
                moved.append(target if transparent[axis] else chase(now, target, limits, dt_s))
        motion = np.array(moved).T
        state.position_rad, state.velocity_rad_s, state.acceleration_rad_s2 = motion
        state.transparent = (transparent[0], transparent[1])
        # Every step makes new arrays and writes into none, so the caller may keep these.
        return motion[0], motion[1], motion[2]


def _axis_limits(params: CommandPreprocessorParams) -> tuple[AxisLimits, AxisLimits]:
    rows = zip(
        params.rate_limit_rad_s,
        params.acceleration_limit_rad_s2,
        params.jerk_limit_rad_s3,
        params.travel_min_rad,
        params.travel_max_rad,
        strict=True,
    )
    azimuth, elevation = (AxisLimits(*row) for row in rows)
    return azimuth, elevation


def _copy(state: CommandPreprocessorState) -> CommandPreprocessorState:
    return replace(
        state,
        position_rad=state.position_rad.copy(),
        velocity_rad_s=state.velocity_rad_s.copy(),
        acceleration_rad_s2=state.acceleration_rad_s2.copy(),
    )
