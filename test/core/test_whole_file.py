"""What outlives a process: written whole or not at all, refused when it cannot be read, and put back as it was."""

import dataclasses
import json
import math
import os
import re
import time
from pathlib import Path

import pytest
import yaml

from rf_pointing.core.whole_file import KeptState, parse_json, parse_yaml, read_whole
from rf_pointing.ephemeris.source import SourceParams, TargetMemory
from rf_pointing.planning import WrapCount
from rf_pointing.station.antenna.memory import AntennaMemory
from rf_pointing.station.antenna.simulated_antenna import AntennaParams, SimulatedAntenna

START_S = 1_151_384_000.0
DEG = math.pi / 180.0


def antenna(memory: AntennaMemory) -> SimulatedAntenna:
    made = SimulatedAntenna(memory.start(AntennaParams()))
    made.enable()
    memory.restore(made)
    return made


def begun(folder: Path) -> tuple[str, AntennaMemory, SimulatedAntenna]:
    memory = AntennaMemory(name := str(folder / "antenna.json"))
    return name, memory, antenna(memory)


def run(subject: SimulatedAntenna, memory: AntennaMemory, seconds: float, start_s: float) -> float:
    ticks = round(seconds / subject.params.tick_s)
    for tick in range(ticks):
        subject.step(round(start_s + tick * subject.params.tick_s, 6))
        memory.keep(subject, start_s)
    return round(start_s + ticks * subject.params.tick_s, 6)


def test_values_come_back_and_only_a_whole_file_ever_stands_there(tmp_path: Path) -> None:
    path = tmp_path / "below" / "state.json"
    assert KeptState(str(path)).recover() == {}
    KeptState(str(path)).keep({"a": 1.5, "b": "x"})
    assert KeptState(str(path)).recover() == {"a": 1.5, "b": "x"}
    assert [found.name for found in path.parent.iterdir()] == ["state.json"]


@pytest.mark.parametrize(("text", "words"), [("{", "cannot be read"), ("[1]", "holds list, must hold an object")])
def test_a_file_that_cannot_be_read_is_refused_by_its_name(tmp_path: Path, text: str, words: str) -> None:
    path = tmp_path / "state.json"
    path.write_text(text)
    with pytest.raises(ValueError, match=words) as refusal:
        KeptState(str(path)).recover()
    assert str(path) in str(refusal.value)


def test_a_file_that_can_never_be_written_is_refused_at_the_start(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(ValueError, match=r"^state file .*/file/state\.json cannot be written: "):
        KeptState(str(tmp_path / "file" / "state.json"))


def test_a_file_that_cannot_be_written_any_more_is_told_and_tried_again(tmp_path: Path) -> None:
    """A folder that becomes a file stands for a full disk, which root can write to no more than others."""
    folder = tmp_path / "kept"
    memory = AntennaMemory(str(folder / "antenna.json"))
    subject = antenna(memory)
    t_s = run(subject, memory, 0.1, START_S)
    assert memory.problem == ""
    folder.rename(tmp_path / "aside")
    folder.write_text("")
    subject.stop("stop was requested")
    t_s = run(subject, memory, 0.1, t_s)
    assert "antenna.json cannot be written: " in memory.problem
    folder.unlink()
    run(subject, memory, 0.1, t_s)
    assert memory.problem == ""
    assert "stop was requested" in antenna(AntennaMemory(str(folder / "antenna.json"))).status(t_s).fault


def test_no_name_keeps_nothing(tmp_path: Path) -> None:
    KeptState("").keep({"a": 1})
    assert KeptState("").recover() == {}


def test_an_antenna_killed_while_it_moves_stands_where_it_was_within_the_half_degree_of_writing(tmp_path: Path) -> None:
    name, memory, subject = begun(tmp_path)
    assert subject.park() == ""
    t_s = run(subject, memory, 6.0, START_S)
    left = subject.reading(t_s).position_rad
    assert abs(left - [120.0 * DEG, 60.0 * DEG]).max() > 3.0 * DEG
    again = antenna(AntennaMemory(name))
    assert abs(again.reading(t_s).position_rad - left).max() < 0.6 * DEG
    assert again.mode == "holding"


def test_brakes_that_were_set_stay_set_until_resumed(tmp_path: Path) -> None:
    name, memory, subject = begun(tmp_path)
    assert subject.disable() == ""
    t_s = run(subject, memory, 1.0, START_S)
    assert subject.mode == "disabled"
    again = antenna(AntennaMemory(name))
    assert again.mode == "disabled"
    assert "disabled" in again.status(t_s).transmit_inhibit
    assert again.resume() == ""
    assert again.mode == "holding"


def test_a_latched_fault_survives_two_restarts_and_is_reset_then(tmp_path: Path) -> None:
    name, memory, subject = begun(tmp_path)
    subject.stop("stop was requested")
    run(subject, memory, 0.1, START_S)
    for _ in range(2):
        memory = AntennaMemory(name)
        subject = antenna(memory)
        t_s = run(subject, memory, 0.1, START_S)
        assert subject.status(t_s).fault == "stop was requested (since before the restart)"
        assert subject.mode == "fault"
    assert subject.reset_fault() == ""
    run(subject, memory, 0.1, t_s)
    assert antenna(AntennaMemory(name)).mode == "holding"


def test_a_state_that_lacks_a_value_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "antenna.json"
    path.write_text('{"azimuth_rad": 1.0, "fault": ""}')
    with pytest.raises(ValueError, match="lacks elevation_rad, mode"):
        AntennaMemory(str(path))


DEEP = 100_000
BOMB = "a: &a [x, x]\n" + "".join(f"{chr(b)}: &{chr(b)} [*{chr(b - 1)}, *{chr(b - 1)}]\n" for b in range(98, 123))


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[" * DEEP + "]" * DEEP, "nested more than 50 deep"),
        ("[" * 60 + "]" * 60, "nested more than 50 deep"),
        ('{"name": "\\ud800"}', "'\\ud800' holds half a character"),
        ("{", "Expecting property name"),
        ("9" * 5000, "integer string conversion"),
    ],
)
def test_json_that_would_raise_elsewhere_is_refused(text: str, words: str) -> None:
    with pytest.raises(ValueError, match=re.escape(words)):
        parse_json(text)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (BOMB, "line 2: alias *a must be written out"),
        ("[" * DEEP, "line 1: nested more than 50 deep"),
        ("- " * 60 + "x", "nested more than 50 deep"),
        ('name: "\\ud800"', "line 1: "),
        ("a: [", "line 2: not YAML: "),
        ("a: !!python/object/apply:os.system [ls]", "line 1: tag tag:yaml.org,2002:python/object"),
        ("a: 2026-99-99", "month must be in 1..12"),
    ],
)
def test_yaml_that_would_raise_or_hang_is_refused(text: str, words: str) -> None:
    begun = time.process_time()
    with pytest.raises(ValueError, match=re.escape(words)):
        parse_yaml(text)
    assert time.process_time() - begun < 2.0


