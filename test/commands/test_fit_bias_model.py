"""The command line from data files to a model file and a report; bad input writes nothing."""

import argparse
import math
import re
from dataclasses import dataclass, replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip("rclpy", reason="the executables live beside the nodes", exc_type=ImportError)
from rf_pointing import calibration
from rf_pointing.calibration import (
    TERMS,
    BiasModel,
    Ionosphere,
    Known,
    ModelVersion,
    Observations,
    PassPriors,
    RawTracking,
    read_model,
    read_tracking,
    write_model,
)
from rf_pointing.calibration.pass_errors import pass_partials
from rf_pointing.calibration.systematic_errors import Suspect
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
from rf_pointing.ephemeris.uncertainty import ElementUncertainty
from rf_pointing.report import calibration_report, tracking_from_bag
from rf_pointing.station.campaign.log import priors_near
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
    file = read_model(tmp_path / "m.yaml")
    assert set(file.fitted) == {"azimuth_offset", "elevation_offset"}
    # By the time of the last observation.
    assert file.name == "fit-1000011059"
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


def options_of(*line: str) -> argparse.Namespace:
    return fit_bias_model.arguments(["p.csv", *line])


def test_the_options_have_the_values_of_their_help():
    given = options_of()
    assert (given.files, given.output, given.name) == ([Path("p.csv")], Path("bias_model.yaml"), "")
    assert (given.max_age, given.largest_error, given.form) == (14.0, 6.0, "rotation")
    assert given.terms == list(calibration.TERM_NAMES)
    assert (given.elements, given.station, given.band, given.namespace) == ("", "dss13", None, None)
    unset = [given.weather, given.time_error, given.ionosphere, given.start_model, given.orbit_prior]
    assert [*unset, given.report, given.points, given.tdm] == [None] * 8
    flags = [given.refraction_removed, given.allow_damage, given.select, given.held_out, given.robust]
    assert not any([*flags, given.sectors, given.require_full])


def test_the_air_is_the_standard_or_that_of_the_user():
    assert fit_bias_model.refraction(options_of()) == "standard"
    assert fit_bias_model.refraction(options_of("--refraction-removed")) is None
    air = fit_bias_model.refraction(options_of("--weather", "900", "20", "40"))
    assert (air.pressure_hpa, air.temperature_k, air.relative_humidity) == (900.0, 293.15, 0.4)
    with pytest.raises(SystemExit):
        options_of("--refraction-removed", "--weather", "900", "20", "40")


def test_the_ionosphere_is_none_or_that_of_the_user():
    assert fit_bias_model.ionosphere(options_of()) is None
    seen = fit_bias_model.ionosphere(options_of("--ionosphere", "50", "2.25"))
    assert (seen.electrons_per_m2, seen.frequency_hz) == (5e17, 2.25e9)


def test_grid_north_is_off_by_the_convergence_of_the_zone():
    # Zone 11 has its middle at 117 deg west: atan(tan(0.20554 deg) sin(35.24716 deg)).
    assert math.degrees(fit_bias_model.convergence_rad(options_of())) == pytest.approx(0.118619, abs=1e-5)


@dataclass(frozen=True)
class Raw:
    t_s: np.ndarray
    name: str = ""


@pytest.fixture
def plain_passes(monkeypatch):
    """Leave passes as they are made, whatever they are made of."""
    monkeypatch.setattr(
        fit_bias_model, "TrackedPass",
        lambda raw, reference, ionosphere: SimpleNamespace(raw=raw, reference=reference, ionosphere=ionosphere),
    )  # fmt: skip


