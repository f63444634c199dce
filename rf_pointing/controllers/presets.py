"""Gains for the DSS-13 antenna: the published ones, and the ones tuned for wind on the same plant.

The tuned set keeps the published structure, PI with feedforward and notch, and adds one section to
the feedback: a narrow notch just below the first mode and zeros next to it turn the phase so that
the mode is damped rather than driven, whichever way its frequency is off, and the poles at twice
the frequency give the lead for a tenfold loop gain.  The sensitivity peaks of encoder and radio
loop stay below 2 with the modes 10 % and the residues 30 % off.  Tuning:
benchmarks/servo_tuning.py, its output next to it; what it gains: docs/math/controllers.md.
"""

import math

from rf_pointing.controllers.lqg import LqgLoopParams, load_lqg_designs
from rf_pointing.controllers.position_loop import PositionLoopParams
from rf_pointing.core import require_choice

TUNED_RADIO_BANDWIDTH_HZ = 0.2
"""Bandwidth f_m of the radio integrator that the tuned loops were designed together with."""

# Rate loop of 20 rad/s, and half of a 20-ms sample.
_DRIVE_LAG_S = 1.0 / 20.0 + 0.01
_FEEDFORWARD_LAG_S = 1.0 / (2.0 * math.pi * 10.0)
_AZIMUTH = PositionLoopParams(
    proportional_gain=7.915, integral_gain=11.59, notch_frequency_hz=1.417,
    notch_damping=0.0468, shaping_enabled=True, shaping_zero_hz=1.785,
    shaping_zero_damping=0.3905, shaping_pole_hz=3.139, shaping_pole_damping=0.6124,
)  # fmt: skip
_ELEVATION = PositionLoopParams(
    proportional_gain=6.665, integral_gain=6.383, notch_frequency_hz=2.068,
    notch_damping=0.0716, shaping_enabled=True, shaping_zero_hz=2.048,
    shaping_zero_damping=0.0152, shaping_pole_hz=3.949, shaping_pole_damping=0.5844,
)  # fmt: skip


def dss13_loops(gains: str) -> tuple[PositionLoopParams, PositionLoopParams]:
    """Return the position loops (azimuth, elevation) with "published" or "tuned" gains."""
    require_choice("gains", gains, ("published", "tuned"))
    if gains == "published":
        # The gains and the notch of BWG, the same on both axes, are the defaults.
        return PositionLoopParams(), PositionLoopParams()
    azimuth, elevation = (
        loop.replace(feedforward_lead_s=_lag_s(loop.notch_damping, loop.notch_frequency_hz))
        for loop in (_AZIMUTH, _ELEVATION)
    )
    return azimuth, elevation


def dss13_lqg_loops() -> tuple[LqgLoopParams, LqgLoopParams]:
    """Return feedforward and limits for the LQG designs of DSS-13 (azimuth, elevation)."""
    notches = [design.weights.notch for design in load_lqg_designs()]
    azimuth, elevation = (LqgLoopParams(feedforward_lead_s=_lag_s(n.pole_damping, n.pole_hz)) for n in notches)
    return azimuth, elevation


def _lag_s(notch_damping: float, notch_hz: float) -> float:
    """Return the lag of the fed-forward rate: drive, half a sample, low-pass, notch."""
    return _DRIVE_LAG_S + _FEEDFORWARD_LAG_S + notch_damping / (math.pi * notch_hz)
