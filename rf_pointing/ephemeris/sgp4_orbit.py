"""Earth-fixed motion of an object from its mean elements: SGP4, then TEME to ITRF.

    r_ITRF = W(x_p, y_p) R3(GMST82(UT1)) r_TEME        (Vallado et al., AIAA 2006-6753, appendix C)

All derivatives are differences of five SGP4 positions.  The velocity that SGP4 returns is not the
derivative of its positions: it lacks the change of the periodic terms, up to 0.2 m/s in a low orbit
and 0.6 to 4 m/s in an eccentric 12-hour one.
"""

import math
from functools import cached_property
from typing import Any

import erfa
import numpy as np
from sgp4.api import SGP4_ERRORS, Satrec

from rf_pointing.core import DAY_S, Array, BoolArray, utc_text
from rf_pointing.ephemeris.earth_orientation import IersEarthOrientation
from rf_pointing.ephemeris.elements import Elements
from rf_pointing.ephemeris.state_vector import OFFSETS, StateVector, motion_from_positions, turned_about_z
from rf_pointing.ephemeris.time_scales import POSIX_EPOCH_JD, leap_seconds

# Derivative of Greenwich mean sidereal time per second of UT1 (Aoki et al. 1982).
GMST_RATE_RAD_S = 7.2921158553e-5
# Long enough for the rounding of SGP4's kilometres, short enough for the truncation, h^4.
_STEP_S = 2.0
_KM = 1e3
# Below this radius nothing orbits.  In half of the step even an eccentric orbit sinks by 4 km only,
# so that none falls to the ground, where SGP4 refuses it, between two steps.
LEAST_RADIUS_KM = 6378.135 + 20.0
_SCAN_STEP_S, _SCAN_BLOCK = 60.0, 10000
# Times at which the mean perigee is looked at, and what the Earth's shape, and Sun and Moon by the
# size of the orbit (0.7 % of the axis at most in 400 eccentric orbits), move it by.
_PERIGEES, _FAR_ABOVE_KM, _FAR_ABOVE = 14, 100.0, 0.01