@pytest.mark.usefixtures("plain_passes")
def test_every_file_is_read_as_what_it_is(tmp_path, monkeypatch):
    names = ("points.csv", "raw.csv", "raw.tdm", "bag.mcap")
    for name in names:
        (tmp_path / name).write_text("")
    (tmp_path / "folder.csv").mkdir()
    inputs = fit_bias_model.recorded_input
    monkeypatch.setattr(inputs, "holds_points", lambda path: path.name == "points.csv")
    monkeypatch.setattr(inputs, "read_points", lambda paths: [path.name for path in paths])
    monkeypatch.setattr(inputs, "read_raw", lambda path, band: [Raw(np.array([10.0, 11.0]), f"{path.name} {band}")])
    monkeypatch.setattr(fit_bias_model, "_reference", lambda _options, one: f"track of {one.name}")
    monkeypatch.setattr(fit_bias_model, "_recorded", lambda _options, path: [path.name])
    line = [str(tmp_path / name) for name in (*names[1:], "folder.csv")]
    for late, first_s in (([], 10.0), (["--time-error", "0.5"], 9.5), (["--time-error", "0"], 10.0)):
        found, passes = fit_bias_model.read_files(
            fit_bias_model.arguments([str(tmp_path / "points.csv"), *line, *late, "--ionosphere", "50", "2.25"])
        )
        assert found == ["points.csv"]
        assert passes[2:] == ["bag.mcap", "folder.csv"]
        assert [one.raw.name for one in passes[:2]] == ["raw.csv X", "raw.tdm X"]
        assert [one.raw.t_s[0] for one in passes[:2]] == [first_s] * 2
        assert passes[1].reference == "track of raw.tdm X"
        assert passes[0].ionosphere.frequency_hz == 2.25e9


def test_a_reference_is_made_of_elements_that_are_young_enough(tmp_path, monkeypatch):
    with pytest.raises(ValueError, match="need --elements FILE for their reference"):
        fit_bias_model._reference(options_of(), Raw(np.zeros(1)))
    cbers = find_elements(verification_elements(), "28057")
    (tmp_path / "a.tle").write_text("\n".join([cbers.name, *tle_lines(cbers)]) + "\n")
    asked = []
    monkeypatch.setattr(fit_bias_model.recorded_input, "reference_of", lambda *given: asked.append(given) or "track")
    for line, oldest_s in (([], 1209600.0), (["--max-age", "2"], 172800.0)):
        given = options_of("--elements", str(tmp_path / "a.tle"), *line)
        assert fit_bias_model._reference(given, Raw(np.zeros(1))) == "track"
        assert asked[-1][3:] == (oldest_s, "standard")
    assert asked[0][1][0].catalogue_number == 28057


@pytest.mark.usefixtures("plain_passes")
def test_samples_of_a_recording_have_small_errors(monkeypatch):
    asked = []
    tracks = [("raw", "track")]
    monkeypatch.setattr(tracking_from_bag, "tracking_from_bag", lambda *a, **named: asked.append((a, named)) or tracks)
    (one,) = fit_bias_model._recorded(options_of("--namespace", "/gs2", "--allow-damage"), Path("bag"))
    assert (one.raw, one.reference, one.ionosphere) == ("raw", "track", None)
    ((place, named),) = asked
    assert place == (Path("bag"), STATION, "X")
    assert named.pop("largest_error_rad") == pytest.approx(6.0 * MDEG)
    assert named == {"namespace": "/gs2", "allow_damage": True}


@pytest.mark.parametrize("line", [[], ["--sectors"], ["--require-full"]])
def test_points_and_raw_passes_are_joined_without_those_left_out(line, monkeypatch):
    selections = []

    def select(parts, _rule, *, require_full):
        selections.append(require_full)
        return parts[0].select(np.arange(7)), None, "selection"

    monkeypatch.setattr(calibration, "select_observations", select)
    own = points(3)
    more = replace(points(2), pass_id=points(2).pass_id + 3)
    made = SimpleNamespace(points=more, reports=["stage"], notes=["pass 9 has none"])
    known = Known(model=BiasModel.zero())
    raw = SimpleNamespace(process=lambda given: made if given is known else None)
    found, stages, notes = fit_bias_model.collected(options_of(*line), own, raw, known, {1, 4})
    assert selections == ([line == ["--require-full"]] if line else [])
    assert stages == (["stage", "selection"] if line else ["stage"])
    assert notes == ["pass 9 has none"]
    assert sorted(set(found.pass_id.tolist())) == ([0] if line else [0, 2, 3])
    assert len(found) == (7 if line else 180)
    alone, stages, notes = fit_bias_model.collected(options_of(), own, None, known, ())
    assert (len(alone), stages, notes) == (180, [], [])


