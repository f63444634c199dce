"""Scans on command: the beam is led over and around a target by a pattern, once or several times.

Lines run from rest to rest, with the given rate over the whole of +-`half_width_rad`; the beam
speeds up outside of it.  Curves begin and end on the target, and their amplitude grows and shrinks
by the quintic of the conical scan:

    circle r (cos wt, sin wt);  Lissajous r (sin 3wt, sin 4wt);  rosette r sin 5wt (cos wt, sin wt)

A line is scanned to and fro in each repetition: a time tag that is late moves the peak one way and
then the other, and is found.  The target is off the source for `baseline_s` before the first and
after every repetition.
"""

import math
from dataclasses import dataclass
from functools import cached_property
from itertools import accumulate

import numpy as np

from rf_pointing.core import LEVEL, Array, Kinematics, Pair, Params, parameter
from rf_pointing.tracking.scan import Offset, growth
from rf_pointing.tracking.search import Legs

# Largest speed of a curve in radii times turns of its slowest part, w.
CURVES = {"circle": 1.0, "lissajous": 5.0, "rosette": 5.0}
POINTS = {
    "five_point": ((0, 0), (-1, 0), (1, 0), (0, -1), (0, 1)),
    "nine_point": ((0, 0), (1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1)),
}
PATTERNS = ("cross", *POINTS, "raster", "drift", *CURVES)
# First axis of the offsets: on the sky along the horizon, of the lower axis, or to the east.
ACROSS, AZIMUTH, EAST = FRAMES = ("cross_elevation", "azimuth", "right_ascension")
SHORTEST_RAMP_S = 2.0


@dataclass(frozen=True, kw_only=True)
class ScanProgramParams(Params):
    """Pattern, size and speed of a scan."""

    pattern: str = parameter("cross", "way of the beam", choices=PATTERNS)
    frame: str = parameter(ACROSS, "axes: on the sky, of the mount, or celestial", choices=FRAMES)
    half_width_rad: float = parameter(math.radians(1.0), "to the edge", 1e-6, 0.35)
    rate_rad_s: float = parameter(math.radians(0.2), "speed while it measures", 1e-7, 0.2)
    move_rate_rad_s: float = parameter(math.radians(1.0), "between two parts", 1e-6, 0.2)
    acceleration_rad_s2: float = parameter(math.radians(0.5), "largest of all", 1e-7, 1.0)
    dwell_s: float = parameter(5.0, "time at each of the points", 0.1, 3600.0)
    lines: int = parameter(9, "lines of a raster", 3, 101)
    repetitions: int = parameter(2, "times that the pattern is run", 1, 1000)
    baseline_rad: float = parameter(0.0, "off the source, first axis (0: not)", 0.0, 0.6)
    baseline_s: float = parameter(5.0, "time off the source", 0.1, 3600.0)

    def check_together(self) -> None:
        """Refuse a baseline on the source, and a drift that is not along the celestial axis."""
        if self.baseline_rad and self.baseline_rad < self.half_width_rad:
            raise ValueError(
                f"baseline_rad={self.baseline_rad:.5f} must be 0 or >= half_width_rad={self.half_width_rad:.5f}"
            )
        if self.pattern == "drift" and self.frame != EAST:
            raise ValueError(f"frame={self.frame}: a drift is along right_ascension, as the sky is")


