"""The simulated antenna without its control unit: drives, structure, wind, sensors, and where the beam really points.

The encoders read the true direction plus the mount's own errors.  Faults of drives and sensors can be put in.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rf_pointing.calibration import BiasModel
from rf_pointing.core import Boresight, Params, parameter, random_stream
from rf_pointing.servo import AntennaPlant, PlantParams, Wind, WindParams
from rf_pointing.station.antenna.injected_faults import InjectedFaults
from rf_pointing.station.antenna.mount import MountError, RateAverage

__all__ = ["AntennaHardware", "AntennaParams"]

Array = NDArray[np.float64]
Pair = tuple[float, float]


@dataclass(frozen=True, kw_only=True)
class AntennaParams(Params):
    """Tick, start and randomness of the simulated antenna."""

    tick_s: float = parameter(0.02, "control period", low=0.001, high=0.1)
    lag_averaging_s: float = parameter(
        5.0, "time over which rates are averaged for the mount's lag terms", low=0.1, high=100.0
    )
    start_azimuth_rad: float = parameter(math.radians(120.0), "azimuth at the start", low=-20.0, high=20.0)
    start_elevation_rad: float = parameter(math.radians(60.0), "elevation at the start", low=-0.2, high=3.3)
    seed: int = parameter(1, "seed of every noise source", low=0, high=2**31 - 1)

    @property
    def start_rad(self) -> Pair:
        """Azimuth and elevation at the start."""
        return self.start_azimuth_rad, self.start_elevation_rad


class AntennaHardware:
    """Once a tick: `look` at its beginning, `move` through it, `encoders` at its end; it begins with its brakes set."""

    def __init__(self, params: AntennaParams, plant: PlantParams, wind: WindParams, mount: BiasModel) -> None:
        self.plant = AntennaPlant(plant, random_stream(params.seed, "encoder"), params.start_rad)
        self.plant.brake()
        self.injected = InjectedFaults()
        self._tick_s = params.tick_s
        self._wind = Wind(wind, random_stream(params.seed, "wind"))
        self._torque = np.zeros(2)
        self._mean = RateAverage(params.lag_averaging_s)
        self._mount_error = MountError(mount)

    def look(self, t_s: float) -> Boresight:
        """Return the true direction of the beam, and let the wind blow on it for this tick."""
        boresight = self._boresight(t_s, self.plant.velocity_rad_s)
        self._torque = self._wind.step(self._tick_s, boresight.azimuth_rad, boresight.elevation_rad)
        return boresight

    def anemometer_m_s(self) -> float:
        """Return the speed of the wind as it is measured, NaN when it is not."""
        return self.injected.wind_speed(math.hypot(*self._wind.speed_m_s))

    def move(self, rate_command_rad_s: Array) -> None:
        """Drive the axes through this tick; a drive that has run away does not listen."""
        if self.injected.kind == "runaway":
            azimuth, elevation = rate_command_rad_s.tolist()
            rate_command_rad_s = np.array(self.injected.rate_command((azimuth, elevation)))
        self.plant.step(rate_command_rad_s, self._torque, self._tick_s)

    def encoders(self) -> Pair:
        """Return the angles that the encoders show."""
        azimuth, elevation = self.plant.encoder_rad.tolist()
        if self.injected.kind == "none":
            return azimuth, elevation
        return self.injected.encoder((azimuth, elevation), self._tick_s)

    def _boresight(self, t_s: float, velocity: Array) -> Boresight:
        """Return the true direction of the beam; the mount's lags act on averaged rates."""
        mean = self._mean
        sky = self._mount_error.remove(t_s, self.plant.beam_rad, mean.rate_rad_s, mean.acceleration_rad_s2)
        mean.update(self._tick_s, velocity + self._mount_error.drift_rad_s)
        azimuth, elevation = sky.tolist()
        if elevation > 0.5 * math.pi:
            azimuth, elevation = azimuth - math.pi, math.pi - elevation
        return Boresight(t_s=t_s, azimuth_rad=azimuth, elevation_rad=elevation)
