"""A plan of a network: one owner at a time in every form, what changed since, and stations that disagree."""

import itertools
import json
from pathlib import Path

import numpy as np
import pytest

import rf_pointing as rp
from rf_pointing.core import angular_distance_rad
from rf_pointing.core.dates import parse_utc
from rf_pointing.operations.pass_list import read_passes
from rf_pointing.station.description import read_station

CBERS = rp.elements("CBERS 2", priority=2)
START = "2006-06-27T04:00:00"
CLOUDY = {"LEO 3.7 m": 0.3}


def stations() -> list[rp.Station]:
    return [rp.Station("dss13"), rp.Station("leo_3m7", "S")]


def test_stations_of_every_mount_share_the_passes_and_slew_in_the_angles_of_their_axes() -> None:
    mixed = [rp.Station(name) for name in ("leo_3m7", "xy_7m3", "polar_3m", "tilt_5m")]
    plan = rp.plan_network(mixed, [CBERS, rp.elements("DELTA 1 DEB", contact_minutes=60.0)], start=START, hours=12.0)
    assert {row["station"] for row in plan.rows} == {one.name for one in mixed}
    for each in itertools.chain.from_iterable(one.day.passes for one in plan.plans.values()):
        if each.certificate and (chosen := each.certificate.chosen):
            first, last = each.certificate.mount.skies(np.array([chosen.start_rad, chosen.end_rad]))
            window = each.window
            assert angular_distance_rad(*first, window.aos_azimuth_rad, window.aos_elevation_rad) < 0.01
            assert angular_distance_rad(*last, window.los_azimuth_rad, window.los_elevation_rad) < 0.01


@pytest.fixture(scope="module")
def plan() -> rp.NetworkPlan:
    targets = [CBERS, rp.elements("DELTA 1 DEB", contact_minutes=60.0), rp.elements("Moon", band="X")]
    return rp.plan_network(stations(), targets, start=START, hours=12.0, cloudy=CLOUDY)


def changed(folder: Path, name: str, old: str, new: str) -> rp.Station:
    """Return the 3.7-m station with another line in its description."""
    read_station("leo_3m7").write(folder / name, {})
    text = (folder / name).read_text()
    assert old in text
    (folder / name).write_text(text.replace(old, new))
    return rp.Station(folder / name)


def test_a_target_has_one_owner_and_the_next_one_is_on_its_way(plan: rp.NetworkPlan) -> None:
    assert {row["station"] for row in plan.rows} == {"Goldstone DSS-13", "LEO 3.7 m"}
    assert {row["band"] for row in plan.rows if row["name"] == "Moon"} == {"X"}
    assert {row["band"] for row in plan.rows if row["name"] == "CBERS 2"} <= {"X", "S"}
    for one, other in itertools.combinations(plan.rows, 2):
        shared_s = min(parse_utc(each["los_utc"]) for each in (one, other)) - parse_utc(other["aos_utc"])
        assert one["name"] != other["name"] or shared_s < 0.01
    handed = [row for row in plan.rows if row["from_station"]]
    assert handed
    assert all(row["since_contact_s"] < 1.0 and row["from_station"] != row["station"] for row in handed)
    for name in plan.plans:
        mine = [row for row in plan.rows if row["station"] == name]
        for before, row in itertools.pairwise(mine):
            assert before["los_utc"] <= row["leave_utc"] <= row["aos_utc"]
    moon = plan.contacts[-1]
    # Clouds of one of two stations: the clear share is between those of one and of both.
    assert 0.7 * moon.seen_share - 0.01 <= moon.clear_share < moon.seen_share <= 1.0
    assert moon.contact_s <= moon.seen_share * 12.0 * 3600.0 + 120.0


def test_every_form_holds_the_same_contacts(plan: rp.NetworkPlan, tmp_path: Path) -> None:
    content = json.loads(plan.to_json())
    assert content["passes"] == plan.rows
    assert {one["name"] for one in content["network"]} == set(plan.plans)
    header, *lines = plan.to_csv().splitlines()
    assert (header.split(","), len(lines)) == (list(plan.rows[0]), len(plan.rows))
    calendar = plan.to_calendar(1.8e9)
    assert calendar.count("LOCATION:LEO 3.7 m") == sum(row["station"] == "LEO 3.7 m" for row in plan.rows)
    # An executive that reads them takes those of its antenna alone.
    for text in (plan.to_json(), plan.to_csv(), calendar):
        assert [one.antenna for one in read_passes(text)] == [row["station"] for row in plan.rows]
    text = str(plan)
    assert "DELTA 1 DEB" in text
    assert "min short" in text
    files = plan.draw(tmp_path / "net.png")
    assert [path.name for path in files] == ["net.png", "net_Goldstone_DSS-13.png", "net_LEO_3.7_m.png"]
    assert all(path.stat().st_size > 10_000 for path in files)


