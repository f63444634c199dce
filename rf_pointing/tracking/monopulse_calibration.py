"""Calibration of a monopulse receiver: the complex response of both difference/sum ratios to an offset.

rho = offset + M theta: the columns of M are what 1 rad of cross-elevation and of elevation do to the two ratios.  Slope
and phase of each channel are the diagonal, cross-talk the rest, `offset` the shift of the null.
"""

import math
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from rf_pointing.core import Params, parameter

__all__ = ["MonopulseCalibration"]

WORST_CONDITION_NUMBER = 20.0


@dataclass(frozen=True, kw_only=True)
class MonopulseCalibration(Params):
    """Rows: cross-elevation and elevation channel; columns: cross-elevation and elevation, per radian."""

    response_real: tuple[float, float, float, float] = parameter(description="real part of M, row by row, per radian")
    response_imaginary: tuple[float, float, float, float] = parameter(
        description="imaginary part of M, row by row, per radian"
    )
    offset_real: tuple[float, float] = parameter((0.0, 0.0), "real part of the ratios on the beam axis")
    offset_imaginary: tuple[float, float] = parameter((0.0, 0.0), "imaginary part of the ratios on the beam axis")

    @classmethod
    def ideal(cls, half_power_beamwidth_rad: float, slope: float) -> Self:
        """Return the response of a feed without imbalance or cross-talk."""
        per_rad = slope / half_power_beamwidth_rad
        return cls(response_real=(per_rad, 0.0, 0.0, per_rad), response_imaginary=(0.0,) * 4)

    @classmethod
    def from_response(cls, response_per_rad: NDArray[np.complex128], offset: NDArray[np.complex128]) -> Self:
        """Build from M (2, 2) and offset (2,); the inverse is `response_per_rad` and `offset`."""
        flat = np.asarray(response_per_rad).ravel()
        a, b, c, d = (complex(value) for value in flat)
        e, f = (complex(value) for value in offset)
        return cls(
            response_real=(a.real, b.real, c.real, d.real),
            response_imaginary=(a.imag, b.imag, c.imag, d.imag),
            offset_real=(e.real, f.real),
            offset_imaginary=(e.imag, f.imag),
        )

    def response_per_rad(self) -> NDArray[np.complex128]:
        """Return M, shape (2, 2)."""
        return (np.array(self.response_real) + 1j * np.array(self.response_imaginary)).reshape(2, 2)

    def offset(self) -> NDArray[np.complex128]:
        """Return the ratios on the beam axis, shape (2,)."""
        return np.array(self.offset_real) + 1j * np.array(self.offset_imaginary)

    def check_together(self) -> None:
        """Refuse a response from which the two axes cannot be told apart."""
        response = self.response_per_rad()
        values = np.linalg.svd(np.vstack([response.real, response.imag]), compute_uv=False)
        condition = float(values[0] / values[1]) if values[1] > 0.0 else math.inf
        if condition > WORST_CONDITION_NUMBER:
            raise ValueError(
                f"the calibration does not separate cross-elevation from elevation: condition number {condition:.1f} "
                f"must be <= {WORST_CONDITION_NUMBER:.0f}"
            )
