"""Orbit from range, range rate and angles: batch weighted least squares (SATCAL 2.2, Table 6).

Gauss-Newton on the state at the epoch; the partials are those of the integrated orbit.
`OrbitResult.shift_from` gives the effect of measurement errors on the orbit by linear theory:
dx = C A' W e.

The preliminary orbit (SATCAL 4.1, Table 2) uses 100 to 200 s of range and angles of one station
right after injection.  Its start fits the measured positions by r0 + v0 t + the twice-integrated
attraction along the path, which is the f and g series summed by iteration.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from rf_pointing.core import (
    as_finite_array,
    require_between,
    require_choice,
    unit_vector_from_azel,
    wrap_rad,
)
from rf_pointing.core.types import Array
from rf_pointing.orbit.forces import Disturbances
from rf_pointing.orbit.measurements import KINDS
from rf_pointing.papers.satcal_motion import (
    Gravity,
    Site,
    Trajectory,
    measured,
    partials,
    propagate,
    to_inertial,
)

_FEWEST, _SWEEPS, _DEGREE = 10, 4, 3


_MAX_ITERATIONS = 30
# In units of the state's own sigma: a smaller step changes nothing that the data can show.
_CONVERGED_SIGMA = 1e-4
# Rank by the scaled partials, so that metres and metres per second compare.
_RANK_TOLERANCE = 1e-11
_STATE_NAMES = ("x", "y", "z", "x rate", "y rate", "z rate")


@dataclass(frozen=True, eq=False)
class Arc:
    """One kind of measurement (`measurements.KINDS`) from one station.

    Values and sigma (n,) at `t_s` (n,).
    """

    site: Site
    kind: str
    t_s: Array
    values: Array
    sigma: Array

    def __post_init__(self) -> None:
        require_choice("kind", self.kind, KINDS)
        object.__setattr__(self, "t_s", as_finite_array("t_s", self.t_s, (None,)))
        for name in ("values", "sigma"):
            spread = np.broadcast_to(getattr(self, name), self.t_s.shape)
            object.__setattr__(self, name, as_finite_array(name, spread, (len(self.t_s),)))
        if np.any(self.sigma <= 0.0):
            raise ValueError(
                f"sigma of {self.kind} at {self.site.name}={np.min(self.sigma)} must be > 0"
            )


@dataclass(frozen=True, eq=False)
class OrbitResult:
    """State (6,) at the epoch with covariance (6, 6).

    `residuals` are measured minus computed, one array per arc.
    """

    epoch_t_s: float
    state: Array
    covariance: Array
    residuals: tuple[Array, ...]
    condition: float
    iterations: int
    gain: tuple[Array, ...]
    """Change of the state (6, n) per unit of error of each measurement of each arc, by linear
    theory."""

    def shift_from(self, errors: Sequence[ArrayLike]) -> Array:
        """Return the change of the state (6,) that `errors` (one entry per arc, broadcast over it)
        cause.
        """
        return np.asarray(
            sum(
                gain @ np.broadcast_to(np.asarray(error, dtype=np.float64), gain.shape[1:])
                for gain, error in zip(self.gain, errors, strict=True)
            )
        )


def times_of(arcs: Sequence[Arc]) -> Array:
    """Return the times (n,) at which the arcs need the orbit."""
    return np.unique(np.concatenate([arc.t_s for arc in arcs]))


def fit_orbit(
    epoch_t_s: float,
    guess: ArrayLike,
    arcs: Sequence[Arc],
    gravity: Gravity,
    *,
    orbit: Trajectory | None = None,
    disturbances: Disturbances | None = None,
) -> OrbitResult:
    """Return the orbit that fits all arcs best, from a `guess` (6,) of the state at the epoch.

    `orbit` is that of the guess at `times_of(arcs)` with its partials, where it is known already.
    Raises ValueError if the arcs do not determine six elements, the iteration does not settle, or
    `orbit` is given at other times.
    """
    state = as_finite_array("guess", guess, (6,)).copy()
    times = times_of(arcs)
    if orbit is not None and not np.array_equal(orbit.t_s, times):
        raise ValueError(
            f"orbit is given at {len(orbit.t_s)} times, must be at the {len(times)} times of the arcs"
        )
    known = orbit
    for iteration in range(1, _MAX_ITERATIONS + 1):
        now = known or propagate(
            epoch_t_s, state, times, gravity, with_partials=True, disturbances=disturbances
        )
        matrix, residuals = _linearised(now, arcs)
        # The given orbit belongs to the guess: after the first step it must be propagated anew.
        known = None
        sigma = np.concatenate([arc.sigma for arc in arcs])
        # Weighted rows, so that sigma of a measurement alone decides what it contributes.
        inverse, covariance, condition = _pseudo_inverse(matrix / sigma[:, np.newaxis])
        step = inverse @ (np.concatenate(residuals) / sigma)
        state += step
        if np.max(np.abs(step) / np.sqrt(np.diag(covariance))) < _CONVERGED_SIGMA:
            # The gain is kept per arc: a bias of one station can be propagated alone.
            split = np.cumsum([len(arc.t_s) for arc in arcs])[:-1]
            gain = tuple(np.split(inverse / sigma, split, axis=1))
            return OrbitResult(
                epoch_t_s, state, covariance, tuple(residuals), condition, iteration, gain
            )
    raise ValueError(f"orbit fit has not settled after {_MAX_ITERATIONS} iterations")


def _linearised(orbit: Trajectory, arcs: Sequence[Arc]) -> tuple[Array, list[Array]]:
    if orbit.partials is None:
        raise ValueError("orbit.partials=None: they are needed")
    rows, residuals = [], []
    for arc in arcs:
        place, column = np.searchsorted(orbit.t_s, arc.t_s), KINDS.index(arc.kind)
        states = orbit.states[place]
        computed = measured(arc.t_s, states, arc.site)[:, column]
        difference = arc.values - computed
        residuals.append(wrap_rad(difference) if arc.kind == "azimuth_rad" else difference)
        rows.append(
            np.einsum(
                "nj,njk->nk", partials(arc.t_s, states, arc.site)[:, column], orbit.partials[place]
            )
        )
    return np.concatenate(rows), residuals


def _pseudo_inverse(matrix: Array) -> tuple[Array, Array, float]:
    scale = np.linalg.norm(matrix, axis=0)
    if np.any(scale == 0.0) or len(matrix) < 6:
        silent = [name for name, size in zip(_STATE_NAMES, scale, strict=True) if size == 0.0]
        raise ValueError(
            f"{len(matrix)} measurements do not determine {', '.join(silent or _STATE_NAMES)}"
        )
    left, singular, rotation = np.linalg.svd(matrix / scale, full_matrices=False)
    if singular[-1] < _RANK_TOLERANCE * singular[0]:
        direction = np.linalg.norm(rotation[singular < _RANK_TOLERANCE * singular[0]], axis=0)
        names = [
            n
            for n, share in zip(_STATE_NAMES, direction / direction.max(), strict=True)
            if share > 0.1
        ]
        raise ValueError(f"the measurements cannot separate {', '.join(names)} of the orbit")
    root = (rotation.T / singular) / scale[:, np.newaxis]
    return root @ left.T, root @ root.T, float(singular[0] / singular[-1])


def preliminary_orbit(
    site: Site,
    t_s: Array,
    range_m: Array,
    azimuth_rad: Array,
    elevation_rad: Array,
    *,
    sigma_range_m: float,
    sigma_angle_rad: float,
    gravity: Gravity,
) -> OrbitResult:
    """Return the orbit at the middle of the data.

    All arrays (n,), n >= 10, from one pass of one station.  `sigma_angle_rad` is on the sky; in
    azimuth it counts as sigma / cos El.
    """
    epoch, guess = starting_state(site, t_s, range_m, azimuth_rad, elevation_rad, gravity)
    arcs = (
        Arc(site, "range_m", t_s, range_m, np.full(len(t_s), sigma_range_m)),
        # Azimuth errs by 1 / cos(El) more than the angle on the sky.
        Arc(site, "azimuth_rad", t_s, azimuth_rad, sigma_angle_rad / np.cos(elevation_rad)),
        Arc(site, "elevation_rad", t_s, elevation_rad, np.full(len(t_s), sigma_angle_rad)),
    )
    return fit_orbit(epoch, guess, arcs, gravity)


def starting_state(
    site: Site,
    t_s: Array,
    range_m: Array,
    azimuth_rad: Array,
    elevation_rad: Array,
    gravity: Gravity,
) -> tuple[float, Array]:
    """Return the middle time and a state (6,) there, good to the accuracy of the measured
    positions.
    """
    times = as_finite_array("t_s", t_s, (None,))
    require_between("samples", len(times), _FEWEST, None)
    positions = _positions(site, times, range_m, azimuth_rad, elevation_rad)
    epoch = float(0.5 * (times[0] + times[-1]))
    elapsed = times - epoch
    # Time in units of the half arc: powers of seconds would ruin the condition of the fit.
    half = max(abs(float(elapsed[0])), 1.0)
    path = positions
    for _ in range(_SWEEPS):
        fallen = _twice_integrated(elapsed / half, gravity.acceleration(path)) * half**2
        line = np.polynomial.polynomial.polyfit(elapsed / half, positions - fallen, 1)
        # The attraction is taken along the improved path: each sweep adds one order of the series.
        path = line[0] + np.outer(elapsed / half, line[1]) + fallen
    return epoch, np.concatenate([line[0], line[1] / half])


def _positions(
    site: Site, t_s: Array, range_m: Array, azimuth_rad: Array, elevation_rad: Array
) -> Array:
    sight = as_finite_array("range_m", range_m, (len(t_s),))[:, np.newaxis] * unit_vector_from_azel(
        azimuth_rad, elevation_rad
    )
    return to_inertial(site.position_m() + sight @ site.axes(), t_s)


def _twice_integrated(x: Array, acceleration: Array) -> Array:
    """Return the double integral from x = 0 of a cubic through the acceleration (n, 3)."""
    cubic = np.polynomial.polynomial.polyfit(x, acceleration, _DEGREE)
    power = np.arange(_DEGREE + 1)
    weights = cubic / ((power + 1) * (power + 2))[:, np.newaxis]
    return np.asarray(x[:, np.newaxis] ** 2 * np.polynomial.polynomial.polyval(x, weights).T)
