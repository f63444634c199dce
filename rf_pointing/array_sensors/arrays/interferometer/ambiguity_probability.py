"""How often a cycle is resolved wrongly, and the signal-to-noise ratio that prevents it.

Error of the unrounded lane: variance (nu^2 - nu + 1)/(2 pi^2 R); wrong when beyond half a lane, p = 1 - erf(1/(2
sqrt(2) sigma)) (PI83 eqs. 7-26 to 7-34).  R is the power ratio of each link alone.
"""

import math
from statistics import NormalDist

import numpy as np
from numpy.typing import NDArray

from rf_pointing.core import require_between, require_choice

__all__ = [
    "chain_error_rate",
    "lane_sigma",
    "required_ratio",
    "step_error_probability",
    "total_error_probability",
]

STEPS = ("difference", "carrier")


def lane_sigma(cycle_ratio: float, snr: float, step: str = "difference") -> float:
    """Return the standard deviation of the unrounded lane number, in lanes (PI83 eq. 7-30).

    `step` "difference": from one difference to the next; "carrier": from the finest difference to the carrier itself,
    which the report treats alike but which is (2 nu^2 + 2 nu + 1)/(4 pi^2 R), 1.37 dB worse at nu = 6.
    """
    require_choice("step", step, STEPS)
    require_between("cycle_ratio", cycle_ratio, 1.0, None)
    require_between("snr", snr, 1e-30, None)
    if step == "carrier":
        return math.sqrt((2.0 * cycle_ratio**2 + 2.0 * cycle_ratio + 1.0) / (4.0 * math.pi**2 * snr))
    return math.sqrt((cycle_ratio**2 - cycle_ratio + 1.0) / (2.0 * math.pi**2 * snr))


def step_error_probability(cycle_ratio: float, snr: float, step: str = "difference") -> float:
    """Return the probability p_ei of a wrong lane in one step (PI83 eq. 7-33)."""
    return math.erfc(1.0 / (2.0 * math.sqrt(2.0) * lane_sigma(cycle_ratio, snr, step)))


def total_error_probability(cycle_ratio: float, snr: float, steps: int) -> float:
    """Return the union bound of all steps, at most one (PI83 eq. 7-34)."""
    require_between("steps", steps, 1, None)
    return min(1.0, steps * step_error_probability(cycle_ratio, snr))


def required_ratio(cycle_ratio: float, probability: float, step: str = "difference") -> float:
    """Return the power ratio R at which one step errs with `probability`; inverse of `step_error_probability`."""
    require_between("probability", probability, 1e-15, 1.0 - 1e-12)
    allowed = 0.5 / -NormalDist().inv_cdf(0.5 * probability)
    return (lane_sigma(cycle_ratio, 1.0, step) / allowed) ** 2


def chain_error_rate(
    cycle_ratio: float, snr: float, carriers: int, trials: int, rng: np.random.Generator
) -> tuple[float, float]:
    """Return the measured rate of a wrong lane in any step of a K-carrier chain, and its standard error.

    Phase errors of variance 1/R per carrier (both links); a chain errs when any rounding does.
    """
    errors = rng.normal(0.0, 1.0 / math.sqrt(snr), (trials, carriers))
    differences = errors[:, 1:] - errors[:, :1]
    unrounded = (cycle_ratio * differences[:, :-1] - differences[:, 1:]) / (2.0 * math.pi)
    rate = float(np.mean(_any_wrong(unrounded)))
    return rate, math.sqrt(max(rate * (1.0 - rate), 1.0 / trials) / trials)


def _any_wrong(unrounded: NDArray[np.float64]) -> NDArray[np.bool_]:
    return np.asarray(np.any(np.abs(unrounded) > 0.5, axis=-1))
