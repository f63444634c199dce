"""Errors of the reference orbit and of the clock during one pass, as extra parameters with priors.

A satellite displaced by d (along its track, across it, radially) is seen displaced by

    dAz = (cos Az, -sin Az, 0) . d / (rho cos El)
    dEl = (-sin El sin Az, -sin El cos Az, cos El) . d / rho

and a clock error tau by (Az', El') tau.  An error of the orbit's plane or shape changes through the
pass as the orbit turns (Clohessy and Wiltshire 1960).  Without these parameters an orbit error of
200 m, the same all through a pass, ends in the mount terms while the residuals look fine.  They
need priors: a clock error free in every pass is exactly the velocity lags, and free along, cross
and radial offsets leave the lags nothing to explain.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any

import numpy as np

from rf_pointing.calibration.observations import Observations
from rf_pointing.calibration.reference import ReferenceTrack
from rf_pointing.calibration.terms import numbered
from rf_pointing.core import LEVEL, Kinematics, Params, azel_from_unit_vector, parameter, wrap_rad
from rf_pointing.core.types import Array, BoolArray, IntArray, Pair

_EARTH_RADIUS_M = 6.371e6
_EARTH_RATE_RAD_S = 7.2921e-5
_GRAVITY_M3_S2 = 3.986004418e14
# Angular rate of a revolution in 105 min.
LOW_ORBIT_RATE_RAD_S = 1e-3
_OBLATENESS, _EQUATOR_M, _FLATTENING = 1.0826e-3, 6.378e6, 1.0 / 298.257
_TURN_PER_STEP_RAD, _NEAREST_MOON_M = 0.05, 3.5e8


@dataclass(frozen=True, kw_only=True)
class PassPriors(Params):
    """Standard deviations of one pass's errors before the data; zero leaves an error out.

    Errors and their drifts are those in the middle of the pass, of a neighbouring orbit: an error
    in height brings its change along the track with it.
    """

    along_track_m: float = parameter(0.0, "orbit error along the track", 0.0, 1e6)
    cross_track_m: float = parameter(0.0, "orbit error across the track", 0.0, 1e6)
    radial_m: float = parameter(0.0, "orbit error in height", 0.0, 1e6)
    along_track_drift_m_s: float = parameter(
        0.0, "further change of the along-track error", 0.0, 1e3
    )
    cross_track_drift_m_s: float = parameter(0.0, "change of the cross-track error", 0.0, 1e3)
    radial_drift_m_s: float = parameter(0.0, "change of the height error", 0.0, 1e3)
    clock_s: float = parameter(0.0, "time tag error of the station", 0.0, 10.0)

    @classmethod
    def of_orbit(cls, size_m: float) -> "PassPriors | None":
        """Return orbit errors of one size along, across and radially; None for a size of zero.

        An error of the orbit's plane or shape is at any phase in a pass: its drift is as large,
        times the orbit's rate.
        """
        if size_m == 0.0:
            return None
        drift_m_s = size_m * LOW_ORBIT_RATE_RAD_S
        return cls(
            along_track_m=size_m, cross_track_m=size_m, radial_m=size_m,
            cross_track_drift_m_s=drift_m_s, radial_drift_m_s=drift_m_s,
        )  # fmt: skip

    def check_together(self) -> None:
        """Refuse an empty set."""
        if not self.names:
            raise ValueError(
                "pass priors are all zero: give at least one a standard deviation, or leave them out"
            )

    @cached_property
    def groups(self) -> tuple[int, ...]:
        """Return which size each of `names` has: an error and its drift share one."""
        stems = [
            name.removesuffix("_m").removesuffix("_drift_m_s") if "along" not in name else name
            for name in self.names
        ]
        return tuple(stems.index(stem) for stem in stems)

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Return the errors that are estimated."""
        return tuple(item.name for item in fields(self) if getattr(self, item.name) > 0.0)

    @cached_property
    def sigma(self) -> Array:
        """Return their prior standard deviations."""
        return np.array([getattr(self, name) for name in self.names])


@dataclass(frozen=True)
class PassErrors:
    """Orbit and clock errors of one pass, estimated with the terms: value and sigma by name.

    Drifts count from `middle_t_s`.
    """

    pass_id: int
    values: Mapping[str, float]
    sigma: Mapping[str, float]
    middle_t_s: float


