"""From recorded sequences to a model: high-pass, OKID, realization, integrator, balanced reduction, residue fit.

One input and one output at a time, as in DSS13-ID Sec. III-D: the straight responses keep the
drive's integrator, the cross responses are high-passed first, because a small unmeasured rate at
the other axis drowns them at low frequency.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rf_pointing.core import Params, parameter
from rf_pointing.identification.balance import balanced_reduction
from rf_pointing.identification.era import realize
from rf_pointing.identification.modal import PoleResidue, refit_residues, restore_integrator
from rf_pointing.identification.model import StateSpace
from rf_pointing.identification.okid import observer_markov, system_markov

__all__ = ["IdentificationParams", "Identified", "high_pass", "identify"]

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class IdentificationParams(Params):
    """How a model is made from the data."""

    observer_order: int = parameter(120, "observer Markov parameters p", low=1, high=2000)
    markov_count: int = parameter(1000, "system Markov parameters in the realization", low=20, high=20000)
    realization_order: int = parameter(14, "order of the realization before reduction", low=1, high=200)
    order: int = parameter(10, "order of the model", low=1, high=200)
    integrator: bool = parameter(True, "whether the response has the drive's integrator")
    integrator_below_hz: float = parameter(0.03, "poles slower than this are the integrator", low=1e-5, high=1.0)
    high_pass_hz: float = parameter(0.0, "corner of the high-pass on input and output, 0 for none", low=0.0, high=10.0)
    refit_high_pass_hz: float = parameter(0.1, "corner of the high-pass before the residue fit", low=1e-4, high=10.0)
    settle_s: float = parameter(10.0, "start of each high-passed sequence that is left out", low=0.0, high=1e4)

    def check_together(self) -> None:
        """Refuse a model larger than its realization, or one realization larger than the Markov parameters carry."""
        if self.order > self.realization_order:
            raise ValueError(f"order={self.order} must be <= realization_order={self.realization_order}")
        if 2 * self.realization_order >= self.markov_count:
            raise ValueError(f"realization_order={self.realization_order} must be < {self.markov_count // 2}")


@dataclass(frozen=True, slots=True)
class Identified:
    """The model, the Hankel singular values that show its order, the observer's residual rms and condition number."""

    model: StateSpace
    hankel: Array
    residual_rms: float
    condition: float


def high_pass(sequences: ArrayLike, sample_s: float, corner_hz: float, settle_s: float) -> Array:
    """Return sequences (sequences, samples) through a second-order Butterworth high-pass, the first `settle_s` cut."""
    import scipy.signal

    sections = scipy.signal.butter(2, corner_hz, "highpass", fs=1.0 / sample_s, output="sos")
    data = np.atleast_2d(sequences)
    passed = scipy.signal.sosfilt(sections, data - data[:, :1], axis=1)
    return np.asarray(passed[:, round(settle_s / sample_s) :])


def identify(inputs: ArrayLike, outputs: ArrayLike, sample_s: float, params: IdentificationParams) -> Identified:
    """Return the model between `inputs` and `outputs`, both (sequences, samples).

    Raises
    ------
    ValueError
        If the data do not support the orders asked for, or no pole is slow enough to be the integrator.
    """
    import scipy.signal

    if params.high_pass_hz > 0.0:
        u, y = (high_pass(data, sample_s, params.high_pass_hz, params.settle_s) for data in (inputs, outputs))
    else:
        u, y = (scipy.signal.detrend(np.atleast_2d(data), axis=1) for data in (inputs, outputs))
    observer = observer_markov(u, y, params.observer_order)
    markov = system_markov(observer, params.markov_count)
    realization = realize(markov, params.realization_order, sample_s)
    modal = PoleResidue.from_state_space(realization.model)
    if params.integrator:
        modal = restore_integrator(modal, params.integrator_below_hz)
    stable = _without_unstable(modal)
    order = min(params.order, len(stable.poles))
    reduced = balanced_reduction(stable.to_state_space(), order)
    corner = max(params.refit_high_pass_hz, params.high_pass_hz)
    fit_u, fit_y = (high_pass(data, sample_s, corner, params.settle_s) for data in (inputs, outputs))
    refitted = refit_residues(PoleResidue.from_state_space(reduced), fit_u, fit_y)
    return Identified(refitted.to_state_space(), realization.hankel, observer.residual_rms, observer.condition)


def _without_unstable(model: PoleResidue) -> PoleResidue:
    """Return the model without poles outside the unit circle: an antenna structure has none, noise invents them."""
    kept = np.abs(model.poles) <= 1.0
    return PoleResidue(model.poles[kept], model.residues[kept], model.direct, model.sample_s)
