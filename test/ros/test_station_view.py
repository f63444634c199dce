"""What a station publishes as plain values: every unit, every rounding."""

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from rf_pointing_msgs import msg as ours

from rf_pointing.core.dates import utc_text
from rf_pointing.ros.stamps import stamp_from_seconds
from rf_pointing.ros.station_view import (
    certificate_values,
    executive_values,
    live_values,
    moving_values,
    passes_values,
    schedule_values,
    status_text,
    status_values,
    target_values,
)

NOW_S = 1.8e9
STAMP = stamp_from_seconds(NOW_S)
ALARMS = [ours.Alarm(name="disk", level=1, message="full", raised=STAMP, acknowledged=True, count=3)]
ALARM = {"name": "disk", "level": 1, "message": "full", "acknowledged": True}
EXECUTIVE = ours.ExecutiveStatus(
    state="running", pass_id="p1", target="BIRD", next_id="p2", reason="waits",
    blocks=[ours.ProcedureBlock(name="slew", state="anomaly", reason="late")], alarms=ALARMS,
    next_start=STAMP,
)  # fmt: skip
TIMES = {"aos": STAMP, "los": stamp_from_seconds(NOW_S + 300.0), "peak_elevation": math.radians(56.789)}
SHOWN_TIMES = {"aos_utc": utc_text(NOW_S), "los_utc": utc_text(NOW_S + 300.0), "peak_deg": 56.79}


def antenna(**values: Any) -> ours.AntennaStatus:
    message = ours.AntennaStatus(**values)
    message.header.stamp = STAMP
    return message


def test_the_status_of_a_station_is_in_degrees_and_utc() -> None:
    tracking = ours.TrackingStatus(
        mode="coast", target="BIRD", on_source=True, carrier_to_noise=41.0, seconds_tracked=7.0
    )
    commanded = np.radians([123.45678, 45.67891])
    permit = {"sun_permit": "alice", "sun_permit_band": "X", "sun_permit_until": STAMP}
    one = antenna(mode="tracking", fault="f", warning="w", commanded=commanded, **permit)
    found = status_values(one, tracking, EXECUTIVE)
    who = f"alice lets the X beam look into the Sun until {utc_text(NOW_S)}"
    assert found == {
        "utc": utc_text(NOW_S), "antenna": "tracking", "fault": "f", "warning": "w", "azimuth_deg": 123.457,
        "elevation_deg": 45.679, "tracking": "coast", "target": "BIRD", "on_source": True, "carrier_to_noise_db_hz": 41.0,
        "seconds_tracked": 7.0, "executive": "running", "pass": "p1", "next": "p2", "doing": "waits",
        "blocks": ["slew: anomaly, late"], "alarms": [ALARM], "pass_target": "BIRD", "sun_permitted": who,
    }  # fmt: skip
    assert f"  warning: w\n  sun permitted: {who}\n" in status_text(found)
    assert "executive running: BIRD slew: anomaly, late; waits" in status_text(found)


def test_executive_passes_and_schedule_are_shown_in_utc_and_degrees() -> None:
    assert executive_values(EXECUTIVE) == {
        "state": "running", "pass": "p1", "target": "BIRD", "blocks": ["slew: anomaly, late"], "doing": "waits", "next": "p2",
        "next_s": NOW_S, "alarms": [{**ALARM, "raised_utc": utc_text(NOW_S), "count": 3}],
    }  # fmt: skip
    # A long schedule is shown around the pass that comes next.
    long = [ours.ScheduledPass(id=f"p{n}", state="tracked" if n < 300 else "waiting") for n in range(500)]
    rows = schedule_values(ours.Schedule(passes=long))
    assert (len(rows), rows[0]["id"], rows[-1]["id"]) == (200, "p250", "p449")
    passes = ours.PassList(target="1", passes=[ours.Pass(target="BIRD", **TIMES)] * 201)
    assert passes_values(passes) == {"target": "1", "rows": [{"target": "BIRD", **SHOWN_TIMES}] * 200}
    entry = ours.ScheduledPass(id="p1", priority=2, state="lost", **TIMES)
    assert schedule_values(ours.Schedule(passes=[entry] * 201)) == [{
        "id": "p1", "target": "", "priority": 2, "state": "lost", "reason": "", "seconds_tracked": 0.0, "seconds_lost": 0.0,
        **SHOWN_TIMES,
    }] * 200  # fmt: skip


