"""Kinematics of any mount with two crossed axes: directions on the sky and angles of the axes.

A mount is a chain of rotations.  Fixed ones turn the frame of the sky (east, north, up) into that
of the mount (right, ahead, pole); in it the lower axis turns about the pole by a, the upper one
lifts the beam towards the pole by b:

    u = B (cos b sin a, cos b cos a, sin b),   B = R_1 R_2 ...

So every mount is one of azimuth and elevation whose vertical points elsewhere, and a row of
`CHAINS` is all that is special about it.  Its keyholes are the two ends of the pole.  (a + 180 deg,
180 deg - b) is the same direction with the dish over its back.

The X-Y mount is that of Rolinski, Carlson and Coates, The X-Y antenna mount for data acquisition
from satellites, IRE Trans. SET-8 (1962) 159.
"""

import json
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike

from rf_pointing.core.angles import azel_from_unit_vector, unit_vector_from_azel
from rf_pointing.core.mount_types import AZIMUTH_ELEVATION, LOWER_AXES, MOUNTS, axes_among
from rf_pointing.core.parameters import Params, parameter
from rf_pointing.core.signals import Target
from rf_pointing.core.types import Array, Pair

Triple = tuple[Array, Array, Array]
EAST, NORTH, UP = range(3)
# Closer to a pole of the Earth an hour angle has no zero.
POLAR_RAD = math.radians(89.9)
# Difference of two verticals that are the same: 0.06 deg of latitude.
LIKE_UP = 1e-3
MOUNT_NOTE = "mount"
"""The note of a recording with a mount that is not level: its numbers as JSON."""


class Turn(NamedTuple):
    """One rotation of a chain, right-handed about an axis of the frame before it."""

    axis: int
    angle_rad: float

    def matrix(self) -> Array:
        """Return the rotation (3, 3)."""
        found, (second, third) = np.eye(3), ((self.axis + 1) % 3, (self.axis + 2) % 3)
        cosine, sine = math.cos(self.angle_rad), math.sin(self.angle_rad)
        found[[second, third], [second, third]] = cosine
        found[second, third], found[third, second] = -sine, sine
        return found


def _x_y(mount: "Kinematics") -> tuple[Turn, ...]:
    # Both axes are 0 at the zenith; X is positive to the north or east, Y to the east or north.
    quarter = 0.5 * math.pi
    if mount.lower_axis == LOWER_AXES[0]:
        return Turn(NORTH, quarter), Turn(UP, quarter)
    return Turn(EAST, quarter), Turn(NORTH, math.pi)


CHAINS: Mapping[str, Callable[["Kinematics"], tuple[Turn, ...]]] = {
    AZIMUTH_ELEVATION: lambda _: (), "x_y": _x_y,
    "ha_dec": lambda mount: (Turn(EAST, mount.latitude_rad - 0.5 * math.pi), Turn(UP, math.pi)),
    "azimuth_elevation_tilt": lambda mount: (
        Turn(UP, -mount.train_rad), Turn(EAST, -mount.tilt_rad),
    ),
}  # fmt: skip
"""The fixed rotations of every mount of `MOUNTS`."""