@pytest.mark.parametrize(
    ("prior", "ranges", "rates", "measured"),
    [
        ([], True, True, True),
        (["--orbit-prior", "0"], True, True, False),
        ([], False, True, False),
        ([], True, False, False),
    ],
)
def test_the_sizes_of_orbit_errors_are_measured_where_ranges_are_known(prior, ranges, rates, measured):
    seen = SimpleNamespace(range_m=1.0 if ranges else None, range_rate_m_s=1.0 if rates else None)
    assert fit_bias_model.measures_orbit(options_of(*prior), seen) == measured


WITH_RANGES = SimpleNamespace(range_m=1.0, range_rate_m_s=1.0)
WITHOUT_RANGES = SimpleNamespace(range_m=None, range_rate_m_s=None)


@pytest.mark.parametrize(("prior", "metres"), [([], 0.0), (["--orbit-prior", "7"], 7.0), (["--orbit-prior", "0"], 0.0)])
def test_orbit_errors_that_are_given_or_unknown_need_one_fit(prior, metres, monkeypatch):
    fits = []
    monkeypatch.setattr(fit_bias_model, "fit_of", lambda *given: fits.append(given) or "fit")
    given = options_of(*prior, "--terms", "droop")
    assert fit_bias_model.fit_of_all(given, WITHOUT_RANGES, "model", "before") == "fit"
    ((_, seen, present, names, priors, start),) = fits
    assert (seen, present, names, start) == (WITHOUT_RANGES, "model", ("droop",), "before")
    expected = PassPriors.of_orbit(metres)
    assert (priors is None) == (expected is None)
    if expected is not None:
        assert priors.sigma.tolist() == expected.sigma.tolist()


def test_orbit_errors_are_measured_from_the_fit_before(monkeypatch):
    fits, firsts = [], []
    monkeypatch.setattr(fit_bias_model, "fit_of", lambda *given: fits.append(given[3:]) or f"fit {len(fits)}")

    def measured(fit, first):
        firsts.append(first)
        fit("start")
        return "measured"

    monkeypatch.setattr(calibration, "measured_pass_priors", measured)
    before = SimpleNamespace(pass_priors="those before")
    given = options_of("--terms", "droop")
    assert fit_bias_model.fit_of_all(given, WITH_RANGES, None, before) == "fit 2"
    assert fits == [(("droop",), "start", before), (("droop",), "measured", "fit 1")]
    fit_bias_model.fit_of_all(given, WITH_RANGES, None, None)
    assert firsts == ["those before", None]


@dataclass(frozen=True)
class Found:
    covariance: np.ndarray
    names: tuple[str, ...] = ("droop",)


def test_the_covariance_of_chosen_terms_is_wider(monkeypatch):
    asked = []
    chosen = SimpleNamespace(names=("droop", "collimation"), widening=np.array([2.0, 3.0]), kept=("collimation",))
    monkeypatch.setattr(calibration, "select_terms", lambda *given, **named: asked.append((given, named)) or chosen)
    monkeypatch.setattr(fit_bias_model, "fit_of", lambda *given: Found(np.ones((2, 2)), given[3]))
    given = options_of("--terms", "droop", "collimation", "elevation_offset")
    result, kept = fit_bias_model.fit_of_chosen(given, "points", None, "orbit", "full")
    assert result.covariance.tolist() == [[4.0, 6.0], [6.0, 9.0]]
    assert (result.names, kept) == (("droop", "collimation"), ("collimation",))
    ((where, named),) = asked
    assert where == ("points", ("droop", "collimation", "elevation_offset"))
    assert (named["pass_priors"], named["about"]) == ("orbit", "full")
    assert named["held"] == dict.fromkeys(set(calibration.TERM_NAMES) - set(given.terms), 0.0)


