"""The command line from data files to a model file and a report; bad input writes nothing."""

import math

import numpy as np
import pytest

pytest.importorskip("rclpy", reason="the executables live beside the nodes", exc_type=ImportError)
from rf_pointing.calibration import BiasModel, ModelFile, Observations, read_model, write_observations
from rf_pointing.geometry import MDEG
from rf_pointing.nodes import fit_bias_model, plan_calibration

STATION = "Goldstone DSS-13"
PLANTED = BiasModel.zero().replace(azimuth_offset=100.0 * MDEG, elevation_offset=-50.0 * MDEG)


def points(passes: int = 12, **changes: object) -> Observations:
    """Return arcs all over the sky seen through the planted model, 1 mdeg of noise."""
    random, parts = np.random.default_rng(3), []
    for number in range(passes):
        t = np.arange(60.0)
        rate = random.uniform(-4e-3, 4e-3, 2) * (1.0, 0.3)
        curve = random.uniform(-4e-5, 4e-5, 2)
        start = (random.uniform(0.0, 2.0 * math.pi), random.uniform(0.4, 1.1))
        motion = [start[k] + rate[k] * t + 0.5 * curve[k] * t**2 for k in (0, 1)]
        motion += [rate[k] + curve[k] * t for k in (0, 1)] + [np.full(60, curve[k]) for k in (0, 1)]
        azimuth, elevation = PLANTED.apply(*motion)
        parts.append(
            Observations(
                station=STATION, band="X", t_s=1e9 + 1000.0 * number + t, pass_id=np.full(60, number),
                observed_azimuth_rad=azimuth + random.normal(0.0, 1.0 * MDEG, 60),
                observed_elevation_rad=elevation + random.normal(0.0, 1.0 * MDEG, 60),
                true_azimuth_rad=motion[0], true_elevation_rad=motion[1],
                azimuth_rate_rad_s=motion[2], elevation_rate_rad_s=motion[3],
                azimuth_acceleration_rad_s2=motion[4], elevation_acceleration_rad_s2=motion[5],
                sigma_azimuth_rad=np.full(60, 1.0 * MDEG), sigma_elevation_rad=np.full(60, 1.0 * MDEG),
            )
        )  # fmt: skip
    return Observations.concatenate(parts)


@pytest.fixture(scope="module")
def done(tmp_path_factory):
    folder = tmp_path_factory.mktemp("fit")
    write_observations(folder / "points.csv", points())
    fit_bias_model.main([str(folder / "points.csv"), "--output", str(folder / "m.yaml"), "--name", "test"])
    return folder


def test_the_model_file_holds_the_planted_coefficients_within_their_sigma(done):
    file: ModelFile = read_model(done / "m.yaml")
    assert (file.name, file.station, file.band) == ("test", STATION, "X")
    sigma = dict(zip(file.fitted, np.sqrt(np.diag(file.covariance)), strict=True))
    for name, value in PLANTED.coefficients.items():
        assert abs(file.model.coefficients[name] - value) < 4.0 * sigma[name]


def test_the_report_shows_coverage_residuals_distribution_correlation_and_coefficients(done):
    page = (done / "m_report" / "report.html").read_text()
    assert page.count("data:image/png;base64,") == 4
    for words in (
        "Sky coverage",
        "Residuals",
        "Distribution",
        "Correlation of the terms",
        "Coefficients",
        "azimuth offset",
    ):
        assert words in page


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (["--band", "Ka"], "the data are of band 'X', must be of 'Ka'"),
        (["--station", "Gatlinburg"], "the data are of station 'Goldstone DSS-13'"),
        (["--terms", "azimuth_offset", "wobble"], "wobble"),
        (["--require-full"], "sectors have < 25"),
    ],
)
def test_bad_input_is_refused_in_words_and_writes_nothing(done, tmp_path, capsys, arguments, complaint):
    with pytest.raises(SystemExit) as ended:
        fit_bias_model.main([str(done / "points.csv"), "--output", str(tmp_path / "x.yaml"), *arguments])
    assert ended.value.code == 2
    assert complaint in capsys.readouterr().err
    assert not (tmp_path / "x.yaml").exists()


@pytest.mark.parametrize("kind", ["single pass", "one elevation", "nan", "degrees"])
def test_data_that_cannot_give_a_model_are_refused(tmp_path, capsys, kind):
    data = points(passes=1 if kind == "single pass" else 4)
    if kind == "one elevation":
        data = data.select(np.abs(data.true_elevation_rad - data.true_elevation_rad[0]) < 1e-3)
    write_observations(tmp_path / "p.csv", data)
    lines = (tmp_path / "p.csv").read_text().splitlines()
    if kind == "nan":
        lines[10] = lines[10].replace(lines[10].split(",")[2], "nan")
    if kind == "degrees":
        lines[10] = ",".join([*lines[10].split(",")[:2], "5000.0", *lines[10].split(",")[3:]])
    (tmp_path / "p.csv").write_text("\n".join(lines) + "\n")
    with pytest.raises(SystemExit):
        fit_bias_model.main([str(tmp_path / "p.csv"), "--output", str(tmp_path / "x.yaml")])
    said = capsys.readouterr().err
    wanted = {"single pass": "passes=1 must be", "one elevation": "", "nan": "line 11", "degrees": "within 3 pi"}
    assert wanted[kind] in said
    assert not (tmp_path / "x.yaml").exists()


def test_plans_say_what_stays_thin_and_which_passes_help(capsys):
    line = ["--start", "2006-06-26T00:00:00", "--hours", "6"]
    with pytest.raises(SystemExit) as ended:
        plan_calibration.main(line)
    said = capsys.readouterr().out
    assert ended.value.code == 1
    assert "of 36 sectors" in said
    assert "thin: az" in said
    with pytest.raises(SystemExit) as ended:
        plan_calibration.main([*line, "--improve", "azimuth_velocity_lag", "--count", "2"])
    assert ended.value.code == 0
    assert capsys.readouterr().out.count("sigma times 0.") == 2
