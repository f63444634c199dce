"""What outlives a process: written whole or not at all, refused when it cannot be read, and put back as it was."""

import math
from pathlib import Path

import pytest

from rf_pointing.core.whole_file import KeptState
from rf_pointing.ephemeris.source import SourceParams, TargetMemory
from rf_pointing.station.antenna.memory import AntennaMemory
from rf_pointing.station.antenna.simulated_antenna import AntennaParams, SimulatedAntenna

START_S = 1_151_384_000.0
DEG = math.pi / 180.0


def antenna(memory: AntennaMemory) -> SimulatedAntenna:
    made = SimulatedAntenna(memory.start(AntennaParams()))
    made.enable()
    memory.restore(made)
    return made


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
    name = str(tmp_path / "antenna.json")
    memory = AntennaMemory(name)
    subject = antenna(memory)
    assert subject.park() == ""
    t_s = run(subject, memory, 6.0, START_S)
    left = subject.reading(t_s).position_rad
    assert abs(left - [120.0 * DEG, 60.0 * DEG]).max() > 3.0 * DEG
    again = antenna(AntennaMemory(name))
    assert abs(again.reading(t_s).position_rad - left).max() < 0.6 * DEG
    assert again.mode == "holding"


def test_brakes_that_were_set_stay_set_until_resumed(tmp_path: Path) -> None:
    name = str(tmp_path / "antenna.json")
    memory = AntennaMemory(name)
    subject = antenna(memory)
    assert subject.disable() == ""
    t_s = run(subject, memory, 1.0, START_S)
    assert subject.mode == "disabled"
    again = antenna(AntennaMemory(name))
    assert again.mode == "disabled"
    assert "disabled" in again.status(t_s).transmit_inhibit
    assert again.resume() == ""
    assert again.mode == "holding"


def test_a_latched_fault_survives_two_restarts_and_is_reset_then(tmp_path: Path) -> None:
    name = str(tmp_path / "antenna.json")
    memory = AntennaMemory(name)
    subject = antenna(memory)
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


def test_a_target_comes_back_with_its_offsets_and_another_configuration_goes_before_it(tmp_path: Path) -> None:
    name, configured = str(tmp_path / "target.json"), SourceParams()
    told = configured.replace(satellite="6251", along_track_offset_s=0.25, hold=True)
    TargetMemory(name, configured).keep(told, 0.3, START_S)
    again = TargetMemory(name, configured)
    assert (again.source, again.peak_rad, again.hold_t_s) == (told, 0.3, START_S)
    other = configured.replace(satellite="28350")
    assert TargetMemory(name, other).source == other
    assert TargetMemory(name, other).hold_t_s is None
