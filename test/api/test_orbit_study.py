"""The question of a network: which words it takes, and what its answer says."""

import json

import pytest

import rf_pointing as rp
from rf_pointing.commands.orbit_covariance import main

LINE = "--stations leo_3m7 Svalbard=78.2,15.4 --tracking angle_mdeg=3 range_m=10 --hours 6 --predict 6"


def test_a_second_station_and_ranges_make_an_orbit_better(tmp_path):
    target, dish = rp.elements("CBERS 2"), rp.Station("leo_3m7")
    alone = rp.orbit_covariance(target, [dish], {"angle_mdeg": 3.0}, hours=6.0, predict_hours=6.0)
    both = rp.orbit_covariance(
        target, [dish, ("Svalbard", 78.2, 15.4)], {"angle_mdeg": 3.0, "range_m": 10.0}, hours=6.0, predict_hours=6.0
    )
    assert both.known.sigma_m(both.known.formal)[-1] < 0.5 * alone.known.sigma_m(alone.known.formal)[-1]
    picture = tmp_path / "known.png"
    both.draw(picture)
    assert picture.read_bytes().startswith(b"\x89PNG")
    assert "noise alone" in str(both)


def test_the_command_prints_what_it_knows_as_json(capsys):
    main([*LINE.split(), "--json"])
    found = json.loads(capsys.readouterr().out)
    assert len(found["t_s"]) == len(found["along_m"]) == len(found["considered_m"]["field"])
    assert set(found["tracked"]) == {"LEO 3.7 m", "Svalbard"}
    assert all(0.0 <= look["hours_after"] <= 6.0 for look in found["looks"])


@pytest.mark.parametrize(
    ("line", "reason"),
    [
        ("--stations leo_3m7 --tracking angle=3", "tracking=angle must be of angle_mdeg"),
        ("--stations leo_3m7 --tracking range_m=ten", "must be a word and its number"),
        ("--stations Here=95,1 --tracking range_m=1", "latitude_rad"),
        ("--stations Here=1 --tracking range_m=1", "must be a description, or NAME=LATITUDE,LONGITUDE"),
        ("--stations A=1,1 A=2,2 --tracking range_m=1", "'A' is given twice"),
        ("--stations A=1,1 --tracking range_bias_m=1", "are all 0"),
        ("--stations A=1,1 --tracking range_m=nan", "range_sigma_m"),
    ],
)
def test_what_cannot_be_answered_is_refused(line, reason, capsys):
    with pytest.raises(SystemExit) as ended:
        main(line.split())
    assert ended.value.code == 2
    assert reason in capsys.readouterr().err