@dataclass(frozen=True, kw_only=True)
class Kinematics(Params):
    """One mount: its type and the angles of its chain.

    `to_axes` and `to_sky` undo each other.  A motion is position, velocity and acceleration
    (n, 2) each; rates and accelerations are exact.
    """

    type: str = parameter(AZIMUTH_ELEVATION, "how the axes lie", choices=MOUNTS)
    lower_axis: str = parameter(
        LOWER_AXES[0], "direction of the lower axis of an X-Y mount", choices=LOWER_AXES
    )
    latitude_rad: float = parameter(0.0, "latitude, for the polar axis of a mount of hour angle and declination",
                                    -0.5 * math.pi, 0.5 * math.pi)  # fmt: skip
    tilt_rad: float = parameter(0.0, "angle by which the azimuth axis leans", 0.0, 0.8)
    train_rad: float = parameter(0.0, "azimuth to which it leans", -20.0, 20.0)
    train_rate_rad_s: float = parameter(
        0.0,
        "rate at which it is turned to lean elsewhere before a pass; 0: it leans there for good",
        0.0,
        1.0,
    )

    def check_together(self) -> None:
        """Refuse a polar mount at a pole of the Earth."""
        if MOUNTS[self.type].polar and abs(self.latitude_rad) > POLAR_RAD:
            raise ValueError(
                f"latitude_deg={math.degrees(self.latitude_rad):g} must be within +-{math.degrees(POLAR_RAD):g} for "
                f"type={self.type}: nearer to a pole of the Earth the hour angle has no zero"
            )

    @property
    def axes(self) -> tuple[str, str]:
        """Names of the lower and the upper axis."""
        return MOUNTS[self.type].axes

    @property
    def words(self) -> str:
        """Kind of the mount and, where it matters, the direction of its lower axis."""
        lies = f" with its lower axis {self.lower_axis}" if MOUNTS[self.type].reversed_by else ""
        return f"of type {self.type}{lies}"

    def same_axes(self, other: "Kinematics") -> bool:
        """Return whether the axes lie alike; the azimuth to which a tilt leans does not count."""
        alike = np.allclose(self.matrix[UP], other.matrix[UP], rtol=0.0, atol=LIKE_UP)
        return self.words == other.words and bool(alike)

    @cached_property
    def matrix(self) -> Array:
        """The fixed rotations B (3, 3): its columns are the mount's right, ahead and pole."""
        found = np.eye(3)
        for turn in CHAINS[self.type](self):
            found = found @ turn.matrix()
        # Quarter turns leave 6e-17 where a zero belongs.
        found = np.where(np.abs(found) < 1e-15, 0.0, found)
        return (
            found * np.array([-1.0, 1.0, 1.0])
            if self.lower_axis == MOUNTS[self.type].reversed_by
            else found
        )

    @cached_property
    def level(self) -> bool:
        """Whether the axes are azimuth and elevation: every direction is its own axis angles."""
        return bool(np.array_equal(self.matrix, np.eye(3)))

    def to_axes(self, position: Array, velocity: Array, acceleration: Array) -> Triple:
        """Return the motion of the axes for a motion on the sky, the first angle continuous."""
        return self._turned(self.matrix, position, velocity, acceleration)

    def to_sky(self, position: Array, velocity: Array, acceleration: Array) -> Triple:
        """Return the motion on the sky of a motion of the axes; the inverse of `to_axes`."""
        return self._turned(self.matrix.T, position, velocity, acceleration)

    def axes_at(self, azimuth_rad: float, elevation_rad: float) -> Pair:
        """Return the axis angles of a direction, the first within [0, 2 pi)."""
        return self._pointed(self.matrix, azimuth_rad, elevation_rad)

    def sky_at(self, first_rad: float, second_rad: float) -> Pair:
        """Return azimuth and elevation, at most 90 deg, of axis angles; undoes `axes_at`."""
        return self._pointed(self.matrix.T, first_rad, second_rad)

    def skies(self, axes_rad: Array) -> Array:
        """Return azimuth, in [0, 2 pi), and elevation (..., 2) of axis angles (..., 2)."""
        vectors = unit_vector_from_azel(axes_rad[..., 0], axes_rad[..., 1]) @ self.matrix.T
        return np.stack(azel_from_unit_vector(vectors), axis=-1)

    def keyholes_rad(self) -> list[Pair]:
        """Return azimuth and elevation of the poles at or above the horizon: 1 or 2."""
        ends = [self.sky_at(0.0, side * 0.5 * math.pi) for side in (1.0, -1.0)]
        return [end for end in ends if end[1] > -1e-9]

    def directions(self, first_rad: Array, second_rad: Array) -> tuple[Array, Array]:
        """Return azimuth and elevation (n,) of axis angles (n,); level axes as they are."""
        if self.level:
            return first_rad, second_rad
        azimuth, elevation = self.skies(np.stack([first_rad, second_rad], axis=-1)).T
        return azimuth, elevation

    def of_directions(
        self, azimuth_rad: ArrayLike, elevation_rad: ArrayLike
    ) -> tuple[Array, Array]:
        """Return axis angles (n,) of directions (n,), the first in [0, 2 pi); level axes as is."""
        if self.level:
            return np.asarray(azimuth_rad), np.asarray(elevation_rad)
        vectors = unit_vector_from_azel(azimuth_rad, elevation_rad) @ self.matrix
        return azel_from_unit_vector(vectors)

    def leaning_from(self, azimuth_rad: float) -> tuple[Self, ...]:
        """Return the mounts to choose from for a pass that culminates at an azimuth.

        A tilt axis leans away from a pass or towards it: that moves the keyhole furthest from it,
        or lifts a low one above the axis's end.
        """
        if self.train_rate_rad_s == 0.0:
            return (self,)
        return tuple(
            self.replace(train_rad=math.remainder(azimuth_rad + turn, math.tau))
            for turn in (math.pi, 0.0)
        )

    @property
    def leaning_s(self) -> float:
        """Longest time in which a tilt axis is turned to another side: half a turn."""
        return math.pi / self.train_rate_rad_s if self.train_rate_rad_s else 0.0

    def across(self, azimuth_rad: ArrayLike, elevation_rad: ArrayLike) -> Array:
        """Return the matrices (..., 2, 2) from sky to mount of small offsets at directions.

        Offsets are across and along the upper axis: cross-elevation and elevation on the sky.
        """
        own = _tangents(*self.of_directions(azimuth_rad, elevation_rad)) @ self.matrix.T
        return np.asarray(own @ np.swapaxes(_tangents(azimuth_rad, elevation_rad), -1, -2))

    def of_axes(self, target: Target) -> Target:
        """Return a target on the sky in the angles of the axes, its uncertainty too."""
        if self.level:
            return target
        motion = self.to_axes(*np.reshape(target.motion, (3, 1, 2)))
        known = target.uncertainty
        if known is not None:
            turn = self.across(target.azimuth_rad, target.elevation_rad)
            known = replace(known, covariance_rad2=turn @ known.covariance_rad2 @ turn.T)
        (first, second), (rate, climb), (bend, curve) = (each[0].tolist() for each in motion)
        return replace(
            target, azimuth_rad=first, elevation_rad=second, azimuth_rate_rad_s=rate, elevation_rate_rad_s=climb,
            azimuth_acceleration_rad_s2=bend, elevation_acceleration_rad_s2=curve, uncertainty=known,
        )  # fmt: skip

    def _turned(
        self, matrix: Array, position: Array, velocity: Array, acceleration: Array
    ) -> Triple:
        if self.level:
            return position, velocity, acceleration
        found = motion_of_vectors(
            *(each @ matrix for each in vectors_of_motion(position, velocity, acceleration))
        )
        # An axis does not jump where its angle passes 180 deg: rates are those of the way it turns.
        found[0][:, 0] = np.unwrap(found[0][:, 0])
        return found

    def _pointed(self, matrix: Array, first: float, second: float) -> Pair:
        # Bit for bit: passes of azimuth and elevation are compared by their digest.
        if self.level and second <= 0.5 * math.pi:
            return first, second
        azimuth, elevation = azel_from_unit_vector(unit_vector_from_azel(first, second) @ matrix)
        return float(azimuth), float(elevation)


