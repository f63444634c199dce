"""The orbit that fits the passes of any stations, with the covariance that it really has.

Weighted least squares in square-root form, from a prior orbit, over

    estimated     state at the epoch, factor of the drag, a change of velocity at a known time
    stochastic    clock, angle biases and biases of range and rate of each pass, which a station
                  keeps from pass to pass with a memory (first-order Gauss-Markov)
    considered    the Earth's field beyond its degree, radiation, refraction of each station

Consider parameters are not estimated: their sigma adds to the covariance (`square_root`).  Several
problems with the same passes, say 300 trials, are solved together: their orbits are one bundle of
the integrator.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import partial

import numpy as np

from rf_pointing.core import EARTH_MU_M3_S2, Array, BoolArray, IntArray, Params, parameter, wrap_rad
from rf_pointing.ephemeris.uncertainty import ElementUncertainty
from rf_pointing.orbit.forces import Disturbances
from rf_pointing.orbit.measurements import KINDS, StationMotion, measured_from, partials_from
from rf_pointing.orbit.motion import point_mass, propagate_together
from rf_pointing.orbit.square_root import Estimate, triangular

STATE = ("x", "y", "z", "x rate", "y rate", "z rate")
BURN = ("burn x", "burn y", "burn z")
BIASES = dict(
    zip(KINDS, ("azimuth bias", "elevation bias", "range bias", "rate bias"), strict=True)
)
COMBINATIONS = (
    "semi-major axis", "eccentricity along the radius", "eccentricity across it",
    "place along the track", "cross-track here", "cross-track a quarter of a revolution on",
)  # fmt: skip
"""Small changes of a nearly circular orbit, each in metres; the columns of `orbit_changes`."""
# The differences of neighbouring orbits, and of orbits with other forces.
_STEP_M, _STEP_M_S = 1.0, 1e-3
_MOST_ITERATIONS = 15
_SETTLED_SIGMA = 3e-3
# Points are judged where the orbit is nearly right, or where it will not become so: what does not
# fit then counts less, and the iteration ends.
_NEARLY_M, _MOST_UNJUDGED = 300.0, 6
OUTLIER_SIGMA = 5.0
_MOST_LINKED = 0.95
_LOOSE_S = 10.0
"""Sigma of a clock that is taken to be wrong."""
_LEAST_AXIS_SIGMA_M = 200.0
"""Short-period terms that mean elements leave out, as an error of the semi-major axis."""


@dataclass(frozen=True, kw_only=True)
class Priors(Params):
    """One-sigma knowledge of everything but the orbit, before the passes."""

    clock_s: float = parameter(0.01, "clock of a station", 1e-6, 100.0)
    azimuth_bias_rad: float = parameter(1e-4, "azimuth of a station, on the sky", 1e-7, 0.1)
    elevation_bias_rad: float = parameter(1e-4, "elevation of a station", 1e-7, 0.1)
    range_bias_m: float = parameter(100.0, "range of a station", 1e-3, 1e7)
    rate_bias_m_s: float = parameter(
        1e4, "range rate of a pass, as the oscillators leave it", 1e-6, 1e6
    )
    memory_s: float = parameter(86400.0, "time in which a station forgets its biases", 1.0, 1e9)
    air: float = parameter(0.5, "factor of the drag", 1e-3, 10.0)
    burn_m_s: float = parameter(5.0, "change of velocity of a manoeuvre", 1e-4, 1e4)
    field: float = parameter(1.0, "share of the field beyond its degree, considered", 0.0, 10.0)
    radiation: float = parameter(0.3, "radiation, considered", 0.0, 10.0)
    refraction: float = parameter(0.05, "refraction of a station, considered", 0.0, 1.0)

    def bias(self, kind: str) -> float:
        """Return the sigma of the bias of a measured quantity."""
        by_kind = (
            self.azimuth_bias_rad, self.elevation_bias_rad, self.range_bias_m, self.rate_bias_m_s,
        )  # fmt: skip
        return dict(zip(KINDS, by_kind, strict=True))[kind]


@dataclass(frozen=True, kw_only=True, eq=False)
class PassData:
    """Points of one pass at n times: values (..., n, k) of k `kinds`, with sigma (k,).

    Angles are true ones, on the sky: free of the mount's model and of refraction, which bent the
    elevation by `bending_rad` (n,).  Sigma and bias of azimuth count on the sky.
    """

    station: str
    t_s: Array
    motion: StationMotion
    kinds: tuple[str, ...]
    values: Array
    sigma: Array
    bending_rad: Array

    @property
    def columns(self) -> list[int]:
        """Places of its kinds among `KINDS`."""
        return [KINDS.index(kind) for kind in self.kinds]


@dataclass(frozen=True, kw_only=True, eq=False)
class Prior:
    """Orbits known before: states (trials, 6) at the epoch in TEME, and one covariance (6, 6)."""

    epoch_t_s: float
    states: Array
    covariance: Array


@dataclass(frozen=True, kw_only=True, eq=False)
class Dynamics:
    """The forces, and the time of a manoeuvre whose change of velocity is estimated."""

    forces: Disturbances
    manoeuvre_t_s: float | None = None

    @property
    def names(self) -> tuple[str, ...]:
        """Estimated parameters of the motion."""
        return (*STATE, "air", *(() if self.manoeuvre_t_s is None else BURN))

    considered = ("field", "radiation")

    def flow(self, epoch_t_s: float, values: Array, t_s: Array) -> tuple[Array, Array]:
        """Return states (trials, n, 6) and their partials (trials, n, 6, q) at rising times (n,).

        `values` (trials, p) are those of `names`; q has `considered` behind them.
        """
        burn = [_STEP_M_S] * (len(self.names) - 7)
        size = np.array([_STEP_M] * 3 + [_STEP_M_S] * 3 + [1.0, *burn, 1.0, 1.0])
        moves = np.concatenate([np.zeros((1, len(size))), np.diag(size)])
        # Consider parameters stay nominal: no field beyond its degree, radiation as modelled.
        nominal = np.concatenate([values, np.broadcast_to([0.0, 1.0], (len(values), 2))], axis=1)
        every = self.states(epoch_t_s, nominal + moves[:, np.newaxis], t_s)
        return every[0], np.moveaxis(every[1:] - every[0], 0, -1) / size

    def states(self, epoch_t_s: float, values: Array, t_s: Array) -> Array:
        """Return states (..., n, 6) of values (..., q) of `names` and of `considered`."""
        flat = values.reshape(-1, values.shape[-1])
        # In the order of `forces.NOMINAL_SCALES`.
        scales = np.stack([flat[:, 6], flat[:, -1], flat[:, -2]], axis=1)
        fly = partial(
            propagate_together, gravity=point_mass, disturbances=self.forces, scales=scales
        )
        start, burn_t_s = flat[:, :6], self.manoeuvre_t_s
        if burn_t_s is None:
            whole = fly(start, t_s - epoch_t_s, epoch_t_s=epoch_t_s)
        else:
            until_s = np.append(np.minimum(t_s, burn_t_s), burn_t_s) - epoch_t_s
            *before, there = fly(start, until_s, epoch_t_s=epoch_t_s)
            there[:, 3:] += flat[:, 7:10]
            after = fly(there, np.maximum(t_s - burn_t_s, 0.0), epoch_t_s=burn_t_s)
            whole = np.where((t_s <= burn_t_s)[:, np.newaxis, np.newaxis], before, after)
        return np.moveaxis(whole, 0, 1).reshape(*values.shape[:-1], len(t_s), 6)


@dataclass(frozen=True, kw_only=True, eq=False)
class Orbits:
    """Solutions of several trials: values (trials, p) of `names`, with covariances.

    `used` (trials, values) says which values were taken, pass by pass and kind by kind; `scale`
    (trials, passes) is by how much the sigma of a pass had to grow.
    """

    prior: Prior
    dynamics: Dynamics
    priors: Priors
    passes: tuple[PassData, ...]
    names: tuple[str, ...]
    values: Array
    formal: Array
    sensitivity: Array
    considered: tuple[str, ...]
    scale: Array
    used: BoolArray
    iterations: int

    def covariance(self) -> Array:
        """Return the covariances (trials, p, p), with what is considered."""
        sigma = self._considered_sigma()
        effect = self.sensitivity * sigma
        return np.asarray(self.formal + effect @ np.swapaxes(effect, -1, -2))

    def at(self, t_s: Array) -> tuple[Array, Array]:
        """Return states (trials, n, 6) and total covariances (trials, n, 6, 6) at rising times."""
        moving = len(self.dynamics.names)
        states, slopes = self.dynamics.flow(self.prior.epoch_t_s, self.values[:, :moving], t_s)
        own = slopes[..., :moving]
        # Biases of passes are correlated with the orbit, and do not move it.
        known = np.einsum("tnij,tjk,tnlk->tnil", own, self.formal[:, :moving, :moving], own)
        effect = np.einsum("tnij,tjc->tnic", own, self.sensitivity[:, :moving])
        # The field and radiation move the orbit beyond what they have spoiled in the fit.
        effect[..., :2] += slopes[..., moving:]
        effect = effect * self._considered_sigma()
        return states, known + effect @ np.swapaxes(effect, -1, -2)

    def _considered_sigma(self) -> Array:
        rest = [self.priors.refraction] * (len(self.considered) - 2)
        return np.array([self.priors.field, self.priors.radiation, *rest])

    def undetermined(self, share: float = 0.5) -> list[str]:
        """Return which combinations the passes leave to the prior: over `share` of its sigma."""
        change = np.linalg.inv(orbit_changes(self.values[0, :6]))
        before = np.sqrt(np.diag(change @ self.prior.covariance @ change.T))
        after = np.sqrt(np.diag(change @ self.covariance()[0, :6, :6] @ change.T))
        return [
            f"{name} ({late:.0f} m of {early:.0f} m)"
            for name, late, early in zip(COMBINATIONS, after, before, strict=True)
            if late > share * early
        ]


def rtn_axes(states: Array) -> Array:
    """Return the rows (..., 3, 3) radial, transverse and normal of inertial states (..., 6)."""
    position, velocity = states[..., :3], states[..., 3:]
    radial = position / np.linalg.norm(position, axis=-1, keepdims=True)
    normal = np.cross(position, velocity)
    normal = normal / np.linalg.norm(normal, axis=-1, keepdims=True)
    return np.stack([radial, np.cross(normal, radial), normal], axis=-2)


def orbit_changes(state: Array) -> Array:
    """Return how `COMBINATIONS`, each by a metre, change an inertial state (6,): (6, 6)."""
    radius = float(np.linalg.norm(state[:3]))
    n = math.sqrt(EARTH_MU_M3_S2 / radius**3)
    # Hill: radial a - e_x cos + ..., along -1.5 n a t; velocities in inertial axes.
    change = np.zeros((6, 6))
    # The axes of velocity do not turn here: v = d/dt + n x r.
    change[:3, :] = [[1, -1, 0, 0, 0, 0], [0, 0, -2, 1, 0, 0], [0, 0, 0, 0, 1, 0]]
    change[3:, :] = n * np.array([[0, 0, 1, -1, 0, 0], [-0.5, 1, 0, 0, 0, 0], [0, 0, 0, 0, 0, 1]])
    axes = rtn_axes(state)
    return np.concatenate([axes.T @ change[:3], axes.T @ change[3:]])


def covariance_of_elements(state: Array, age_s: float, model: ElementUncertainty) -> Array:
    """Return the covariance (6, 6) of a state by mean elements of an age, in inertial axes.

    The growth of the along-track error is that of an error of the semi-major axis.
    """
    along, cross, radial = model.sigmas_m(age_s)
    n = math.sqrt(EARTH_MU_M3_S2 / float(np.linalg.norm(state[:3])) ** 3)
    # A wrong axis by da is -1.5 n da along the track each second.
    growth_m_s = model.along_growth_m_s + 2.0 * model.along_drag_m_s2 * abs(age_s)
    axis = math.hypot(growth_m_s / (1.5 * n), _LEAST_AXIS_SIGMA_M)
    change = orbit_changes(state) * np.array([axis, radial, radial, along, cross, cross])
    return np.asarray(change @ change.T)


@dataclass(eq=False)
class _Rows:
    """Layout of the parameters, and the rows of all passes."""

    dynamics: Dynamics
    passes: Sequence[PassData]
    priors: Priors
    names: list[str] = field(init=False)
    considered: list[str] = field(init=False)

    def __post_init__(self) -> None:
        self.names, self.places = list(self.dynamics.names), []
        self.stations = sorted({one.station for one in self.passes})
        self.considered = [
            *self.dynamics.considered,
            *(f"refraction at {name}" for name in self.stations),
        ]
        for number, one in enumerate(self.passes, start=1):
            self.places.append(len(self.names))
            self.names += [
                f"{name} of pass {number}"
                for name in ("clock", *(BIASES[kind] for kind in one.kinds))
            ]
        self.times = np.unique(np.concatenate([one.t_s for one in self.passes]))
        self.own = np.concatenate(
            [
                [k] * one.values[..., 0, :].shape[-1] * len(one.t_s)
                for k, one in enumerate(self.passes)
            ]
        )

    def prior_covariance(self, orbit: Array, loose: int | None) -> Array:
        """Return the covariance (p, p) of all parameters before the passes."""
        found = np.zeros((len(self.names),) * 2)
        found[:6, :6] = orbit
        found[6, 6] = self.priors.air**2
        for k in range(7, len(self.dynamics.names)):
            found[k, k] = self.priors.burn_m_s**2
        for one, place in zip(self.passes, self.places, strict=True):
            for other, there in zip(self.passes, self.places, strict=True):
                if one.station != other.station:
                    continue
                apart_s = abs(float(one.t_s[0] - other.t_s[0]))
                # Two files of one pass must not make the covariance singular.
                kept = math.exp(-apart_s / self.priors.memory_s) * (
                    1.0 if one is other else 1.0 - 1e-6
                )
                found[place, there] = kept * self.priors.clock_s**2
                for k, kind in enumerate(one.kinds, start=1):
                    if kind in other.kinds:
                        # Oscillators of a satellite are another matter in every pass.
                        share = float(one is other) if kind == "range_rate_m_s" else kept
                        found[place + k, there + 1 + other.kinds.index(kind)] = (
                            share * self.priors.bias(kind) ** 2
                        )
        if loose is not None:
            found[self.places[loose], self.places[loose]] += _LOOSE_S**2
        return found

    def linear(self, values: Array, epoch_t_s: float) -> tuple[Array, Array, Array, Array]:
        """Return residuals (trials, rows), partials (.., p) and (.., c), and sigma of the rows."""
        moving = len(self.dynamics.names)
        states, slopes = self.dynamics.flow(epoch_t_s, values[:, :moving], self.times)
        trials, blocks = len(values), []
        for one, place in zip(self.passes, self.places, strict=True):
            rows = np.searchsorted(self.times, one.t_s)
            seen, columns = states[:, rows], one.columns
            calculated = measured_from(seen, one.motion, light=True)
            by_state = partials_from(seen, one.motion)[..., columns, :]
            shape = (trials, len(one.t_s), len(columns))
            partials = np.zeros((*shape, len(self.names)))
            whole = by_state @ slopes[:, rows]
            partials[..., :moving] = whole[..., :moving]
            considered = np.zeros((*shape, len(self.considered)))
            considered[..., :2] = whole[..., moving:]
            rates = np.zeros((*calculated.shape[:-1], 4))
            rates[..., 0], rates[..., 1] = one.motion.angle_rates(seen)
            rates[..., 2] = calculated[..., 3]
            # The oscillators err by far more than a clock of milliseconds makes of this.
            rates[..., 3] = np.gradient(calculated[..., 3], one.t_s, axis=1)
            # A late clock writes a time at which the satellite is further on.
            partials[..., place] = -rates[..., columns]
            sky = np.ones(shape)
            if "azimuth_rad" in one.kinds:
                sky[..., one.kinds.index("azimuth_rad")] = 1.0 / np.cos(calculated[..., 1])
            for k in range(len(columns)):
                partials[..., k, place + 1 + k] = sky[..., k]
            if "elevation_rad" in one.kinds:
                station = 2 + self.stations.index(one.station)
                considered[..., one.kinds.index("elevation_rad"), station] = one.bending_rad
            own = partials[..., place : place + 1 + len(columns)]
            mine = values[:, np.newaxis, np.newaxis, place : place + 1 + len(columns)]
            # Linear in the biases: a clock of 0.1 s curves an angle by 0.1 mdeg.
            residual = one.values - calculated[..., columns] - np.sum(own * mine, axis=-1)
            if "azimuth_rad" in one.kinds:
                k = one.kinds.index("azimuth_rad")
                residual[..., k] = wrap_rad(residual[..., k])
            sigma = one.sigma * sky
            # Kind by kind, so that the rows of a pass stay together.
            blocks.append(
                [
                    np.swapaxes(part, 1, 2).reshape(trials, -1, *part.shape[3:])
                    for part in (residual, partials, considered, sigma)
                ]
            )
        residual, partials, considered, sigma = (
            np.concatenate(part, axis=1) for part in zip(*blocks, strict=True)
        )
        return residual, partials, considered, sigma


def determine(
    prior: Prior, passes: Sequence[PassData], dynamics: Dynamics, priors: Priors,
    loose: int | None = None,
) -> Orbits:  # fmt: skip
    """Return the orbits that fit the passes best; every trial has its own prior state and values.

    The sigma of a pass grows to what its residuals show, and points beyond 5 of it are left out.
    Of the pass `loose`, by its place in time, the clock is not known.

    Raises
    ------
    ValueError
        Without a pass, for points before the epoch, or if the iteration does not settle.
    """
    ordered = tuple(sorted(passes, key=lambda one: float(one.t_s[0])))
    if not ordered:
        raise ValueError("passes=0, must be 1 or more")
    if float(ordered[0].t_s[0]) < prior.epoch_t_s:
        raise ValueError(
            f"the epoch {prior.epoch_t_s} must not lie after the first point {ordered[0].t_s[0]}"
        )
    rows = _Rows(dynamics, ordered, priors)
    trials, p = len(prior.states), len(rows.names)
    known = np.zeros((trials, p))
    # Biases are unknown around zero, the drag around that of B*.
    known[:, :6], known[:, 6] = prior.states, 1.0
    root = np.linalg.inv(np.linalg.cholesky(rows.prior_covariance(prior.covariance, loose)))
    values, weight = known.copy(), np.ones((trials, len(rows.own)))
    scale = np.ones((trials, len(ordered)))
    stage = 0
    for iteration in range(1, _MOST_ITERATIONS + 1):
        residual, partials, considered, sigma = rows.linear(values, prior.epoch_t_s)
        share = weight / (sigma * scale[:, rows.own])
        data = (
            np.concatenate([partials, considered, residual[..., np.newaxis]], axis=-1)
            * share[..., np.newaxis]
        )
        # The prior counts from where the iteration stands, not from where it began.
        before = np.zeros((trials, p, data.shape[-1]))
        before[..., :p], before[..., -1] = root, (known - values) @ root.T
        found = triangular(np.concatenate([before, data], axis=1), p)
        inverse = np.linalg.inv(found[..., :p])
        estimate = Estimate(
            np.asarray(np.einsum("tij,tj->ti", inverse, found[..., -1])),
            np.asarray(inverse @ np.swapaxes(inverse, -1, -2)),
            np.asarray(-inverse @ found[..., p:-1]),
        )
        step = estimate.values
        values = values + step
        # Residuals after the step, by linear theory: an orbit less to integrate.
        after = residual - np.einsum("trp,tp->tr", partials, step)
        settled = (
            np.max(np.abs(step) / np.sqrt(np.einsum("tii->ti", estimate.formal))) < _SETTLED_SIGMA
        )
        small = np.max(np.abs(step[:, :3])) < _NEARLY_M or iteration >= _MOST_UNJUDGED
        near = settled or (stage == 0 and small)
        if near and stage < 2:
            scale, weight = _judged(after / sigma, rows.own, len(ordered))
            stage += 1
        elif settled:
            return Orbits(
                prior=prior, dynamics=dynamics, priors=priors, passes=ordered,
                names=tuple(rows.names), values=values, formal=estimate.formal,
                sensitivity=estimate.sensitivity, considered=tuple(rows.considered), scale=scale,
                used=weight > 0.0, iterations=iteration,
            )  # fmt: skip
    raise ValueError(f"the orbit has not settled after {_MOST_ITERATIONS} iterations")


def _judged(normal: Array, own: IntArray, count: int) -> tuple[Array, Array]:
    """Return by how much the sigma of each pass must grow (trials, passes), and weights of rows."""
    scale, weight = np.ones((len(normal), count)), np.ones(normal.shape)
    for k in range(count):
        mine = normal[:, own == k]
        # The median of |x| is 0.6745 sigma, whatever a few outliers do.
        size = np.maximum(np.median(np.abs(mine), axis=1) / 0.6745, 1.0)
        kept = np.clip(mine / size[:, np.newaxis], -OUTLIER_SIGMA, OUTLIER_SIGMA)
        # Errors of a tracker last longer than a point: then n points are not n measurements.
        linked = np.sum(kept[:, 1:] * kept[:, :-1], axis=1) / np.sum(kept**2, axis=1)
        linked = np.where(
            linked > 2.0 / np.sqrt(mine.shape[1]), np.minimum(linked, _MOST_LINKED), 0.0
        )
        weight[:, own == k] = np.abs(mine) <= OUTLIER_SIGMA * size[:, np.newaxis]
        scale[:, k] = size * np.sqrt((1.0 + linked) / (1.0 - linked))
    return scale, weight
