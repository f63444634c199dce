"""Which terms the data cannot tell apart, in the terms' names, and which data would."""

from collections.abc import Container, Sequence

import numpy as np
from numpy.typing import NDArray

from rf_pointing.calibration.terms import all_terms

__all__ = [
    "HIGH_CORRELATION",
    "LARGEST_SIGMA_RAD",
    "advice_for",
    "inseparable_pairs",
    "null_space_message",
    "require_determined",
]

Array = NDArray[np.float64]

HIGH_CORRELATION = 0.95
"""Correlation above which two fitted terms are reported as poorly separated."""
LARGEST_SIGMA_RAD = 5e-3
"""Sigma of an angle above which a fit is refused: the products of such errors exceed any noise, and no sigma is true then."""
_SHARE = 0.05


def advice_for(names: Sequence[str]) -> str:
    """Return which data would separate `names`."""
    known = all_terms()
    wanted = dict.fromkeys(known[name].separated_by for name in names if name in known)
    return "; ".join(wanted) if wanted else "a prior on one of them"


def null_space_message(names: Sequence[str], directions: Array, scale: Array) -> str:
    """Return the refusal for null directions (m, k) of the matrix whose columns have norm `scale` (k,)."""
    sentences = []
    for effect in np.abs(_echelon(directions * scale)):
        involved = [name for name, share in zip(names, effect / np.max(effect), strict=True) if share > _SHARE]
        sentences.append(" + ".join(involved))
    everyone = list(dict.fromkeys(name for sentence in sentences for name in sentence.split(" + ")))
    return (
        f"the data cannot separate {'; '.join(sentences)}: "
        f"fix one of the terms, give a prior, or add {advice_for(everyone)}"
    )


def _echelon(rows: Array) -> Array:
    """Return the reduced basis of the space that `rows` (m, k) span.

    It is unique; which basis an SVD gives depends on the last bits.
    """
    rows = rows.copy()
    for index in range(len(rows)):
        size = np.max(np.abs(rows[index:]), axis=0)
        column = int(np.argmax(size > _SHARE * np.max(size)))
        pivot = index + int(np.argmax(np.abs(rows[index:, column])))
        rows[[index, pivot]] = rows[[pivot, index]]
        rows[index] /= rows[index, column]
        others = np.arange(len(rows)) != index
        rows[others] -= np.outer(rows[others, column], rows[index])
    return rows


def require_determined(names: Sequence[str], covariance: Array, known: Container[str]) -> None:
    """Raise ValueError naming angle terms whose sigma is beyond LARGEST_SIGMA_RAD, and the data that would bring it down.

    Terms in `known` have a prior: how far they may be off is the user's word.
    """
    terms, sigma = all_terms(), dict(zip(names, np.sqrt(np.diag(covariance)).tolist(), strict=True))
    lost = [n for n in names if n not in known and terms[n].unit == "rad" and sigma[n] > LARGEST_SIGMA_RAD]
    if lost:
        largest, limit = (np.degrees(value) for value in (max(sigma[name] for name in lost), LARGEST_SIGMA_RAD))
        raise ValueError(
            f"the data hardly separate {' + '.join(lost)} (sigma up to {largest:.2g} deg, must be <= {limit:.2g} deg): "
            f"fix one of the terms, give a prior, or add {advice_for(lost)}"
        )


def inseparable_pairs(
    names: Sequence[str], correlation: Array, threshold: float = HIGH_CORRELATION
) -> tuple[tuple[str, str, float], ...]:
    """Return the pairs of terms with |correlation| >= threshold, the worst first."""
    rows, columns = np.triu_indices(len(names), 1)
    pairs = [
        (names[i], names[j], float(correlation[i, j]))
        for i, j in zip(rows.tolist(), columns.tolist(), strict=True)
        if abs(correlation[i, j]) >= threshold
    ]
    return tuple(sorted(pairs, key=lambda pair: -abs(pair[2])))
