"""From recorded passes and old elements to an orbit: points, prior, checks, elements again.

Inertial axes are those of TEME: what turns there is the Earth by GMST of 1982 and UT1, with its
pole, as for mean elements.  The points of a pass are the medians of 5 s of measured minus
reference, added to the reference again; then the mount's model and refraction are taken off.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from rf_pointing.calibration import BiasModel, TrackedPass
from rf_pointing.core import EARTH_RADIUS_M, TURN, Array, RadioRefraction, wrap_rad
from rf_pointing.core.dates import DAY_S, to_utc_text
from rf_pointing.ephemeris import Elements, Site, StateVector, TargetSource, leap_seconds
from rf_pointing.ephemeris.earth_orientation import IersEarthOrientation
from rf_pointing.ephemeris.sgp4_orbit import Sgp4Orbit, earth_fixed_from_teme
from rf_pointing.ephemeris.uncertainty import ElementUncertainty
from rf_pointing.orbit.determination import (
    Dynamics,
    Orbits,
    PassData,
    Prior,
    Priors,
    covariance_of_elements,
    determine,
    rtn_axes,
)
from rf_pointing.orbit.forces import Disturbances, turning_velocity
from rf_pointing.orbit.measurements import KINDS, StationMotion

DEGREE = 8
"""Last degree of the Earth's field in an orbit from passes; what lies beyond is considered."""
# B* is half of ballistic coefficient times the density that SGP4 refers to (kg/m^2 per radius).
_BALLISTIC_PER_BSTAR = 12.741621
_RADIATION_M2_KG = 0.02
_POINT_S = 5.0
FEWEST_POINTS = 10
_LEAST_SIGMA = dict(zip(KINDS, (1e-6, 1e-6, 0.01, 1e-4), strict=True))
# The length of six numbers of unit variance exceeds this once in 11 million orbits.
FARTHEST_SIGMA = 6.6
MISFIT_SIGMA = 3.0
WRONG_BIAS_SIGMA = 5.0
_MOST_LEFT_OUT = 0.3


def from_teme(t_s: Array, orientation: IersEarthOrientation | None = None) -> Array:
    """Return the rotations (n, 3, 3) from TEME to the Earth's axes at UTC times (n,)."""
    earth, still = orientation or IersEarthOrientation(), np.zeros_like(t_s)
    columns = []
    for axis in np.eye(3):
        unit = tuple(still + value for value in axis)
        # Directions alone: derivatives of the turning axes are not needed.
        none = (still, still, still)
        columns.append(
            np.stack(
                earth_fixed_from_teme(StateVector(unit, none, none, none), t_s, earth).position,
                axis=-1,
            )
        )
    return np.stack(columns, axis=-1)


def motion_of_site(site: Site, t_s: Array) -> StationMotion:
    """Return the motion of a site in TEME at UTC times (n,)."""
    turn = from_teme(t_s)
    position = np.einsum("nji,j->ni", turn, site.position_m)
    return StationMotion(position, turning_velocity(position), np.asarray(site.axes) @ turn)


def teme_state(source: TargetSource, t_s: float) -> Array:
    """Return position and velocity (6,) in TEME of a target that knows its motion."""
    motion = source.motion_at(t_s)
    turn = from_teme(np.array([t_s]), source.orientation)[0]
    return np.concatenate([turn.T @ motion.position, turn.T @ motion.velocity])


def forces_of(elements: Elements, state: Array) -> Disturbances:
    """Return the forces on a satellite, its drag from B* in the mean atmosphere at its height."""
    height_m = float(np.linalg.norm(state[:3])) - EARTH_RADIUS_M
    return Disturbances(
        degree=DEGREE, sun=True, moon=True, radiation_m2_kg=_RADIATION_M2_KG,
        ballistic_m2_kg=min(max(_BALLISTIC_PER_BSTAR * elements.drag_per_earth_radius, 1e-3), 1.0),
        **Disturbances.air_at(height_m),
    )  # fmt: skip


