"""A night of the station in one process: what is tracked, what goes wrong, and what the report says of it."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest

from rf_pointing.report.night_report import night_of, page
from rf_pointing.simulation import StationSetup
from test.scripts import script_module
from test.simulation.night_plan import small_night


@pytest.fixture(scope="module")
def simulation() -> Any:
    return script_module("benchmarks/night_simulation.py")


def flown(simulation: Any, folder: Path, *faults: Any, bands: Sequence[str] = ("", ""), **changes: Any) -> Any:
    station, elements, passes = small_night(folder, bands, **changes)
    night = simulation.NightSimulation(
        StationSetup(station), elements, passes, passes[0].aos_t_s - 120.0, faults=faults
    )
    night.run(passes[-1].los_t_s + 600.0)
    return night


def test_a_night_without_an_operator_tracks_each_satellite_in_its_band_with_one_feed_off_the_axis_and_stows(
    simulation: Any, tmp_path: Path
) -> None:
    # 1.1 deg, nearly half a beam: 2.5 dB if nothing turned the dish.
    off_axis = {"bands.S.feed_offset.cross_elevation_deg": 0.9, "bands.S.feed_offset.elevation_deg": -0.6}
    night = flown(simulation, tmp_path, bands=("S", "X", "S"), **off_axis)
    records = night.night.records
    assert [(record.band, record.state) for record in records] == [("S", "tracked"), ("X", "tracked"), ("S", "tracked")]
    assert all(record.tracked_s > 0.7 * (record.los_t_s - record.aos_t_s) for record in records)
    assert (night.setup.band, night.log.outside, night.log.messages) == ("S", [], [])
    assert (night.antenna.mode, night.night.finished) == ("stowed", True)


# A servo that comes back is followed again by the pass in hand; the others end it.
@pytest.mark.parametrize(
    ("kinds", "attempts", "name"),
    [
        ("controller_killed", 2, "xy_7m3"),
        ("servo_killed", 1, "tilt_5m"),
        ("drive_lost", 2, "leo_3m7"),
        ("runaway", 2, "leo_3m7"),
        ("ephemeris_killed tracker_killed full_disk", 1, "polar_3m"),
    ],
)
def test_fault_in_a_pass_is_an_alarm_and_a_cause_and_the_next_pass_is_tracked_without_an_operator(
    simulation: Any, tmp_path: Path, kinds: str, attempts: int, name: str
) -> None:
    tilt = {"mount.train_deg": 30.0} if name == "tilt_5m" else {}
    station, _, passes = small_night(tmp_path, name=name, **tilt)
    # Early enough: a pass is tried again while half of it is left.
    faults = [simulation.NightFault(passes[0].aos_t_s + 10.0, kind, 8.0) for kind in kinds.split()]
    night = flown(simulation, tmp_path, *faults, name=name, **tilt)
    first, second = night.night.records
    assert second.state == "tracked"
    assert second.tracked_s > 0.7 * (second.los_t_s - second.aos_t_s)
    assert first.attempts == attempts
    assert not night.log.outside
    assert not night.night.book.lasting
    assert (night.antenna.mode, night.night.finished) == ("stowed", True)
    report = page(night_of(night.night.state(), station.name))
    for kind in kinds.split():
        assert any(simulation.CAUSES[kind] in cause for cause in first.causes), first
        assert simulation.CAUSES[kind] in report
