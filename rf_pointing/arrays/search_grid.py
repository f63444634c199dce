"""The published search: the largest MUSIC value on a grid of theta and phi, without refinement (DOA section 3.1).

The grid step becomes a floor of step / sqrt(12) in both angles, 0.289 deg at 1 deg, whatever the signal; and because
the floor repeats with the direction it is not white: a filter behind it cannot average it away.
`snap_to_grid` returns what the full search would, from the refined peak: the best of the four nodes around it.
"""

import numpy as np
from numpy.typing import NDArray

from rf_pointing.arrays.circular_array import CircularArrayParams, steering
from rf_pointing.arrays.music import principal_eigenvectors
from rf_pointing.arrays.peak_refinement import signal_fraction
from rf_pointing.arrays.polar_direction import direction_from_polar, polar_from_direction
from rf_pointing.geometry import require_between

__all__ = ["grid_search", "snap_to_grid"]

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]


def grid_search(
    array: CircularArrayParams, covariance: ComplexArray, step_rad: float, theta_max_rad: float = np.pi / 2.0
) -> Array:
    """Return the grid direction (n, 3) with the largest spectrum of each covariance (n, M, M)."""
    require_between("step_rad", step_rad, 1e-4, 0.5)
    require_between("theta_max_rad", theta_max_rad, step_rad, np.pi / 2.0)
    theta = np.arange(0.0, theta_max_rad + 0.5 * step_rad, step_rad)
    phi = np.arange(round(2.0 * np.pi / step_rad)) * step_rad
    nodes = direction_from_polar(*(axis.ravel() for axis in np.meshgrid(theta, phi, indexing="ij")))
    manifold = steering(array, nodes).T
    best = np.empty(len(covariance), dtype=np.intp)
    for start in range(0, len(covariance), 256):
        principal = principal_eigenvectors(covariance[start : start + 256], array.elements)
        spectrum = principal.conj() @ manifold
        best[start : start + 256] = np.argmax(spectrum.real**2 + spectrum.imag**2, axis=-1)
    return nodes[best]


def snap_to_grid(array: CircularArrayParams, principal: ComplexArray, refined: Array, step_rad: float) -> Array:
    """Return the best of the four grid nodes around each refined peak (n, 3); `principal` is v_1 (n, M)."""
    require_between("step_rad", step_rad, 1e-4, 0.5)
    theta, phi = (angle / step_rad for angle in polar_from_direction(refined))
    corners = np.stack(
        [
            direction_from_polar((np.floor(theta) + up) * step_rad, (np.floor(phi) + right) * step_rad)
            for up in (0.0, 1.0)
            for right in (0.0, 1.0)
        ]
    )
    values = np.stack([signal_fraction(array, principal[:, :, None], corner) for corner in corners])
    return np.asarray(corners[np.argmax(values, axis=0), np.arange(len(refined))])