def points_of(
    tracked: TrackedPass, site: Site, model: BiasModel, refraction: RadioRefraction | None
) -> tuple[PassData, str]:
    """Return the points of a recorded pass, and what was left out of it ("" if nothing was).

    `refraction` None is right for angles that are free of it.  Raises ValueError for a pass with
    fewer than 10 points.
    """
    keep, report = tracked.validation
    raw = tracked.raw
    t_s = raw.t_s[keep]
    cell = np.floor((t_s - t_s[:1]) / _POINT_S)
    firsts = np.flatnonzero(np.diff(cell, prepend=-1.0))
    if len(firsts) < FEWEST_POINTS:
        raise ValueError(
            f"pass of {raw.target} over {raw.station}: {len(firsts)} points of {_POINT_S:g} s, "
            f"must be "
            f">= {FEWEST_POINTS} ({report.text()})"
        )
    # Medians: a few wild samples of a point do not move it.
    pieces = np.split(np.arange(len(t_s)), firsts[1:])
    # From the first sample on: times since 1970 would lose their microseconds in a sum.
    times = t_s[0] + np.array([np.mean(t_s[rows] - t_s[0]) for rows in pieces])
    at = tracked.reference.at(times)
    kinds = tuple(kind for kind in KINDS if kind in raw.channels)
    columns, sigmas = {}, []
    for kind in kinds:
        off = tracked.residuals[kind]
        off = wrap_rad(off) if kind == "azimuth_rad" else off
        points = np.array([np.median(off[rows]) for rows in pieces])
        columns[kind] = getattr(at, kind) + points
        sky = np.abs(np.cos(at.elevation_rad)) if kind == "azimuth_rad" else 1.0
        # Third differences leave the noise and nothing of the motion: variance 20.
        noise = 1.4826 / math.sqrt(20.0) * float(np.median(np.abs(np.diff(points * sky, 3))))
        sigmas.append(max(noise, _LEAST_SIGMA[kind]))
    angles = columns["azimuth_rad"], columns["elevation_rad"]
    azimuth, elevation = model.remove(*angles, *at.motion()[2:])
    # A dish over the top looks at the other side of its axis.
    over = elevation > 0.5 * math.pi
    azimuth, elevation = (
        np.where(over, azimuth + math.pi, azimuth),
        np.where(over, math.pi - elevation, elevation),
    )
    true = elevation if refraction is None else refraction.remove(elevation)
    columns |= {"azimuth_rad": azimuth, "elevation_rad": true}
    data = PassData(
        station=raw.station, t_s=times, motion=motion_of_site(site, times), kinds=kinds,
        values=np.stack([columns[kind] for kind in kinds], axis=-1)[np.newaxis],
        sigma=np.array(sigmas), bending_rad=elevation - true,
    )  # fmt: skip
    return data, report.text() if report.before > report.after else ""


def prior_of(
    elements: Elements, epoch_t_s: float, law: ElementUncertainty, max_age_s: float
) -> Prior:
    """Return the orbit by mean elements at a time, with the covariance of their age."""
    state = teme_state(Sgp4Orbit(elements, IersEarthOrientation(), max_age_s=max_age_s), epoch_t_s)
    covariance = covariance_of_elements(state, epoch_t_s - elements.epoch_t_s, law)
    return Prior(epoch_t_s=epoch_t_s, states=state[np.newaxis], covariance=covariance)


