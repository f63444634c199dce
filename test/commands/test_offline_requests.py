"""What the offline command lines mean: requests in the units of the package."""

import dataclasses
import itertools
import math
from pathlib import Path

import pytest

from rf_pointing.calibration import TERM_NAMES
from rf_pointing.commands import fit_bias_model, plan_calibration, plan_passes
from rf_pointing.core.dates import DAY_S, parse_utc
from rf_pointing.ephemeris import find_elements, tle_lines, verification_elements
from rf_pointing.operations.pass_list import read_passes

START = "2006-06-27T04:00:00"


def test_plan_passes_plans_a_day_of_cbers_2_unless_told_otherwise() -> None:
    usual = plan_passes.request_from([])
    assert (usual.target.satellite, usual.target.location, usual.targets) == ("28057", "", None)
    assert usual.span == {"start_t_s": None, "hours": 24.0, "mask_deg": None}
    assert (usual.min_peak_deg, usual.gap_s, usual.json) == (0.0, 0.0, False)
    assert [usual.csv, usual.ics, usual.oem, usual.picture] == [None] * 4
    line = f"--all --start {START} --hours 744 --min-peak 90 --gap 3600 --mask 12 --json --csv c --ics i --picture p"
    given = plan_passes.request_from(line.split())
    assert given.span == {"start_t_s": parse_utc(START), "hours": 744.0, "mask_deg": 12.0}
    assert (given.gap_s, given.json, given.csv, given.ics, given.picture) == (
        3600.0, True, Path("c"), Path("i"), Path("p"),
    )  # fmt: skip
    assert given.targets
    assert {target.min_peak_deg for target in given.targets} == {90.0}


def test_fit_bias_model_offers_all_terms_and_knows_nothing_unless_told_otherwise() -> None:
    usual = fit_bias_model.request_from(["p.csv"])
    assert (usual.files.paths, usual.output, usual.name) == ([Path("p.csv")], Path("bias_model.yaml"), "")
    assert usual.files.max_age_s == 14.0 * DAY_S
    assert usual.files.largest_error_rad is None
    assert (usual.fit.terms, usual.fit.form, usual.fit.refraction) == (TERM_NAMES, "rotation", "standard")
    unset = [usual.fit.time_error_s, usual.files.ionosphere, usual.fit.known, usual.fit.orbit_prior_m]
    assert [*unset, usual.report, usual.points, usual.tdm] == [None] * 7
    flags = [usual.fit.select, usual.fit.held_out, usual.fit.robust, usual.fit.sectors, usual.fit.require_full]
    assert not any([*flags, usual.files.allow_damage])
    line = "p.csv --weather 900 20 40 --ionosphere 50 2.25 --time-error 0.5 --largest-error 3 --max-age 2"
    given = fit_bias_model.request_from(line.split())
    air, seen = given.fit.refraction, given.files.ionosphere
    assert air is given.files.refraction
    assert (air.pressure_hpa, air.temperature_k, air.relative_humidity) == (900.0, 293.15, 0.4)
    assert (seen.electrons_per_m2, seen.frequency_hz) == (5e17, 2.25e9)
    assert (given.fit.time_error_s, given.files.time_error_s, given.files.max_age_s) == (0.5, 0.5, 2.0 * DAY_S)
    assert fit_bias_model.request_from(["p.csv", "--refraction-removed"]).fit.refraction is None


def test_plan_calibration_cuts_candidates_as_the_options_say() -> None:
    usual = plan_calibration.request_from(["--start", START])
    assert (usual.hours, usual.fewest, usual.count, usual.orbit_prior_m) == (24.0, 25, 5, 200.0)
    assert (usual.rules.arcs_s, usual.rules.spacing_s, usual.slew.settle_s) == ((), 10.0, 60.0)
    line = f"--start {START} --arc 20 40 --spacing 5 --settle 30 --sigma 3 --improve droop --count 2 --orbit-prior 0"
    given = plan_calibration.request_from(line.split())
    assert (given.rules.arcs_s, given.rules.spacing_s, given.slew.settle_s) == ((20.0, 40.0), 5.0, 30.0)
    assert math.degrees(given.rules.sigma_rad) == pytest.approx(3e-3)
    assert (given.improve, given.count, given.orbit_prior_m) == (["droop"], 2, 0.0)


