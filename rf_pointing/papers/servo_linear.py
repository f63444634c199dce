"""The closed loop in continuous time: antenna, position loops, radio integrator, as one linear
system.

    command = r + o,   o' = 2 pi f_m (r + delta - beam)
    u = N(s) [k_p e + k_i int(e) + F(s) command']

Used for root loci and exact responses; the sampled loop is the real code in `servo_pass.py`.
"""

import math
from dataclasses import dataclass

import numpy as np

from rf_pointing.controllers import PositionLoopParams
from rf_pointing.core.types import Array, ComplexArray
from rf_pointing.servo import PlantParams
from rf_pointing.servo.linear_model import linear_model

COMMAND, RATE, WIND, DEVIATION = slice(0, 2), slice(2, 4), slice(4, 6), slice(6, 8)
INPUTS = 8


@dataclass(frozen=True, slots=True)
class ClosedLoop:
    """x' = a x + b u with u = command (2), its rate (2), wind acceleration (2), target deviation
    (2).

    `encoder` and `beam` are (2, n); `offset` (2, n) is what the radio integrator adds to the
    command.
    """

    a: Array
    b: Array
    encoder: Array
    beam: Array
    offset: Array

    def stable(self) -> bool:
        """Whether every pole lies left of the axis (a pole at zero of an unused integrator does not
        count).
        """
        return bool(np.max(np.linalg.eigvals(self.a).real) < 1e-9)

    def response(self, frequency_hz: Array, output: Array, inputs: slice) -> ComplexArray:
        """Return the transfer function (f, rows, 2) from `inputs` to `output`."""
        s = 2j * np.pi * np.asarray(frequency_hz)[:, None, None]
        solved = np.linalg.solve(
            s * np.eye(len(self.a)) - self.a, self.b[None, :, inputs].astype(np.complex128)
        )
        return np.asarray(output @ solved)


def closed_loop(
    plant: PlantParams,
    loops: tuple[PositionLoopParams, PositionLoopParams],
    bandwidth_hz: tuple[float, float] = (0.0, 0.0),
) -> ClosedLoop:
    """Return the loop of `plant` under both position loops and radio integrators of f_m
    `bandwidth_hz`.
    """
    model = linear_model(plant)
    size = len(model.a)
    total = size + 10
    a, b = np.zeros((total, total)), np.zeros((total, INPUTS))
    a[:size, :size], b[:size, WIND] = model.a, model.b_wind
    encoder, beam = np.zeros((2, total)), np.zeros((2, total))
    encoder[:, :size], beam[:, :size] = model.encoder, model.beam
    offset = np.eye(total)[size + 8 :]
    for axis in (0, 1):
        gain = 2.0 * math.pi * bandwidth_hz[axis]
        rate_row, rate_input = -gain * beam[axis], gain * (_unit(axis) + _unit(6 + axis))
        a[size + 8 + axis], b[size + 8 + axis] = rate_row, rate_input
        row, through = _controller(
            axis, size, a, b, loops[axis], offset[axis] - encoder[axis], rate_row, rate_input
        )
        a[:size] += np.outer(model.b_command[:, axis], row)
        b[:size] += np.outer(model.b_command[:, axis], through)
    return ClosedLoop(a, b, encoder, beam, offset)


def _unit(index: int) -> Array:
    unit: Array = np.eye(INPUTS)[index]
    return unit


def _controller(
    axis: int,
    size: int,
    a: Array,
    b: Array,
    loop: PositionLoopParams,
    error: Array,
    rate_row: Array,
    rate_input: Array,
) -> tuple[Array, Array]:
    """Fill the four states of one position loop and return its command as rows over states and
    inputs.
    """
    integral, filtered, band, low = (size + 4 * axis + k for k in range(4))
    a[integral], b[integral] = error, _unit(axis)
    wb = 2.0 * math.pi * loop.feedforward_band_hz
    a[filtered], b[filtered] = wb * rate_row, wb * (rate_input + _unit(2 + axis))
    a[filtered, filtered] -= wb
    row = loop.proportional_gain * error
    row[integral] += loop.integral_gain
    row[filtered] += loop.feedforward_gain
    through = loop.proportional_gain * _unit(axis)
    wn, width = 2.0 * math.pi * loop.notch_frequency_hz, 2.0 * loop.notch_damping
    a[band], b[band] = wn * row, wn * through
    a[band, band] -= wn * width
    a[band, low] -= wn
    a[low, band] = wn
    if loop.notch_enabled:
        row[band] -= width
    return row, through


def stability_limit_hz(
    plant: PlantParams,
    loops: tuple[PositionLoopParams, PositionLoopParams],
    axis: int,
    highest_hz: float = 3.0,
) -> float:
    """Return the smallest f_m of one axis' radio loop at which the closed loop is no longer stable
    (root locus).

    Scanned upwards in steps of 2 % from 5 mHz, then bisected; `highest_hz` if stable all the way.
    """

    def stable(f_m: float) -> bool:
        return closed_loop(plant, loops, (f_m, 0.0) if axis == 0 else (0.0, f_m)).stable()

    low = high = 0.005
    while stable(high):
        low, high = high, 1.02 * high
        if high > highest_hz:
            return highest_hz
    for _ in range(20):
        middle = math.sqrt(low * high)
        low, high = (middle, high) if stable(middle) else (low, middle)
    return low


def peak_sensitivity(
    plant: PlantParams, loops: tuple[PositionLoopParams, PositionLoopParams], axis: int, f_m: float
) -> float:
    """Return Ms = max |1 / (1 + G H)| of one axis' radio loop, G from command to beam with the
    encoder loop closed.
    """
    frequency = np.geomspace(1e-3, 20.0, 4000)
    loop = closed_loop(plant, loops)
    s = 2j * np.pi * frequency
    both = loop.response(frequency, loop.beam, COMMAND) + s[:, None, None] * loop.response(
        frequency, loop.beam, RATE
    )
    return float(np.max(np.abs(1.0 / (1.0 + both[:, axis, axis] * 2.0 * math.pi * f_m / s))))
