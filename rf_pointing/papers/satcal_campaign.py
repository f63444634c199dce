"""Simulated calibration campaigns for SATCAL, and the published numbers they plant.

Real pass geometry, an orbit off by 200 m, noise, and fits of many runs.  Orbit errors are those of
a neighbouring orbit (Clohessy-Wiltshire): within a pass they change as they would, between passes
they are independent.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime

import numpy as np
from numpy.typing import NDArray

from rf_pointing.calibration import (
    BiasModel,
    FitResult,
    Observations,
    PassPriors,
    SectorRule,
    fit_bias_model,
    held_at_zero,
    select_observations,
)
from rf_pointing.calibration.pass_errors import shift_by
from rf_pointing.core.target_motion import ANGLES, TargetMotion
from rf_pointing.core.types import Array
from rf_pointing.papers.satcal_looks import visits
from rf_pointing.papers.satcal_motion import Elements, Gravity, Site

MAURITIUS_DEG = {
    "azimuth_offset": 0.178,
    "non_orthogonality": 0.062,
    "collimation": -0.010,
    "azimuth_encoder_sine": -0.194,
    "azimuth_encoder_cosine": -0.048,
    "azimuth_velocity_lag": -1.022,
    "mislevel_east": 0.039,
    "mislevel_north": -0.007,
    "elevation_offset": -0.202,
    "droop": -0.089,
    "elevation_encoder_sine": -0.009,
    "elevation_velocity_lag": -1.907,
}
"""Table 1, degrees and seconds; x7 and x14 are not in it."""

PCMC_DEG = {
    "PCMC-1": {
        "azimuth_offset": -0.435,
        "non_orthogonality": -0.095,
        "azimuth_encoder_sine": -0.052,
        "azimuth_encoder_cosine": 0.038,
        "azimuth_velocity_lag": 0.470,
        "mislevel_east": -0.080,
        "mislevel_north": -0.023,
        "elevation_offset": 0.223,
        "elevation_velocity_lag": 0.350,
    },
    "PCMC-2": {
        "azimuth_offset": 0.766,
        "non_orthogonality": 0.101,
        "azimuth_encoder_sine": 0.094,
        "azimuth_encoder_cosine": -0.010,
        "azimuth_velocity_lag": -0.696,
        "mislevel_east": 0.039,
        "mislevel_north": 0.005,
        "elevation_offset": 0.051,
        "elevation_velocity_lag": -0.699,
    },
}
"""Table 3, degrees and seconds."""

ORBIT_PRIORS = PassPriors(
    along_track_m=165.0,
    cross_track_m=92.0,
    radial_m=28.0,
    cross_track_drift_m_s=0.095,
    radial_drift_m_s=0.029,
)
"""The 200-m reference orbit, split as neighbouring orbits split it: mostly along the track, least
in height, and the drifts are those of the orbit's turn.
"""

SITES = {
    "Mauritius": Site(
        name="Mauritius", latitude_rad=math.radians(-20.34), longitude_rad=math.radians(57.45)
    ),
    "Bangalore": Site(
        name="Bangalore", latitude_rad=math.radians(13.03), longitude_rad=math.radians(77.51)
    ),
    "Lucknow": Site(
        name="Lucknow", latitude_rad=math.radians(26.91), longitude_rad=math.radians(80.96)
    ),
    "Sriharikota": Site(
        name="Sriharikota", latitude_rad=math.radians(13.72), longitude_rad=math.radians(80.23)
    ),
}

IRS_P3 = Elements(
    semi_major_axis_m=7205497.854,
    eccentricity=0.002332,
    inclination_rad=math.radians(98.789565),
    node_rad=math.radians(156.612388),
    perigee_rad=math.radians(243.5181),
    mean_anomaly_rad=math.radians(325.4653),
)
"""Table 2, regular orbit determination at `INJECTION_T_S`."""
INJECTION_T_S = datetime(1996, 3, 21, 5, 11, 2, 70000, UTC).timestamp()

IRS_P3_APRIL = Elements(
    semi_major_axis_m=7202735.995,
    eccentricity=0.001357,
    inclination_rad=math.radians(98.802323),
    node_rad=math.radians(168.301110),
    perigee_rad=math.radians(139.794369),
    mean_anomaly_rad=math.radians(103.763373),
)
"""Table 6, corrected data, at `APRIL_T_S`."""
APRIL_T_S = datetime(1996, 4, 2, tzinfo=UTC).timestamp()
_ORBIT_RATE_RAD_S = 2.0 * np.pi / 6080.0
# 28 m up, 174 m along and 92 m across: together the 200 m rms of the reference orbit.
_ELLIPSE_M, _AHEAD_M, _ACROSS_M = 40.0, 165.0, 92.0
_GRAVITY = Gravity()


def model_of(table_deg: dict[str, float]) -> BiasModel:
    """Return the model of a table; terms that it does not list are zero."""
    return BiasModel.from_degrees({**held_at_zero(table_deg), **table_deg})


MAURITIUS = model_of(MAURITIUS_DEG)


def points_of(passes: Sequence[TargetMotion], sigma_rad: float) -> Observations:
    """Return noise-free, unbiased points of passes, 80 deg of elevation and below."""
    parts = []
    for number, seen in enumerate(passes):
        # Near the zenith the azimuth rate grows without bound, and its lag terms with it.
        low = seen.elevation_rad <= np.radians(80.0)
        count = int(np.sum(low))
        if count == 0:
            continue
        parts.append(
            Observations(
                station="simulated",
                band="S",
                t_s=seen.t_s[low],
                pass_id=np.full(count, number),
                observed_azimuth_rad=seen.azimuth_rad[low],
                observed_elevation_rad=seen.elevation_rad[low],
                true_azimuth_rad=seen.azimuth_rad[low],
                true_elevation_rad=seen.elevation_rad[low],
                **{name: getattr(seen, name)[low] for name in ANGLES[2:]},
                sigma_azimuth_rad=np.full(count, sigma_rad),
                sigma_elevation_rad=np.full(count, sigma_rad),
                range_m=seen.range_m[low],
                range_rate_m_s=seen.range_rate_m_s[low],
            )
        )
    return Observations.concatenate(parts)


def sky_filling_points(
    site: Site, satellites: Sequence[Elements], epoch_t_s: float, days: float, sigma_rad: float
) -> Observations:
    """Return 25 to 30 points, 10 s apart, in each of the 36 sectors.

    Refuses if `days` do not fill them.
    """
    passes = [
        seen
        for satellite in satellites
        for seen in visits(
            site, satellite, epoch_t_s, days, _GRAVITY, step_s=10.0, lowest_rad=np.radians(10.0)
        )
    ]
    return select_observations([points_of(passes, sigma_rad)], SectorRule(), require_full=True)[0]


def orbit_error(points: Observations, random: np.random.Generator) -> tuple[Array, Array]:
    """Return shifts of azimuth and elevation (n,) from an orbit error of 200 m rms."""
    return shift_by(points, orbit_error_m(points, random))


def orbit_error_m(points: Observations, random: np.random.Generator) -> Array:
    """Return the displacement (n, 3) along, across and up of the reference orbit: 200 m rms."""
    # One orbit error per pass: between passes the reference orbit is determined anew.
    place = np.searchsorted(points.passes, points.pass_id)
    count = len(points.passes)
    first = np.array([points.t_s[points.pass_id == number][0] for number in points.passes])
    phase = _ORBIT_RATE_RAD_S * (points.t_s - first[place])
    a, b, c, d = (random.normal(0.0, _ELLIPSE_M / np.sqrt(2.0), count)[place] for _ in range(4))
    across = (_ACROSS_M / _ELLIPSE_M) * (c * np.cos(phase) + d * np.sin(phase)) * np.sqrt(2.0)
    radial = a * np.cos(phase) + b * np.sin(phase)
    # Clohessy-Wiltshire: the ellipse along the track is twice that in height and a quarter turn
    # ahead.
    along = (
        2.0 * (b * np.cos(phase) - a * np.sin(phase)) + random.normal(0.0, _AHEAD_M, count)[place]
    )
    return np.stack([along, across, radial], axis=1)


def observed(
    points: Observations, model: BiasModel, random: np.random.Generator, shift: tuple[Array, Array]
) -> Observations:
    """Return the points seen through `model` with noise of their sigma and the orbit's `shift`."""
    offset = model.offset_rad(*points.motion())
    noise = random.standard_normal((2, len(points)))
    return replace(
        points,
        observed_azimuth_rad=points.true_azimuth_rad
        + offset[0]
        + shift[0]
        + points.sigma_azimuth_rad * noise[0],
        observed_elevation_rad=points.true_elevation_rad
        + offset[1]
        + shift[1]
        + points.sigma_elevation_rad * noise[1],
    )