def test_terms_are_held_where_they_are_known_and_zero_where_they_were_not_chosen(monkeypatch):
    asked = []
    monkeypatch.setattr(calibration, "fit_bias_model", lambda _points, **named: asked.append(named) or "fit")
    given = options_of("--terms", "droop", "collimation")
    assert fit_bias_model.fit_of(given, "points", None, ("droop",), "orbit", "start") == "fit"
    found = asked[-1]
    assert found["held"] == dict.fromkeys(set(calibration.TERM_NAMES) - {"droop"}, 0.0)
    assert (found["terms"], found["priors"], found["pass_priors"], found["start"]) == (
        ("droop",),
        None,
        "orbit",
        "start",
    )
    assert found["options"] == calibration.FitOptions(
        form="rotation", scale_covariance=True, huber_sigma=0.0, edit_sigma=3.0
    )
    known = BiasModel.zero().replace(droop=0.02, collimation=0.05, elevation_offset=0.01)
    robust = options_of("--terms", "droop", "collimation", "--robust", "--form", "printed")
    fit_bias_model.fit_of(robust, "points", SimpleNamespace(model=known), ("droop",), None)
    found = asked[-1]
    assert (found["held"]["collimation"], found["held"]["elevation_offset"]) == (0.0, 0.01)
    assert "droop" not in found["held"]
    assert found["priors"] == priors_near(known, ("droop",))
    assert found["options"] == calibration.FitOptions(
        form="printed", scale_covariance=True, huber_sigma=1.5, edit_sigma=0.0
    )


def test_a_term_that_the_known_model_lacks_is_held_near_zero(monkeypatch):
    asked = []
    monkeypatch.setattr(calibration, "fit_bias_model", lambda _points, **named: asked.append(named))
    extension = next(term.name for term in calibration.EXTENSION_TERMS)
    present = SimpleNamespace(model=BiasModel.zero())
    fit_bias_model.fit_of(options_of("--terms", extension), "points", present, (extension,), None)
    base = BiasModel.zero().replace(**{extension: 0.0})
    assert asked[-1]["priors"] == priors_near(base, (extension,))


def test_each_pass_has_a_clock_of_its_own_for_the_search_of_late_ones(monkeypatch):
    fits = []
    monkeypatch.setattr(fit_bias_model, "fit_of", lambda *given: fits.append(given) or "fit")
    assert fit_bias_model.clocks(options_of("--terms", "droop"), "points", None) == "fit"
    ((_, _, _, names, priors),) = fits
    assert names == ("droop",)
    assert priors == PassPriors(clock_s=1.0)


def test_remarks_name_the_orbit_errors_that_sigma_allows_for():
    priors = SimpleNamespace(names=("along_track_m", "radial_m"), sigma=np.array([300.4, 12.0]))
    text = "sigma allows for orbit errors of 300 m along-track, 12 m radial in each pass"
    for prior, pass_priors, remarks in (
        ([], priors, [f"{text} as the passes show them"]),
        (["--orbit-prior", "5"], priors, [text]),
        (["--orbit-prior", "0"], None, []),
    ):
        assert fit_bias_model.orbit_remarks(options_of(*prior), SimpleNamespace(pass_priors=pass_priors)) == remarks
    (remark,) = fit_bias_model.orbit_remarks(options_of(), SimpleNamespace(pass_priors=None))
    assert "exact reference" in remark


def test_remarks_name_the_terms_that_were_chosen_kept_and_left_out():
    done = SimpleNamespace(result=SimpleNamespace(names=("droop", "collimation")), kept=("collimation",))
    given = options_of("--select", "--terms", "droop", "collimation", "elevation_offset")
    (remark,) = fit_bias_model.choice_remarks(given, done)
    assert remark == (
        "chosen by BIC: droop; not seen, but fitted since others depend on them: collimation; "
        "not supported by the data, zero: elevation_offset"
    )
    assert fit_bias_model.choice_remarks(options_of(), done) == []


