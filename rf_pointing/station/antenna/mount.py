"""The mount errors that a simulated antenna really has: their parameters, their effect on the beam.

The model is SATCAL eqs. (1)-(2).
"""

import math
from dataclasses import asdict, dataclass

import numpy as np

from rf_pointing.calibration import TERMS, BiasModel
from rf_pointing.calibration.terms import MOUNT_TERMS
from rf_pointing.core import LEVEL, Array, Boresight, Kinematics, Params, parameter

RENEWAL_S = 0.5
"""Time between two steps of the inversion: a hundredth of the cost of inverting at every tick."""
STEEP_RAD = math.radians(5.0)
"""Within this of the zenith a step does not converge: errors grow as tan(elevation)."""
LIMIT_RAD = math.radians(5.0)
LIMIT_S = 10.0
MEMORY_TIMES = 20.0
"""Times of its averaging after which a mount at rest remembers no motion."""


def _coefficient(description: str, limit: float = LIMIT_RAD) -> float:
    """Declare one coefficient, zero unless configured, within +-`limit`."""
    declared: float = parameter(0.0, description, -limit, limit)
    return declared


@dataclass(frozen=True, kw_only=True)
class MountParams(Params):
    """Coefficients x1 to x14; observed = true + model(true)."""

    azimuth_offset_rad: float = _coefficient("x1, azimuth encoder offset")
    non_orthogonality_rad: float = _coefficient("x2, non-orthogonality of the axes")
    collimation_rad: float = _coefficient("x3, collimation of the radio axis")
    azimuth_encoder_sine_rad: float = _coefficient("x4, azimuth encoder nonlinearity, sine")
    azimuth_encoder_cosine_rad: float = _coefficient("x5, azimuth encoder nonlinearity, cosine")
    azimuth_velocity_lag_s: float = _coefficient("x6, azimuth velocity lag", LIMIT_S)
    azimuth_acceleration_lag_s2: float = _coefficient("x7, azimuth acceleration lag in s^2", LIMIT_S)
    mislevel_east_rad: float = _coefficient("x8, mislevel about east")
    mislevel_north_rad: float = _coefficient("x9, mislevel about north")
    elevation_offset_rad: float = _coefficient("x10, elevation encoder offset")
    droop_rad: float = _coefficient("x11, droop")
    elevation_encoder_sine_rad: float = _coefficient("x12, elevation encoder nonlinearity")
    elevation_velocity_lag_s: float = _coefficient("x13, elevation velocity lag", LIMIT_S)
    elevation_acceleration_lag_s2: float = _coefficient("x14, elevation acceleration lag in s^2", LIMIT_S)

    def model(self, mount: Kinematics | None = None) -> BiasModel:
        """Return the bias model of these coefficients; on another mount those of its own terms."""
        # The names end in their units, the terms of the model do not.
        by_stem = {name.rsplit("_", 1)[0]: value for name, value in asdict(self).items()}
        own = {term.number: by_stem[term.name] for term in TERMS}
        return BiasModel({term.name: own[term.number] for term in MOUNT_TERMS[(mount or LEVEL).type]}, mount)


class RateAverage:
    """Rates of the beam averaged over about T = `time_s`: the lags of the mount act on these.

    On the momentary rate, vibration included, a lag of seconds would be a prediction, and no loop
    could be closed on it.  The average has two poles, 1 / (1 + T s + T^2 s^2) = 1 - T s + T^3 s^3 -
    ...: without a term in s^2 a lag on it is a velocity and an acceleration lag, as in SATCAL eqs.
    (1)-(2), up to the third derivative of the rate.
    """

    def __init__(self, time_s: float) -> None:
        self.time_s = time_s
        self.rate_rad_s = np.zeros(2)
        self.acceleration_rad_s2 = np.zeros(2)

    def update(self, dt_s: float, rate_rad_s: Array) -> None:
        """Go on by `dt_s` with the beam moving at `rate_rad_s` (2,)."""
        time_s = self.time_s
        pull = (rate_rad_s - self.rate_rad_s) / time_s - self.acceleration_rad_s2
        self.acceleration_rad_s2 = self.acceleration_rad_s2 + dt_s / time_s * pull
        self.rate_rad_s = self.rate_rad_s + dt_s * self.acceleration_rad_s2


