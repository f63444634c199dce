"""Second stage of an antenna: a fast actuator that moves the beam a little, before a slow mount.

It is a steering mirror, a subreflector, a hexapod or a feed table.  Its deflection d is that of the
beam on the sky, to the right (cross-elevation) and up:

    beam = axes + (d_x / cos(upper axis), d_y)
"""

import math
from dataclasses import dataclass

import numpy as np

from rf_pointing.core.parameters import Params, parameter
from rf_pointing.core.types import Array

STEEPEST = 0.01
"""Cosine of the upper axis below which the lower axis no longer moves the beam to the side."""


@dataclass(frozen=True, kw_only=True)
class SecondStageParams(Params):
    """Motion of a second stage under its own controller."""

    travel_rad: float = parameter(
        0.0, "largest deflection of the beam, each way; 0: no second stage", low=0.0, high=0.1
    )
    rate_rad_s: float = parameter(
        math.radians(1.0), "largest rate of the deflection", low=1e-6, high=10.0
    )
    bandwidth_hz: float = parameter(5.0, "bandwidth (-3 dB) of its own loop", low=0.1, high=2000.0)
    latency_s: float = parameter(
        0.02, "time from a command to the begin of its motion", low=0.0, high=2.0
    )
    hand_back_s: float = parameter(
        1.0,
        "time at the end of its travel after which the mount is left alone",
        low=0.02,
        high=100.0,
    )
    lost_s: float = parameter(
        0.5, "silence of a real stage after which it is not relied on", low=0.02, high=100.0
    )
    radio_bandwidth_hz: float = parameter(
        0.2, "tracking loop that its margins are taken with", low=0.0, high=5.0
    )

    @property
    def present(self) -> bool:
        """Whether the antenna has one."""
        return self.travel_rad > 0.0


def sky_from_axes(angles_rad: Array, upper_rad: float) -> Array:
    """Return the deflection (2,) on the sky of small axis angles (2,)."""
    scale = math.cos(upper_rad)
    return np.array([angles_rad[0] * scale if abs(scale) >= STEEPEST else 0.0, angles_rad[1]])


def axes_from_sky(deflection_rad: Array, upper_rad: float) -> Array:
    """Return the small axis angles (2,) that deflect the beam as much (2,)."""
    scale = math.cos(upper_rad)
    return np.array(
        [deflection_rad[0] / scale if abs(scale) >= STEEPEST else 0.0, deflection_rad[1]]
    )
