"""Position laws from error to rate command in state space, notch and section included.

    x(k+1) = a x(k) + b e(k),   u(k) = c x(k) + d e(k)

The feedforward lies outside the loop and is not part of it.
"""

import numpy as np
from numpy.typing import NDArray

from rf_pointing.controllers.filters import section_matrices
from rf_pointing.controllers.lqg import LqgDesign
from rf_pointing.controllers.position_loop import PositionLoopParams

Array = NDArray[np.float64]
LawMatrices = tuple[Array, Array, Array, Array]
"""State space a (n, n), b (n, 1), c (1, n), d (1, 1)."""


def law_matrices(law: PositionLoopParams | LqgDesign, sample_s: float) -> LawMatrices:
    """Return the law sampled every `sample_s` seconds.

    Raises
    ------
    ValueError
        If a filter lies at or above half the sampling rate, or the design is for another rate.
    """
    if isinstance(law, LqgDesign):
        # The matrices of a design hold for one sampling time; there is no conversion that keeps its
        # margins.
        if abs(sample_s - law.sample_s) > 1e-6:
            raise ValueError(f"sample_s={sample_s} must be {law.sample_s}, the sampling time of the LQG design")
        core = law.a - law.b @ law.state_gain - law.observer_gain @ law.c
        chain = core, -law.observer_gain, -law.state_gain, np.zeros((1, 1))
        # In the order of the loop, so that the states are those of the code that runs.
        filters = [law.weights.shaping, law.weights.notch]
    else:
        gain = np.array([[law.proportional_gain]])
        chain = np.eye(1), np.array([[sample_s]]), np.array([[law.integral_gain]]), gain
        filters = [law.shaping, law.notch]
    for params in filters:
        if params.enabled:
            chain = _series(chain, section_matrices(params, sample_s))
    return chain


def _series(first: LawMatrices, second: LawMatrices) -> LawMatrices:
    a1, b1, c1, d1 = first
    a2, b2, c2, d2 = second
    a = np.block([[a1, np.zeros((len(a1), len(a2)))], [b2 @ c1, a2]])
    return a, np.vstack([b1, b2 @ d1]), np.hstack([d2 @ c1, c2]), d2 @ d1
