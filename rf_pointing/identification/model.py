"""A sampled linear model: its modes, its response, its simulation."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from rf_pointing.core import Array, ComplexArray, as_finite_array


@dataclass(frozen=True, slots=True)
class StateSpace:
    """x(k+1) = a x + b u, y = c x + d u; a (n, n), b (n, m), c (q, n), d (q, m)."""

    a: Array
    b: Array
    c: Array
    d: Array
    sample_s: float

    def __post_init__(self) -> None:
        size = len(self.a)
        inputs, outputs = self.b.shape[1], self.c.shape[0]
        shapes = {"a": (size, size), "b": (size, inputs), "c": (outputs, size), "d": (outputs, inputs)}
        for name, shape in shapes.items():
            as_finite_array(name, getattr(self, name), shape)

    @property
    def order(self) -> int:
        """Number of states."""
        return len(self.a)

    def response(self, frequency_hz: ArrayLike) -> ComplexArray:
        """Return the transfer function (f, q, m)."""
        z = np.exp(2j * np.pi * np.asarray(frequency_hz, dtype=np.float64) * self.sample_s)[:, None, None]
        solved = np.linalg.solve(z * np.eye(self.order) - self.a, self.b.astype(np.complex128)[None])
        return np.asarray(self.c @ solved + self.d)

    def simulate(self, inputs: ArrayLike) -> Array:
        """Return the outputs (samples, q) for `inputs` (samples, m) from rest."""
        u = np.asarray(inputs, dtype=np.float64).reshape(-1, self.b.shape[1])
        state = np.zeros(self.order)
        states = np.zeros((len(u), self.order))
        # A loop: the state is not known before the step, and the order is ten.
        for k, drive in enumerate(u @ self.b.T):
            states[k] = state
            state = self.a @ state + drive
        return np.asarray(states @ self.c.T + u @ self.d.T)


@dataclass(frozen=True, slots=True)
class Modes:
    """Oscillating poles of a model, lowest frequency first."""

    frequency_hz: Array
    damping: Array


def modes_of(model: StateSpace) -> Modes:
    """Return natural frequencies and damping ratios."""
    poles = np.linalg.eigvals(model.a)
    # One of each conjugate pair; a real pole has no frequency.
    oscillating = poles[poles.imag > 1e-9]
    s = np.log(oscillating) / model.sample_s
    rank = np.argsort(np.abs(s))
    natural = np.abs(s[rank])
    return Modes(natural / (2.0 * np.pi), -s[rank].real / natural)
