"""How uncertain a target is: from the age of its elements, its covariance, or what passes taught.

    sigma_along  = a0 + a1 |age| + a2 age^2       with a manoeuvre dv: and 3 dv |age|, as squares
    sigma_cross  = c0 + c1 |age|
    sigma_radial = r0 + r1 |age|

in metres along the velocity, along the orbit normal and upward in the orbit; projected at right
angles to the line of sight and divided by the range.  The along-track error grows fastest because
drag errors change the period; after a change dv of the speed it grows by 3 dv (Clohessy and
Wiltshire).  Source of the default size: Vallado and Cefola, "Two-line element sets: practice and
use", IAC-12 (2012): about 1 km at epoch, growing by 1 to 3 km a day in low orbits.  Fit your own
from passes you have tracked.

An ephemeris brings its covariance: between two of its epochs their mean, weighted by time, in the
axes of the orbit; outside of them the nearer one.  A learned time takes the place of the
along-track error.
"""

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from rf_pointing.core import DAY_S, Array, Params, SkyUncertainty, parameter
from rf_pointing.core.signals import LEAST_KNOWN_S
from rf_pointing.ephemeris.elements import Elements
from rf_pointing.ephemeris.oem import OemTarget
from rf_pointing.ephemeris.state_vector import StateVector, combined, cross, dot, norm, rotated
from rf_pointing.ephemeris.track import TopocentricTrack

# Growth of the along-track error of a circular orbit for a change of the speed.
DRIFT_OF_SPEED = 3.0


@dataclass(frozen=True, kw_only=True)
class ElementUncertainty(Params):
    """One-sigma position errors of mean elements against their age."""

    along_m: float = parameter(700.0, "along-track sigma at the epoch", 0.0, 1e6)
    along_growth_m_s: float = parameter(1000.0 / DAY_S, "its growth, by default 1 km a day", 0.0, 10.0)
    along_drag_m_s2: float = parameter(200.0 / DAY_S**2, "its quadratic growth, by default 0.2 km/day^2", 0.0, 1)
    cross_m: float = parameter(300.0, "cross-track sigma at the epoch", 0.0, 1e6)
    cross_growth_m_s: float = parameter(100.0 / DAY_S, "its growth, by default 0.1 km a day", 0.0, 10.0)
    radial_m: float = parameter(300.0, "radial sigma at the epoch", 0.0, 1e6)
    radial_growth_m_s: float = parameter(100.0 / DAY_S, "its growth, by default 0.1 km a day", 0.0, 10.0)

    manoeuvre_m_s: float = parameter(
        0.0, "speed that a manoeuvre since the epoch may have changed, one sigma; 0: none", 0.0, 1e3
    )

    def sigmas_m(self, age_s: float) -> tuple[float, float, float]:
        """Return the along-track, cross-track and radial sigma [m] at an age of either sign."""
        age = abs(age_s)
        grown_m = self.along_m + self.along_growth_m_s * age + self.along_drag_m_s2 * age**2
        return (
            math.hypot(grown_m, DRIFT_OF_SPEED * self.manoeuvre_m_s * age),
            self.cross_m + self.cross_growth_m_s * age,
            self.radial_m + self.radial_growth_m_s * age,
        )


def sky_uncertainty(track: TopocentricTrack, t_s: float, model: ElementUncertainty) -> SkyUncertainty | None:
    """Return the uncertainty at UTC `t_s`, None of bodies and of ephemerides without covariance."""
    elements, age_s = getattr(track.target, "elements", None), 0.0
    if isinstance(elements, Elements):
        age_s = t_s - elements.epoch_t_s
        covariance_m2 = np.diag(np.square(model.sigmas_m(age_s)))
    elif isinstance(track.target, OemTarget) and track.target.covariances:
        covariance_m2 = _ephemeris_covariance_m2(track.target, t_s)
    else:
        return None
    orbit = rotated(track.motion_at(t_s), track.site.axes)
    speed_m_s = float(norm(orbit.velocity))
    if track.learned is not None:
        covariance_m2[0, :] = covariance_m2[:, 0] = 0.0
        covariance_m2[0, 0] = (speed_m_s * track.learned.sigma_s(t_s)) ** 2
    seen, _, _ = track.relative_motion_at(t_s)
    found = _on_the_sky(seen, np.array(_orbit_axes(orbit)), covariance_m2, float(norm(seen.position)))
    along_s = math.sqrt(covariance_m2[0, 0]) / speed_m_s
    return replace(found, age_s=age_s, along_track_s=along_s)


def place_uncertainty(track: TopocentricTrack, t_s: float, covariance_m2: Array, age_s: float) -> SkyUncertainty:
    """Return what a covariance (3, 3) of the Earth-fixed position means on the sky at UTC `t_s`."""
    seen, range_m, _ = track.relative_motion_at(t_s)
    found = _on_the_sky(seen, np.array(track.site.axes).T, covariance_m2, float(range_m))
    speed = float(norm(seen.velocity))
    along_s = min(found.along_track_rad * float(range_m) / speed, LEAST_KNOWN_S) if speed else 0.0
    return replace(found, age_s=age_s, along_track_s=along_s)


