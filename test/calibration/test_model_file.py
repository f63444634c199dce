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


def test_values_in_the_file_are_degrees_and_seconds(file, tmp_path):
    write_model(tmp_path / "m.yaml", file)
    terms = yaml.safe_load((tmp_path / "m.yaml").read_text())["terms"]
    assert terms["azimuth_offset"]["value_deg"] == pytest.approx(0.178, abs=0.05)
    assert terms["azimuth_velocity_lag"]["value_s"] == pytest.approx(-1.022, abs=0.2)


SIZE = r"covariance\.matrix must be a list of 14 lists of 14"
ORDER = r"covariance\.order is .*; must be the fitted terms"
TEXTS = r"covariance\.order must be a list of texts"
DIAGONAL = "must be symmetric with a positive diagonal"
WHOLE = "must be a whole number >= 0"
OUT = object()
"""The value of a key that is taken out."""


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        (("station",), OUT, "station is missing"),
        (("station",), 5, "station=5 must be a text"),
        (("band",), "", "band='' must be a text"),
        (("colour",), "red", "colour is not a known key"),
        (("format",), "other/1", "format='other/1' must be one of"),
        (("created_utc",), "yesterday", "created_utc='yesterday' must be a time"),
        (("created_utc",), "2026-03-21T05:11:02", "created_utc='2026-03-21T05:11:02' must be a time"),
        (("created_utc",), "2026-13-21T05:11:02Z", "created_utc: "),
        (("validity", "until_utc"), "1999-01-01T00:00:00Z", r"validity\.until_utc=1999.* must not be before"),
        (("data", "last_utc"), "1999-01-01T00:00:00Z", r"data\.last_utc=1999.* must not be before"),
        (("data", "passes"), True, rf"data\.passes=True {WHOLE}"),
        (("data", "passes"), 2.0, rf"data\.passes=2\.0 {WHOLE}"),
        (("data", "passes"), -1, rf"data\.passes=-1 {WHOLE}"),
        (("fit", "condition"), float("nan"), r"fit\.condition=nan must be finite"),
        (("fit", "condition"), True, r"fit\.condition=True must be a number"),
        (("terms",), [], "terms must be a mapping of keys to values"),
        (("terms", "droop"), OUT, "needs droop"),
        (("terms", "squint"), {}, r"terms\.squint is not a known key"),
        (("terms", "droop", "value_deg"), "small", r"terms\.droop\.value_deg='small' must be a number"),
        (("terms", "droop", "value_deg"), 0.0, r"terms\.droop\.used=True contradicts terms\.droop\.value_deg"),
        (("terms", "droop", "used"), False, r"terms\.droop\.used=False contradicts terms\.droop\.value_deg"),
        (("terms", "droop", "used"), 1, r"terms\.droop\.used=1 must be true or false"),
        (("terms", "droop", "sigma_deg"), None, r"terms\.droop\.sigma_deg is missing"),
        (("terms", "droop", "fixed"), True, ORDER),
        (("covariance", "order"), ["collimation", "droop"], ORDER),
        (("covariance", "order"), "droop", TEXTS),
        (("covariance", "order", 3), 3, TEXTS),
        (("covariance", "unit", 5), "deg", r"covariance\.unit must be deg, "),
        (("covariance", "matrix"), "none", SIZE),
        (("covariance", "matrix", 3), 3.0, SIZE),
        (("covariance", "matrix", 3), OUT, SIZE),
        (("covariance", "matrix", 3, 4), OUT, SIZE),
        (("covariance", "matrix", 3, 4), True, r"covariance\.matrix\[3\]\[4\]=True must be a number"),
        (("covariance", "matrix", 0, 1), 1e-12, DIAGONAL),
        (("covariance", "matrix", 2, 2), 0.0, DIAGONAL),
    ],
)
def test_a_damaged_file_is_refused_by_its_key(file, tmp_path, key, value, message):
    path = tmp_path / "model.json"
    write_model(path, file)
    content = json.loads(path.read_text())
    place = content
    for part in key[:-1]:
        place = place[part]
    if value is OUT:
        del place[key[-1]]
    else:
        place[key[-1]] = value
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


@pytest.mark.parametrize("suffix", [".yaml", ".json"])
def test_every_field_reads_back(file, tmp_path, suffix):
    given = replace(file, valid_until_t_s=None, mean_azimuth_rad=1.3e-4, mean_elevation_rad=-2.1e-4, observations=17)
    write_model(tmp_path / f"m{suffix}", given)
    back = read_model(tmp_path / f"m{suffix}")
    for name, value in vars(given).items():
        if isinstance(value, float):
            # Times are written to the microsecond.
            assert getattr(back, name) == pytest.approx(
                value, rel=1e-13 if value < 1e6 else 0.0, abs=1e-6 * (value > 1e6)
            )
        elif name not in ("model", "covariance"):
            assert getattr(back, name) == value
    assert back.model.coefficients == pytest.approx(file.model.coefficients, rel=1e-14)
    assert np.allclose(back.covariance, file.covariance, rtol=1e-13, atol=0.0)
    assert not list(tmp_path.glob("*.part"))