class MountError:
    """Takes the mount's errors off axis angles that change slowly from call to call.

    The correction is renewed by one step of sky += axes - apply(sky) every `RENEWAL_S` and runs on
    a straight line in between: within 0.03 mdeg of `BiasModel.remove` along a pass that peaks at 44
    deg, at a hundredth of its cost.  Near the zenith the lags are taken at the rates of the axes
    and the rest off exactly, in every call; in the exclusion cone of the mount, where no direction
    can be named, the correction stays.
    """

    def __init__(self, model: BiasModel) -> None:
        self._model = model
        self._correction = np.zeros(2)
        self.drift_rad_s = np.zeros(2)
        """How fast the beam moves in addition to the axes (2,)."""
        self._renewed_s: float | None = None

    def remove(self, t_s: float, axes_rad: Array, rate_rad_s: Array, acceleration_rad_s2: Array) -> Array:
        """Return true azimuth and elevation (2,) of a beam at these axis angles and rates."""
        if abs(axes_rad[1] - 0.5 * math.pi) < STEEP_RAD:
            return self._remove_steep(t_s, axes_rad, (*rate_rad_s, *acceleration_rad_s2))
        if self._renewed_s is None or not 0.0 <= t_s - self._renewed_s <= 10.0 * RENEWAL_S:
            sky = np.array(self._model.remove(*axes_rad, *rate_rad_s, *acceleration_rad_s2))
            self._correction, self.drift_rad_s, self._renewed_s = sky - axes_rad, np.zeros(2), t_s
        # Ticks are sums of floats: one that is due must not wait for the next because of a rounding
        # error.
        elif t_s - self._renewed_s >= RENEWAL_S - 1e-6:
            self._renew(t_s, axes_rad, rate_rad_s, acceleration_rad_s2)
        sky_now: Array = axes_rad + self._correction + self.drift_rad_s * (t_s - self._renewed_s)
        return sky_now

    def _remove_steep(self, t_s: float, axes_rad: Array, motion: tuple[float, ...]) -> Array:
        # Near the zenith the inversion with lags at the rates of the beam need not converge.
        try:
            sky = np.array(self._model.beam_at(*axes_rad, *motion))
        except ValueError:
            return np.asarray(axes_rad + self._correction)
        # The rate is kept up here too: leaving the steep region must not start with a jump.
        correction, since_s = sky - axes_rad, t_s - (self._renewed_s or 0.0)
        self.drift_rad_s = (correction - self._correction) / since_s if 0.0 < since_s <= RENEWAL_S else np.zeros(2)
        self._correction, self._renewed_s = correction, t_s
        return sky

    def _renew(self, t_s: float, axes_rad: Array, rate_rad_s: Array, acceleration_rad_s2: Array) -> None:
        assert self._renewed_s is not None
        elapsed_s = t_s - self._renewed_s
        # One step of the fixed-point iteration from the extrapolated correction is enough here.
        sky = axes_rad + self._correction + self.drift_rad_s * elapsed_s
        observed = self._model.apply(*sky, *rate_rad_s, *acceleration_rad_s2)
        correction = sky - np.array([float(part) for part in observed])
        self.drift_rad_s = (correction - self._correction) / elapsed_s
        self._correction, self._renewed_s = correction, t_s


class SimulatedBeam:
    """Where the beam of axes with the mount's errors really points, tick by tick."""

    def __init__(
        self, params: MountParams, lag_averaging_s: float, tick_s: float, mount: Kinematics = LEVEL
    ) -> None:  # fmt: skip
        self._mount = mount
        self._tick_s = tick_s
        self._mean, self._looked_s = RateAverage(lag_averaging_s), math.inf
        self.bend(params)

    def bend(self, params: MountParams) -> None:
        """Have other errors from now on, as in another band; the mount moves on as it did."""
        self._mount_error = MountError(params.model(self._mount))

    def boresight(self, t_s: float, axes_rad: Array, rate_rad_s: Array) -> Boresight:
        """Return the direction on the sky of axes (2,) that move at these rates (2,)."""
        mean, stood_s, self._looked_s = self._mean, t_s - self._looked_s - self._tick_s, t_s
        # A simulation that stalls leaves the axes where they are: the mount comes to rest.
        for _ in range(round(min(stood_s, MEMORY_TIMES * mean.time_s) / self._tick_s) if stood_s > 0.0 else 0):
            mean.update(self._tick_s, np.zeros(2))
        # The mount's lags act on averaged rates.
        sky = self._mount_error.remove(t_s, axes_rad, mean.rate_rad_s, mean.acceleration_rad_s2)
        # After the use: the lags act on the motion up to this tick.
        mean.update(self._tick_s, rate_rad_s + self._mount_error.drift_rad_s)
        azimuth, elevation = sky.tolist()
        if not self._mount.level:
            azimuth, elevation = self._mount.sky_at(azimuth, elevation)
        elif elevation > 0.5 * math.pi:
            # Over its back the dish points to the other side: a direction on the sky has no
            # elevation above 90 deg.
            azimuth, elevation = azimuth - math.pi, math.pi - elevation
        return Boresight(t_s=t_s, azimuth_rad=azimuth, elevation_rad=elevation)
