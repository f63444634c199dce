"""`plan_calibration`: what its command line plans for, and what it prints of a campaign and of advice."""

import dataclasses
import re
from collections.abc import Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from rf_pointing import calibration
from rf_pointing.calibration import BiasModel, ModelVersion, PassPriors, SectorRule, Slew, write_model
from rf_pointing.commands import plan_calibration
from rf_pointing.core import MDEG
from rf_pointing.core.dates import DAY_S, parse_utc
from rf_pointing.ephemeris import find_elements, tle_lines, verification_elements
from rf_pointing.station.campaign.plan import ArcRules

START = "2006-06-27T04:00:00"
START_S = parse_utc(START)


def run(*words: str) -> int:
    with pytest.raises(SystemExit) as ended:
        plan_calibration.main([*words])
    assert isinstance(ended.value.code, int)
    return ended.value.code


def catalogue(path: Path, *epochs_s: float) -> list[str]:
    """Write CBERS 2 with each of these epochs, as `AT 0`, `AT 1` ...; return the option."""
    cbers = find_elements(verification_elements(), "28057")
    lines = []
    for k, epoch_s in enumerate(epochs_s):
        one = dataclasses.replace(cbers, catalogue_number=k + 1, epoch_t_s=epoch_s)
        lines += [f"AT {k}", *tle_lines(one)]
    path.write_text("\n".join(lines))
    return ["--elements", str(path)]


@pytest.fixture
def one(tmp_path: Path) -> list[str]:
    """Return the options of three hours of CBERS 2, in which two passes rise above 10 deg."""
    return [*catalogue(tmp_path / "one.tle", find_elements(verification_elements(), "28057").epoch_t_s),
            "--start", START, "--hours", "3"]  # fmt: skip


@pytest.mark.parametrize(
    ("line", "wanted"),
    [
        (
            "",
            {
                "elements": "", "beacons": False, "station": "dss13", "band": None, "hours": 24.0, "arc": [],
                "spacing": 10.0, "settle": 60.0, "fewest": 25, "sigma": 2.0, "improve": [], "model": None, "count": 5,
                "orbit_prior": 200.0,
            },
        ),
        (
            "--elements x.tle --beacons --station mine.yaml --band Ka --hours 3 --arc 20 40 --spacing 5 --settle 30",
            {
                "elements": "x.tle", "beacons": True, "station": "mine.yaml", "band": "Ka", "hours": 3.0,
                "arc": [20.0, 40.0], "spacing": 5.0, "settle": 30.0,
            },
        ),
        (
            "--fewest 3 --sigma 1.5 --improve droop collimation --model m.yaml --count 2 --orbit-prior 0",
            {
                "fewest": 3, "sigma": 1.5, "improve": ["droop", "collimation"], "model": Path("m.yaml"), "count": 2,
                "orbit_prior": 0.0,
            },
        ),
    ],
)  # fmt: skip
def test_the_command_line_means_what_it_says(line: str, wanted: dict[str, Any]) -> None:
    options = vars(plan_calibration.arguments(["--start", START, *line.split()]))
    assert {name: options[name] for name in wanted} == wanted


def test_a_campaign_needs_a_start() -> None:
    assert run("--hours", "3") == 2


# Candidates


class Search:
    """In the place of the search for arcs: keeps what is searched, and finds `found`."""

    def __init__(self) -> None:
        self.found: list[Any] = ["a candidate"]
        self.refused: list[str] = []
        self.names: list[str] = []
        self.times: tuple[float, float] = (0.0, 0.0)
        self.rules = ArcRules()

    def __call__(
        self, elements: Sequence[Any], _site: Any, start_s: float, span_s: float, rules: ArcRules
    ) -> tuple[list[Any], list[str]]:
        self.names, self.times, self.rules = [each.name for each in elements], (start_s, span_s), rules
        return self.found, self.refused


@pytest.fixture
def search(monkeypatch: pytest.MonkeyPatch) -> Search:
    search = Search()
    monkeypatch.setattr(plan_calibration, "candidate_arcs", search)
    return search


def candidates_of(*words: str) -> list[Any]:
    return plan_calibration.candidates_of(plan_calibration.arguments(["--start", START, *words]))


