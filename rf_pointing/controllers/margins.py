"""Margins of a sampled loop, read off its open-loop response L on a frequency grid.

    S = 1 / (1 + L),   peak sensitivity = max |S|

A peak M leaves at least a gain margin of M / (M - 1) and a phase margin of 2 arcsin(1 / (2 M)).
"""

import math
from dataclasses import dataclass

import numpy as np

from rf_pointing.controllers.filters import LawMatrices
from rf_pointing.core.types import Array, ComplexArray

RADIO_SAMPLE_S, RADIO_PERIOD_S = 0.02, 0.1


@dataclass(frozen=True, slots=True)
class Margins:
    """Peak of |S| and its frequency; by how much gain may rise and phase fall.

    A margin is infinite where the loop never has that phase or gain.
    """

    peak_sensitivity: float
    peak_hz: float
    gain_margin_db: float
    phase_margin_rad: float


def loop_margins(frequency_hz: Array, loop: ComplexArray) -> Margins:
    """Return the margins of a stable loop `loop` (f,), linear between the points of the grid."""
    sensitivity = 1.0 / np.abs(1.0 + loop)
    peak = int(np.argmax(sensitivity))
    size, phase = np.abs(loop), np.unwrap(np.angle(loop))
    turns = np.round((phase - math.pi) / (2.0 * math.pi))
    # Odd half turns are crossed where the rest changes its sign without a jump.
    rest = phase - math.pi - 2.0 * math.pi * turns
    crossed = np.flatnonzero((rest[:-1] * rest[1:] <= 0.0) & (turns[:-1] == turns[1:]))
    share = np.abs(rest[crossed]) / np.maximum(np.abs(np.diff(rest)[crossed]), 1e-300)
    gains = size[crossed] + share * np.diff(size)[crossed]
    rise = 1.0 / gains[gains < 1.0]
    unity = np.flatnonzero((size[:-1] - 1.0) * (size[1:] - 1.0) <= 0.0)
    part = (1.0 - size[unity]) / np.where(np.diff(size)[unity] == 0.0, 1.0, np.diff(size)[unity])
    angles = phase[unity] + part * np.diff(phase)[unity]
    away = np.abs((angles + 2.0 * math.pi) % (2.0 * math.pi) - math.pi)
    return Margins(
        float(sensitivity[peak]), float(frequency_hz[peak]),
        20.0 * math.log10(float(rise.min())) if len(rise) else math.inf,
        float(away.min()) if len(away) else math.inf,
    )  # fmt: skip


def sampled_response(
    system: tuple[Array, Array, Array, Array], frequency_hz: Array, sample_s: float
) -> ComplexArray:  # fmt: skip
    """Return the response (f, q, m) of x(k+1) = a x + b u, y = c x + d u."""
    a, b, c, d = system
    z = np.exp(2j * np.pi * frequency_hz * sample_s)[:, None, None]
    solved = np.linalg.solve(z * np.eye(len(a)) - a, b.astype(np.complex128)[None])
    return np.asarray(c @ solved + d, dtype=np.complex128)


def closed_radius(model: LawMatrices, law: LawMatrices) -> float:
    """Return the spectral radius of the loop of a law around a model, rate command to encoder."""
    (a, b, c, d), (la, lb, lc, ld) = model, law
    through = 1.0 / (1.0 + (ld @ d).item())
    rows = [
        [a - through * b @ ld @ c, through * b @ lc],
        [-lb @ c + through * lb @ d @ ld @ c, la - through * lb @ d @ lc],
    ]
    return float(np.max(np.abs(np.linalg.eigvals(np.block(rows)))))


@dataclass(frozen=True, slots=True)
class RadioLoop:
    """Radio integrator of f_m `bandwidth_hz` on the mean of `mean_of` errors, one every 0.1 s.

    Each error is the mean of the latest `cluster` samples at 50 Hz and acts `wait_s` after the last
    of them, on a straight line 0.1 s long.
    """

    bandwidth_hz: float
    mean_of: int
    cluster: int
    wait_s: float

    def response(self, frequency_hz: Array) -> ComplexArray:
        """Return the response (f,) from error to offset, without the images of the sampling."""
        s = 2j * np.pi * frequency_hz
        errors = sum(np.exp(-k * RADIO_PERIOD_S * s) for k in range(self.mean_of)) / self.mean_of
        samples = sum(np.exp(-k * RADIO_SAMPLE_S * s) for k in range(self.cluster)) / self.cluster
        line = np.exp(-0.5 * RADIO_PERIOD_S * s) * np.sinc(frequency_hz * RADIO_PERIOD_S)
        gain = 2.0 * math.pi * self.bandwidth_hz / s * np.exp(-self.wait_s * s)
        return np.asarray(gain * errors * samples * line, dtype=np.complex128)


def encircles_not(loop: ComplexArray) -> bool:
    """Return whether a loop with one integrator leaves -1 alone: 1 + L then turns by a quarter."""
    angle = np.unwrap(np.angle(1.0 + loop))
    return abs(float(angle[-1] - angle[0]) - 0.5 * math.pi) < 0.25 * math.pi
