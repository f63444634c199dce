"""The antenna in motion: rate command and wind torque in, encoder and radio beam out.

The linear part is stepped exactly (zero-order hold, matrices cached per step length); limits,
friction, brakes and gear play enter as inputs held over each substep (`drive.py`).  Angles are
continuous, never folded.
"""

import copy
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from rf_pointing.core import as_finite_array, as_finite_pair, require_between
from rf_pointing.core.types import Array, Pair
from rf_pointing.servo.drive import DriveConstants, axis_inputs, drive_constants, gear_correction
from rf_pointing.servo.linear_model import INPUTS, LinearModel, discretise, linear_model
from rf_pointing.servo.parameters import PlantParams

# Measured step lengths differ from tick to tick; on a grid few distinct matrices are needed, and
# these are cached.
_GRID_S = 1e-4


@dataclass(slots=True)
class PlantState:
    """Everything that `AntennaPlant` remembers: copied back, the run goes on identically.

    `x` (n,) is the state of the linear model, `debt_s` the part of the elapsed time (below 0.1 ms)
    that is not yet integrated; `held_axis` keeps its brake set (-1: none); `commands` are (time,
    azimuth, elevation) rate commands still inside the dead time; `encoder_rad` (2,) is the latest
    reading, `random` the state of the noise
    generator.
    """

    x: Array
    time_s: float
    debt_s: float
    powered: bool
    braked: bool
    held_axis: int
    at_stop: tuple[bool, bool]
    encoder_rad: Array
    commands: tuple[tuple[float, float, float], ...]
    random: Mapping[str, Any] = field(repr=False)