@pytest.mark.parametrize(("beamwidth", "error"), [(0.004, [0.25, -0.125]), (0.5, [0.002, -0.001]), (0.0, [])])
def test_what_moves_is_in_degrees_and_its_error_in_beamwidths(beamwidth: float, error: list[float]) -> None:
    axes = antenna(rate_command=np.radians([1.23456, -0.5]), rate_limit=np.radians([6.0, 3.0]), at_limit=[1, 0],
        transmit_inhibit="low", last_rejection="late")  # fmt: skip
    tracking = ours.TrackingStatus(
        azimuth=math.radians(100.0), elevation=math.radians(40.0), cross_elevation_error=0.001, elevation_error=-0.0005,
        beamwidth=beamwidth, axis_distance=math.radians(0.0123456), seconds_lost=3.26, mean_loss=0.126, los=STAMP,
    )  # fmt: skip
    wanted = {
        "rate_deg_s": [1.2346, -0.5], "rate_limit_deg_s": [6.0, 3.0], "at_limit": [True, False], "beam_deg": [100.0, 40.0],
        "beamwidth_deg": round(math.degrees(beamwidth), 5), "error_beamwidths": error, "axis_distance_deg": 0.01235,
        "seconds_lost": 3.3, "mean_loss_db": 0.13, "t_s": NOW_S, "los_s": NOW_S,
        "transmit_inhibit": "low", "last_rejection": "late", "held": False,
    }  # fmt: skip
    found = moving_values(axes, tracking)
    assert {name: found[name] for name in wanted} == wanted


def test_a_target_is_in_kilometres_and_hours() -> None:
    target = ours.Target(
        target="BIRD", azimuth=math.radians(12.34567), elevation=math.radians(5.0), range=1234567.0, range_rate=-6543.21,
        element_age=9123.0,
    )  # fmt: skip
    shown = {
        "name": "BIRD", "position_deg": [12.346, 5.0], "range_km": 1234.6,
        "range_rate_m_s": -6543.2, "age_h": None, "along_sigma_s": None,
    }  # fmt: skip
    assert target_values(target) == shown
    target.covariance = [1e-9] * 16
    assert target_values(target) == shown | {"age_h": 2.5, "along_sigma_s": 0.0}


def test_what_moves_is_shown_as_far_as_it_is_known() -> None:
    assert live_values({}) == {}
    joints = SimpleNamespace(position_rad=np.radians([10.0, 20.0]))
    found = live_values({"antenna": antenna(mode="tracking"), "joints": joints, "target": ours.Target(target="BIRD")})
    assert (found["antenna"], found["tracking"], found["executive"]) == ("tracking", "", "none")
    assert (found["encoder_deg"], found["sky_target"]["name"]) == ([10.0, 20.0], "BIRD")
    assert not {"blocks", "alarms"} & set(found)


@pytest.mark.parametrize("works", [True, False])
def test_a_certificate_shows_its_chosen_branch_alone(works: bool) -> None:
    branches = [ours.PassBranch(turns=turns, works=works, refusals=[] if works else ["slow"]) for turns in (0, 1)]
    message = ours.PassCertificate(
        target="BIRD", branches=branches, rate_limit=[0.1, 0.1], acceleration_limit=[0.1, 0.1], least_share=0.5
    )
    found = certificate_values(message)
    assert (found["name"], found["label"]) == ("BIRD", "direct, +0 turns" if works else "")
    assert (found["chosen"]["turns"] if works else found["chosen"]) == (0 if works else None)
    assert "branches" not in found
