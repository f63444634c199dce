"""The command `plan_passes`: words, JSON, a picture, and refusals with the number."""

import csv
import dataclasses
import json
import math
import re
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from rf_pointing.commands import plan_passes, plan_passes_many
from rf_pointing.core.dates import DAY_S, parse_utc
from rf_pointing.ephemeris import find_elements, tle_lines, verification_elements
from rf_pointing.station.description import read_station
from rf_pointing.station.pointing.multi_satellite_plan import DayPlan, Fate, Wish

OVER = ["--start", "2006-06-28T06:00:00", "--hours", "12.5"]


def test_json_tells_of_every_pass_when_where_and_on_which_branch(capsys: pytest.CaptureFixture[str]) -> None:
    plan_passes.main([*OVER, "--json"])
    plans = json.loads(capsys.readouterr().out)
    zenith = max(plans, key=lambda plan: plan["pass"]["peak_elevation_deg"])
    said = zenith["pass"]
    assert said["aos_utc"] < said["tca_utc"] < said["los_utc"]
    assert said["peak_elevation_deg"] == pytest.approx(89.9, abs=0.01)
    assert said["sun_angle_deg"] > 10.0
    assert said["azimuth_min_deg"] < said["azimuth_max_deg"]
    assert zenith["accepted"]
    assert [branch["chosen"] for branch in zenith["branches"]].count(True) == 1


