"""The live line of a pass, the certificate before it, and what is said at its end."""

import io
import math
import sys
from typing import Any

import pytest
from rf_pointing_msgs.action import TrackPass
from rf_pointing_msgs.msg import PassBranch, PassCertificate, TrackingStatus

from rf_pointing.ros.live_pass import LiveLine, LivePass, describe, outcome_line
from rf_pointing.ros.managed_graph import NotStartedError
from rf_pointing.ros.stamps import stamp_from_seconds
from rf_pointing.ros.station_run import GraphRun
from test.ros.fake_station import FakeStation, fake

__all__ = ["fake"]

CERTIFICATE = PassCertificate(
    target="ISS", accepted=True, branches=[PassBranch(works=True)], rate_limit=[0.1, 0.1],
    acceleration_limit=[0.1, 0.1], sky_peak=0.75,
)  # fmt: skip


def feedback(**changes: Any) -> TrackPass.Feedback:
    status = TrackingStatus(
        axis_distance=4e-5, mode="monopulse", azimuth=math.radians(-10.0), elevation=math.radians(43.21),
        cross_elevation_error=3e-5, elevation_error=-4e-5, carrier_to_noise=57.3, command_lead=1.0,
    )  # fmt: skip
    status.header.stamp, status.los = stamp_from_seconds(100.0), stamp_from_seconds(223.4)
    for name, value in changes.items():
        setattr(status, name, value)
    return TrackPass.Feedback(status=status, progress=0.5)


def test_the_line_tells_what_the_operator_asks() -> None:
    assert describe(feedback()) == (
        "[############............] LOS in  123 s  monopulse     command az 350.00 el 43.21 deg  error   2.86 mdeg"
        "  C/N0 57.3 dB-Hz  axes 0.002 deg off"
    )
    # Half power is 3.01 dB; a slew is told in degrees, and no carrier where nobody measures one.
    half, slew = (feedback(elevation_error=e, cross_elevation_error=0.0, beamwidth=0.02) for e in (0.01, 2.1))
    assert "error 572.96 mdeg  3.01 dB  C/N0" in describe(half)
    assert "error 120.32 deg  C/N0" in describe(slew)
    assert describe(feedback(carrier_to_noise=0.0)).endswith("error   2.86 mdeg  axes 0.002 deg off")
    assert describe(feedback(on_source=True, alarm="coast: the carrier is lost")).endswith(
        "on source  coast: the carrier is lost"
    )
    # After the end of the pass.
    assert "LOS in    0 s" in describe(feedback(los=stamp_from_seconds(90.0)))


def test_the_last_line_has_what_was_held_and_lost_and_the_predicted_loss() -> None:
    result = TrackPass.Result(
        success=True, message="loss of signal", seconds_tracked=697.4, seconds_lost=17.6, mean_loss=0.112,
        predicted_loss=0.0,
    )  # fmt: skip
    assert outcome_line(result) == (
        "tracked: loss of signal; 697 s held, 18 s lost; mean pointing loss 0.11 dB, 0.00 dB predicted"
    )
    failed = TrackPass.Result(message="drives cut", seconds_lost=30.0, mean_loss=40.0, predicted_loss=-1.0)
    assert outcome_line(failed) == "NOT tracked: drives cut; 0 s held, 30 s lost; mean pointing loss 40.00 dB"


class Stream(io.StringIO):
    """A terminal or a log; `flushed` is what the user sees."""

    flushed = ""

    def __init__(self, terminal: bool) -> None:
        super().__init__()
        self.isatty = lambda: terminal

    def flush(self) -> None:
        self.flushed = self.getvalue()


@pytest.mark.parametrize(("terminal", "drawn"), [(True, 200), (False, 4)])
def test_a_line_is_redrawn_in_place_on_a_terminal_or_repeated_every_ten_seconds(
    fake: FakeStation, monkeypatch: pytest.MonkeyPatch, terminal: bool, drawn: int
) -> None:
    stream = Stream(terminal)
    monkeypatch.setattr(sys, "stderr", stream)
    # The first one at once, on a machine that has just started too.
    fake.wall.now_s = 0.5
    line = LiveLine(0.2)
    for _ in range(399):
        line.show(lambda: "all is well")
        assert stream.flushed == stream.getvalue()
        fake.wall.now_s += 0.1
    line.end()
    text = stream.getvalue()
    assert text.count("all is well") == pytest.approx(drawn, abs=drawn // 100)
    assert text.count("\n") == (1 if terminal else drawn)
    assert text.count("\r\x1b[2K") == (text.count("all") if terminal else 0)


@pytest.fixture
def live(fake: FakeStation) -> LivePass:
    fake.ready_s, fake.result_s = 0.0, 100.0
    fake.results["track_pass"] = TrackPass.Result(success=True, message="loss of signal", predicted_loss=-1.0)
    return LivePass(GraphRun("track", "/gs1"))


def test_the_certificate_of_a_pass_is_shown_before_it_is_followed(
    fake: FakeStation, live: LivePass, capsys: pytest.CaptureFixture[str]
) -> None:
    fake.publish(5.0, "pass_certificate", CERTIFICATE)
    handle = live.begin(TrackPass.Goal())
    assert fake.wall.passed_s == pytest.approx(5.0, abs=0.1)
    assert capsys.readouterr().err.startswith("certificate of ISS: machine: 5.73 5.73 deg/s")
    fake.at(10.0, lambda: fake.feedback(TrackPass.Impl.FeedbackMessage(feedback=feedback())))
    assert live.result(handle) is fake.results["track_pass"]
    assert capsys.readouterr().err.startswith("[############............] LOS in  123 s")


def test_the_certificate_of_an_earlier_pass_is_not_shown(
    fake: FakeStation, live: LivePass, capsys: pytest.CaptureFixture[str]
) -> None:
    """A running station has kept it; its own must come within 40 s."""
    fake.topics["pass_certificate"][1](CERTIFICATE)
    with pytest.raises(TimeoutError, match="neither certified nor refused the pass within 40 s"):
        live.begin(TrackPass.Goal())
    assert fake.wall.passed_s == pytest.approx(40.0, abs=0.1)
    assert capsys.readouterr().err == ""


def test_a_process_that_ends_before_the_certificate_ends_the_wait(fake: FakeStation) -> None:
    class Run(GraphRun):
        def check(self) -> None:
            if fake.wall.passed_s > 2.0:
                raise NotStartedError("pointing_controller ended")

    fake.ready_s, fake.result_s, fake.results["track_pass"] = 0.0, 100.0, TrackPass.Result()
    with pytest.raises(NotStartedError, match="pointing_controller ended"):
        LivePass(Run("track", "/gs1")).begin(TrackPass.Goal())
