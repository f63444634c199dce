"""The tables of three flights in which everything happens, number by number as recorded.

After an intended change let it record anew; the difference of `data/summaries.json` then shows what it moved:

    RECORD=1 scripts/test plain test/report/test_recorded_summary.py
"""

import json
import math
import os
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rf_pointing.report.analysis import analyse
from rf_pointing.report.bag_writer import TopicLoss
from rf_pointing.report.definitions import Definitions
from rf_pointing.report.recording import Pass, Recording, read_recording
from rf_pointing.report.statistics import summarize
from rf_pointing.report.summary import Complaint, to_json
from test.report.conftest import START_NS, SyntheticRun

FILE = Path(__file__).parent / "data" / "summaries.json"
MODES = [
    (2, "idle"), (5, "slew"), (9, "program_track"), (12, "search"), (24, "monopulse"),
    (26, "coast"), (33, "conscan"),
]  # fmt: skip
LATE_PASS = Pass("28057", START_NS + 30 * 10**9, START_NS + 40 * 10**9, START_NS + 90 * 10**9, 1.1)
SHORT_PASS = Pass("4711", START_NS + 3 * 10**9, START_NS + 4 * 10**9, START_NS + 6 * 10**9, 0.3)


def mode(t: float) -> str:
    return next((name for end, name in MODES if t < end - 1e-9), "idle")


def error_mdeg(t: float) -> tuple[float, float]:
    size = 60.0 if t < 9.0 else 25.0 * math.exp(-(t - 9.0)) + 2.0
    return (size * math.cos(3.0 * t), 0.6 * size * math.sin(4.0 * t) + 0.02 * t)


def flight(**changes: Any) -> SyntheticRun:
    plan: dict[str, Any] = {
        "seconds": 36.0, "speed": 7.0, "mode": mode, "error_mdeg": error_mdeg, "aos_los_s": (6.0, 32.0),
        "offset_mdeg": lambda t: (0.5 * t, -0.3 * t), "carrier_to_noise": lambda t: 55.0 - 0.2 * t + math.sin(t),
        "azel_deg": lambda t: (100.0 + 0.5 * t + 2.0 * math.sin(0.4 * t), 30.0 + 0.1 * t + math.cos(0.3 * t)),
        "sensed": lambda t: t > 9.65 and not 15.0 < t < 15.3,
        "dropped": {"target": {3, 9}, "joint_states": {100, 333, 334}, "pointing_error": {120}, "clock": {70}},
        "lateness_s": lambda t: 5e-4 + 1e-4 * math.sin(7.0 * t) + (0.003 if round(10 * t) == 77 else 0.0),
        "target": lambda t: "28057" if 4.0 < t < 33.0 else "",
        "counted": lambda t: (max(0.0, 0.9 * (t - 6.0)), max(0.0, 0.1 * (t - 6.0)), 0.02 * t),
        "fault": lambda t: "commands ran dry" if 34.0 < t < 35.0 else "",
        "predicted": {"lost": 1.5, "late": 0.7, "acquisition": 2.5, "mean_loss": 0.3},
    }  # fmt: skip
    return SyntheticRun(**{**plan, **changes})


def varied(recording: Recording) -> Recording:
    """Return the recording with columns that differ from row to row, two passes more, and what a recorder tells."""
    for data in recording.topics.values():
        data.log_time_ns[:] += np.arange(len(data)) * 7919 % 1009 * 1000
    status = recording.topics["tracking_status"].columns
    rows = np.arange(len(status["mode"]))
    status["beamwidth"] = status["beamwidth"] * (1.0 + 0.002 * rows)
    status["command_lead"] = 0.8 + 0.1 * np.sin(rows)
    if "antenna_status" in recording.topics:
        antenna = recording.topics["antenna_status"].columns
        rows = np.arange(len(antenna["mode"]))
        antenna["command_lead"] = 0.7 - 0.1 * np.cos(rows)
        antenna["at_limit"] = np.column_stack([rows % 50 == 7, rows % 30 < 2])
        antenna["rate_limit"] = np.column_stack([0.02 - 1e-5 * rows, 0.01 + 1e-5 * rows])
        antenna["acceleration_limit"] = antenna["rate_limit"] * [0.3, 0.7]
        antenna["commands_rejected"] = rows // 40
        antenna["last_rejection"] = np.array([f"stale by {row} ms" for row in rows])
        antenna["set_points"] = np.where(rows < 300, 3 * rows, rows - 300)
        antenna["starts"] = np.column_stack([rows // 3, rows // 5])
        antenna["reversals"] = np.column_stack([rows // 9, rows // 11])
    lost = (TopicLoss("/gs1/target", 4, 1_800_000_003 * 10**9), TopicLoss("/gs1/clock", 2, 1_800_000_004 * 10**9))
    complaints = (Complaint(component="gs1/servo", message="late", count=3),)
    passes = (SHORT_PASS, *recording.passes, LATE_PASS) if recording.passes else ()
    return replace(
        recording, passes=passes, not_recorded=lost, warnings=complaints, others=recording.others | {"/rosout": 17},
        problems=("a problem",),
    )  # fmt: skip


FLIGHTS: dict[str, dict[str, Any]] = {
    "whole": {},
    "sensed, cut short": {"truth": False, "left_out": {"antenna_status", "monopulse"}, "seconds": 30.0},
    "no sensor, no pass": {
        "sensed": lambda _: False, "left_out": {"passes", "joint_states", "pass_certificate"}, "seconds": 20.0,
        "counted": lambda _: (0.0, 0.0, 0.0), "carrier_to_noise": lambda t: math.nan if t < 3.0 else 50.0 - t,
    },
    "never tracked": {
        "mode": lambda t: "slew" if t > 1.0 else "idle", "seconds": 8.0, "target": lambda _: "",
        "carrier_to_noise": lambda _: math.nan,
    },
}  # fmt: skip


def summary(name: str, folder: Path, types: Definitions) -> Any:
    flight(**FLIGHTS[name]).write(folder / "bag", types, {"station": "DSS-13"})
    found = json.loads(to_json(summarize(analyse(varied(read_recording(folder / "bag"))))))
    del found["bag"]["path"]
    return found


def leaves(value: Any, place: str = "") -> dict[str, Any]:
    """Return every number and text of a table by its place."""
    if isinstance(value, dict | list):
        items = value.items() if isinstance(value, dict) else enumerate(value)
        return {name: leaf for key, item in items for name, leaf in leaves(item, f"{place}/{key}").items()}
    return {place: value}


@pytest.mark.parametrize("name", FLIGHTS)
def test_a_table_is_the_recorded_one(name: str, tmp_path: Path, types: Definitions) -> None:
    table, recorded = summary(name, tmp_path, types), json.loads(FILE.read_text(encoding="utf-8"))
    if os.environ.get("RECORD"):
        FILE.write_text(json.dumps(recorded | {name: table}, indent=1) + "\n", encoding="utf-8")
        return
    found, wanted = leaves(table), leaves(recorded[name])
    assert set(found) == set(wanted)
    for place, value in wanted.items():
        assert found[place] == (pytest.approx(value, rel=1e-6, abs=1e-9) if isinstance(value, float) else value), place
