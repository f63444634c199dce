"""The watches over drives, encoders and loops: shares of what moves, steps and scans.

A drive may be later than stated: by `LATE` times its latency before it counts as a runaway, and by
1.3 times the lag L of a loop before that counts as an oscillation.  Where the acceleration a of a
slew begins, such an axis loses (1.3 L)^2 a / 2, and then moves off at 0.3 L a until its gain
k_p <= 0.2 / L takes it back:

    at most  0.85 a L^2 + 0.3 L a / k_p = 2.4 a L^2,    counted as gross from CORNER a L^2 on
"""

import math
from collections.abc import Mapping, Sequence
from typing import Any

from rf_pointing.core import Rows, flat, rounded, tuned
from rf_pointing.drives.params import DriveParams
from rf_pointing.drives.registry import takes_positions
from rf_pointing.station.derive import axes
from rf_pointing.station.derive.band import (
    REFERENCE_M,
    STIFF_BACKLASH_DEG,
    STIFF_DRIVE_RAD_S,
    TICK_S,
    Band,
    drive_acceleration_deg_s2,
)
from rf_pointing.station.pointing.antenna_watch import AntennaWatchParams
from rf_pointing.tracking.scan import SCAN_RADIUS

WAITS = ("rotator.minimum_interval_s", "rotator.latency_s", "link.poll_period_s", "link.poll_period_s")
"""From a set point to the reading that shows its motion, for a drive that takes positions."""


LATE, CORNER = 1.5, 3.0


def takes_rates(drive: Mapping[str, Any]) -> bool:
    """Return whether a drive section names a device whose position loop this station closes."""
    kind = str(drive.get("type", "simulated"))
    return kind != "simulated" and not takes_positions(kind) and drive.get("model") != "position"


def rate_latency_s(of: Band) -> float:
    """Return the stated time from a rate to the motion; 0 for drives that do not take rates."""
    given = flat(of.content.drive).get("rotator.latency_s", DriveParams().rotator.latency_s)
    return float(given) if takes_rates(of.content.drive) else 0.0


def drive_watch(of: Band) -> Rows:
    """The watch over the drives."""
    hardest = max(map(drive_acceleration_deg_s2, of.axes))
    fastest = max(axis.rate_deg_s for axis in of.axes)
    stiff = of.structure == "stiff"
    late_s, read_s, read = rate_latency_s(of), 0.01, "10 ms of the acceleration"
    if takes_rates(of.content.drive):
        # Which period a reading of a device belongs to is known to one of its own and one of ours.
        poll_s = float(flat(of.content.drive).get("link.poll_period_s", DriveParams().link.poll_period_s))
        read_s, read = 0.01 + TICK_S + poll_s, "the acceleration in 10 ms, a tick and a poll"
    bandwidth = STIFF_DRIVE_RAD_S if stiff else 20.0 * min(1.0, REFERENCE_M / of.wind_diameter_m)
    return {
        "bandwidth_hz": tuned(bandwidth / (2.0 * math.pi), "the rate loops'"),
        "acceleration_limit_deg_s2": tuned(hardest, "the faster drive's"),
        "rate_limit_deg_s": tuned(fastest, "the faster drive's"),
        "disturbance_deg_s2": tuned(0.75 * hardest, "0.75 of the acceleration"),
        "slack_deg_s2": tuned(0.15 * hardest, "0.15 of the acceleration"),
        "gained_deg_s": tuned(read_s * hardest, read),
        "excess_deg_s": tuned(0.25 * fastest, "a quarter of the rate"),
    } | ({"delay_s": tuned(min(rounded(LATE * late_s), 1.0), "1.5 times the latency")} if late_s else {})


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


def oscillation(of: Band, lags_s: Sequence[float]) -> Rows:
    """The watch over the position loops, whose drives have these lags."""
    swing = max(0.02, 4.0 * of.step_deg, 0.6 * SCAN_RADIUS * of.beamwidth_deg)
    slew = rounded(CORNER * max(a * lag_s**2 for a, lag_s in zip(of.accelerations_deg_s2, lags_s, strict=True)))
    return {
        "threshold_deg": tuned(min(swing, 5.0), "0.02 deg, at least four steps and 0.6 of the scan radius"),
        "gross_threshold_deg": tuned(
            min(max(2.5 * swing, slew), 50.0), "2.5 times the smallest swing, at least 3 a L^2 of a slew"
        ),
        "largest_deg": tuned(
            min(max(0.5, 10.0 * swing, 2.0 * slew), 50.0),
            "0.5 deg, at least ten times the smallest swing and 6 a L^2 of a slew",
        ),
    }
