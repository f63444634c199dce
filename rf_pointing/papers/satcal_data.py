"""SATCAL's published numbers and the simulated station they are held against."""

import math
from datetime import UTC, datetime

from rf_pointing.calibration import BiasModel, PassPriors, held_at_zero
from rf_pointing.papers.orbit import Elements, Site

__all__ = [
    "APRIL_T_S",
    "INJECTION_T_S",
    "IRS_P3",
    "IRS_P3_APRIL",
    "MAURITIUS",
    "MAURITIUS_DEG",
    "ORBIT_PRIORS",
    "PCMC_DEG",
    "SITES",
    "model_of",
]

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
    along_track_m=175.0,
    cross_track_m=92.0,
    radial_m=35.0,
    along_track_drift_m_s=0.06,
    cross_track_drift_m_s=0.1,
    radial_drift_m_s=0.03,
)
"""The 200-m reference orbit, split as neighbouring orbits split it: mostly along the track, least in height.

A height error drags an along-track drift of -2 n times itself with it; the two are independent here, so the height
prior is a quarter wider than the simulated 28 m.
"""

SITES = {
    "Mauritius": Site(name="Mauritius", latitude_rad=math.radians(-20.34), longitude_rad=math.radians(57.45)),
    "Bangalore": Site(name="Bangalore", latitude_rad=math.radians(13.03), longitude_rad=math.radians(77.51)),
    "Lucknow": Site(name="Lucknow", latitude_rad=math.radians(26.91), longitude_rad=math.radians(80.96)),
    "Sriharikota": Site(name="Sriharikota", latitude_rad=math.radians(13.72), longitude_rad=math.radians(80.23)),
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


def model_of(table_deg: dict[str, float]) -> BiasModel:
    """Return the model of a table; terms that it does not list are zero."""
    return BiasModel.from_degrees({**held_at_zero(table_deg), **table_deg})


MAURITIUS = model_of(MAURITIUS_DEG)
