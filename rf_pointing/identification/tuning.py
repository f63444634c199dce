"""Gains of a PI position loop from the identified response of an axis.

    rate(k) = k_p e(k) + k_i sum e T,    k_i = k_p^2 / 4,    e = command - encoder

The largest k_p is taken with which the sampled loop is stable and its sensitivity

    |S| = 1 / |1 + C(z) G(z)| <= M

at all frequencies, which leaves a gain margin of M / (M - 1) and a phase margin of
2 arcsin(1 / (2 M)): 2 and 29 deg for M = 2.  The lag of the axis, which the feedforward leads, is
that of the response well below the loop: G = exp(-j w lag) / (j w).
"""

from dataclasses import dataclass

import numpy as np

from rf_pointing.core.types import Array
from rf_pointing.identification.model import StateSpace

MOST_SENSITIVE = 2.0
_STEPS = 200
_FREQUENCIES = 600
_LAG_SHARE = 0.1
"""The lag is read off at this share of the frequency at which k_p crosses 1."""


@dataclass(frozen=True, slots=True)
class TunedLoop:
    """Gains of one axis (1/s, 1/s^2), its lag, and the largest sensitivity with them."""

    proportional_gain: float
    integral_gain: float
    lag_s: float
    sensitivity: float


def tuned_loop(model: StateSpace, most_sensitive: float = MOST_SENSITIVE) -> TunedLoop:
    """Return the fastest loop within the margins; ValueError for a response without an integrator.

    `model` has one input, the rate command in rad/s, and one output, the encoder in rad.
    """
    nyquist_hz = 0.5 / model.sample_s
    frequency_hz = np.geomspace(1e-3 * nyquist_hz, 0.98 * nyquist_hz, _FREQUENCIES)
    response = model.response(frequency_hz)[:, 0, 0]
    z = np.exp(2j * np.pi * frequency_hz * model.sample_s)
    best, worst = 0.0, 0.0
    # From above: of two ranges of gains that are stable the slower one has both margins.
    for gain in np.geomspace(1e-3, 1.0, _STEPS) / model.sample_s:
        law = gain + 0.25 * gain**2 * model.sample_s / (z - 1.0)
        sensitivity = float(np.max(1.0 / np.abs(1.0 + law * response)))
        if sensitivity > most_sensitive or _pole(model, float(gain)) > 1.0 + 1e-6:
            break
        best, worst = float(gain), sensitivity
    if best == 0.0:
        raise ValueError(
            f"no loop of this response is within |S| <= {most_sensitive:g}: it must follow a rate with its position"
        )
    slow_hz = _LAG_SHARE * best / (2.0 * np.pi)
    phase = float(np.angle(1j * model.response(np.array([slow_hz]))[0, 0, 0]))
    return TunedLoop(best, 0.25 * best**2, max(0.0, -phase / (2.0 * np.pi * slow_hz)), worst)


def _pole(model: StateSpace, gain: float) -> float:
    """Return the modulus of the outermost pole of the closed loop."""
    k_i = 0.25 * gain**2 * model.sample_s
    a: Array = np.block([
        [model.a - gain * model.b @ model.c, k_i * model.b],
        [-model.c, np.eye(1)],
    ]) / 1.0  # fmt: skip
    return float(np.max(np.abs(np.linalg.eigvals(a))))
