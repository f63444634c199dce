"""The 34-m beam-waveguide antenna DSS-13 as the BWG and DSS13-ID articles describe it.

Published: the mode frequencies, the amplifier gain (80, corrected to 56), the 15 % softer azimuth
gear, the 24-bit encoders, the 450 deg of azimuth travel.  Fitted to the published results: damping,
residues, drive bandwidth, pinion floor.  Assumed: inertias, friction, play, limits, cross residues.
docs/math/plant.md lists every number.
"""

import math
from typing import Any

from rf_pointing.core import require_choice
from rf_pointing.servo.parameters import AxisParams, PlantParams

BENDING_FREQUENCY_HZ = {"bwg": 2.12, "identified": 2.01}
"""Elevation bending mode: where BWG Sec. IV-B notches it, and where DSS13-ID Table 1 measured it.
"""

# Above every published mode, so that the gears leave the published frequencies as they are.
_GEAR_HZ = 11.0
_COUPLING = {60: 0.10, 90: 0.03}


def dss13_plant(
    *,
    elevation_deg: int = 60,
    bending: str = "bwg",
    pinion_angle_rad: float = 0.0,
    ideal: bool = False,
) -> PlantParams:
    """Return the DSS-13 plant.

    Parameters
    ----------
    elevation_deg
        Posture of the published model, 60 or 90: with the dish level the axes are less coupled.
    bending
        "bwg" for the 2.12-Hz mode of BWG, "identified" for the 2.01 Hz of DSS13-ID.
    pinion_angle_rad
        Place of the elevation pinion (BWG Fig. 14).
    ideal
        True leaves out friction, play, encoder steps and noise: the linear model with its limits.
    """
    require_choice("elevation_deg", str(elevation_deg), [str(key) for key in _COUPLING])
    require_choice("bending", bending, BENDING_FREQUENCY_HZ)
    azimuth = _axis(
        inertia_kg_m2=2.5e7, gear_softness=0.85, mode_frequency_hz=(1.65, 3.24, 4.24),
        mode_damping=(0.02, 0.02, 0.02), mode_encoder_residue=(0.05, 0.02, 0.02),
        mode_beam_residue=(0.10, 0.05, 0.03), travel_min_rad=math.radians(-225.0),
        travel_max_rad=math.radians(225.0),
    )  # fmt: skip
    elevation = _axis(
        inertia_kg_m2=2.0e7,
        gear_softness=1.0,
        mode_frequency_hz=(BENDING_FREQUENCY_HZ[bending], 3.15, 5.22),
        mode_damping=(0.0082, 0.01, 0.01),
        mode_encoder_residue=(0.316, 0.02, 0.02),
        mode_beam_residue=(0.5, 0.249, 0.02),
        travel_min_rad=math.radians(2.0),
        # Past the zenith by 2 deg: the commanded travel ends at 1.6 rad, and an overshoot must not
        # strike the stop.
        travel_max_rad=math.radians(92.0),
    )
    if ideal:
        linear = {
            "coulomb_friction_n_m": 0.0,
            "backlash_rad": 0.0,
            "encoder_bits": 40,
            "encoder_noise_rad": 0.0,
        }
        azimuth, elevation = azimuth.replace(**linear), elevation.replace(**linear)
    return PlantParams(
        azimuth=azimuth,
        elevation=elevation,
        pinion_angle_rad=pinion_angle_rad,
        pinion_floor=0.28,
        azimuth_to_bending=_COUPLING[elevation_deg],
        azimuth_modes_in_elevation=tuple(
            _COUPLING[elevation_deg] * residue for residue in (0.05, 0.02, 0.02)
        ),
        elevation_modes_in_azimuth=(0.0032, 0.001, 0.001),
        cross_mode_frequency_hz=5.76,
        cross_mode_damping=0.02,
        cross_mode_residue=0.003,
        substep_s=0.005,
    )


def _axis(*, inertia_kg_m2: float, gear_softness: float, **structure: Any) -> AxisParams:
    """Return an axis with drive, friction and encoder of either; `structure` is its own."""
    return AxisParams(
        amplifier_gain=56.0,
        drive_bandwidth_per_gain_hz=20.0 / (2.0 * math.pi) / 56.0,
        # None is published.
        drive_delay_s=0.0,
        inertia_kg_m2=inertia_kg_m2,
        gear_stiffness_n_m=gear_softness * inertia_kg_m2 * (2.0 * math.pi * _GEAR_HZ) ** 2,
        gear_damping=0.15,
        backlash_rad=math.radians(3e-3),
        # Above the friction, so that tracking does not cross the play; below a slew's torque, which
        # does.
        countertorque_n_m=0.01 * inertia_kg_m2,
        coulomb_friction_n_m=2.5e-5 * inertia_kg_m2,
        static_friction_ratio=1.3,
        stribeck_rate_rad_s=math.radians(2e-3),
        rate_limit_rad_s=math.radians(2.0),
        acceleration_limit_rad_s2=math.radians(2.0),
        brake_torque_n_m=math.radians(2.0) * inertia_kg_m2,
        encoder_bits=24,
        # One step of the encoder.
        encoder_noise_rad=2.0 * math.pi / 2**24,
        **structure,
    )
