"""The last guard of the control unit: what moves towards a hill is stopped, what rests is left alone."""

import math

import pytest

from rf_pointing.controllers import CommandPreprocessorParams
from rf_pointing.planning import HorizonMask
from rf_pointing.station.antenna.safety import AntennaSafety, SafetyParams

DEG = math.pi / 180.0
TICK_S = 0.02
HILL = HorizonMask(
    azimuth_rad=(0.0, 1.0, 1.1, 2.0, 2.1),
    elevation_rad=(0.0, 0.0, 20.0 * DEG, 20.0 * DEG, 0.0),
    clearance_rad=0.1 * DEG,
)


@pytest.mark.parametrize(
    ("elevation_deg", "rate_deg_s", "stopped"),
    [(20.3, -1.0, True), (20.3, 1.0, False), (40.0, -1.0, False), (20.3, 0.0, False), (10.0, 0.0, False)],
    ids=["towards the hill", "away from it", "far above it", "at rest above it", "at rest inside it"],
)
def test_only_a_motion_that_cannot_stop_above_the_hill_is_stopped(
    elevation_deg: float, rate_deg_s: float, stopped: bool
) -> None:
    """At 1 deg/s the axes come to rest after 0.63 deg."""
    safety = AntennaSafety(SafetyParams(mask=HILL), CommandPreprocessorParams(), TICK_S)
    reason = safety.guard("track", 1e9, (1.5, elevation_deg * DEG), (0.0, rate_deg_s * DEG))
    assert ("below the horizon mask" in reason) is stopped
    assert bool(reason) is stopped
