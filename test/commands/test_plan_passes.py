"""The command `plan_passes`: words, JSON, a picture, and refusals with the number."""

import csv
import dataclasses
import json
import re
import subprocess
import sys
from pathlib import Path

import pytest

from rf_pointing.commands import plan_passes, plan_passes_many
from rf_pointing.core.dates import parse_utc
from rf_pointing.ephemeris import find_elements, tle_lines, verification_elements
from rf_pointing.station.description import read_station

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
        (["28057, peak=91"], ["peak=91 must be a number from 0 to 90 deg"]),
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


@pytest.mark.parametrize(
    ("options", "complaint"),
    [
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
