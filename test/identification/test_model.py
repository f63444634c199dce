"""Model files: round trip and strictness."""

import json
from pathlib import Path

import numpy as np
import pytest

from rf_pointing.identification import ModelRecord, StateSpace, load_models, save_models


@pytest.fixture
def written(tmp_path: Path, planted: StateSpace) -> Path:
    path = tmp_path / "models.json"
    save_models(path, [ModelRecord("elevation", "elevation", planted, (3.0, 1.0), 0.002, "planted, no noise")])
    return path


def test_round_trip_is_exact(written: Path, planted: StateSpace) -> None:
    (record,) = load_models(written)
    for name in "abcd":
        np.testing.assert_array_equal(getattr(record.model, name), getattr(planted, name))
    assert (record.input, record.error, record.provenance) == ("elevation", 0.002, "planted, no noise")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda entry: entry.pop("d"), r"lacks \['d'\]"),
        (lambda entry: entry.update(gain=2.0), r"unknown keys \['gain'\]"),
        (lambda entry: entry.update(c=[[1.0]]), "c has shape"),
        (lambda entry: entry.update(input="focus"), "input='focus' must be one of"),
    ],
)
def test_spoiled_files_are_refused_by_name(written: Path, change: object, message: str) -> None:
    content = json.loads(written.read_text())
    change(content["responses"][0])
    written.write_text(json.dumps(content))
    with pytest.raises(ValueError, match=message):
        load_models(written)


def test_another_format_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "other.json"
    path.write_text('{"format": "something else"}')
    with pytest.raises(ValueError, match="format must be"):
        load_models(path)