@dataclass(frozen=True, kw_only=True)
class SharedErrors:
    """Errors that all passes have in common that one set of elements predicts.

    `sets` names the set of each pass, `priors` are their sizes: those of an error at the ascending
    node, which is turned on as the satellite goes round.  `latitude_rad` is that of the site.
    """

    sets: Mapping[int, str]
    latitude_rad: float
    priors: PassPriors

    def times(self, factor: float) -> "SharedErrors":
        """Return the same with errors that much larger."""
        sizes = (factor * self.priors.sigma).tolist()
        return replace(
            self, priors=self.priors.replace(**dict(zip(self.priors.names, sizes, strict=True)))
        )


@dataclass(frozen=True, eq=False)
class Sharing:
    """The set of elements (g,) of each pass, and what (g, p, p) turns its error into theirs."""

    sets: IntArray
    turns: Array

    @classmethod
    def of(cls, data: Observations, shared: SharedErrors) -> "Sharing":
        """Return those of the passes of `data`, ascending; a pass without a set is its own.

        An error of the elements becomes those of a pass that move its target most nearly alike.
        """
        numbers, place = np.unique(data.pass_id, return_inverse=True)
        names = [shared.sets.get(number, f"pass {number}") for number in numbers.tolist()]
        sight, own = _sight_of(data), shared.priors.names
        elapsed_s = data.t_s - middles_of_passes(data)
        seen = {
            name: sum(m[:, np.newaxis] * a for m, a in zip(metres, sight.track_axes, strict=True))
            for name, metres in _displacements(elapsed_s, sight.orbit_rate_rad_s).items()
            if name in own
        }
        planned = _of_elements(sight, data.t_s, shared.latitude_rad)
        turns = np.tile(np.eye(len(own)), (len(numbers), 1, 1))
        acting = [own.index(name) for name in seen]
        # On the sky: along the line of sight nothing is seen.
        size = np.stack([np.cos(data.true_elevation_rad), np.ones(len(data))])
        here, there = (
            np.stack([sight.shift(each[name]) * size for name in seen], axis=2)
            for each in (seen, seen | planned)
        )
        for k in range(len(numbers)):
            own_rows, rows = (
                part[:, place == k].reshape(-1, len(acting)) for part in (here, there)
            )
            solved: Any = np.linalg.lstsq(own_rows, rows, rcond=None)[0]
            turns[k][np.ix_(acting, acting)] = solved
        return cls(np.unique(names, return_inverse=True)[1].astype(np.int64), turns)


def _of_elements(sight: "_Sight", t_s: Array, latitude_rad: float) -> dict[str, Array]:
    """Return the displacements (n, 3) of a target by a unit of each error of its elements.

    The oblate Earth turns the perigee, and a plane that is tilted wrongly ever farther off: in
    three days 300 m of it become 100 m along the track.  Errors are those at the middle time.
    """
    pole = np.array([0.0, np.cos(latitude_rad), np.sin(latitude_rad)])
    # The centre is not below the site: 0.2 deg of the axes turn 1 km along into 3 m of height.
    flat = 1.0 - _FLATTENING * (2.0 - _FLATTENING)
    normal_m = _EQUATOR_M / np.sqrt(np.cos(latitude_rad) ** 2 + flat * np.sin(latitude_rad) ** 2)
    site = normal_m * (np.array([0.0, 0.0, 1.0]) - (1.0 - flat) * np.sin(latitude_rad) * pole)
    position = sight.range_m[:, np.newaxis] * sight.axes[0] + site
    # The inertial velocity counts: that of the ground turns the plane by some degrees.
    velocity = sight.velocity_m_s + np.cross(_EARTH_RATE_RAD_S * pole, position)
    radius_m = np.linalg.norm(position, axis=1)
    radial, normal = position / radius_m[:, np.newaxis], np.cross(position, velocity)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    ahead, node = np.cross(normal, radial), np.cross(pole, normal)
    phase = np.arctan2(
        np.sum(radial * np.cross(normal, node), axis=1), np.sum(radial * node, axis=1)
    )
    rate, cosine = sight.orbit_rate_rad_s, normal @ pole
    turned = 1.5 * _OBLATENESS * (_EQUATOR_M / radius_m) ** 2 * rate * (t_s - np.mean(t_s))
    perigee = phase - turned * (2.5 * cosine**2 - 0.5)
    sine = np.sqrt(1.0 - cosine**2)

    def moved(*shares: Any) -> Array:
        parts = np.broadcast_arrays(*shares, rate)
        axes = (ahead, normal, radial)
        return np.asarray(sum(m[:, np.newaxis] * a for m, a in zip(parts, axes, strict=False)))

    tilt = (np.sin(phase) - turned * sine**2 * np.cos(phase)) / rate
    return {
        "along_track_m": moved(1.0, 0.0, 0.0),
        "cross_track_m": moved(0.0, np.cos(phase), 0.0),
        "cross_track_drift_m_s": moved(-4.0 * turned * cosine * sine / rate, tilt, 0.0),
        "radial_m": moved(-2.0 * np.sin(perigee), 0.0, np.cos(perigee)),
        "radial_drift_m_s": moved(2.0 * np.cos(perigee) / rate, 0.0, np.sin(perigee) / rate),
    }


