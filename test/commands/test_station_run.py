"""A run that cannot be begun says why, in a line, and is over."""

import pytest
import rclpy

from rf_pointing.commands import calibrate
from rf_pointing.commands.station_run import StationRun, run_to_end


def test_a_run_without_room_for_its_bag_ends_with_the_reason_and_nothing_left(
    capsys: pytest.CaptureFixture[str],
) -> None:
    def make() -> StationRun:
        raise OSError("no room to begin a recording in /full")

    assert run_to_end("track", make, lambda _: pytest.fail("there is no run to work with")) == 2
    assert capsys.readouterr().err == "track: no room to begin a recording in /full\n"
    assert not rclpy.ok()


def test_calibrate_refuses_an_output_with_a_bag_before_anything_is_written(
    tmp_path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "bag").mkdir()
    monkeypatch.setattr(calibrate, "plan", lambda _: None)
    with pytest.raises(SystemExit) as ended:
        calibrate.main(["--output", str(tmp_path)])
    assert ended.value.code == 2
    assert capsys.readouterr().err == f"calibrate: output={tmp_path} holds a bag already\n"
    assert [entry.name for entry in tmp_path.iterdir()] == ["bag"]
