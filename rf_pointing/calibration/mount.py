"""Exact geometry of a mount of two axes that are tilted, skewed, miscollimated, and bend.

The beam of a mount at the axis angles (A, E) points along  T Rz(A) Rn(x2) Re(E) c(x3):  T leans the
azimuth axis by x8 to the north and x9 to the east, Rn skews the elevation axis, c is the beam off
the plane normal to that axis.  The fixed rotations of `core/kinematics.py` come before the chain of
any other mount: its pole takes the place of the zenith.  There the beam bends along the vertical z,

    u_axes = (u + x11 z) / |u + x11 z|,    x11 cos El upward on the sky to first order,

which `bent` and `straight` apply and undo.  To first order in x2, x3, x8, x9 this is the printed
tan/sec form of SATCAL eqs. (1)-(2); unlike it, it stays finite at the zenith.  All angles are
Taylor series (m, ...).
"""

import math
from dataclasses import dataclass

import numpy as np

from rf_pointing.calibration import taylor
from rf_pointing.core import UP, Array, Kinematics


@dataclass(frozen=True)
class Skew:
    """The four rotations of the mount, radians: x2, x3, x8, x9."""

    non_orthogonality: float
    collimation: float
    mislevel_east: float
    mislevel_north: float

    @property
    def cone_rad(self) -> float:
        """Return the radius of the exclusion cone about the mount's zenith, out of any reach."""
        return abs(self.non_orthogonality + self.collimation)

    def tilt(self) -> Array:
        """Return the rotation (3, 3) from mount axes to east-north-up, the axis last."""
        angle = math.hypot(self.mislevel_east, self.mislevel_north)
        # No lean has no direction to lean to.
        if angle == 0.0:
            return np.eye(3)
        east, north = -self.mislevel_east / angle, self.mislevel_north / angle
        cross = np.array([[0.0, 0.0, north], [0.0, 0.0, -east], [-north, east, 0.0]])
        return np.asarray(
            np.eye(3) + math.sin(angle) * cross + (1.0 - math.cos(angle)) * (cross @ cross)
        )


def axes_from_sky(azimuth: Array, elevation: Array, skew: Skew) -> tuple[Array, Array]:
    """Return the axis angles that put the beam on a direction; `sky_from_axes` is the inverse.

    An elevation above pi/2 selects the plunged branch.  The axis azimuth is the turn nearest to
    `azimuth`.  Raises ValueError for a direction in the exclusion cone, which no axis angles reach.
    """
    east, north, up = _rotated(skew.tilt().T, _direction(azimuth, elevation))
    # SATCAL's x2 and x3 turn the other way about these axes, hence the signs.
    sin_c, sin_n = -math.sin(skew.collimation), -math.sin(skew.non_orthogonality)
    cos_n = math.cos(skew.non_orthogonality)
    right = (sin_n * up + sin_c * taylor.constant(1.0, up)) / cos_n
    forward_squared = (
        taylor.multiply(east, east) + taylor.multiply(north, north) - taylor.multiply(right, right)
    )
    # A controller holds its last command here; a guessed azimuth would be any azimuth.
    if np.any(forward_squared[0] <= 0.0):
        raise ValueError(
            f"a direction lies within {math.degrees(skew.cone_rad):.4f} deg of the mount's zenith: "
            "no axis angles reach it"
        )
    # The root of a beam over the top is negative: it looks back along the forward axis.
    branch = np.where(elevation[0] > np.pi / 2.0, -1.0, 1.0)
    forward = branch * taylor.square_root(forward_squared)
    axis_elevation = taylor.angle_of(
        (up + sin_c * sin_n * taylor.constant(1.0, up)) / cos_n, forward
    )
    axis_azimuth = taylor.angle_of(east, north) - taylor.angle_of(right, forward)
    return _near(axis_azimuth, azimuth), axis_elevation


def sky_from_axes(axis_azimuth: Array, axis_elevation: Array, skew: Skew) -> tuple[Array, Array]:
    """Return the beam's direction at the axis angles; above pi/2 plunged (az + pi, pi - el)."""
    sin_a, cos_a = taylor.sine_cosine(axis_azimuth)
    sin_e, cos_e = taylor.sine_cosine(axis_elevation)
    sin_c, cos_c = -math.sin(skew.collimation), math.cos(skew.collimation)
    sin_n, cos_n = -math.sin(skew.non_orthogonality), math.cos(skew.non_orthogonality)
    right = cos_n * sin_c * taylor.constant(1.0, sin_e) + sin_n * cos_c * sin_e
    forward = cos_c * cos_e
    up = cos_n * cos_c * sin_e - sin_n * sin_c * taylor.constant(1.0, sin_e)
    east = taylor.multiply(right, cos_a) + taylor.multiply(forward, sin_a)
    north = taylor.multiply(forward, cos_a) - taylor.multiply(right, sin_a)
    return _angles(_rotated(skew.tilt(), (east, north, up)), axis_azimuth, axis_elevation)


