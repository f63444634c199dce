"""Lines of logs as JSON: any text is read back, and data stay on stdout."""

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rf_pointing.station.log_lines import ROS_FORMAT, json_lines, quoted, say


@given(text=st.text())
def test_any_text_of_a_node_is_read_back_from_its_line(text: str) -> None:
    # What rcutils makes of its format, which knows no quoting.
    line = ROS_FORMAT
    for token, value in (("time", "1795677184.7"), ("severity", "WARN"), ("name", "gs1.antenna_servo")):
        line = line.replace(f"{{{token}}}", value)
    line = line.replace("{message}", quoted(text))
    assert "\n" not in line
    assert json.loads(line) == {"t_s": 1795677184.7, "level": "WARN", "name": "gs1.antenna_servo", "text": text}


def test_a_command_says_it_in_the_chosen_form(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.delenv("RF_POINTING_LOG", raising=False)
    say("plan_passes", 'no "ISS"')
    assert capsys.readouterr() == ("", 'plan_passes: no "ISS"\n')
    monkeypatch.setenv("RF_POINTING_LOG", "json")
    say("plan_passes", 'no "ISS"', "ERROR")
    out, err = capsys.readouterr()
    said = json.loads(err)
    assert (out, said["level"], said["name"], said["text"]) == ("", "ERROR", "plan_passes", 'no "ISS"')
    monkeypatch.setenv("RF_POINTING_LOG", "yaml")
    with pytest.raises(ValueError, match="RF_POINTING_LOG='yaml' must be text or json"):
        json_lines()
