"""Least-squares fit of the bias model (SATCAL eqs. 3-8), by orthogonal triangles instead of (A'A)^-1.

One round of the loop: linearise about the current coefficients, solve, edit.  With the printed form the equations are
linear and only the editing iterates; with the rotation form the loop is Gauss-Newton on the exact model, which is the
paper's "updated iteratively".
"""

from collections.abc import Iterable, Mapping

import numpy as np

from rf_pointing.calibration.editing import huber_weights, normalised_size, within_limit
from rf_pointing.calibration.fit_options import FitOptions, Prior
from rf_pointing.calibration.fit_problem import FitProblem, Round
from rf_pointing.calibration.fit_result import FitResult, Rejected
from rf_pointing.calibration.observations import Observations
from rf_pointing.calibration.pass_errors import PassPriors
from rf_pointing.calibration.sandwich import sandwich_covariance
from rf_pointing.calibration.terms import TERM_NAMES, terms_by_name

__all__ = ["check_names", "fit_bias_model", "held_at_zero"]

_CONVERGED_SIGMA = 1e-6
_WEIGHTS_SETTLED = 1e-4
_FREE_ROUNDS = 8
"""Rounds in which rejected observations may come back; afterwards editing only removes, so that it must end."""


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
    pass_priors: PassPriors | None = None,
    options: FitOptions | None = None,
) -> FitResult:
    """Fit `terms` to observed minus true angles; every other one of the 14 must be in `held` with its value.

    `pass_priors` adds orbit and clock errors of every pass to the unknowns.  Raises ValueError naming the terms that
    the data cannot separate, terms that are neither fitted nor held, and a fit that has not settled after
    `options.max_iterations`.
    """
    names, chosen = tuple(terms), options or FitOptions()
    check_names(names, held or {}, priors or {})
    if pass_priors is not None and chosen.covariance == "sandwich":
        raise ValueError("covariance='sandwich' with pass_priors counts the errors of a pass twice: choose one")
    backed = all(name in (priors or {}) for name in names)
    if len(observations.passes) < chosen.fewest_passes and not backed:
        raise ValueError(
            f"passes={len(observations.passes)} must be >= fewest_passes={chosen.fewest_passes}: "
            "the errors of one pass look like those of the mount; track more, or give every term a prior"
        )
    problem = FitProblem(observations, names, dict(held or {}), dict(priors or {}), pass_priors, chosen.form)
    last = _iterate(problem, chosen)
    _check_left(observations, last, chosen, backed)
    return _result(problem, last, chosen)


def _iterate(problem: FitProblem, options: FitOptions) -> Round:
    used = np.ones(len(problem.data), dtype=bool)
    weight = np.ones(len(problem.data))
    values = problem.start()
    for number in range(1, options.max_iterations + 1):
        now = problem.solve(values, used, weight, number)
        step = float(np.max(np.abs(now.solution.values - values) / np.sqrt(np.diag(now.solution.covariance))))
        values = now.solution.values
        size = normalised_size(now.residuals, problem.sigmas, used)
        keep = within_limit(size, options.edit_sigma, used, may_return=number <= _FREE_ROUNDS)
        lighter = huber_weights(size, options.huber_sigma)
        settled = np.array_equal(keep, used) and np.allclose(lighter, weight, rtol=0.0, atol=_WEIGHTS_SETTLED)
        if settled and (problem.linear or step < _CONVERGED_SIGMA):
            return now
        used, weight = keep, lighter
    raise ValueError(f"max_iterations={options.max_iterations}: the fit has not settled")


def _check_left(data: Observations, last: Round, options: FitOptions, backed: bool) -> None:
    """Refuse a fit whose editing has thrown away what it was to be fitted to."""
    out = ~last.used
    numbers, counts = np.unique(data.pass_id[out], return_counts=True)
    worst = ", ".join(str(number) for number in numbers[np.argsort(-counts, kind="stable")][:4].tolist())
    if np.mean(out) > options.most_edited:
        raise ValueError(
            f"{int(np.sum(out))} of {len(data)} observations were edited out ({100.0 * np.mean(out):.0f} %), most of them of "
            f"pass {worst}; must be <= {100.0 * options.most_edited:g} %: passes that contradict each other, sigmas too small, "
            "or terms that are missing"
        )
    left = len(np.unique(data.pass_id[last.used]))
    if left < options.fewest_passes and not backed:
        raise ValueError(
            f"passes={left} are left after editing, must be >= fewest_passes={options.fewest_passes}: pass {worst} contradict "
            "the others"
        )


def _result(problem: FitProblem, last: Round, options: FitOptions) -> FitResult:
    data, solution, used = problem.data, last.solution, last.used
    freedom = 2 * int(np.sum(used)) - len(problem.names) + len(problem.priors)
    variance = [float(np.mean((r[used] / s[used]) ** 2)) for r, s in zip(last.residuals, problem.sigmas, strict=True)]
    covariance = solution.covariance
    if options.covariance == "sandwich":
        covariance = sandwich_covariance(problem.names, covariance, problem.weighted_passes(last))
    elif options.scale_covariance:
        covariance = covariance * (solution.residual_square / max(freedom, 1))
    size = normalised_size(last.residuals, problem.sigmas, used)
    return FitResult(
        names=problem.names,
        values=solution.values,
        covariance=covariance,
        held=problem.held,
        form=options.form,
        station=data.station,
        band=data.band,
        rank=solution.rank,
        condition=solution.condition,
        iterations=last.number,
        residual_azimuth_rad=last.residuals[0],
        residual_elevation_rad=last.residuals[1],
        pass_azimuth_rad=last.pass_offsets[0],
        pass_elevation_rad=last.pass_offsets[1],
        cos_elevation=np.cos(data.true_elevation_rad),
        used=used,
        rejected=tuple(
            Rejected(int(row), float(data.t_s[row]), int(data.pass_id[row]), f"residual of {size[row]:.1f} sigma")
            for row in np.flatnonzero(~used)
        ),
        variance_azimuth=variance[0],
        variance_elevation=variance[1],
        degrees_of_freedom=freedom,
        first_t_s=float(np.min(data.t_s)),
        last_t_s=float(np.max(data.t_s)),
        passes=len(np.unique(data.pass_id[used])),
        pass_errors=problem.pass_errors(last),
        pass_priors=problem.pass_priors,
    )


def check_names(names: tuple[str, ...], held: Mapping[str, float], priors: Mapping[str, Prior]) -> None:
    """Raise ValueError unless every one of the 14 terms is either fitted or held and all names are known."""
    if not names:
        raise ValueError("terms is empty, must name at least one term to fit")
    terms_by_name(names)
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