def bent(azimuth: Array, elevation: Array, pull: Array) -> tuple[Array, Array]:
    """Return the direction of a beam that is pulled by a vector (3,); `straight` is the inverse."""
    at = _direction(azimuth, elevation)
    pulled = [u + p * taylor.constant(1.0, u) for u, p in zip(at, pull.tolist(), strict=True)]
    return _angles((pulled[0], pulled[1], pulled[2]), azimuth, elevation)


def straight(azimuth: Array, elevation: Array, pull: Array) -> tuple[Array, Array]:
    """Return the direction whose pulled beam points here: u = s w - p with |u| = 1."""
    at = _direction(azimuth, elevation)
    along = sum(p * w for w, p in zip(at, pull.tolist(), strict=True))
    left = taylor.constant(1.0 - float(pull @ pull), at[0]) + taylor.multiply(along, along)
    scale = along + taylor.square_root(left)
    found = [
        taylor.multiply(scale, w) - p * taylor.constant(1.0, w)
        for w, p in zip(at, pull.tolist(), strict=True)
    ]
    return _angles((found[0], found[1], found[2]), azimuth, elevation)


def _angles(
    vector: tuple[Array, Array, Array], near: Array, elevation: Array
) -> tuple[Array, Array]:
    """Return the angles of a vector, on the turn and the branch of `near` and `elevation`."""
    east, north, up = vector
    branch = np.where(elevation[0] > np.pi / 2.0, -1.0, 1.0)
    horizontal = taylor.square_root(taylor.multiply(east, east) + taylor.multiply(north, north))
    azimuth = taylor.angle_of(branch * east, branch * north)
    return _near(azimuth, near), taylor.angle_of(up, branch * horizontal)


def lift(mount: Kinematics, first: Array, second: Array) -> tuple[Array, Array]:
    """Return by what the axes turn where the beam is lifted by the cosine of its elevation.

    That is what a pull of one along the vertical z does: z' e_1 / cos b and z' e_2, with the unit
    vectors e along the axes.  Azimuth turns by nothing, elevation by cos El.
    """
    (right, ahead, pole), sine, cosine = mount.matrix[UP], np.sin(first), np.cos(first)
    across = (right * cosine - ahead * sine) / np.cos(second)
    return across, pole * np.cos(second) - (right * sine + ahead * cosine) * np.sin(second)


def risen(mount: Kinematics, first: Array, second: Array, by_rad: Array) -> Array:
    """Return the change (2, n) of the axes where a beam at these angles rises a little."""
    if mount.level:
        # Upward on the sky is downward on the axis of a dish over the top.
        return np.stack([0.0 * by_rad, np.where(second > 0.5 * math.pi, -by_rad, by_rad)])
    across, along = lift(mount, first, second)
    # At the zenith nothing rises: what air and ionosphere bend ends there.
    size = np.maximum(np.hypot(across * np.cos(second), along), 1e-9)
    return np.asarray(np.stack([across, along]) * by_rad / size)


def _direction(azimuth: Array, elevation: Array) -> tuple[Array, Array, Array]:
    sin_az, cos_az = taylor.sine_cosine(azimuth)
    sin_el, cos_el = taylor.sine_cosine(elevation)
    return taylor.multiply(cos_el, sin_az), taylor.multiply(cos_el, cos_az), sin_el


def _rotated(matrix: Array, vector: tuple[Array, Array, Array]) -> tuple[Array, Array, Array]:
    x, y, z = vector
    first, second, third = (row[0] * x + row[1] * y + row[2] * z for row in matrix)
    return first, second, third


def _near(angle: Array, reference: Array) -> Array:
    # atan2 knows no turns: a joint's azimuth must continue, or the antenna would turn by 360 deg.
    moved = angle.copy()
    moved[0] += 2.0 * np.pi * np.round((reference[0] - angle[0]) / (2.0 * np.pi))
    return moved
