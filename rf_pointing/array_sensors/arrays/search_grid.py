"""The published search: the largest MUSIC value on a grid of theta and phi, without refinement (DOA section 3.1).

The grid step becomes a floor of step / sqrt(12) in both angles, 0.289 deg at 1 deg, whatever the signal; and because
the floor repeats with the direction it is not white: a filter behind it cannot average it away.
`nearest_node` gives what the full search would in 97 of 100 cases from the refined peak alone; in the others the peak lies
half way between two nodes.
"""

import numpy as np
from numpy.typing import NDArray

from rf_pointing.array_sensors.arrays.circular_array import CircularArrayParams, steering
from rf_pointing.array_sensors.arrays.music import principal_eigenvectors
from rf_pointing.array_sensors.arrays.polar_direction import direction_from_polar, polar_from_direction
from rf_pointing.core import require_between

__all__ = ["grid_search", "nearest_node"]

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


def nearest_node(direction: Array, step_rad: float) -> Array:
    """Return the node of the grid of theta and phi nearest to each refined peak (..., 3)."""
    require_between("step_rad", step_rad, 1e-4, 0.5)
    theta, phi = polar_from_direction(direction)
    return direction_from_polar(np.round(theta / step_rad) * step_rad, np.round(phi / step_rad) * step_rad)