def pass_partials(
    observations: Observations, names: tuple[str, ...], lags_s: Pair = (0.0, 0.0)
) -> tuple[Array, Array]:
    """Return the partials (n, len(names)) of azimuth and of elevation, radians per metre or second.

    `lags_s` are the velocity lags of the axes, which show the errors that much ahead: a lag of 1 s
    and an along-track error of 1 km make 0.15 s^2 of an acceleration lag.  Raises ValueError if an
    orbit error is named and the observations have no range or range rate.
    """
    data = observations
    elapsed_s = data.t_s - middles_of_passes(data)
    return motion_partials(
        elapsed_s, data.motion(), data.range_m, data.range_rate_m_s, names, lags_s, data.mount
    )


def motion_partials(
    elapsed_s: Array, motion: Sequence[Array], range_m: Array | None, range_rate_m_s: Array | None,
    names: Sequence[str], lags_s: Pair, mount: Kinematics = LEVEL,
) -> tuple[Array, Array]:  # fmt: skip
    """Return the same of a motion (angles, rates, accelerations) `elapsed_s` from mid-pass."""
    # A clock error alone needs no range: the rates are enough.
    of_orbit = any(not name.startswith("clock") for name in names)
    if of_orbit and (range_m is None or range_rate_m_s is None):
        raise ValueError("range_m=None or range_rate_m_s=None: orbit errors of a pass need both")
    both, seen = [], dict[float, dict[str, Array]]()
    for axis, lag in enumerate(lags_s):
        if lag not in seen:
            ahead = _ahead(motion, lag)
            seen[lag] = {"clock_s": np.stack(ahead[2:4])}
            if of_orbit and range_m is not None and range_rate_m_s is not None:
                sight = _Sight.of(ahead, range_m + lag * range_rate_m_s, range_rate_m_s, mount)
                seen[lag] |= _orbit_columns(elapsed_s + lag, sight)
        both.append(np.stack([seen[lag][name][axis] for name in names], axis=-1))
    return both[0], both[1]


def lags_of(coefficients: Mapping[str, float]) -> Pair:
    """Return the velocity lags of the lower and the upper axis."""
    lower, upper = numbered(coefficients, 6, 13)
    return lower, upper


def _ahead(motion: Sequence[Array], time_s: float) -> list[Array]:
    """Return azimuth, elevation and their rates a short time later."""
    angles = [motion[k] + time_s * (motion[k + 2] + 0.5 * time_s * motion[k + 4]) for k in (0, 1)]
    return angles + [motion[k + 2] + time_s * motion[k + 4] for k in (0, 1)]


def track_axes(observations: Observations) -> tuple[Array, Array, Array]:
    """Return unit vectors (n, 3) along, across and radial to the track, east-north-up."""
    return _sight_of(observations).track_axes


def shift_by(observations: Observations, metres: Array) -> tuple[Array, Array]:
    """Return the shifts (n,) of a target moved along, across and up, `metres` (n, 3)."""
    sight = _sight_of(observations)
    shift = sight.shift(
        sum(m[:, np.newaxis] * axis for m, axis in zip(metres.T, sight.track_axes, strict=True))
    )
    return shift[0], shift[1]


def _ranges(observations: Observations) -> tuple[Array, Array]:
    if observations.range_m is None or observations.range_rate_m_s is None:
        raise ValueError("range_m=None or range_rate_m_s=None: orbit errors of a pass need both")
    return observations.range_m, observations.range_rate_m_s


def _sight_of(observations: Observations) -> "_Sight":
    return _Sight.of(observations.motion(), *_ranges(observations), observations.mount)


def site_partials(observations: Observations) -> tuple[Array, Array]:
    """Return the partials (n, 3) by metres that the antenna is east, north and up of its site."""
    sight = _sight_of(observations)
    columns = np.stack(
        [sight.shift(-np.broadcast_to(axis, (len(observations), 3))) for axis in np.eye(3)], axis=-1
    )
    return columns[0], columns[1]


