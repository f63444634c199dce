"""How far mean elements may be off, growing with their age, and what that is on the sky.

    sigma_along  = a0 + a1 |age| + a2 age^2
    sigma_cross  = c0 + c1 |age|
    sigma_radial = r0 + r1 |age|

in metres along the velocity, along the orbit normal and upward in the orbit; projected at right
angles to the line of sight and divided by the range.  The along-track error grows fastest because
drag errors change the period. Source of the default size: Vallado and Cefola, "Two-line element
sets: practice and use", IAC-12 (2012): about 1 km at epoch, growing by 1 to 3 km a day in low
orbits.  Fit your own from passes you have tracked.
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rf_pointing.core import Params, parameter
from rf_pointing.core.dates import DAY_S
from rf_pointing.ephemeris.elements import Elements
from rf_pointing.ephemeris.state_vector import StateVector, combined, cross, dot, norm, rotated
from rf_pointing.ephemeris.track import TopocentricTrack


@dataclass(frozen=True, kw_only=True)
class ElementUncertainty(Params):
    """One-sigma position errors of mean elements against their age."""

    along_m: float = parameter(700.0, "along-track sigma at the epoch", low=0.0, high=1e6)
    along_growth_m_s: float = parameter(1000.0 / DAY_S, "its growth, by default 1 km a day", low=0.0, high=10.0)
    along_drag_m_s2: float = parameter(
        200.0 / DAY_S**2, "its quadratic growth, by default 0.2 km/day^2", low=0.0, high=1
    )
    cross_m: float = parameter(300.0, "cross-track sigma at the epoch", low=0.0, high=1e6)
    cross_growth_m_s: float = parameter(100.0 / DAY_S, "its growth, by default 0.1 km a day", low=0.0, high=10.0)
    radial_m: float = parameter(300.0, "radial sigma at the epoch", low=0.0, high=1e6)
    radial_growth_m_s: float = parameter(100.0 / DAY_S, "its growth, by default 0.1 km a day", low=0.0, high=10.0)

    def sigmas_m(self, age_s: float) -> tuple[float, float, float]:
        """Return the along-track, cross-track and radial sigma [m] at an age of either sign."""
        age = abs(age_s)
        return (
            self.along_m + self.along_growth_m_s * age + self.along_drag_m_s2 * age**2,
            self.cross_m + self.cross_growth_m_s * age,
            self.radial_m + self.radial_growth_m_s * age,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class SkyUncertainty:
    """One-sigma error of the direction, as a matrix, and along and across the motion on the sky.

    `covariance_rad2` is (2, 2) in the order cross-elevation, elevation.
    """

    age_s: float
    along_track_rad: float
    cross_track_rad: float
    along_track_s: float
    covariance_rad2: NDArray[np.float64]


def sky_uncertainty(track: TopocentricTrack, t_s: float, model: ElementUncertainty) -> SkyUncertainty:
    """Return the uncertainty at UTC `t_s` of a track that follows mean elements."""
    elements = getattr(track.target, "elements", None)
    # An ephemeris or a body has no epoch to grow old from.
    if not isinstance(elements, Elements):
        raise ValueError(f"{track.name} is not tracked from mean elements: their age says nothing about its error")
    age_s = t_s - elements.epoch_t_s
    orbit = rotated(track.motion_at(t_s), track.site.axes)
    seen, _, _ = track.relative_motion_at(t_s)
    on_sky = _sky_axes(seen)
    covariance = np.zeros((2, 2))
    for axis, sigma_m in zip(_orbit_axes(orbit), model.sigmas_m(age_s), strict=True):
        shift = np.array([dot(on_sky[0], axis), dot(on_sky[1], axis)]) * sigma_m / norm(seen.position)
        # The three errors are independent in the orbit, not on the sky.
        covariance += np.outer(shift, shift)
    motion = np.array([dot(axis, seen.velocity) for axis in on_sky])
    along = motion / np.linalg.norm(motion)
    across = np.array([along[1], -along[0]])
    return SkyUncertainty(
        age_s=age_s,
        along_track_rad=float(np.sqrt(along @ covariance @ along)),
        cross_track_rad=float(np.sqrt(across @ covariance @ across)),
        along_track_s=model.sigmas_m(age_s)[0] / float(norm(orbit.velocity)),
        covariance_rad2=covariance,
    )


def place_uncertainty(
    track: TopocentricTrack, t_s: float, covariance_m2: NDArray[np.float64], age_s: float
) -> SkyUncertainty:
    """Return what a covariance (3, 3) of the Earth-fixed position means on the sky at UTC `t_s`."""
    seen, range_m, _ = track.relative_motion_at(t_s)
    right, up = (np.array(axis, dtype=np.float64) for axis in _sky_axes(seen))
    to_sky = np.array([right, up]) @ np.array(track.site.axes) / float(range_m)
    covariance = to_sky @ covariance_m2 @ to_sky.T
    velocity = np.array(seen.velocity, dtype=np.float64)
    motion, speed = np.array([right @ velocity, up @ velocity]), float(np.linalg.norm(velocity))
    # A target at rest on the sky has no way: its error is counted across the elevation.
    along = motion / float(np.linalg.norm(motion)) if motion.any() else np.array([1.0, 0.0])
    across = np.array([along[1], -along[0]])
    along_rad = float(np.sqrt(along @ covariance @ along))
    return SkyUncertainty(
        age_s=age_s,
        along_track_rad=along_rad,
        cross_track_rad=float(np.sqrt(across @ covariance @ across)),
        along_track_s=along_rad * float(range_m) / speed if speed else 0.0,
        covariance_rad2=covariance,
    )


def stale_warning(
    track: TopocentricTrack, t_s: float, stale_s: float, model: ElementUncertainty, beamwidth_rad: float | None = None
) -> str:
    """Return "" or, of elements older than `stale_s` at UTC `t_s`, their age and expected error.

    The error is one sigma on the sky, in beamwidths where one is given.
    """
    if not isinstance(getattr(track.target, "elements", None), Elements):
        return ""
    sky = sky_uncertainty(track, t_s, model)
    if abs(sky.age_s) <= stale_s:
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
