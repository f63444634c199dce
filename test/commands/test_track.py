"""The live line: what it says, where it is drawn, and how often."""

import io
import math
from typing import Any

import pytest
from rf_pointing_msgs.action import TrackPass
from rf_pointing_msgs.msg import TrackingStatus

from rf_pointing.commands import live_pass
from rf_pointing.commands.live_pass import ProgressLine, describe, outcome_line
from rf_pointing.nodes.stamps import stamp_from_seconds


def feedback(**changes: Any) -> TrackPass.Feedback:
    status = TrackingStatus(
        axis_distance=4e-5, mode="monopulse", azimuth=math.radians(-10.0), elevation=math.radians(43.21),
        cross_elevation_error=3e-5, elevation_error=-4e-5, carrier_to_noise=57.3, command_lead=1.0,
    )  # fmt: skip
    status.header.stamp, status.los = stamp_from_seconds(100.0), stamp_from_seconds(223.4)
    for name, value in changes.items():
        setattr(status, name, value)
    return TrackPass.Feedback(status=status, progress=0.5)


class Terminal(io.StringIO):
    """A stream that says it is a terminal."""

    def isatty(self) -> bool:
        return True


class Wall:
    """A wall clock that is set by hand."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.now_s = 100.0
        monkeypatch.setattr(live_pass.time, "monotonic", lambda: self.now_s)


def test_the_line_tells_what_the_operator_asks() -> None:
    line = describe(feedback())
    assert line.startswith("[############............] LOS in  123 s  monopulse ")
    for part in ("command az 350.00 el 43.21 deg", "error   2.86 mdeg", "C/N0 57.3 dB-Hz",
                 "axes 0.002 deg off"):  # fmt: skip
        assert part in line
    assert describe(feedback(on_source=True, alarm="coast: the carrier is lost")).endswith(
        "on source  coast: the carrier is lost"
    )


def test_the_last_line_has_what_was_held_and_lost_and_the_predicted_loss() -> None:
    result = TrackPass.Result(
        success=True, message="loss of signal", seconds_tracked=697.4, seconds_lost=17.6, mean_loss=0.112,
        predicted_loss=0.09,
    )  # fmt: skip
    assert outcome_line(result) == (
        "tracked: loss of signal; 697 s held, 18 s lost; mean pointing loss 0.11 dB, 0.09 dB predicted"
    )
    failed = TrackPass.Result(
        message="antenna fault: drives cut", fault="antenna fault: drives cut", seconds_lost=30.0, mean_loss=40.0,
        predicted_loss=-1.0,
    )  # fmt: skip
    assert outcome_line(failed) == (
        "NOT tracked: antenna fault: drives cut; 0 s held, 30 s lost; mean pointing loss 40.00 dB"
    )


def test_after_the_end_of_the_pass_no_time_is_left() -> None:
    assert "LOS in    0 s" in describe(feedback(los=stamp_from_seconds(90.0)))


def test_on_a_terminal_the_line_is_redrawn_in_place_five_times_a_second(monkeypatch: pytest.MonkeyPatch) -> None:
    wall, stream = Wall(monkeypatch), Terminal()
    line = ProgressLine(stream)
    for _ in range(100):
        line.show(feedback())
        wall.now_s += 0.01
    line.end()
    assert stream.getvalue().count("\r\x1b[2K[") == 5
    assert stream.getvalue().endswith("\n")
    assert stream.getvalue().count("\n") == 1


def test_in_a_log_a_line_comes_every_ten_seconds(monkeypatch: pytest.MonkeyPatch) -> None:
    wall, stream = Wall(monkeypatch), io.StringIO()
    line = ProgressLine(stream)
    for _ in range(300):
        line.show(feedback())
        wall.now_s += 0.1
    line.end()
    assert stream.getvalue().count("\n") == 3
    assert "\x1b" not in stream.getvalue()
