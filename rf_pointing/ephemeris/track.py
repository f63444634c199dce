"""Where to point the antenna: apparent azimuth and elevation of a target, their rates, and range.

elements -> SGP4 (TEME) -> Earth-fixed -> minus the antenna -> light time -> east-north-up ->
offsets -> refraction
"""

import math
from typing import TYPE_CHECKING, Any, Literal, Protocol

import numpy as np
from numpy.typing import ArrayLike

from rf_pointing.core import DAY_S, Target, nearest_turn_rad, require_choice, require_finite
from rf_pointing.core.constants import SPEED_OF_LIGHT_M_S
from rf_pointing.core.refraction import RadioRefraction
from rf_pointing.ephemeris.celestial import FixedPoint
from rf_pointing.ephemeris.earth_orientation import IersEarthOrientation
from rf_pointing.ephemeris.elements import Elements
from rf_pointing.ephemeris.look_angles import SENSES, LookAngles, angles_and_rates, delayed
from rf_pointing.ephemeris.satellite_antenna import SatelliteAntennaParams
from rf_pointing.ephemeris.sgp4_orbit import Sgp4Orbit
from rf_pointing.ephemeris.sites import Site
from rf_pointing.ephemeris.state_vector import StateVector, combined, norm, rotated, seen_from_rotating_axes
from rf_pointing.ephemeris.target_offsets import TargetOffsets

if TYPE_CHECKING:
    from rf_pointing.ephemeris.learned_times import LearnedTime


class TargetSource(Protocol):
    """A target that knows its motion: elements, an ephemeris file, or a body of the sky."""

    name: str
    rotation_rate_rad_s: float
    """Turning rate of the Earth-fixed axes that the motion is written in."""
    at_infinity: bool
    """Whether it is an apparent direction without parallax (stars), of no meaningful length."""

    @property
    def orientation(self) -> IersEarthOrientation | None:
        """Orientation by which motion became Earth-fixed, None if it was given in them."""

    @property
    def spans_t_s(self) -> tuple[tuple[float, float], ...]:
        """First and last UTC times of the parts of an ephemeris, infinite for others."""

    def motion_at(self, t_s: Any, ahead_s: float = 0.0) -> StateVector:
        """Return inertial derivatives in Earth-fixed axes, metres; ValueError outside the spans."""

    def warnings(self, t_s: float) -> tuple[str, ...]:
        """Return what makes the motion at `t_s` less certain."""


