"""Least-squares fit of the bias model (SATCAL eqs. 3-8), by orthogonal triangles instead of (A'A)^-1.

One pass of the loop: linearise about the current coefficients, solve, edit.  With the printed form the equations are
linear and only the editing iterates; with the rotation form the loop is Gauss-Newton on the exact model, which is the
paper's "updated iteratively".
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rf_pointing.calibration.bias_model import BiasModel
from rf_pointing.calibration.design import Block, angles_of, design_blocks
from rf_pointing.calibration.fit_result import FitResult, Rejected
from rf_pointing.calibration.observations import Observations
from rf_pointing.calibration.terms import TERM_NAMES, terms_by_name
from rf_pointing.calibration.triangle import Solution, Triangle
from rf_pointing.geometry import Params, parameter, wrap_rad

__all__ = ["FitOptions", "Prior", "fit_bias_model", "held_at_zero"]

Array = NDArray[np.float64]
_CONVERGED_SIGMA = 1e-6


@dataclass(frozen=True)
class Prior:
    """Knowledge of one term before the data: value and standard deviation in the term's unit."""

    value: float
    sigma: float


@dataclass(frozen=True, kw_only=True)
class FitOptions(Params):
    """How the fit treats its data."""

    form: str = parameter("printed", "model form: SATCAL (1)-(2) or exact rotations", choices=("printed", "rotation"))
    edit_sigma: float = parameter(3.0, "residuals beyond this many sigma are left out; 0: none", low=0.0, high=100.0)
    huber_sigma: float = parameter(
        0.0, "residuals beyond this many sigma count linearly; 0: squared", low=0.0, high=10.0
    )
    max_iterations: int = parameter(30, "bound of the editing and linearisation loop", low=1, high=1000)
    scale_covariance: bool = parameter(False, "multiply the covariance by the measured residual variance")


def held_at_zero(fitted: Iterable[str]) -> dict[str, float]:
    """Return the terms among the 14 that are not in `fitted`, each held at zero."""
    names = set(fitted)
    return {name: 0.0 for name in TERM_NAMES if name not in names}


def fit_bias_model(
    observations: Observations,
    *,
    terms: Iterable[str] = TERM_NAMES,
    held: Mapping[str, float] | None = None,
    priors: Mapping[str, Prior] | None = None,
    options: FitOptions | None = None,
) -> FitResult:
    """Fit `terms` to observed minus true angles; every other one of the 14 must be in `held` with its value.

    Raises ValueError naming the terms that the data cannot separate, terms that are neither fitted nor held, and a
    fit that has not settled after `options.max_iterations`.
    """
    problem = _Problem(observations, tuple(terms), dict(held or {}), dict(priors or {}), options or FitOptions())
    return problem.solve()


