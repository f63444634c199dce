"""The command line of `station`, and how its lines read."""

from pathlib import Path

import pytest
from rcl_interfaces.msg import ParameterType, ParameterValue
from rcl_interfaces.srv import GetParameters
from rf_pointing_msgs.msg import Alarm, AntennaStatus, ExecutiveStatus

from rf_pointing.commands import station


@pytest.mark.parametrize(
    "line",
    [
        "offset",
        "queue",
        "fly",
        "go 120",
        "go 120 high",
        "track",
        "night dance",
        "offset --along 100",
        "--namespace a b status",
    ],
)
def test_wrong_lines_end_with_2(line: str) -> None:
    with pytest.raises(SystemExit) as ended:
        station.arguments(line.split())
    assert ended.value.code == 2


def test_a_file_that_is_missing_ends_with_2(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        station.main(["queue", "/nowhere/night.csv"])
    assert ended.value.code == 2
    assert "no such file: /nowhere/night.csv" in capsys.readouterr().err


def test_the_key_is_that_of_the_antenna_where_this_user_has_it(tmp_path: Path) -> None:
    client, answer = station.StationClient.__new__(station.StationClient), GetParameters.Response()
    client._call = lambda *_: answer
    client.options = station.arguments(["park"])
    assert client._key() == "", "an antenna without the parameter"
    answer.values = [ParameterValue(type=ParameterType.PARAMETER_STRING, string_value=str(tmp_path / "command.key"))]
    assert client._key() == "", "a key of another computer"
    (tmp_path / "command.key").touch()
    assert client._key() == str(tmp_path / "command.key")
    client.options = station.arguments(["--key", "/nowhere/command.key", "park"])
    with pytest.raises(ValueError, match="--key /nowhere/command.key: no such file"):
        client._key()


def test_the_line_of_a_night_shows_what_runs_and_every_alarm() -> None:
    client = station.StationClient.__new__(station.StationClient)
    alarm = Alarm(name="full_disk", level=1, message="0.1 GB are free", acknowledged=True)
    client.newest = {
        "antenna_status": AntennaStatus(mode="tracking", commanded=[1.0, 0.5], fault=""),
        "executive_status": ExecutiveStatus(state="running", pass_id="p1", blocks=["pass: executing"], alarms=[alarm]),
    }
    line = station._status_line(client._status_values())
    assert "antenna tracking az 57.30 el 28.65 deg" in line
    assert "executive running: p1 pass: executing" in line
    assert "warning full_disk: 0.1 GB are free (acknowledged)" in line