def test_a_plan_tells_what_differs_from_the_one_before(plan: rp.NetworkPlan, tmp_path: Path) -> None:
    earlier = tmp_path / "yesterday.json"
    earlier.write_text(plan.to_json())
    assert plan.changes(earlier) == []
    begin, end = f"{START[:11]}08:00:00", f"{START[:11]}12:00:00"
    later = rp.plan_network(
        stations(), [CBERS], start=START, hours=12.0, maintenance={"LEO 3.7 m": [(begin, end), (begin, end)]}
    )
    changes = later.changes(earlier)
    assert not any(parse_utc(row["los_utc"]) > parse_utc(begin) and parse_utc(row["aos_utc"]) < parse_utc(end)
                   for row in later.rows if row["station"] == "LEO 3.7 m")  # fmt: skip
    assert sum(line.startswith("dropped: ") and "Moon" in line for line in changes) == plan.contacts[-1].contacts
    assert any(line.startswith("dropped: LEO 3.7 m CBERS 2") for line in changes)
    alone = rp.plan_network([changed(tmp_path, "new.yaml", "diameter_m: 3.7", "diameter_m: 3.6")], [CBERS], start=START)
    assert alone.changes(earlier)[:2] == [
        "station Goldstone DSS-13 has left", "station LEO 3.7 m has another version of its description",
    ]  # fmt: skip


def test_plans_that_cannot_be_compared_are_refused(plan: rp.NetworkPlan, tmp_path: Path) -> None:
    path = tmp_path / "plan.json"
    content = json.loads(plan.to_json())
    day = {"start_utc": "2006-06-25T04:00:00Z", "end_utc": "2006-06-26T04:00:00Z"}
    path.write_text(json.dumps(content | day))
    with pytest.raises(ValueError, match="does not last when this one does, from 2006-06-27T04"):
        plan.changes(path)
    row = content["passes"][0]
    twice = row | {"station": "LEO 3.7 m" if row["station"] != "LEO 3.7 m" else "Goldstone DSS-13"}
    path.write_text(json.dumps(content | {"passes": [row, twice]}))
    with pytest.raises(ValueError, match=r"two owners of one pass, .*LEO 3.7 m|two owners of one pass"):
        plan.changes(path)
    for text in ("[]", '{"passes": []}', "{", '{"start_utc": 1, "end_utc": "x", "network": [], "passes": []}'):
        path.write_text(text)
        with pytest.raises(ValueError, match="plan.json"):
            plan.changes(path)


def test_stations_that_disagree_are_refused_by_name(tmp_path: Path) -> None:
    shipped = rp.Station("leo_3m7")
    moved = changed(tmp_path, "moved.yaml", "latitude_deg: 48", "latitude_deg: 49")
    with pytest.raises(ValueError, match=r"two have the name LEO 3.7 m, at .* deg north, .* and at"):
        rp.plan_network([shipped, moved], [CBERS], start=START)
    other = changed(tmp_path, "other.yaml", "diameter_m: 3.7", "diameter_m: 3.6")
    with pytest.raises(ValueError, match=r"LEO 3.7 m has two versions of its description: .*leo_3m7.yaml and .*other"):
        rp.plan_network([shipped, other], [CBERS], start=START)
    with pytest.raises(ValueError, match=r"LEO 3.7 m is named twice"):
        rp.plan_network([shipped, rp.Station("leo_3m7", "S")], [CBERS], start=START)
    for wrong, options in (
        ("stations: give at least one", {"stations": []}),
        ("band='L' of CBERS 2: no station has it", {"targets": [rp.elements("CBERS 2", band="L")]}),
        ("cloudy of 'dss13': the station must be one of LEO 3.7 m", {"cloudy": {"dss13": 0.1}}),
        ("cloudy=1.0 of LEO 3.7 m must be from 0 to below 1", {"cloudy": {"LEO 3.7 m": 1.0}}),
        ("maintenance of LEO 3.7 m: .* must be before", {"maintenance": {"LEO 3.7 m": [(START, START)]}}),
        ("targets: give at least one satellite", {"targets": []}),
    ):
        given = {"stations": [shipped], "targets": [CBERS], "start": START} | options
        with pytest.raises(ValueError, match=wrong):
            rp.plan_network(**given)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="is of a network: give stations"):
        shipped.plan([rp.elements("CBERS 2", contact_minutes=5.0)], start=START)
