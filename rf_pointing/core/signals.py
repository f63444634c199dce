"""The nouns on the arrows of the graph: what the parts of a station say to each other.

Times `t_s` are UTC seconds since 1970-01-01 (leap seconds not counted, as on the ROS wire).  Sky
angles are apparent (refraction included).  Axis order is always azimuth, elevation; error order
cross-elevation, elevation. Joint angles are mechanical and continuous: they are never folded into
one turn.
"""

import math
from bisect import bisect_left
from dataclasses import dataclass, field

import numpy as np

from rf_pointing.core.checks import all_finite, as_finite_array, require_between, require_finite
from rf_pointing.core.constants import SPEED_OF_LIGHT_M_S
from rf_pointing.core.types import Array, ComplexArray

# Joint names, in the order of every two-axis array.
AXES = ("azimuth", "elevation")
BASE, AZIMUTH, ELEVATION, BEAM = FRAMES = ("base_link", "azimuth_link", "elevation_link", "beam")
"""Frames of an antenna, each the child of the one before; a namespace goes before them."""
DESIGNATED = "designated"
"""First word of the name of a target that reports lead to; the rest names it in them."""
STANDBY, STANDBY_ROLE = "_standby", "lifecycle.standby"
"""End of the name of the second of two controllers, and the parameter that makes it that."""
# Time that a `TimeBuffer` keeps.
KEPT_S = 2.0
LONGEST_GAP_S = 0.5
"""Gap of an antenna's periodic work that is not yet a stall or a jump of the clock."""
# No mount turns so far from its encoders' zero: such a reading is not an angle.
FARTHEST_RAD = 10.0 * 2.0 * math.pi
LEAST_KNOWN_RAD, LEAST_KNOWN_S = math.pi, 3600.0
"""Standard deviations of a direction and of a time along the orbit: of more nothing is known."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SkyUncertainty:
    """One-sigma error of a predicted direction, as a matrix, and along and across the motion.

    `covariance_rad2` is (2, 2) in the order cross-elevation, elevation; `along_track_s` is the
    error of the time along the orbit, 0 for a target that has none; `age_s` that of the elements.
    """

    covariance_rad2: Array
    along_track_rad: float = 0.0
    cross_track_rad: float = 0.0
    along_track_s: float = 0.0
    age_s: float = 0.0

    def __post_init__(self) -> None:
        covariance = as_finite_array("covariance_rad2", self.covariance_rad2, (2, 2))
        (right, both), (other, up) = covariance.tolist()
        for name, value in (("covariance_rad2[0]", right), ("covariance_rad2[3]", up)):
            require_between(name, value, 0.0, LEAST_KNOWN_RAD**2)
        # A direction that is uncertain along one line only is of rank one: the tolerance lets it
        # pass, and what rounding makes of it.
        slack = 1e-9 * max(right, up)
        if abs(both - other) > slack or both**2 > (1.0 + 1e-9) * right * up + slack**2:
            raise ValueError(
                f"covariance_rad2={covariance.tolist()} must be symmetric, with both its variances >= 0"
            )
        for name in ("along_track_rad", "cross_track_rad"):
            require_between(name, getattr(self, name), 0.0, LEAST_KNOWN_RAD)
        require_between("along_track_s", self.along_track_s, 0.0, LEAST_KNOWN_S)
        require_finite("age_s", self.age_s)
        object.__setattr__(self, "covariance_rad2", covariance)


@dataclass(frozen=True, slots=True, kw_only=True)
class Target:
    """Where the target is at `t_s`; azimuth continuous along a pass, elevation with refraction.

    `satellite_gain_db` is that of its antenna towards the station, against the antenna's axis.
    `offsets` of the operator are contained in the direction; `uncertainty` is None where nothing
    is known of it.
    """

    t_s: float
    name: str
    azimuth_rad: float
    elevation_rad: float
    azimuth_rate_rad_s: float
    elevation_rate_rad_s: float
    azimuth_acceleration_rad_s2: float
    elevation_acceleration_rad_s2: float
    range_m: float
    range_rate_m_s: float
    refraction_rad: float
    satellite_gain_db: float = 0.0
    offsets: str = ""
    uncertainty: SkyUncertainty | None = None

    @property
    def motion(self) -> tuple[float, ...]:
        """Azimuth and elevation, their rates and their accelerations."""
        return (
            self.azimuth_rad, self.elevation_rad, self.azimuth_rate_rad_s, self.elevation_rate_rad_s,
            self.azimuth_acceleration_rad_s2, self.elevation_acceleration_rad_s2,
        )  # fmt: skip

    @property
    def light_time_s(self) -> float:
        """One-way travel time of the signal."""
        return self.range_m / SPEED_OF_LIGHT_M_S

    @property
    def doppler_factor(self) -> float:
        """Frequency received over frequency sent (without clock rates, below 1e-9)."""
        return 1.0 - self.range_rate_m_s / SPEED_OF_LIGHT_M_S

    def __post_init__(self) -> None:
        if self.range_m >= 1.0 and all_finite(
            self.t_s, *self.motion, self.range_m, self.range_rate_m_s, self.refraction_rad, self.satellite_gain_db,
        ):  # fmt: skip
            return
        for name in self.__slots__:
            if name not in ("name", "offsets", "uncertainty"):
                require_finite(name, getattr(self, name))
        require_between("range_m", self.range_m, 1.0, math.inf)


@dataclass(frozen=True, slots=True, kw_only=True)
class HeldDirection:
    """Apparent direction in which a sensor held the target at `t_s`, and the beam's width."""

    t_s: float
    azimuth_rad: float
    elevation_rad: float
    beamwidth_rad: float


