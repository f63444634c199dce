"""The command line from data files to a model file and a report; bad input writes nothing."""

import math
import re
from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("rclpy", reason="the executables live beside the nodes", exc_type=ImportError)
from rf_pointing.calibration import (
    TERMS,
    BiasModel,
    Ionosphere,
    ModelVersion,
    Observations,
    RawTracking,
    read_model,
    read_tracking,
    write_model,
)
from rf_pointing.calibration.pass_errors import pass_partials
from rf_pointing.calibration.tracking_csv import write_observations
from rf_pointing.commands import fit_bias_model, plan_calibration
from rf_pointing.core import MDEG
from rf_pointing.core.refraction import RadioRefraction
from rf_pointing.ephemeris import (
    TopocentricTrack,
    find_elements,
    find_passes,
    site,
    tle_lines,
    verification_elements,
)
from test.calibration.conftest import write_tracking

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


def at_one_elevation() -> Observations:
    """Return the same with every point of every pass at 40 deg of elevation, and at rest there."""
    data = points()
    flat, rest = np.full(len(data), math.radians(40.0)), np.zeros(len(data))
    moved = data.observed_elevation_rad - data.true_elevation_rad + flat
    still = {"elevation_rate_rad_s": rest, "elevation_acceleration_rad_s2": rest}
    return replace(data, true_elevation_rad=flat, observed_elevation_rad=moved, **still)


@pytest.fixture(scope="module")
def done(tmp_path_factory):
    folder = tmp_path_factory.mktemp("fit")
    write_observations(folder / "points.csv", points())
    fit_bias_model.main([str(folder / "points.csv"), "--output", str(folder / "m.yaml"), "--name", "test"])
    return folder


def test_the_model_file_holds_the_planted_coefficients_within_their_sigma(done):
    file: ModelVersion = read_model(done / "m.yaml")
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


def test_terms_are_chosen_and_passes_held_out_say_whether_that_was_right(done, tmp_path, capsys):
    fit_bias_model.main(
        [str(done / "points.csv"), "--output", str(tmp_path / "m.yaml"), "--form", "printed", "--select", "--held-out"]
    )
    assert set(read_model(tmp_path / "m.yaml").fitted) == {"azimuth_offset", "elevation_offset"}
    said = capsys.readouterr().out
    assert (
        "chosen by BIC: azimuth_offset, elevation_offset; not supported by the data, zero: non_orthogonality, " in said
    )
    chosen, offered = (
        float(re.search(rf"predicted to ([\d.]+) mdeg rms with {words}", said)[1])
        for words in ("these terms", "all terms offered")
    )
    # Noise of 1 mdeg in both axes; the needless twelve terms make the prediction of an unseen pass worse.
    assert 1.1 < chosen < 1.5
    assert chosen < offered
    assert "passes held out are predicted" in (tmp_path / "m_report" / "report.html").read_text()


def test_errors_of_the_orbit_are_found_and_allowed_for_unless_that_is_forbidden(tmp_path, capsys):
    data, random = points(24), np.random.default_rng(4)
    data = replace(data, range_m=np.full(len(data), 1e6), range_rate_m_s=np.zeros(len(data)))
    along = random.normal(0.0, 300.0, 24)[data.pass_id]
    azimuth, elevation = (partial[:, 0] * along for partial in pass_partials(data, ("along_track_m",)))
    moved = {"observed_azimuth_rad": data.observed_azimuth_rad + azimuth,
             "observed_elevation_rad": data.observed_elevation_rad + elevation}  # fmt: skip
    write_observations(tmp_path / "p.csv", replace(data, **moved))
    line = [str(tmp_path / "p.csv"), "--output", str(tmp_path / "m.yaml")]
    pulls, sigma = {}, {}
    for kind, options in (("measured", []), ("none", ["--orbit-prior", "0"])):
        fit_bias_model.main([*line, *options])
        file = read_model(tmp_path / "m.yaml")
        error = [file.model.coefficients[name] - PLANTED.coefficients[name] for name in file.fitted]
        sigma[kind] = np.sqrt(np.diag(file.covariance))
        pulls[kind] = np.max(np.abs(error) / sigma[kind])
    said = capsys.readouterr().out
    size = float(
        re.search(r"sigma allows for orbit errors of (\d+) m along-track, .* as the passes show them", said)[1]
    )
    assert size == pytest.approx(300.0, rel=0.35)
    # As correlated noise the orbit errors make sigma right too, and much larger.
    assert max(pulls.values()) < 4.0
    assert np.median(sigma["none"] / sigma["measured"]) > 2.0
    assert "doubtful: the residuals of a pass are correlated" in said
    assert "are correlated" in (tmp_path / "m_report" / "report.html").read_text()


