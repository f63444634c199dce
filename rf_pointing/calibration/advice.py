"""Which passes to track next: those that shrink the sigma of the chosen terms most.

A pass with weighted partials A, its own orbit and clock errors eliminated, turns the covariance C of the terms into

    C' = C - C A' (1 + A C A')^-1 A C

whatever will be measured.  Passes are taken greedily: the best one first, the next one given the first, and so on.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from rf_pointing.calibration.angles import REFERENCE_TEMPERATURE_K
from rf_pointing.calibration.campaign import Slew
from rf_pointing.calibration.candidate_pass import CandidatePass
from rf_pointing.calibration.fit import held_at_zero
from rf_pointing.calibration.fit_problem import FitProblem
from rf_pointing.calibration.pass_errors import PassPriors
from rf_pointing.calibration.terms import terms_by_name
from rf_pointing.core import require_between

__all__ = ["PassAdvice", "next_best_passes", "uninformed_covariance"]

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class PassAdvice:
    """One pass worth tracking: sigma of all terms (k,) after it, and the mean factor on the chosen ones' sigma."""

    name: str
    start_t_s: float
    sigma: Array
    factor: float


def uninformed_covariance(terms: Sequence[str]) -> Array:
    """Return the covariance of a station never calibrated: the largest believable magnitude of each term as sigma."""
    return np.diag([term.limit**2 for term in terms_by_name(terms)])


def next_best_passes(
    terms: Sequence[str],
    covariance: Array,
    candidates: Sequence[CandidatePass],
    *,
    chosen: Sequence[str],
    count: int,
    pass_priors: PassPriors | None = None,
    slew: Slew | None = None,
) -> list[PassAdvice]:
    """Return up to `count` passes, the best first, that most reduce the sigma of the `chosen` terms.

    `covariance` (k, k) is that of the last fit, or `uninformed_covariance`.  Passes that overlap a better one, or begin before
    the antenna can have slewed there, are left out.  Stops when no pass is left.
    """
    require_between("count", count, 1, None)
    places = _places(terms, chosen)
    gains = [_information(tuple(terms), candidate, pass_priors) for candidate in candidates]
    reach = slew or Slew()
    left, present = list(range(len(candidates))), np.asarray(covariance, dtype=np.float64)
    advice: list[PassAdvice] = []
    while left and len(advice) < count:
        after = {k: _updated(present, gains[k]) for k in left}
        best = min(left, key=lambda k: _factor(after[k], present, places))
        factor = _factor(after[best], present, places)
        present = after[best]
        left = [k for k in left if k != best and reach.allows(candidates[k], candidates[best])]
        advice.append(PassAdvice(candidates[best].name, candidates[best].start_t_s, np.sqrt(np.diag(present)), factor))
    return advice


def _places(terms: Sequence[str], chosen: Sequence[str]) -> NDArray[np.int64]:
    astray = [name for name in chosen if name not in terms]
    if astray or not chosen:
        raise ValueError(f"chosen={', '.join(chosen) or 'nothing'} must name terms among {', '.join(terms)}")
    return np.array([list(terms).index(name) for name in chosen], dtype=np.int64)


def _information(terms: tuple[str, ...], candidate: CandidatePass, pass_priors: PassPriors | None) -> Array:
    """Return rows (m, k) whose squares are the information of a pass about the terms."""
    data = candidate.observations("planned", "planned", 0)
    # As warm as the reference of the thermal terms, about which a plan says nothing.
    data = replace(data, temperature_k=np.full(len(data), REFERENCE_TEMPERATURE_K))
    problem = FitProblem(data, terms, held_at_zero(terms), {}, pass_priors, "printed")
    one = np.ones(len(data))
    triangle, _ = problem.triangle(np.zeros(len(terms)), one.astype(bool), one)
    return triangle.factor[:, :-1]


def _updated(covariance: Array, rows: Array) -> Array:
    seen = covariance @ rows.T
    inner = np.eye(len(rows)) + rows @ seen
    return np.asarray(covariance - seen @ np.linalg.solve(inner, seen.T))


def _factor(after: Array, before: Array, places: NDArray[np.int64]) -> float:
    ratio = np.diag(after)[places] / np.diag(before)[places]
    return float(np.mean(np.sqrt(np.maximum(ratio, 0.0))))
