"""The daily motion of a satellite that stays: harmonics of the sidereal day, learned from levels.

A geostationary satellite with an inclination i moves through a figure of eight once a sidereal
day, i to the north and south and i^2/4 to the east and west.  Its offset from a base direction
(fixed, or from elements) is

    s(t) = c_0 + sum_k  a_k cos k w t + b_k sin k w t,    w = 2 pi / 86164.09 s,  k = 1 .. 4

per axis, cross-elevation and elevation.  Two levels P_A, P_B [dB] with the beam at A, then B, give

    P_A - P_B = K (|s(t_B) - B|^2 - |s(t_A) - A|^2),     K = 12.04 dB / h^2 (Gaussian beam)

which hardly depends on how strong the satellite is.  A Kalman filter holds the coefficients; their
random walk forgets within weeks, as orbits change.
"""

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from rf_pointing.core import MU, Array

SIDEREAL_DAY_S = 86164.0905
HARMONICS = 4
TERMS = 1 + 2 * HARMONICS
# Each harmonic of the apparent motion is smaller than the one before by the inclination, in rad.
FALLING = 0.12
# How far mean and swing wander in a day: longitudes drift, inclinations grow by 0.85 deg a year.
MEAN_WANDER_RAD, SWING_WANDER_RAD = math.radians(0.01), math.radians(0.004)
DAY_S = 86400.0
# A difference of levels farther off than this is refused; three of five are a manoeuvre.
GATE_SIGMAS, MANOEUVRE = 5.0, 4


@dataclass(frozen=True, slots=True)
class Sample:
    """A mean level [dB] at `t_s` with the beam at `beam_rad` (2,) from the base direction."""

    t_s: float
    beam_rad: Array
    level_db: float


@dataclass
class SiderealMotion:
    """Offset of a satellite from its base direction, with covariance.

    `constant_rad` and `daily_rad` are what is believed of the offset before anything is measured:
    of its mean and of its daily swing.
    """

    half_power_beamwidth_rad: float
    constant_rad: float
    daily_rad: float
    t_s: float = 0.0
    mean: Array = field(default_factory=lambda: np.zeros(2 * TERMS))
    covariance: Array = field(init=False)
    manoeuvres: int = 0
    _outliers: int = 0

    def __post_init__(self) -> None:
        self.covariance = np.diag(self._prior_rad**2)

    @property
    def _prior_rad(self) -> Array:
        return _terms(self.constant_rad, self.daily_rad)

    def at(self, times: Array | float) -> Array:
        """Return the offset (..., 2) at times (...)."""
        waves, mean = _waves(times), self.mean.reshape(2, TERMS)
        return np.asarray(waves @ mean.T)

    def covariance_rad2(self, t_s: float) -> Array:
        """Return the covariance (2, 2) of the offset at a time."""
        rows = _rows(t_s)
        grown = self.covariance + self._wander(t_s)
        return np.asarray(rows @ grown @ rows.T)

    def _wander(self, t_s: float) -> Array:
        days = max(t_s - self.t_s, 0.0) / DAY_S if self.t_s else 0.0
        return np.diag(_terms(MEAN_WANDER_RAD, SWING_WANDER_RAD) ** 2 * days)

    def learn(self, before: Sample, after: Sample, stretch: Array, sigma_db: float) -> bool:
        """Use two levels; `stretch` (2,) turns offsets into angles on the sky.

        Return whether they fit what is known; those that do not are left out.
        """
        slope = 10.0 * MU / math.log(10.0) / self.half_power_beamwidth_rad**2
        self.covariance = self.covariance + self._wander(after.t_s)
        self.t_s = after.t_s
        expected, row = 0.0, np.zeros(2 * TERMS)
        for sign, one in ((-1.0, before), (1.0, after)):
            apart = (self.at(one.t_s) - one.beam_rad) * stretch
            expected += sign * slope * float(apart @ apart)
            row += sign * 2.0 * slope * (apart * stretch) @ _rows(one.t_s)
        # Only the difference counts: rain and gain are the same in both levels.
        innovation = (before.level_db - after.level_db) - expected
        variance = float(row @ self.covariance @ row) + sigma_db**2
        if innovation**2 > GATE_SIGMAS**2 * variance:
            # What the other axis says between them fits, and takes back half of it.
            self._outliers += 2
            if self._outliers >= MANOEUVRE:
                # The orbit has changed: what was learned of the mean and the swing is doubtful.
                self._outliers, self.manoeuvres = 0, self.manoeuvres + 1
                self.covariance = self.covariance + np.diag((0.3 * self._prior_rad) ** 2)
            return False
        self._outliers = max(0, self._outliers - 1)
        gain = self.covariance @ row / variance
        self.mean = self.mean + gain * innovation
        left = np.eye(2 * TERMS) - np.outer(gain, row)
        self.covariance = left @ self.covariance @ left.T + np.outer(gain, gain) * sigma_db**2
        return True

    def place(self, t_s: float, offset_rad: Array, sigma_rad: float) -> None:
        """Take the target to be at an offset (2,) at a time, to `sigma_rad`."""
        # The same update for both offsets at once.
        rows = _rows(t_s)
        shared = rows @ self.covariance
        gain = np.linalg.solve(shared @ rows.T + sigma_rad**2 * np.eye(2), shared).T
        self.mean = self.mean + gain @ (offset_rad - self.at(t_s))
        self.covariance = self.covariance - gain @ shared
        self.t_s = t_s

    def values(self) -> dict[str, Any]:
        """Return what is kept over a restart, as plain numbers."""
        return {"t_s": self.t_s, "mean": self.mean.tolist(), "covariance": self.covariance.tolist()}

    def restore(self, kept: dict[str, Any]) -> None:
        """Take what was kept; ValueError for numbers that cannot be a covariance."""
        mean, covariance = (
            np.array(kept.get(name), dtype=np.float64) for name in ("mean", "covariance")
        )
        if mean.shape != (2 * TERMS,) or covariance.shape != (2 * TERMS, 2 * TERMS):
            raise ValueError(f"mean and covariance must have {2 * TERMS} rows")
        if not (np.isfinite(mean).all() and np.isfinite(covariance).all()):
            raise ValueError("mean and covariance must be finite")
        if np.linalg.eigvalsh(0.5 * (covariance + covariance.T))[0] < -1e-12 * self.constant_rad**2:
            raise ValueError("covariance must have no negative variance")
        self.mean, self.covariance, self.t_s = mean, covariance, float(kept.get("t_s", 0.0))


def _terms(mean_rad: float, swing_rad: float) -> Array:
    """Return sizes (2 TERMS,) of the coefficients for those of the mean and of the daily swing."""
    swings = [swing_rad * FALLING**k for k in range(HARMONICS) for _ in range(2)]
    return np.array([mean_rad, *swings] * 2, dtype=np.float64)


def _waves(times: Array | float) -> Array:
    """Return the terms (..., TERMS) of one axis at times (...)."""
    turned, shape = np.asarray(times) * (math.tau / SIDEREAL_DAY_S), np.shape(times)
    phase = np.multiply.outer(turned, np.arange(1, HARMONICS + 1))
    ones = np.ones((*shape, 1))
    pairs = np.stack([np.cos(phase), np.sin(phase)], axis=-1).reshape(*shape, 2 * HARMONICS)
    return np.concatenate([ones, pairs], axis=-1)


def _rows(t_s: float) -> Array:
    """Return the partials (2, 2 TERMS) of both offsets by the coefficients."""
    return np.asarray(np.kron(np.eye(2), _waves(t_s)[None, :]), dtype=np.float64)
