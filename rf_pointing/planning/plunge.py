"""The exact plunge: (az + 180 deg, 180 deg - el) is the same direction with the dish over the top.

Mirroring about closest approach instead is 30 deg off at loss of signal.
"""

import numpy as np
from numpy.typing import NDArray

__all__ = ["plunged", "unplunged"]

Array = NDArray[np.float64]
MIRROR = np.array([1.0, -1.0])


def plunged(position: Array, velocity: Array, acceleration: Array) -> tuple[Array, Array, Array]:
    """Return the same motion on the sky with the dish over the top, (..., 2) each; `unplunged` undoes it."""
    return position * MIRROR + np.pi, velocity * MIRROR, acceleration * MIRROR


def unplunged(position: Array, velocity: Array, acceleration: Array) -> tuple[Array, Array, Array]:
    """Undo `plunged`."""
    return (position - np.pi) * MIRROR, velocity * MIRROR, acceleration * MIRROR
