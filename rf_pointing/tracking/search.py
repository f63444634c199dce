"""Searches around where the target should be: an Archimedean spiral, or strips along the track.

Spiral: rho = b phi with pitch 2 pi b = 0.6 beamwidths.  It ends half a pitch outside `sigmas` times
the ephemeris uncertainty, so every direction within that radius comes within half a pitch, 0.3
beamwidths, of the beam's axis.

Strips: for an ephemeris that is mostly early or late, the likeliest strip first.  Legs run from
rest to rest: out and back along the track, one pitch to the left, back, two to the right, and so
on; then back to the middle and again.
"""

import math
from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import accumulate, pairwise

import numpy as np

from rf_pointing.core import MDEG, Array, BandNumbers, Pair, Params, Rows, parameter, rounded, tuned
from rf_pointing.tracking.scan import Offset

# Newton's method for the angle of a length begins no more than 1/250 of a turn away: its error,
# squared by every step, is below the rounding after three.
POINTS_PER_TURN = 256
NEWTON_STEPS = 4


@dataclass(frozen=True, kw_only=True)
class SpiralParams(Params):
    """Size and speed of the search."""

    half_power_beamwidth_rad: float = parameter(65.0 * MDEG, "half-power beamwidth", 1e-6, 1.4)
    uncertainty_rad: float = parameter(65.0 * MDEG, "standard deviation of the target's direction", 1e-7, 0.2)
    sigmas: float = parameter(3.0, "radius of the search in standard deviations", 0.5, 10.0)
    pitch_beamwidths: float = parameter(0.6, "distance between turns in beamwidths", 0.05, 1.0)
    rate_rad_s: float = parameter(150.0 * MDEG, "largest speed along the spiral", 1e-7, 0.2)
    acceleration_rad_s2: float = parameter(350.0 * MDEG, "largest acceleration", 1e-7, 1.0)

    def check_together(self) -> None:
        """Refuse a search that would take more turns than a pass has time for."""
        if self.turns > 200.0:
            raise ValueError(
                f"uncertainty_rad={self.uncertainty_rad} needs {self.turns:.0f} turns of the spiral, must be <= 200"
            )

    @property
    def radius_rad(self) -> float:
        """Radius that is searched completely."""
        return self.sigmas * self.uncertainty_rad

    @property
    def turns(self) -> float:
        """Turns until every direction within the radius was passed."""
        return self.radius_rad / (self.pitch_beamwidths * self.half_power_beamwidth_rad) + 0.5


def spiral_of_band(of: BandNumbers) -> Rows:
    """Return the rows of `SpiralParams` for the beam and the rates of a band."""
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


class SpiralSearch:
    """The spiral over time: outwards from rest to rest, back on the same path, and again."""

    def __init__(self, params: SpiralParams) -> None:
        self.params = params
        self._b = params.pitch_beamwidths * params.half_power_beamwidth_rad / (2.0 * math.pi)
        phi = np.linspace(0.0, 2.0 * math.pi * params.turns, math.ceil(params.turns * POINTS_PER_TURN))
        self._length = 0.5 * self._b * (phi * np.hypot(1.0, phi) + np.arcsinh(phi))
        self._phi = phi
        self._speed = self._speed_at(phi)
        # Constant acceleration from point to point: the mean speed is then exact, also from and to
        # rest.
        steps = 2.0 * np.diff(self._length) / (self._speed[1:] + self._speed[:-1])
        self._time = np.concatenate([[0.0], np.cumsum(steps)])

    @property
    def duration_s(self) -> float:
        """Time until the spiral has passed everything once."""
        return float(self._time[-1])

    def offset(self, t_since_start_s: float) -> Offset:
        """Return the offset from the expected direction and its rates; at rest before the start."""
        cycle = max(t_since_start_s, 0.0) % (2.0 * self.duration_s)
        outward = cycle <= self.duration_s
        x, y, x_rate, y_rate = self._outward(cycle if outward else 2.0 * self.duration_s - cycle)
        return Offset(x, y, x_rate, y_rate) if outward else Offset(x, y, -x_rate, -y_rate)

    def _outward(self, t: float) -> tuple[float, float, float, float]:
        i = min(int(np.searchsorted(self._time, t, side="right")) - 1, len(self._time) - 2)
        slope = (self._speed[i + 1] - self._speed[i]) / (self._time[i + 1] - self._time[i])
        elapsed = t - self._time[i]
        length = float(self._length[i] + self._speed[i] * elapsed + 0.5 * slope * elapsed**2)
        speed = float(self._speed[i] + slope * elapsed)
        phi = self._phi_at(length, float(self._phi[i]))
        tangent = math.hypot(1.0, phi)
        cosine, sine = math.cos(phi), math.sin(phi)
        return (
            self._b * phi * cosine, self._b * phi * sine, speed * (cosine - phi * sine) / tangent,
            speed * (sine + phi * cosine) / tangent,
        )  # fmt: skip

    def _phi_at(self, length: float, start: float) -> float:
        phi = start
        for _ in range(NEWTON_STEPS):
            phi -= (0.5 * (phi * math.hypot(1.0, phi) + math.asinh(phi)) - length / self._b) / math.hypot(1.0, phi)
        return max(phi, 0.0)

    def _speed_at(self, phi: Array) -> Array:
        # Half of the acceleration, in the sense of squares, for the curve and half for the speed.
        share = self.params.acceleration_rad_s2 / math.sqrt(2.0)
        curvature_radius = self._b * (1.0 + phi**2) ** 1.5 / (2.0 + phi**2)
        to_end = self._length[-1] - self._length
        limits = [np.full_like(phi, self.params.rate_rad_s), np.sqrt(share * curvature_radius),
                  np.sqrt(2.0 * share * self._length), np.sqrt(2.0 * share * to_end)]  # fmt: skip
        return np.asarray(np.min(limits, axis=0))


