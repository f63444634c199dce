"""Disturbances of a carrier: dropouts, spin of the spacecraft, and an interference line near it."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from rf_pointing.core import Array, ComplexArray, Pair, Params, parameter


@dataclass(frozen=True, kw_only=True)
class DropoutParams(Params):
    """Random interruptions of the carrier."""

    count: int = parameter(10, "dropouts in the interval", 0, 10000)
    shortest_s: float = parameter(0.5, "shortest dropout", 1e-3, 3600.0)
    longest_s: float = parameter(20.0, "longest dropout", 1e-3, 3600.0)
    gap_s: float = parameter(5.0, "least time with a carrier between two", 0.0, 3600.0)

    ordered = ("shortest_s <= longest_s",)


class Dropouts:
    """Dropouts between two times, drawn once from `rng`; they never overlap."""

    def __init__(
        self, params: DropoutParams, start_s: float, stop_s: float, rng: "np.random.Generator"
    ) -> None:
        lengths = rng.uniform(params.shortest_s, params.longest_s, params.count)
        free = stop_s - start_s - float(np.sum(lengths)) - params.gap_s * (params.count + 1)
        if free < 0.0:
            raise ValueError(
                f"count={params.count} dropouts need {-free:.1f} s more than stop_s - start_s"
            )
        # Sorted random cuts of the free time are the gaps: every arrangement is equally likely.
        cuts = np.sort(rng.uniform(0.0, free, params.count))
        before = np.concatenate([[0.0], np.cumsum(lengths)])[:-1]
        self.start_s: Array = (
            start_s + cuts + before + params.gap_s * np.arange(1, params.count + 1)
        )
        self.stop_s: Array = self.start_s + lengths

    def level_db_hz(self, t_s: ArrayLike, carrier_to_noise_db_hz: ArrayLike) -> Array:
        """Return the C/N0 with the dropouts taken out of it: -inf while there is no carrier."""
        times = np.asarray(t_s, dtype=np.float64)
        inside = (times[..., None] >= self.start_s) & (times[..., None] < self.stop_s)
        return np.where(
            inside.any(axis=-1), -np.inf, np.asarray(carrier_to_noise_db_hz, dtype=np.float64)
        )


@dataclass(frozen=True, kw_only=True)
class SpinParams(Params):
    """Power modulation of a spinning spacecraft: 1 + depth cos(2 pi t / period + phase)."""

    period_s: float = parameter(12.0, "spin period", 0.01, 36000.0)
    depth: float = parameter(0.1, "amplitude relative to the mean power", 0.0, 0.95)
    phase_rad: float = parameter(0.0, "phase at time zero", -math.pi, math.pi)


def spin_gain_db(params: SpinParams, t_s: ArrayLike) -> Array:
    """Return what to add to the C/N0 for the spin at these times."""
    angle = 2.0 * math.pi * np.asarray(t_s, dtype=np.float64) / params.period_s + params.phase_rad
    return np.asarray(10.0 * np.log10(1.0 + params.depth * np.cos(angle)))


@dataclass(frozen=True, kw_only=True)
class InterferenceParams(Params):
    """A line near the carrier, through a sidelobe: its ratio in the differences is its own."""

    level_db_hz: float = parameter(25.0, "power of the line over the noise density", -40.0, 120.0)
    frequency_offset_hz: float = parameter(7.0, "distance from the carrier", -1000.0, 1000.0)
    difference_ratio: Pair = parameter(
        (0.7, -0.4), "voltage in cross-elevation and elevation difference over that in the sum",
        -3.0, 3.0,
    )  # fmt: skip


def interference_volts(params: InterferenceParams, t_s: Array, sample_s: float) -> ComplexArray:
    """Return the line in sum and both differences (3, n), in sqrt(N0); `t_s` ends each sample."""
    # A sample integrates over sample_s: a line off the carrier is weakened by the sinc of that
    # window.
    weakened = np.sinc(params.frequency_offset_hz * sample_s)
    # The phase of the mean over the sample is that of its middle.
    middle = t_s - 0.5 * sample_s
    line = (
        10.0 ** (params.level_db_hz / 20.0)
        * weakened
        * np.exp(2j * math.pi * params.frequency_offset_hz * middle)
    )
    return np.asarray(np.array([1.0, *params.difference_ratio])[:, None] * line)
