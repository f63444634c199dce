"""A target that follows an orbit ephemeris message: interpolation as declared, never outside the usable span.

Lagrange of degree N passes a polynomial through N + 1 positions, Hermite of degree N through (N + 1) / 2 positions and
velocities.  The polynomial of a window is solved for once, in a time scaled to [-1, 1], and differentiated for the
velocity, acceleration and jerk.
"""

from collections.abc import Sequence
from functools import lru_cache
from typing import Any

import erfa
import numpy as np
from numpy.typing import NDArray

from rf_pointing.core import require_choice
from rf_pointing.core.dates import utc_text
from rf_pointing.ephemeris.celestial_frame import EARTH_RATE_RAD_S, earth_fixed_from_gcrs, tt_parts
from rf_pointing.ephemeris.earth_orientation import EarthOrientationSource, IersEarthOrientation
from rf_pointing.ephemeris.oem import METHODS, OemSegment
from rf_pointing.ephemeris.sgp4_orbit import GMST_RATE_RAD_S, earth_fixed_from_teme
from rf_pointing.ephemeris.state_vector import StateVector, Vector, rotated, seen_from_rotating_axes
from rf_pointing.ephemeris.time_scales import DAY_S, POSIX_EPOCH_JD, Tai, leap_seconds

__all__ = ["OemTarget"]

Array = NDArray[np.float64]

_CELESTIAL = ("GCRF", "ICRF", "EME2000", "J2000")
_TEME = "TEME"
EDGE_S = 1.0


