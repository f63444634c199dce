"""What beam and sensed error do beyond what could be expected: innovations under a Kalman filter of the target's motion.

target = beam + error.  Against the prediction the target moves at a velocity that changes slowly (acceleration noise), the
wind moves the beam unseen by the encoders (random walk of strength q), receiver and vibration add white noise R.  For every
response of unit size the gains are the same, so the filter runs on beam and error apart; whatever the loop made of earlier
errors, their innovations are white.  How strong wind and vibration are nobody knows: a bank of filters tries several.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

__all__ = ["InnovationBank", "Innovations"]

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]


class Innovations(NamedTuple):
    """Of n filters (n,): beam and error, complex as cross-elevation + j elevation; variance per axis of their sum."""

    beam_rad: ComplexArray
    error_rad: ComplexArray
    variance_rad2: Array


@dataclass(frozen=True, slots=True, kw_only=True)
class InnovationBank:
    """Filters after a measurement: position and velocity (2, n) of beam and error, covariance per axis (3, n)."""

    t_s: float
    position_rad: ComplexArray
    velocity_rad_s: ComplexArray
    covariance: Array

    @classmethod
    def begin(
        cls, t_s: float, beam_rad: complex, error_rad: complex, noise_rad2: Array, velocity_rad_s: Array | float
    ) -> "InnovationBank":
        """Return filters after a first measurement with R (n,); `velocity_rad_s` is what the target's may be (1 sigma)."""
        start = np.repeat(np.array([[beam_rad], [error_rad]]), len(noise_rad2), axis=1)
        still = np.zeros_like(noise_rad2)
        covariance = np.array([noise_rad2, still, still + velocity_rad_s**2])
        return cls(t_s=t_s, position_rad=start, velocity_rad_s=np.zeros_like(start), covariance=covariance)

    def step(
        self,
        t_s: float,
        beam_rad: complex,
        error_rad: complex,
        noise_rad2: Array,
        walk: Array,
        acceleration: Array | float,
    ) -> tuple["InnovationBank", Innovations]:
        """Return the bank after a later measurement, and what was new in it.

        `noise_rad2` (n,) is R per axis, `walk` (n,) q in rad/sqrt(s), `acceleration` (n,) or one for all
        the density of the noise that changes the velocity, rad/s^1.5.
        """
        dt, power = t_s - self.t_s, acceleration**2
        position, mixed, speed = self.covariance
        position = position + dt * (2.0 * mixed + dt * speed + walk**2 + power * dt**2 / 3.0)
        mixed = mixed + dt * (speed + 0.5 * power * dt)
        variance = position + noise_rad2
        gain, rate_gain = position / variance, mixed / variance
        expected = self.position_rad + dt * self.velocity_rad_s
        new = np.array([[beam_rad], [error_rad]]) - expected
        bank = InnovationBank(
            t_s=t_s,
            position_rad=expected + gain * new,
            velocity_rad_s=self.velocity_rad_s + rate_gain * new,
            covariance=np.array(
                [(1.0 - gain) * position, (1.0 - gain) * mixed, speed + dt * power - rate_gain * mixed]
            ),
        )
        return bank, Innovations(new[0], new[1], variance)