class ScanProgram:
    """The motion of a scan: the same for every target, from rest on it to rest on it."""

    def __init__(self, params: ScanProgramParams) -> None:
        self.params = params
        parts: list[Legs | _Curve] = []
        away = self._baseline()
        for number in range(params.repetitions):
            parts += [away] if away and not number else []
            parts += [self._repetition(number)]
            parts += [away] if away else []
        self._parts, self._starts = parts, [0.0, *accumulate(part.duration_s for part in parts)]

    @property
    def duration_s(self) -> float:
        """Time until the beam is back on the target."""
        return self._starts[-1]

    def offset(self, t_s: float) -> Offset:
        """Return offset and rates `t_s` after the start in the axes of the frame; then at rest."""
        part = int(np.searchsorted(self._starts, t_s, side="right")) - 1
        if part < 0 or part >= len(self._parts):
            return Offset(0.0, 0.0, 0.0, 0.0)
        return self._parts[part].at(t_s - self._starts[part])

    @cached_property
    def demand(self) -> Pair:
        """Largest rate and acceleration along an axis, in rad/s and rad/s^2."""
        rates = np.array([self.offset(t)[2:] for t in np.arange(0.0, self.duration_s, 0.05)])
        return float(np.abs(rates).max()), float(np.abs(np.diff(rates, axis=0)).max() / 0.05)

    def axes(self, place_rad: Array, latitude_rad: float, mount: Kinematics = LEVEL) -> Array:
        """Return what makes offsets across and along the upper axis (n, 2, 2) of the frame's.

        `place_rad` (n, 2) are the angles of the axes at the target.  Celestial offsets are east,
        multiplied by the cosine of the declination, and north; those of the mount are of its lower
        and upper axis.
        """
        turn = np.tile(np.eye(2), (len(place_rad), 1, 1))
        if self.params.frame == AZIMUTH:
            turn[:, 0, 0] = np.cos(place_rad[:, 1])
            return turn
        azimuth, elevation = mount.directions(*place_rad.T)
        if self.params.frame == EAST:
            # The way to the celestial pole, from the vertical clockwise.
            right = -np.sin(azimuth) * math.cos(latitude_rad)
            up = np.cos(elevation) * math.sin(latitude_rad)
            up -= np.sin(elevation) * math.cos(latitude_rad) * np.cos(azimuth)
            length = np.maximum(np.hypot(right, up), 1e-12)
            sine, cosine = right / length, up / length
            turn[:] = np.moveaxis(np.array([[-cosine, sine], [sine, cosine]]), 2, 0)
        return turn if mount.level else mount.across(azimuth, elevation) @ turn

    def _baseline(self) -> Legs | None:
        params, off = self.params, (self.params.baseline_rad, 0.0)
        if not off[0]:
            return None
        # On the other side as well: a slope of the sky is not taken for a step.
        corners = [(0.0, 0.0), off, (-off[0], 0.0), (0.0, 0.0)]
        rests = [0.5 * params.baseline_s] * 2 + [0.0]
        return Legs(corners, [params.move_rate_rad_s] * 3, params.acceleration_rad_s2, rests)

    def _repetition(self, number: int) -> "Legs | _Curve":
        params, r = self.params, self.params.half_width_rad
        if params.pattern in CURVES:
            return _Curve(params)
        slow, fast = params.rate_rad_s, params.move_rate_rad_s
        if params.pattern in POINTS:
            places = [(r * x, r * y) for x, y in POINTS[params.pattern]]
            # The way back the other time: a drift of the power is not taken for a direction.
            corners = [(0.0, 0.0), *(places[::-1] if number % 2 else places), (0.0, 0.0)]
            rests = [params.dwell_s] * len(places) + [0.0]
            return Legs(corners, [fast] * (len(corners) - 1), params.acceleration_rad_s2, rests)
        run_in = 0.5 * slow**2 / params.acceleration_rad_s2
        ends, lines = r + run_in, list[tuple[Pair, Pair]]()
        if params.pattern == "cross":
            right, up = (ends, 0.0), (0.0, ends)
            left, down = (-ends, 0.0), (0.0, -ends)
            lines = [(left, right), (right, left), (down, up), (up, down)]
        elif params.pattern == "drift":
            lines = [((-ends, 0.0), (ends, 0.0))]
        else:
            for line, y in enumerate(np.linspace(-r, r, params.lines).tolist()):
                side = ends if (line + number) % 2 else -ends
                lines.append(((side, y), (-side, y)))
        corners, rates = [(0.0, 0.0)], list[float]()
        for first, last in lines:
            corners += [first, last]
            rates += [fast, slow]
        return Legs([*corners, (0.0, 0.0)], [*rates, fast], params.acceleration_rad_s2)


class _Curve:
    """One turn of a curve, with the growth of its amplitude before and the shrinking after it."""

    def __init__(self, params: ScanProgramParams) -> None:
        self._pattern, self._radius = params.pattern, params.half_width_rad
        # A ramp needs 5.8 r / T^2, and the curve its own acceleration.
        self._rate = min(
            params.rate_rad_s / (CURVES[params.pattern] * self._radius),
            math.sqrt(0.5 * params.acceleration_rad_s2 / self._radius) / CURVES[params.pattern],
        )
        # The quintic alone moves the beam by up to 1.9 r / T: the curve needs its share.
        self._ramp_s = max(
            SHORTEST_RAMP_S, math.sqrt(11.6 * self._radius / params.acceleration_rad_s2),
            2.7 * self._radius / params.move_rate_rad_s,
        )  # fmt: skip
        self.duration_s = math.tau / self._rate + 2.0 * self._ramp_s

    def at(self, t_s: float) -> Offset:
        """Return offset and rates `t_s` after the start."""
        grows = t_s < 0.5 * self.duration_s
        share, change = growth(t_s if grows else self.duration_s - t_s, self._ramp_s)
        change, w = change if grows else -change, self._rate
        phase = w * (t_s - self._ramp_s)
        sine, cosine = math.sin(phase), math.cos(phase)
        if self._pattern == "circle":
            x, y, x_rate, y_rate = cosine, sine, -sine, cosine
        elif self._pattern == "lissajous":
            x, x_rate = math.sin(3.0 * phase), 3.0 * math.cos(3.0 * phase)
            y, y_rate = math.sin(4.0 * phase), 4.0 * math.cos(4.0 * phase)
        else:
            petal, bend = math.sin(5.0 * phase), 5.0 * math.cos(5.0 * phase)
            x, x_rate = petal * cosine, bend * cosine - petal * sine
            y, y_rate = petal * sine, bend * sine + petal * cosine
        r, w = self._radius, share * w
        return Offset(r * share * x, r * share * y, r * (change * x + w * x_rate), r * (change * y + w * y_rate))
