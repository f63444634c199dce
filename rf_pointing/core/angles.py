"""Angles on the sky and on the axes: wrapping, unwrapping, cross-elevation and unit vectors.

Azimuth runs from true north through east, elevation from the horizon up.  Cross-elevation is
measured on the sky: xel = azimuth difference * cos(elevation).
"""

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rf_pointing.core.checks import require_finite

# One millidegree in radians, the unit in which pointing errors are reported.
MDEG = math.radians(1e-3)


def wrap_rad(angle_rad: ArrayLike) -> NDArray[np.float64]:
    """Return the angle folded into [-pi, pi), elementwise."""
    return np.mod(np.asarray(angle_rad, dtype=np.float64) + np.pi, 2.0 * np.pi) - np.pi


def nearest_turn_rad(angle_rad: float, reference_rad: float) -> float:
    """Return `angle_rad` plus the whole turns that bring it within half a turn of the reference."""
    require_finite("angle_rad", angle_rad)
    require_finite("reference_rad", reference_rad)
    return angle_rad + 2.0 * math.pi * round((reference_rad - angle_rad) / (2.0 * math.pi))


def unit_vector_from_azel(azimuth_rad: ArrayLike, elevation_rad: ArrayLike) -> NDArray[np.float64]:
    """Return east, north, up components, shape (..., 3); the inverse is `azel_from_unit_vector`."""
    azimuth, elevation = np.broadcast_arrays(
        np.asarray(azimuth_rad, dtype=np.float64), np.asarray(elevation_rad, dtype=np.float64)
    )
    horizontal = np.cos(elevation)
    return np.stack(
        [horizontal * np.sin(azimuth), horizontal * np.cos(azimuth), np.sin(elevation)], axis=-1
    )


def azel_from_unit_vector(enu: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return azimuth in [0, 2 pi) and elevation in [-pi/2, pi/2] of ENU vectors (..., 3)."""
    east, north, up = np.moveaxis(np.asarray(enu, dtype=np.float64), -1, 0)
    return np.mod(np.arctan2(east, north), 2.0 * np.pi), np.arctan2(up, np.hypot(east, north))


def sky_offset_rad(
    azimuth_rad: ArrayLike, elevation_rad: ArrayLike, from_azimuth_rad: ArrayLike,
    from_elevation_rad: ArrayLike,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:  # fmt: skip
    """Return cross-elevation and elevation of a direction seen from a beam, in the beam's frame.

    Exact on the sphere and regular at the zenith: the components of the direction along the beam's
    right-hand and upward axes, each turned into an angle.  Positive cross-elevation: the direction
    lies clockwise of the beam.
    """
    azimuth, elevation = (
        np.asarray(azimuth_rad, dtype=np.float64),
        np.asarray(elevation_rad, dtype=np.float64),
    )
    beam_azimuth = np.asarray(from_azimuth_rad, dtype=np.float64)
    beam_elevation = np.asarray(from_elevation_rad, dtype=np.float64)
    # By components: to stack them takes several times longer for the five directions of a period.
    level, higher = np.cos(elevation), beam_elevation + np.pi / 2.0
    east, north, high = level * np.sin(azimuth), level * np.cos(azimuth), np.sin(elevation)
    beam_sine, beam_cosine = np.sin(beam_azimuth), np.cos(beam_azimuth)
    ahead, over = np.cos(beam_elevation), np.cos(higher)
    along_right = east * beam_cosine + north * -beam_sine
    along_up = east * (over * beam_sine) + north * (over * beam_cosine) + high * np.sin(higher)
    along_forward = (
        east * (ahead * beam_sine) + north * (ahead * beam_cosine) + high * np.sin(beam_elevation)
    )
    # Not the arc cosine: it has no digits left for a small separation.
    across = np.hypot(along_right, along_up)
    # On the axis itself both are zero, and so is the offset.
    scale = np.arctan2(across, along_forward) / np.maximum(across, np.finfo(np.float64).tiny)
    return along_right * scale, along_up * scale


def separation_rad(
    azimuth_rad: float, elevation_rad: float, other_azimuth_rad: float, other_elevation_rad: float
) -> float:
    """Return `angular_distance_rad` of two directions, to the last bit, in a tenth of its time."""
    angles = np.array((azimuth_rad, elevation_rad, other_azimuth_rad, other_elevation_rad))
    (sin_a, up_a, sin_b, up_b), (cos_a, level_a, cos_b, level_b) = (
        np.sin(angles).tolist(),
        np.cos(angles).tolist(),
    )
    east_a, north_a, east_b, north_b = (
        level_a * sin_a, level_a * cos_a, level_b * sin_b, level_b * cos_b,
    )  # fmt: skip
    x, y, z = (
        north_a * up_b - up_a * north_b,
        up_a * east_b - east_a * up_b,
        east_a * north_b - north_a * east_b,
    )
    sine, cosine = (
        math.sqrt(x * x + y * y + z * z),
        east_a * east_b + north_a * north_b + up_a * up_b,
    )
    return float(np.arctan2(sine, cosine))


def angular_distance_rad(
    azimuth_rad: ArrayLike, elevation_rad: ArrayLike, other_azimuth_rad: ArrayLike,
    other_elevation_rad: ArrayLike,
) -> NDArray[np.float64]:  # fmt: skip
    """Return the angle between two directions, accurate for small and for large separations."""
    a = unit_vector_from_azel(azimuth_rad, elevation_rad)
    b = unit_vector_from_azel(other_azimuth_rad, other_elevation_rad)
    # Sine and cosine together are accurate for small and for large angles alike.
    sine: NDArray[np.float64] = np.linalg.norm(np.cross(a, b), axis=-1)
    cosine: NDArray[np.float64] = np.sum(a * b, axis=-1)
    return np.arctan2(sine, cosine)
