"""Passes through the zenith to hold a certificate against: which satellites, stations and days, and
on what mount.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from rf_pointing.calibration import BiasModel
from rf_pointing.core import random_stream
from rf_pointing.core.constants import EARTH_MU_M3_S2, EARTH_RADIUS_M
from rf_pointing.ephemeris import (
    SITES,
    Elements,
    Pass,
    TopocentricTrack,
    find_passes,
    site,
    verification_elements,
)
from rf_pointing.planning import AxisLimits
from rf_pointing.station.antenna.mount import MountParams

LEAST_PERIGEE_M, LARGEST_PERIGEE_M = 300e3, 1500e3
"""Perigees of the orbits that are flown: low, and high enough to last for the days they are flown
on.
"""
LEAST_PEAK_RAD = math.radians(75.0)
AVERAGING_S = 5.0
"""Time over which the mount averages the rates that its lags act on."""
MOST_TRIES = 3000
DAYS = 7
GENERATED_SHARE = 0.7
"""Share of passes of generated orbits: few of the verification set are low and last."""
EPOCH_T_S = 1_151_347_200.0
"""Epoch of the generated orbits, 2006-06-26."""
BEAMS_DEG = (0.065, 0.264, 1.0, 3.0)


@dataclass(frozen=True, kw_only=True)
class KeyholeCase:
    """One pass to fly, the beam that follows it, whether the dish may go over the top, and the
    errors of the mount.

    The controller knows the mount as a perfect calibration would, its lags as those of steady
    motion.
    """

    track: TopocentricTrack
    window: Pass
    beamwidth_rad: float
    station: str = ""
    over: bool = False
    mount: MountParams = MountParams()

    @property
    def limits(self) -> AxisLimits:
        """Travel of the axes: ample, up to the zenith or beyond."""
        top_rad = math.radians(176.0) if self.over else 0.5 * math.pi
        return AxisLimits(azimuth_min_rad=-6.0, azimuth_max_rad=12.0, elevation_max_rad=top_rad)

    @property
    def calibrated(self) -> BiasModel:
        """The model of steady motion: an average of rates is an acceleration lag of -T more."""
        found = self.mount.model()
        lags = {
            f"{axis}_acceleration_lag": found.coefficients[f"{axis}_acceleration_lag"]
            - AVERAGING_S * found.coefficients[f"{axis}_velocity_lag"]
            for axis in ("azimuth", "elevation")
        }
        return found.replace(**lags)


def station_mount() -> MountParams:
    """Return errors of the size of SATCAL Table 1 (Mauritius), those of our station."""
    return MountParams(
        azimuth_offset_rad=math.radians(0.178),
        non_orthogonality_rad=math.radians(0.062),
        collimation_rad=math.radians(-0.010),
        azimuth_encoder_sine_rad=math.radians(-0.194),
        azimuth_encoder_cosine_rad=math.radians(-0.048),
        azimuth_velocity_lag_s=-1.022,
        azimuth_acceleration_lag_s2=0.02,
        mislevel_east_rad=math.radians(0.039),
        mislevel_north_rad=math.radians(-0.007),
        elevation_offset_rad=math.radians(-0.202),
        droop_rad=math.radians(-0.089),
        elevation_encoder_sine_rad=math.radians(-0.009),
        elevation_velocity_lag_s=-1.907,
        elevation_acceleration_lag_s2=0.02,
    )


def high_passes(count: int, seed: int) -> Iterator[KeyholeCase]:
    """Yield passes that go through the zenith, each of another random orbit, station or day, with a
    random beam.

    Orbits are the lasting low ones of the verification set and generated circular ones.
    """
    random = random_stream(seed, "keyhole")
    real = [
        e for e in verification_elements() if LEAST_PERIGEE_M < _perigee_m(e) < LARGEST_PERIGEE_M
    ]
    seen: set[tuple[str, str, int]] = set()
    for number in range(MOST_TRIES):
        generated = random.random() < GENERATED_SHARE
        elements = _generated(number, random) if generated else real[random.integers(len(real))]
        station, day = list(SITES)[random.integers(len(SITES))], int(random.integers(DAYS))
        beamwidth_rad = math.radians(float(random.choice(BEAMS_DEG)))
        if (elements.name, station, day) in seen:
            continue
        seen.add((elements.name, station, day))
        track = TopocentricTrack(elements, site(station))
        passes = find_passes(track, elements.epoch_t_s + 86400.0 * day, 86400.0, math.radians(5.0))
        for window in passes:
            if window.peak_elevation_rad >= LEAST_PEAK_RAD and count > 0:
                count -= 1
                yield KeyholeCase(
                    track=track, window=window, beamwidth_rad=beamwidth_rad, station=station
                )
        if count == 0:
            return


def _perigee_m(elements: Elements) -> float:
    axis_m = (EARTH_MU_M3_S2 / elements.mean_motion_rad_s**2) ** (1.0 / 3.0)
    return float(axis_m * (1.0 - elements.eccentricity) - EARTH_RADIUS_M)


def _generated(number: int, random: np.random.Generator) -> Elements:
    """Return a circular orbit of 350 to 1300 km, inclined by 40 to 110 degrees."""
    axis_m = EARTH_RADIUS_M + random.uniform(350e3, 1300e3)
    node, anomaly = random.uniform(0.0, 2.0 * math.pi, 2).tolist()
    return Elements(
        name=f"generated {number}",
        catalogue_number=number + 1,
        epoch_t_s=EPOCH_T_S,
        inclination_rad=math.radians(random.uniform(40.0, 110.0)),
        ascending_node_rad=node,
        eccentricity=1e-3,
        argument_of_perigee_rad=0.0,
        mean_anomaly_rad=anomaly,
        mean_motion_rad_s=math.sqrt(EARTH_MU_M3_S2 / axis_m**3),
        drag_per_earth_radius=1e-5,
    )