class OemTarget:
    """StateVector from the segments of one object.

    `interpolation` (method, degree) serves segments that declare none; without it such a message is refused.
    """

    at_infinity = False

    def __init__(
        self,
        segments: Sequence[OemSegment],
        orientation: EarthOrientationSource | None = None,
        *,
        interpolation: tuple[str, int] | None = None,
    ) -> None:
        if not segments or len({segment.object_id for segment in segments}) != 1:
            raise ValueError("segments must be one or more of one object")
        frames = {segment.frame for segment in segments}
        frame = frames.pop()
        if frames or not (frame in _CELESTIAL or frame == _TEME or frame.startswith("ITRF")):
            raise ValueError(
                f"REF_FRAME={frame!r} must be one of {', '.join(_CELESTIAL)}, TEME, ITRF-yyyy, in all segments"
            )
        self.name = segments[0].name
        self.rotation_rate_rad_s = GMST_RATE_RAD_S if frame == _TEME else EARTH_RATE_RAD_S
        self._frame = frame
        self._segments = tuple(segments)
        self._windows = tuple(_window_size(segment, interpolation) for segment in segments)
        self._orientation: EarthOrientationSource = orientation or IersEarthOrientation()
        self._polynomial = lru_cache(maxsize=4096)(self._solved_polynomial)

    @property
    def spans_t_s(self) -> tuple[tuple[float, float], ...]:
        """First and last UTC times of what is usable without a gap, each a second of light inside the ends."""
        joined: list[list[float]] = []
        for first, last in sorted((segment.usable_from_s, segment.usable_to_s) for segment in self._segments):
            if joined and first <= joined[-1][1]:
                joined[-1][1] = max(joined[-1][1], last)
            else:
                joined.append([first, last])
        inside = [(first + EDGE_S, last - EDGE_S) for first, last in joined if last - first > 2.0 * EDGE_S]
        return tuple((_utc_s(first), _utc_s(last)) for first, last in inside)

    def motion_at(self, t_s: Any, ahead_s: float = 0.0) -> StateVector:
        """Return the inertial motion [m] in Earth-fixed axes; a time outside the usable spans raises ValueError."""
        tai_s = t_s + leap_seconds().tai_minus_utc_s(t_s) + ahead_s
        if isinstance(t_s, float):
            derivatives = self._derivatives(tai_s)
        else:
            each = [self._derivatives(float(time)) for time in tai_s]
            derivatives = np.moveaxis(np.array(each).reshape(-1, 4, 3), 0, -1)
        position, velocity, acceleration, jerk = ((v[0], v[1], v[2]) for v in derivatives)
        return self._earth_fixed(StateVector(position, velocity, acceleration, jerk), t_s)

    def warnings(self, t_s: float) -> tuple[str, ...]:
        """Return what makes the position at `t_s` less certain than the message."""
        return self._orientation.warnings(t_s)

    def _earth_fixed(self, motion: StateVector, t_s: Any) -> StateVector:
        if self._frame == _TEME:
            return earth_fixed_from_teme(motion, t_s, self._orientation)
        if self._frame.startswith("ITRF"):
            # Its derivatives are those of the turning frame; turning back makes them inertial.
            return seen_from_rotating_axes(motion, -EARTH_RATE_RAD_S)
        if self._frame in ("EME2000", "J2000"):
            motion = rotated(motion, _gcrs_from_j2000())
        return earth_fixed_from_gcrs(motion, t_s, self._orientation)

    def _derivatives(self, tai_s: float) -> Any:
        """Return position to jerk (4, 3) at a TAI time, from the last segment that may be used there."""
        for index in range(len(self._segments) - 1, -1, -1):
            segment = self._segments[index]
            if segment.usable_from_s <= tai_s <= segment.usable_to_s:
                break
        else:
            raise ValueError(f"{_utc(tai_s)} is outside the usable span of {self.name}: {self._spans()}")
        _, size, _ = self._windows[index]
        after = int(np.searchsorted(segment.tai_s, tai_s, side="right"))
        start = min(max(after - size // 2 - size % 2, 0), len(segment.tai_s) - size)
        middle, half, derivatives = self._polynomial(index, start)
        powers = ((tai_s - middle) / half) ** np.arange(derivatives.shape[1])
        return np.einsum("p,kpc->kc", powers, derivatives)

    def _solved_polynomial(self, index: int, start: int) -> tuple[float, float, Array]:
        """Return middle and half width of a window and the coefficients (4, degree + 1, 3) of all derivatives."""
        segment, (hermite, size, degree) = self._segments[index], self._windows[index]
        times = segment.tai_s[start : start + size]
        middle, half = 0.5 * (times[0] + times[-1]), 0.5 * (times[-1] - times[0])
        x = (times - middle) / half
        rows, values = np.vander(x, degree + 1, increasing=True), segment.position_m[start : start + size]
        if hermite:
            slopes = np.zeros_like(rows)
            slopes[:, 1:] = rows[:, :-1] * np.arange(1, degree + 1)
            rows = np.concatenate([rows, slopes])
            values = np.concatenate([values, segment.velocity_m_s[start : start + size] * half])
        coefficients = [np.linalg.solve(rows, values)]
        for _ in range(3):
            lower = np.zeros_like(coefficients[-1])
            lower[:-1] = coefficients[-1][1:] * np.arange(1, degree + 1)[:, None] / half
            coefficients.append(lower)
        return float(middle), float(half), np.array(coefficients)

    def _spans(self) -> str:
        return "; ".join(f"{_utc(s.usable_from_s)} to {_utc(s.usable_to_s)}" for s in self._segments)


def _window_size(segment: OemSegment, fallback: tuple[str, int] | None) -> tuple[bool, int, int]:
    """Return whether velocities are used, how many states, and the degree."""
    method, degree = (segment.method, segment.degree) if segment.method else (fallback or ("", 0))
    if not method:
        raise ValueError(f"OEM of {segment.name} declares no INTERPOLATION: give interpolation and its degree")
    require_choice("interpolation", method, METHODS)
    hermite = method == "HERMITE"
    if hermite and (degree % 2 == 0 or degree < 3):
        raise ValueError(
            f"INTERPOLATION_DEGREE={degree} must be odd, 3 or more, for HERMITE: it takes positions and velocities"
        )
    degree = 1 if method == "LINEAR" else degree
    size = (degree + 1) // 2 if hermite else degree + 1
    if len(segment.tai_s) < size:
        raise ValueError(
            f"OEM segment of {segment.name} has {len(segment.tai_s)} states, must have {size} for {method}"
        )
    return hermite, size, degree


@lru_cache(maxsize=1)
def _gcrs_from_j2000() -> tuple[Vector, Vector, Vector]:
    """Rows of the frame bias, transposed: 23 mas between the mean equator of J2000 and the GCRS."""
    bias, _, _ = erfa.bp06(*tt_parts(946728000.0 - 64.184))
    first, second, third = bias.T.tolist()
    return tuple(first), tuple(second), tuple(third)


def _utc_s(tai_s: float) -> float:
    days, seconds = divmod(tai_s, DAY_S)
    return Tai(POSIX_EPOCH_JD + days, seconds / DAY_S).to_utc().posix_s()


def _utc(tai_s: float) -> str:
    return utc_text(_utc_s(tai_s))
