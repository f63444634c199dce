"""The metrics of the page: the grammar of OpenMetrics 1.0, and the values that were shown."""

import json
import math
import re
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rf_pointing.web.metrics import Family, board_metrics, exposition, labelled, page_metrics

NAME = r"[a-zA-Z_][a-zA-Z0-9_]*"
VALUE = re.compile(rf'({NAME})="((?:[^"\\\n]|\\[\\"n])*)"(?:,|$)')
SAMPLE = re.compile(rf"({NAME})(?:\{{(.*)\}})? (-?(?:\d+\.?\d*(?:e[+-]?\d+)?))")
SUFFIX = {"gauge": "", "stateset": "", "counter": "_total", "info": "_info"}
LIVE = {
    "antenna": "tracking", "fault": "", "azimuth_deg": 100.5, "elevation_deg": 40.0, "encoder_deg": [100.25, 40.0],
    "rate_deg_s": [0.5, -0.25], "rate_limit_deg_s": [3.0, 2.0], "tracking": "nose", "target": "ISS",
    "error_beamwidths": [0.03, 0.04], "beamwidth_deg": 2.0, "carrier_to_noise_db_hz": 57.25, "seconds_tracked": 12.0,
    "seconds_lost": 3.0, "mean_loss_db": 0.125, "held": True, "sky_target": {"age_h": 1.5},
    "schedule_states": {"tracked": 2, "waiting": 1},
}  # fmt: skip
KEPT: dict[str, Any] = {
    "station": {"name": 'Mine "A"', "band": "X"},
    "executive": {"alarms": [{"name": "lost_node", "level": 2, "acknowledged": True}]},
}
NODES = [{"name": "antenna_servo", "silent_s": 0, "checks": [["state", 0, "active"], ["clock", 1, "late"]]}]
SOURCES = ("antenna", "tracking", "target", "executive")


def read(text: str) -> dict[tuple[str, frozenset[tuple[str, str]]], float]:
    """Return the samples of an exposition; every line must be as the ABNF of OpenMetrics 1.0 has it."""
    assert text.endswith("# EOF\n")
    found, seen, name, kind, unit = {}, set[str](), "", "", ""
    for line in text.removesuffix("# EOF\n").splitlines():
        if line.startswith("# "):
            _, word, described, rest = line.split(" ", 3)
            if word == "TYPE":
                # The lines of a family are together, and its type is the first of them.
                assert described not in seen
                name, kind, unit = described, rest, ""
                seen.add(name)
            assert word in ("TYPE", "UNIT", "HELP")
            assert described == name
            unit = rest if word == "UNIT" else unit
            assert not unit or name.endswith(f"_{unit}")
            continue
        match = SAMPLE.fullmatch(line)
        assert match, line
        assert match[1] == name + SUFFIX[kind]
        labels = VALUE.findall(match[2] or "")
        assert ",".join(f'{key}="{text}"' for key, text in labels) == (match[2] or "")
        if kind == "stateset":
            assert name in dict(labels)
        key = match[1].removeprefix("rf_pointing_"), frozenset(labels)
        assert key not in found
        found[key] = float(match[3])
    return found


def scraped(age_s: float = 0.5, **changes: Any) -> dict[Any, float]:
    families = board_metrics(LIVE | changes, dict.fromkeys(SOURCES, age_s), KEPT, NODES)
    return read(exposition([*families, *page_metrics(2, 5, 1)]))


