import json
from dataclasses import replace

import numpy as np
import pytest
import yaml

from rf_pointing.calibration import ModelVersion, fit_bias_model, read_model, write_model


@pytest.fixture
def file(campaign, table_1):
    fit = fit_bias_model(campaign(table_1))
    version = ModelVersion.from_fit(fit, name="2026-a", software="rf_pointing 0", created_t_s=1.7e9)
    return replace(version, valid_until_t_s=1.8e9)


@pytest.mark.parametrize("suffix", [".yaml", ".json"])
def test_a_written_model_reads_back_equal(file, tmp_path, suffix):
    path = tmp_path / f"model{suffix}"
    write_model(path, file)
    back = read_model(path)
    for name in file.model.coefficients:
        assert back.model.coefficients[name] == pytest.approx(file.model.coefficients[name], rel=1e-14)
    assert np.allclose(back.covariance, file.covariance, rtol=1e-13, atol=0.0)
    assert (back.fitted, back.station, back.passes, back.created_t_s) == (file.fitted, "gs1", 12, 1.7e9)
    assert not list(tmp_path.glob("*.part"))


def test_values_in_the_file_are_degrees_and_seconds(file, tmp_path):
    write_model(tmp_path / "m.yaml", file)
    terms = yaml.safe_load((tmp_path / "m.yaml").read_text())["terms"]
    assert terms["azimuth_offset"]["value_deg"] == pytest.approx(0.178, abs=0.05)
    assert terms["azimuth_velocity_lag"]["value_s"] == pytest.approx(-1.022, abs=0.2)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda m: m.pop("station"), "station is missing"),
        (lambda m: m.update(colour="red"), "colour is not a known key"),
        (lambda m: m["terms"]["droop"].update(value_deg="small"), r"terms\.droop\.value_deg='small' must be a number"),
        (lambda m: m["terms"].pop("droop"), "needs droop"),
        (lambda m: m["terms"].update(squint={}), r"terms\.squint is not a known key"),
        (lambda m: m["covariance"]["matrix"].pop(), r"covariance\.matrix must be a list of 14"),
        (lambda m: m["covariance"]["matrix"][0].__setitem__(0, -1.0), "positive diagonal"),
        (
            lambda m: (
                m["covariance"]["matrix"][0].__setitem__(1, 1.0) or m["covariance"]["matrix"][1].__setitem__(0, 1.0)
            ),
            "positive semidefinite",
        ),
        (
            lambda m: m["terms"]["droop"].update(sigma_deg=1e-6),
            r"terms\.droop\.sigma_deg=1e-06 contradicts the covariance",
        ),
        (lambda m: m["terms"]["droop"].pop("sigma_deg"), r"terms\.droop\.sigma_deg is missing"),
        (
            lambda m: m["validity"].update(until_utc="1999-01-01T00:00:00Z"),
            r"validity\.until_utc=1999.* must not be before",
        ),
        (lambda m: m["data"].update(last_utc="1999-01-01T00:00:00Z"), r"data\.last_utc=1999.* must not be before"),
        (lambda m: m.update(created_utc="yesterday"), "created_utc='yesterday' must be a time"),
        (lambda m: m.update(format="other/1"), "format='other/1' must be one of"),
        (lambda m: m["fit"].update(condition=float("nan")), r"fit\.condition=nan must be finite"),
    ],
)
def test_a_damaged_file_is_refused_by_its_key(file, tmp_path, change, message):
    path = tmp_path / "model.json"
    write_model(path, file)
    content = json.loads(path.read_text())
    change(content)
    path.write_text(json.dumps(content))
    with pytest.raises(ValueError, match=message):
        read_model(path)


def test_text_that_is_not_json_or_yaml_is_refused_with_its_line(tmp_path):
    (tmp_path / "m.json").write_text('{"format":\n oops}')
    (tmp_path / "m.yaml").write_text("format: x\n  bad: : y")
    for name in ("m.json", "m.yaml"):
        with pytest.raises(ValueError, match="line 2"):
            read_model(tmp_path / name)


def test_a_model_of_another_station_band_or_time_is_refused(file):
    file.check_for("gs1", "S", 1.75e9)
    with pytest.raises(ValueError, match="is of station 'gs1', must be of 'gs2'"):
        file.check_for("gs2", "S", 1.75e9)
    with pytest.raises(ValueError, match="is of band 'S', must be of 'X'"):
        file.check_for("gs1", "X", 1.75e9)
    with pytest.raises(ValueError, match="is valid from"):
        file.check_for("gs1", "S", 1.9e9)
