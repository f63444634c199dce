"""The parameters of an antenna: drives, gears, modes, friction, limits, encoders.

The modes are in residue form.  With theta the angle of the drive referred to the axis, mode i obeys

    q'' + 2 zeta w q' + w^2 q = -excitation * theta''
    encoder = theta + sum(a q),   beam = theta + sum(b q)

where a is `mode_encoder_residue` and b is `mode_beam_residue`: the encoder and the beam see
different amounts of the same bending.  A positive residue lags the drive as a tip mass does.
"""

import math
from dataclasses import dataclass

from rf_pointing.core import Params, parameter


@dataclass(frozen=True, kw_only=True)
class AxisParams(Params):
    """One axis: rate drive, gearbox, structure, friction, limits and encoder."""

    amplifier_gain: float = parameter(description="drive amplifier gain k_r", low=1.0, high=1000.0)
    drive_bandwidth_per_gain_hz: float = parameter(
        description="rate-loop bandwidth per unit of amplifier gain", low=1e-3, high=10.0
    )
    drive_delay_s: float = parameter(description="dead time of the drive", low=0.0, high=0.5)
    inertia_kg_m2: float = parameter(
        description="inertia about the axis, motors included through the gears", low=1.0, high=1e10
    )
    gear_stiffness_n_m: float = parameter(
        description="stiffness of the gears per radian of the axis", low=1.0, high=1e13
    )
    gear_damping: float = parameter(
        description="damping ratio of the gear mode", low=1e-4, high=1.0
    )
    backlash_rad: float = parameter(
        description="half width of the gear play, at the axis", low=0.0, high=0.01
    )
    countertorque_n_m: float = parameter(
        description="torque by which the paired drives load the gears against each other",
        low=0.0,
        high=1e9,
    )
    coulomb_friction_n_m: float = parameter(
        description="friction torque of the moving axis", low=0.0, high=1e8
    )
    static_friction_ratio: float = parameter(
        description="breakaway torque over the friction torque (Stribeck)", low=1.0, high=5.0
    )
    stribeck_rate_rad_s: float = parameter(
        description="rate at which the Stribeck excess has fallen to 1/e", low=1e-8, high=0.1
    )
    mode_frequency_hz: tuple[float, ...] = parameter(
        description="frequencies of the flexible modes", low=1e-3, high=200.0
    )
    mode_damping: tuple[float, ...] = parameter(
        description="damping ratios of the modes", low=1e-5, high=0.999
    )
    mode_encoder_residue: tuple[float, ...] = parameter(
        description="what the encoder sees", low=-10.0, high=10.0
    )
    mode_beam_residue: tuple[float, ...] = parameter(
        description="what the beam sees", low=-10.0, high=10.0
    )
    rate_limit_rad_s: float = parameter(
        description="largest rate the drive accepts", low=1e-6, high=10.0
    )
    acceleration_limit_rad_s2: float = parameter(
        description="largest acceleration the motors can give", low=1e-6, high=100.0
    )
    brake_torque_n_m: float = parameter(
        description="holding torque of the brakes", low=0.0, high=1e10
    )
    travel_min_rad: float = parameter(description="lower hard stop", low=-50.0, high=50.0)
    travel_max_rad: float = parameter(description="upper hard stop", low=-50.0, high=50.0)
    encoder_bits: int = parameter(description="encoder resolution per turn", low=8, high=40)
    encoder_noise_rad: float = parameter(
        description="rms noise of one encoder reading", low=0.0, high=0.01
    )

    ordered = ("travel_min_rad < travel_max_rad",)

    def check_together(self) -> None:
        """Refuse unequal mode lists."""
        count = len(self.mode_frequency_hz)
        for name in ("mode_damping", "mode_encoder_residue", "mode_beam_residue"):
            if len(getattr(self, name)) != count:
                raise ValueError(
                    f"{name} has {len(getattr(self, name))} values, mode_frequency_hz has {count}"
                )
        if count == 0:
            raise ValueError("mode_frequency_hz has 0 values, must have at least 1")

    @property
    def drive_bandwidth_rad_s(self) -> float:
        """Bandwidth of the rate loop, proportional to the amplifier gain."""
        return 2.0 * math.pi * self.amplifier_gain * self.drive_bandwidth_per_gain_hz

    @property
    def gear_frequency_rad_s(self) -> float:
        """Frequency of the axis inertia on the gear stiffness with the motors held."""
        return math.sqrt(self.gear_stiffness_n_m / self.inertia_kg_m2)


@dataclass(frozen=True, kw_only=True)
class PlantParams(Params):
    """Both axes and what couples them; the bending mode is the first mode of the elevation axis."""

    azimuth: AxisParams = parameter(description="azimuth axis")
    elevation: AxisParams = parameter(description="elevation axis")
    pinion_angle_rad: float = parameter(
        description="place of the elevation pinion, 0 pushes horizontally", low=0.0, high=1.6
    )
    pinion_floor: float = parameter(
        description="share of the bending mode that a vertical push still excites",
        low=0.0,
        high=1.0,
    )
    azimuth_to_bending: float = parameter(
        description="excitation of the bending mode by azimuth, relative to elevation",
        low=-1.0,
        high=1.0,
    )
    azimuth_modes_in_elevation: tuple[float, ...] = parameter(
        description="residues of the azimuth modes in encoder and beam of elevation",
        low=-1.0,
        high=1.0,
    )
    elevation_modes_in_azimuth: tuple[float, ...] = parameter(
        description="residues of the elevation modes in encoder and beam of azimuth",
        low=-1.0,
        high=1.0,
    )
    cross_mode_frequency_hz: float = parameter(
        description="mode that azimuth excites and only elevation shows", low=1e-3, high=200.0
    )
    cross_mode_damping: float = parameter(description="its damping ratio", low=1e-5, high=0.999)
    cross_mode_residue: float = parameter(
        description="its residue in both elevation outputs", low=-10.0, high=10.0
    )
    substep_s: float = parameter(
        description="longest internal integration step", low=1e-5, high=0.05
    )

    def check_together(self) -> None:
        """Refuse what is not an axis, and cross residues that do not match its modes."""
        for name, other in (("azimuth", "elevation"), ("elevation", "azimuth")):
            axis, cross = getattr(self, name), f"{name}_modes_in_{other}"
            if not isinstance(axis, AxisParams):
                raise ValueError(f"{name}={axis!r} must be AxisParams")
            if len(getattr(self, cross)) != len(axis.mode_frequency_hz):
                raise ValueError(
                    f"{cross} has {len(getattr(self, cross))} values, {name} has {len(axis.mode_frequency_hz)} modes"
                )