def checked_orbit(
    prior: Prior, passes: Sequence[PassData], dynamics: Dynamics, priors: Priors
) -> Orbits:
    """Return the orbit of passes that agree with each other and with what was known before.

    Raises
    ------
    ValueError
        A clock that is wrong, a pass that is not of this satellite, elements that are off by more
        than their law allows, or a pass with too many outliers: each with value and bound.
    """
    found, trouble = _tried(prior, passes, dynamics, priors)
    if not trouble:
        return found
    ordered = sorted(passes, key=lambda one: float(one.t_s[0]))
    limit_s = WRONG_BIAS_SIGMA * priors.clock_s
    clocks = []
    for k, one in enumerate(ordered if len(ordered) > 1 else ()):
        loose, still = _tried(prior, passes, dynamics, priors, loose=k)
        late_s = float(loose.values[0, loose.names.index(f"clock of pass {k + 1}")])
        if not still and abs(late_s) > limit_s:
            clocks.append((abs(late_s), late_s, _named(k, one)))
    if clocks:
        # Another orbit may take the error to another pass: the least of them explains it best.
        _, late_s, name = min(clocks)
        raise ValueError(
            f"clock of pass {name} is {late_s:+.3f} s off the other passes, must be within "
            f"{limit_s:g} s ({WRONG_BIAS_SIGMA:g} sigma)"
        )
    # Two passes that disagree do not tell which is wrong.
    for k, one in enumerate(ordered if len(ordered) > 2 else ()):
        _, still = _tried(prior, [*ordered[:k], *ordered[k + 1 :]], dynamics, priors)
        if not still:
            raise ValueError(
                f"pass {_named(k, one)} does not agree with the others: {trouble}; is it of "
                f"another satellite?"
            )
    raise ValueError(
        f"the passes and the elements do not agree: {trouble}; is it another satellite, or a "
        f"manoeuvre?"
    )


def _named(k: int, one: PassData) -> str:
    return f"{k + 1} ({one.station}, {to_utc_text(float(one.t_s[0]))[:19]})"


def _tried(
    prior: Prior, passes: Sequence[PassData], dynamics: Dynamics, priors: Priors,
    loose: int | None = None,
) -> tuple[Orbits, str]:  # fmt: skip
    """Return an orbit, and what is wrong with it."""
    found = determine(prior, passes, dynamics, priors, loose)
    step = np.linalg.solve(
        np.linalg.cholesky(prior.covariance), found.values[0, :6] - prior.states[0]
    )
    far = float(np.linalg.norm(step))
    if far > FARTHEST_SIGMA:
        return (
            found,
            f"the orbit is {far:.1f} sigma from that of the elements, must be <= "
            f"{FARTHEST_SIGMA:g}",
        )
    first = 0
    for k, one in enumerate(found.passes):
        used = found.used[0, first : first + one.values[0].size]
        first += one.values[0].size
        # Noise and biases within their priors leave residuals up to this.
        allowed = np.hypot(one.sigma, [priors.bias(kind) for kind in one.kinds]) / one.sigma
        most = MISFIT_SIGMA * float(np.max(allowed[:2]))
        if found.scale[0, k] > most:
            return found, (
                f"pass {_named(k, one)} is off by "
                f"{math.degrees(found.scale[0, k] * one.sigma[1]) * 1e3:.1f} mdeg rms, "
                f"must be <= {math.degrees(most * one.sigma[1]) * 1e3:.1f} mdeg"
            )
        if np.mean(~used) > _MOST_LEFT_OUT:
            return found, (
                f"pass {_named(k, one)} has {100.0 * np.mean(~used):.0f} % outliers, must be <= "
                f"{100.0 * _MOST_LEFT_OUT:g} %"
            )
    sigmas = np.sqrt(np.diag(found.covariance()[0]))
    for name, value, sigma in zip(found.names, found.values[0], sigmas, strict=True):
        kind = name.partition(" of pass")[0]
        own_s, own_rad = {"clock": priors.clock_s}, priors.azimuth_bias_rad
        own = own_s | {"azimuth bias": own_rad, "elevation bias": priors.elevation_bias_rad}
        if loose is not None or kind not in own:
            continue
        if abs(value) - 2.0 * sigma > WRONG_BIAS_SIGMA * own[kind]:
            mdeg = math.degrees(value) * 1e3
            shown = f"{value:+.3f} s" if kind == "clock" else f"{mdeg:+.0f} mdeg"
            return found, (
                f"{name} comes out as {shown}, {abs(value) / own[kind]:.1f} sigma, must be <= "
                f"{WRONG_BIAS_SIGMA:g}"
            )
    return found, ""