def test_terms_that_are_not_offered_keep_their_known_values_while_others_are_chosen(done, tmp_path):
    known = read_model(done / "m.yaml")
    steep = replace(known, model=BiasModel.zero().replace(elevation_offset=-50.0 * MDEG, droop=0.3 * MDEG))
    write_model(tmp_path / "known.yaml", steep)
    offered = ["azimuth_offset", "collimation", "droop"]
    fit_bias_model.main(
        [str(done / "points.csv"), "--output", str(tmp_path / "m.yaml"), "--form", "printed", "--select",
         "--start-model", str(tmp_path / "known.yaml"), "--terms", *offered]
    )  # fmt: skip
    found = read_model(tmp_path / "m.yaml")
    # Droop would be chosen to stand for an elevation offset of which the search knew nothing; not chosen, it is zero.
    assert found.fitted == ("azimuth_offset",)
    assert found.model.coefficients["elevation_offset"] == pytest.approx(-50.0 * MDEG)
    assert found.model.coefficients["droop"] == 0.0


@pytest.fixture(scope="module")
def raw_files(tmp_path_factory):
    """Return CSV files of four passes of CBERS-2 at 2 samples/s, seen through the planted model and an ionosphere."""
    folder, seen = tmp_path_factory.mktemp("raw"), Ionosphere(electrons_per_m2=5e17, frequency_hz=2.25e9)
    elements, place = find_elements(verification_elements(), "28057"), site(STATION)
    (folder / "elements.tle").write_text("\n".join([elements.name, *tle_lines(elements)]) + "\n")
    track, random = TopocentricTrack(elements, place), np.random.default_rng(5)
    windows = find_passes(track, elements.epoch_t_s, 86400.0, math.radians(15.0))[:4]
    for number, window in enumerate(windows):
        look = track.sample(np.arange(window.aos_t_s, window.los_t_s, 0.5))
        bent = look.elevation_rad + seen.bending(look.elevation_rad, look.range_m)
        noise = random.normal(0.0, 2.0 * MDEG, (2, len(bent)))
        raw = RawTracking(
            station=STATION, band="X", target="28057", t_s=look.t_s, azimuth_rad=look.azimuth_rad + 100.0 * MDEG + noise[0],
            elevation_rad=bent - 50.0 * MDEG + noise[1], range_m=None, range_rate_m_s=None,
            good=np.arange(len(bent)) > 9,
        )  # fmt: skip
        write_tracking(folder / f"{number}.csv", raw)
    return folder


def test_points_and_raw_data_are_written_for_other_software_and_give_the_same_model(raw_files, tmp_path, capsys):
    common = ["--elements", str(raw_files / "elements.tle"), "--terms", "azimuth_offset", "elevation_offset"]
    first = [*(str(path) for path in sorted(raw_files.glob("*.csv"))), *common, "--ionosphere", "50", "2.25"]
    out = {
        name: str(tmp_path / f"{name}") for name in ("a.yaml", "points.csv", "raw.tdm", "b.yaml", "c.yaml", "d.yaml")
    }
    fit_bias_model.main([*first, "--output", out["a.yaml"], "--points", out["points.csv"], "--tdm", out["raw.tdm"]])
    fit_bias_model.main([out["raw.tdm"], *common, "--ionosphere", "50", "2.25", "--output", out["b.yaml"]])
    fit_bias_model.main([out["points.csv"], *common, "--output", out["c.yaml"]])
    fit_bias_model.main([out["raw.tdm"], *common, "--output", out["d.yaml"]])
    a, b, c, d = (read_model(out[name]) for name in ("a.yaml", "b.yaml", "c.yaml", "d.yaml"))
    for name, sigma in zip(a.fitted, np.sqrt(np.diag(a.covariance)), strict=True):
        assert a.model.coefficients[name] == pytest.approx(PLANTED.coefficients[name], abs=5.0 * sigma)
        assert b.model.coefficients[name] == pytest.approx(a.model.coefficients[name], abs=1e-3 * sigma)
        assert c.model.coefficients[name] == pytest.approx(a.model.coefficients[name], abs=1e-3 * sigma)
    # Without it, what the ionosphere bends ends in the elevation offset.
    assert d.model.coefficients["elevation_offset"] - a.model.coefficients["elevation_offset"] > 0.3 * MDEG
    with pytest.raises(SystemExit):
        fit_bias_model.main([out["points.csv"], *common, "--output", out["d.yaml"], "--tdm", out["raw.tdm"]])
    assert "the files hold calibration points only, no raw data to write" in capsys.readouterr().err


