"""What an identification leaves in its folder: files that can be read back, and pictures."""

import json
from pathlib import Path

import numpy as np
import pytest

from rf_pointing.identification import CrossCheck, ResponseStudy, StateSpace, StraightCheck
from rf_pointing.identification.identify import Identified
from rf_pointing.identification.spectra import FrequencyResponse
from rf_pointing.report.identification_report import error_table, write_identification


def response(driven: str, shown: str, coherence: float) -> ResponseStudy:
    omega = 2.0 * np.pi * 2.12
    pole = np.exp((-0.0082 + 1j) * omega * 0.02)
    a = np.array([[1.0, 0.0, 0.0], [0.0, pole.real, pole.imag], [0.0, -pole.imag, pole.real]])
    model = StateSpace(a, np.array([[0.02], [1.0], [0.0]]), np.array([[1.0, 0.002, 0.0]]), np.zeros((1, 1)), 0.02)
    frequency = np.linspace(0.0, 25.0, 513)
    shape = model.response(np.maximum(frequency, 1e-3))[:, 0, 0]
    measured = FrequencyResponse(frequency, shape, np.full(len(frequency), coherence))
    checks = (StraightCheck(0.001, 0.003), StraightCheck(0.0005, 0.004))
    if driven != shown:
        checks = (CrossCheck(0.05, 1e-6),)
    return ResponseStudy(driven, shown, measured, Identified(model, np.geomspace(1.0, 1e-9, 60), 10.0), checks)


@pytest.fixture
def studies() -> list[ResponseStudy]:
    return [response("elevation", "elevation", 0.95), response("elevation", "azimuth", 0.5)]


def test_models_errors_and_pictures_are_written(tmp_path: Path, studies: list[ResponseStudy]) -> None:
    write_identification(tmp_path, studies, "white input")
    content = json.loads((tmp_path / "models.json").read_text())
    assert content["format"] == "rf_pointing identified models 2"
    models = content["responses"]
    assert [(each["input"], each["output"], each["error"]) for each in models] == [
        ("elevation", "elevation", 0.001),
        ("elevation", "azimuth", 0.05),
    ]
    for name in "abcd":
        np.testing.assert_array_equal(models[0][name], getattr(studies[0].identified.model, name))
    assert {each["provenance"] for each in models} == {"white input"}
    rows = json.loads((tmp_path / "errors.json").read_text())
    assert rows[0]["gain_factor"] == 0.004
    assert rows[0]["modes_hz"] == [pytest.approx(2.12, abs=0.01)]
    assert rows[1]["bias_rad_s"] == [1e-6]
    for name in ("elevation_to_elevation", "elevation_to_azimuth"):
        assert (tmp_path / f"{name}.png").read_bytes().startswith(b"\x89PNG")


def test_the_table_says_percent_and_where_no_band_is_valid(studies: list[ResponseStudy]) -> None:
    straight, cross = error_table(studies).splitlines()[1:3]
    assert straight.split()[:6] == ["elevation", "to", "elevation", "0.10", "%", "0.40"]
    assert "none" in cross