@dataclass(frozen=True, eq=False)
class _Sight:
    """The line of sight to the target, arrays (n,): angles and their rates, range and its rate."""

    azimuth_rad: Array
    elevation_rad: Array
    azimuth_rate_rad_s: Array
    elevation_rate_rad_s: Array
    range_m: Array
    range_rate_m_s: Array
    mount: Kinematics = LEVEL

    @classmethod
    def of(
        cls, motion: Sequence[Array], range_m: Array, range_rate_m_s: Array, mount: Kinematics
    ) -> "_Sight":
        """Return the line of sight of a motion: angles, their rates, and what else there is."""
        return cls(motion[0], motion[1], motion[2], motion[3], range_m, range_rate_m_s, mount)

    @cached_property
    def axes(self) -> tuple[Array, Array, Array]:
        """Unit vectors (n, 3) toward the target, clockwise and upward of it, east-north-up."""
        sin_az, cos_az = np.sin(self.azimuth_rad), np.cos(self.azimuth_rad)
        sin_el, cos_el = np.sin(self.elevation_rad), np.cos(self.elevation_rad)
        toward = np.stack([cos_el * sin_az, cos_el * cos_az, sin_el], axis=1)
        clockwise = np.stack([cos_az, -sin_az, np.zeros_like(sin_az)], axis=1)
        upward = np.stack([-sin_el * sin_az, -sin_el * cos_az, cos_el], axis=1)
        if self.mount.level:
            return toward, clockwise, upward
        turn = self.mount.matrix.T
        return toward @ turn, clockwise @ turn, upward @ turn

    @cached_property
    def geocentric_m(self) -> Array:
        """Position (n, 3) from the centre of a spherical Earth."""
        # An ellipsoid turns the axes, and so the prior, by 0.2 deg.
        centre = np.array([0.0, 0.0, _EARTH_RADIUS_M])
        return np.asarray(self.range_m[:, np.newaxis] * self.axes[0] + centre)

    @cached_property
    def velocity_m_s(self) -> Array:
        """Velocity (n, 3) as seen from the rotating Earth, where the station is."""
        toward, clockwise, upward = self.axes
        turning = clockwise * (self.azimuth_rate_rad_s * np.cos(self.elevation_rad))[:, np.newaxis]
        turning = turning + upward * self.elevation_rate_rad_s[:, np.newaxis]
        return np.asarray(
            self.range_rate_m_s[:, np.newaxis] * toward + self.range_m[:, np.newaxis] * turning
        )

    @cached_property
    def track_axes(self) -> tuple[Array, Array, Array]:
        """Unit vectors (n, 3) along, across and radial to the track."""
        velocity = self.velocity_m_s
        radial = self.geocentric_m / np.linalg.norm(self.geocentric_m, axis=1, keepdims=True)
        across = np.cross(radial, velocity)
        across /= np.linalg.norm(across, axis=1, keepdims=True)
        return np.cross(across, radial), across, radial

    @cached_property
    def orbit_rate_rad_s(self) -> Array:
        """The rate (n,) of a circular orbit of this height."""
        return np.asarray(np.sqrt(_GRAVITY_M3_S2 / np.linalg.norm(self.geocentric_m, axis=1) ** 3))

    @cached_property
    def in_orbit(self) -> BoolArray:
        """Whether a target (n,) is nearer than the Moon: only satellites have errors of orbits."""
        return np.asarray(self.range_m < _NEAREST_MOON_M)

    def shift(self, displacement_m: Any) -> Array:
        """Return by what azimuth and elevation (2, n) change when the target moves (n, 3)."""
        _, clockwise, upward = self.axes
        azimuth = np.sum(clockwise * displacement_m, axis=1) / (
            self.range_m * np.cos(self.elevation_rad)
        )
        elevation = np.sum(upward * displacement_m, axis=1) / self.range_m
        return np.asarray(np.stack([azimuth, elevation]))


def _orbit_columns(elapsed_s: Array, sight: _Sight) -> dict[str, Array]:
    """Return the shifts (2, n) by a unit of each error."""
    unit = [sight.in_orbit * sight.shift(axis) for axis in sight.track_axes]
    return {
        name: np.asarray(sum(share * one for share, one in zip(shares, unit, strict=True)))
        for name, shares in _displacements(elapsed_s, sight.orbit_rate_rad_s).items()
    }


