"""The linear part of the plant in state space, continuous and discretised.

    x' = A x + B_command u + B_friction f + B_wind w + B_gear g
    encoder = C_encoder x,   beam = C_beam x

State: both drive angles, both drive rates, the mode coordinates, the mode rates.  u is the rate
command (rad/s), f and w are accelerations of the axis (torque over inertia), g accelerations of the
gear coordinate.  The drive is v' = w_d (u - v) + f + w; the modes are excited by v', the gears only
by the torque of the motors, so that a steady wind torque twists them.
"""

import math
from dataclasses import dataclass

import numpy as np

from rf_pointing.core import require_between
from rf_pointing.core.types import Array
from rf_pointing.servo.parameters import AxisParams, PlantParams

COMMAND, FRICTION, WIND, GEAR = slice(0, 2), slice(2, 4), slice(4, 6), slice(6, 8)
INPUTS = 8


@dataclass(frozen=True, slots=True)
class LinearModel:
    """State space: a (n, n), b (n, 8), encoder, beam, mode_excitation (2, n) of az and el.

    `gear_index` (2,) are the mode coordinates that are the gears of both axes.
    """

    a: Array
    b: Array
    encoder: Array
    beam: Array
    mode_excitation: Array
    gear_index: tuple[int, int]
    state_names: tuple[str, ...]

    @property
    def b_command(self) -> Array:
        """Input matrix (n, 2) of the two rate commands."""
        return self.b[:, COMMAND]

    @property
    def b_wind(self) -> Array:
        """Input matrix (n, 2) of the wind accelerations."""
        return self.b[:, WIND]


@dataclass(frozen=True, slots=True)
class _Mode:
    """One mode: excitation by, and appearance in, azimuth and elevation."""

    name: str
    omega_rad_s: float
    damping: float
    excitation: tuple[float, float]
    encoder: tuple[float, float]
    beam: tuple[float, float]
    gear_of: int | None = None


def linear_model(params: PlantParams) -> LinearModel:
    """Return the linear model of the plant (friction, play, limits and encoder steps left out)."""
    modes = _modes(params)
    count = len(modes)
    size = 4 + 2 * count
    a, b = np.zeros((size, size)), np.zeros((size, INPUTS))
    encoder, beam = np.zeros((2, size)), np.zeros((2, size))
    excitation = np.array([mode.excitation for mode in modes]).T
    _fill_drives(params, a, b, encoder, beam)
    for index, mode in enumerate(modes):
        _fill_mode(mode, 4 + index, 4 + count + index, a, b)
        encoder[:, 4 + index] = mode.encoder
        beam[:, 4 + index] = mode.beam
    gears = {mode.gear_of: index for index, mode in enumerate(modes) if mode.gear_of is not None}
    names = [f"{kind}_{axis}" for kind in ("angle", "rate") for axis in ("azimuth", "elevation")]
    names += [mode.name for mode in modes] + [f"{mode.name}_rate" for mode in modes]
    return LinearModel(a, b, encoder, beam, excitation, (gears[0], gears[1]), tuple(names))


def matrix_exponential(matrix: Array) -> Array:
    """Return exp(matrix) by scaling, 18 Taylor terms and squaring, to 1e-15 per squaring."""
    norm = float(np.abs(matrix).sum(axis=1).max())
    # A norm below a half makes 18 terms exact to rounding.
    squarings = max(0, math.frexp(2.0 * norm)[1])
    scaled = matrix / 2.0**squarings
    result = term = np.eye(len(matrix))
    for order in range(1, 19):
        term = term @ scaled / order
        result = result + term
    for _ in range(squarings):
        result = result @ result
    return result


def discretise(a: Array, b: Array, dt_s: float) -> Array:
    """Return [A_d B_d] (n, n+m), exact for inputs held over `dt_s` (zero-order hold)."""
    require_between("dt_s", dt_s, 1e-9, None)
    size, inputs = b.shape
    block = np.zeros((size + inputs, size + inputs))
    block[:size, :size] = a * dt_s
    block[:size, size:] = b * dt_s
    return matrix_exponential(block)[:size]


def _fill_drives(params: PlantParams, a: Array, b: Array, encoder: Array, beam: Array) -> None:
    for axis, drive in enumerate((params.azimuth, params.elevation)):
        a[axis, 2 + axis] = 1.0
        a[2 + axis, 2 + axis] = -drive.drive_bandwidth_rad_s
        b[2 + axis, axis] = drive.drive_bandwidth_rad_s
        b[2 + axis, 2 + axis] = b[2 + axis, 4 + axis] = 1.0
        encoder[axis, axis] = beam[axis, axis] = 1.0


def _fill_mode(mode: _Mode, position: int, rate: int, a: Array, b: Array) -> None:
    a[position, rate] = 1.0
    a[rate, position] = -(mode.omega_rad_s**2)
    a[rate, rate] = -2.0 * mode.damping * mode.omega_rad_s
    for axis, factor in enumerate(mode.excitation):
        a[rate, 2 + axis] -= factor * a[2 + axis, 2 + axis]
        b[rate] -= factor * b[2 + axis]
    if mode.gear_of is not None:
        # The wind pushes the structure, not the motors: a steady torque then twists the gear and
        # leaves the drive.
        b[rate, 4 + mode.gear_of] = 0.0
        b[rate, 6 + mode.gear_of] = 1.0


def _modes(params: PlantParams) -> list[_Mode]:
    # Excitation of the bending mode by elevation (BWG, Sec. IV-A).
    factor = params.pinion_floor + (1.0 - params.pinion_floor) * math.cos(params.pinion_angle_rad)
    bending = (factor * params.azimuth_to_bending, factor)
    azimuth = _axis_modes("azimuth", params.azimuth, params.azimuth_modes_in_elevation, (1.0, 0.0))
    elevation = _axis_modes(
        "elevation", params.elevation, params.elevation_modes_in_azimuth, (0.0, 1.0), bending
    )
    cross = _Mode(
        "cross",
        2.0 * math.pi * params.cross_mode_frequency_hz,
        params.cross_mode_damping,
        (1.0, 0.0),
        (0.0, params.cross_mode_residue),
        (0.0, params.cross_mode_residue),
    )
    return [*azimuth, *elevation, cross, _gear(params.azimuth, 0), _gear(params.elevation, 1)]


def _axis_modes(
    name: str,
    axis: AxisParams,
    cross: tuple[float, ...],
    excitation: tuple[float, float],
    first: tuple[float, float] | None = None,
) -> list[_Mode]:
    """Return the modes of one axis; `first` is the excitation of its first mode if it differs."""
    modes = []
    for index, frequency in enumerate(axis.mode_frequency_hz):
        own = axis.mode_encoder_residue[index], axis.mode_beam_residue[index]
        encoder, beam = (
            (seen, cross[index]) if name == "azimuth" else (cross[index], seen) for seen in own
        )
        excited = first if first is not None and index == 0 else excitation
        omega, damping = 2.0 * math.pi * frequency, axis.mode_damping[index]
        modes.append(_Mode(f"{name}_mode{index + 1}", omega, damping, excited, encoder, beam))
    return modes


def _gear(axis: AxisParams, own: int) -> _Mode:
    unit = (1.0, 0.0) if own == 0 else (0.0, 1.0)
    name = ("azimuth_gear", "elevation_gear")[own]
    return _Mode(name, axis.gear_frequency_rad_s, axis.gear_damping, unit, unit, unit, gear_of=own)
