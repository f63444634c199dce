"""The live line, the certificate before it, and a pass that is tracked from its start to its report."""

import io
import math
from pathlib import Path
from typing import Any

import pytest
from rf_pointing_msgs.action import TrackPass
from rf_pointing_msgs.msg import PassBranch, PassCertificate, TrackingStatus

import rf_pointing.report
from rf_pointing.commands import live_pass, track, track_options
from rf_pointing.commands.live_pass import LivePass, ProgressLine, describe, outcome_line
from rf_pointing.commands.station_run import GraphRun
from rf_pointing.ros.graph import NODES
from rf_pointing.ros.managed_graph import NotStartedError
from rf_pointing.ros.stamps import seconds_from_stamp, stamp_from_seconds
from rf_pointing.station.description import read_station
from test.commands.fake_station import FakeStation, make_run


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
    """A stream that says it is a terminal; `flushed` is what the user sees."""

    flushed = ""

    def flush(self) -> None:
        self.flushed = self.getvalue()

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
        assert stream.flushed == stream.getvalue()
    line.end()
    assert stream.getvalue().count("\r\x1b[2K[") == 5
    assert stream.getvalue().endswith("\n")
    assert stream.getvalue().count("\n") == 1


def test_in_a_log_a_line_comes_every_ten_seconds(monkeypatch: pytest.MonkeyPatch) -> None:
    wall, stream = Wall(monkeypatch), io.StringIO()
    line = ProgressLine(stream)
    for _ in range(321):
        line.show(feedback())
        wall.now_s += 0.125
    line.end()
    assert stream.getvalue().count("\n") == 5, "at 0, 10 ... 40 s"
    assert "\x1b" not in stream.getvalue()


def test_the_first_line_comes_at_once_on_a_machine_that_has_just_started(monkeypatch: pytest.MonkeyPatch) -> None:
    wall, stream = Wall(monkeypatch), io.StringIO()
    wall.now_s = 0.5
    ProgressLine(stream).show(feedback())
    assert stream.getvalue().count("\n") == 1


@pytest.mark.parametrize(("predicted", "text"), [(0.0, "0.00 dB predicted"), (-1.0, "40.00 dB")])
def test_a_predicted_loss_of_zero_is_one(predicted: float, text: str) -> None:
    assert outcome_line(TrackPass.Result(mean_loss=40.0, predicted_loss=predicted)).endswith(text)


# The certificate

CERTIFICATE = PassCertificate(
    target="ISS", accepted=True, branches=[PassBranch(works=True)], rate_limit=[0.1, 0.1],
    acceleration_limit=[0.1, 0.1], sky_peak=0.75,
)  # fmt: skip


@pytest.fixture
def fake(monkeypatch: pytest.MonkeyPatch) -> FakeStation:
    fake = make_run(monkeypatch)
    fake.ready_s, fake.result_s = 0.0, 100.0
    fake.results["track_pass"] = TrackPass.Result(success=True, message="loss of signal", predicted_loss=-1.0)
    return fake


def test_the_certificate_of_a_pass_is_shown_before_it_is_followed(
    fake: FakeStation, capsys: pytest.CaptureFixture[str]
) -> None:
    live = LivePass(GraphRun("track", "/gs1"))
    fake.publish(5.0, "pass_certificate", CERTIFICATE)
    handle = live.begin(TrackPass.Goal())
    assert fake.wall.passed_s == pytest.approx(5.0, abs=0.1)
    assert capsys.readouterr().err.startswith("certificate of ISS: machine: 5.73 5.73 deg/s")
    fake.at(10.0, lambda: fake.feedback(TrackPass.Impl.FeedbackMessage(feedback=feedback())) if fake.feedback else None)
    assert live.result(handle) is fake.results["track_pass"]
    assert capsys.readouterr().err.startswith("[############............] LOS in  123 s")
    assert fake.wall.passed_s == pytest.approx(100.0, abs=0.2)


def test_the_certificate_of_an_earlier_pass_is_not_shown(fake: FakeStation, capsys: pytest.CaptureFixture[str]) -> None:
    """A running station has kept it; its own must come within 40 s."""
    run = GraphRun("track", "/gs1")
    live = LivePass(run)
    fake.publish(0.1, "pass_certificate", CERTIFICATE)
    run.spin(0.2)
    begin_s = fake.wall.passed_s
    with pytest.raises(TimeoutError, match="neither certified nor refused the pass in 40 s"):
        live.begin(TrackPass.Goal())
    assert fake.wall.passed_s - begin_s == pytest.approx(40.0, abs=0.1)
    assert capsys.readouterr().err == ""


def test_a_pass_that_ends_without_a_certificate_has_none(fake: FakeStation, capsys: pytest.CaptureFixture[str]) -> None:
    fake.result_s = 3.0
    live = LivePass(GraphRun("track", "/gs1"))
    assert live.result(live.begin(TrackPass.Goal())).message == "loss of signal"
    assert fake.wall.passed_s == pytest.approx(3.0, abs=0.1)
    assert capsys.readouterr().err == ""