def test_angles_without_refraction_are_refused_until_that_is_stated(raw_files, tmp_path, capsys):
    air, files = RadioRefraction.standard(site(STATION).altitude_m), []
    for path in sorted(raw_files.glob("*.csv")):
        raw = read_tracking(path)
        write_tracking(tmp_path / path.name, replace(raw, elevation_rad=air.remove(raw.elevation_rad)))
        files.append(str(tmp_path / path.name))
    line = [*files, "--elements", str(raw_files / "elements.tle"), "--terms", "azimuth_offset", "elevation_offset", "droop",
            "--ionosphere", "50", "2.25", "--output", str(tmp_path / "m.yaml")]  # fmt: skip
    with pytest.raises(SystemExit) as ended:
        fit_bias_model.main(line)
    assert ended.value.code == 2
    size = float(re.search(r"the angles contain (-[\d.]+) \+/- [\d.]+ of the refraction", capsys.readouterr().err)[1])
    assert size == pytest.approx(-1.0, abs=0.1)
    assert not (tmp_path / "m.yaml").exists()
    fit_bias_model.main([*line, "--refraction-removed"])
    model = read_model(tmp_path / "m.yaml")
    assert model.model.coefficients["elevation_offset"] == pytest.approx(-50.0 * MDEG, abs=2.0 * MDEG)


def test_time_tags_late_in_all_passes_are_refused_until_they_are_stated(raw_files, tmp_path, capsys):
    files = []
    for path in sorted(raw_files.glob("*.csv")):
        raw = read_tracking(path)
        write_tracking(tmp_path / path.name, replace(raw, t_s=raw.t_s + 0.5))
        files.append(str(tmp_path / path.name))
    lags = ["azimuth_velocity_lag", "elevation_velocity_lag"]
    line = [*files, "--elements", str(raw_files / "elements.tle"), "--terms", "azimuth_offset", "elevation_offset", *lags,
            "--ionosphere", "50", "2.25", "--output", str(tmp_path / "m.yaml")]  # fmt: skip
    with pytest.raises(SystemExit) as ended:
        fit_bias_model.main(line)
    assert ended.value.code == 2
    late = float(re.search(r"the time tags are ([\d.]+) s late", capsys.readouterr().err)[1])
    assert late == pytest.approx(0.5, abs=0.02)
    fit_bias_model.main([*line, "--time-error", "0.5"])
    model = read_model(tmp_path / "m.yaml")
    assert [model.model.coefficients[name] for name in lags] == pytest.approx([0.0, 0.0], abs=0.01)


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (["--band", "Ka"], "the data are of band 'X', must be of 'Ka'"),
        (["--station", "leo_3m7"], "the data are of station 'Goldstone DSS-13', must be of 'LEO 3.7 m'"),
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


def cells(lines: list[str], row: int, **values: str) -> None:
    """Put text into columns of one row of a table."""
    header = next(line for line in lines if not line.startswith("#")).split(",")
    fields = lines[row].split(",")
    for name, value in values.items():
        fields[header.index(name)] = value
    lines[row] = ",".join(fields)


def swapped(line: str, header: list[str]) -> str:
    fields = line.split(",")
    for kind in ("observed", "true"):
        a, b = header.index(f"{kind}_azimuth_deg"), header.index(f"{kind}_elevation_deg")
        fields[a], fields[b] = fields[b], fields[a]
    return ",".join(fields)


def in_radians(line: str, header: list[str]) -> str:
    values = zip(header, line.split(","), strict=True)
    return ",".join(repr(math.radians(float(v))) if "_deg" in name else v for name, v in values)


