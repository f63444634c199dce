"""A station whose axes follow every command exactly: mount, lags and sensor noise of the simulated antenna, no dynamics.

For what depends on the geometry alone, such as a calibration campaign, at a thousandth of the cost of `simulate_pass`.  One
step is one period of the controller: the beam is where the mount's errors put it, the sensor reports target minus beam with
noise, and an integrator of the first order takes the error out of the next commands.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rf_pointing.calibration import BiasModel
from rf_pointing.core import JointReading, Params, PointingError, parameter, sky_offset_rad
from rf_pointing.ephemeris import Pass, TopocentricTrack
from rf_pointing.station.antenna.mount import MountError, RateAverage
from rf_pointing.station.campaign.log import CalibrationLog

__all__ = ["KinematicParams", "KinematicStation"]

Array = NDArray[np.float64]
TARGET_STEP_S = 0.5


@dataclass(frozen=True, kw_only=True)
class KinematicParams(Params):
    """Period, loop and noise."""

    period_s: float = parameter(0.1, "time between two commands", low=0.01, high=1.0)
    lag_averaging_s: float = parameter(
        5.0, "time over which rates are averaged for the mount's lags", low=0.1, high=100.0
    )
    loop_hz: float = parameter(0.2, "bandwidth of the tracking loop", low=0.001, high=1.0)
    noise_rad: float = parameter(1e-5, "standard deviation of the sensed error", low=0.0, high=0.01)


class KinematicStation:
    """Tracks passes with the mount errors `mount` under the pointing model `model`."""

    def __init__(
        self, params: KinematicParams, mount: BiasModel, model: BiasModel, random: np.random.Generator
    ) -> None:
        self.params, self.model = params, model
        self.mount = mount
        self._random = random

    def track(self, track: TopocentricTrack, window: Pass, *, sensor: bool, log: CalibrationLog | None = None) -> Array:
        """Return target minus beam (n, 2), cross-elevation and elevation, at every period of the pass.

        Before the pass the axes are at rest at its beginning.  With `sensor` the loop is closed, without it the model
        alone points; `log` gets what the calibrator would.
        """
        step_s = self.params.period_s
        times = np.arange(window.aos_t_s, window.los_t_s, step_s)
        look = track.sample(times)
        sky = np.column_stack([look.azimuth_rad, look.elevation_rad])
        rates = np.column_stack([look.azimuth_rate_rad_s, look.elevation_rate_rad_s])
        accelerations = np.column_stack([look.azimuth_acceleration_rad_s2, look.elevation_acceleration_rad_s2])
        axes, velocity, _ = self.model.apply_moving(sky, rates, accelerations)
        feed = self._feeder(track, log) if log is not None else None
        mount, mean, trim = MountError(self.mount), RateAverage(self.params.lag_averaging_s), np.zeros(2)
        gain = 2.0 * math.pi * self.params.loop_hz * step_s
        misses, before = np.empty((len(times), 2)), trim
        for k, t_s in enumerate(times.tolist()):
            position = axes[k] + trim
            beam = mount.remove(t_s, position, mean.rate_rad_s, mean.acceleration_rad_s2)
            moved = position - (axes[k - 1] + before if k else position)
            mean.update(step_s, moved / step_s + mount.drift_rad_s)
            before = trim
            misses[k] = np.ravel(sky_offset_rad(sky[k, 0], sky[k, 1], beam[0], beam[1]))
            sensed = misses[k] + self.params.noise_rad * self._random.standard_normal(2)
            if feed is not None:
                feed(t_s, position, velocity[k], sensed)
            if sensor:
                trim = trim + gain * sensed / np.array([math.cos(sky[k, 1]), 1.0])
        return misses

    def _feeder(self, track: TopocentricTrack, log: CalibrationLog) -> Callable[[float, Array, Array, Array], None]:
        known_s = -math.inf

        def feed(t_s: float, position: Array, velocity: Array, sensed: Array) -> None:
            nonlocal known_s
            known_s = max(known_s, t_s - TARGET_STEP_S)
            while known_s < t_s + TARGET_STEP_S:
                known_s += TARGET_STEP_S
                log.take_target(track.target_at(known_s))
            log.take_joints(JointReading(t_s=t_s, position_rad=position, velocity_rad_s=velocity))
            covariance = self.params.noise_rad**2 * np.eye(2)
            log.take_error(PointingError(
                t_s=t_s, sensor="monopulse", cross_elevation_rad=float(sensed[0]),
                elevation_rad=float(sensed[1]), covariance_rad2=covariance,
            ))  # fmt: skip

        return feed
