"""The reference track: where the orbit says the satellite was, at any time within the samples.

Between samples azimuth and elevation follow the quintic through position, rate and acceleration,
range the cubic through range and range rate.  All times are UTC seconds since 1970, all angles rad.
"""

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rf_pointing.core import as_finite_array

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, eq=False)
class ReferenceTrack:
    """True motion of the target over the station, arrays (n,) at rising `t_s`, azimuth continuous.

    Raises ValueError for unequal lengths, values that are not finite and times that do not
    increase.
    """

    t_s: Array
    azimuth_rad: Array
    elevation_rad: Array
    azimuth_rate_rad_s: Array
    elevation_rate_rad_s: Array
    azimuth_acceleration_rad_s2: Array
    elevation_acceleration_rad_s2: Array
    range_m: Array
    range_rate_m_s: Array

    def __post_init__(self) -> None:
        object.__setattr__(self, "t_s", as_finite_array("t_s", self.t_s, (None,)))
        for item in fields(self):
            object.__setattr__(self, item.name, as_finite_array(item.name, getattr(self, item.name), (len(self.t_s),)))
        if len(self.t_s) < 2 or np.any(np.diff(self.t_s) <= 0.0):
            raise ValueError("reference t_s must have at least 2 points and increase from point to point")

    def covers(self, t_s: ArrayLike) -> NDArray[np.bool_]:
        """Return which times lie within the samples; the track is never extrapolated."""
        times = np.asarray(t_s, dtype=np.float64)
        return np.asarray((times >= self.t_s[0]) & (times <= self.t_s[-1]))

    def at(self, t_s: ArrayLike) -> "ReferenceTrack":
        """Return the track at other times, increasing and within the samples."""
        times = as_finite_array("t_s", t_s, (None,))
        if not np.all(self.covers(times)):
            outside = times[~self.covers(times)][0]
            raise ValueError(f"t_s={outside} must be within the reference {self.t_s[0]}..{self.t_s[-1]}")
        # The last sample belongs to the last interval, or there would be no interval to its right.
        left = np.clip(np.searchsorted(self.t_s, times, side="right") - 1, 0, len(self.t_s) - 2)
        step, elapsed = self.t_s[left + 1] - self.t_s[left], times - self.t_s[left]
        azimuth = _quintic(self._axis("azimuth"), left, step, elapsed)
        elevation = _quintic(self._axis("elevation"), left, step, elapsed)
        distance = _cubic(self.range_m, self.range_rate_m_s, left, step, elapsed)
        # The quintic also meets the accelerations, which the lag terms x7 and x14 need.
        return ReferenceTrack(
            t_s=times,
            azimuth_rad=azimuth[0],
            elevation_rad=elevation[0],
            azimuth_rate_rad_s=azimuth[1],
            elevation_rate_rad_s=elevation[1],
            azimuth_acceleration_rad_s2=azimuth[2],
            elevation_acceleration_rad_s2=elevation[2],
            range_m=distance[0],
            range_rate_m_s=distance[1],
        )

    def motion(self) -> tuple[Array, ...]:
        """Return azimuth, elevation, rates and accelerations, as the bias model takes them."""
        return tuple(self.truth().values())[:6]

    def truth(self) -> dict[str, Array]:
        """Return the columns of `Observations` that hold the true motion, by name."""
        return {
            "true_azimuth_rad": self.azimuth_rad,
            "true_elevation_rad": self.elevation_rad,
            "azimuth_rate_rad_s": self.azimuth_rate_rad_s,
            "elevation_rate_rad_s": self.elevation_rate_rad_s,
            "azimuth_acceleration_rad_s2": self.azimuth_acceleration_rad_s2,
            "elevation_acceleration_rad_s2": self.elevation_acceleration_rad_s2,
            "range_m": self.range_m,
            "range_rate_m_s": self.range_rate_m_s,
        }

    def _axis(self, name: str) -> tuple[Array, Array, Array]:
        return (
            getattr(self, f"{name}_rad"),
            getattr(self, f"{name}_rate_rad_s"),
            getattr(self, f"{name}_acceleration_rad_s2"),
        )


def _quintic(
    samples: tuple[Array, Array, Array], left: NDArray[np.int64], step: Array, elapsed: Array
) -> tuple[Array, Array, Array]:
    # About the left sample, from what its Taylor series leaves over at the right one.
    (p0, v0, a0), (p1, v1, a1) = ([part[side] for part in samples] for side in (left, left + 1))
    gap = (p1 - p0 - v0 * step - 0.5 * a0 * step**2) / step**3
    slip = (v1 - v0 - a0 * step) / step**2
    bend = (a1 - a0) / step
    c3 = 10.0 * gap - 4.0 * slip + 0.5 * bend
    c4 = (-15.0 * gap + 7.0 * slip - bend) / step
    c5 = (6.0 * gap - 3.0 * slip + 0.5 * bend) / step**2
    t = elapsed
    position = p0 + t * (v0 + t * (0.5 * a0 + t * (c3 + t * (c4 + t * c5))))
    velocity = v0 + t * (a0 + t * (3.0 * c3 + t * (4.0 * c4 + t * 5.0 * c5)))
    return position, velocity, a0 + t * (6.0 * c3 + t * (12.0 * c4 + t * 20.0 * c5))


def _cubic(value: Array, rate: Array, left: NDArray[np.int64], step: Array, elapsed: Array) -> tuple[Array, Array]:
    p0, p1, v0, v1 = value[left], value[left + 1], rate[left], rate[left + 1]
    slope = (p1 - p0) / step
    c2 = (3.0 * slope - 2.0 * v0 - v1) / step
    c3 = (v0 + v1 - 2.0 * slope) / step**2
    t = elapsed
    return p0 + t * (v0 + t * (c2 + t * c3)), v0 + t * (2.0 * c2 + t * 3.0 * c3)
