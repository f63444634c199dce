"""The servo run as one compiled loop (numba): plant substeps, wind, encoders, position loops.

Limits, friction, gear play, filter samples and wind torque are the very functions of `servo` and `controllers`,
compiled; what is written out here is the order of the calls and the matrix product.  Random numbers come from the same
streams, drawn ahead.
"""

import math
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from rf_pointing.controllers import PositionLoopParams, Section, filter_sample
from rf_pointing.core import random_stream
from rf_pointing.servo import (
    GustFilter,
    PlantParams,
    WindParams,
    axis_inputs,
    discretise,
    drive_constants,
    gear_correction,
    gust_torque_n_m,
    linear_model,
    tooth_wind,
    torque_constants,
)

if TYPE_CHECKING:
    from rf_pointing.papers.headless_servo import ServoRunSetup

__all__ = ["CompiledServo"]

Array = NDArray[np.float64]

_GUST_STEP_S = 0.02
_CALM_M_S = 1e-3


class CompiledServo:
    """The compiled loop with everything prepared that does not hang on the seed; `run` may be called from many threads.

    Raises
    ------
    ValueError
        If the tick is not a whole number of substeps and of gust steps, which the compiled loop needs.
    """

    def __init__(self, setup: "ServoRunSetup") -> None:
        self._setup = setup
        substeps, step_s = _substeps(setup.plant, setup.tick_s)
        self._clock = (setup.tick_s, substeps, step_s)
        self._plant = _plant_arrays(setup.plant, step_s)
        self._gusts = _Gusts(setup.wind, len(setup.position_rad), setup.tick_s)
        self._loops = tuple(_loop_constants(params, setup.tick_s) for params in setup.loops)
        self._kernel = _kernel()

    def run(self, seed: int) -> tuple[Array, Array, Array]:
        """Return rate commands, encoder and beam angles (ticks, 2) of the run with one seed."""
        setup = self._setup
        count = len(setup.position_rad)
        noise = random_stream(seed, "encoder").standard_normal((count, 2))
        rates, encoder, beam = (np.zeros((count, 2)) for _ in range(3))
        commands = (setup.position_rad, setup.velocity_rad_s, setup.acceleration_rad_s2)
        wind = self._gusts.drawn(seed)
        self._kernel(*commands, self._plant, wind, noise, self._loops, self._clock, rates, encoder, beam)
        return rates, encoder, beam


def _substeps(params: PlantParams, tick_s: float) -> tuple[int, float]:
    count = round(tick_s / params.substep_s)
    if count < 1 or abs(count * params.substep_s - tick_s) > 1e-9:
        raise ValueError(f"tick_s={tick_s} must be a whole number of substeps of {params.substep_s} s")
    if abs(tick_s - _GUST_STEP_S) > 1e-9:
        raise ValueError(f"tick_s={tick_s} must be {_GUST_STEP_S} s, the step of the gusts")
    return count, params.substep_s


def _plant_arrays(params: PlantParams, step_s: float) -> tuple[Any, ...]:
    model = linear_model(params)
    axes = (params.azimuth, params.elevation)
    encoder_step = np.array([2.0 * math.pi / 2**axis.encoder_bits for axis in axes])
    return (
        np.ascontiguousarray(discretise(model.a, model.b, step_s).T),
        np.vstack([model.encoder, model.beam]),
        np.ascontiguousarray(model.mode_excitation),
        tuple(drive_constants(axis, step_s) for axis in axes),
        np.array([4 + index for index in model.gear_index]),
        np.array([[axis.travel_min_rad, axis.travel_max_rad] for axis in axes]),
        np.array([axis.inertia_kg_m2 for axis in axes]),
        np.array([axis.drive_delay_s for axis in axes]),
        encoder_step,
        np.array([axis.encoder_noise_rad for axis in axes]),
    )


class _Gusts:
    """What the kernel needs of the wind: constants once, random numbers per seed."""

    def __init__(self, params: WindParams, count: int, tick_s: float) -> None:
        self._blows = params.mean_speed_m_s > _CALM_M_S
        self._gust = GustFilter.davenport(params.mean_speed_m_s if self._blows else 1.0, params.drag_coefficient)
        self._start = self._gust.stationary_factor().T
        self._decay, factor = self._gust.step_matrices(tick_s)
        self._factor, self._count = factor.T, count if self._blows else 0
        self._speed = np.array([params.mean_speed_m_s, params.lateral_ratio])
        self._torque = torque_constants(params)

    def drawn(self, seed: int) -> tuple[Any, ...]:
        random = random_stream(seed, "wind")
        start = random.standard_normal((2, 4)) @ self._start
        noise = random.standard_normal((self._count, 2, 4)) @ self._factor
        return self._blows, start, self._decay, noise, self._gust.residues, self._speed, self._torque


def _loop_constants(params: PositionLoopParams, tick_s: float) -> tuple[Any, ...]:
    half = math.pi * params.feedforward_band_hz * tick_s
    return (
        (params.proportional_gain, params.integral_gain, params.feedforward_gain, half, params.feedforward_lead_s),
        params.rate_limit_rad_s,
        params.shaping_enabled,
        Section(params.shaping, tick_s).constants,
        params.notch_enabled,
        Section(params.notch.section, tick_s).constants,
    )