def refuse_leap_second(first_t_s: float, last_t_s: float) -> None:
    """Refuse a span in which UTC has a leap second: its seconds are counted as equal here."""
    before, after = (leap_seconds().tai_minus_utc_s(t_s) for t_s in (first_t_s, last_t_s))
    if before != after:
        raise ValueError(
            f"a leap second lies between {to_utc_text(first_t_s)} and {to_utc_text(last_t_s)}: "
            f"take the passes of one side"
        )


def mean_elements(
    old: Elements, epoch_t_s: float, t_s: Array, position_m: Array, air: float
) -> tuple[Elements, float]:
    """Return mean elements that follow positions (n, 3) in TEME best, and their rms distance, m.

    B* is that of the old ones times the factor of the drag.
    """
    from scipy.optimize import least_squares

    # SGP4 keeps the mean elements of its last call: where the drift of ten days has brought them.
    record = old.satrec()
    leap_s = leap_seconds().tai_minus_utc_s(epoch_t_s) - leap_seconds().tai_minus_utc_s(
        old.epoch_t_s
    )
    record.sgp4_tsince((epoch_t_s - old.epoch_t_s + leap_s) / 60.0)
    fresh = replace(
        old, epoch_t_s=epoch_t_s, drag_per_earth_radius=old.drag_per_earth_radius * max(air, 0.0)
    )
    motion = old.mean_motion_rad_s * (record.a / record.am) ** 1.5
    start = np.array(
        [
            motion, record.em * math.cos(record.om), record.em * math.sin(record.om), record.im,
            record.Om, record.mm + record.om,
        ]
    )  # fmt: skip

    def made(p: Array) -> Elements:
        # A circle has no perigee: its vector has no singularity there.
        perigee = math.atan2(p[2], p[1])
        return replace(
            fresh, mean_motion_rad_s=float(p[0]), eccentricity=math.hypot(p[1], p[2]),
            inclination_rad=float(p[3]), ascending_node_rad=float(p[4]) % TURN,
            argument_of_perigee_rad=perigee % TURN, mean_anomaly_rad=(float(p[5]) - perigee) % TURN,
        )  # fmt: skip

    def off(p: Array) -> Array:
        propagated = made(p).satrec()
        days = (t_s - epoch_t_s) / DAY_S
        codes, places, _ = propagated.sgp4_array(
            np.full(len(t_s), propagated.jdsatepoch), propagated.jdsatepochF + days
        )
        if np.any(codes):
            raise ValueError(
                f"mean elements of {old.name} cannot follow the orbit: SGP4 gives code "
                f"{int(np.max(codes))}"
            )
        return np.asarray(1e3 * places - position_m).ravel()

    # A kilometre at the end of the arc, and a kilometre here.
    reach = max(float(np.max(np.abs(t_s - epoch_t_s))), 3600.0)
    scale = np.array([1.5e-4 / reach, *[1.5e-4] * 5])
    best = least_squares(off, start, x_scale=scale, diff_step=1e-7, method="lm")
    return made(best.x), float(np.sqrt(3.0 * np.mean(best.fun**2)))


@dataclass(frozen=True, kw_only=True, eq=False)
class Ephemeris:
    """An orbit at times (n,): TEME states (n, 6), covariances (n, 6, 6) in RTN axes [m, m/s]."""

    t_s: Array
    states: Array
    covariance: Array

    @classmethod
    def of(cls, found: Orbits, t_s: Array) -> "Ephemeris":
        """Return the first of the solutions at rising times."""
        states, covariance = found.at(t_s)
        axes = rtn_axes(states[0])
        turn = np.zeros((len(t_s), 6, 6))
        turn[:, :3, :3] = turn[:, 3:, 3:] = axes
        return cls(
            t_s=t_s, states=states[0], covariance=turn @ covariance[0] @ np.swapaxes(turn, -1, -2)
        )

    def sigmas_m(self) -> Array:
        """Return radial, along-track and cross-track sigma (n, 3)."""
        return np.asarray(np.sqrt(np.diagonal(self.covariance, axis1=1, axis2=2)[:, :3]))