def test_the_values_of_the_page_are_scraped() -> None:
    found = scraped()

    def value(name: str, /, **labels: str) -> float:
        return found[name, frozenset(labels.items())]

    assert value("axis_position_degrees", axis="azimuth") == 100.25
    assert value("axis_error_degrees", axis="azimuth") == 0.25
    assert value("axis_rate_degrees_per_second", axis="elevation") == -0.25
    assert value("pointing_error_degrees") == pytest.approx(0.1)
    assert (value("carrier_to_noise_db_hz"), value("elements_age_seconds")) == (57.25, 5400.0)
    assert (value("pass_tracked_seconds"), value("pass_lost_seconds"), value("pass_loss_db")) == (12.0, 3.0, 0.125)
    assert (value("fault_latched"), value("schedule_passes", state="tracked")) == (0.0, 2.0)
    assert value("alarm_lasts", alarm="lost_node", level="error") == 2.0
    assert (value("page_commands_total"), value("page_viewers")) == (5.0, 2.0)
    assert value("node_level", node="antenna_servo") == 1.0
    assert value("station_info", name=r"Mine \"A\"", band="X") == 1.0
    # Of a state set one is 1, and a tracker of another package is one more.
    modes = {
        dict(labels)["rf_pointing_pointing_mode"]: v for (name, labels), v in found.items() if name == "pointing_mode"
    }
    assert [mode for mode, v in modes.items() if v] == ["nose"]
    assert {"idle", "monopulse"} < modes.keys()


@pytest.mark.parametrize("level", [0, 1, 2])
def test_without_an_executive_the_alarms_are_those_that_station_alarms_shows(level: int) -> None:
    own = {"name": "station_alarms", "silent_s": 0, "checks": [["alarms", level, "lost_drive: no answer"]]}
    found = read(exposition(board_metrics(LIVE, {"antenna": 0.5}, KEPT, [*NODES, own])))
    assert found["alarms_lasting", frozenset()] == bool(level)
    labels = {"alarm": "station_alarms", "level": ("ok", "warning", "error")[level]}
    assert found.get(("alarm_lasts", frozenset(labels.items())), 0.0) == bool(level)


def test_what_is_old_or_unknown_is_a_gap() -> None:
    old = {name for name, _ in scraped(age_s=11.0)}
    assert "source_age_seconds" in old
    assert not old & {"axis_position_degrees", "pointing_mode", "elements_age_seconds", "alarms_lasting"}
    assert "carrier_to_noise_db_hz" not in {name for name, _ in scraped(carrier_to_noise_db_hz=0.0)}
    assert "pointing_error_degrees" not in {name for name, _ in scraped(error_beamwidths=[])}
    assert read(exposition([])) == {}


@given(text=st.text(), value=st.floats())
def test_any_text_is_a_label_and_any_number_a_sample_or_a_gap(text: str, value: float) -> None:
    written = exposition([Family("one", "", text, [({"of": text}, value)])])
    # A line ends at "\n" alone; `splitlines` would see more ends.
    lines = written.split("\n")
    assert lines[-2:] == ["# EOF", ""]
    if not math.isfinite(value):
        assert len(lines) == 2
        return
    label = re.fullmatch(r'rf_pointing_one\{of="((?:[^"\\\n]|\\[\\"n])*)"\} (\S+)', lines[2], re.DOTALL)
    assert label
    assert re.sub(r"\\(.)", lambda m: {"n": "\n"}.get(m[1], m[1]), label[1]) == text
    assert float(label[2]) == value


def test_the_dashboard_asks_for_metrics_that_there_are() -> None:
    dashboard = (Path(__file__).parents[2] / "config" / "viewers" / "grafana.json").read_text()
    queries = [t["expr"] for panel in json.loads(dashboard)["panels"] for t in panel.get("targets", ())]
    asked = {name.removeprefix("rf_pointing_") for query in queries for name in re.findall(r"rf_pointing_\w+", query)}
    assert asked
    assert asked <= {name for name, _ in scraped()}


def test_the_samples_of_several_antennas_are_those_of_each_with_its_label() -> None:
    of_each = {
        antenna: board_metrics(LIVE | {"target": target}, dict.fromkeys(SOURCES, 0.0), KEPT, NODES)
        for antenna, target in {"/gs1": "ISS", "/gs2": ""}.items()
    }
    expected = {
        (name, labels | {("antenna", antenna)}): value
        for antenna, families in of_each.items()
        for (name, labels), value in read(exposition(families)).items()
    }
    assert read(exposition(labelled(of_each))) == expected