class TopocentricTrack:
    """A target seen from a site.

    Parameters
    ----------
    target : elements, or any `TargetSource`.
    hold_t_s : the direction is held where it is at this time, with zero rates; None lets it move.
    refraction : "standard" for the mean weather at the site's altitude, None for a vacuum.
    max_age_s : largest distance from the epoch of elements; times beyond it are refused.
    light_time : "receive" for signals arriving at `t_s`, "transmit" for signals leaving, "none".
    antenna : antenna and attitude of the satellite; None sends alike in all directions.
    learned : what passes have taught of the time along the track; it moves the target like the
        operator's offset, but is not shown with them.
    offsets : those of `TargetOffsets`, by name.
    """

    def __init__(
        self, target: Elements | TargetSource, site: Site, *,
        refraction: RadioRefraction | Literal["standard"] | None = "standard",
        max_age_s: float = 14.0 * DAY_S, hold_t_s: float | None = None,
        light_time: str = "receive", orientation: IersEarthOrientation | None = None,
        antenna: SatelliteAntennaParams | None = None, learned: "LearnedTime | None" = None,
        **offsets: float,
    ) -> None:  # fmt: skip
        self.offsets = TargetOffsets(**offsets)
        require_choice("light_time", light_time, SENSES)
        if hold_t_s is not None:
            require_finite("hold_t_s", hold_t_s)
        if isinstance(target, Elements):
            target = Sgp4Orbit(target, orientation or IersEarthOrientation(), max_age_s=max_age_s)
        elif isinstance(target, FixedPoint):
            target = target.seen_from(site)
        self.target: TargetSource = target
        self.name, self._offsets_text = target.name, self.offsets.offsets_text
        self.site = site
        self.refraction = RadioRefraction.standard(site.altitude_m) if refraction == "standard" else refraction
        self.hold_t_s, self.light_time = hold_t_s, light_time
        self.antenna, self.learned = antenna or SatelliteAntennaParams(), learned
        self._antenna = _inertial_motion_of(site, target.rotation_rate_rad_s)
        self._antenna_rows = StateVector(*(np.reshape(v, (3, 1)) for v in self._antenna.derivatives()))

    def with_offsets(
        self, *, hold_t_s: float | None = None, antenna: SatelliteAntennaParams | None = None,
        site: Site | None = None, refraction: RadioRefraction | Literal["same"] | None = "same",
        learned: "LearnedTime | Literal['same'] | None" = "same", **offsets: Any,
    ) -> "TopocentricTrack":  # fmt: skip
        """Return the same track with what is given instead; this one stays."""
        return TopocentricTrack(
            self.target, site or self.site, hold_t_s=hold_t_s, light_time=self.light_time,
            refraction=self.refraction if refraction == "same" else refraction,
            antenna=antenna or self.antenna,
            learned=self.learned if learned == "same" else learned, **offsets,
        )  # fmt: skip

    def target_at(self, t_s: float, *, near_azimuth_rad: float = math.pi) -> Target:
        """Return the apparent direction at UTC `t_s`, near an azimuth; ValueError outside spans."""
        require_finite("t_s", t_s)
        look: dict[str, Any] = {name: float(value) for name, value in self._look(float(t_s)).items()}
        look["refraction_rad"] = look["elevation_rad"] - look.pop("true_elevation_rad")
        look["azimuth_rad"] = nearest_turn_rad(look["azimuth_rad"], near_azimuth_rad)
        return Target(t_s=float(t_s), name=self.name, offsets=self._offsets_text, **look)

    def sample(self, t_s: ArrayLike) -> LookAngles:
        """Return the apparent directions at UTC times (n,), azimuth continuous from [0, 2 pi).

        Continuity needs steps in which the azimuth moves by less than half a turn.
        """
        times = np.asarray(t_s, dtype=np.float64)
        if times.ndim != 1:
            raise ValueError(f"t_s has shape {times.shape}, must be (n,)")
        require_finite("t_s", times)
        look = self._look(times)
        # Continuous along the array; the caller chooses the turn.
        azimuth = np.unwrap(look["azimuth_rad"])
        look["azimuth_rad"] = azimuth + 2.0 * np.pi * (azimuth[:1] < 0.0)
        return LookAngles(t_s=times, **look)

    @property
    def spans_t_s(self) -> tuple[tuple[float, float], ...]:
        """First and last UTC times of the parts in which the direction is known."""
        if self.hold_t_s is not None:
            return ((-math.inf, math.inf),)
        ahead_s = self.offsets.along_track_offset_s + self.offsets.time_offset_s
        ends = [(first - ahead_s, last - ahead_s) for first, last in self.target.spans_t_s]
        if self.learned is None:
            return tuple(ends)
        learned_s = self.learned.ahead_s
        return tuple((first - learned_s(max(first, 0.0)), last - learned_s(min(last, 1e10))) for first, last in ends)

    def covers(self, t_s: float) -> bool:
        """Return whether `t_s` lies in one of the spans."""
        return any(first <= t_s <= last for first, last in self.spans_t_s)

    def warnings(self, t_s: float) -> tuple[str, ...]:
        """Return what makes the direction at `t_s` less certain: expired tables, predicted UT1."""
        return self.target.warnings(t_s)

    def motion_at(self, t_s: Any) -> StateVector:
        """Return the target's motion at `t_s` as `TargetSource` does, with the offsets of time."""
        later_s, ahead_s = self.offsets.time_offset_s, self.offsets.along_track_offset_s
        if self.learned is not None:
            ahead_s = ahead_s + self.learned.ahead_s(t_s)
        return self.target.motion_at(t_s + later_s, ahead_s)

    def relative_motion_at(self, t_s: Any) -> tuple[StateVector, Any, Any]:
        """Return the true motion from the site in east-north-up axes, range c tau [m] and its rate.

        Components are floats for a float time and arrays for an array.  Offsets are included,
        refraction is not.
        """
        motion = self.motion_at(t_s)
        if self.target.at_infinity:
            seen, range_m, range_rate_m_s = self._direction_only(motion)
        else:
            antenna = self._antenna if isinstance(t_s, float) else self._antenna_rows
            pairs = zip(motion.derivatives(), antenna.derivatives(), strict=True)
            relative = StateVector(*(combined((1.0, of_target), (-1.0, of_antenna)) for of_target, of_antenna in pairs))
            inertial, range_m, range_rate_m_s = delayed(relative, antenna, SENSES[self.light_time])
            seen = seen_from_rotating_axes(inertial, self.target.rotation_rate_rad_s)
        enu = rotated(seen, self.site.axes)
        return self.offsets.moved(enu, self.site), range_m, range_rate_m_s

    def _direction_only(self, motion: StateVector) -> tuple[StateVector, Any, Any]:
        """Return the direction without parallax; aberration by the antenna: 0.09 mdeg."""
        seen = seen_from_rotating_axes(motion, self.target.rotation_rate_rad_s)
        length = norm(seen.position)
        # Annual aberration is in the body's direction already; this is the diurnal one.
        aberration = SENSES[self.light_time] / SPEED_OF_LIGHT_M_S * length
        position = combined((1.0, seen.position), (aberration, self._antenna.velocity))
        return StateVector(position, seen.velocity, seen.acceleration, seen.jerk), length, 0.0 * length

    def _look(self, t_s: Any) -> dict[str, Any]:
        """Return the fields of `LookAngles` at `t_s`, floats or arrays like it."""
        # Zero in the shape of the times, float or array.
        still = 0.0 * t_s
        at_s = t_s if self.hold_t_s is None else still + self.hold_t_s
        enu, range_m, range_rate_m_s = self.relative_motion_at(at_s)
        azimuth, true, azimuth_rate, rate, azimuth_acceleration, acceleration = angles_and_rates(enu)
        elevation = true
        if self.refraction is not None:
            elevation, rate, acceleration = self.refraction.apply_with_rates(true, rate, acceleration)
        rates = {
            "azimuth_rate_rad_s": azimuth_rate, "elevation_rate_rad_s": rate,
            "azimuth_acceleration_rad_s2": azimuth_acceleration,
            "elevation_acceleration_rad_s2": acceleration, "range_rate_m_s": range_rate_m_s,
        }  # fmt: skip
        if self.hold_t_s is not None:
            rates = dict.fromkeys(rates, still)
        right, up = self.offsets.azimuth_offset_rad, self.offsets.elevation_offset_rad
        place = {
            "azimuth_rad": azimuth + right, "elevation_rad": elevation + up, "range_m": range_m,
            "true_elevation_rad": true + up,
        }  # fmt: skip
        return place | rates | {"satellite_gain_db": still + self._satellite_gain_db(at_s)}

    def _satellite_gain_db(self, t_s: Any) -> Any:
        """Return the gain of the satellite's antenna towards the site, in dB against its axis."""
        if self.antenna.half_power_beamwidth_rad == 0.0 or self.target.at_infinity:
            return 0.0
        return self.antenna.gain_db(self.motion_at(t_s), self.site.position_m)


def _inertial_motion_of(site: Site, rate_rad_s: float) -> StateVector:
    """StateVector of the antenna with the turning Earth, in Earth-fixed axes."""
    (x, y, z), w = site.position_m, rate_rad_s
    return StateVector((x, y, z), (-w * y, w * x, 0.0), (-(w**2) * x, -(w**2) * y, 0.0), (w**3 * y, -(w**3) * x, 0.0))