LEVEL = Kinematics()
"""Elevation over azimuth."""


def mount_of_joints(joints: Sequence[str]) -> Kinematics:
    """Return a mount of the type whose axes are among these, for the names of its axes."""
    axes = axes_among(joints)
    return next(Kinematics(type=kind) for kind, each in MOUNTS.items() if each.axes == axes)


def mount_to_notes(mount: Kinematics) -> dict[str, str]:
    """Return what a recording keeps of a mount: nothing of azimuth and elevation."""
    return {} if mount.level else {MOUNT_NOTE: json.dumps(asdict(mount))}


def mount_from_notes(notes: Mapping[str, str]) -> Kinematics | None:
    """Return the mount of a recording, level without a note; None for a damaged note."""
    try:
        return Kinematics.from_mapping(json.loads(notes.get(MOUNT_NOTE, "{}")))
    except (ValueError, TypeError, AttributeError):
        return None


def _tangents(first: ArrayLike, second: ArrayLike) -> Array:
    """Return the unit vectors (..., 2, 3) across and along the upper axis."""
    sine, cosine, rise, level = np.sin(first), np.cos(first), np.sin(second), np.cos(second)
    right = np.stack([cosine, -sine, np.zeros_like(sine)], axis=-1)
    return np.stack([right, np.stack([-rise * sine, -rise * cosine, level], axis=-1)], axis=-2)


def vectors_of_motion(
    position: Array, velocity: Array, acceleration: Array
) -> tuple[Array, Array, Array]:
    """Return the unit vectors (n, 3) of moving directions (n, 2), with both derivatives.

    The inverse is `motion_of_vectors`.
    """
    (sa, sh), (ca, ch) = np.sin(position).T, np.cos(position).T
    w, v = velocity.T
    dw, dv = acceleration.T
    east, north = sa * ch, ca * ch
    u = np.stack([east, north, sh], axis=1)
    du = np.stack([w * north - v * sa * sh, -w * east - v * ca * sh, v * ch], axis=1)
    ddu = np.stack(
        [
            dw * north - w**2 * east - 2.0 * w * v * ca * sh - dv * sa * sh - v**2 * east,
            -dw * east - w**2 * north + 2.0 * w * v * sa * sh - dv * ca * sh - v**2 * north,
            dv * ch - v**2 * sh,
        ],
        axis=1,
    )
    return u, du, ddu


def motion_of_vectors(u: Array, du: Array, ddu: Array) -> tuple[Array, Array, Array]:
    """Return the angles (n, 2) of moving vectors (n, 3), their rates and accelerations."""
    (x, y, z), (dx, dy, dz), (ddx, ddy, ddz) = u.T, du.T, ddu.T
    # At the zenith itself azimuth is undefined; a nanoradian keeps its rates finite.
    level2 = np.maximum(x**2 + y**2, 1e-18)
    level = np.sqrt(level2)
    azimuth, elevation = np.arctan2(x, y), np.arctan2(z, level)
    w = (y * dx - x * dy) / level2
    dlevel = (x * dx + y * dy) / level
    dw = (y * ddx - x * ddy) / level2 - 2.0 * w * dlevel / level
    ddlevel = (dx**2 + dy**2 + x * ddx + y * ddy - dlevel**2) / level
    r2 = level2 + z**2
    v = (level * dz - z * dlevel) / r2
    dv = (level * ddz - z * ddlevel) / r2 - 2.0 * v * (level * dlevel + z * dz) / r2
    return np.column_stack([azimuth, elevation]), np.column_stack([w, v]), np.column_stack([dw, dv])