@dataclass(frozen=True, slots=True, kw_only=True)
class JointReading:
    """Encoder angles and rates of both axes at `t_s`, shape (2,); angles within `FARTHEST_RAD`."""

    t_s: float
    position_rad: Array
    velocity_rad_s: Array

    def __post_init__(self) -> None:
        require_finite("t_s", self.t_s)
        position = as_finite_array("position_rad", self.position_rad, (2,))
        velocity = as_finite_array("velocity_rad_s", self.velocity_rad_s, (2,))
        if position is not self.position_rad or velocity is not self.velocity_rad_s:
            object.__setattr__(self, "position_rad", position)
            object.__setattr__(self, "velocity_rad_s", velocity)
        azimuth, elevation = position.tolist()
        if -FARTHEST_RAD <= azimuth <= FARTHEST_RAD and -FARTHEST_RAD <= elevation <= FARTHEST_RAD:
            return
        for axis, angle_rad in zip(AXES, (azimuth, elevation), strict=True):
            require_between(f"position_rad of {axis}", angle_rad, -FARTHEST_RAD, FARTHEST_RAD)


@dataclass(frozen=True, slots=True, kw_only=True)
class JointTrajectory:
    """Time-tagged commands for both axes: `t_s` (n,) increasing, the rest (n, 2)."""

    t_s: Array
    position_rad: Array
    velocity_rad_s: Array
    acceleration_rad_s2: Array

    def __post_init__(self) -> None:
        object.__setattr__(self, "t_s", as_finite_array("t_s", self.t_s, (None,)))
        for name in ("position_rad", "velocity_rad_s", "acceleration_rad_s2"):
            object.__setattr__(
                self, name, as_finite_array(name, getattr(self, name), (len(self.t_s), 2))
            )
        if len(self.t_s) == 0:
            raise ValueError("t_s has 0 points, must have at least 1")
        if not (self.t_s[1:] > self.t_s[:-1]).all():
            raise ValueError("t_s must increase from point to point")


@dataclass(frozen=True, slots=True, kw_only=True)
class Boresight:
    """Where the radio beam of a simulated antenna really points on the sky (simulation truth)."""

    t_s: float
    azimuth_rad: float
    elevation_rad: float

    def __post_init__(self) -> None:
        if all_finite(self.t_s, self.azimuth_rad, self.elevation_rad):
            return
        for name in self.__slots__:
            require_finite(name, getattr(self, name))


@dataclass(frozen=True, slots=True, kw_only=True)
class MonopulseCluster:
    """Complex sum and difference samples of one cluster, all (n,), at the times `t_s` (n,).

    `carrier_to_noise_db_hz` is the receiver's own estimate of C/N0 on the sum channel.
    """

    t_s: Array
    sum: ComplexArray
    difference_cross_elevation: ComplexArray
    difference_elevation: ComplexArray
    carrier_to_noise_db_hz: float


@dataclass(frozen=True, slots=True, kw_only=True)
class CarrierPower:
    """Carrier power over `integration_s` ending at `t_s`, with its sigma, both in watts."""

    t_s: float
    integration_s: float
    power_w: float
    sigma_w: float
    carrier_to_noise_db_hz: float


