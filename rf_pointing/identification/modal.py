"""Pole and residue form of a single-input, single-output model: restoring the integrator, refitting the residues.

    T(z) = d + sum_i r_i / (z - p_i)

Noise splits the drive's pole at zero frequency into small poles near z = 1.  They are put back to
one exact integrator with the sum of their residues (DSS13-ID Sec. IV-B sets the two very small
eigenvalues to zero).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rf_pointing.core import require_between
from rf_pointing.identification.model import StateSpace

__all__ = ["PoleResidue", "refit_residues", "restore_integrator"]

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]


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

    Raises
    ------
    ValueError
        If there is no such pole.
    """
    require_between("below_hz", below_hz, 1e-6, 0.5 / model.sample_s)
    slow = np.abs(model.poles - 1.0) < 2.0 * np.pi * below_hz * model.sample_s
    if not np.any(slow):
        raise ValueError(f"below_hz={below_hz}: no pole that slow, the slowest is {_slowest_hz(model):.3f} Hz")
    poles = np.concatenate([[1.0], model.poles[~slow]]).astype(np.complex128)
    residues = np.concatenate([[np.sum(model.residues[slow]).real], model.residues[~slow]]).astype(np.complex128)
    return PoleResidue(poles, residues, model.direct, model.sample_s)


def refit_residues(model: PoleResidue, inputs: ArrayLike, outputs: ArrayLike) -> PoleResidue:
    """Return the model with residues and direct term fitted to sequences (sequences, samples) by output error.

    Each sequence has its own start of every mode, which is no part of the model.  High-pass both
    sides first: the integrated wind and an unmeasured small rate at the input would otherwise set
    the gain of the integrator.
    """
    u, y = np.atleast_2d(inputs).astype(np.float64), np.atleast_2d(outputs).astype(np.float64)
    own = [_filtered(model, sequence) for sequence in u]
    free = [_nuisance(model, u.shape[1])] * len(u)
    normal = np.zeros((own[0].shape[1], own[0].shape[1]))
    right = np.zeros(len(normal))
    for columns, nuisance, target in zip(own, free, y, strict=True):
        orthonormal = np.linalg.qr(nuisance)[0]
        reduced = columns - orthonormal @ (orthonormal.T @ columns)
        normal += reduced.T @ reduced
        right += reduced.T @ (target - orthonormal @ (orthonormal.T @ target))
    scale = np.sqrt(np.diag(normal))
    solution = np.linalg.lstsq(normal / np.outer(scale, scale), right / scale, rcond=1e-13)[0] / scale
    return _with(model, solution)


def _filtered(model: PoleResidue, u: Array) -> Array:
    """Return the columns (samples, n + 1) whose weights are the residues (real, imaginary) and the direct term."""
    import scipy.signal

    columns = []
    for pole in model.poles[model.poles.imag >= 0.0]:
        passed = scipy.signal.lfilter([0.0, 1.0], [1.0, -pole], u.astype(np.complex128))
        columns += [passed.real] if pole.imag == 0.0 else [2.0 * passed.real, -2.0 * passed.imag]
    return np.column_stack([*columns, u])


def _nuisance(model: PoleResidue, samples: int) -> Array:
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


def _slowest_hz(model: PoleResidue) -> float:
    return float(np.min(np.abs(model.poles - 1.0))) / (2.0 * np.pi * model.sample_s)