@cache
def _kernel() -> Any:
    """Compile the loop; about ten seconds, once per process.  It runs without the interpreter's lock."""
    import numba

    compiled = numba.njit(tooth_wind)
    namespace = {"tooth_wind": compiled}
    torque = numba.njit(gust_torque_n_m)
    section = numba.njit(filter_sample)
    inputs_of = numba.njit(axis_inputs)
    correction = numba.njit(_rebound(gear_correction, namespace))

    @numba.njit
    def law(now, position, velocity, acceleration, measured, loop):  # type: ignore[no-untyped-def]
        gains, limit, shaped, shaping, notched, notch = loop
        kp, ki, feed, half, lead = gains
        error = position - measured
        rate = velocity + lead * acceleration
        filtered = ((1.0 - half) * now[1] + half * (now[2] + rate)) / (1.0 + half)
        value, band, low = kp * error + ki * now[0], 0.0, 0.0
        if shaped:
            value, band, low = section(value, now[3], now[4], shaping)
        raw = value + feed * filtered
        command, notch_band, notch_low = raw, 0.0, raw
        if notched:
            command, notch_band, notch_low = section(raw, now[5], now[6], notch)
        applied = min(max(command, -limit), limit)
        now[7], now[8] = error, applied - command
        now[1], now[2], now[3], now[4], now[5], now[6] = filtered, rate, band, low, notch_band, notch_low
        return applied

    @numba.njit
    def advance(x, z, command, wind, plant):  # type: ignore[no-untyped-def]
        matrix, _, excitation, drives, gear, travel = plant[:6]
        size, modes = len(x), excitation.shape[1]
        z[:size] = x
        for axis in range(2):
            drive = drives[axis]
            u, friction, pushed = inputs_of(x[2 + axis], command[axis], wind[axis], True, False, drive)
            z[size + axis], z[size + 2 + axis], z[size + 4 + axis] = u, friction, pushed
            z[size + 6 + axis] = correction(x[gear[axis]], x[gear[axis] + modes], drive)
        x[:] = 0.0
        for j in range(len(z)):
            value = z[j]
            for i in range(size):
                x[i] += matrix[j, i] * value
        for axis in range(2):
            if not travel[axis, 0] <= x[axis] <= travel[axis, 1]:
                rate = x[2 + axis]
                x[axis] = min(max(x[axis], travel[axis, 0]), travel[axis, 1])
                for mode in range(modes):
                    x[4 + modes + mode] += excitation[axis, mode] * rate
                x[2 + axis] = 0.0

    @numba.njit
    def late(rates, k, time, delay, tick, command):  # type: ignore[no-untyped-def]
        for axis in range(2):
            index = math.floor((time - delay[axis] + 1e-9) / tick)
            command[axis] = rates[min(index, k), axis] if index >= 0 else 0.0

    @numba.njit(nogil=True)
    def loop(  # type: ignore[no-untyped-def]
        position, velocity, acceleration, plant, wind, noise, loops, clock, rates, encoder, beam
    ):
        rows, inertia, delay, encoder_step, encoder_noise = plant[1], plant[6], plant[7], plant[8], plant[9]
        blows, gusts, decay, gust_noise, residues, speed, constants = wind
        tick, substeps, step = clock
        size = plant[0].shape[1]
        x, z, command, push = np.zeros(size), np.zeros(plant[0].shape[0]), np.zeros(2), np.zeros(2)
        memory = np.zeros((2, 9))
        measured = np.zeros(2)
        gusts = gusts.copy()
        for axis in range(2):
            x[axis] = position[0, axis]
            measured[axis] = round(position[0, axis] / encoder_step[axis]) * encoder_step[axis]
        for k in range(len(position)):
            rates[k, 0] = law(memory[0], position[k, 0], velocity[k, 0], acceleration[k, 0], measured[0], loops[0])
            rates[k, 1] = law(memory[1], position[k, 1], velocity[k, 1], acceleration[k, 1], measured[1], loops[1])
            if blows:
                gusts = gusts * decay + gust_noise[k]
                along, across = speed[0] + np.sum(gusts[0] * residues), speed[1] * np.sum(gusts[1] * residues)
                azimuth, elevation = torque(along, across, measured[0], measured[1], constants)
                push[0], push[1] = azimuth / inertia[0], elevation / inertia[1]
            for n in range(substeps):
                late(rates, k, k * tick + n * step, delay, tick, command)
                advance(x, z, command, push, plant)
            for axis in range(2):
                angle = np.sum(rows[axis] * x)
                noisy = angle + encoder_noise[axis] * noise[k, axis]
                measured[axis] = round(noisy / encoder_step[axis]) * encoder_step[axis]
                encoder[k, axis] = measured[axis]
                beam[k, axis] = np.sum(rows[2 + axis] * x)
                if loops[axis][0][1] > 0.0:
                    kp = loops[axis][0][0]
                    back = memory[axis, 8] / kp if kp > 0.0 else 0.0
                    memory[axis, 0] += tick * (memory[axis, 7] + back)

    return loop


def _rebound(function: Any, names: dict[str, Any]) -> Any:
    """Return the function with some of its module's names replaced by their compiled versions."""
    import types

    return types.FunctionType(function.__code__, {**function.__globals__, **names}, function.__name__)
