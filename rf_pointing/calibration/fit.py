"""Least-squares fit of the bias model (SATCAL eqs. 3-8), by orthogonal triangles, not (A'A)^-1.

One round of the loop: linearise about the current coefficients, solve, edit.  With the printed form
the equations are linear and only the editing iterates; with the rotation form the loop is
Gauss-Newton on the exact model, which is the paper's "updated iteratively".

The covariance is that of independent noise, or the cluster sandwich, which stays honest when the
errors of one pass are correlated:

    cov = C [ sum_g u_g u_g' ] C,    C = (A'WA)^-1,    u_g = (1 - M_g C)^-1 s_g

with M_g = A_g'W A_g and s_g = A_g'W r_g, summed over passes.  The factor (1 - M_g C)^-1 undoes the
pull of a pass on its own residuals (Bell and McCaffrey's third correction, the delete-one-pass
jackknife): without it few passes give far too small a sigma.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from rf_pointing.calibration.fit_problem import FitProblem, Round
from rf_pointing.calibration.fit_result import FitResult, Nuisance, Prior, Rejected
from rf_pointing.calibration.noise import NoiseScale, share_after_editing
from rf_pointing.calibration.observations import Observations
from rf_pointing.calibration.pass_errors import PassPriors, SharedErrors
from rf_pointing.calibration.terms import mount_of, names_of, terms_by_name
from rf_pointing.core import AZIMUTH_ELEVATION, Array, BoolArray, Params, parameter

# A step of a millionth of sigma: below it rounding, not the data, moves the terms.
_CONVERGED_SIGMA = 1e-6
_WEIGHTS_SETTLED = 1e-4
_MOST_ROUNDS = 40
# Where a third has to go, the data contradict each other or the model.
_MOST_EDITED = 0.33
# Rejected observations may return in these rounds; later ones only remove, and so must end.
_FREE_ROUNDS = 8
# Ratio of sigma to the median of the absolute values, for a normal distribution.
_MEDIAN_TO_SIGMA = 1.4826
# Fewer passes give a matrix of scores that says more about these passes than about their errors.
_FEWEST_SANDWICH_PASSES = 5
_ALONE = 1e-8
# The measured excess of right sigmas scatters about 1, and only its upper half would count.
_EXCESS_SIGMA = 2.0


@dataclass(frozen=True, kw_only=True)
class FitOptions(Params):
    """How the fit treats its data.

    `covariance` "white" takes the stated sigmas as independent noise; "sandwich" measures how the
    errors of a pass are correlated (it needs many passes, edited beforehand).
    """

    form: str = parameter(
        "printed", "model form: SATCAL (1)-(2) or exact rotations", choices=("printed", "rotation")
    )
    edit_sigma: float = parameter(
        3.0, "residuals beyond this many sigma are left out; 0: none", 0.0, 100.0
    )
    huber_sigma: float = parameter(
        0.0, "residuals beyond this many sigma count linearly; 0: squared", 0.0, 10
    )
    covariance: str = parameter("white", "how sigma is computed", choices=("white", "sandwich"))
    fewest_passes: int = parameter(
        3, "fewer passes are refused unless every term has a prior", 1, 1000
    )
    scale_covariance: bool = parameter(
        False, "raise the white covariance where residuals are larger than sigma says"
    )

    def check_together(self) -> None:
        """Refuse editing before a sandwich."""
        # Editing cuts off the correlated errors that the sandwich has to measure.
        if self.covariance == "sandwich" and self.edit_sigma > 0.0:
            raise ValueError(
                f"edit_sigma={self.edit_sigma} must be 0 with covariance='sandwich': edit in the pipeline beforehand, "
                "or sigma comes out up to 1.7 times too small"
            )


def held_at_zero(fitted: Iterable[str]) -> dict[str, float]:
    """Return the terms among the 14 of their mount that are not in `fitted`, each held at zero."""
    names = list(fitted)
    return {name: 0.0 for name in names_of(mount_of(names)) if name not in names}


def fit_bias_model(
    observations: Observations, *, terms: Iterable[str] | None = None,
    held: Mapping[str, float] | None = None, priors: Mapping[str, Prior] | None = None,
    pass_priors: PassPriors | None = None, shared: SharedErrors | None = None,
    nuisances: Sequence[Nuisance] = (), options: FitOptions | None = None,
    start: FitResult | None = None,
) -> FitResult:  # fmt: skip
    """Fit `terms` to observed minus true angles (SATCAL eqs. 3-8).

    Parameters
    ----------
    terms, held
        Terms to fit, by name, by default the 14 of the mount; every other one of these must be in
        `held` with its value.
    priors
        Value and sigma of terms that are known before the data.
    pass_priors
        Sizes of orbit and clock errors, which are then estimated for every pass.
    shared
        Those that the passes of one set of elements have in common besides.
    nuisances
        What the whole campaign has in common, estimated with the terms.
    start
        A fit of nearly the same, from which fewer rounds are needed.

    Raises
    ------
    ValueError
        Naming terms that the data cannot separate or that are neither fitted nor held; for too few
        passes, too many rejected observations, and a fit that has not settled.
    """
    kind, chosen = observations.mount.type, options or FitOptions()
    names = names_of(kind) if terms is None else tuple(terms)
    _check_names(names, held or {}, priors or {}, kind)
    if pass_priors is not None and chosen.covariance == "sandwich":
        raise ValueError(
            "covariance='sandwich' with pass_priors counts the errors of a pass twice: choose one"
        )
    backed = all(name in (priors or {}) for name in names)
    if len(observations.passes) < chosen.fewest_passes and not backed:
        raise ValueError(
            f"passes={len(observations.passes)} must be >= fewest_passes={chosen.fewest_passes}: "
            "the errors of one pass look like those of the mount; track more, or give every term a prior"
        )
    problem = FitProblem(observations, names, dict(held or {}), dict(priors or {}), pass_priors, chosen.form,
                         shared, nuisances)  # fmt: skip
    last = _iterate(problem, chosen, start)
    _check_left(observations, last, chosen, backed)
    return _result(problem, last, chosen)


def _iterate(problem: FitProblem, options: FitOptions, start: FitResult | None) -> Round:
    used = np.ones(len(problem.data), dtype=bool)
    weight = np.ones(len(problem.data))
    values = problem.start()
    if start is not None:
        values = np.array([start.coefficients[name] for name in problem.names])
        # The edited points of the start are known only where the fit has the same points.
        used = start.used if len(start.used) == len(used) else used
    before: tuple[Array, Array] | None = None
    for number in range(1, _MOST_ROUNDS + 1):
        now = problem.solve(values, used, weight)
        step = (now.solution.values - values) / np.sqrt(np.diag(now.solution.covariance))
        values = now.solution.values
        size = normalised_size(now.residuals, problem.sigmas, used)
        keep = within_limit(size, options.edit_sigma, used, may_return=number <= _FREE_ROUNDS)
        lighter = huber_weights(size, options.huber_sigma)
        settled = np.array_equal(keep, used) and np.allclose(
            lighter, weight, rtol=0.0, atol=_WEIGHTS_SETTLED
        )
        # The covariance of a round that was not the last one would belong to other rows.
        if settled and (problem.linear or np.max(np.abs(step)) < _CONVERGED_SIGMA):
            return now
        # The partials are those of an antenna without errors: with long lags near the zenith a
        # round takes 6 % of what is left.  The secant of two rounds (Anderson 1965) takes the rest.
        if settled and before is not None:
            turn = step - before[1]
            values = values - (turn @ step) / (turn @ turn) * (values - before[0])
        before = (now.solution.values, step) if settled else None
        used, weight = keep, lighter
    raise ValueError(f"the fit has not settled after {_MOST_ROUNDS} rounds")


def _check_left(data: Observations, last: Round, options: FitOptions, backed: bool) -> None:
    """Refuse a fit that rejects too much: what is left agrees with itself, not with the antenna."""
    out = ~last.used
    numbers, counts = np.unique(data.pass_id[out], return_counts=True)
    worst = ", ".join(
        str(number) for number in numbers[np.argsort(-counts, kind="stable")][:4].tolist()
    )
    if np.mean(out) > _MOST_EDITED:
        raise ValueError(
            f"{int(np.sum(out))} of {len(data)} observations were edited out ({100.0 * np.mean(out):.0f} %), most of them of "
            f"pass {worst}; must be <= {100.0 * _MOST_EDITED:g} %: passes that contradict each other, sigmas too small, "
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
    variance = np.mean((last.residuals[:, used] / problem.sigmas[:, used]) ** 2, axis=1).tolist()
    covariance = solution.covariance
    if options.covariance == "sandwich":
        covariance = sandwich_covariance(problem.names, covariance, problem.weighted_passes(last))
    noise = (
        problem.noise(last, share_after_editing(options.edit_sigma))
        if options.scale_covariance
        else None
    )
    if noise is not None and options.covariance == "white":
        covariance = covariance * excess_of(noise)
    size = normalised_size(last.residuals, problem.sigmas, used)
    common, spread = problem.nuisance_estimates(last)
    places, rows = (
        problem.pass_rows(last)
        if problem.pass_priors is not None
        else (np.zeros(0, dtype=np.int64), None)
    )
    return FitResult(
        names=problem.names, values=solution.values, covariance=covariance, held=problem.held,
        form=options.form, station=data.station, mount=data.mount, band=data.band,
        condition=solution.condition, residual_azimuth_rad=last.residuals[0],
        residual_elevation_rad=last.residuals[1], pass_azimuth_rad=last.pass_offsets[0],
        pass_elevation_rad=last.pass_offsets[1], cos_elevation=np.cos(data.true_elevation_rad),
        used=used,
        rejected=tuple(
            Rejected(int(row), int(data.pass_id[row]), f"residual of {size[row]:.1f} sigma")
            for row in np.flatnonzero(~used)
        ),
        variance_azimuth=variance[0], variance_elevation=variance[1],
        first_t_s=float(np.min(data.t_s)), last_t_s=float(np.max(data.t_s)),
        passes=len(np.unique(data.pass_id[used])), pass_errors=problem.pass_errors(last),
        pass_priors=problem.pass_priors, noise=noise, pass_rows=rows, pass_places=places,
        shared=problem.shared, sharing=problem.sharing, nuisances=problem.nuisances,
        nuisance_values=common, nuisance_covariance=spread, priors=problem.priors,
    )  # fmt: skip


def excess_of(noise: tuple[NoiseScale, NoiseScale]) -> float:
    """Return the factor of the covariance, 1 unless the noise is larger than sigma says."""
    # Never below 1: residuals that are smaller than sigma may be so because they are correlated.
    factor = 0.5 * (noise[0].factor + noise[1].factor)
    uncertainty = 0.5 * float(np.hypot(noise[0].uncertainty, noise[1].uncertainty))
    return factor if factor > 1.0 + _EXCESS_SIGMA * uncertainty else 1.0


def _check_names(
    names: tuple[str, ...], held: Mapping[str, float], priors: Mapping[str, Prior], kind: str
) -> None:
    """Raise ValueError for unknown names and terms of the 14 that are not fitted or held once."""
    if not names:
        raise ValueError("terms is empty, must name at least one term to fit")
    other = "" if kind == AZIMUTH_ELEVATION else kind
    terms_by_name(names, other)
    terms_by_name(held, other)
    both = [name for name in names if name in held]
    if both:
        raise ValueError(f"term {', '.join(both)} is both fitted and held")
    missing = [name for name in names_of(kind) if name not in names and name not in held]
    if missing:
        raise ValueError(
            f"term {', '.join(missing)} is neither fitted nor held: give it a value in held"
        )
    astray = [name for name in priors if name not in names]
    if astray:
        raise ValueError(f"prior of {', '.join(astray)}: not a fitted term")


def normalised_size(residuals: Array, sigmas: Array, used: BoolArray) -> Array:
    """Return the larger of the axes' residuals (2, n), over their spread among `used` rows."""
    # Where it exceeds the stated sigma: an orbit error must not cost the whole pass.
    sizes = np.abs(residuals) / sigmas
    spread = np.maximum(1.0, _MEDIAN_TO_SIGMA * np.median(sizes[:, used], axis=1))
    return np.asarray(np.max(sizes / spread[:, np.newaxis], axis=0))