def test_held_out_passes_are_predicted_by_both_sets_of_terms(monkeypatch):
    asked = []

    def predict(_points, names, *, held, pass_priors):
        asked.append((names, held, pass_priors))
        return SimpleNamespace(
            rms_rad=np.array([1.0, 3.0, 2.0]) * MDEG, total_rms_rad=2.5 * MDEG, pass_ids=[10, 11, 12]
        )

    monkeypatch.setattr(calibration, "held_out_passes", predict)
    result = SimpleNamespace(names=("droop",), coefficients={"droop": 1.0, "collimation": 2.0}, pass_priors="priors")
    given = options_of("--held-out", "--terms", "droop", "collimation")
    four = SimpleNamespace(passes=range(4))
    these, offered = fit_bias_model.prediction_remarks(given, four, result)
    assert these == ("passes held out are predicted to 2.50 mdeg rms with these terms, the worst (11) to 3.00 mdeg")
    assert "with all terms offered" in offered
    assert asked == [(("droop",), {"collimation": 2.0}, "priors"), (("droop", "collimation"), {}, "priors")]
    assert len(fit_bias_model.prediction_remarks(options_of("--held-out", "--terms", "droop"), four, result)) == 1
    assert fit_bias_model.prediction_remarks(options_of(), SimpleNamespace(passes=()), result) == []
    with pytest.raises(ValueError, match="passes=3 must be >= 4"):
        fit_bias_model.prediction_remarks(given, SimpleNamespace(passes=range(3)), result)


def suspect(text: str, refuse: bool) -> Suspect:
    return Suspect("clock", 1.0, 0.1, "s", text, refuse)


def test_a_fit_is_refused_for_every_error_that_spoils_it():
    fit_bias_model.refuse_wrong([None, suspect("a small clock error", False)])
    with pytest.raises(ValueError, match=r"^no model is fitted: a late clock; a wrong site$"):
        fit_bias_model.refuse_wrong(
            [suspect("a late clock", True), None, suspect("a small one", False), suspect("a wrong site", True)]
        )


@pytest.mark.parametrize("refuse", [False, True])
@pytest.mark.parametrize(
    ("file", "time_error", "weather"), [("p.csv", [], []), ("bag", ["--time-error", "0"], ["900"])]
)
def test_doubts_are_looked_for_in_clock_air_site_and_north(file, time_error, weather, refuse, monkeypatch):
    seen = {}

    def found(name):
        def look(*given):
            seen[name] = given
            return suspect(name, refuse) if name != "clock_by_ranges" else None

        return look

    names = ["clock_by_ranges", "common_clock", "refraction_and_site", "north_doubt"]
    for name in names:
        monkeypatch.setattr(fit_bias_model.suspects, name, found(name))
    line = [*time_error, *(["--weather", "900", "20", "40"] if weather else [])]
    given = fit_bias_model.arguments([file, "q.tdm", *line])
    wanted = [name for name in names[1:] if name != "common_clock" or not time_error]
    if refuse and file == "p.csv":
        with pytest.raises(ValueError, match="; ".join(wanted)):
            fit_bias_model.doubtful(given, "result", "points", ["passes"], None)
    else:
        # The station's own recordings are not refused.
        assert fit_bias_model.doubtful(given, "result", "points", ["passes"], None) == wanted
    air = seen["refraction_and_site"][2]
    standard = RadioRefraction.standard(site(STATION).altitude_m)
    assert air.pressure_hpa == (900.0 if weather else pytest.approx(standard.pressure_hpa, rel=1e-4))
    assert seen["north_doubt"] == ("result", fit_bias_model.convergence_rad(given))
    assert ("common_clock" in seen) == (not time_error)


def with_sizes(passes: int, **sizes: float) -> SimpleNamespace:
    return SimpleNamespace(
        passes=passes, pass_priors=SimpleNamespace(names=tuple(sizes), sigma=np.array([*sizes.values()]))
    )


def test_few_passes_do_not_know_the_sizes_of_the_orbit_errors():
    (doubt,) = fit_bias_model.orbit_doubts(options_of(), with_sizes(7, along_track_m=9.0), ["pass"])
    assert "measured from 7 passes, which know their size to 27 %" in doubt
    assert fit_bias_model.orbit_doubts(options_of(), with_sizes(8, along_track_m=9.0), ["pass"]) == []
    assert fit_bias_model.orbit_doubts(options_of("--orbit-prior", "5"), with_sizes(7, along_track_m=9.0), []) == []
    assert fit_bias_model.orbit_doubts(options_of(), SimpleNamespace(passes=7, pass_priors=None), []) == []


