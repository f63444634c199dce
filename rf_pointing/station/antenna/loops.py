"""The position laws of both axes: PI or LQG, exchanged while running, watched for swinging.

A change of gains or of the law is taken as a whole, between two ticks and without a jump of the
rate command; one that would be unstable on the antenna is refused and changes nothing.  Stable
means: no pole outside the unit circle in the sampled closed loop of the linear plant behind its
dead time, stepped exactly over one control period, and the laws that run, filters included.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from rf_pointing.controllers import (
    CommandPreprocessorParams,
    LawMatrices,
    LqgDesign,
    LqgLoop,
    LqgLoopParams,
    OscillationDetector,
    OscillationDetectorParams,
    PositionLaw,
    PositionLoop,
    PositionLoopParams,
    TrajectoryBufferParams,
    dss13_loops,
    dss13_lqg_loops,
    load_lqg_designs,
)
from rf_pointing.controllers.margins import loop_margins, sampled_response
from rf_pointing.core import AXES, Array, Motion, Params, parameter
from rf_pointing.servo import PlantParams, discretise
from rf_pointing.servo.linear_model import linear_model
from rf_pointing.station.antenna.axis_response import AxisResponse

Law = PositionLoopParams | LqgDesign
AnyLaw = PositionLaw[Any, Any]

AT_REST = np.zeros(2)
_PI, LQG = "pi", "lqg"
BY_DRIVE = "drive"
"""The law of a drive that takes positions and closes the loop itself."""
_AZIMUTH, _ELEVATION = dss13_loops("tuned")
_LQG_AZIMUTH, _LQG_ELEVATION = dss13_lqg_loops()
EDGE = 1e-6
"""Open integrators lie on the unit circle, a double one within the root of rounding of it."""

MOVED = 1.25
"""A law is refused where the peak of its sensitivity is so many times the one it was tuned for."""


@dataclass(frozen=True, kw_only=True)
class LoopParams(Params):
    """Position laws of both axes, the watch over them, and the limits of every command."""

    law: str = parameter(
        _PI, "position law of both axes; drive: that of the device", choices=(_PI, LQG, BY_DRIVE)
    )  # fmt: skip
    azimuth: PositionLoopParams = parameter(_AZIMUTH, "azimuth PI loop")
    elevation: PositionLoopParams = parameter(_ELEVATION, "elevation PI loop")
    lqg_file: str = parameter("", "file of the LQG designs, empty for those of DSS-13")
    lqg_azimuth: LqgLoopParams = parameter(_LQG_AZIMUTH, "feedforward and limit of the azimuth LQG law")
    lqg_elevation: LqgLoopParams = parameter(_LQG_ELEVATION, "feedforward and limit of the elevation LQG law")
    oscillation: OscillationDetectorParams = parameter(OscillationDetectorParams(), "what counts as an oscillation")
    preprocessor: CommandPreprocessorParams = parameter(CommandPreprocessorParams(), "limits of the commands")
    table: TrajectoryBufferParams = parameter(TrajectoryBufferParams(), "trust in the command table")


def law_rates(
    laws: Sequence[AnyLaw], command: Sequence[Sequence[float]], encoder_rad: Sequence[float], tick_s: float
) -> list[float]:
    """Return the rate commands (2,) of both laws and advance the laws by one tick.

    `command` is position (rad), velocity (rad/s) and acceleration (rad/s^2) of azimuth and
    elevation.
    """
    position, velocity, acceleration = command
    rates = []
    for axis, law in enumerate(laws):
        rate = law.output(position[axis], velocity[axis], encoder_rad[axis], acceleration[axis])
        # Before the drives move: nothing between the laws and the drives cuts these rates any more.
        law.update(tick_s, rate)
        rates.append(rate)
    return rates


class AxisLoops:
    """Both axes' laws: `reset` to the antenna's motion, then `rates` once a tick."""

    def __init__(self, params: LoopParams, plant: PlantParams, tick_s: float) -> None:
        self._tick_s = tick_s
        self._designs: tuple[str, tuple[LqgDesign, LqgDesign]] | None = None
        self.check(params, plant)
        self.params = params
        self._laws = self._build(params)
        self.watch = tuple(OscillationDetector(params.oscillation) for _ in AXES)
        self._newest = (np.zeros(2), np.zeros(2), np.zeros(2), np.zeros(2))

    @property
    def oscillation(self) -> str:
        """Which axis oscillates and how, "" if none does."""
        found = [f"{axis}: {seen.reason}" for axis, seen in zip(AXES, self.watch, strict=True) if seen.oscillating]
        return "; ".join(found)

    @property
    def in_force(self) -> Sequence[Law]:
        """Gains or designs of the laws that run; ValueError where the device closes the loop."""
        params = self.params
        if params.law == BY_DRIVE:
            raise ValueError(f"loops.law={BY_DRIVE}: the device closes the loop")
        if params.law == LQG:
            return self._designs_of(params.lqg_file)
        return params.azimuth, params.elevation

    def check(self, params: LoopParams, plant: PlantParams) -> None:
        """Raise ValueError, saying why, if this set cannot run on this antenna; changes nothing."""
        # Eigenvalues of some 30 states take milliseconds; unchecked gains can shake an antenna
        # apart.
        if params.law == BY_DRIVE:
            return
        gains: Sequence[Law] = params.azimuth, params.elevation
        laws = gains if params.law == _PI else self._designs_of(params.lqg_file)
        require_stable(plant, laws, self._tick_s)
        require_unmoved(plant, laws, self._tick_s)
        # Building places the filters below half the sampling rate, or raises.
        self._build(params)

    def retune(self, params: LoopParams, plant: PlantParams) -> None:
        """Take a new set between two ticks without a jump; all of it or, with ValueError, none."""
        self.check(params, plant)
        before, self.params = self.params, params
        # The estimates of another law mean nothing: it starts anew on the newest motion and rate
        # command.
        if (params.law, params.lqg_file) != (before.law, before.lqg_file):
            self._laws = self._build(params)
            self._start(*self._newest)
        else:
            gains = (params.azimuth, params.elevation)
            feedforwards = (params.lqg_azimuth, params.lqg_elevation)
            # A device that closes the loop itself has no laws here.
            for law, changed in zip(self._laws, gains if params.law == _PI else feedforwards, strict=False):
                law.retune(changed)
        for watch in self.watch:
            watch.retune(params.oscillation)

    def reset(
        self, position_rad: Array, measured_rad: Array, velocity_rad_s: Array = AT_REST, command_rad_s: Array = AT_REST
    ) -> None:
        """Start on this motion as if the laws had given `command_rad_s`, with calm detectors."""
        self._start(position_rad, velocity_rad_s, measured_rad, command_rad_s)
        for watch in self.watch:
            watch.reset()

    def rates(self, command: Motion, measured_rad: Array) -> Array:
        """Return the rate commands (2,) for a feasible command and the encoders of this tick."""
        measured = measured_rad.tolist()
        if self.params.law == BY_DRIVE:
            # No law runs here that could swing: a device behind its slews shows what they are, to
            # and fro, and the watch of its set points sees it swing about one.
            given = command.velocity
        else:
            position, velocity, acceleration = command
            wanted = position.tolist()
            rows = wanted, velocity.tolist(), acceleration.tolist()
            given = np.array(law_rates(self._laws, rows, measured, self._tick_s))
            for axis, watch in enumerate(self.watch):
                # The error of the feasible command: that of the raw one is large in every slew.
                watch.update(wanted[axis] - measured[axis], self._tick_s)
        # Kept for an exchange of the law: the next one starts where this one is.
        self._newest = (command.position, command.velocity, measured_rad, given)
        return given

    def _start(self, position: Array, velocity: Array, measured: Array, command: Array) -> None:
        self._newest = (position, velocity, measured, command)
        rows = zip(position.tolist(), velocity.tolist(), measured.tolist(), command.tolist(), strict=True)
        for law, row in zip(self._laws, rows, strict=False):
            law.reset(*row)

    def _build(self, params: LoopParams) -> list[AnyLaw]:
        if params.law == BY_DRIVE:
            return []
        if params.law == _PI:
            return [PositionLoop(params.azimuth, self._tick_s), PositionLoop(params.elevation, self._tick_s)]
        azimuth, elevation = self._designs_of(params.lqg_file)
        return [LqgLoop(azimuth, params.lqg_azimuth), LqgLoop(elevation, params.lqg_elevation)]

    def _designs_of(self, file: str) -> tuple[LqgDesign, LqgDesign]:
        # A file is read when it is named, not in every change of a gain.
        if self._designs is None or self._designs[0] != file:
            self._designs = (file, load_lqg_designs(Path(file) if file else None))
        return self._designs[1]


BOTH = (0, 1)


def require_stable(
    plant: PlantParams, laws: Sequence[Law], tick_s: float, axes: Sequence[int] = BOTH
) -> None:  # fmt: skip
    """Raise ValueError, naming the axis, unless the laws of these axes are stable on the plant."""
    # Each axis is closed alone first, so that the reason can name it, then all together.
    for closed in dict.fromkeys((*((axis,) for axis in axes), tuple(axes))):
        pole = closed_loop_pole(plant, laws, tick_s, closed)
        if abs(pole) > 1.0 + EDGE:
            who = " and ".join(AXES[axis] for axis in closed)
            frequency_hz = abs(math.atan2(pole.imag, pole.real)) / (2.0 * math.pi * tick_s)
            gains = "; ".join(_gains(AXES[axis], laws[axis]) for axis in closed)
            raise ValueError(
                f"{gains}: the closed loop of {who} is unstable at {frequency_hz:.2f} Hz, "
                f"spectral radius {abs(pole):.4f} must be <= 1"
            )


def require_unmoved(
    plant: PlantParams, laws: Sequence[Law], tick_s: float, axes: Sequence[int] = BOTH
) -> None:  # fmt: skip
    """Raise ValueError, naming the axis, where a law has lost the margins it was tuned for.

    A law that says no peak of its sensitivity is held to stability alone.
    """
    for axis in axes:
        if (law := laws[axis]).peak_sensitivity == 0.0:
            continue
        known = AxisResponse.on_own_grid(plant, axis, tick_s)
        gain = sampled_response(law.matrices(tick_s), known.frequency_hz, tick_s)[:, 0, 0]
        found = loop_margins(known.frequency_hz, gain * known.from_command[:, 0])
        if found.peak_sensitivity > MOVED * law.peak_sensitivity:
            raise ValueError(
                f"{AXES[axis]}: the plant is not the one that this law was tuned for: its "
                f"sensitivity has a peak of {found.peak_sensitivity:.2f} at {found.peak_hz:.2f} Hz, tuned for "
                f"{law.peak_sensitivity:.2f}, at most {MOVED:g} times as much; identify and tune "
                f"again, or correct plant.{AXES[axis]}"
            )


def closed_loop_pole(plant: PlantParams, laws: Sequence[Law], tick_s: float, closed: Sequence[int] = (0, 1)) -> complex:
    """Return the pole (of z) farthest from the origin with the loops of `closed` closed."""
    a, b, encoder = _sampled(plant, tick_s)
    for axis in closed:
        a, b, encoder = _close(a, b, encoder, axis, laws[axis].matrices(tick_s))
    poles = np.linalg.eigvals(a)
    return complex(poles[np.argmax(np.abs(poles))])


def _gains(axis: str, law: Law) -> str:
    if isinstance(law, LqgDesign):
        return f"{axis} LQG of control_weight={law.weights.control_weight}"
    return f"{axis}.proportional_gain={law.proportional_gain}, {axis}.integral_gain={law.integral_gain}"


def _sampled(plant: PlantParams, tick_s: float) -> tuple[Array, Array, Array]:
    """Return a, b (n, 2), encoder (2, n) over one control period, dead times as whole periods."""
    model = linear_model(plant)
    step, size = discretise(model.a, model.b_command, tick_s), len(model.a)
    a, b, encoder = step[:, :size], step[:, size:], model.encoder
    for axis, limits in enumerate((plant.azimuth, plant.elevation)):
        # The dead time costs phase in proportion to frequency; without it unstable gains pass.
        for _ in range(round(limits.drive_delay_s / tick_s)):
            a, b, encoder = _delay(a, b, encoder, axis)
    return a, b, encoder


def _delay(a: Array, b: Array, encoder: Array, axis: int) -> tuple[Array, Array, Array]:
    """Put one sample of delay before the command of an axis."""
    size = len(a)
    longer = np.zeros((size + 1, size + 1))
    longer[:size, :size], longer[:size, size] = a, b[:, axis]
    entry = np.vstack([b, np.zeros((1, 2))])
    entry[:, axis] = 0.0
    entry[size, axis] = 1.0
    return longer, entry, np.hstack([encoder, np.zeros((2, 1))])


def _close(a: Array, b: Array, encoder: Array, axis: int, law: LawMatrices) -> tuple[Array, Array, Array]:
    """Close the loop of an axis: command = law(-encoder)."""
    la, lb, lc, ld = law
    entry, shown = b[:, axis : axis + 1], encoder[axis : axis + 1]
    closed = np.block([[a - entry @ ld @ shown, entry @ lc], [-lb @ shown, la]])
    return closed, np.vstack([b, np.zeros((len(la), 2))]), np.hstack([encoder, np.zeros((2, len(la)))])
