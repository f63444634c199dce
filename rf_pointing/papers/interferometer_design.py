"""Design of the interferometer: from requirements to carriers and powers (PI83 chapters 7, 8).

requirement -> sigma of a two-way range -> sigma of phase -> power ratio -> power, for
carrier-frequency tracking (CFT: range from the carrier's own phase) and difference-frequency
tracking (DFT: from the widest difference).

Wrong cycles limit the power ratio R of each link.  The error of the unrounded lane has variance
(nu^2 - nu + 1)/(2 pi^2 R) and is wrong beyond half a lane, p = 1 - erf(1/(2 sqrt(2) sigma)) (eqs.
7-26 to 7-34).  Tables: cycle errors (7-1), carriers against power ratio (8-1), powers (8-2, 8-3).
"""

import math
from dataclasses import dataclass
from statistics import NormalDist

from rf_pointing.array_sensors.interferometer.radio import LinkParams, required_power_w
from rf_pointing.array_sensors.interferometer.variant import CORRECTED, is_published
from rf_pointing.core import Params, parameter, require_between, require_choice
from rf_pointing.papers.interferometer_accuracy import direction_variance

STEPS = ("difference", "carrier")
SYSTEMS = ("CFT", "DFT")
# Resolves the two-way length of 100 km, eq. (8-1).
_LOWEST_HZ = 1500.0
_HIGHEST_HZ = {"CFT": 2.5e9, "DFT": 100e6}
# Below 10 dB per phase the Gaussian model of (7-3) does not hold; DFT differences two phases.
_FLOOR_DB = {"CFT": 10.0, "DFT": 10.0 + 10.0 * math.log10(2.0)}
SOLVER_LIMIT_DB = 110.0
"""Where the author's iteration stopped: Table 8-1 prints it for two carriers."""


def lane_sigma(cycle_ratio: float, snr: float, step: str = "difference") -> float:
    """Return the standard deviation of the unrounded lane number, in lanes (PI83 eq. 7-30).

    `step` "difference": from one difference to the next; "carrier": from the finest difference to
    the carrier itself, which the report treats alike but which is (2 nu^2 + 2 nu + 1)/(4 pi^2 R),
    1.37 dB worse at nu = 6.
    """
    require_choice("step", step, STEPS)
    require_between("cycle_ratio", cycle_ratio, 1.0, None)
    require_between("snr", snr, 1e-30, None)
    if step == "carrier":
        # The last step compares a difference with a carrier, which has no common carrier to cancel.
        return math.sqrt(
            (2.0 * cycle_ratio**2 + 2.0 * cycle_ratio + 1.0) / (4.0 * math.pi**2 * snr)
        )
    return math.sqrt((cycle_ratio**2 - cycle_ratio + 1.0) / (2.0 * math.pi**2 * snr))


def step_error_probability(cycle_ratio: float, snr: float, step: str = "difference") -> float:
    """Return the probability p_ei of a wrong lane in one step (PI83 eq. 7-33)."""
    return math.erfc(1.0 / (2.0 * math.sqrt(2.0) * lane_sigma(cycle_ratio, snr, step)))


def required_ratio(cycle_ratio: float, probability: float, step: str = "difference") -> float:
    """Return the power ratio R at which one step errs with `probability`.

    Inverse of `step_error_probability`.
    """
    require_between("probability", probability, 1e-15, 1.0 - 1e-12)
    # Half a lane in units of the sigma that is exceeded with this probability, on both sides.
    allowed = 0.5 / -NormalDist().inv_cdf(0.5 * probability)
    return (lane_sigma(cycle_ratio, 1.0, step) / allowed) ** 2


@dataclass(frozen=True, kw_only=True)
class Requirements(Params):
    """One-sigma requirements of PI83 section 8 (its Table 1-1 divided by three)."""

    range_sigma_m: float = parameter(
        0.01 / 3.0, "distance at the shortest range of 1 m", low=1e-9, high=1e3
    )
    direction_sigma_rad: float = parameter(0.01 / 3.0, "direction", low=1e-9, high=1.0)
    roll_sigma_rad: float = parameter(0.01, "relative roll", low=1e-9, high=1.0)
    half_cone_rad: float = parameter(
        math.radians(45.0), "largest angle off boresight", low=0.0, high=1.5
    )
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


def minimum_difference_hz(
    range_m: float, ratio: float, speed_of_light_m_s: float = 3.0e8
) -> tuple[float, float]:
    """Return f_min that resolves the two-way length of `range_m`, and f0 with room for noise (eqs.
    8-1, 8-2).
    """
    require_between("range_m", range_m, 1e-3, None)
    require_between("ratio", ratio, 1.001, None)
    lowest = speed_of_light_m_s / (2.0 * range_m)
    # f0 below f_min leaves one part in nu of the coarsest cycle for noise at both ends.
    return lowest, lowest * (ratio - 1.0) / ratio