def test_scans_and_passes_that_help_most_become_a_schedule_of_the_executive(tmp_path: Path) -> None:
    file = tmp_path / "night.csv"
    satellites = f"--elements {tmp_path / 'x.tle'}"
    line = f"--station leo_3m7 --start {START} --hours 8 --count 4 --schedule {file} --scan"
    cbers = find_elements(verification_elements(), "28057")
    (tmp_path / "x.tle").write_text("\n".join([cbers.name, *tle_lines(cbers)]))
    request = plan_calibration.request_from([*satellites.split(), *line.split(), "Moon", "Cassiopeia A"])
    assert {one.name for one in request.candidates()} == {"Moon", "Cassiopeia A", cbers.name}
    assert plan_calibration.advice(request, request.candidates()) == 0
    planned = read_passes(file.read_text())
    assert len(planned) == 4
    assert all(one.scan == ("" if one.target == cbers.name else "cross") for one in planned)
    for before, after in itertools.pairwise(planned):
        assert after.aos_t_s > before.los_t_s + request.slew.settle_s
    by_number = plan_calibration.request_from([*satellites.split(), *line.split(), "28057"])
    assert plan_calibration.advice(by_number, by_number.candidates()) == 0
    assert {(one.target, one.scan) for one in read_passes(file.read_text())} == {(cbers.name, "cross")}
    only = plan_calibration.request_from([*line.split(), "Moon"])
    assert {one.name for one in only.candidates()} == {"Moon"}


def test_candidates_have_elements_within_14_days_all_along(tmp_path: Path) -> None:
    """A campaign of a day takes those from 13 days before its start to 14 days after it."""
    cbers, lines = find_elements(verification_elements(), "28057"), []
    for k, day in enumerate((-13.1, -12.9, 0.0, 13.9, 14.1)):
        one = dataclasses.replace(cbers, catalogue_number=k + 1, epoch_t_s=parse_utc(START) + day * DAY_S)
        lines += [f"AT {k}", *tle_lines(one)]
    (tmp_path / "x.tle").write_text("\n".join(lines))
    request = plan_calibration.request_from(["--elements", str(tmp_path / "x.tle"), "--start", START])
    assert {one.name for one in request.candidates()} == {"AT 1", "AT 2", "AT 3"}


@pytest.mark.parametrize(("hours", "works"), [("0.009", False), ("671.9", True), ("672.1", False)])
def test_a_campaign_lasts_up_to_four_weeks(tmp_path: Path, hours: str, works: bool) -> None:
    cbers = find_elements(verification_elements(), "28057")
    middle = dataclasses.replace(cbers, epoch_t_s=parse_utc(START) + 1800.0 * float(hours))
    (tmp_path / "x.tle").write_text("\n".join(["MIDDLE", *tle_lines(middle)]))
    line = ["--elements", str(tmp_path / "x.tle"), "--start", START, "--hours", hours]
    request = plan_calibration.request_from(line)
    if works:
        assert request.candidates()
        return
    with pytest.raises(ValueError, match=f"hours={hours}"):
        request.candidates()


@pytest.mark.parametrize(
    ("line", "reader", "shown"),
    [
        ("plan_passes --start 2006-06-28T06:00:00 --hours 3 --satellites 28057", "head -n 1", "satellite"),
        ("check_station leo_3m7", "true", ""),
    ],
)
def test_a_reader_that_has_seen_enough_is_no_error(line: str, reader: str, shown: str) -> None:
    import subprocess
    import sys

    program, *arguments = line.split()
    code = f"from rf_pointing.commands.{program} import main; main()"
    command = f"{{ {sys.executable} -c '{code}' {' '.join(arguments)}; echo $? >&2; }} | {reader}"
    done = subprocess.run(command, shell=True, capture_output=True, text=True, timeout=120, check=False)
    assert done.stdout.startswith(shown)
    assert "Broken" not in done.stderr
    assert done.stderr.endswith("0\n")
