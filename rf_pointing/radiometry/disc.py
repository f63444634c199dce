"""Power that a beam receives of a disc: its pattern convolved with the disc.

    R(u) = mean of g over the disc of radius r, its centre u from the axis,  u and r in beamwidths

R is not divided by its value on the axis: R(0) is the share of the flux that the beam sees of a
disc in its middle, the size correction K = 1 / R(0) of flux measurements.  In an elliptical beam
the disc is taken to be as elliptical as the beam: the error is of the order of e times the size
correction.
"""

from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rf_pointing.core.types import Array
from rf_pointing.rf.beam import BeamParams, normalised_voltage

# Steps of the table of R, in beamwidths: its cubic is good to 1e-6.
TABLE_STEP = 0.02
# A disc of a smaller radius, in beamwidths, is a point: K differs from 1 by less than 2e-6.
SMALLEST_RADIUS = 1e-3


class DiscResponse:
    """Response of a beam's pattern to discs; everything in beamwidths, so that no width enters."""

    def __init__(self, beam: BeamParams) -> None:
        self.beam = beam

    def power(self, u2: Array, radius: float, farthest: float) -> Array:
        """Return R (n,) at squared distances (n,) within `farthest`, for a disc of that radius."""
        if radius < SMALLEST_RADIUS:
            return self.pattern(np.sqrt(u2))
        return np.asarray(_spline(self.beam, float(radius), float(np.ceil(farthest)))(np.sqrt(u2)))

    def correction(self, radius: float) -> float:
        """Return K >= 1: flux of the disc over what a beam on its middle receives."""
        return 1.0 / float(self.power(np.zeros(1), radius, 1.0)[0])

    def pattern(self, u: NDArray[np.float64]) -> Array:
        """Return the power pattern g at `u` beamwidths from the axis."""
        return np.asarray(normalised_voltage(self.beam, u) ** 2)


@lru_cache(maxsize=256)
def _spline(beam: BeamParams, radius: float, farthest: float) -> Any:
    # Imported here: points need none of it.
    from scipy.interpolate import CubicSpline

    count = 8 + int(np.ceil(12.0 * radius))
    nodes, weights = np.polynomial.legendre.leggauss(count)
    # Even in area, so that the weights are those of the disc: s^2 from 0 to 1.
    ring = radius * np.sqrt(0.5 * (nodes + 1.0))
    angles = np.pi * (np.arange(2 * count) + 0.5) / (2 * count)
    grid = np.arange(0.0, farthest + 2.0 * TABLE_STEP, TABLE_STEP)
    apart = np.sqrt(
        grid[:, None, None] ** 2
        + ring[None, :, None] ** 2
        + 2.0 * grid[:, None, None] * ring[None, :, None] * np.cos(angles)
    )
    values = np.mean(normalised_voltage(beam, apart) ** 2, axis=2) @ (0.5 * weights)
    return CubicSpline(grid, values, bc_type=((1, 0.0), "not-a-knot"))
