"""Place and orbital frame on a circular orbit, in Earth-fixed axes (DOA section 2).

Orbital frame F_o: x along the flight, y against the orbit's momentum, z to the centre of the Earth.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rf_pointing.array_sensors.attitude.rotations import cross_product

__all__ = ["OrbitPoint", "circular_frame"]

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class OrbitPoint:
    """Earth-fixed position (..., 3), axes of F_o as rows (..., 3, 3), and inertial rate of F_o in F_o (..., 3)."""

    position_m: Array
    frame: Array
    frame_rate_rad_s: Array


def circular_frame(along_rad: ArrayLike, node_rad: ArrayLike, inclination_rad: float) -> Array:
    """Return F_o (..., 3, 3) at `along_rad` past the ascending node of Earth-fixed longitude `node_rad`."""
    along = np.asarray(along_rad, dtype=np.float64)
    outward = _turned(np.cos(along), np.sin(along), node_rad, inclination_rad)
    forward = _turned(-np.sin(along), np.cos(along), node_rad, inclination_rad)
    return np.stack([forward, -cross_product(outward, forward), -outward], axis=-2)


def _turned(in_plane_x: Array, in_plane_y: Array, node_rad: ArrayLike, tilt: float) -> Array:
    x, y = in_plane_x, in_plane_y * np.cos(tilt)
    return np.stack(
        [
            x * np.cos(node_rad) - y * np.sin(node_rad),
            x * np.sin(node_rad) + y * np.cos(node_rad),
            in_plane_y * np.sin(tilt),
        ],
        axis=-1,
    )
