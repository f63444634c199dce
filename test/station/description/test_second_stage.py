"""The block of a second stage in a description: what it gives, and what is refused."""

import math
from pathlib import Path

import pytest

from rf_pointing.commands.check_station import report
from rf_pointing.station.description import StationError, read_station

BLOCK = {"travel_deg": 0.02, "rate_deg_s": 0.5, "bandwidth_hz": 5.0, "latency_s": 0.05}


def with_stage(folder: Path, **changes: object) -> Path:
    keys = {f"second_stage.{name}": value for name, value in BLOCK.items()} | changes
    read_station("dss13").write(folder / "station.yaml", keys)
    return folder / "station.yaml"


def test_its_keys_are_the_parameters_of_the_servo_and_its_line_is_in_the_report(tmp_path: Path) -> None:
    station = read_station(with_stage(tmp_path, **{"tuning.integrator.bandwidth_hz": 0.15}))
    stage = station.sets("antenna_servo", "Ka")["second_stage"]
    assert (stage.travel_rad, stage.rate_rad_s) == pytest.approx((math.radians(0.02), math.radians(0.5)))
    assert (stage.bandwidth_hz, stage.latency_s, stage.radio_bandwidth_hz) == (5.0, 0.05, 0.15)
    lines = list(report(station, "Ka", everything=False))
    row = next(line for line in lines[lines.index("\nsecond stage:") :] if line.strip().startswith("elevation"))
    alone, with_it, times, worst, peak = map(float, row.split()[1:])
    assert times == pytest.approx(alone / with_it, rel=0.02)
    assert (worst > 3.0, peak < 2.0) == (True, True)
    assert not read_station("dss13").sets("antenna_servo", "Ka")["second_stage"].present


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"second_stage.latency_s": 3.0}, "latency_s=3"),
        ({"second_stage.travel_deg": None}, "second_stage.travel_deg"),
        ({"drive.type": "simulated_rotator"}, "second_stage: drive.type='simulated_rotator' takes positions"),
        ({"tuning.second_stage.travel_deg": 0.1}, "given by second_stage.travel_deg: change it there"),
    ],
)
def test_what_cannot_be_is_named(tmp_path: Path, changes: dict[str, object], reason: str) -> None:
    with pytest.raises(StationError, match=reason):
        read_station(with_stage(tmp_path, **changes))


def test_a_stage_that_is_too_late_is_refused_by_the_report(tmp_path: Path) -> None:
    station = read_station(with_stage(tmp_path, **{"second_stage.latency_s": 0.3}))
    with pytest.raises(ValueError, match=r"second_stage.latency_s=0.3, bandwidth_hz=5: .* must be >= 1.25"):
        list(report(station, "Ka", everything=False))
