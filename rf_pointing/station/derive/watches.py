"""The watches over drives, encoders and loops: shares of what moves, steps and scans."""

import math

from rf_pointing.core.derived import Rows, rounded, tuned
from rf_pointing.station.derive import axes
from rf_pointing.station.derive.band import (
    REFERENCE_M,
    STIFF_BACKLASH_DEG,
    STIFF_DRIVE_RAD_S,
    Band,
    drive_acceleration_deg_s2,
)
from rf_pointing.station.pointing.antenna_watch import AntennaWatchParams
from rf_pointing.tracking.scan import SCAN_RADIUS

WAITS = ("rotator.minimum_interval_s", "rotator.latency_s", "link.poll_period_s", "link.poll_period_s")
"""From a set point to the reading that shows its motion, for a drive that takes positions."""


def drive_watch(of: Band) -> Rows:
    """The watch over the drives."""
    hardest = max(map(drive_acceleration_deg_s2, of.axes))
    fastest = max(axis.rate_deg_s for axis in of.axes)
    stiff = of.structure == "stiff"
    bandwidth = STIFF_DRIVE_RAD_S if stiff else 20.0 * min(1.0, REFERENCE_M / of.wind_diameter_m)
    return {
        "bandwidth_hz": tuned(bandwidth / (2.0 * math.pi), "the rate loops'"),
        "acceleration_limit_deg_s2": tuned(hardest, "the faster drive's"),
        "rate_limit_deg_s": tuned(fastest, "the faster drive's"),
        "disturbance_deg_s2": tuned(0.75 * hardest, "0.75 of the acceleration"),
        "slack_deg_s2": tuned(0.15 * hardest, "0.15 of the acceleration"),
        "gained_deg_s": tuned(0.01 * hardest, "10 ms of the acceleration"),
        "excess_deg_s": tuned(0.25 * fastest, "a quarter of the rate"),
    }


def encoder_watch(of: Band) -> Rows:
    """The watch over the encoders."""
    step, usual = of.step_deg, STIFF_BACKLASH_DEG if of.structure == "stiff" else 0.003
    play = max(axis.backlash_deg or 0.0 for axis in of.axes) or usual
    return {
        "jump_deg": tuned(max(0.03, 6.0 * step), "0.03 deg, at least six encoder steps"),
        "drift_deg": tuned(max(0.03, 4.0 * step + 4.0 * play), "0.03 deg, at least four steps and four plays"),
        "frozen_deg": tuned(max(0.008, 4.0 * step + 2.0 * play), "0.008 deg, at least four steps and two plays"),
    }


def antenna_watch(of: Band) -> Rows:
    """The controller's watch over the axes."""
    reaction_s = AntennaWatchParams().reaction_s
    if of.positions:
        drive = axes.drive(of)
        reaction_s = rounded(sum(drive[name].value for name in WAITS))
    return {
        "frozen_deg": tuned(max(0.02, 4.0 * of.step_deg), "0.02 deg, at least four encoder steps"),
        "reaction_s": tuned(reaction_s, "0.3 s; a drive that takes positions: interval, latency and two polls"),
        "runaway_deg": tuned(
            min(max(0.5, 5.0 * of.step_deg, 0.25 * of.beamwidth_deg), 50.0), "0.5 deg, at least five steps and 0.25 h"
        ),
    }


def oscillation(of: Band) -> Rows:
    """The watch over the position loops."""
    swing = max(0.02, 4.0 * of.step_deg, 0.6 * SCAN_RADIUS * of.beamwidth_deg)
    return {
        "threshold_deg": tuned(min(swing, 5.0), "0.02 deg, at least four steps and 0.6 of the scan radius"),
        "gross_threshold_deg": tuned(min(2.5 * swing, 50.0), "2.5 times the smallest swing"),
        "largest_deg": tuned(
            min(max(0.5, 10.0 * swing), 50.0), "0.5 deg, at least ten times the smallest swing"
        ),
    }  # fmt: skip
