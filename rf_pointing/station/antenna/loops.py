"""The position laws of both axes as the control unit runs them: PI or LQG, exchanged while running, watched for swinging.

A change of gains or of the law is taken as a whole, between two ticks and without a jump of the rate command; one that
would be unstable on the antenna is refused and changes nothing.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rf_pointing.controllers import (
    CommandPreprocessorParams,
    LqgDesign,
    LqgLoop,
    LqgLoopParams,
    OscillationDetector,
    OscillationDetectorParams,
    PositionLoop,
    PositionLoopParams,
    TrajectoryBufferParams,
    dss13_loops,
    dss13_lqg_loops,
    load_lqg_designs,
)
from rf_pointing.core import AXES, Motion, Params, parameter
from rf_pointing.servo import PlantParams
from rf_pointing.station.antenna.loop_stability import require_stable

__all__ = ["AxisLoops", "LoopParams", "PositionLaw", "law_rates"]

Array = NDArray[np.float64]
PositionLaw = PositionLoop | LqgLoop

AT_REST = np.zeros(2)
_PI, _LQG = "pi", "lqg"
_AZIMUTH, _ELEVATION = dss13_loops("tuned")
_LQG_AZIMUTH, _LQG_ELEVATION = dss13_lqg_loops()


@dataclass(frozen=True, kw_only=True)
class LoopParams(Params):
    """Position laws of both axes, the watch over them, and the limits that every command is brought within."""

    law: str = parameter(_PI, "position law of both axes", choices=(_PI, _LQG))
    azimuth: PositionLoopParams = parameter(_AZIMUTH, "azimuth PI loop")
    elevation: PositionLoopParams = parameter(_ELEVATION, "elevation PI loop")
    lqg_file: str = parameter("", "file of the LQG designs, empty for those of DSS-13")
    lqg_azimuth: LqgLoopParams = parameter(_LQG_AZIMUTH, "feedforward and limit of the azimuth LQG law")
    lqg_elevation: LqgLoopParams = parameter(_LQG_ELEVATION, "feedforward and limit of the elevation LQG law")
    oscillation: OscillationDetectorParams = parameter(OscillationDetectorParams(), "what counts as an oscillation")
    preprocessor: CommandPreprocessorParams = parameter(CommandPreprocessorParams(), "limits of the commands")
    table: TrajectoryBufferParams = parameter(TrajectoryBufferParams(), "trust in the command table")


def law_rates(
    laws: Sequence[PositionLaw], command: Sequence[Sequence[float]], encoder_rad: Sequence[float], tick_s: float
) -> list[float]:
    """Return the rate commands (2,) of both laws for one tick of `tick_s`, and advance the laws to the next one.

    `command` is position (rad), velocity (rad/s) and acceleration (rad/s^2) of azimuth and elevation.
    """
    position, velocity, acceleration = command
    rates = []
    for axis, law in enumerate(laws):
        rates.append(law.output(position[axis], velocity[axis], encoder_rad[axis], acceleration[axis]))
        law.update(tick_s, rates[axis])
    return rates


class AxisLoops:
    """Both axes' laws: `reset` to the antenna's motion, then `rates` once a tick."""

    def __init__(self, params: LoopParams, plant: PlantParams, tick_s: float) -> None:
        self._tick_s = tick_s
        self._designs: tuple[str, tuple[LqgDesign, LqgDesign]] | None = None
        self.check(params, plant)
        self._params = params
        self._laws = self._build(params)
        self._watch = tuple(OscillationDetector(params.oscillation) for _ in AXES)
        self._newest = (np.zeros(2), np.zeros(2), np.zeros(2), np.zeros(2))

    @property
    def params(self) -> LoopParams:
        """The parameter set in force."""
        return self._params

    @property
    def watch(self) -> tuple[OscillationDetector, ...]:
        """The oscillation detectors of azimuth and elevation."""
        return self._watch

    @property
    def oscillation(self) -> str:
        """Which axis oscillates and how, "" if none does."""
        found = [f"{axis}: {seen.reason}" for axis, seen in zip(AXES, self._watch, strict=True) if seen.oscillating]
        return "; ".join(found)

    def check(self, params: LoopParams, plant: PlantParams) -> None:
        """Raise ValueError, saying why, if this set cannot run on this antenna; changes nothing."""
        require_stable(plant, self._chosen(params), self._tick_s)
        self._build(params)

    def retune(self, params: LoopParams, plant: PlantParams) -> None:
        """Take a new set between two ticks and without a jump; refused as a whole if it cannot run."""
        self.check(params, plant)
        before, self._params = self._params, params
        if (params.law, params.lqg_file) != (before.law, before.lqg_file):
            self._laws = self._build(params)
            self._start(*self._newest)
        else:
            gains = (params.azimuth, params.elevation)
            beside = (params.lqg_azimuth, params.lqg_elevation)
            for axis, law in enumerate(self._laws):
                if isinstance(law, PositionLoop):
                    law.retune(gains[axis])
                else:
                    law.retune(beside[axis])
        for watch in self._watch:
            watch.retune(params.oscillation)

    def reset(
        self, position_rad: Array, measured_rad: Array, velocity_rad_s: Array = AT_REST, command_rad_s: Array = AT_REST
    ) -> None:
        """Start on this motion as if the laws had given `command_rad_s` (2,); forget what the detectors have seen."""
        self._start(position_rad, velocity_rad_s, measured_rad, command_rad_s)
        for watch in self._watch:
            watch.reset()

    def rates(self, command: Motion, measured_rad: Array) -> Array:
        """Return the rate commands (2,) for a feasible command and the encoders of this tick."""
        measured = measured_rad.tolist()
        given = np.array(law_rates(self._laws, [part.tolist() for part in command], measured, self._tick_s))
        for watch, position, shown in zip(self._watch, command.position.tolist(), measured, strict=True):
            watch.update(position - shown, self._tick_s)
        self._newest = (command.position, command.velocity, measured_rad, given)
        return given

    def _start(self, position: Array, velocity: Array, measured: Array, command: Array) -> None:
        self._newest = (position, velocity, measured, command)
        rows = zip(position.tolist(), velocity.tolist(), measured.tolist(), command.tolist(), strict=True)
        for law, row in zip(self._laws, rows, strict=True):
            law.reset(*row)

    def _build(self, params: LoopParams) -> list[PositionLaw]:
        if params.law == _PI:
            return [PositionLoop(params.azimuth, self._tick_s), PositionLoop(params.elevation, self._tick_s)]
        azimuth, elevation = self._designs_of(params.lqg_file)
        return [LqgLoop(azimuth, params.lqg_azimuth), LqgLoop(elevation, params.lqg_elevation)]

    def _chosen(self, params: LoopParams) -> tuple[PositionLoopParams | LqgDesign, ...]:
        if params.law == _PI:
            return params.azimuth, params.elevation
        return self._designs_of(params.lqg_file)

    def _designs_of(self, file: str) -> tuple[LqgDesign, LqgDesign]:
        if self._designs is None or self._designs[0] != file:
            self._designs = (file, load_lqg_designs(Path(file) if file else None))
        return self._designs[1]