@dataclass(frozen=True, slots=True, kw_only=True)
class PointingError:
    """Target minus beam at `t_s`, positive for a target clockwise (right) of the beam or above.

    `covariance_rad2` is (2, 2) in the order cross-elevation, elevation.  An invalid error carries
    its reason and must not move the antenna.
    """

    t_s: float
    sensor: str
    cross_elevation_rad: float
    elevation_rad: float
    covariance_rad2: Array = field(default_factory=lambda: np.zeros((2, 2)))
    carrier_to_noise_db_hz: float = 0.0
    valid: bool = True
    reason: str = ""

    def __post_init__(self) -> None:
        if not all_finite(
            self.t_s, self.cross_elevation_rad, self.elevation_rad, self.carrier_to_noise_db_hz
        ):
            for name in ("t_s", "cross_elevation_rad", "elevation_rad", "carrier_to_noise_db_hz"):
                require_finite(name, getattr(self, name))
        covariance = as_finite_array("covariance_rad2", self.covariance_rad2, (2, 2))
        (right, both), (_, up) = covariance.tolist()
        # The tolerance lets a covariance of rank one pass, as a conical scan may give.
        if min(right, up) < 0.0 or both**2 > (1.0 + 1e-9) * right * up:
            raise ValueError(
                f"covariance_rad2={covariance.tolist()} must be that of two real axes: no negative variance"
            )
        object.__setattr__(self, "covariance_rad2", covariance)

    @property
    def estimated(self) -> bool:
        """Whether an error was estimated; a report without a covariance only carries the C/N0."""
        return bool(self.covariance_rad2.any())


@dataclass
class TimeBuffer:
    """Values of one shape in order of time, linear in between; dropped when older than `kept_s`."""

    kept_s: float = KEPT_S
    times: list[float] = field(default_factory=list)
    values: list[Array] = field(default_factory=list)

    def add(self, t_s: float, value: Array) -> None:
        """Note the value at `t_s`; a step back in time forgets what was known."""
        if self.times and t_s <= self.times[-1]:
            self.clear()
        self.times.append(t_s)
        self.values.append(value)
        while self.times[-1] - self.times[0] > self.kept_s:
            del self.times[0], self.values[0]

    def clear(self) -> None:
        """Forget everything."""
        self.times.clear()
        self.values.clear()

    def at(self, t_s: float) -> Array | None:
        """Return the value, None when `t_s` is not covered."""
        after = bisect_left(self.times, t_s)
        if after >= len(self.times) or (after == 0 and self.times[0] > t_s):
            return None
        if self.times[after] == t_s:
            return self.values[after]
        before = after - 1
        share = (t_s - self.times[before]) / (self.times[after] - self.times[before])
        mixed: Array = self.values[before] + share * (self.values[after] - self.values[before])
        return mixed


class BeamPosition:
    """Offset of the beam from the commanded direction, on the sky, over the last seconds.

    Encoder angles and commanded directions arrive as streams of their own; both are compared at the
    time of a radio measurement.
    """

    def __init__(self) -> None:
        self._joints, self._centre = TimeBuffer(), TimeBuffer()

    def clear(self) -> None:
        """Forget everything, for a new pass."""
        self._joints.clear()
        self._centre.clear()

    def take_joints(self, reading: JointReading) -> None:
        """Note the encoder angles."""
        self._joints.add(reading.t_s, reading.position_rad)

    def take_centre(self, t_s: float, direction_rad: Array) -> None:
        """Note the commanded direction (2,), axis angles."""
        self._centre.add(t_s, direction_rad)

    def too_old(self, t_s: float) -> bool:
        """Whether `t_s` lies before all that is known, so that its offset will never be."""
        return any(
            bool(series.times) and t_s < series.times[0] for series in (self._joints, self._centre)
        )

    def offset(self, t_s: float) -> Array | None:
        """Return cross-elevation and elevation (2,) of the beam off the direction, or None.

        On the sky, also while the dish is over the top.
        """
        joints, centre = self._joints.at(t_s), self._centre.at(t_s)
        if joints is None or centre is None:
            return None
        away: Array = (joints - centre) * np.array([math.cos(float(joints[1])), 1.0])
        # Over the top the cosine is negative, and up on the sky is down for the axis.
        return -away if centre[1] > 0.5 * math.pi else away
