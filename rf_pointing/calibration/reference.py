"""The reference track: where the orbit says the satellite was, at any time within the samples.

Between samples azimuth and elevation follow the quintic through position, rate and acceleration,
range the cubic through range and range rate.  All times are UTC seconds since 1970, all angles rad.
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from rf_pointing.core import LEVEL, Array, BoolArray, IntArray, Kinematics, as_finite_array
from rf_pointing.core.hermite import quintic_coefficients
from rf_pointing.core.target_motion import TargetMotion


@dataclass(frozen=True, kw_only=True, eq=False)
class ReferenceTrack(TargetMotion):
    """True motion of the target over the station, arrays (n,) at rising `t_s`.

    Angles of another `mount` are those of its axes (`on`).  Raises ValueError for unequal lengths,
    values that are not finite and times that do not increase.
    """

    mount: Kinematics = LEVEL

    def __post_init__(self) -> None:
        object.__setattr__(self, "t_s", as_finite_array("t_s", self.t_s, (None,)))
        for name in COLUMNS:
            column = as_finite_array(name, getattr(self, name), (len(self.t_s),))
            object.__setattr__(self, name, column)
        if len(self.t_s) < 2 or np.any(np.diff(self.t_s) <= 0.0):
            raise ValueError(
                "reference t_s must have at least 2 points and increase from point to point"
            )

    @classmethod
    def of(cls, look: Any) -> "ReferenceTrack":
        """Return the track of what has its columns, as the look angles of an ephemeris."""
        return cls(**{name: getattr(look, name) for name in COLUMNS})

    def covers(self, t_s: ArrayLike) -> BoolArray:
        """Return which times lie within the samples; the track is never extrapolated."""
        times = np.asarray(t_s, dtype=np.float64)
        return np.asarray((times >= self.t_s[0]) & (times <= self.t_s[-1]))

    def at(self, t_s: ArrayLike) -> "ReferenceTrack":
        """Return the track at other times, increasing and within the samples."""
        times = as_finite_array("t_s", t_s, (None,))
        if not np.all(self.covers(times)):
            outside = times[~self.covers(times)][0]
            raise ValueError(
                f"t_s={outside} must be within the reference {self.t_s[0]}..{self.t_s[-1]}"
            )
        # The last sample belongs to the last interval, or there would be no interval to its right.
        left = np.clip(np.searchsorted(self.t_s, times, side="right") - 1, 0, len(self.t_s) - 2)
        step, elapsed = self.t_s[left + 1] - self.t_s[left], times - self.t_s[left]
        columns: dict[str, Any] = {"t_s": times}
        # The quintic also meets the accelerations, which the lag terms x7 and x14 need.
        for axis in ("azimuth", "elevation"):
            names = (f"{axis}_rad", f"{axis}_rate_rad_s", f"{axis}_acceleration_rad_s2")
            samples = [getattr(self, name) for name in names]
            columns |= zip(names, _quintic(samples, left, step, elapsed), strict=True)
        distance = _cubic(self.range_m, self.range_rate_m_s, left, step, elapsed)
        columns |= zip(("range_m", "range_rate_m_s"), distance, strict=True)
        return replace(self, **columns)

    def on(self, mount: Kinematics) -> "ReferenceTrack":
        """Return the motion on the sky as that of the axes of a mount."""
        if mount == self.mount:
            return self
        names = [name for name in COLUMNS if "azimuth" in name or "elevation" in name]
        pairs = [
            np.column_stack([getattr(self, name) for name in names[k : k + 2]]) for k in (0, 2, 4)
        ]
        columns = np.concatenate(mount.to_axes(pairs[0], pairs[1], pairs[2]), axis=1).T
        return replace(self, mount=mount, **dict(zip(names, columns, strict=True)))

    def sky_rad(self) -> tuple[Array, Array]:
        """Return azimuth and elevation (n,)."""
        return self.mount.directions(self.azimuth_rad, self.elevation_rad)

    def over_the_top(self) -> "ReferenceTrack":
        """Return the motion in axis angles of a dish over the top, (az + 180 deg, 180 deg - el)."""
        return replace(
            self, azimuth_rad=self.azimuth_rad + np.pi, elevation_rad=np.pi - self.elevation_rad,
            elevation_rate_rad_s=-self.elevation_rate_rad_s,
            elevation_acceleration_rad_s2=-self.elevation_acceleration_rad_s2,
        )  # fmt: skip

    def motion(self) -> tuple[Array, ...]:
        """Return azimuth, elevation, rates and accelerations, as the bias model takes them."""
        return tuple(self.truth().values())[:6]

    def truth(self) -> dict[str, Array]:
        """Return the columns of `Observations` that hold the true motion, by name."""
        columns = {name: getattr(self, name) for name in COLUMNS if name != "t_s"}
        return {
            f"true_{name}" if name in ("azimuth_rad", "elevation_rad") else name: columns[name]
            for name in columns
        }


COLUMNS = tuple(item.name for item in fields(TargetMotion))
"""Names of the columns of a track."""


def _quintic(
    samples: Sequence[Array], left: IntArray, step: Array, elapsed: Array
) -> tuple[Array, Array, Array]:
    (p0, v0, a0), (p1, v1, a1) = ([part[side] for part in samples] for side in (left, left + 1))
    c3, c4, c5 = quintic_coefficients((p0, v0, a0), (p1, v1, a1), step)
    t = elapsed
    position = p0 + t * (v0 + t * (0.5 * a0 + t * (c3 + t * (c4 + t * c5))))
    velocity = v0 + t * (a0 + t * (3.0 * c3 + t * (4.0 * c4 + t * 5.0 * c5)))
    return position, velocity, a0 + t * (6.0 * c3 + t * (12.0 * c4 + t * 20.0 * c5))


def _cubic(
    value: Array, rate: Array, left: IntArray, step: Array, elapsed: Array
) -> tuple[Array, Array]:
    p0, p1, v0, v1 = value[left], value[left + 1], rate[left], rate[left + 1]
    slope = (p1 - p0) / step
    c2 = (3.0 * slope - 2.0 * v0 - v1) / step
    c3 = (v0 + v1 - 2.0 * slope) / step**2
    t = elapsed
    return p0 + t * (v0 + t * (c2 + t * c3)), v0 + t * (2.0 * c2 + t * 3.0 * c3)