def test_orbit_errors_three_times_those_of_such_elements_are_doubtful(tmp_path):
    cbers = find_elements(verification_elements(), "28057")
    (tmp_path / "a.tle").write_text("\n".join([cbers.name, *tle_lines(cbers)]) + "\n")
    given = options_of("--elements", str(tmp_path / "a.tle"))
    days = (1.0, -2.0)
    passes = [
        SimpleNamespace(raw=SimpleNamespace(t_s=cbers.epoch_t_s + 86400.0 * np.array([day, 30.0]), target="28057"))
        for day in days
    ]
    ages = [np.array(ElementUncertainty().sigmas_m(86400.0 * day)) for day in days]
    along, _, radial = np.sqrt(0.5 * (ages[0] ** 2 + ages[1] ** 2))
    few = with_sizes(8, along_track_m=2.99 * along, radial_m=3.01 * radial)
    (doubt,) = fit_bias_model.orbit_doubts(given, few, passes)
    assert doubt.startswith(f"radial_m of the passes is {3.01 * radial:.0f}, 3.0 times that of elements up to 2.0 days")
    assert fit_bias_model.orbit_doubts(given, few, []) == []
    assert fit_bias_model.orbit_doubts(options_of(), few, passes) == []


def test_a_fit_scales_the_noise_of_the_one_before():
    before = Known(model=BiasModel.zero(), form="printed", sigma_scale=(2.0, 3.0))
    errors = [SimpleNamespace(pass_id=4), SimpleNamespace(pass_id=7)]
    noise = [SimpleNamespace(factor=4.0), SimpleNamespace(factor=25.0)]
    known = fit_bias_model.known_after(SimpleNamespace(model=PLANTED, noise=noise, pass_errors=errors), before)
    assert known.sigma_scale == (4.0, 15.0)
    assert (known.model, known.form, known.errors) == (PLANTED, "printed", {4: errors[0], 7: errors[1]})
    quiet = fit_bias_model.known_after(SimpleNamespace(model=PLANTED, noise=None, pass_errors=[]), before)
    assert quiet.sigma_scale == (2.0, 3.0)


def test_the_outcome_is_a_line_of_numbers():
    data = points(2)
    used = np.arange(len(data)) < 100
    result = SimpleNamespace(
        used=used, passes=2, rejected=[3, 4, 5], condition=12.4, rms_rad=lambda: (2.0 * MDEG, 3.0 * MDEG)
    )
    text = fit_bias_model.summary(data, result)
    rule = calibration.SectorRule()
    seen = data.select(used)
    counts = rule.coverage(seen.true_azimuth_rad, seen.true_elevation_rad).counts
    assert text.startswith(
        "100 observations of 2 passes, 3 edited out; residual rms 2.00 mdeg cross-elevation, 3.00 mdeg elevation; "
        "condition 12; "
    )
    assert f"; {np.count_nonzero(counts >= 25)} of 36 sectors have 25 observations" in text