def test_a_version_tells_of_its_fit(campaign, table_1):
    data = campaign(table_1)
    observed = data.observed_elevation_rad.copy()
    observed[[3, 9]] += 0.01
    fit = fit_bias_model(replace(data, observed_elevation_rad=observed))
    version = ModelVersion.from_fit(fit, name="a", software="test", created_t_s=1.7e9)
    assert (version.valid_from_t_s, version.valid_until_t_s) == (1.7e9, None)
    assert version.rejected == len(fit.rejected) >= 2
    assert version.observations == len(data) - version.rejected
    across = fit.residual_azimuth_rad[fit.used] * np.cos(data.true_elevation_rad[fit.used])
    assert version.rms_cross_elevation_rad == pytest.approx(np.sqrt(np.mean(across**2)))
    assert version.rms_elevation_rad == pytest.approx(np.sqrt(np.mean(fit.residual_elevation_rad[fit.used] ** 2)))
    assert version.mean_azimuth_rad == pytest.approx(np.mean(fit.residual_azimuth_rad[fit.used]))
    assert version.mean_elevation_rad == pytest.approx(np.mean(fit.residual_elevation_rad[fit.used]))
    assert (version.first_t_s, version.last_t_s) == (np.min(data.t_s), np.max(data.t_s))


@pytest.mark.parametrize(("t_s", "valid"), [(1.7e9 - 1.0, False), (1.7e9, True), (1.8e9, True), (1.8e9 + 1.0, False)])
def test_a_model_is_valid_from_its_first_to_its_last_instant(file, t_s, valid):
    assert file.is_valid_at(t_s) is valid
    assert replace(file, valid_until_t_s=None).is_valid_at(t_s) is (t_s >= 1.7e9)


@pytest.mark.parametrize(("correlation", "refused"), [(1.0, False), (-1.0, False), (1.0 + 1e-7, True)])
def test_terms_that_the_data_do_not_separate_are_a_covariance_and_more_than_that_is_none(
    file, tmp_path, correlation, refused
):
    path = tmp_path / "model.json"
    write_model(path, file)
    content = json.loads(path.read_text())
    matrix = np.diag(np.diag(content["covariance"]["matrix"]))
    matrix[0, 1] = matrix[1, 0] = correlation * np.sqrt(matrix[0, 0] * matrix[1, 1])
    content["covariance"]["matrix"] = matrix.tolist()
    path.write_text(json.dumps(content))
    if refused:
        with pytest.raises(ValueError, match="positive semidefinite"):
            read_model(path)
    else:
        assert read_model(path).fitted == file.fitted


def test_a_model_without_a_fitted_term_reads_back(file, tmp_path):
    """Terms that were typed in have no sigma; one that is zero is not used."""
    model = file.model.replace(droop=0.0)
    write_model(tmp_path / "m.json", replace(file, model=model, fitted=(), covariance=np.zeros((0, 0))))
    back = read_model(tmp_path / "m.json")
    assert (back.fitted, back.covariance.shape) == ((), (0, 0))
    assert back.model.coefficients["collimation"] == pytest.approx(model.coefficients["collimation"], rel=1e-14)
    terms = json.loads((tmp_path / "m.json").read_text())["terms"]
    assert (terms["droop"]["used"], terms["collimation"]["used"]) == (False, True)
    assert all(term["fixed"] and "sigma_deg" not in term for term in terms.values())


@pytest.mark.parametrize(("share", "refused"), [(0.9, False), (-0.9, False), (1.1, True), (-1.1, True)])
def test_a_sigma_that_was_changed_by_hand_is_found(file, tmp_path, share, refused):
    """By more than one part in a thousand."""
    write_model(tmp_path / "m.json", file)
    content = json.loads((tmp_path / "m.json").read_text())
    content["terms"]["azimuth_velocity_lag"]["sigma_s"] *= 1.0 + 1e-3 * share
    (tmp_path / "m.json").write_text(json.dumps(content))
    if refused:
        with pytest.raises(ValueError, match="azimuth_velocity_lag.sigma_s=.* contradicts the covariance"):
            read_model(tmp_path / "m.json")
    else:
        assert read_model(tmp_path / "m.json").fitted == file.fitted