@dataclass(frozen=True, eq=False)
class Runs:
    """Fits of many simulated campaigns.

    Estimates and stated sigma (runs, k), the truth (k,) and the first fit.
    """

    names: tuple[str, ...]
    truth: Array
    values: Array
    sigma: Array
    first: FitResult

    def within_three_sigma(self) -> NDArray[np.bool_]:
        """Return which estimates (runs, k) lie within three of their own sigma of the truth."""
        return np.abs(self.values - self.truth) <= 3.0 * self.sigma

    def spread_over_sigma(self) -> Array:
        """Return the actual spread of the estimates over the stated sigma (k,)."""
        # About the truth, not about the mean: a common bias counts as error.
        spread = np.sqrt(np.mean((self.values - self.truth) ** 2, axis=0))
        return np.asarray(spread / np.sqrt(np.mean(self.sigma**2, axis=0)))


def many_runs(
    points: Observations,
    model: BiasModel,
    names: tuple[str, ...],
    runs: int,
    random: np.random.Generator,
    pass_priors: PassPriors | None,
) -> Runs:
    """Simulate and fit `runs` campaigns at the same points."""
    fits = []
    for _ in range(runs):
        data = observed(points, model, random, orbit_error(points, random))
        fits.append(
            fit_bias_model(data, terms=names, held=held_at_zero(names), pass_priors=pass_priors)
        )
    truth = np.array([model.coefficients[name] for name in names])
    return Runs(
        names, truth, np.array([f.values for f in fits]), np.array([f.sigma for f in fits]), fits[0]
    )
