"""From recorded sequences to a model: high-pass, OKID, realization, reduction, residue fit.

One input and one output at a time, as in DSS13-ID Sec. III-D.  The straight responses keep the
drive's integrator.  The cross responses are high-passed first, because a small unmeasured rate at
the other axis drowns them at low frequency.

Residues are fitted to the pole and residue form T(z) = d + sum_i r_i / (z - p_i).  Noise splits the
drive's pole at zero frequency into small poles near z = 1.  They are put back to one exact
integrator with the sum of their residues (DSS13-ID Sec. IV-B sets the two very small eigenvalues to
zero).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from rf_pointing.core import Array, ComplexArray, Params, parameter, require_between
from rf_pointing.identification.model import StateSpace
from rf_pointing.identification.realization import balanced_reduction, observer_markov, realize, system_markov


@dataclass(frozen=True, slots=True)
class PoleResidue:
    """Poles and residues (n,), complex ones in adjacent conjugate pairs, and the direct term."""

    poles: ComplexArray
    residues: ComplexArray
    direct: float
    sample_s: float

    @classmethod
    def from_state_space(cls, model: StateSpace) -> "PoleResidue":
        """Return the form of a model with one input, one output and distinct poles."""
        if model.b.shape[1] != 1 or model.c.shape[0] != 1:
            raise ValueError(f"model has {model.b.shape[1]} inputs and {model.c.shape[0]} outputs, must have 1 and 1")
        poles, vectors = np.linalg.eig(model.a)
        residues = (model.c @ vectors)[0] * np.linalg.solve(vectors, model.b.astype(np.complex128))[:, 0]
        # Rounded, so that the two of a conjugate pair stay neighbours whatever their last bits.
        rank = np.lexsort((-poles.imag, np.round(np.abs(poles.imag), 12), np.round(poles.real, 12)))
        return cls(poles[rank].astype(np.complex128), residues[rank], float(model.d[0, 0]), model.sample_s)

    def to_state_space(self) -> StateSpace:
        """Return the real block-diagonal model: one state per real pole, two per pair."""
        a, b = np.zeros((len(self.poles), len(self.poles))), np.zeros((len(self.poles), 1))
        c = np.zeros((1, len(self.poles)))
        index = 0
        while index < len(self.poles):
            pole, residue = self.poles[index], self.residues[index]
            if pole.imag == 0.0:
                a[index, index], b[index, 0], c[0, index] = pole.real, 1.0, residue.real
                index += 1
                continue
            a[index : index + 2, index : index + 2] = [[pole.real, pole.imag], [-pole.imag, pole.real]]
            b[index, 0] = 1.0
            c[0, index : index + 2] = 2.0 * residue.real, 2.0 * residue.imag
            index += 2
        return StateSpace(a, b, c, np.array([[self.direct]]), self.sample_s)


def restore_integrator(model: PoleResidue, below_hz: float = 0.03) -> PoleResidue:
    """Return the model with all poles slower than `below_hz` merged into one pole at exactly z = 1.

    Raises ValueError if there is no such pole.
    """
    require_between("below_hz", below_hz, 1e-6, 0.5 / model.sample_s)
    slow = np.abs(model.poles - 1.0) < 2.0 * np.pi * below_hz * model.sample_s
    if not np.any(slow):
        slowest_hz = float(np.min(np.abs(model.poles - 1.0))) / (2.0 * np.pi * model.sample_s)
        raise ValueError(f"below_hz={below_hz}: no pole that slow, the slowest is {slowest_hz:.3f} Hz")
    # Exactly one: a pole at 0.9999 would let the integrator leak in a minute.
    poles = np.concatenate([[1.0], model.poles[~slow]]).astype(np.complex128)
    residues = np.concatenate([[np.sum(model.residues[slow]).real], model.residues[~slow]]).astype(np.complex128)
    return PoleResidue(poles, residues, model.direct, model.sample_s)


def summed(model: PoleResidue) -> PoleResidue:
    """Return the model whose output is the sum of that of `model` up to each sample: a pole at 1.

    z / (z - 1) times r / (z - p) is r p / (p - 1) / (z - p) plus r / (1 - p) / (z - 1).
    """
    poles = np.concatenate([[1.0], model.poles])
    steady = np.sum(model.residues / (1.0 - model.poles)).real + model.direct
    residues = np.concatenate([[steady], model.residues * model.poles / (model.poles - 1.0)])
    return PoleResidue(poles.astype(np.complex128), residues, model.direct, model.sample_s)


def refit_residues(model: PoleResidue, inputs: ArrayLike, outputs: ArrayLike) -> PoleResidue:
    """Return the model with residues and direct term fitted to sequences (sequences, samples).

    Each sequence has its own start of every mode, which is not part of the model.  High-pass both
    sides first: the integrated wind and an unmeasured small rate at the input would otherwise set
    the gain of the integrator.
    """
    u, y = np.atleast_2d(inputs).astype(np.float64), np.atleast_2d(outputs).astype(np.float64)
    # Every sequence has the same length, hence the same free motions.  They are projected out:
    # their weights are not part of the model.
    free = np.linalg.qr(_free_motions(model, u.shape[1]))[0]
    unknowns = len(model.poles) + 1
    normal, right = np.zeros((unknowns, unknowns)), np.zeros(unknowns)
    for sequence, target in zip(u, y, strict=True):
        columns = _filtered(model, sequence)
        reduced = columns - free @ (free.T @ columns)
        normal += reduced.T @ reduced
        right += reduced.T @ target
    # Residues of slow and fast modes differ by orders of magnitude; scaled, the rank is decided by
    # a stated tolerance.
    scale = np.sqrt(np.diag(normal))
    solution = np.linalg.lstsq(normal / np.outer(scale, scale), right / scale, rcond=1e-13)[0] / scale
    return _with(model, solution)


def _filtered(model: PoleResidue, u: Array) -> Array:
    """Return columns (samples, n + 1) for the residues (real, imaginary) and the direct term."""
    import scipy.signal

    columns = []
    for pole in model.poles[model.poles.imag >= 0.0]:
        passed = scipy.signal.lfilter([0.0, 1.0], [1.0, -pole], u.astype(np.complex128))
        columns += [passed.real] if pole.imag == 0.0 else [2.0 * passed.real, -2.0 * passed.imag]
    return np.column_stack([*columns, u])


def _free_motions(model: PoleResidue, samples: int) -> Array:
    steps = np.arange(samples)
    columns = [np.ones(samples)]
    for pole in model.poles[(model.poles.imag >= 0.0) & (np.abs(model.poles - 1.0) > 1e-12)]:
        decay = pole**steps
        columns += [decay.real] if pole.imag == 0.0 else [decay.real, decay.imag]
    return np.column_stack(columns)


def _with(model: PoleResidue, solution: Array) -> PoleResidue:
    residues, index = [], 0
    for pole in model.poles[model.poles.imag >= 0.0]:
        if pole.imag == 0.0:
            residues.append(complex(solution[index]))
            index += 1
        else:
            residue = complex(solution[index], solution[index + 1])
            residues += [residue, residue.conjugate()]
            index += 2
    return PoleResidue(model.poles, np.array(residues), float(solution[-1]), model.sample_s)


@dataclass(frozen=True, kw_only=True)
class IdentificationParams(Params):
    """How a model is made from the data."""

    observer_order: int = parameter(120, "observer Markov parameters p", 1, 2000)
    markov_count: int = parameter(1000, "system Markov parameters in the realization", 20, 20000)
    realization_order: int = parameter(14, "order of the realization before reduction", 1, 200)
    order: int = parameter(10, "order of the model", 1, 200)
    integrator: bool = parameter(True, "whether the response has the drive's integrator")
    integrator_below_hz: float = parameter(0.03, "poles slower than this are the integrator", 1e-5, 1.0)
    high_pass_hz: float = parameter(0.0, "corner of the high-pass on input and output, 0 for none", 0.0, 10.0)
    refit_high_pass_hz: float = parameter(0.1, "corner of the high-pass before the residue fit", 1e-4, 10.0)
    settle_s: float = parameter(10.0, "start of each high-passed sequence that is left out", 0.0, 1e4)

    ordered = ("order <= realization_order",)

    def check_together(self) -> None:
        """Refuse a realization larger than the Markov parameters carry."""
        if 2 * self.realization_order >= self.markov_count:
            raise ValueError(f"realization_order={self.realization_order} must be < {self.markov_count // 2}")


@dataclass(frozen=True, slots=True)
class Identified:
    """Model, Hankel singular values, and condition number of the observer."""

    model: StateSpace
    hankel: Array
    condition: float


def high_pass(sequences: ArrayLike, sample_s: float, corner_hz: float, settle_s: float) -> Array:
    """Return sequences (sequences, samples) through a Butterworth high-pass, `settle_s` cut off."""
    import scipy.signal

    sections = scipy.signal.butter(2, corner_hz, "highpass", fs=1.0 / sample_s, output="sos")
    data = np.atleast_2d(sequences)
    # From the first sample on: a step at the start would ring through the whole sequence.
    passed = scipy.signal.sosfilt(sections, data - data[:, :1], axis=1)
    return np.asarray(passed[:, round(settle_s / sample_s) :])


def _level(sequences: Array) -> Array:
    return np.asarray(sequences - np.mean(sequences, axis=1, keepdims=True))


def _realized(u: Array, y: Array, sample_s: float, params: IdentificationParams) -> tuple[PoleResidue, Array, float]:
    """Return modes, Hankel singular values, and condition of the observer."""
    observer = observer_markov(u, y, params.observer_order)
    realization = realize(system_markov(observer, params.markov_count), params.realization_order, sample_s)
    return PoleResidue.from_state_space(realization.model), realization.hankel, observer.condition


def identify(inputs: ArrayLike, outputs: ArrayLike, sample_s: float, params: IdentificationParams) -> Identified:
    """Return the model between `inputs` and `outputs`, both (sequences, samples).

    Raises ValueError if the data do not support the orders.
    """
    import scipy.signal

    if params.high_pass_hz > 0.0:
        u, y = (high_pass(data, sample_s, params.high_pass_hz, params.settle_s) for data in (inputs, outputs))
    else:
        # A drift of the integrator from wind is not a response to the input.
        u, y = (scipy.signal.detrend(np.atleast_2d(data), axis=1) for data in (inputs, outputs))
    modal, hankel, condition = _realized(u, y, sample_s, params)
    if params.integrator:
        try:
            modal = restore_integrator(modal, params.integrator_below_hz)
        except ValueError:
            # In short sequences wind hides the integrator among its drifts; rates have none.
            u, y = np.atleast_2d(inputs)[:, 1:], np.diff(np.atleast_2d(outputs), axis=1)
            rates, hankel, condition = _realized(_level(u), _level(y), sample_s, params)
            modal = summed(rates)
    # An antenna structure has no pole outside the unit circle; noise invents them.  The integrator
    # is exactly on it and stays.
    kept = np.abs(modal.poles) <= 1.0
    stable = PoleResidue(modal.poles[kept], modal.residues[kept], modal.direct, modal.sample_s)
    order = min(params.order, len(stable.poles))
    reduced = balanced_reduction(stable.to_state_space(), order)
    # Below the corner the data are wind, not response.
    corner = max(params.refit_high_pass_hz, params.high_pass_hz)
    fit_u, fit_y = (high_pass(data, sample_s, corner, params.settle_s) for data in (inputs, outputs))
    refitted = refit_residues(PoleResidue.from_state_space(reduced), fit_u, fit_y)
    return Identified(refitted.to_state_space(), hankel, condition)