class Legs:
    """Straight legs from rest to rest, each a trapezoid of speed, with a rest at the end of each.

    `corners` (n) are the ends of the legs; `rates_rad_s` and `rests_s` (n - 1) belong to one each.
    """

    def __init__(
        self, corners: Sequence[Pair], rates_rad_s: Sequence[float], acceleration_rad_s2: float,
        rests_s: Sequence[float] | None = None,
    ) -> None:  # fmt: skip
        self._rates, self._acceleration = rates_rad_s, acceleration_rad_s2
        self._legs = list(pairwise(corners))
        ways = [self._leg_time_s(leg) for leg in range(len(self._legs))]
        rests = rests_s or [0.0] * len(ways)
        self._starts = [0.0, *accumulate(map(sum, zip(ways, rests, strict=True)))]

    @property
    def duration_s(self) -> float:
        """Time until the last rest is over."""
        return self._starts[-1]

    def at(self, t_s: float) -> Offset:
        """Return place and rates `t_s` after the start, those of the ends outside of it."""
        within_s = min(max(t_s, 0.0), math.nextafter(self.duration_s, 0.0))
        leg = bisect_right(self._starts, within_s) - 1
        (x0, y0), (x1, y1) = self._legs[leg]
        if not (length := math.hypot(x1 - x0, y1 - y0)):
            return Offset(x0, y0, 0.0, 0.0)
        way, speed = self._way(within_s - self._starts[leg], leg, length)
        cosine, sine = (x1 - x0) / length, (y1 - y0) / length
        return Offset(x0 + way * cosine, y0 + way * sine, speed * cosine, speed * sine)

    def _peak_rad_s(self, leg: int, length: float) -> float:
        return min(self._rates[leg], math.sqrt(self._acceleration * length))

    def _leg_time_s(self, leg: int) -> float:
        if not (length := math.dist(*self._legs[leg])):
            return 0.0
        peak = self._peak_rad_s(leg, length)
        return length / peak + peak / self._acceleration

    def _way(self, t: float, leg: int, length: float) -> Pair:
        """Return distance and speed on a leg after `t`: a trapezoid of speed, then rest."""
        peak = self._peak_rad_s(leg, length)
        ramp_s, total_s = peak / self._acceleration, self._leg_time_s(leg)
        if t < ramp_s:
            return 0.5 * self._acceleration * t**2, self._acceleration * t
        if t > total_s - ramp_s:
            left_s = max(total_s - t, 0.0)
            return length - 0.5 * self._acceleration * left_s**2, self._acceleration * left_s
        return peak * (t - 0.5 * ramp_s), peak


class StripSearch:
    """Covers +-`half_length_rad` along the track and +-`half_width_rad` across it in strips."""

    def __init__(
        self, half_length_rad: float, half_width_rad: float, pitch_rad: float, rate_rad_s: float,
        acceleration_rad_s2: float,
    ) -> None:  # fmt: skip
        corners = _corners(half_length_rad, math.ceil(max(half_width_rad / pitch_rad - 0.5, 0.0)), pitch_rad)
        self._legs = Legs(corners, [rate_rad_s] * (len(corners) - 1), acceleration_rad_s2)

    @property
    def duration_s(self) -> float:
        """Time until everything was passed once and the beam is back in the middle."""
        return self._legs.duration_s

    def offset(self, t_since_start_s: float) -> Offset:
        """Return the offset along and left of the track, with rates; at rest before the start."""
        return self._legs.at(max(t_since_start_s, 0.0) % self.duration_s)


def _corners(half_length: float, strips: int, pitch: float) -> list[Pair]:
    """Return the ends of the legs, the first strip through the middle."""
    corners, end = [(0.0, 0.0), (half_length, 0.0), (-half_length, 0.0)], -half_length
    for index in range(1, strips + 1):
        for left in (index * pitch, -index * pitch):
            corners += [(end, left), (-end, left)]
            end = -end
    return [*corners, (0.0, 0.0)]
