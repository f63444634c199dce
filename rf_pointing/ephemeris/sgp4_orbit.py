"""Earth-fixed motion of an object from its mean elements: SGP4, then TEME to ITRF.

    r_ITRF = W(x_p, y_p) R3(GMST82(UT1)) r_TEME        (Vallado et al., AIAA 2006-6753, appendix C)

Acceleration and jerk are differences of the SGP4 velocity one second to either side: SGP4 gives neither, and a
two-body formula would leave out the oblateness that SGP4 contains.
"""

from typing import Any

import erfa
import numpy as np
from sgp4.api import SGP4_ERRORS, Satrec

from rf_pointing.ephemeris.earth_orientation import EarthOrientationSource
from rf_pointing.ephemeris.elements import Elements
from rf_pointing.ephemeris.motion import Motion, turned_about_z
from rf_pointing.ephemeris.time_scales import DAY_S, POSIX_EPOCH_JD, leap_seconds, utc_text

__all__ = ["GMST_RATE_RAD_S", "Sgp4Orbit"]

GMST_RATE_RAD_S = 7.2921158553e-5
"""Derivative of Greenwich mean sidereal time per second of UT1 (Aoki et al. 1982)."""
_STEP_S = 1.0
_KM = 1e3


class Sgp4Orbit:
    """Motion of one object; refuses times further than `max_age_s` from the epoch of its elements."""

    rotation_rate_rad_s = GMST_RATE_RAD_S

    def __init__(self, elements: Elements, orientation: EarthOrientationSource, *, max_age_s: float) -> None:
        if not max_age_s > 0.0:
            raise ValueError(f"max_age_s={max_age_s} must be > 0")
        self.elements = elements
        self.name = elements.name
        self.max_age_s = max_age_s
        self._orientation = orientation
        self._record = elements.satrec()
        self._leap_at_epoch_s = leap_seconds().tai_minus_utc_s(elements.epoch_t_s)
        if self._record.error:
            raise ValueError(f"elements of {self.name}: {SGP4_ERRORS[self._record.error]}")

    def motion_at(self, t_s: Any, ahead_s: float = 0.0) -> Motion:
        """Return the inertial motion [m] in Earth-fixed axes at UTC `t_s` (float or array).

        `ahead_s` moves the object along its orbit without turning the Earth: an along-track error in time.
        """
        elapsed_s = t_s - self.elements.epoch_t_s + ahead_s
        self._check_age(t_s, elapsed_s)
        elapsed_s = elapsed_s + (leap_seconds().tai_minus_utc_s(t_s) - self._leap_at_epoch_s)
        teme = _teme_motion(self._record, elapsed_s, self.name)
        earth = self._orientation.at(t_s)
        days = t_s // DAY_S
        angle_rad = erfa.gmst82(POSIX_EPOCH_JD + days, (t_s - days * DAY_S + earth.ut1_minus_utc_s) / DAY_S)
        return turned_about_z(teme, angle_rad, earth.pole_x_rad, earth.pole_y_rad)

    def warnings(self, t_s: float) -> tuple[str, ...]:
        """Return what makes the position at `t_s` less certain than its elements."""
        return self._orientation.warnings(t_s)

    def _check_age(self, t_s: Any, elapsed_s: Any) -> None:
        age_s = abs(elapsed_s) if isinstance(elapsed_s, float) else np.max(np.abs(elapsed_s), initial=0.0)
        if not age_s <= self.max_age_s:
            raise ValueError(
                f"t_s={np.max(t_s)} is {age_s / DAY_S:.2f} days from the epoch {utc_text(self.elements.epoch_t_s)} of "
                f"{self.name}, must be <= max_age_s={self.max_age_s} ({self.max_age_s / DAY_S:.2f} days)"
            )


def _teme_motion(record: Satrec, elapsed_s: Any, name: str) -> Motion:
    """Return TEME position, velocity, acceleration and jerk in metres."""
    position, now = _state(record, elapsed_s, name)
    before = _state(record, elapsed_s - _STEP_S, name)[1]
    after = _state(record, elapsed_s + _STEP_S, name)[1]
    acceleration = [(b - a) * (_KM / (2.0 * _STEP_S)) for a, b in zip(before, after, strict=True)]
    jerk = [(b - 2.0 * v + a) * (_KM / _STEP_S**2) for a, v, b in zip(before, now, after, strict=True)]
    x, y, z = (component * _KM for component in position)
    vx, vy, vz = (component * _KM for component in now)
    return Motion((x, y, z), (vx, vy, vz), tuple3(acceleration), tuple3(jerk))


def tuple3(components: list[Any]) -> tuple[Any, Any, Any]:
    """Return three components as a vector."""
    x, y, z = components
    return x, y, z


def _state(record: Satrec, elapsed_s: Any, name: str) -> tuple[Any, Any]:
    if isinstance(elapsed_s, float):
        code, position, velocity = record.sgp4_tsince(elapsed_s / 60.0)
    else:
        whole = np.full(elapsed_s.shape, record.jdsatepoch)
        codes, position, velocity = record.sgp4_array(whole, record.jdsatepochF + elapsed_s / DAY_S)
        position, velocity = position.T, velocity.T
        code = int(codes.max(initial=0))
    if code:
        raise ValueError(f"{name} cannot be propagated: {SGP4_ERRORS[code]}")
    return position, velocity