@pytest.mark.parametrize(
    ("kind", "complaint"),
    [
        ("single pass", "passes=1 must be >= fewest_passes=3"),
        ("one elevation", "do not determine elevation_velocity_lag, elevation_acceleration_lag: fix them, give priors"),
        ("one elevation without lags", "the data cannot separate"),
        ("rates in rad/s", "azimuth_rate_deg_s is not the change of true_azimuth_deg"),
        ("nan", "line 11: true_elevation_deg=nan must be finite"),
        ("a repeated time", "repeats t_s[7]"),
        ("swapped columns", "degrees given, or azimuth and elevation swapped?"),
        ("one angle of another unit", "within 3 pi; degrees given?"),
        ("radians", "radians given where degrees are expected?"),
        ("two stations", "station is mixed: Goldstone DSS-13, gs2"),
        ("a model of another station", "is of station 'gs2', must be of 'Goldstone DSS-13'"),
        ("rubbish for a recording", "r.mcap"),
        ("rubbish for a TDM", "line 2"),
    ],
)
def test_data_that_cannot_give_a_model_are_refused_and_nothing_is_written(done, tmp_path, capsys, kind, complaint):
    arguments = [str(tmp_path / "p.csv")]
    write_observations(tmp_path / "p.csv", at_one_elevation() if "one elevation" in kind else
                       points(passes=1 if kind == "single pass" else 4))  # fmt: skip
    lines = (tmp_path / "p.csv").read_text().splitlines()
    header = lines[2].split(",")
    if kind == "one elevation without lags":
        arguments += ["--terms", *(term.name for term in TERMS if term.kind != "lag")]
    if kind == "rates in rad/s":
        place = header.index("azimuth_rate_deg_s")
        rows = [line.split(",") for line in lines[3:]]
        lines[3:] = [",".join([*r[:place], repr(math.radians(float(r[place]))), *r[place + 1 :]]) for r in rows]
    if kind == "nan":
        cells(lines, 10, true_elevation_deg="nan")
    if kind == "a repeated time":
        cells(lines, 11, t_s=lines[10].split(",")[header.index("t_s")])
    if kind == "one angle of another unit":
        cells(lines, 10, observed_azimuth_deg="5000.0")
    if kind == "swapped columns":
        lines = [*lines[:3], *(swapped(line, header) for line in lines[3:])]
    if kind == "radians":
        lines = [*lines[:3], *(in_radians(line, header) for line in lines[3:])]
    (tmp_path / "p.csv").write_text("\n".join(lines) + "\n")
    if kind == "two stations":
        (tmp_path / "q.csv").write_text("\n".join(["# station: gs2", *lines[1:]]) + "\n")
        arguments.append(str(tmp_path / "q.csv"))
    if kind == "a model of another station":
        write_model(tmp_path / "m.yaml", replace(read_model(done / "m.yaml"), station="gs2"))
        arguments += ["--start-model", str(tmp_path / "m.yaml")]
    for suffix, content in (("mcap", b"rubbish" * 50), ("tdm", b"CCSDS_TDM_VERS = 2.0\nrubbish\n")):
        if kind in ("rubbish for a recording", "rubbish for a TDM"):
            (tmp_path / f"r.{suffix}").write_bytes(content)
    arguments += {
        "rubbish for a recording": [str(tmp_path / "r.mcap")],
        "rubbish for a TDM": [str(tmp_path / "r.tdm")],
    }.get(kind, [])
    with pytest.raises(SystemExit) as ended:
        fit_bias_model.main([*arguments, "--output", str(tmp_path / "x.yaml")])
    assert ended.value.code == 2
    assert complaint in capsys.readouterr().err
    assert not (tmp_path / "x.yaml").exists()
    assert not (tmp_path / "x_report").exists()


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


def test_advice_from_a_model_of_another_station_is_refused(done, tmp_path, capsys):
    write_model(tmp_path / "m.yaml", replace(read_model(done / "m.yaml"), station="gs2"))
    line = ["--start", "2006-06-26T00:00:00", "--hours", "3", "--improve", "collimation", "--model"]
    with pytest.raises(SystemExit) as ended:
        plan_calibration.main([*line, str(tmp_path / "m.yaml")])
    assert ended.value.code == 2
    assert "is of station 'gs2', must be of 'Goldstone DSS-13'" in capsys.readouterr().err