def test_what_is_within_the_bounds_is_read_as_before(tmp_path: Path) -> None:
    text = "a: {b: [1, 2.5, -3e-4, yes, null, 2006-06-27]}\r\nc: \N{SNOWMAN}\r"
    (tmp_path / "file").write_bytes(text.encode())
    assert parse_yaml(read_whole(tmp_path / "file")) == yaml.safe_load(text)
    assert parse_json('{"a": [1, [2.5, "\\u2603"]]}') == {"a": [1, [2.5, "\N{SNOWMAN}"]]}


@pytest.mark.parametrize("name", ["/dev/zero", "pipe", "folder", "long"])
def test_what_is_too_long_or_not_a_regular_file_is_refused_soon(tmp_path: Path, name: str) -> None:
    """A pipe that is opened as a file waits for its other end, and a test that fails hangs."""
    path = tmp_path / name
    if name == "long":
        with path.open("wb") as file:
            file.truncate(3 * 2**30)
    elif name != "/dev/zero":
        (os.mkfifo if name == "pipe" else os.mkdir)(path)
    begun = time.process_time()
    words = "is longer than 1 MiB" if name == "long" else "must be a regular file"
    with pytest.raises(ValueError, match=f"{re.escape(str(path))} {words}"):
        read_whole(path)
    assert time.process_time() - begun < 1.0


@pytest.mark.parametrize(
    ("key", "value", "words"),
    [
        ("azimuth_rad", "12", "azimuth_rad='12' must be a number"),
        ("azimuth_rad", True, "azimuth_rad=True must be a number"),
        ("elevation_rad", None, "elevation_rad=None must be a number"),
        ("fault", 3, "fault=3 must be a text"),
        ("mode", ["parked"], "mode=['parked'] must be a text"),
        ("mode", "flying", "mode='flying' must be one of parked, stowed, disabled"),
    ],
)
def test_a_state_of_the_antenna_of_a_wrong_type_is_refused(tmp_path: Path, key: str, value: object, words: str) -> None:
    state = {"azimuth_rad": 1.0, "elevation_rad": 1.0, "mode": "", "fault": ""} | {key: value}
    (tmp_path / "state.json").write_text(json.dumps(state))
    with pytest.raises(ValueError, match=re.escape(words)):
        AntennaMemory(str(tmp_path / "state.json"))


@pytest.mark.parametrize("number", [math.nan, math.inf, 10**400])
def test_a_state_of_the_antenna_with_an_impossible_angle_is_refused(tmp_path: Path, number: float) -> None:
    state = {"azimuth_rad": number, "elevation_rad": 1.0, "mode": "", "fault": ""}
    (tmp_path / "state.json").write_text(json.dumps(state))
    with pytest.raises(ValueError, match="azimuth_rad"):
        AntennaMemory(str(tmp_path / "state.json")).start(AntennaParams())


@pytest.mark.parametrize(
    "kept",
    [
        {"source": 3}, {"source": ["a"]}, {"source": {"weather": 4}}, {"source": {"nothing": 4}},
        {"source": {"satellite": 4}}, {"peak_rad": "high"}, {"peak_rad": [1]}, {"hold_t_s": {}}, {"hold_t_s": 10**400},
    ],
)  # fmt: skip
def test_a_state_of_the_target_of_a_wrong_type_is_refused(tmp_path: Path, kept: dict[str, object]) -> None:
    path, configured = tmp_path / "state.json", SourceParams()
    path.write_text(json.dumps({"configured": dataclasses.asdict(configured)} | kept))
    with pytest.raises(ValueError, match="state file .*state.json cannot be used: "):
        TargetMemory(str(path), configured)


@pytest.mark.parametrize("text", ["[" * DEEP, '{"azimuth_rad": 1e308}', '{"azimuth_rad": [1]}', "[1]", "3", "\0", ""])
def test_a_wrap_file_that_is_none_is_a_doubt_and_no_traceback(tmp_path: Path, text: str) -> None:
    (tmp_path / "wrap.json").write_text(text)
    azimuth, doubt = WrapCount(tmp_path / "wrap.json").recover(1.0)
    assert azimuth == 1.0
    assert "look at the cables, then reset" in doubt