def _on_the_sky(seen: StateVector, axes: Array, covariance_m2: Array, range_m: float) -> SkyUncertainty:
    """Return a covariance along `axes` (3, 3), in rows, at right angles to the line of sight."""
    on_sky = np.array(_sky_axes(seen), dtype=np.float64)
    shifts, motion = on_sky @ axes.T / range_m, on_sky @ np.array(seen.velocity, dtype=np.float64)
    covariance = shifts @ covariance_m2 @ shifts.T
    covariance = 0.5 * (covariance + covariance.T)
    # A target at rest on the sky has no way: its error is counted across the elevation.
    along = motion / float(np.linalg.norm(motion)) if motion.any() else np.array([1.0, 0.0])
    variances = (float(way @ covariance @ way) for way in (along, np.array([along[1], -along[0]])))
    ahead, aside = (math.sqrt(max(each, 0.0)) for each in variances)
    return SkyUncertainty(covariance_rad2=covariance, along_track_rad=ahead, cross_track_rad=aside)


def _ephemeris_covariance_m2(target: OemTarget, t_s: float) -> Array:
    """Return the covariance (3, 3) along the velocity, the orbit normal and upward."""
    known = target.covariances
    times = np.array([each_s for each_s, _, _ in known])
    after = int(np.clip(np.searchsorted(times, t_s), 1, len(known) - 1)) if len(known) > 1 else 0
    rows = sorted({max(after - 1, 0), after})
    first_s, last_s = times[rows[0]], times[rows[-1]]
    share = float(np.clip((t_s - first_s) / (last_s - first_s), 0.0, 1.0)) if len(rows) > 1 else 0.0
    found = []
    for row in rows:
        then_s, frame, matrix_m2 = known[row]
        # In the axes of the orbit a covariance changes slowly; in those of the sky once an orbit.
        turn = np.array(_orbit_axes(target.motion_at(then_s))) @ target.axes_of(frame, then_s).T
        found.append(turn @ matrix_m2 @ turn.T)
    return np.asarray((1.0 - share) * found[0] + share * found[-1])


def stale_warning(
    track: TopocentricTrack, t_s: float, stale_s: float, model: ElementUncertainty, beamwidth_rad: float | None = None
) -> str:
    """Return "" or, of elements older than `stale_s` at UTC `t_s`, their age and expected error.

    The error is one sigma on the sky, in beamwidths where one is given.
    """
    sky = sky_uncertainty(track, t_s, model)
    # An ephemeris has no age, and one learned time makes old elements good again.
    if sky is None or abs(sky.age_s) <= stale_s or track.learned is not None:
        return ""
    error = error_text(sky.along_track_rad, beamwidth_rad)
    return f"elements of {track.name} are stale: {abs(sky.age_s) / DAY_S:.1f} days from their epoch, {error}"


def error_text(along_rad: float, beamwidth_rad: float | None) -> str:
    """Return an expected error along the track in words: in mdeg, and in beamwidths."""
    beams = "" if beamwidth_rad is None else f", {along_rad / beamwidth_rad:.2g} beamwidths"
    return f"expected error along the track {math.degrees(along_rad) * 1e3:.0f} mdeg{beams}"


def orientation_sigma_rad(track: TopocentricTrack, t_s: float) -> float:
    """Return the one-sigma pointing error that the Earth's uncertain orientation makes at `t_s`.

    The root of the sum of squares over both directions of the sky; 0 while the orientation is
    measured, and for an ephemeris that is given in Earth-fixed axes.
    """
    orientation = track.target.orientation
    ut1_s, pole_rad = (0.0, 0.0) if orientation is None else orientation.sigmas_at(t_s)
    position = track.motion_at(t_s).position
    rate = track.target.rotation_rate_rad_s
    # An error of the Earth's angle, or of either coordinate of the pole, turns the target.
    turns = ((ut1_s * rate, (0.0, 0.0, 1.0)), (pole_rad, (0.0, 1.0, 0.0)), (pole_rad, (1.0, 0.0, 0.0)))
    seen, _, _ = track.relative_motion_at(t_s)
    squares = 0.0
    for sigma, turned_about in turns:
        shift = cross(position, turned_about)
        moved = tuple(dot(axis, shift) for axis in track.site.axes)
        squares += sigma**2 * sum(dot(axis, moved) ** 2 for axis in _sky_axes(seen))
    return math.sqrt(squares) / float(norm(seen.position))


def _orbit_axes(orbit: StateVector) -> tuple[Any, Any, Any]:
    """Return unit vectors along the velocity, the orbit normal, and upward (east-north-up)."""
    along = combined((1.0 / norm(orbit.velocity), orbit.velocity))
    normal = cross(orbit.position, orbit.velocity)
    normal = combined((1.0 / norm(normal), normal))
    return along, normal, cross(along, normal)


def _sky_axes(seen: StateVector) -> tuple[Any, Any]:
    """Unit vectors to the right (cross-elevation) and up (elevation) of the line of sight."""
    east, north, _ = seen.position
    horizontal = float(np.hypot(east, north))
    right = (north / horizontal, -east / horizontal, 0.0)
    forward = combined((1.0 / norm(seen.position), seen.position))
    return right, cross(right, forward)
