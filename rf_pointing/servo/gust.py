"""Davenport's gust spectrum as a shaping filter: white noise in, gust speed out, exact at any time step.

    S(f) = 4 kappa V^2 / f * x^2 / (1 + x^2)^(4/3),   x = 1200 m * f / V        (Davenport 1961, V at 10 m height)

approximated by G s (s + z1)(s + z2) / ((s + p1)...(s + p4)) with the poles and zeros fixed in x, so one fit serves all
speeds: within 0.3 dB for 0.3 < x < 1000, that is 2 mHz to 6.7 Hz at 8 m/s.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rf_pointing.core import require_between

__all__ = ["GustFilter", "davenport_psd"]

Array = NDArray[np.float64]

_LENGTH_M = 1200.0
_LEVEL = 39.5379847
_ZEROS = np.array([15.9230820, 202.318487])
_POLES = np.array([0.275876131, 1.82643308, 24.2825212, 313.564259])


def davenport_psd(frequency_hz: ArrayLike, mean_speed_m_s: float, drag_coefficient: float) -> Array:
    """Return the one-sided spectrum of the gust speed in (m/s)^2/Hz at `frequency_hz` > 0."""
    frequency = np.asarray(frequency_hz, dtype=np.float64)
    x = _LENGTH_M * frequency / mean_speed_m_s
    psd: Array = 4.0 * drag_coefficient * mean_speed_m_s**2 / frequency * x**2 / (1.0 + x**2) ** (4.0 / 3.0)
    return psd


@dataclass(frozen=True, slots=True)
class GustFilter:
    """Shaping filter in diagonal form: states decay at `poles_rad_s` (4,), share one white noise, sum by `residues`."""

    poles_rad_s: Array
    residues: Array

    @classmethod
    def davenport(cls, mean_speed_m_s: float, drag_coefficient: float) -> "GustFilter":
        """Return the filter of Davenport's spectrum at `mean_speed_m_s` (m/s) and surface drag coefficient."""
        require_between("mean_speed_m_s", mean_speed_m_s, 1e-3, None)
        require_between("drag_coefficient", drag_coefficient, 0.0, 0.1)
        scale = 2.0 * math.pi * mean_speed_m_s / _LENGTH_M
        gain = scale * math.sqrt(0.5 * drag_coefficient * mean_speed_m_s * _LENGTH_M * _LEVEL)
        return cls(scale * _POLES, gain * _residues())

    @property
    def variance_m2_s2(self) -> float:
        """Variance of the gust speed."""
        return float(self.residues @ self._covariance(None) @ self.residues)

    def psd(self, frequency_hz: ArrayLike) -> Array:
        """Return the one-sided spectrum of the filter's output in (m/s)^2/Hz."""
        s = 2j * np.pi * np.asarray(frequency_hz, dtype=np.float64)[..., None]
        psd: Array = 2.0 * np.abs((self.residues / (s + self.poles_rad_s)).sum(axis=-1)) ** 2
        return psd

    def stationary_factor(self) -> Array:
        """Return L (4, 4) such that L times unit normal numbers is a state in the stationary distribution."""
        return _factor(self._covariance(None))

    def step_matrices(self, dt_s: float) -> tuple[Array, Array]:
        """Return the decay (4,) and the noise factor (4, 4) of a step of `dt_s`."""
        require_between("dt_s", dt_s, 1e-6, None)
        return np.exp(-self.poles_rad_s * dt_s), _factor(self._covariance(dt_s))

    def _covariance(self, dt_s: float | None) -> Array:
        sums = np.add.outer(self.poles_rad_s, self.poles_rad_s)
        grown = np.ones_like(sums) if dt_s is None else -np.expm1(-sums * dt_s)
        return grown / sums


def _residues() -> Array:
    """Return the residues of s (s + z1)(s + z2) / prod(s + p) at its poles."""
    values = [
        -pole * np.prod(_ZEROS - pole) / np.prod(np.delete(_POLES, index) - pole) for index, pole in enumerate(_POLES)
    ]
    return np.array(values)


def _factor(covariance: Array) -> Array:
    """Return a square root of a covariance that is close to singular (a Cholesky factor may not exist)."""
    values, vectors = np.linalg.eigh(covariance)
    factor: Array = vectors * np.sqrt(np.maximum(values, 0.0))
    return factor