def test_a_process_that_ends_before_the_certificate_ends_the_wait(fake: FakeStation) -> None:
    class Run(GraphRun):
        def check(self) -> None:
            if fake.wall.passed_s > 2.0:
                raise NotStartedError("pointing_controller ended")

    with pytest.raises(NotStartedError, match="pointing_controller ended"):
        LivePass(Run("track", "/gs1")).begin(TrackPass.Goal())
    assert fake.wall.passed_s == pytest.approx(2.0, abs=0.1)


def test_the_live_line_of_a_terminal_is_left_below_it(fake: FakeStation, monkeypatch: pytest.MonkeyPatch) -> None:
    stream = Terminal()
    monkeypatch.setattr(live_pass.sys, "stderr", stream)
    live = LivePass(GraphRun("track", "/gs1"))
    fake.result_s = 1.0
    live.result(live.begin(TrackPass.Goal()))
    assert stream.getvalue() == "\n"


# The command


@pytest.fixture
def reports(fake: FakeStation, monkeypatch: pytest.MonkeyPatch) -> list[tuple[Path, Path]]:
    """Let a station take any pass; return bag and folder of every report."""
    made: list[tuple[Path, Path]] = []
    monkeypatch.setattr(rf_pointing.report, "write_report", lambda bag, folder: made.append((bag, folder)))
    monkeypatch.setattr(track_options, "time", fake.wall)
    fake.publish(1.0, "pass_certificate", CERTIFICATE)
    return made


def run(*words: str) -> int:
    with pytest.raises(SystemExit) as ended:
        track.main([*words])
    assert isinstance(ended.value.code, int)
    return ended.value.code


def test_a_pass_is_tracked_from_its_plan_to_its_report(
    fake: FakeStation, reports: list[tuple[Path, Path]], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run("--sensor", "conscan", "--scan-sigma", "2", "--output", str(tmp_path)) == 0
    lines = capsys.readouterr().err.splitlines()
    assert lines[0] == (
        "track: CBERS 2 over Goldstone DSS-13, X band, conscan: AOS 2006-06-27T04:58:43.813Z, 715 s, peak 44.3 deg"
    )
    assert lines[1].startswith("track: scan of ")
    assert lines[-2:] == [
        f"track: report {tmp_path}/report.html, bag {tmp_path}/bag",
        "track: tracked: loss of signal; 0 s held, 0 s lost; mean pointing loss 0.00 dB",
    ]
    assert reports == [(tmp_path / "bag", tmp_path)]
    ((_, goal),) = fake.goals
    assert (goal.sensor, goal.target_pass.target) == ("conscan", "CBERS 2")
    (graph,) = fake.graphs
    assert [step[0] for step in graph.steps[:2]] == ["start", "configure"]
    # Time runs when the goal is certified, and stops with the nodes.
    assert graph.steps[-3:-1] == [("activate", NODES[:1]), ("stop",)]
    assert fake.life[-3:] == ["executor shut down", "destroyed", "over"]


def test_a_pass_that_was_not_tracked_ends_with_1(
    fake: FakeStation, reports: list[tuple[Path, Path]], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    fake.results["track_pass"].success = False
    assert run("--output", str(tmp_path)) == 1
    assert "scan of" not in capsys.readouterr().err
    assert len(reports) == 1


def test_a_pass_that_did_not_start_ends_with_2_and_has_no_report(
    fake: FakeStation, reports: list[tuple[Path, Path]], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    fake.results["track_pass"] = None
    assert run("--output", str(tmp_path)) == 2
    assert "the goal was refused: the last line of pointing_controller" in capsys.readouterr().err
    assert reports == []
    assert fake.recorders[0].closed


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        (["--speed", "0"], "speed=0.0 must be between"),
        (["--params-file", "mine.yaml"], "antenna_srvo is no node"),
        (["--satellite", "99999"], "satellite='99999' is not among"),
    ],
)
def test_what_is_refused_ends_with_2_before_anything_starts(
    fake: FakeStation,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    words: list[str],
    reason: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("mine.yaml").write_text("/**/antenna_srvo: {ros__parameters: {wind.mean_speed_m_s: 1.0}}")
    assert run(*words) == 2
    assert reason in capsys.readouterr().err
    assert fake.graphs == []
    assert not Path("runs").exists()


def real(tmp_path: Path) -> list[str]:
    path = tmp_path / "mine.yaml"
    read_station("dss13").write(path, {"drive.type": "hamlib", "wind.anemometer": False})
    return ["--station", str(path), "--output", str(tmp_path / "out")]


def test_a_real_antenna_is_started_in_time_for_its_longest_slew(
    fake: FakeStation, reports: list[tuple[Path, Path]], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """440 deg of azimuth at 2 deg/s, and 30 s to settle, before its rise."""
    fake.wall.now_s = seconds_from_stamp(stamp_from_seconds(1_151_384_323.8)) - 400.0
    fake.events.clear()
    fake.result_s = 1.0
    assert run(*real(tmp_path)) == 0
    lines = capsys.readouterr().err.splitlines()
    assert lines[1] == "track: in real time: CBERS 2 is waited for; the antenna is started in 150 s"
