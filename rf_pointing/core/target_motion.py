"""The motion of a target over a station, as its look angles, reference tracks and fits share it."""

from dataclasses import dataclass

from rf_pointing.core.types import Array

ANGLES = (
    "azimuth_rad", "elevation_rad", "azimuth_rate_rad_s", "elevation_rate_rad_s",
    "azimuth_acceleration_rad_s2", "elevation_acceleration_rad_s2",
)  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TargetMotion:
    """Where a target is at `t_s` [s], all (n,), rad and m; azimuth is continuous."""

    t_s: Array
    azimuth_rad: Array
    elevation_rad: Array
    azimuth_rate_rad_s: Array
    elevation_rate_rad_s: Array
    azimuth_acceleration_rad_s2: Array
    elevation_acceleration_rad_s2: Array
    range_m: Array
    range_rate_m_s: Array

    @property
    def angles(self) -> tuple[Array, ...]:
        """The columns of `ANGLES`."""
        return tuple(getattr(self, name) for name in ANGLES)
