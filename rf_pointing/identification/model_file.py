"""Identified models as a JSON file: matrices, what they connect, how they were made, how good they are.

Loading is strict: a missing or unknown key, or a matrix of the wrong shape, is refused by name.
"""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from rf_pointing.core import AXES, require_choice
from rf_pointing.identification.model import StateSpace

__all__ = ["ModelRecord", "load_models", "save_models"]

_KEYS = {"input", "output", "sample_s", "a", "b", "c", "d", "hankel", "error", "provenance"}
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
