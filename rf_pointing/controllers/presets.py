"""Gains for the DSS-13 antenna: the published ones, and the ones tuned for wind on the same plant.

The tuned set keeps the published structure and changes numbers only: faster loops, each behind a wide notch placed
beside its axis' first mode (above it in elevation), so that the sensitivity peak stays below 2 with the modes 10 % and
the residues 30 % off.  Tuning: benchmarks/servo_tuning.py; what it buys: docs/math/controllers.md.
"""

import math

from rf_pointing.controllers.position_loop import PositionLoopParams
from rf_pointing.geometry import require_choice

__all__ = ["TUNED_RADIO_BANDWIDTH_HZ", "dss13_loops"]

TUNED_RADIO_BANDWIDTH_HZ = 0.05
"""Bandwidth f_m of the radio integrator that the tuned loops were designed together with."""

_DRIVE_LAG_S = 1.0 / 20.0 + 0.01
_PUBLISHED = {"proportional_gain": 0.5, "integral_gain": 1.8, "notch_frequency_hz": 2.12, "notch_damping": 0.2}
_TUNED = (
    {"proportional_gain": 4.67, "integral_gain": 7.02, "notch_frequency_hz": 1.522, "notch_damping": 0.115},
    {"proportional_gain": 4.23, "integral_gain": 6.01, "notch_frequency_hz": 2.235, "notch_damping": 0.466},
)


def dss13_loops(gains: str) -> tuple[PositionLoopParams, PositionLoopParams]:
    """Return the position loops (azimuth, elevation) with "published" or "tuned" gains."""
    require_choice("gains", gains, ("published", "tuned"))
    if gains == "published":
        published = PositionLoopParams(**_PUBLISHED)
        return published, published
    azimuth, elevation = (PositionLoopParams(**values, feedforward_lead_s=_lead_s(values)) for values in _TUNED)
    return azimuth, elevation


def _lead_s(values: dict[str, float]) -> float:
    """Return the lag that the fed-forward rate meets: drive, half a sample, feedforward band, notch."""
    notch_s = values["notch_damping"] / (math.pi * values["notch_frequency_hz"])
    return _DRIVE_LAG_S + 1.0 / (2.0 * math.pi * 10.0) + notch_s