def test_a_dish_that_may_go_over_the_top_loses_a_hundredth(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    wide = tmp_path / "wide.yaml"
    changes = {"mount.elevation.travel_deg": [4.0, 176.0], "mount.elevation.hard_stop_deg": [2.0, 178.0]}
    read_station("dss13").write(wide, changes | {"tuning.loops.preprocessor.travel_max_deg": [223.0, 177.0]})
    picture = tmp_path / "plan.png"
    plan_passes.main([*OVER, "--json", "--station", str(wide), "--band", "S", "--picture", str(picture)])
    plans = json.loads(capsys.readouterr().out)
    branches = max(plans, key=lambda plan: plan["pass"]["peak_elevation_deg"])["branches"]
    taken = next(branch for branch in branches if branch["chosen"])
    direct = next(branch for branch in branches if branch["works"] and not branch["over"])
    assert taken["over"]
    assert taken["lost_signal_s"] < 0.02 * direct["lost_signal_s"]
    assert taken["elevation_range_deg"][1] == pytest.approx(175.0, abs=0.1)
    assert picture.stat().st_size > 20_000


MANY = ["--start", "2006-06-28T06:00:00", "--hours", "12.5"]
TWO = ["--satellites", "28057", "DELTA 1 DEB"]


def test_many_satellites_are_listed_in_order_of_rise_like_the_plan_of_one(capsys: pytest.CaptureFixture[str]) -> None:
    plan_passes.main([*MANY, *TWO, "--json"])
    listed = json.loads(capsys.readouterr().out)
    rises = [row["aos_utc"] for row in listed["passes"]]
    assert rises == sorted(rises)
    assert {row["catalogue_number"] for row in listed["passes"]} >= {28057}
    plan_passes.main([*OVER, "--satellite", "28057", "--json"])
    planned = [plan["pass"] for plan in json.loads(capsys.readouterr().out)]
    mine = [row for row in listed["passes"] if row["catalogue_number"] == 28057]
    assert [row["aos_utc"][:22] for row in mine] == [row["aos_utc"][:22] for row in planned]
    assert [row["peak_elevation_deg"] for row in mine] == pytest.approx(
        [row["peak_elevation_deg"] for row in planned], abs=1e-3
    )
    assert listed["station"] == "Goldstone DSS-13"
    assert (listed["start_utc"], listed["end_utc"]) == ("2006-06-28T06:00:00.000Z", "2006-06-28T18:30:00.000Z")


def test_all_satellites_make_a_table_and_those_too_old_are_named(capsys: pytest.CaptureFixture[str]) -> None:
    plan_passes.main([*MANY, "--all"])
    text = capsys.readouterr()
    lines = text.out.splitlines()
    assert lines[0].split()[:4] == ["satellite", "prio", "AOS", "(UTC)"]
    assert any(line.startswith("CBERS 2") and "tracked: direct" in line for line in lines[1:])
    assert re.fullmatch(r"\d+ passes: \d+ tracked, \d+ yields, \d+ barred", lines[-1])
    assert len(lines) == 2 + int(lines[-1].split()[0])
    assert "was not searched" in text.err
    assert "days from its epoch, must be <= 14.00 days" in text.err


def test_without_a_start_old_elements_are_planned_from_their_newest_epoch(capsys: pytest.CaptureFixture[str]) -> None:
    plan_passes.main(["--satellites", "28057", "--json"])
    assert json.loads(capsys.readouterr().out)["passes"][0]["aos_utc"].startswith("2006-06-2")


def test_without_a_start_fresh_elements_are_planned_from_now(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    now_s = parse_utc("2006-06-30T12:00:00")
    monkeypatch.setattr(plan_passes_many.time, "time", lambda: now_s)
    plan_passes.main(["--satellites", "28057", "--json", "--hours", "12"])
    assert json.loads(capsys.readouterr().out)["start_utc"] == "2006-06-30T12:00:00.000Z"


def test_a_list_file_gives_priorities_that_decide_and_least_peaks(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    cbers = find_elements(verification_elements(), "28057")
    twin = dataclasses.replace(cbers, name="TWIN", catalogue_number=11111, epoch_t_s=cbers.epoch_t_s + 120.0)
    elements, listed = tmp_path / "two.tle", tmp_path / "list.txt"
    elements.write_text("\n".join(line for one in (cbers, twin) for line in (one.name, *tle_lines(one))))
    options = [*MANY, "--elements", str(elements), "--satellites", str(listed), "--min-peak", "5", "--json"]
    for favourite, other in (("CBERS 2", "11111"), ("TWIN", "28057")):
        listed.write_text(f"# the night\n{favourite}, priority=9, peak=10   # first\n\n{other}\n")
        plan_passes.main(options)
        rows = json.loads(capsys.readouterr().out)["passes"]
        tracked = [row for row in rows if row["fate"] == "tracked"]
        # Where the favourite has no pass of its own that can be tracked, the other one has the antenna.
        assert {row["fate"] for row in rows if row["name"] == favourite} <= {"tracked", "barred"}
        assert all(row["branch"] and row["sun_angle_deg"] > 1.0 for row in tracked)
        assert all(row["peak_elevation_deg"] >= 10.0 for row in rows if row["name"] == favourite)
        yields = [row["reason"] for row in rows if row["fate"] == "yields"]
        assert len(yields) > 0
        assert all(re.fullmatch(rf"overlaps {favourite} for \d+ s: priority 9 is above 0", reason) for reason in yields)


def test_a_table_in_csv_has_every_pass_and_the_names_of_the_json(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    plan_passes.main([*MANY, *TWO, "--json", "--csv", str(tmp_path / "plan.csv")])
    rows = json.loads(capsys.readouterr().out)["passes"]
    with (tmp_path / "plan.csv").open(newline="") as file:
        table = list(csv.DictReader(file))
    assert [row["aos_utc"] for row in table] == [row["aos_utc"] for row in rows]
    assert list(table[0]) == list(rows[0])
    assert [row["reason"] for row in table] == [row["reason"] for row in rows]


def test_the_calendar_is_read_back_by_another_program_and_keeps_rfc_5545(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    elements = tmp_path / "odd.tle"
    odd = "CBERS 2; \u00c4\u00d6\u00dc, a name that is far longer than seventy-five octets of a line"
    elements.write_text("\n".join((odd, *tle_lines(find_elements(verification_elements(), "28057")))))
    calendar = tmp_path / "plan.ics"
    plan_passes.main([*MANY, "--all", "--elements", str(elements), "--json", "--ics", str(calendar)])
    rows = [row for row in json.loads(capsys.readouterr().out)["passes"] if row["fate"] == "tracked"]
    raw = calendar.read_bytes()
    lines = raw.split(b"\r\n")
    assert lines[-1] == b""
    assert b"\n" not in b"".join(lines)
    assert max(map(len, lines)) <= 75
    assert (lines[0], lines[-2]) == (b"BEGIN:VCALENDAR", b"END:VCALENDAR")
    for wanted in (b"VERSION:2.0", b"PRODID:-//rf_pointing//plan_passes//EN"):
        assert lines.count(wanted) == 1
    # Unfolded and unescaped by hand: what any calendar does.
    whole = raw.decode().replace("\r\n ", "").split("\r\n")
    names = [
        line.removeprefix("SUMMARY:").replace("\\;", ";").replace("\\,", ",")
        for line in whole
        if line[:8] == "SUMMARY:"
    ]
    assert names == [f"{odd}, peak {row['peak_elevation_deg']:.0f} deg" for row in rows]
    begins = [line.removeprefix("DTSTART:") for line in whole if line.startswith("DTSTART:")]
    assert begins == [re.sub(r"[-:]|\.\d+", "", row["aos_utc"]) for row in rows]
    for name in ("UID", "DTSTAMP", "DTEND"):
        values = [line for line in whole if line.startswith(f"{name}:")]
        assert len(values) == len(rows) > 1
        assert name == "DTSTAMP" or len(set(values)) == len(values)


def test_the_picture_of_many_satellites_is_drawn(tmp_path: Path) -> None:
    picture = tmp_path / "many.png"
    plan_passes.main([*MANY, "--all", "--picture", str(picture)])
    assert picture.stat().st_size > 30_000


def test_a_plan_without_a_pass_is_written_in_every_form(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    files = {form: tmp_path / f"plan.{form}" for form in ("csv", "ics", "picture")}
    options = [word for form, path in files.items() for word in (f"--{form}", str(path))]
    plan_passes.main([*MANY, *TWO, "--hours", "1", "--min-peak", "89.9", *options])
    assert capsys.readouterr().out.splitlines() == ["no pass", "0 passes: 0 tracked, 0 yields, 0 barred"]
    assert files["csv"].read_text() == "name\n"
    assert "BEGIN:VEVENT" not in files["ics"].read_text()
    assert files["picture"].stat().st_size > 5_000


def test_stale_elements_are_told_with_their_error_in_beamwidths(capsys: pytest.CaptureFixture[str]) -> None:
    late = ["--start", "2006-07-01T06:00:00", "--hours", "12"]
    plan_passes.main([*late, "--satellites", "28057"])
    assert re.search(
        r"stale elements of 1 tracked satellites, older than 2 days; the worst, CBERS 2: [45]\.\d days, "
        r"expected error along the track \d+ mdeg, [\d.]+ beamwidths",
        capsys.readouterr().err,
    )
    plan_passes.main([*late, "--satellite", "28057"])
    assert re.search(r"elements of CBERS 2 are stale: [45]\.\d days .* beamwidths", capsys.readouterr().err)
    plan_passes.main([*OVER, "--satellite", "28057"])
    assert "stale" not in capsys.readouterr().err


def test_a_reader_that_has_seen_enough_is_no_error() -> None:
    code = "from rf_pointing.commands.plan_passes import main; main()"
    command = f"{sys.executable} -c '{code}' --all --start 2006-06-28T06:00:00 | head -n 1"
    done = subprocess.run(command, shell=True, capture_output=True, text=True, timeout=120, check=False)
    assert done.stdout.startswith("satellite")
    assert "Traceback" not in done.stderr
    assert "BrokenPipe" not in done.stderr


@pytest.mark.parametrize(
    ("lines", "complaints"),
    [
        (["28057, priority=1.5"], ["list.txt, line 1: priority=1.5 must be a whole number from -1000 to 1000"]),
        (["28057, priority=1001"], ["priority=1001 must be a whole number from -1000 to 1000"]),
        (["28057, priority=-1001"], ["priority=-1001 must be a whole number from -1000 to 1000"]),
        (["28057, peak=91"], ["peak=91 must be a number from 0 to 90 deg"]),
        (["28057, peak=90.5"], ["peak=90.5 must be a number from 0 to 90 deg"]),
        (["28057, peak=-1"], ["peak=-1 must be a number from 0 to 90 deg"]),
        (["28057, weight=3"], ["'weight=3' is unknown: after the satellite come priority=N and peak=DEG"]),
        (["28057", "CBERS 2"], ["list.txt, line 2: satellite='CBERS 2' is named twice"]),
        (
            ["Nemesis", "# ok", "31415"],
            ["line 1: satellite='Nemesis' is not among", "line 3: satellite='31415' is not among"],
        ),
        ([""], ["names no satellite"]),
    ],
)
def test_all_that_is_wrong_in_a_list_is_told_at_once(
    lines: list[str], complaints: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "list.txt").write_text("\n".join(lines))
    with pytest.raises(SystemExit) as stopped:
        plan_passes.main(["--satellites", str(tmp_path / "list.txt")])
    assert stopped.value.code == 2
    error = capsys.readouterr().err
    assert all(complaint in error for complaint in complaints), error


@pytest.mark.parametrize(("errors", "more"), [(10, ""), (11, "and 1 more"), (12, "and 2 more")])
def test_of_many_errors_the_first_ten_are_shown(
    errors: int, more: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "list.txt").write_text("\n".join(f"28057, weight={k}" for k in range(errors)))
    with pytest.raises(SystemExit):
        plan_passes.main(["--satellites", str(tmp_path / "list.txt")])
    lines = capsys.readouterr().err.splitlines()
    assert sum("is unknown" in line for line in lines) == 10
    assert [line for line in lines if "is unknown" not in line] == ([more] if more else [])


@pytest.mark.parametrize(
    ("options", "complaint"),
    [
        (["--all", "--oem", "x.oem"], "--oem is of one satellite"),
        (["--satellites", "28057", "--oem", "x.oem"], "--oem is of one satellite"),
        (["--gap", "3601"], "argument --gap: 3601 must be between 0 and 3600"),
        (["--hours", "745"], "argument --hours: 745 must be between 0.01 and 744"),
        (["--hours", "0.009"], "argument --hours: 0.009 must be between 0.01 and 744"),
        (["--min-peak", "91"], "argument --min-peak: 91 must be between 0 and 90"),
        (["--ics", "plan.ics"], "--ics is of a plan of many satellites: give --satellites or --all"),
        (["--csv", "plan.csv"], "--csv is of a plan of many satellites"),
        (["--all", "--params-file", "a.yaml"], "unrecognized arguments: --params-file a.yaml"),
        (["--all", "--band", "Q"], "band='Q' of Goldstone DSS-13 must be one of S, X, Ka"),
        (["--all", "--prefer", "peak"], "unrecognized arguments: --prefer peak"),
        (["--gap", "-1"], "argument --gap: -1 must be between 0 and 3600"),
        (["--all", "--satellites", "28057"], "not allowed with argument"),
        (["--satellites", "28057", "Nemesis"], "Nemesis"),
        (["--all", "--elements", "no.tle"], "elements='no.tle' does not exist"),
        (["--hours", "0"], "argument --hours: 0 must be between 0.01 and 744"),
        (["--mask", "95"], "argument --mask: 95 must be between 0 and 89"),
        (["--mask", "nan"], "argument --mask: nan must be between 0 and 89"),
        (["--hours", "a day"], "argument --hours: 'a day' must be a number"),
        (["--station", "Atlantis"], "Atlantis"),
        (["--satellite", "Nemesis"], "Nemesis"),
    ],
)
def test_what_cannot_be_planned_is_refused_by_name(
    options: list[str], complaint: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as stopped:
        plan_passes.main(options)
    assert stopped.value.code == 2
    assert complaint in capsys.readouterr().err


@pytest.mark.parametrize(
    ("line", "wanted"),
    [
        (
            "",
            {
                "satellite": "28057", "satellites": None, "all": False, "hours": 24.0, "min_peak": 0.0, "gap": 0.0,
                "model": "", "json": False, "csv": None, "ics": None, "oem": None, "picture": None, "mask": None,
            },
        ),
        ("--satellites a b --hours 0.01 --min-peak 0 --gap 0", {"satellites": ["a", "b"], "hours": 0.01}),
        (
            "--all --hours 744 --min-peak 90 --gap 3600 --model m.yaml --json",
            {"all": True, "hours": 744.0, "min_peak": 90.0, "gap": 3600.0, "model": "m.yaml", "json": True},
        ),
        ("--csv c --ics i --oem o --picture p", {"csv": "c", "ics": "i", "oem": "o", "picture": "p"}),
    ],
)  # fmt: skip
def test_the_command_line_means_what_it_says(line: str, wanted: dict[str, Any]) -> None:
    options = vars(plan_passes.arguments(line.split()))
    assert {name: options[name] for name in wanted} == wanted


def test_the_passes_of_a_satellite_are_shown_with_their_certificates(capsys: pytest.CaptureFixture[str]) -> None:
    plan_passes.main(["--start", "2006-06-28T16:00:00", "--hours", "3", "--min-peak", "80"])
    shown = capsys.readouterr()
    lines = shown.out.splitlines()
    assert lines[0] == (
        "CBERS 2: AOS 2006-06-28T18:16:30.364Z, TCA 2006-06-28T18:22:43.547Z, LOS 2006-06-28T18:28:54.179Z, 744 s"
    )
    assert lines[1].startswith("  peak 89.90 deg, azimuth 12.5 to 194.2 deg, ")
    assert lines[2].startswith("certificate of CBERS 2")
    assert shown.out.count("CBERS 2: AOS") == 1
    plan_passes.main(["--start", "2006-06-28T16:00:00", "--hours", "2.3", "--min-peak", "80"])
    shown = capsys.readouterr()
    # The next one rises later than that.
    assert (shown.out, shown.err) == ("no pass\n", "")


def test_the_warning_of_stale_elements_is_of_the_last_pass(capsys: pytest.CaptureFixture[str]) -> None:
    """Two days after their epoch, which only the last two of six passes are, the last by 2.45 days."""
    plan_passes.main(["--start", "2006-06-28T06:00:00", "--hours", "24", "--json"])
    shown = capsys.readouterr()
    assert "elements of CBERS 2 are stale: 2.4 days from their epoch, expected error along the track 320 m" in shown.err
    last_s = parse_utc(json.loads(shown.out)[-1]["pass"]["tca_utc"])
    assert (last_s - find_elements(verification_elements(), "28057").epoch_t_s) / DAY_S == pytest.approx(
        2.446, abs=1e-3
    )


@pytest.mark.parametrize(("designator", "wanted"), [("2003-049A", "2003-049A"), ("", "28057")])
def test_the_motion_of_a_satellite_is_written_over_the_hours_of_the_plan(
    designator: str,
    wanted: str,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """With its international designator, or its number where it has none."""
    cbers = dataclasses.replace(find_elements(verification_elements(), "28057"), international_designator=designator)
    elements, oem = tmp_path / "one.tle", tmp_path / "x.oem"
    elements.write_text("\n".join((cbers.name, *tle_lines(cbers))))
    plan_passes.main(
        ["--elements", str(elements), "--start", "2006-06-28T08:00:00", "--hours", "0.5", "--oem", str(oem)]
    )
    written = capsys.readouterr()
    assert (written.out, written.err) == ("no pass\n", f"plan_passes: {oem}\n")
    lines = oem.read_text().splitlines()
    for line in (
        f"OBJECT_ID = {wanted}", "START_TIME = 2006-06-28T08:00:00.000000", "STOP_TIME = 2006-06-28T08:30:00.000000",
    ):  # fmt: skip
        assert line in lines


# What is planned for many satellites


class Plan:
    """In the place of the planner: keeps what it is to plan, and finds no pass."""

    def __init__(self) -> None:
        self.wishes: list[Wish] = []
        self.times: tuple[float, float] = (0.0, 0.0)
        self.least_rad, self.options = 0.0, dict[str, float]()

    def __call__(
        self, wishes: Any, _site: Any, start_s: float, duration_s: float, _rules: Any, _encoder_rad: Any,
        least_rad: float, **options: float,
    ) -> DayPlan:  # fmt: skip
        self.wishes, self.times, self.least_rad, self.options = list(wishes), (start_s, duration_s), least_rad, options
        return DayPlan(start_t_s=start_s, duration_s=duration_s, passes=(), unsearched=())


@pytest.fixture
def plan(monkeypatch: pytest.MonkeyPatch) -> Plan:
    plan = Plan()
    monkeypatch.setattr(plan_passes_many, "plan_day", plan)
    return plan


def test_many_satellites_are_planned_as_the_options_say(plan: Plan, tmp_path: Path) -> None:
    file = tmp_path / "list.txt"
    file.write_text("28057, priority=-1000, peak=90\nDELTA 1 DEB, priority=1000\n")
    options = ["--hours", "12", "--gap", "60", "--mask", "7", "--min-peak", "20", "--start", "2006-06-28T06:00:00"]
    plan_passes.main([*options, "--satellites", str(file)])
    assert plan.times == (parse_utc("2006-06-28T06:00:00"), 12.0 * 3600.0)
    assert plan.least_rad == pytest.approx(math.radians(7.0))
    assert plan.options == {"gap_s": 60.0, "max_age_s": 14.0 * DAY_S}
    assert [(wish.elements.name, wish.priority) for wish in plan.wishes] == [("CBERS 2", -1000), ("DELTA 1 DEB", 1000)]
    assert [wish.min_peak_rad for wish in plan.wishes] == pytest.approx([math.radians(90.0), math.radians(20.0)])
    plan_passes.main([*options, "--all"])
    everything = {one.catalogue_number for one in verification_elements()}
    assert {wish.elements.catalogue_number for wish in plan.wishes} == everything
    assert {(wish.priority, wish.min_peak_rad) for wish in plan.wishes} == {(0, math.radians(20.0))}


@pytest.mark.parametrize(
    ("hours", "days", "now"),
    [(12, 13.4, True), (12, 13.6, False), (12, -13.4, True), (12, -13.6, False), (240, 3.9, True), (240, 4.1, False)],
)
def test_a_plan_begins_now_while_the_elements_last_to_its_end(
    plan: Plan, monkeypatch: pytest.MonkeyPatch, hours: int, days: float, now: bool
) -> None:
    """Elements last for 14 days; older ones are planned from their newest epoch."""
    epoch_s = max(find_elements(verification_elements(), name).epoch_t_s for name in TWO[1:])
    now_s = epoch_s + days * DAY_S
    monkeypatch.setattr(plan_passes_many.time, "time", lambda: now_s)
    plan_passes.main([*TWO, "--hours", str(hours)])
    assert plan.times[0] == (now_s if now else epoch_s)


def named(path: Path, *names: str) -> list[str]:
    """Write CBERS 2 by each of these names, with numbers from 1; return the option."""
    cbers = find_elements(verification_elements(), "28057")
    ones = [dataclasses.replace(cbers, name=name, catalogue_number=k) for k, name in enumerate(names, start=1)]
    path.write_text("\n".join(line for one in ones for line in (one.name, *tle_lines(one))))
    return ["--elements", str(path), "--start", "2006-06-28T06:00:00"]


@pytest.mark.parametrize(
    ("entry", "number", "priority"),
    [
        ("twin", 1, 0),
        ("2", 2, 0),
        ("A=B", 3, 0),
        ("A=B, priority=7", 3, 7),
        ("DEB,B, priority=7", 4, 7),
        ("DEB,B", 4, 0),
        ("FENGYUN #2", 5, 0),
        ("777", 6, 0),
    ],
)
def test_a_name_may_hold_what_a_list_uses(plan: Plan, tmp_path: Path, entry: str, number: int, priority: int) -> None:
    elements = named(tmp_path / "odd.tle", "Twin", "OTHER", "A=B", "DEB,B", "FENGYUN #2", "777")
    (tmp_path / "list.txt").write_text(f"{entry} # a comment\n")
    plan_passes.main([*elements, "--satellites", str(tmp_path / "list.txt")])
    ((wish,),) = [plan.wishes]
    assert (wish.elements.catalogue_number, wish.priority) == (number, priority)


def test_a_name_of_two_objects_is_refused(plan: Plan, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    elements = named(tmp_path / "two.tle", "TWIN", "TWIN")
    with pytest.raises(SystemExit):
        plan_passes.main([*elements, "--satellites", "TWIN"])
    assert "TWIN" in capsys.readouterr().err
    plan_passes.main([*elements, "--satellites", "2"])
    assert [wish.elements.catalogue_number for wish in plan.wishes] == [2]


def test_a_file_that_is_no_text_is_no_list(plan: Plan, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "list.txt").write_bytes(b"\xff\xfe\x00\x80")
    with pytest.raises(SystemExit) as ended:
        plan_passes.main(["--satellites", str(tmp_path / "list.txt")])
    assert ended.value.code == 2
    assert "is no list of satellites" in capsys.readouterr().err


def test_a_row_has_its_numbers_to_a_millionth(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    table = tmp_path / "plan.csv"
    plan_passes.main(["--start", "2006-06-28T06:00:00", "--hours", "1", "--satellites", "28057", "--csv", str(table)])
    shown = capsys.readouterr()
    assert shown.out.splitlines()[-1] == "1 passes: 1 tracked, 0 yields, 0 barred"
    assert shown.err == f"plan_passes: {table}\n"
    (row,) = csv.DictReader(table.read_text().splitlines())
    assert all(len(value.partition(".")[2]) <= 6 for value in row.values() if re.fullmatch(r"-?\d+\.\d+", value))
    assert len(row["tca_range_m"].partition(".")[2]) == 6
    age_s = parse_utc(row["tca_utc"]) - find_elements(verification_elements(), "28057").epoch_t_s
    assert float(row["element_age_h"]) == pytest.approx(age_s / 3600.0, abs=1e-5)
    # The beam of X band is 0.065 deg wide.
    assert float(row["along_track_sigma_beams"]) == pytest.approx(float(row["along_track_sigma_deg"]) / 0.065, rel=1e-4)
    assert (row["name"], row["priority"], row["branch"]) == ("CBERS 2", "0", "direct, -1 turns")


def day_pass(age_days: float, fate: Fate, along_rad: float, number: int = 1) -> Any:
    elements = SimpleNamespace(catalogue_number=number)
    return SimpleNamespace(
        age_s=age_days * DAY_S,
        fate=fate,
        along_rad=along_rad,
        window=SimpleNamespace(name=f"AT {number}", elements=elements),
    )


@pytest.mark.parametrize(
    ("passes", "text"),
    [
        ([(1.9, Fate.TRACKED, 1e-3, 1)], ""),
        ([(9.0, Fate.YIELDS, 1e-3, 1)], ""),
        (
            [
                (3.0, Fate.TRACKED, 1e-3, 1),
                (4.0, Fate.TRACKED, 2e-3, 2),
                (9.0, Fate.BARRED, 3e-3, 3),
                (1.0, Fate.TRACKED, 4e-3, 4),
            ],
            "stale elements of 2 tracked satellites, older than 2 days; the worst, AT 2: 4.0 days, expected error along "
            "the track 115 mdeg, 2 beamwidths",
        ),
    ],
)
def test_stale_elements_count_where_they_are_tracked(passes: list[tuple[float, Fate, float, int]], text: str) -> None:
    plan: Any = SimpleNamespace(passes=[day_pass(*each) for each in passes])
    assert plan_passes_many.stale_text(plan, 2.0 * DAY_S, 1e-3) == text
