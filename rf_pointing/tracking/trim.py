"""Ephemeris error in a Kalman filter: along-track time, cross-track distance, and a bias.

Direction error of the ephemeris = tau (x', y') + (c / range) n + (b_x, b_y): tau s ahead along the
track, whose rate on the sky is (x', y'); c m to the left of it, n the unit vector to the left; b
the bias of the mount.  Each state is a random walk.  A measurement is target minus predicted
direction, with the covariance of the sensor.
"""

import math
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from rf_pointing.core import MDEG, Array, Params, SkyUncertainty, as_finite_array, parameter
from rf_pointing.core.constants import EARTH_RADIUS_M
from rf_pointing.core.kinematics import LEVEL, Kinematics

# A prior that is no more than so many times too small is kept; elements of two days have that. With
# 1.5 the 34-m antenna searched so widely on elements of a day that it held 75 of 113 s.
USUAL = 3.0
# Elevation above which cross-elevation is no longer turned into ever larger azimuth.
STEEPEST_RAD = math.radians(88.0)
EARTH_RATE_RAD_S = 2.0 * math.pi / 86164.1
# Half of the difference from which the rate along a path is taken.
RATE_STEP_S = 0.05
# Below this speed a geostationary target has no track, so no direction across it.
SLOWEST_RAD_S = 1e-9


class SkyMotion(NamedTuple):
    """Predicted motion on the sky: rates in cross-elevation and elevation, and range (...)."""

    cross_elevation_rate_rad_s: ArrayLike
    elevation_rate_rad_s: ArrayLike
    range_m: ArrayLike


class Trim(NamedTuple):
    """Direction to add to the ephemeris (2,), cross-elevation and elevation, covariance (2, 2)."""

    offset_rad: Array
    covariance_rad2: Array


@dataclass(frozen=True, kw_only=True)
class TrimParams(Params):
    """Ephemeris error assumed before a measurement, and how fast it changes."""

    along_track_s: float = parameter(0.15, "standard deviation of the time along the track", 0.0, 60.0)
    cross_track_m: float = parameter(300.0, "standard deviation across the track", 0.0, 1e6)
    bias_rad: float = parameter(5.0 * MDEG, "standard deviation of the mount's bias per axis", 0.0, 0.1)
    along_track_walk_s: float = parameter(1e-3, "change of the time in 1 s, rms", 0.0, 10.0)
    cross_track_walk_m: float = parameter(1.0, "change across the track in 1 s, rms", 0.0, 1e5)
    bias_walk_rad: float = parameter(0.02 * MDEG, "change of the bias in 1 s, rms", 0.0, 0.01)
    jitter_rad: float = parameter(0.5 * MDEG, "fast motion of the beam that is not the ephemeris", 0.0, 0.1)
    correlation_s: float = parameter(1.0, "time over which that motion is the same", 0.0, 60.0)
    gate_sigmas: float = parameter(6.0, "innovation beyond which a measurement is refused", 2.0, 100.0)
    gate_patience: int = parameter(
        3, "rejections in a row after which the filter is doubted, not the measurements", 1, 1000
    )


def prior_for(params: TrimParams, known: SkyUncertainty, sky: SkyMotion) -> TrimParams:
    """Return the prior for a target that is `known` so well where it moves like `sky` (floats).

    Those configured, themselves, for a target that is known as well as they say.  One that stands
    on the sky has no track: its direction is as uncertain as a bias.
    """
    right, up, range_m = (float(np.ravel(np.asarray(part))[0]) for part in sky)
    speed, covariance = math.hypot(right, up), known.covariance_rad2
    if speed <= SLOWEST_RAD_S:
        sigma = math.sqrt(float(np.linalg.eigvalsh(covariance)[-1]))
        return params if sigma <= USUAL * params.bias_rad else params.replace(bias_rad=min(sigma, 0.1))
    ahead, left = np.array([right, up]) / speed, np.array([-up, right]) / speed
    along, across = (math.sqrt(max(float(axis @ covariance @ axis), 0.0)) for axis in (ahead, left))
    return prior_of(params, known.along_track_s or along / speed, across * range_m)


