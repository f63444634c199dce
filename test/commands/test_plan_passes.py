"""The command `plan_passes`: words, JSON, a picture, and refusals with the number."""

import json
from pathlib import Path

import pytest

from rf_pointing.commands import plan_passes

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
    wide.write_text(
        "/**/pointing_controller:\n  ros__parameters:\n    limits: {elevation_max_deg: 176.0}\n"
        "    machine: {half_power_beamwidth_deg: 0.264}\n"
    )
    picture = tmp_path / "plan.png"
    plan_passes.main([*OVER, "--json", "--params-file", str(wide), "--picture", str(picture)])
    plans = json.loads(capsys.readouterr().out)
    branches = max(plans, key=lambda plan: plan["pass"]["peak_elevation_deg"])["branches"]
    taken = next(branch for branch in branches if branch["chosen"])
    direct = next(branch for branch in branches if branch["works"] and not branch["over"])
    assert taken["over"]
    assert taken["lost_signal_s"] < 0.02 * direct["lost_signal_s"]
    assert taken["elevation_range_deg"][1] == pytest.approx(175.0, abs=0.1)
    assert picture.stat().st_size > 20_000


MANY = ["--start", "2006-06-28T06:00:00", "--hours", "12.5"]


def test_many_satellites_are_listed_in_order_of_rise_like_the_plan_of_one(capsys: pytest.CaptureFixture[str]) -> None:
    plan_passes.main([*MANY, "--satellites", "28057", "DELTA 1 DEB", "--json"])
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


def test_all_satellites_make_a_table_and_those_too_old_are_named(capsys: pytest.CaptureFixture[str]) -> None:
    plan_passes.main([*MANY, "--all"])
    text = capsys.readouterr()
    lines = text.out.splitlines()
    assert lines[0].split()[:3] == ["satellite", "AOS", "(UTC)"]
    assert any(line.startswith("CBERS 2") for line in lines[1:])
    assert "was not searched" in text.err
    assert "days from its epoch, must be <= 14.00 days" in text.err


def test_without_a_start_many_satellites_are_searched_from_their_newest_epoch(
    capsys: pytest.CaptureFixture[str],
) -> None:
    plan_passes.main(["--satellites", "28057", "--json"])
    assert json.loads(capsys.readouterr().out)["passes"][0]["aos_utc"].startswith("2006-06-2")


@pytest.mark.parametrize(
    ("options", "complaint"),
    [
        (["--all", "--picture", "plan.png"], "--picture needs the certificate of one satellite: give --satellite"),
        (["--all", "--params-file", "a.yaml"], "--params-file needs the certificate of one satellite"),
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
