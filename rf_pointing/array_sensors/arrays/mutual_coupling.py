"""Mutual coupling and gain errors of a circular array: measured response = diag(gain) C a(s).

By symmetry C is circulant and symmetric: C_ij depends on the distance min(|i - j|, M - |i - j|) round the circle only,
with C_ii = 1.  DOA assumes it away by calibration (after eq. (11)) and leaves it to future work; here it is a model,
`coupling_calibration` finds it, and every estimator takes the response matrix.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rf_pointing.core import require_finite

__all__ = ["ArrayResponse", "coupling_basis", "coupling_matrix"]

ComplexArray = NDArray[np.complex128]


@dataclass(frozen=True, slots=True, kw_only=True)
class ArrayResponse:
    """Gains (M,) of the elements and coupling coefficients (M // 2,) to the 1st, 2nd ... neighbour on the circle."""

    gain: ComplexArray
    coupling: ComplexArray

    def __post_init__(self) -> None:
        for name in ("gain", "coupling"):
            require_finite(name, getattr(self, name))
        if self.gain.ndim != 1 or self.coupling.shape != (len(self.gain) // 2,):
            raise ValueError(
                f"coupling has shape {self.coupling.shape}, must be ({len(self.gain) // 2},) for the gains"
            )
        dead = np.flatnonzero(np.abs(self.gain) < 1e-6)
        if len(dead):
            raise ValueError(f"gain[{dead[0]}]={self.gain[dead[0]]} must not be zero: a failed element")

    @property
    def matrix(self) -> ComplexArray:
        """The response matrix (M, M) that multiplies the ideal steering vector."""
        return np.asarray(self.gain[:, None] * coupling_matrix(len(self.gain), self.coupling), dtype=np.complex128)


def coupling_basis(elements: int) -> NDArray[np.float64]:
    """Return B (M // 2 + 1, M, M): ones where two elements are d places apart on the circle, for d = 0, 1 ..."""
    apart = np.abs(np.subtract.outer(np.arange(elements), np.arange(elements)))
    apart = np.minimum(apart, elements - apart)
    return np.asarray(apart == np.arange(elements // 2 + 1)[:, None, None], dtype=np.float64)


def coupling_matrix(elements: int, coupling: ArrayLike) -> ComplexArray:
    """Return C (M, M) from the coefficients (M // 2,) of the 1st, 2nd ... neighbour; its diagonal is one."""
    coefficients = np.concatenate([[1.0 + 0.0j], np.asarray(coupling, dtype=np.complex128)])
    if coefficients.shape != (elements // 2 + 1,):
        raise ValueError(f"coupling has {len(coefficients) - 1} coefficients, must be {elements // 2}")
    require_finite("coupling", coefficients)
    return np.asarray(np.einsum("d,dij->ij", coefficients, coupling_basis(elements)), dtype=np.complex128)