def test_candidates_are_cut_as_the_options_say(search: Search, capsys: pytest.CaptureFixture[str]) -> None:
    search.refused = ["its orbit has decayed"]
    assert candidates_of("--hours", "48", "--arc", "20", "40", "--spacing", "5", "--sigma", "3") == search.found
    assert search.times == (START_S, 48.0 * 3600.0)
    rules = search.rules
    assert (rules.arcs_s, rules.spacing_s) == ((20.0, 40.0), 5.0)
    assert rules.sigma_rad == pytest.approx(3.0 * MDEG)
    assert capsys.readouterr().err == "plan_calibration: left out: its orbit has decayed\n"


def test_the_sky_is_that_of_beacons_of_a_file_or_of_sgp4(search: Search, tmp_path: Path) -> None:
    candidates_of("--beacons")
    assert {name.split()[0] for name in search.names} == {"BEACON"}
    candidates_of(*catalogue(tmp_path / "x.tle", START_S))
    assert search.names == ["AT 0"]
    candidates_of()
    assert "CBERS 2" in search.names


def test_elements_count_that_are_within_14_days_all_along(search: Search, tmp_path: Path) -> None:
    """Of a campaign of a day: from 13 days before its start to 14 days after it."""
    days = (-13.1, -12.9, 0.0, 13.9, 14.1)
    candidates_of(*catalogue(tmp_path / "x.tle", *(START_S + day * DAY_S for day in days)))
    assert search.names == ["AT 1", "AT 2", "AT 3"]


