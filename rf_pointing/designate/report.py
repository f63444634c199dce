"""One report of where a target is: Earth-fixed position with its covariance, perhaps its velocity.

Every source becomes this, so that the filter (`motion.py`) fuses what reports alike.  What cannot
be a place is refused here, with its name, value and bound.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rf_pointing.core import Array, Params, parameter, require_between, require_finite, require_name
from rf_pointing.ephemeris.sites import Site, earth_fixed_m, local_axes

# From below the lowest shore to beyond the Moon.
LOWEST_M, HIGHEST_M = -500.0, 5e8
FASTEST_M_S = 2e4


@dataclass(frozen=True, kw_only=True)
class ReportNoise(Params):
    """One-sigma errors of what a source reports."""

    horizontal_m: float = parameter(30.0, "horizontal position", 0.1, 1e5)
    vertical_m: float = parameter(
        100.0, "height above the ellipsoid; barometric ones are off by this", 0.1, 1e5
    )
    velocity_m_s: float = parameter(3.0, "reported velocity, per axis", 0.01, 1e3)
    time_s: float = parameter(0.3, "time of a report; acts along the velocity", 0.0, 60.0)
    direction_rad: float = parameter(math.radians(0.1), "reported azimuth and elevation", 1e-6, 0.2)
    range_m: float = parameter(50.0, "reported range", 0.1, 1e6)


@dataclass(frozen=True, slots=True, kw_only=True)
class Report:
    """A target `name` at UTC `t_s`: position (3,) [m] and covariance (3, 3), Earth-fixed.

    `velocity_m_s` (3,) is relative to the ground, None where it is not reported.
    """

    t_s: float
    name: str
    position_m: Array
    covariance_m2: Array
    velocity_m_s: Array | None = None

    @classmethod
    def of_place(
        cls, t_s: float, name: str, place: Sequence[float], noise: ReportNoise,
        velocity_m_s: tuple[float, float, float] | None = None,
    ) -> "Report":  # fmt: skip
        """Return a report of a `place` (latitude_deg, longitude_deg, height_m).

        The velocity [m/s] is to the east, north and up.  ValueError outside their bounds.
        """
        if len(place) != 3:
            raise ValueError(f"place has {len(place)} numbers, must be latitude, longitude, height")
        latitude_deg, longitude_deg, height_m = place
        require_finite("t_s", t_s)
        require_name("name", name)
        require_between("latitude_deg", latitude_deg, -90.0, 90.0)
        require_between("longitude_deg", longitude_deg, -180.0, 360.0)
        require_between("height_m", height_m, LOWEST_M, HIGHEST_M)
        where = math.radians(latitude_deg), math.radians(longitude_deg)
        to_fixed = np.array(local_axes(*where)).T
        sigmas = np.array([noise.horizontal_m, noise.horizontal_m, noise.vertical_m])
        for speed in velocity_m_s or ():
            require_between("velocity_m_s", speed, -FASTEST_M_S, FASTEST_M_S)
        return cls(
            t_s=t_s, name=name, position_m=np.array(earth_fixed_m(*where, height_m)),
            covariance_m2=(to_fixed * sigmas**2) @ to_fixed.T,
            velocity_m_s=None if velocity_m_s is None else to_fixed @ np.array(velocity_m_s),
        )  # fmt: skip

    @classmethod
    def of_direction(
        cls, t_s: float, name: str, azimuth_rad: float, elevation_rad: float, range_m: float,
        site: Site, noise: ReportNoise,
    ) -> "Report":  # fmt: skip
        """Return a report of a true direction (without refraction) and a range from a site."""
        require_finite("t_s", t_s)
        require_name("name", name)
        require_between("azimuth_rad", azimuth_rad, -math.tau, 2.0 * math.tau)
        require_between("elevation_rad", elevation_rad, -0.5 * math.pi, 0.5 * math.pi)
        require_between("range_m", range_m, 1.0, HIGHEST_M)
        to_fixed = np.array(site.axes).T
        (sa, se), (ca, ce) = (
            np.sin([azimuth_rad, elevation_rad]),
            np.cos([azimuth_rad, elevation_rad]),
        )
        looks = np.array([[sa * ce, ca, -sa * se], [ca * ce, -sa, -ca * se], [se, 0.0, ce]])
        across_m = range_m * noise.direction_rad
        sigmas = np.array([noise.range_m, across_m, across_m])
        axes = to_fixed @ looks
        return cls(
            t_s=t_s, name=name, position_m=np.array(site.position_m) + range_m * axes[:, 0],
            covariance_m2=(axes * sigmas**2) @ axes.T,
        )  # fmt: skip

    @property
    def taken_s(self) -> float:
        """Time of arrival, by which a receiver's queue is kept short."""
        return self.t_s