def prior_of(params: TrimParams, along_s: float, cross_m: float) -> TrimParams:
    """Return the prior for a target that is known so well; those configured if that is enough."""
    if along_s <= USUAL * params.along_track_s and cross_m <= USUAL * params.cross_track_m:
        return params
    return params.replace(
        along_track_s=min(max(along_s, params.along_track_s), 60.0),
        cross_track_m=min(max(cross_m, params.cross_track_m), 1e6),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class TrimState:
    """Time; mean (4,) and covariance of along-track s, cross-track m, bias rad (2); counts."""

    t_s: float | None
    mean: Array
    covariance: Array
    used: int = 0
    refused: int = 0
    refused_in_a_row: int = 0


class TrimFilter:
    """Kalman filter of the ephemeris error; `trim` holds for any later time and in a coast.

    A filter that is sure of something wrong would refuse the truth for ever: after `gate_patience`
    rejections in a row it knows again only what it was configured with.
    """

    def __init__(self, params: TrimParams) -> None:
        self.params = params
        spread = np.array([params.along_track_s, params.cross_track_m, params.bias_rad, params.bias_rad])
        self._prior = np.diag(spread**2)
        self.state = TrimState(t_s=None, mean=np.zeros(4), covariance=self._prior)

    def update(self, t_s: float, offset_rad: Array, covariance_rad2: Array, sky: SkyMotion) -> bool:
        """Add target minus prediction (2,) at `t_s`; return False if the chi-square test fails."""
        offset = as_finite_array("offset_rad", offset_rad, (2,))
        noise = as_finite_array("covariance_rad2", covariance_rad2, (2, 2)) + self._jitter(t_s)
        mean, covariance = self.state.mean, self._aged(t_s)
        rows = direction_rows(sky)
        innovation = offset - rows @ mean
        spread = rows @ covariance @ rows.T + noise
        if float(innovation @ np.linalg.solve(spread, innovation)) > self.params.gate_sigmas**2:
            in_a_row = self.state.refused_in_a_row + 1
            tired = in_a_row >= self.params.gate_patience
            self.state = TrimState(
                t_s=t_s, mean=np.zeros(4) if tired else mean, covariance=self._prior if tired else covariance,
                used=self.state.used, refused=self.state.refused + 1, refused_in_a_row=0 if tired else in_a_row,
            )  # fmt: skip
            return False
        gain = np.linalg.solve(spread, rows @ covariance).T
        keep = np.eye(4) - gain @ rows
        # Joseph's form stays symmetric and positive where the plain one loses it after thousands of
        # updates.
        covariance = keep @ covariance @ keep.T + gain @ noise @ gain.T
        self.state = replace(
            self.state, t_s=t_s, mean=mean + gain @ innovation, covariance=0.5 * (covariance + covariance.T),
            used=self.state.used + 1, refused_in_a_row=0,
        )  # fmt: skip
        return True

    def trim(self, t_s: float, sky: SkyMotion) -> Trim:
        """Return what to add to the ephemeris at `t_s`, also long after the last update."""
        rows = direction_rows(sky)
        return Trim(rows @ self.state.mean, rows @ self._aged(t_s) @ rows.T)

    def turn(self, signs: Array) -> None:
        """Multiply the bias by `signs` (2,): the dish went over the top, the ephemeris did not."""
        turned = np.concatenate([np.ones(2), signs])
        self.state = replace(
            self.state, mean=turned * self.state.mean, covariance=np.outer(turned, turned) * self.state.covariance
        )

    def _aged(self, t_s: float) -> Array:
        if self.state.t_s is None:
            return self.state.covariance
        elapsed = t_s - self.state.t_s
        if elapsed < 0.0:
            raise ValueError(f"t_s={t_s} must be >= {self.state.t_s}, the time of the last update")
        p = self.params
        walk = np.array([p.along_track_walk_s, p.cross_track_walk_m, p.bias_walk_rad, p.bias_walk_rad])
        return self.state.covariance + np.diag(walk**2 * elapsed)

    def _jitter(self, t_s: float) -> Array:
        """Noise of the beam's own motion; samples closer than `correlation_s` count for less."""
        # Ten errors a second of one slow gust are one measurement, not ten.
        elapsed = math.inf if self.state.t_s is None else t_s - self.state.t_s
        share = 1.0 if elapsed >= self.params.correlation_s else self.params.correlation_s / max(elapsed, 1e-3)
        return np.eye(2) * self.params.jitter_rad**2 * share


def direction_rows(sky: SkyMotion) -> Array:
    """Return d(direction) / d(state) (..., 2, 4); at rest there is no cross-track direction."""
    right, up, range_m = (np.asarray(part, dtype=np.float64) for part in sky)
    nearest_m = float(np.min(range_m))
    # A comparison of its own: this runs several times a period, and NaN fails it too.
    if not nearest_m >= 1.0:
        raise ValueError(f"range_m={nearest_m} must be >= 1.0")
    speed = np.hypot(right, up)
    across = np.where(speed > SLOWEST_RAD_S, 1.0, 0.0) / (np.maximum(speed, SLOWEST_RAD_S) * range_m)
    rows = np.zeros((*right.shape, 2, 4))
    rows[..., 0, 0], rows[..., 1, 0] = right, up
    rows[..., 0, 1], rows[..., 1, 1] = -up * across, right * across
    rows[..., 0, 2] = rows[..., 1, 3] = 1.0
    return rows


class TrackPath:
    """A pass on the sky: where its target is when it is early or late by more than a straight line.

    A target tau s ahead in its orbit is where it will be tau s later, less what the Earth turns
    meanwhile: R(w tau) p(t + tau), with p from the centre of the Earth.  The filter's tau (x', y')
    is the beginning of that curve: 4 s are 3 deg near the zenith of a low orbit, and 0.2 deg off
    the line.

    `t_s` (n,) in steps in which the motion hardly bends, `position_rad` (n, 2) azimuth, continuous,
    and elevation, `range_m` (n,).  On another `mount` they are the angles of its axes.
    """

    def __init__(
        self, t_s: Array, position_rad: Array, range_m: Array, latitude_rad: float, mount: Kinematics = LEVEL
    ) -> None:
        self._t_s, self._azimuth_rad, self._elevation_rad = t_s, *position_rad.T
        self._mount = mount
        # The Earth turns about its own axis, whatever the axes of the mount are.
        position_rad = position_rad if mount.level else mount.skies(position_rad)
        azimuth, elevation = position_rad.T
        level = range_m * np.cos(elevation)
        up = EARTH_RADIUS_M + range_m * np.sin(elevation)
        self._place = (level * np.sin(azimuth), level * np.cos(azimuth), up)
        self._turning = EARTH_RATE_RAD_S * math.cos(latitude_rad), EARTH_RATE_RAD_S * math.sin(latitude_rad)

    def moved(self, times: Array, ahead_s: float | Array) -> tuple[Array, Array]:
        """Return the offset (n, 2) on the sky of a target that is `ahead_s` early, and its rate.

        The rate is that of the offset over `ahead_s`.  Before and after the pass the target goes on
        straight.
        """
        azimuth, elevation = (np.interp(times, self._t_s, each) for each in (self._azimuth_rad, self._elevation_rad))
        stretch = np.cos(np.minimum(np.abs(elevation), STEEPEST_RAD))

        def offset(tau_s: float | Array) -> Array:
            there, height = self._seen(times + tau_s, tau_s)
            across = np.remainder(there - azimuth + math.pi, 2.0 * math.pi) - math.pi
            return np.column_stack([across * stretch, height - elevation])

        early, late = offset(ahead_s + RATE_STEP_S), offset(ahead_s - RATE_STEP_S)
        return offset(ahead_s), (early - late) / (2.0 * RATE_STEP_S)

    def _seen(self, times: Array, tau_s: float | Array) -> tuple[Array, Array]:
        """Return azimuth and elevation (n,) of the place at `times` before a turn of `tau_s`."""
        inside = np.clip(times, self._t_s[0], self._t_s[-1])
        east, north, up = (np.interp(inside, self._t_s, each) for each in self._place)
        for end, beyond in (
            (slice(2), np.minimum(times - inside, 0.0)),
            (slice(-2, None), np.maximum(times - inside, 0.0)),
        ):
            step_s = float(np.diff(self._t_s[end])[0])
            rates = (float(np.diff(each[end])[0]) / step_s for each in self._place)
            east, north, up = (each + beyond * rate for each, rate in zip((east, north, up), rates, strict=True))
        along, upward = self._turning
        east, north, up = (
            east + tau_s * (along * up - upward * north), north + tau_s * upward * east, up - tau_s * along * east,
        )  # fmt: skip
        up = up - EARTH_RADIUS_M
        if not self._mount.level:
            east, north, up = self._mount.matrix.T @ np.stack([east, north, up])
        return np.arctan2(east, north), np.arctan2(up, np.hypot(east, north))
