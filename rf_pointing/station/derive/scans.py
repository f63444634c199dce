"""Conical scan, step-track and search, scaled with the beam.

radius of the scan  r = 0.0912 h     (0.1 dB of loss, CONSCAN eq. 1)
"""

import math

from rf_pointing.station.derive.band import Band, Rows, Value, rounded, tuned

SCAN_RADIUS = 0.0912
STEP = 0.08
"""Step of step-track in beamwidths: 0.08 dB of loss."""


def conscan(of: Band) -> Rows:
    """Conical scan."""
    h, receiver = of.beamwidth_deg, of.content.receiver
    sample_s = receiver.power_period_s
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
        "fewest_samples": tuned(turn, "one turn"),
        "updates": tuned("sample", "a sliding window"),
        "drift": tuned(True, "the carrier changes along a pass"),
        "unmodelled_deg": tuned(unmodelled, "0.001 deg, at least the rms of an encoder step"),
        "misfit_limit": tuned(20.0, "wind and fading are not noise of the receiver"),
        "bandwidth_hz": tuned(0.4 / period_s, "0.4 / period"),
        "sample_s": Value(sample_s, "receiver.power_period_s"),
        "delay_s": Value(receiver.delay_s, "receiver.delay_s"),
    }


def steptrack(of: Band) -> Rows:
    """Step-track; a move is a quintic over the diagonal of the square."""
    sample_s = of.content.receiver.power_period_s
    across = math.sqrt(2.0) * STEP * of.beamwidth_deg
    rate, acceleration = min(of.rates_deg_s), min(of.accelerations_deg_s2)
    move_s = max(0.6, 1.875 * across / (0.5 * rate), math.sqrt(5.7735 * across / acceleration))
    return {
        "half_power_beamwidth_deg": of.width,
        "step_beamwidths": tuned(STEP, "0.08 of a beamwidth: 0.08 dB"),
        "dwell_s": tuned(0.7 if sample_s <= 0.1 else 7.0 * sample_s, "seven samples"),
        "move_s": tuned(move_s, "0.6 s, longer where half the rate or the acceleration is reached"),
        "samples_per_point": tuned(5, "of seven"),
        "tolerance": tuned(0.5, "half a step"),
    }


def spiral(of: Band) -> Rows:
    """The search."""
    rate, acceleration = min(of.rates_deg_s), min(of.accelerations_deg_s2)
    return {
        "half_power_beamwidth_deg": of.width,
        "uncertainty_deg": tuned(
            max(0.065, 3.0 * of.step_deg), "0.065 deg, 1 km at 900 km, at least three encoder steps"
        ),
        "rate_deg_s": tuned(
            rounded(min(2.31 * of.beamwidth_deg, rate / 6.0), 3), "2.31 h / s, at most a sixth of the rate"
        ),
        "acceleration_deg_s2": tuned(0.4375 * acceleration, "0.4375 of the commanded acceleration"),
    }
