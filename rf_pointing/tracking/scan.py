"""The circle that conscan adds to the command, and what every scan of the beam must say of itself.

x = r cos(w t), y = r sin(w t), w = 2 pi / period; the radius grows smoothly over `ramp_s`, so the
command never jumps.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple, Protocol

from rf_pointing.core import MDEG, Params, parameter

# Radius of the scan in beamwidths: 0.1 dB of loss (CONSCAN eq. 1).
SCAN_RADIUS = 0.0912
# From the time since its start to an `Offset`.
Pattern = Callable[[float], tuple[float, ...]]


class Offset(NamedTuple):
    """An offset to add to the command, on the sky, with its rates."""

    cross_elevation_rad: float
    elevation_rad: float
    cross_elevation_rate_rad_s: float
    elevation_rate_rad_s: float


class LoopRate(NamedTuple):
    """How the loop follows a scan's results; `sample_s` None: as the integrator is configured."""

    bandwidth_hz: float
    sample_s: float | None = None


# A result that comes once a round moves the beam by 0.7 of itself, spread over 1 s: all at once
# would shake it.
ONCE_A_ROUND = LoopRate(0.7 / (2.0 * math.pi), 1.0)


class Scan(Protocol):
    """How a sensor moves the beam, and what the controller must know of the errors."""

    @property
    def age_s(self) -> float:
        """How long before the stamp of an error its samples lie on average."""

    @property
    def loop(self) -> LoopRate:
        """How the tracking loop follows the errors."""

    def pattern(self) -> Pattern:
        """Return the motion of the beam, from its start."""


def growth(t_s: float, ramp_s: float) -> tuple[float, float]:
    """Return the share of an amplitude that grows from 0 to 1 in `ramp_s`, and its rate.

    The quintic 10 s^3 - 15 s^4 + 6 s^5, at rest at both ends.
    """
    if t_s >= ramp_s:
        return 1.0, 0.0
    s = max(t_s, 0.0) / ramp_s
    return s**3 * (10.0 - 15.0 * s + 6.0 * s**2), 30.0 * s**2 * (1.0 - s) ** 2 / ramp_s


@dataclass(frozen=True, kw_only=True)
class ScanParams(Params):
    """Radius and period of the conical scan."""

    radius_rad: float = parameter(5.93 * MDEG, "scan radius; 0.0912 beamwidths cost 0.1 dB", 1e-8, 0.4)
    period_s: float = parameter(32.0, "time of one turn", 0.1, 3600.0)
    ramp_s: float = parameter(4.0, "time over which the radius grows from zero", 0.0, 600.0)

    def pattern(self) -> Pattern:
        """Return the circle, from its start."""
        return self.offset

    def offset(self, t_since_start_s: float) -> Offset:
        """Return the scan offset `t_since_start_s` after the start; zero before it."""
        if t_since_start_s <= 0.0:
            return Offset(0.0, 0.0, 0.0, 0.0)
        # Without a ramp the command would jump by the radius, and the axes would ring.
        share, change = growth(t_since_start_s, self.ramp_s)
        radius, radius_rate = self.radius_rad * share, self.radius_rad * change
        rate = 2.0 * math.pi / self.period_s
        cosine, sine = math.cos(rate * t_since_start_s), math.sin(rate * t_since_start_s)
        return Offset(
            radius * cosine, radius * sine, radius_rate * cosine - radius * rate * sine,
            radius_rate * sine + radius * rate * cosine,
        )  # fmt: skip


@dataclass(frozen=True)
class CircleScan:
    """The circle of a registered tracker, with the age of its errors and its loop's bandwidth."""

    circle: ScanParams
    age_s: float
    bandwidth_hz: float

    @property
    def loop(self) -> LoopRate:
        """How the tracking loop follows the errors."""
        return LoopRate(self.bandwidth_hz)

    def pattern(self) -> Pattern:
        """Return the circle, from its start."""
        return self.circle.pattern()
