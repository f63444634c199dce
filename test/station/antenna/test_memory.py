"""What is written of an antenna and when, what a file must hold, and what a restarted control unit takes from it."""

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rf_pointing.station.antenna.memory import AntennaMemory, state_files, state_folder
from rf_pointing.station.antenna.modes import AntennaMode
from rf_pointing.station.antenna.simulated_antenna import AntennaParams
from test.station.stepped_antenna import STANDING, START_S, Clock, antenna

KEPT = {"azimuth_rad": 0.3, "elevation_rad": 0.9, "mode": "", "fault": ""}


def kept(path: Path, **changes: Any) -> AntennaMemory:
    path.write_text(json.dumps({key: value for key, value in (KEPT | changes).items() if value is not ...}))
    return AntennaMemory(str(path))


def test_the_folder_of_the_state_is_that_of_user_and_domain(monkeypatch: pytest.MonkeyPatch) -> None:
    for base, domain, folder in (
        ("/var/x", "7", "/var/x/rf_pointing/domain7"), ("/var/x", "", "/var/x/rf_pointing/domain0"),
        ("", "3", "/home/me/.local/state/rf_pointing/domain3"),
    ):  # fmt: skip
        monkeypatch.setenv("HOME", "/home/me")
        monkeypatch.setenv("XDG_STATE_HOME", base)
        monkeypatch.setenv("ROS_DOMAIN_ID", domain)
        assert state_folder() == Path(folder)
    monkeypatch.delenv("XDG_STATE_HOME")
    monkeypatch.delenv("ROS_DOMAIN_ID")
    assert state_folder() == Path("/home/me/.local/state/rf_pointing/domain0")
    assert state_files(Path("/x"), "/north/") == {
        "state_file": "/x/north/antenna_servo.json",
        "wrap_file": "/x/north/azimuth_turn.json",
        "command_key_file": "/x/north/command.key",
    }


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"azimuth_rad": ..., "fault": ...}, "lacks azimuth_rad, fault"),
        ({"azimuth_rad": "0.3"}, "azimuth_rad='0.3' must be a number"),
        ({"elevation_rad": True}, "elevation_rad=True must be a number"),
        ({"elevation_rad": None}, "elevation_rad=None must be a number"),
        ({"mode": 1}, "mode=1 must be a text"),
        ({"fault": None}, "fault=None must be a text"),
        ({"mode": "tracking"}, "mode='tracking' must be one of parked, stowed, disabled"),
    ],
)
def test_a_file_of_another_program_is_refused(tmp_path: Path, changes: dict[str, Any], said: str) -> None:
    with pytest.raises(ValueError, match=said):
        kept(tmp_path / "s.json", **changes)


def test_an_antenna_starts_where_it_was_left(tmp_path: Path) -> None:
    params = AntennaParams()
    assert AntennaMemory("").start(params) is params
    assert AntennaMemory(str(tmp_path / "none.json")).start(params) is params
    found = kept(tmp_path / "s.json", elevation_rad=1).start(params)
    assert (found.antenna.start_azimuth_rad, found.antenna.start_elevation_rad) == (0.3, 1.0)
    assert found.replace(antenna=params.antenna) == params
    # Numbers that no float holds are no angles.
    for given in (10**400, -(10**400)):
        with pytest.raises(ValueError, match="start_azimuth_rad"):
            kept(tmp_path / "s.json", azimuth_rad=given).start(params)


@pytest.mark.parametrize(
    ("changes", "mode", "fault"),
    [
        ({}, "holding", ""),
        ({"mode": "parked"}, "parked", ""),
        ({"mode": "disabled"}, "disabled", ""),
        ({"fault": "brake"}, "fault", "brake (since before the restart)"),
        ({"fault": "brake (since before the restart)", "mode": "stowed"}, "fault", "brake (since before the restart)"),
    ],
)
def test_a_fault_and_a_rest_are_taken_once(tmp_path: Path, changes: dict[str, Any], mode: str, fault: str) -> None:
    memory, clock = kept(tmp_path / "s.json", **changes), Clock(antenna())
    clock.antenna.enable()
    memory.restore(clock.antenna)
    clock.run(0.1)
    assert (clock.antenna.mode, clock.antenna.status(clock.t_s).fault) == (mode, fault)
    assert clock.antenna.axes.hardware.powered is (mode in ("holding", "fault"))
    other = Clock(antenna())
    other.antenna.enable()
    memory.restore(other.antenna)
    assert (other.antenna.mode, other.antenna.status(other.t_s).fault) == ("holding", "")


class Standing:
    """An antenna that is where a test puts it."""

    def __init__(self) -> None:
        self.place, self.mode, self.fault = STANDING.copy(), AntennaMode.HOLDING, ""

    def reading(self, _t_s: float) -> "Standing":
        return self

    status = reading

    @property
    def position_rad(self) -> np.ndarray:
        return self.place


def test_the_file_is_written_after_half_a_degree_and_with_every_change_of_rest_or_fault(tmp_path: Path) -> None:
    path, subject = tmp_path / "s.json", Standing()
    memory = AntennaMemory(str(path))

    def written() -> dict[str, Any] | None:
        memory.keep(subject, START_S)  # type: ignore[arg-type]
        found = json.loads(path.read_text()) if path.is_file() else None
        path.unlink(missing_ok=True)
        return found

    assert written() == {"azimuth_rad": STANDING[0], "elevation_rad": STANDING[1], "mode": "", "fault": ""}
    for axis in (0, 1):
        for way_deg in (0.49, -0.49):
            subject.place = STANDING.copy()
            subject.place[axis] += math.radians(way_deg)
            assert written() is None, "0.49 deg from what is written"
        subject.place[axis] = STANDING[axis] - math.radians(0.51)
        assert written() is not None
        assert memory.problem == ""
        subject.place = STANDING.copy()
        assert written() is not None
    # A mode that is no rest is none that is kept.
    subject.mode = AntennaMode.TRACKING
    assert written() is None
    subject.mode = AntennaMode.STOWED
    assert written() == {"azimuth_rad": STANDING[0], "elevation_rad": STANDING[1], "mode": "stowed", "fault": ""}
    subject.fault = "brake"
    assert written() is not None
    assert written() is None