def _displacements(elapsed_s: Array, rate_rad_s: Array) -> dict[str, tuple[Array, Array, Array]]:
    """Return how far a unit of each error moves the target along, across and up.

    That of a neighbouring orbit (Clohessy-Wiltshire): what is up by cos(n t) is behind by
    2 sin(n t), and what is across is so by cos(n t).
    """
    zero, rate = np.zeros_like(elapsed_s), rate_rad_s
    cosine, sine = np.cos(rate * elapsed_s), np.sin(rate * elapsed_s) / rate
    return {
        "along_track_m": (zero + 1.0, zero, zero), "along_track_drift_m_s": (elapsed_s, zero, zero),
        "cross_track_m": (zero, cosine, zero), "cross_track_drift_m_s": (zero, sine, zero),
        "radial_m": (-2.0 * rate * sine, zero, cosine),
        "radial_drift_m_s": (2.0 * cosine / rate, zero, sine),
    }  # fmt: skip


def displaced(track: ReferenceTrack, errors: PassErrors) -> ReferenceTrack:
    """Return the track with the errors of the pass, exactly: near the zenith the partials bend.

    A kilometre turns the azimuth rate of a pass at 85 deg by 1.4 %, and the lags act on it.
    """
    track, sight = _finely(track)
    shares = _displacements(track.t_s - errors.middle_t_s, sight.orbit_rate_rad_s)
    metres = np.zeros((len(track.t_s), 3))
    for name, value in errors.values.items():
        for share, axis in zip(shares.get(name, ()), sight.track_axes, strict=False):
            metres = metres + value * (sight.in_orbit * share)[:, np.newaxis] * axis
    return _moved(track, sight, metres, errors.values.get("clock_s", 0.0))


def seen_from(track: ReferenceTrack, east_north_up_m: Array) -> ReferenceTrack:
    """Return the track as an antenna that much away from its site sees it, in parallel axes."""
    track, sight = _finely(track)
    return _moved(track, sight, np.broadcast_to(-east_north_up_m, (len(track.t_s), 3)), 0.0)


def _finely(track: ReferenceTrack) -> tuple[ReferenceTrack, _Sight]:
    # So fine that the derivatives of the shift are differences of it, near the zenith too.
    step_s = _TURN_PER_STEP_RAD / max(float(np.max(np.abs(track.azimuth_rate_rad_s))), 1e-9)
    length_s = track.t_s[-1] - track.t_s[0]
    if step_s < track.t_s[1] - track.t_s[0]:
        track = track.at(np.linspace(track.t_s[0], track.t_s[-1], 2 + int(length_s / step_s)))
    return track, _Sight.of(track.motion(), track.range_m, track.range_rate_m_s, track.mount)


def _moved(track: ReferenceTrack, sight: _Sight, metres: Array, late_s: float) -> ReferenceTrack:
    motion = track.motion()
    moved = track.range_m[:, np.newaxis] * sight.axes[0] + metres
    azimuth, elevation = azel_from_unit_vector(
        moved if track.mount.level else moved @ track.mount.matrix
    )
    # Over the top, a dish reaches the same direction with another pair of axis angles.
    over = motion[1] > 0.5 * np.pi
    azimuth, elevation = (
        np.where(over, azimuth + np.pi, azimuth),
        np.where(over, np.pi - elevation, elevation),
    )
    shift = np.stack([wrap_rad(azimuth - motion[0]), elevation - motion[1]]) + late_s * np.stack(
        motion[2:4]
    )
    farther = np.linalg.norm(moved, axis=1) - track.range_m
    elapsed = track.t_s - track.t_s[0]
    rate = np.gradient(shift, elapsed, axis=1)
    bend = np.gradient(rate, elapsed, axis=1)
    return replace(
        track, range_m=track.range_m + farther,
        range_rate_m_s=track.range_rate_m_s + np.gradient(farther, elapsed),
        azimuth_rad=motion[0] + shift[0], elevation_rad=motion[1] + shift[1],
        azimuth_rate_rad_s=motion[2] + rate[0], elevation_rate_rad_s=motion[3] + rate[1],
        azimuth_acceleration_rad_s2=motion[4] + bend[0],
        elevation_acceleration_rad_s2=motion[5] + bend[1],
    )  # fmt: skip


def middles_of_passes(data: Observations) -> Array:
    """Return for each row the middle of its pass, from which the drifts of its orbit count."""
    # From the first point they would be correlated with the offsets.
    numbers, place = np.unique(data.pass_id, return_inverse=True)
    first, last = np.full(len(numbers), np.inf), np.full(len(numbers), -np.inf)
    np.minimum.at(first, place, data.t_s)
    np.maximum.at(last, place, data.t_s)
    return np.asarray(0.5 * (first + last)[place])
