"""Spiral search: an Archimedean spiral at constant speed around where the target should be.

rho = b phi with pitch 2 pi b = 0.6 beamwidths.  It ends half a pitch outside `sigmas` times the ephemeris
uncertainty, so every direction within that radius comes within half a pitch, 0.3 beamwidths, of the beam's axis.
Speed: the given rate, less where rate^2/curvature radius or the start and the end would exceed the acceleration (half
of it, in the sense of squares, for each).
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rf_pointing.core import MDEG, Params, parameter
from rf_pointing.tracking.scan import Offset

__all__ = ["SpiralParams", "SpiralSearch"]

Array = NDArray[np.float64]
POINTS_PER_TURN = 256


@dataclass(frozen=True, kw_only=True)
class SpiralParams(Params):
    """Size and speed of the search."""

    half_power_beamwidth_rad: float = parameter(65.0 * MDEG, "half-power beamwidth", low=1e-6, high=0.5)
    uncertainty_rad: float = parameter(65.0 * MDEG, "standard deviation of the target's direction", low=1e-7, high=0.2)
    sigmas: float = parameter(3.0, "radius of the search in standard deviations", low=0.5, high=10.0)
    pitch_beamwidths: float = parameter(0.6, "distance between turns in beamwidths", low=0.05, high=1.0)
    rate_rad_s: float = parameter(150.0 * MDEG, "largest speed along the spiral", low=1e-7, high=0.2)
    acceleration_rad_s2: float = parameter(350.0 * MDEG, "largest acceleration", low=1e-7, high=1.0)

    def check_together(self) -> None:
        """Refuse a search that would take more turns than a pass has time for."""
        if self.turns > 200.0:
            raise ValueError(
                f"uncertainty_rad={self.uncertainty_rad} needs {self.turns:.0f} turns of the spiral, must be <= 200"
            )

    @property
    def radius_rad(self) -> float:
        """Radius that is searched completely."""
        return self.sigmas * self.uncertainty_rad

    @property
    def turns(self) -> float:
        """Turns until every direction within the radius was passed."""
        return self.radius_rad / (self.pitch_beamwidths * self.half_power_beamwidth_rad) + 0.5


class SpiralSearch:
    """The spiral of `params` as a function of time: outwards from rest to rest, back on the same way, and again."""

    def __init__(self, params: SpiralParams) -> None:
        self.params = params
        self._b = params.pitch_beamwidths * params.half_power_beamwidth_rad / (2.0 * math.pi)
        phi = np.linspace(0.0, 2.0 * math.pi * params.turns, math.ceil(params.turns * POINTS_PER_TURN) + 2)
        self._length = self._length_at(phi)
        self._phi = phi
        self._speed = self._speed_at(phi)
        # Constant acceleration from point to point: the mean speed is then exact, also from and to rest.
        steps = 2.0 * np.diff(self._length) / (self._speed[1:] + self._speed[:-1])
        self._time = np.concatenate([[0.0], np.cumsum(steps)])

    @property
    def duration_s(self) -> float:
        """Time until the spiral has passed everything once."""
        return float(self._time[-1])

    def offset(self, t_since_start_s: float) -> Offset:
        """Return the offset from the expected direction and its rates; before the start it rests."""
        cycle = max(t_since_start_s, 0.0) % (2.0 * self.duration_s)
        outward = cycle <= self.duration_s
        x, y, x_rate, y_rate = self._outward(cycle if outward else 2.0 * self.duration_s - cycle)
        return Offset(x, y, x_rate, y_rate) if outward else Offset(x, y, -x_rate, -y_rate)

    def _outward(self, t: float) -> tuple[float, float, float, float]:
        i = min(int(np.searchsorted(self._time, t, side="right")) - 1, len(self._time) - 2)
        slope = (self._speed[i + 1] - self._speed[i]) / (self._time[i + 1] - self._time[i])
        elapsed = t - self._time[i]
        length = float(self._length[i] + self._speed[i] * elapsed + 0.5 * slope * elapsed**2)
        speed = float(self._speed[i] + slope * elapsed)
        phi = self._phi_at(length, float(self._phi[i]))
        tangent = math.hypot(1.0, phi)
        cosine, sine = math.cos(phi), math.sin(phi)
        return (
            self._b * phi * cosine,
            self._b * phi * sine,
            speed * (cosine - phi * sine) / tangent,
            speed * (sine + phi * cosine) / tangent,
        )

    def _length_at(self, phi: Array) -> Array:
        return np.asarray(0.5 * self._b * (phi * np.hypot(1.0, phi) + np.arcsinh(phi)))

    def _phi_at(self, length: float, start: float) -> float:
        phi = start
        for _ in range(8):  # Newton, quadratic from a point at most 1/256 turn away
            step = (0.5 * (phi * math.hypot(1.0, phi) + math.asinh(phi)) - length / self._b) / math.hypot(1.0, phi)
            phi -= step
            if abs(step) < 1e-13 * (1.0 + phi):
                break
        return max(phi, 0.0)

    def _speed_at(self, phi: Array) -> Array:
        share = self.params.acceleration_rad_s2 / math.sqrt(2.0)
        curvature_radius = self._b * (1.0 + phi**2) ** 1.5 / (2.0 + phi**2)
        to_end = self._length[-1] - self._length
        limits = [np.full_like(phi, self.params.rate_rad_s), np.sqrt(share * curvature_radius),
                  np.sqrt(2.0 * share * self._length), np.sqrt(2.0 * share * to_end)]  # fmt: skip
        return np.asarray(np.min(limits, axis=0))
