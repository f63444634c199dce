"""Accuracy of a conical scan in closed form (CONSCAN eqs. 1-6, 23-25), and its design.

h is the half-power beamwidth, r the scan radius, mu = 4 ln 2; n samples per period; sigma_p/P the
relative standard deviation of one carrier power sample; C/N0 in dB-Hz for the beam on the target.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

from rf_pointing.core import MDEG, MU, BandNumbers, Params, Rows, Value, parameter, rounded, tuned
from rf_pointing.tracking.conscan_estimate import ConscanParams
from rf_pointing.tracking.scan import SCAN_RADIUS

FEWEST_SAMPLES = 4
# Rounding of a number of samples that should be whole.
ROUNDING = 1e-9
# Halvings of a radius: 2^-60 is below the rounding of a float.
BISECTIONS = 60


def conscan_slope(half_power_beamwidth_rad: float, radius_rad: float) -> float:
    """Return k_s = 2 r mu / h (eq. 6): relative power modulation per beamwidth of error."""
    return 2.0 * radius_rad * MU / half_power_beamwidth_rad


def conscan_loss(half_power_beamwidth_rad: float, offset_rad: float) -> float:
    """Return exp(-mu offset^2 / h^2): L1 at the scan radius, L2 at the pointing error."""
    return math.exp(-MU * (offset_rad / half_power_beamwidth_rad) ** 2)


def conscan_sigma_eq25_rad(
    half_power_beamwidth_rad: float, radius_rad: float, samples: int, carrier_to_noise_db_hz: float,
    integration_s: float = 1.0,
) -> float:  # fmt: skip
    """Return the sigma per axis for the Block V receiver (eq. 25, there with 1 s)."""
    relative = math.sqrt(2.0 / (10.0 ** (carrier_to_noise_db_hz / 10.0) * integration_s))
    relative /= conscan_loss(half_power_beamwidth_rad, radius_rad)
    slope = conscan_slope(half_power_beamwidth_rad, radius_rad)
    return half_power_beamwidth_rad / slope * relative * math.sqrt(2.0 / samples)


class ScanDesign(NamedTuple):
    """The scan to run, with the accuracy and loss it has."""

    radius_rad: float
    period_s: float
    samples: int
    sigma_rad: float
    loss_db: float


@dataclass(frozen=True, kw_only=True)
class ScanDesignParams(Params):
    """Limits of a scan: its cost and its duration."""

    half_power_beamwidth_rad: float = parameter(65.0 * MDEG, "half-power beamwidth", 1e-6, 1.4)
    integration_s: float = parameter(1.0, "time of one carrier power sample", 1e-3, 60.0)
    preferred_loss_db: float = parameter(0.1, "loss of the scan while it suffices", 0.001, 3.0)
    largest_loss_db: float = parameter(1.0, "loss of the scan at most", 0.001, 3.0)
    shortest_period_s: float = parameter(4.0, "shortest turn the antenna can follow", 0.1, 3600.0)
    longest_period_s: float = parameter(64.0, "longest turn", 0.1, 3600.0)

    ordered = ("preferred_loss_db <= largest_loss_db", "shortest_period_s <= longest_period_s")


def radius_for_loss_rad(half_power_beamwidth_rad: float, loss_db: float) -> float:
    """Return the scan radius that costs `loss_db` when the target is at the centre."""
    return half_power_beamwidth_rad * math.sqrt(loss_db * math.log(10.0) / (10.0 * MU))


# The scan keeps its preferred loss as long as the period allows (CONSCAN eq. 25 gives the samples
# needed).  Then the radius grows, at most to the largest loss, or to h / sqrt(2 mu), where
# r exp(-mu r^2 / h^2) and so the accuracy is best.
def design_scan(params: ScanDesignParams, carrier_to_noise_db_hz: float, wanted_sigma_rad: float) -> ScanDesign:
    """Return the scan of least loss, then least period, that reaches the sigma, or ValueError."""
    fewest = max(FEWEST_SAMPLES, math.ceil(params.shortest_period_s / params.integration_s - ROUNDING))
    most = max(fewest, math.floor(params.longest_period_s / params.integration_s + ROUNDING))
    radius = radius_for_loss_rad(params.half_power_beamwidth_rad, params.preferred_loss_db)
    one_sample = _sigma(params, radius, 4, carrier_to_noise_db_hz) * 2.0
    samples = max(fewest, math.ceil((one_sample / wanted_sigma_rad) ** 2 * (1.0 - ROUNDING)))
    if samples > most:
        samples, radius = most, _radius(params, most, carrier_to_noise_db_hz, wanted_sigma_rad)
    return ScanDesign(
        radius, samples * params.integration_s, samples,
        _sigma(params, radius, samples, carrier_to_noise_db_hz),
        -10.0 * math.log10(conscan_loss(params.half_power_beamwidth_rad, radius)),
    )  # fmt: skip


def conscan_of_band(of: BandNumbers) -> Rows:
    """Return the rows of `ConscanParams` for the beam, the rates and the receiver of a band."""
    h, sample_s = of.beamwidth_deg, of.power_period_s
    radius = rounded(SCAN_RADIUS * h, 3)
    fastest = max(
        2.0 * math.pi * radius / (0.25 * min(of.rates_deg_s)),
        2.0 * math.pi * math.sqrt(radius / (0.3 * min(of.accelerations_deg_s2))),
        12.0 * sample_s,
    )
    period_s = math.ceil(max(4.0, fastest) / sample_s - 1e-9) * sample_s
    turn = round(period_s / sample_s)
    unmodelled = max(0.001, of.step_deg / math.sqrt(12.0))
    return {
        "half_power_beamwidth_deg": of.width,
        "radius_deg": tuned(radius, "0.0912 h: 0.1 dB of loss"),
        "period_s": tuned(period_s, "4 s, longer where a quarter of the rate or 0.3 of the acceleration is reached"),
        "ramp_s": tuned(0.5 * period_s, "half a turn"),
        "window_samples": tuned(2 * turn, "two turns"),
        "fewest_samples": tuned(turn, "one turn"), "updates": tuned("sample", "a sliding window"),
        "drift": tuned(True, "the carrier changes along a pass"),
        "unmodelled_deg": tuned(unmodelled, "0.001 deg, at least the rms of an encoder step"),
        "misfit_limit": tuned(20.0, "wind and fading are not noise of the receiver"),
        "bandwidth_hz": tuned(0.4 / period_s, "0.4 / period"),
        "sample_s": Value(sample_s, "receiver.power_period_s"),
        "delay_s": Value(of.delay_s, "receiver.delay_s"),
    }  # fmt: skip


def scan_for_accuracy(
    params: ConscanParams, limits: ScanDesignParams, carrier_to_noise_db_hz: float, wanted_sigma_rad: float
) -> ConscanParams:
    """Return `params` with a scan whose windows are known to `wanted_sigma_rad` per axis.

    The window keeps its turns of the scan, the loop its share of the window; beam and sampling are
    those of `params`, the bounds of loss and period those of `limits`.  The noise is the
    receiver's, at this C/N0 or above; a drift of the power that is estimated along costs sqrt(1 -
    6/(pi turns)^2).  ValueError when it is out of reach.
    """
    window_s = params.window_samples * params.sample_s
    turns = window_s / params.period_s
    over_window = limits.replace(
        half_power_beamwidth_rad=params.half_power_beamwidth_rad, integration_s=params.sample_s,
        shortest_period_s=turns * limits.shortest_period_s, longest_period_s=turns * limits.longest_period_s,
    )  # fmt: skip
    separated = math.sqrt(1.0 - 6.0 / (math.pi * turns) ** 2) if params.drift else 1.0
    design = design_scan(over_window, carrier_to_noise_db_hz, separated * wanted_sigma_rad)
    longer = design.period_s / window_s
    return params.replace(
        radius_rad=design.radius_rad, period_s=design.period_s / turns, window_samples=design.samples,
        fewest_samples=max(FEWEST_SAMPLES, round(params.fewest_samples * longer)),
        bandwidth_hz=params.bandwidth_hz / longer,
    )  # fmt: skip


def _sigma(params: ScanDesignParams, radius_rad: float, samples: int, level_db_hz: float) -> float:
    return conscan_sigma_eq25_rad(
        params.half_power_beamwidth_rad, radius_rad, samples, level_db_hz, params.integration_s
    )


def _radius(params: ScanDesignParams, samples: int, level_db_hz: float, wanted_rad: float) -> float:
    """Return the smallest radius that reaches the accuracy with `samples`."""
    h = params.half_power_beamwidth_rad
    low = radius_for_loss_rad(h, params.preferred_loss_db)
    high = min(radius_for_loss_rad(h, params.largest_loss_db), h / math.sqrt(2.0 * MU))
    best = _sigma(params, high, samples, level_db_hz)
    if best > wanted_rad:
        raise ValueError(
            f"wanted_sigma_rad={wanted_rad:.3g} must be >= {best:.3g} at C/N0 {level_db_hz:.1f} dB-Hz within "
            f"longest_period_s={params.longest_period_s} and largest_loss_db={params.largest_loss_db}"
        )
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        if _sigma(params, middle, samples, level_db_hz) > wanted_rad:
            low = middle
        else:
            high = middle
    return high