class Sgp4Orbit:
    """Motion of one object; times more than `max_age_s` from its epoch are an error."""

    rotation_rate_rad_s = GMST_RATE_RAD_S
    at_infinity = False

    def __init__(self, elements: Elements, orientation: IersEarthOrientation, *, max_age_s: float) -> None:
        if not max_age_s > 0.0:
            raise ValueError(f"max_age_s={max_age_s} must be > 0")
        self.elements = elements
        self.name = elements.name
        self.max_age_s = max_age_s
        self.orientation = orientation
        # A record of its own: it holds the state of its last call.
        self._record = elements.satrec()
        self._leap_at_epoch_s = leap_seconds().tai_minus_utc_s(elements.epoch_t_s)
        if self._record.error:
            raise ValueError(f"elements of {self.name}: {SGP4_ERRORS[self._record.error]}")

    @cached_property
    def spans_t_s(self) -> tuple[tuple[float, float], ...]:
        """First and last UTC time at which the object is in orbit, infinite if it does not decay.

        The elements are propagated to `max_age_s` on both sides of their epoch, once (20 ms for 14
        days).
        """
        return ((self.elements.epoch_t_s - self._endurance_s(-1.0), self.elements.epoch_t_s + self._endurance_s(1.0)),)

    def motion_at(self, t_s: Any, ahead_s: float = 0.0) -> StateVector:
        """Return the inertial motion [m] in Earth-fixed axes at UTC `t_s` (float or array).

        `ahead_s` moves the object along its orbit without turning the Earth: an along-track error
        in time.
        """
        elapsed_s = t_s - self.elements.epoch_t_s + ahead_s
        self._check_age(t_s, elapsed_s)
        # SGP4 counts elapsed seconds; a difference of UTC lacks the leap seconds in between.
        elapsed_s = elapsed_s + (leap_seconds().tai_minus_utc_s(t_s) - self._leap_at_epoch_s)
        teme = motion_from_positions(_positions_km(self._record, elapsed_s, self.name), _STEP_S, _KM)
        return earth_fixed_from_teme(teme, t_s, self.orientation)

    def warnings(self, t_s: float) -> tuple[str, ...]:
        """Return what makes the position at `t_s` less certain than its elements."""
        found = self.orientation.warnings(t_s)
        first_s, last_s = self.spans_t_s[0]
        if math.isfinite(last_s):
            found += (f"{self.name} decays: its elements give no place after {utc_text(last_s)}",)
        if t_s < first_s:
            found += (f"{self.name} has no place before {utc_text(first_s)} by its elements",)
        return found

    def _endurance_s(self, sense: float) -> float:
        """Return how long from the epoch, into the future (1) or past (-1), the object orbits."""
        if self._stays_high(sense):
            return math.inf
        steps = math.ceil(self.max_age_s / _SCAN_STEP_S)
        for first in range(0, steps + 1, _SCAN_BLOCK):
            elapsed_s = sense * _SCAN_STEP_S * np.arange(first, min(first + _SCAN_BLOCK, steps + 1), dtype=np.float64)
            falls = np.flatnonzero(~self._in_orbit(elapsed_s))
            if len(falls):
                return self._fall_s(sense, _SCAN_STEP_S * (first + float(falls[0])))
        return math.inf

    def _stays_high(self, sense: float) -> bool:
        """Return whether the mean perigee, smooth in time, is far above the ground throughout."""
        for k in range(_PERIGEES + 1):
            code, _, _ = self._record.sgp4_tsince(sense * k / _PERIGEES * self.max_age_s / 60.0)
            perigee_km = self._record.am * (1.0 - _FAR_ABOVE - self._record.em) * self._record.radiusearthkm
            if code or not perigee_km > LEAST_RADIUS_KM + _FAR_ABOVE_KM:
                return False
        return True

    def _fall_s(self, sense: float, late_s: float) -> float:
        """Return the time from the epoch to the end of the orbit, in the step before `late_s`."""
        early_s = max(late_s - _SCAN_STEP_S, 0.0)
        while late_s - early_s > 0.1:
            middle_s = 0.5 * (early_s + late_s)
            inside = bool(self._in_orbit(np.array([sense * middle_s]))[0])
            early_s, late_s = (middle_s, late_s) if inside else (early_s, middle_s)
        # The differences of `motion_at` need positions on both sides; one step for a leap second.
        return max(early_s - 3.0 * _STEP_S, 0.0)

    def _in_orbit(self, elapsed_s: Array) -> BoolArray:
        whole = np.full(elapsed_s.shape, self._record.jdsatepoch)
        codes, positions, _ = self._record.sgp4_array(whole, self._record.jdsatepochF + elapsed_s / DAY_S)
        radius_km = np.sqrt(np.einsum("nc,nc->n", positions, positions))
        return np.asarray((codes == 0) & (radius_km > LEAST_RADIUS_KM))

    def _check_age(self, t_s: Any, elapsed_s: Any) -> None:
        age_s = abs(elapsed_s) if isinstance(elapsed_s, float) else np.max(np.abs(elapsed_s), initial=0.0)
        if not age_s <= self.max_age_s:
            epoch = f"the epoch {utc_text(self.elements.epoch_t_s)} of {self.name}"
            most = f"{self.max_age_s} ({self.max_age_s / DAY_S:.2f} days)"
            newer = "; fetch_elements brings newer ones" * bool(np.max(elapsed_s) > self.max_age_s)
            bound = f"must be <= max_age_s={most}{newer}"
            raise ValueError(f"t_s={np.max(t_s)} is {age_s / DAY_S:.2f} days from {epoch}, {bound}")


def earth_fixed_from_teme(motion: StateVector, t_s: Any, orientation: IersEarthOrientation) -> StateVector:
    """Return the inertial motion in Earth-fixed axes at UTC times, from TEME of date."""
    earth = orientation.at(t_s)
    days = t_s // DAY_S
    angle_rad = erfa.gmst82(POSIX_EPOCH_JD + days, (t_s - days * DAY_S + earth.ut1_minus_utc_s) / DAY_S)
    return turned_about_z(motion, angle_rad, earth.pole_x_rad, earth.pole_y_rad)


def _positions_km(record: Satrec, elapsed_s: Any, name: str) -> Any:
    """Return the positions at the five `OFFSETS` from a time."""
    if isinstance(elapsed_s, float):
        found = [record.sgp4_tsince((elapsed_s + k * _STEP_S) / 60.0) for k in OFFSETS]
        code, positions = max(one[0] for one in found), [one[1] for one in found]
    else:
        # One call for all: it costs as much as twenty positions.
        each = np.add.outer(_STEP_S * np.array(OFFSETS), elapsed_s)
        whole = np.full(each.size, record.jdsatepoch)
        # Fractions of days carry the elapsed time; the epoch's own fraction is added first.
        codes, every, _ = record.sgp4_array(whole, record.jdsatepochF + each.ravel() / DAY_S)
        code, positions = int(codes.max(initial=0)), every.reshape(5, -1, 3)
    if code:
        raise ValueError(f"{name} cannot be propagated: {SGP4_ERRORS[code]}")
    return positions
