"""A sampled linear model, its modes, its response, and the simulation of sequences."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = ["Modes", "StateSpace", "modes_of"]

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]


@dataclass(frozen=True, slots=True)
class StateSpace:
    """x(k+1) = a x + b u, y = c x + d u at intervals of `sample_s`; a (n, n), b (n, m), c (q, n), d (q, m)."""

    a: Array
    b: Array
    c: Array
    d: Array
    sample_s: float

    def __post_init__(self) -> None:
        size = len(self.a)
        shapes = {"a": (size, size), "b": (size, self.b.shape[1]), "c": (self.c.shape[0], size)}
        shapes["d"] = (self.c.shape[0], self.b.shape[1])
        for name, shape in shapes.items():
            if getattr(self, name).shape != shape:
                raise ValueError(f"{name} has shape {getattr(self, name).shape}, must be {shape}")
            if not np.all(np.isfinite(getattr(self, name))):
                raise ValueError(f"{name} must be finite")

    @property
    def order(self) -> int:
        """Number of states."""
        return len(self.a)

    def response(self, frequency_hz: ArrayLike) -> ComplexArray:
        """Return the transfer function (f, q, m)."""
        z = np.exp(2j * np.pi * np.asarray(frequency_hz, dtype=np.float64) * self.sample_s)[:, None, None]
        solved = np.linalg.solve(z * np.eye(self.order) - self.a, self.b.astype(np.complex128))
        return np.asarray(self.c @ solved + self.d)

    def simulate(self, inputs: ArrayLike, start: ArrayLike | None = None) -> Array:
        """Return the outputs (samples, q) for `inputs` (samples, m) from the state `start` (n,), zero if not given."""
        u = np.asarray(inputs, dtype=np.float64).reshape(-1, self.b.shape[1])
        state = np.zeros(self.order) if start is None else np.asarray(start, dtype=np.float64)
        states = np.zeros((len(u), self.order))
        for k, drive in enumerate(u @ self.b.T):
            states[k] = state
            state = self.a @ state + drive
        return np.asarray(states @ self.c.T + u @ self.d.T)


@dataclass(frozen=True, slots=True)
class Modes:
    """Oscillating poles of a model, lowest frequency first, and its real poles as z values."""

    frequency_hz: Array
    damping: Array
    real_poles: Array


def modes_of(model: StateSpace) -> Modes:
    """Return natural frequencies, damping ratios and real poles."""
    poles = np.linalg.eigvals(model.a)
    oscillating = poles[poles.imag > 1e-9]
    s = np.log(oscillating) / model.sample_s
    rank = np.argsort(np.abs(s))
    natural = np.abs(s[rank])
    real = np.sort(poles[np.abs(poles.imag) <= 1e-9].real)
    return Modes(natural / (2.0 * np.pi), -s[rank].real / natural, real)
