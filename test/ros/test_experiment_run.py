"""An identification as client of the antenna: what it sends, waits for and takes."""

import math
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import yaml
from rf_pointing_msgs.action import Identify
from rf_pointing_msgs.msg import ManualRate

from rf_pointing.identification import ExcitationParams
from rf_pointing.ros.experiment_run import EndedEarlyError, ExperimentRun
from rf_pointing.ros.managed_graph import NotStartedError
from rf_pointing.ros.stamps import stamp_from_seconds
from test.ros.fake_station import FakeStation, fake

__all__ = ["fake"]

PARAMS = ExcitationParams(samples=64, idle_rate_rad_s=math.radians(0.01))


@pytest.fixture
def antenna(fake: FakeStation) -> FakeStation:
    """Return a station that offers the experiment; two sequences take a second."""
    fake.ready_s, fake.publishers["manual_rate"] = 0.0, 1
    fake.results["identify"] = Identify.Result(success=True, samples_taken=128)
    return fake


def run_of() -> ExperimentRun:
    return ExperimentRun("/gs1", 2, 9, PARAMS)


def sample(fake: FakeStation, number: int, axis: str = "elevation") -> None:
    message = ManualRate(axis=axis, sample=number, rate=(1e-4, 1e-6 * number), position=(0.1, 0.001 * number))
    message.header.stamp = stamp_from_seconds(1.8e9 + PARAMS.sample_s * number)
    fake.publish(0.5 if number % 2 else 0.6, "manual_rate", message)


def test_one_axis_is_driven_and_its_samples_are_put_where_they_belong(
    antenna: FakeStation, capsys: pytest.CaptureFixture[str]
) -> None:
    run = run_of()
    # Samples of before the experiment belong to nobody.
    antenna.topics["manual_rate"][1](ManualRate(axis="elevation", sample=0))
    for number in range(128):
        sample(antenna, number)
    recording = run.record("elevation")
    ((name, goal),) = antenna.goals
    assert (name, goal.axis, goal.sequences, goal.samples, goal.seed) == ("identify", "elevation", 2, 64, 9)
    assert math.degrees(goal.idle) == pytest.approx(0.01)
    assert recording.input_rad_s == pytest.approx(1e-6 * np.arange(128.0).reshape(2, 64))
    assert recording.encoder_rad[..., 1] == pytest.approx(1e-3 * np.arange(128.0).reshape(2, 64))
    assert (capsys.readouterr().err, antenna.warnings) == ("", [])


def test_samples_of_another_axis_are_left_out_and_late_ones_waited_for(
    antenna: FakeStation, capsys: pytest.CaptureFixture[str]
) -> None:
    run = run_of()
    for number in range(64):
        sample(antenna, number)
    sample(antenna, 64, axis="azimuth")
    assert run.record("elevation").input_rad_s.shape == (1, 64)
    assert "azimuth" in " ".join(antenna.warnings)
    # Two seconds for samples that are late, and no more.
    assert antenna.wall.passed_s == pytest.approx(3.1, abs=0.2)
    assert "elevation: 64 samples were lost, 1 sequences are complete" in capsys.readouterr().err


@pytest.mark.parametrize(("taken", "error"), [(0, NotStartedError), (1, EndedEarlyError)])
def test_an_experiment_that_fails_has_begun_when_samples_were_taken(
    antenna: FakeStation, taken: int, error: type[Exception]
) -> None:
    antenna.results["identify"] = Identify.Result(success=False, message="the wind is too high", samples_taken=taken)
    with pytest.raises(error, match="azimuth: the wind is too high"):
        run_of().record("azimuth")


def test_progress_is_reported_once_in_ten_seconds(antenna: FakeStation, capsys: pytest.CaptureFixture[str]) -> None:
    antenna.result_s, antenna.results["identify"] = 30.0, Identify.Result(success=False, samples_taken=1)
    for at_s, progress in ((0.5, 0.1), (5.0, 0.2), (10.4, 0.3), (10.7, 0.4), (11.0, 0.5)):
        message = SimpleNamespace(feedback=Identify.Feedback(progress=progress))
        antenna.at(at_s, lambda message=message: antenna.feedback(message))
    with pytest.raises(EndedEarlyError):
        run_of().record("azimuth")
    assert capsys.readouterr().err.splitlines() == [f"identify_antenna: azimuth: {k} %" for k in (10, 40)]


def test_an_antenna_that_comes_late_is_waited_for_half_a_minute(antenna: FakeStation) -> None:
    antenna.ready_s = 20.0
    run_of().find_antenna()
    assert antenna.wall.passed_s == pytest.approx(20.0, abs=0.1)
    antenna.publishers.clear()
    with pytest.raises(NotStartedError, match="no antenna offers identify in /gs1"):
        run_of().find_antenna()
    assert antenna.wall.passed_s == pytest.approx(50.0, abs=0.2)


def test_the_user_ends_the_wait_at_once(antenna: FakeStation) -> None:
    antenna.ready_s = math.inf
    run = run_of()
    run.interrupt()
    with pytest.raises(NotStartedError, match="interrupted"):
        run.find_antenna()
    assert antenna.wall.passed_s < 0.1


def test_a_simulated_antenna_is_started_with_its_parameters_and_its_time_last(
    antenna: FakeStation, tmp_path: Path
) -> None:
    run = run_of()
    run.start_antenna({"band": "S"}, (Path("mine.yaml"),), tmp_path)
    assert (antenna.graph.files, antenna.graph.logs) == ([tmp_path / "run.yaml", Path("mine.yaml")], tmp_path / "logs")
    nodes = ("simulation_clock", "antenna_servo")
    steps = [("start", nodes, True), ("configure", nodes), ("activate", nodes[1:]), ("activate", nodes[:1])]
    assert antenna.log == steps
    written = yaml.safe_load((tmp_path / "run.yaml").read_text())
    assert written["/**/antenna_servo"]["ros__parameters"] == {"band": "S"}
    # Speed 0: as fast as the machine can.
    assert written["/**/simulation_clock"]["ros__parameters"] == {"start_s": 1.0e9, "speed": 0.0, "tick_s": 0.1}