def within_limit(size: Array, limit: float, used: BoolArray, *, may_return: bool) -> BoolArray:
    """Return the rows that count next; limit 0 keeps all, with `may_return` rejected rows too."""
    if limit == 0.0:
        return used
    keep = size <= limit
    return keep if may_return else keep & used


def huber_weights(size: Array, limit: float) -> Array:
    """Return weights (n,) that make residuals beyond `limit` count linearly; limit 0: all one."""
    return np.ones_like(size) if limit == 0.0 else np.minimum(1.0, limit / np.maximum(size, limit))


def sandwich_covariance(
    names: Sequence[str], covariance: Array, passes: Sequence[tuple[int, Array, Array]]
) -> Array:
    """Return the covariance (k, k), from that of white noise and each pass's rows and residuals.

    Rows and residuals are divided by sigma.  Raises ValueError for fewer than
    _FEWEST_SANDWICH_PASSES passes and where one pass alone determines a term.
    """
    if len(passes) < _FEWEST_SANDWICH_PASSES:
        raise ValueError(
            f"passes={len(passes)} must be >= {_FEWEST_SANDWICH_PASSES} for a sandwich covariance"
        )
    # A pass that alone determines a term has no residual to measure its errors by.
    meat = np.zeros_like(covariance)
    for number, rows, residuals in passes:
        remaining = np.eye(len(names)) - (rows.T @ rows) @ covariance
        values, vectors = np.linalg.eig(remaining.T)
        if np.min(np.abs(values)) < _ALONE:
            weak = (
                np.abs(vectors[:, int(np.argmin(np.abs(values)))])
                * np.sqrt(np.diag(covariance)) ** -1
            )
            name = names[int(np.argmax(weak))]
            raise ValueError(f"pass {number} alone determines {name}: add passes that see it too")
        score = np.linalg.solve(remaining, rows.T @ residuals)
        meat += np.outer(score, score)
    return np.asarray(covariance @ meat @ covariance)