def range_requirement_m(requirements: Requirements, variant: str = CORRECTED) -> float:
    """Return the sigma of one two-way range that the distance requirement allows (PI83 eqs. 8-4,
    8-5).

    "published" reaches its 0.1095 m with the slipped decimal of 1/36 and without squaring sigma;
    "corrected" is six times the requirement (independent noise in the nine ranges).
    """
    if is_published(variant):
        # The printed route: decimal point of 1/36 slipped, sigma not squared.
        return math.sqrt(requirements.range_sigma_m / 0.278)
    return 6.0 * requirements.range_sigma_m


def direction_requirement_m(requirements: Requirements, variant: str = CORRECTED) -> float:
    """Return the sigma of one two-way range that the direction requirement allows (PI83 eqs. 8-6,
    8-7).
    """
    sensitivity = direction_variance(requirements.half_cone_rad, requirements.radius_m, variant)
    return requirements.direction_sigma_rad / math.sqrt(sensitivity)


def phase_sigma_rad(range_sigma_m: float, wavelength_m: float) -> float:
    """Return the phase sigma of a two-way range sigma (PI83 eq. 8-10)."""
    return 2.0 * math.pi * range_sigma_m / wavelength_m


def roll_requirement_snr(requirements: Requirements) -> float:
    """Return the power ratio that meets the roll requirement (PI83 eqs. 8-12, 8-13)."""
    # Largest coupling one: its amplitude noise is relative to the carrier.
    amplitude_sigma = requirements.roll_sigma_rad / math.sqrt(requirements.roll_variance)
    return 1.0 / (2.0 * amplitude_sigma**2)


def amplitude_ripple_db(requirements: Requirements) -> float:
    """Return the pattern ripple that equals the allowed amplitude noise (PI83 eq. 8-14)."""
    return 20.0 * math.log10(
        1.0 + requirements.roll_sigma_rad / math.sqrt(requirements.roll_variance)
    )


def largest_phase_bias_rad(ratio: float) -> float:
    """Return the unknown hardware phase that still resolves cycles, pi/(nu + 1) (PI83 eqs. 8-15,
    8-16).
    """
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
    """Return the DFT design: two phases are differenced, so twice the power ratio (PI83 section
    8.2).
    """
    return _design(
        requirements, speed_of_light_m_s / largest_difference_hz, 2.0, ratio, steps, variant
    )


def _design(
    requirements: Requirements,
    wavelength_m: float,
    phases: float,
    ratio: float,
    steps: int,
    variant: str,
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


@dataclass(frozen=True, slots=True, kw_only=True)
class CarrierCountRow:
    """A row of Table 8-1: cycles per step and the power ratio of each link for K carriers."""

    carriers: int
    step_probability: float
    ratio: float
    snr_db: float


def carrier_count_row(
    carriers: int, system: str, total_probability: float = 0.001, variant: str = CORRECTED
) -> CarrierCountRow:
    """Return the row of Table 8-1 for K carriers of the "CFT" or "DFT" system.

    "published": K - 1 steps for both systems, the ratio limited to 110 dB, where the author's
    iteration stopped. "corrected": DFT climbs from difference to difference in K - 2 steps (K >=
    3), no limit.  DFT needs 3.01 dB more because two phases are differenced; neither goes below 10
    dB per phase, the model's own assumption.
    """
    require_choice("system", system, SYSTEMS)
    published = is_published(variant)
    # K carriers have K - 1 differences and K - 2 steps between them; the report counts one too many
    # for DFT.
    steps = carriers - (1 if published or system == "CFT" else 2)
    require_between("carriers", carriers, 2 if steps >= carriers - 1 else 3, None)
    ratio = frequency_ratio(_HIGHEST_HZ[system], _LOWEST_HZ, steps)
    probability = total_probability / steps
    doubling = 2.0 if system == "DFT" else 1.0
    snr_db = max(
        10.0 * math.log10(doubling * required_ratio(ratio, probability)), _FLOOR_DB[system]
    )
    if published:
        snr_db = min(snr_db, SOLVER_LIMIT_DB)
    return CarrierCountRow(
        carriers=carriers, step_probability=probability, ratio=ratio, snr_db=snr_db
    )


def link_powers_w(
    snr_db: float, range_m: float, forward_hz: float, return_hz: float, link: LinkParams
) -> tuple[float, float]:
    """Return the radiated powers of forward and return link (PI83 Tables 8-2, 8-3)."""
    snr = 10.0 ** (0.1 * snr_db)
    forward, back = (
        required_power_w(snr, range_m, frequency, link) for frequency in (forward_hz, return_hz)
    )
    return float(forward), float(back)


def frequency_ratio(highest_hz: float, lowest_hz: float, steps: int) -> float:
    """Return nu that climbs from the lowest to the highest difference in `steps` equal ratios
    (Table 8-1).
    """
    require_between("steps", steps, 1, None)
    require_between("lowest_hz", lowest_hz, 1e-6, highest_hz)
    return float((highest_hz / lowest_hz) ** (1.0 / steps))