class AntennaPlant:
    """Two-axis antenna; starts at rest, drives on, brakes released.

    `step` advances by any measured `dt_s`: whole substeps plus one shorter one on a 0.1-ms grid;
    what remains below the grid is carried to the next step and the outputs are extrapolated over
    it.
    """

    def __init__(
        self,
        params: PlantParams,
        random: "np.random.Generator",
        position_rad: ArrayLike = (0.0, math.pi / 4.0),
    ) -> None:
        self._random = random
        self._joints: Pair | None = None
        self._configure(params)
        self._state = self._rest(as_finite_array("position_rad", position_rad, (2,)))

    @property
    def state(self) -> PlantState:
        """A copy of the complete state, noise generator included."""
        self._state.random = self._random.bit_generator.state
        return copy.deepcopy(self._state)

    @state.setter
    def state(self, state: PlantState) -> None:
        if state.x.shape != self._state.x.shape:
            raise ValueError(f"state.x has shape {state.x.shape}, must be {self._state.x.shape}")
        self._state = copy.deepcopy(state)
        self._joints = None
        self._random.bit_generator.state = state.random

    @property
    def encoder_rad(self) -> Array:
        """Encoder angles (2,) of the latest step: quantised, with noise."""
        return self._state.encoder_rad.copy()

    @property
    def beam_rad(self) -> Array:
        """Joint angles (2,) at which a rigid antenna would have the radio beam (truth)."""
        return self._output(self._model.beam)

    @property
    def true_joint_rad(self) -> Array:
        """Angles (2,) at the encoders without their steps and noise (truth)."""
        return np.array(self.joints())

    def joints(self) -> Pair:
        """Return `true_joint_rad` as plain floats."""
        if self._joints is None:
            azimuth, elevation = self._output(self._model.encoder).tolist()
            self._joints = azimuth, elevation
        return self._joints

    @property
    def velocity_rad_s(self) -> Array:
        """Tachometer rates (2,) of the drives, referred to the axes."""
        return self._state.x[2:4].copy()

    @property
    def at_stop(self) -> tuple[bool, bool]:
        """Which axis touched a hard stop during the latest step."""
        return self._state.at_stop

    @property
    def powered(self) -> bool:
        """Whether the drives have power."""
        return self._state.powered

    def brake(self) -> None:
        """Cut the drives and set the brakes."""
        self._state.braked, self._state.powered = True, False

    def release_brake(self, held_axis: int = -1) -> None:
        """Release the brakes and power the drives, but for those of `held_axis`."""
        self._state.braked, self._state.powered, self._state.held_axis = False, True, held_axis

    def check(self, params: PlantParams) -> None:
        """Raise ValueError if `reconfigure` would refuse these: the number of modes must stay."""
        for name in ("azimuth", "elevation"):
            new, old = (
                len(getattr(each, name).mode_frequency_hz) for each in (params, self.params)
            )
            if new != old:
                raise ValueError(
                    f"{name}.mode_frequency_hz has {new} modes, must keep {old} while the antenna runs"
                )

    def reconfigure(self, params: PlantParams) -> None:
        """Take new parameters with the motion going on; refused if the number of modes differs."""
        self.check(params)
        self._configure(params)

    def step(self, rate_command_rad_s: ArrayLike, wind_torque_n_m: ArrayLike, dt_s: float) -> None:
        """Advance by `dt_s` under held rate commands (2,) (rad/s) and wind torques (2,) (N m).

        Raises
        ------
        ValueError
            For a non-finite input or `dt_s` outside (0, 1 s].
        """
        command = as_finite_pair("rate_command_rad_s", rate_command_rad_s)
        torque = as_finite_pair("wind_torque_n_m", wind_torque_n_m)
        wind = (torque[0] / self._inertia[0], torque[1] / self._inertia[1])
        require_between("dt_s", dt_s, 1e-6, 1.0)
        state = self._state
        state.at_stop = (False, False)
        if self._delayed:
            state.commands = (*state.commands, (state.time_s, command[0], command[1]))
        self._integrate(command, wind, dt_s + state.debt_s)
        self._read_encoders()

    def _integrate(self, command: Pair, wind: Pair, interval_s: float) -> None:
        substep_s = self.params.substep_s
        # The tolerance keeps a tick of 20 ms at 200 grid steps, not 199 and a rest.
        ticks = int(interval_s / _GRID_S + 1e-6)
        ticks_per_substep = max(1, round(substep_s / _GRID_S))
        whole, rest = divmod(ticks, ticks_per_substep)
        x = self._state.x.tolist()
        for count in [ticks_per_substep] * whole + ([rest] if rest else []):
            x = self._substep(x, command, wind, count)
        left_s = interval_s - ticks * _GRID_S
        self._state.debt_s, self._joints = left_s if left_s > 0.0 else 0.0, None

    def _substep(self, x: list[float], command: Pair, wind: Pair, ticks: int) -> list[float]:
        """Go on from the state `x` of the linear model, and return the next one."""
        cached = self._cache.get(ticks) or self._prepare(ticks)
        matrix, (azimuth, elevation) = cached
        state, size, (gear_az, gear_el) = self._state, self._size, self._gear
        if self._delayed:
            # The dead time is not a whole number of ticks: the command in force may change within a
            # tick.
            command = self._delayed_commands()
        powered, braked, held = state.powered, state.braked, state.held_axis
        u_az, friction_az, pushed_az = axis_inputs(
            x[2], command[0], wind[0], powered and held != 0, braked or held == 0, azimuth
        )
        u_el, friction_el, pushed_el = axis_inputs(
            x[3], command[1], wind[1], powered and held != 1, braked or held == 1, elevation
        )
        play_az = gear_correction(x[gear_az], x[gear_az + self._modes], azimuth)
        play_el = gear_correction(x[gear_el], x[gear_el + self._modes], elevation)
        z = self._z
        z[:size] = state.x
        z[size:] = (u_az, u_el, friction_az, friction_el, pushed_az, pushed_el, play_az, play_el)
        # Into the state itself: no new array in every substep.
        np.dot(matrix, z, out=state.x)
        state.time_s += ticks * _GRID_S
        x = state.x.tolist()
        (low_az, high_az), (low_el, high_el) = self._travel
        if low_az <= x[0] <= high_az and low_el <= x[1] <= high_el:
            return x
        for axis, (low, high) in enumerate(self._travel):
            if not low <= x[axis] <= high:
                self._hit_stop(axis)
        return list(state.x.tolist())

    def _hit_stop(self, axis: int) -> None:
        """Stop the axis dead, which strikes the modes: their rates jump by excitation * rate."""
        x, rate = self._state.x, self._state.x[2 + axis]
        x[axis] = min(max(x[axis], self._travel[axis][0]), self._travel[axis][1])
        # The momentum of the drive goes into the structure in an instant.
        x[4 + self._modes :] += self._model.mode_excitation[axis] * rate
        x[2 + axis] = 0.0
        hit = list(self._state.at_stop)
        hit[axis] = True
        self._state.at_stop = (hit[0], hit[1])

    def _delayed_commands(self) -> Pair:
        """Return, per axis, the newest command older than the dead time (zero before the first)."""
        state = self._state
        commands = state.commands
        due_az, due_el = (
            sum(entry[0] <= state.time_s - delay + 1e-9 for entry in commands)
            for delay in self._delay
        )
        found = (
            commands[due_az - 1][1] if due_az else 0.0,
            commands[due_el - 1][2] if due_el else 0.0,
        )
        # What is in force on the slower axis, and what is newer.
        state.commands = commands[max(0, min(due_az, due_el) - 1) :]
        return found

    def _read_encoders(self) -> None:
        angles = self.joints()
        # Both axes draw, also when one has no noise: then the other's does not depend on it.
        noise = self._random.standard_normal(2).tolist()
        for axis, step in enumerate(self._encoder_step):
            noisy = angles[axis] + self._encoder_noise[axis] * noise[axis]
            self._state.encoder_rad[axis] = round(noisy / step) * step

    def _output(self, rows: Array) -> Array:
        output: Array = rows @ self._state.x
        # Without this the outputs would jitter by rate times 0.1 ms when measured steps are fed in.
        if self._state.debt_s > 0.0:
            output = output + self._state.debt_s * (rows @ (self._model.a @ self._state.x))
        return output

    def _prepare(self, ticks: int) -> tuple[Array, tuple[DriveConstants, DriveConstants]]:
        step_s = ticks * _GRID_S
        constants = (
            drive_constants(self.params.azimuth, step_s),
            drive_constants(self.params.elevation, step_s),
        )
        self._cache[ticks] = (discretise(self._model.a, self._model.b, step_s), constants)
        return self._cache[ticks]

    def _configure(self, params: PlantParams) -> None:
        axes = (params.azimuth, params.elevation)
        self.params = params
        self._joints = None
        self._model: LinearModel = linear_model(params)
        self._size = len(self._model.a)
        self._modes = self._model.mode_excitation.shape[1]
        self._gear = [4 + index for index in self._model.gear_index]
        self._cache: dict[int, tuple[Array, tuple[DriveConstants, DriveConstants]]] = {}
        self._z = np.zeros(self._size + INPUTS)
        self._inertia = [axis.inertia_kg_m2 for axis in axes]
        self._travel = [(axis.travel_min_rad, axis.travel_max_rad) for axis in axes]
        self._delay = [axis.drive_delay_s for axis in axes]
        self._delayed = max(self._delay) > 0.0
        self._encoder_step = [2.0 * math.pi / 2**axis.encoder_bits for axis in axes]
        self._encoder_noise = [axis.encoder_noise_rad for axis in axes]

    def _rest(self, position_rad: Array) -> PlantState:
        for name, angle, (low, high) in zip(
            ("azimuth", "elevation"), position_rad, self._travel, strict=True
        ):
            require_between(f"position_rad ({name})", float(angle), low, high)
        x = np.zeros(self._size)
        x[:2] = position_rad
        encoder = np.round(position_rad / np.array(self._encoder_step)) * self._encoder_step
        return PlantState(
            x,
            0.0,
            0.0,
            True,
            False,
            -1,
            (False, False),
            encoder,
            (),
            self._random.bit_generator.state,
        )