class Rounds:
    """The rounds of pipeline and fit; `values` are the terms of each fit, `late` what each search finds."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.values: list[list[float]] = []
        self.late: list[dict[int, Suspect]] = []
        self.passes, self.pass_errors, self.north = 9, ["errors"], None
        self.collected: list[set[int]] = []
        self.searched: list[str] = []
        self.fits = 0
        self.first = None
        self.chosen: list[tuple] = []
        module = fit_bias_model
        monkeypatch.setattr(module, "collected", self._collected)
        monkeypatch.setattr(module, "fit_of_all", self._fit)
        monkeypatch.setattr(module, "fit_of_chosen", lambda *given: self.chosen.append(given[3:]) or ("few", ("kept",)))
        monkeypatch.setattr(module, "clocks", lambda *_: "clocks")
        monkeypatch.setattr(module, "known_after", lambda result, _before: f"after fit {result.number}")
        monkeypatch.setattr(module, "doubtful", lambda *_: ["doubt"])
        monkeypatch.setattr(module, "orbit_doubts", lambda *_: ["orbit"])
        monkeypatch.setattr(module, "RawPasses", self._raw)
        monkeypatch.setattr(module.suspects, "wrong_north", lambda *_: self.north)
        monkeypatch.setattr(module.suspects, "late_passes", self._search)

    def _raw(self, _passes, first):
        self.first = first
        return "raw"

    def _collected(self, _options, _points, _raw, _known, out):
        self.collected.append(set(out))
        every = SimpleNamespace(passes=range(self.passes), range_m=None, range_rate_m_s=None)
        return every, [f"stage {len(self.collected)}"], ["note"]

    def _fit(self, _options, _points, _present, _before):
        values = self.values[min(self.fits, len(self.values) - 1)]
        self.fits += 1
        sigma = np.array([2.0, 1.0])
        return SimpleNamespace(
            values=np.array(values), sigma=sigma, pass_errors=self.pass_errors, pass_priors="priors", number=self.fits
        )

    def _search(self, result, _points):
        self.searched.append(result if isinstance(result, str) else f"fit {result.number}")
        return self.late.pop(0) if self.late else {}

    def run(self, *line: str, raw: bool = True, own: bool = True):
        files = SimpleNamespace(pass_id=np.array([3, 7])) if own else None
        passes = [SimpleNamespace(raw=SimpleNamespace(notes=["raw note", "raw note"]))] if raw else []
        return fit_bias_model.fitted_files(options_of(*line), (files, passes), None)


@pytest.fixture
def rounds(monkeypatch) -> Rounds:
    made = Rounds(monkeypatch)
    made.values = [[1.0, 1.0], [0.5, 1.0], [0.42, 1.0]]
    return made


def test_raw_passes_are_processed_until_no_term_moves(rounds):
    done = rounds.run()
    # 0.08 is less than 0.05 of the sigma of 2; the model after each fit goes into the next round.
    assert rounds.fits == 3
    assert rounds.collected == [set()] * 3
    assert rounds.searched == ["fit 1"]
    assert (done.result.number, done.full.number) == (3, 3)
    assert (done.stages, done.notes, done.doubts, done.kept) == (
        ["stage 3"],
        ["note", "raw note"],
        ["doubt", "orbit"],
        (),
    )


@pytest.mark.parametrize("step", [(0.11, 0.0), (0.0, 0.06)])
def test_terms_that_go_on_moving_end_after_six_rounds(step, rounds):
    rounds.values = [[k * step[0], k * step[1]] for k in range(10)]
    rounds.run()
    assert rounds.fits == 7
    rounds.values = [[(-1.0) ** k, 0.0] for k in range(10)]
    rounds.fits = 0
    rounds.run()
    assert rounds.fits == 7


def test_points_alone_are_fitted_once(rounds):
    done = rounds.run(raw=False)
    assert (rounds.fits, done.result.number, done.notes) == (1, 1, ["note"])


@pytest.mark.parametrize("raw", [False, True])
def test_late_passes_are_left_out_until_none_stands_out(raw, rounds):
    rounds.values = [[1.0, 1.0]]
    rounds.late = [{2: suspect("pass 2 is late", False)}, {5: suspect("pass 5 is late", False)}]
    done = rounds.run(raw=raw)
    assert rounds.collected == [set(), {2}, {2, 5}, *([{2, 5}] if raw else [])]
    assert rounds.searched == ["fit 1", "fit 2", "fit 3"]
    assert done.notes[-2:] == ["pass 2 is late", "pass 5 is late"]


@pytest.mark.parametrize(
    ("errors", "passes", "searched"),
    [(["errors"], 9, "fit 1"), ([], 4, "fit 1"), ([], 5, "clocks"), (["errors"], 3, "fit 1"), ([], 3, "fit 1")],
)
def test_late_passes_are_searched_with_a_clock_each_where_the_fit_has_none(errors, passes, searched, rounds):
    rounds.pass_errors, rounds.passes = errors, passes
    rounds.run()
    assert rounds.searched == [searched]


@pytest.mark.parametrize(("own", "first"), [(True, 8), (False, 0)])
def test_raw_passes_are_numbered_after_those_of_the_points(own, first, rounds):
    rounds.run(own=own)
    assert rounds.first == first


def test_a_wrong_north_is_refused_before_the_fit(rounds):
    rounds.north = suspect("north is off by 0.12 deg", True)
    with pytest.raises(ValueError, match="north is off"):
        rounds.run()
    assert rounds.fits == 0


def test_terms_are_chosen_at_once_from_points_and_at_last_from_raw_passes(rounds):
    done = rounds.run("--select", "--orbit-prior", "7", raw=False)
    ((orbit, full),) = rounds.chosen
    assert full is None
    assert orbit.sigma.tolist() == PassPriors.of_orbit(7.0).sigma.tolist()
    assert (rounds.fits, done.result, done.full, done.kept, done.doubts) == (0, "few", None, ("kept",), [])
    rounds.run("--select", raw=False)
    assert rounds.chosen[-1] == (PassPriors.of_orbit(0.0), None)
    done = rounds.run("--select")
    assert (done.result, done.full.number, done.kept) == ("few", 3, ("kept",))
    assert rounds.chosen[-1] == ("priors", done.full)


class Written:
    """What a fit leaves on the disk; the fit itself is ready-made."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.files: dict[str, object] = {}
        self.raw = [SimpleNamespace(raw="pass 1"), SimpleNamespace(raw="pass 2")]
        self.checked: list[tuple] = []
        module = fit_bias_model
        result = SimpleNamespace(last_t_s=1e9, separation_advice=lambda: ["droop"])
        done = module.Fitted(result, result, "points", ["stage"], ["note"], ["doubt"])
        monkeypatch.setattr(module, "read_files", lambda _: (None, self.raw))
        monkeypatch.setattr(module, "fitted_files", lambda _options, _files, _present: done)
        monkeypatch.setattr(module, "summary", lambda *_: "summary")
        monkeypatch.setattr(module, "orbit_remarks", lambda *_: ["orbit"])
        monkeypatch.setattr(module, "ModelVersion", SimpleNamespace(from_fit=lambda _result, name, **_: name))
        present = SimpleNamespace(valid_from_t_s=5.0, check_for=lambda *given: self.checked.append(given))
        monkeypatch.setattr(calibration, "read_model", lambda _: present)
        monkeypatch.setattr(calibration, "doubts_of", lambda *_: ["noise"])
        for name in ("write_model", "write_observations", "write_tdm"):
            monkeypatch.setattr(calibration, name, lambda path, content, **_: self.files.update({path.name: content}))
        monkeypatch.setattr(calibration_report, "write_calibration_report", self._report)

    def _report(self, folder, _points, _result, *, name, stages, notes, remarks):
        self.files[folder.name] = (name, stages, notes, remarks)
        return folder / "report.html"


