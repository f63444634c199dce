"""What a station publishes as plain values: every unit, every rounding."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from rf_pointing_msgs.msg import Alarm, AntennaStatus, ExecutiveStatus, Pass, ScheduledPass, Target, TrackingStatus

from rf_pointing.core.dates import utc_text
from rf_pointing.planning import HorizonMask
from rf_pointing.ros import convert_planning, station_view
from rf_pointing.ros.stamps import stamp_from_seconds
from rf_pointing.ros.station_view import (
    degrees,
    entry_values,
    executive_values,
    mask_values,
    moving_values,
    path_values,
    status_values,
    target_values,
    window_values,
)

NOW_S = 1.8e9
STAMP = stamp_from_seconds(NOW_S)
ALARMS = [Alarm(name="disk", level=1, message="full", raised=STAMP, acknowledged=True, count=3)]
EXECUTIVE = ExecutiveStatus(
    state="running", pass_id="p1", target="BIRD", next_id="p2", reason="waits", blocks=["slew"], alarms=ALARMS,
    next_start=STAMP,
)  # fmt: skip


def test_angles_are_rounded_to_a_tenth_of_a_millidegree() -> None:
    assert degrees([math.radians(12.34567), math.radians(-0.00004)]) == [12.3457, -0.0]
    assert degrees([math.radians(12.34567)], 2) == [12.35]


def test_the_status_of_a_station_is_in_degrees_and_utc() -> None:
    antenna = AntennaStatus(mode="tracking", fault="f", warning="w", commanded=np.radians([123.45678, 45.67891]))
    antenna.header.stamp = STAMP
    tracking = TrackingStatus(mode="coast", target="BIRD", on_source=True, carrier_to_noise=41.0, seconds_tracked=7.0)
    values = status_values(antenna, tracking, EXECUTIVE)
    assert values["utc"] == utc_text(NOW_S)
    assert (values["azimuth_deg"], values["elevation_deg"]) == (123.457, 45.679)
    assert (values["antenna"], values["tracking"], values["executive"]) == ("tracking", "coast", "running")
    assert (values["carrier_to_noise_db_hz"], values["seconds_tracked"], values["on_source"]) == (41.0, 7.0, True)
    assert values["alarms"] == [{"name": "disk", "level": 1, "message": "full", "acknowledged": True}]
    assert (values["pass"], values["next"], values["doing"], values["blocks"]) == ("p1", "p2", "waits", ["slew"])


def test_the_executive_is_shown_with_its_alarms() -> None:
    values = executive_values(EXECUTIVE)
    assert (values["state"], values["target"], values["next_s"]) == ("running", "BIRD", NOW_S)
    (alarm,) = values["alarms"]
    assert (alarm["raised_utc"], alarm["count"], alarm["acknowledged"]) == (utc_text(NOW_S), 3, True)


def test_passes_are_shown_with_their_times_and_peaks() -> None:
    times = {"aos": STAMP, "los": stamp_from_seconds(NOW_S + 300.0)}
    values = window_values(Pass(target="BIRD", peak_elevation=math.radians(56.789), **times))
    assert values == {
        "target": "BIRD",
        "aos_utc": utc_text(NOW_S),
        "los_utc": utc_text(NOW_S + 300.0),
        "peak_deg": 56.79,
    }
    entry = entry_values(ScheduledPass(id="p1", priority=2, peak_elevation=math.radians(56.789), state="lost", **times))
    assert (entry["id"], entry["priority"], entry["peak_deg"], entry["state"]) == ("p1", 2, 56.79, "lost")
    assert (entry["aos_utc"], entry["los_utc"]) == (utc_text(NOW_S), utc_text(NOW_S + 300.0))


def test_what_moves_is_in_degrees_and_its_error_in_beamwidths() -> None:
    antenna = AntennaStatus(
        rate_command=np.radians([1.23456, -0.5]), rate_limit=np.radians([6.0, 3.0]), at_limit=[1, 0], commander="/me"
    )
    antenna.header.stamp = STAMP
    tracking = TrackingStatus(
        azimuth=math.radians(100.0), elevation=math.radians(40.0), cross_elevation_error=0.001, elevation_error=-0.0005,
        beamwidth=0.004, axis_distance=math.radians(0.0123456), seconds_lost=3.26, mean_loss=0.126, los=STAMP,
    )  # fmt: skip
    values = moving_values(antenna, tracking)
    assert (values["rate_deg_s"], values["rate_limit_deg_s"], values["at_limit"]) == (
        [1.2346, -0.5], [6.0, 3.0], [True, False]
    )  # fmt: skip
    assert (values["beam_deg"], values["beamwidth_deg"]) == ([100.0, 40.0], 0.22918)
    assert values["error_beamwidths"] == [0.25, -0.125]
    assert (values["axis_distance_deg"], values["seconds_lost"], values["mean_loss_db"]) == (0.01235, 3.3, 0.13)
    assert (values["t_s"], values["los_s"]) == (NOW_S, NOW_S)
    tracking.beamwidth, tracking.cross_elevation_error, tracking.elevation_error = 3.0, 1.0, 0.0
    assert moving_values(antenna, tracking)["error_beamwidths"] == [0.3333, 0.0]
    tracking.beamwidth = 0.5
    assert moving_values(antenna, tracking)["error_beamwidths"] == [2.0, 0.0]
    tracking.beamwidth = 0.0
    assert moving_values(antenna, tracking)["error_beamwidths"] == []


def test_a_target_is_in_kilometres_and_hours() -> None:
    target = Target(
        target="BIRD", azimuth=math.radians(12.34567), elevation=math.radians(5.0), range=1234567.0, range_rate=-6543.21,
        element_age=9123.0,
    )  # fmt: skip
    values = target_values(target)
    assert values == {
        "name": "BIRD", "position_deg": [12.346, 5.0], "range_km": 1234.6, "range_rate_m_s": -6543.2, "age_h": None,
    }  # fmt: skip
    target.covariance = [1e-9] * 16
    assert target_values(target)["age_h"] == 2.5


@pytest.mark.parametrize(
    ("samples", "points", "second"), [(10, 11, 1), (90, 91, 1), (91, 47, 2), (180, 91, 2), (181, 62, 3)]
)
def test_a_path_has_some_90_points_and_its_end(samples: int, points: int, second: int) -> None:
    t_s = NOW_S + np.arange(float(samples))
    position = np.radians(np.column_stack([np.arange(samples) * 1.234, np.full(samples, 30.0)]))
    values = path_values(SimpleNamespace(name="BIRD", t_s=t_s, position_rad=position))
    assert (values["aos_s"], values["los_s"]) == (NOW_S, NOW_S + samples - 1.0)
    found = values["points_deg"]
    assert len(found) == points
    assert found[:2] == [[0.0, 30.0], [round(1.234 * second, 2), 30.0]]
    assert found[-1] == [pytest.approx(1.234 * (samples - 1), abs=0.006), 30.0]


def test_the_horizon_goes_around_the_whole_turn_in_steps_of_2_deg() -> None:
    mask = HorizonMask(azimuth_rad=(0.0, math.pi), elevation_rad=(math.radians(2.0), math.radians(8.0)))
    rows = mask_values(mask)
    assert [row[0] for row in rows] == [2.0 * k for k in range(181)]
    for azimuth, height in rows:
        assert height == pytest.approx(math.degrees(mask.lowest_all(np.array([math.radians(azimuth)]))[0]), abs=0.0051)
    assert rows[45][1] == round(rows[45][1], 2)


@pytest.mark.parametrize("chosen", [0, 1, None])
def test_a_certificate_shows_its_chosen_branch_alone(monkeypatch: pytest.MonkeyPatch, chosen: int | None) -> None:
    branches = [{"label": f"b{index}", "chosen": index == chosen} for index in range(2)]
    one = SimpleNamespace(chosen=None if chosen is None else SimpleNamespace(label=f"b{chosen}"))
    monkeypatch.setattr(convert_planning, "certificate_from_message", lambda _: one)
    monkeypatch.setattr(station_view, "certificate_values", lambda _: {"name": "BIRD", "branches": list(branches)})
    values = station_view.certificate_section(SimpleNamespace())
    assert values == {
        "name": "BIRD", "label": "" if chosen is None else f"b{chosen}",
        "chosen": None if chosen is None else branches[chosen],
    }  # fmt: skip
