"""A sampled linear model: its modes, its response, its simulation, and the JSON file that keeps it.

A file says what the matrices connect, how they were made and how good they are.  Loading is strict:
a missing or unknown key, or a matrix of the wrong shape, is an error that names it.
"""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rf_pointing.core import AXES, require_choice

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]


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
        """Return the outputs (samples, q) for `inputs` (samples, m) from `start` (n,) or zero."""
        u = np.asarray(inputs, dtype=np.float64).reshape(-1, self.b.shape[1])
        state = np.zeros(self.order) if start is None else np.asarray(start, dtype=np.float64)
        states = np.zeros((len(u), self.order))
        # A loop: the state is not known before the step, and the order is ten.
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
    # One of each conjugate pair; a real pole has no frequency.
    oscillating = poles[poles.imag > 1e-9]
    s = np.log(oscillating) / model.sample_s
    rank = np.argsort(np.abs(s))
    natural = np.abs(s[rank])
    real = np.sort(poles[np.abs(poles.imag) <= 1e-9].real)
    return Modes(natural / (2.0 * np.pi), -s[rank].real / natural, real)


_KEYS = {"input", "output", "sample_s", "a", "b", "c", "d", "hankel", "error", "provenance"}
# Changed with every change of the keys, so that an old file is named instead of misread.
_FORMAT = "rf_pointing identified models 1"


@dataclass(frozen=True, slots=True)
class ModelRecord:
    """One response: rate command of axis `input` (rad/s) to encoder of axis `output` (rad).

    `error` is the relative error on held-out sequences, `provenance` says from which data and how
    it was made.
    """

    input: str
    output: str
    model: StateSpace
    hankel: tuple[float, ...]
    error: float
    provenance: str

    def __post_init__(self) -> None:
        require_choice("input", self.input, AXES)
        require_choice("output", self.output, AXES)


def save_models(path: Path, records: list[ModelRecord]) -> None:
    """Write the records to `path`."""
    responses = [
        {
            "input": record.input,
            "output": record.output,
            "sample_s": record.model.sample_s,
            **{name: getattr(record.model, name).tolist() for name in "abcd"},
            "hankel": list(record.hankel),
            "error": record.error,
            "provenance": record.provenance,
        }
        for record in records
    ]
    path.write_text(json.dumps({"format": _FORMAT, "responses": responses}, indent=1) + "\n")


def load_models(path: Path) -> list[ModelRecord]:
    """Return the records in `path`.

    Raises
    ------
    ValueError
        For another format, an unknown or missing key, or matrices that do not fit together.
    """
    content = json.loads(path.read_text())
    if not isinstance(content, dict) or content.get("format") != _FORMAT:
        raise ValueError(f"{path}: format must be {_FORMAT!r}")
    return [_record(path, index, entry) for index, entry in enumerate(content["responses"])]


def _record(path: Path, index: int, entry: dict[str, Any]) -> ModelRecord:
    unknown, missing = sorted(set(entry) - _KEYS), sorted(_KEYS - set(entry))
    if unknown or missing:
        raise ValueError(f"{path}: response {index} has unknown keys {unknown} and lacks {missing}")
    a, b, c, d = (np.array(entry[name], dtype=np.float64) for name in "abcd")
    model = StateSpace(a, b, c, d, float(entry["sample_s"]))
    return ModelRecord(
        entry["input"], entry["output"], model, tuple(entry["hankel"]), float(entry["error"]), entry["provenance"]
    )