@pytest.fixture
def written(monkeypatch) -> Written:
    return Written(monkeypatch)


def test_a_fit_leaves_a_model_and_a_report_and_what_else_is_wanted(written):
    lines = fit_bias_model.run(options_of("--output", "out/m.yaml"))
    report = ("fit-1000000000", ["stage"], ["note", "doubt"], ["orbit"])
    assert written.files == {"m.yaml": "fit-1000000000", "m_report": report}
    assert lines == [
        "summary", "orbit", "not separable: droop", "doubtful: doubt", "doubtful: noise", "left out: note",
        "model out/m.yaml, report out/m_report/report.html",
    ]  # fmt: skip
    assert written.checked == []
    fit_bias_model.run(
        options_of("--points", "p.csv", "--tdm", "r.tdm", "--report", "page", "--name", "mine", "--start-model", "a")
    )
    assert written.files["bias_model.yaml"] == "mine"
    assert written.files["p.csv"] == "points"
    assert written.files["r.tdm"] == ["pass 1", "pass 2"]
    assert written.files["page"][0] == "mine"
    assert written.checked == [(STATION, "X", 5.0)]


def test_points_alone_are_no_raw_data_to_write(written):
    written.raw = []
    fit_bias_model.run(options_of())
    written.files.clear()
    with pytest.raises(ValueError, match=r"tdm=r\.tdm: the files hold calibration points only"):
        fit_bias_model.run(options_of("--tdm", "r.tdm"))
    assert written.files == {}