class _Problem:
    """The data and the choices of one fit, prepared once."""

    def __init__(
        self,
        observations: Observations,
        names: tuple[str, ...],
        held: dict[str, float],
        priors: dict[str, Prior],
        options: FitOptions,
    ) -> None:
        self.data, self.names, self.held, self.priors, self.options = observations, names, held, priors, options
        self.terms = terms_by_name(names)
        _check_names(names, held, priors)
        self.angles = angles_of(observations)
        self.blocks = design_blocks(self.angles, self.terms)
        self.sigma = (observations.sigma_azimuth_rad, observations.sigma_elevation_rad)
        self.measured = (observations.residual_azimuth_rad, observations.residual_elevation_rad)

    def solve(self) -> FitResult:
        used = np.ones(len(self.data), dtype=bool)
        robust = np.ones(len(self.data))
        values = self._start()
        for iteration in range(1, self.options.max_iterations + 1):
            offset = self._modelled(values)
            solution = self._solve_linear(values, offset, used, robust)
            step = np.max(np.abs(solution.values - values) / np.sqrt(np.diag(solution.covariance)))
            values = solution.values
            residual = self._residual(self._modelled(values))
            keep, robust_next = self._edit(residual, used), self._robust(residual)
            settled = np.array_equal(keep, used) and np.allclose(robust_next, robust, atol=1e-4)
            if settled and (step < _CONVERGED_SIGMA or self._linear):
                return self._result(solution, residual, used, robust, iteration)
            used, robust = keep, robust_next
        raise ValueError(f"max_iterations={self.options.max_iterations}: the fit has not settled")

    @property
    def _linear(self) -> bool:
        return self.options.form == "printed"

    def _start(self) -> Array:
        return np.array([self.priors[n].value if n in self.priors else 0.0 for n in self.names])

    def _modelled(self, values: Array) -> tuple[Array, Array]:
        model = BiasModel({**self.held, **dict(zip(self.names, values, strict=True))})
        motion, temperature = self.data.motion(), self.data.temperature_k
        if self._linear:
            return model.offset_rad(*motion, temperature_k=temperature)
        azimuth, elevation = model.apply(*motion, temperature_k=temperature)
        return azimuth - motion[0], elevation - motion[1]

    def _residual(self, offset: tuple[Array, Array]) -> tuple[Array, Array]:
        return wrap_rad(self.measured[0] - offset[0]), self.measured[1] - offset[1]

    def _solve_linear(
        self, values: Array, offset: tuple[Array, Array], used: NDArray[np.bool_], robust: Array
    ) -> Solution:
        triangle = Triangle(self.names)
        residual = self._residual(offset)
        for block, axis_residual, sigma in zip(self.blocks, residual, self.sigma, strict=True):
            _fold(triangle, block, axis_residual, values, (np.sqrt(robust) / sigma), used)
        for name, prior in self.priors.items():
            triangle.add_prior(name, prior.value, prior.sigma)
        return triangle.solve()

    def _normalised(self, residual: tuple[Array, Array]) -> Array:
        return np.maximum(np.abs(residual[0] / self.sigma[0]), np.abs(residual[1] / self.sigma[1]))

    def _edit(self, residual: tuple[Array, Array], used: NDArray[np.bool_]) -> NDArray[np.bool_]:
        limit = self.options.edit_sigma
        if limit == 0.0:
            return used
        size = self._normalised(residual)
        # Against the spread of the data, not the stated sigma: an orbit error common to a pass is no outlier.
        spread = max(1.0, float(np.median(size)) / 1.05)
        return size <= limit * spread * 1.15

    def _robust(self, residual: tuple[Array, Array]) -> Array:
        limit = self.options.huber_sigma
        size = self._normalised(residual)
        return np.ones_like(size) if limit == 0.0 else np.minimum(1.0, limit / np.maximum(size, 1e-300))

    def _result(
        self,
        solution: Solution,
        residual: tuple[Array, Array],
        used: NDArray[np.bool_],
        robust: Array,
        iterations: int,
    ) -> FitResult:
        freedom = 2 * int(np.sum(used)) - len(self.names) + len(self.priors)
        variance = [
            float(np.mean((r[used] / s[used]) ** 2 * robust[used])) for r, s in zip(residual, self.sigma, strict=True)
        ]
        scale = solution.residual_square / max(freedom, 1) if self.options.scale_covariance else 1.0
        return FitResult(
            names=self.names,
            values=solution.values,
            covariance=solution.covariance * scale,
            held=self.held,
            form=self.options.form,
            station=self.data.station,
            band=self.data.band,
            rank=solution.rank,
            condition=solution.condition,
            iterations=iterations,
            residual_azimuth_rad=residual[0],
            residual_elevation_rad=residual[1],
            cos_elevation=self.angles.cos_elevation(1),
            used=used,
            rejected=self._rejected(residual, used),
            variance_azimuth=variance[0],
            variance_elevation=variance[1],
            degrees_of_freedom=freedom,
            first_t_s=float(np.min(self.data.t_s)),
            last_t_s=float(np.max(self.data.t_s)),
            passes=len(self.data.passes),
        )

    def _rejected(self, residual: tuple[Array, Array], used: NDArray[np.bool_]) -> tuple[Rejected, ...]:
        size = self._normalised(residual)
        return tuple(
            Rejected(int(row), float(self.data.t_s[row]), int(self.data.pass_id[row]), f"{size[row]:.1f} sigma")
            for row in np.flatnonzero(~used)
        )


def _check_names(names: tuple[str, ...], held: Mapping[str, float], priors: Mapping[str, Prior]) -> None:
    if not names:
        raise ValueError("terms is empty, must name at least one term to fit")
    terms_by_name(held)
    both = [name for name in names if name in held]
    if both:
        raise ValueError(f"term {', '.join(both)} is both fitted and held")
    missing = [name for name in TERM_NAMES if name not in names and name not in held]
    if missing:
        raise ValueError(f"term {', '.join(missing)} is neither fitted nor held: give it a value in held")
    astray = [name for name in priors if name not in names]
    if astray:
        raise ValueError(f"prior of {', '.join(astray)}: not a fitted term")


def _fold(
    triangle: Triangle, block: Block, residual: Array, values: Array, weight: Array, used: NDArray[np.bool_]
) -> None:
    if len(block.columns) == 0:
        return
    right = residual + block.matrix @ values[block.columns]
    scale = weight[used]
    triangle.add(block.matrix[used] * scale[:, np.newaxis], right[used] * scale, block.columns)