def test_elements_that_are_too_old_are_refused(
    search: Search, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run("--start", START, *catalogue(tmp_path / "x.tle", START_S - 20.0 * DAY_S)) == 2
    assert f"none of 1 elements is within 14 days of start={START}" in capsys.readouterr().err


def test_a_sky_without_candidates_is_refused(search: Search, capsys: pytest.CaptureFixture[str]) -> None:
    search.found = []
    assert run("--start", START) == 2
    assert "no target rises above 10 deg in 24 h" in capsys.readouterr().err


@pytest.mark.parametrize(("hours", "works"), [("0.009", False), ("0.01", True), ("671.9", True), ("672.1", False)])
def test_a_campaign_lasts_up_to_four_weeks(search: Search, tmp_path: Path, hours: str, works: bool) -> None:
    line = [*catalogue(tmp_path / "x.tle", START_S + 1800.0 * float(hours)), "--hours", hours]
    if works:
        assert candidates_of(*line) == search.found
    else:
        with pytest.raises(ValueError, match=f"hours={hours}"):
            candidates_of(*line)


# The campaign


def test_a_campaign_lists_its_passes_and_what_stays_thin(one: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert run(*one, "--fewest", "10") == 1
    lines = capsys.readouterr().out.splitlines()
    assert lines[:2] == [
        "2006-06-27T05:00:00.000Z     560 s  peak 44.3 deg  AT 0",
        "2006-06-27T06:40:40.000Z     400 s  peak 18.0 deg  AT 0",
    ]
    counted = re.fullmatch(r"2 of 2 candidates fill (\d+) of 36 sectors", lines[2])
    assert counted
    thin = [re.fullmatch(r"thin: .* has (\d+) of 10", line) for line in lines[3:]]
    assert all(found and int(found[1]) < 10 for found in thin)
    assert len(thin) == 36 - int(counted[1]) < 36


@pytest.fixture
def planned(monkeypatch: pytest.MonkeyPatch, search: Search) -> dict[str, Any]:
    """Let every campaign be full after an hour and a half; return the rules of the last one."""
    given: dict[str, Any] = {}

    def plan_campaign(_candidates: Any, rule: SectorRule, slew: Slew) -> Any:
        given.update(rule=rule, slew=slew)
        return SimpleNamespace(passes=[], coverage=SimpleNamespace(thin=[]), full_at_t_s=START_S + 5400.0)

    monkeypatch.setattr(calibration, "plan_campaign", plan_campaign)
    return given


@pytest.mark.parametrize(("fewest", "most"), [("25", 30), ("40", 40)])
def test_a_full_campaign_ends_with_0_and_the_time(
    planned: dict[str, Any], capsys: pytest.CaptureFixture[str], fewest: str, most: int
) -> None:
    assert run("--start", START, "--fewest", fewest, "--settle", "45") == 0
    assert capsys.readouterr().out.splitlines() == [
        "0 of 1 candidates fill 36 of 36 sectors", "all filled at 2006-06-27T05:30:00.000Z, 1.50 h after the start",
    ]  # fmt: skip
    assert (planned["rule"].fewest, planned["rule"].most, planned["slew"].settle_s) == (int(fewest), most, 45.0)


# Advice


def test_advice_names_the_pass_and_the_sigma_after_it(one: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert run(*one, "--improve", "collimation", "--count", "1") == 0
    (line,) = capsys.readouterr().out.splitlines()
    found = re.fullmatch(r"2006-06-27T\S+  AT 0: sigma times (\S+); since the start: collimation (\S+)", line)
    assert found
    assert 0.0 < float(found[1]) == float(found[2]) < 0.5


@pytest.fixture
def model(tmp_path: Path) -> ModelVersion:
    return ModelVersion(
        name="m", station="Goldstone DSS-13", band="Ka", software="0", created_t_s=START_S, valid_from_t_s=START_S,
        valid_until_t_s=None, first_t_s=START_S - 3600.0, last_t_s=START_S, observations=100, rejected=0, passes=2,
        form="exact", condition=10.0, rms_cross_elevation_rad=1e-5, rms_elevation_rad=1e-5, mean_azimuth_rad=1.0,
        mean_elevation_rad=0.5,
        model=BiasModel.zero(), fitted=("collimation", "droop"), covariance=np.diag([4e-8, 1e-8]),
    )  # fmt: skip


@pytest.fixture
def sought(monkeypatch: pytest.MonkeyPatch, search: Search) -> dict[str, Any]:
    """Let every advice be one pass that halves all sigma; return what it was sought with."""
    given: dict[str, Any] = {}

    def next_best_passes(terms: Sequence[str], covariance: Any, _candidates: Any, **options: Any) -> list[Any]:
        given.update(options, terms=tuple(terms), sigma=np.sqrt(np.diag(covariance)))
        return [SimpleNamespace(name="AT 0", start_t_s=START_S, factor=0.25, sigma=0.5 * given["sigma"])]

    monkeypatch.setattr(calibration, "next_best_passes", next_best_passes)
    return given


def test_advice_starts_from_the_covariance_of_the_last_model(
    sought: dict[str, Any], model: ModelVersion, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write_model(tmp_path / "m.yaml", model)
    line = "--improve droop collimation --count 3 --settle 45 --orbit-prior 100 --model"
    assert run("--start", START, *line.split(), str(tmp_path / "m.yaml")) == 0
    assert capsys.readouterr().out == (
        "2006-06-27T04:00:00.000Z  AT 0: sigma times 0.250; since the start: droop 0.500, collimation 0.500\n"
    )
    assert (sought["terms"], sought["chosen"], sought["count"]) == (model.fitted, ["droop", "collimation"], 3)
    assert sought["sigma"] == pytest.approx([2e-4, 1e-4])
    assert sought["slew"] == Slew(settle_s=45.0)
    assert sought["pass_priors"] == PassPriors.of_orbit(100.0)


def test_of_a_station_without_a_model_no_term_is_known(sought: dict[str, Any]) -> None:
    assert run("--start", START, "--improve", "azimuth_velocity_lag", "collimation") == 0
    assert {"azimuth_velocity_lag", "collimation"} <= set(sought["terms"])
    assert sought["terms"][: len(calibration.TERM_NAMES)] == calibration.TERM_NAMES
    assert np.all(sought["sigma"] > 0.0)


def test_the_model_of_another_station_is_refused(
    sought: dict[str, Any], model: ModelVersion, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write_model(tmp_path / "m.yaml", dataclasses.replace(model, station="gs2"))
    assert run("--start", START, "--improve", "droop", "--model", str(tmp_path / "m.yaml")) == 2
    assert "is of station 'gs2', must be of 'Goldstone DSS-13'" in capsys.readouterr().err
