"""From accuracy requirements to radiated power (PI83 chapter 8).

requirement -> sigma of a two-way range -> sigma of phase -> power ratio -> power, for carrier-frequency tracking
(CFT: range from the carrier's own phase) and difference-frequency tracking (DFT: from the widest difference).
"""

import math
from dataclasses import dataclass

from rf_pointing.array_sensors.arrays.interferometer.ambiguity_probability import required_ratio
from rf_pointing.array_sensors.arrays.interferometer.sensitivity import direction_variance
from rf_pointing.array_sensors.arrays.interferometer.variant import CORRECTED, is_published
from rf_pointing.core import Params, parameter, require_between

__all__ = [
    "Requirements",
    "SystemDesign",
    "amplitude_ripple_db",
    "carrier_tracking_design",
    "difference_tracking_design",
    "direction_requirement_m",
    "largest_phase_bias_rad",
    "minimum_difference_hz",
    "phase_sigma_rad",
    "range_requirement_m",
    "roll_requirement_snr",
]


@dataclass(frozen=True, kw_only=True)
class Requirements(Params):
    """One-sigma requirements of PI83 section 8 (its Table 1-1 divided by three)."""

    range_sigma_m: float = parameter(0.01 / 3.0, "distance at the shortest range of 1 m", low=1e-9, high=1e3)
    direction_sigma_rad: float = parameter(0.01 / 3.0, "direction", low=1e-9, high=1.0)
    roll_sigma_rad: float = parameter(0.01, "relative roll", low=1e-9, high=1.0)
    half_cone_rad: float = parameter(math.radians(45.0), "largest angle off boresight", low=0.0, high=1.5)
    radius_m: float = parameter(1.0, "array radius", low=1e-3, high=100.0)
    roll_variance: float = parameter(2.0, "largest V_psi^2 in the cone", low=0.5, high=100.0)
    error_probability: float = parameter(0.001, "wrong cycle in any step", low=1e-12, high=0.5)


@dataclass(frozen=True, slots=True, kw_only=True)
class SystemDesign:
    """The chain's numbers; power ratios `snr_` are those of each link."""

    range_sigma_from_range_m: float
    range_sigma_m: float
    wavelength_m: float
    phase_sigma_rad: float
    snr_direction: float
    snr_roll: float
    snr_ambiguity: float
    ripple_db: float
    phase_bias_rad: float

    @property
    def snr_required(self) -> float:
        """The largest of the three power ratios."""
        return max(self.snr_direction, self.snr_roll, self.snr_ambiguity)


def minimum_difference_hz(range_m: float, ratio: float, speed_of_light_m_s: float = 3.0e8) -> tuple[float, float]:
    """Return f_min that resolves the two-way length of `range_m`, and f0 with room for noise (eqs. 8-1, 8-2)."""
    require_between("range_m", range_m, 1e-3, None)
    require_between("ratio", ratio, 1.001, None)
    lowest = speed_of_light_m_s / (2.0 * range_m)
    return lowest, lowest * (ratio - 1.0) / ratio


def range_requirement_m(requirements: Requirements, variant: str = CORRECTED) -> float:
    """Return the sigma of one two-way range that the distance requirement allows (PI83 eqs. 8-4, 8-5).

    "published" reaches its 0.1095 m with the slipped decimal of 1/36 and without squaring sigma; "corrected" is six
    times the requirement (independent noise in the nine ranges).
    """
    if is_published(variant):
        return math.sqrt(requirements.range_sigma_m / 0.278)
    return 6.0 * requirements.range_sigma_m


def direction_requirement_m(requirements: Requirements, variant: str = CORRECTED) -> float:
    """Return the sigma of one two-way range that the direction requirement allows (PI83 eqs. 8-6, 8-7)."""
    sensitivity = direction_variance(requirements.half_cone_rad, requirements.radius_m, variant)
    return requirements.direction_sigma_rad / math.sqrt(sensitivity)


def phase_sigma_rad(range_sigma_m: float, wavelength_m: float) -> float:
    """Return the phase sigma of a two-way range sigma (PI83 eq. 8-10)."""
    return 2.0 * math.pi * range_sigma_m / wavelength_m


def roll_requirement_snr(requirements: Requirements) -> float:
    """Return the power ratio that the roll requirement asks for (PI83 eqs. 8-12, 8-13)."""
    amplitude_sigma = requirements.roll_sigma_rad / math.sqrt(requirements.roll_variance)
    return 1.0 / (2.0 * amplitude_sigma**2)


def amplitude_ripple_db(requirements: Requirements) -> float:
    """Return the pattern ripple that equals the allowed amplitude noise (PI83 eq. 8-14)."""
    return 20.0 * math.log10(1.0 + requirements.roll_sigma_rad / math.sqrt(requirements.roll_variance))


def largest_phase_bias_rad(ratio: float) -> float:
    """Return the unknown hardware phase that still resolves cycles, pi/(nu + 1) (PI83 eqs. 8-15, 8-16)."""
    require_between("ratio", ratio, 1.0, None)
    return math.pi / (ratio + 1.0)


def carrier_tracking_design(
    requirements: Requirements,
    forward_hz: float = 3.0e9,
    return_hz: float = 2.0e9,
    ratio: float = 6.0,
    steps: int = 8,
    variant: str = CORRECTED,
    speed_of_light_m_s: float = 3.0e8,
) -> SystemDesign:
    """Return the CFT design: the phase error is that of both links together (PI83 section 8.1)."""
    wavelength = 2.0 * speed_of_light_m_s / (forward_hz + return_hz)
    return _design(requirements, wavelength, 1.0, ratio, steps, variant)


def difference_tracking_design(
    requirements: Requirements,
    largest_difference_hz: float = 100e6,
    ratio: float = 4.888,
    steps: int = 7,
    variant: str = CORRECTED,
    speed_of_light_m_s: float = 3.0e8,
) -> SystemDesign:
    """Return the DFT design: two phases are differenced, so twice the power ratio (PI83 section 8.2)."""
    return _design(requirements, speed_of_light_m_s / largest_difference_hz, 2.0, ratio, steps, variant)


def _design(
    requirements: Requirements, wavelength_m: float, phases: float, ratio: float, steps: int, variant: str
) -> SystemDesign:
    range_sigma = direction_requirement_m(requirements, variant)
    phase_sigma = phase_sigma_rad(range_sigma, wavelength_m)
    return SystemDesign(
        range_sigma_from_range_m=range_requirement_m(requirements, variant),
        range_sigma_m=range_sigma,
        wavelength_m=wavelength_m,
        phase_sigma_rad=phase_sigma,
        snr_direction=phases / phase_sigma**2,
        snr_roll=roll_requirement_snr(requirements),
        snr_ambiguity=required_ratio(ratio, requirements.error_probability / steps),
        ripple_db=amplitude_ripple_db(requirements),
        phase_bias_rad=largest_phase_bias_rad(ratio),
    )
