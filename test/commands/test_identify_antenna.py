"""`identify_antenna` with an antenna, a graph and a clock of the test's own: what it sends, waits for and leaves behind."""

import math
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import yaml
from rf_pointing_msgs.action import Identify
from rf_pointing_msgs.msg import ManualRate

from rf_pointing.commands import identify_antenna, station_run
from rf_pointing.commands.identify_antenna import EndedEarlyError, Experimenter, arguments, excitation
from rf_pointing.identification import Recording
from rf_pointing.ros.managed_graph import NotStartedError
from rf_pointing.station.description import read_station

SMALL = ["--sequences", "2", "--held-out", "1", "--samples", "64"]


class Clock:
    """A wall clock that goes on only while the run waits; it ends a loop that never waits."""

    def __init__(self) -> None:
        self.now_s, self.reads = 0.5, 0

    def monotonic(self) -> float:
        self.reads += 1
        assert self.reads < 5000, "a loop that waits for nothing"
        return self.now_s


class Later:
    """A future that is done, or that never will be."""

    def __init__(self, value: Any, done: bool = True) -> None:
        self._value, self._done = value, done

    def done(self) -> bool:
        return self._done

    def result(self) -> Any:
        return self._value


class Antenna:
    """The antenna beyond the topics: `events` happen one at each turn of the run's executor."""

    def __init__(self, clock: Clock) -> None:
        self.clock, self.waits_s = clock, list[float]()
        self.ready, self.publishers, self.answers, self.accepted = True, 1, True, True
        self.result = Identify.Result(success=True, samples_taken=128)
        self.goals: list[Identify.Goal] = []
        self.events: list[Callable[[], None]] = []
        self.on_sample: Callable[[ManualRate], None] = lambda _: None
        self.feedback: Callable[[Any], None] = lambda _: None
        self.warnings: list[str] = []

    def node(self, _program: str, namespace: str) -> Any:
        def subscribe(_type: type, topic: str, callback: Callable[[ManualRate], None], _qos: Any) -> None:
            assert (namespace, topic) == ("/gs1", "manual_rate")
            self.on_sample = callback

        logger = SimpleNamespace(warning=lambda text, **_: self.warnings.append(text))
        return SimpleNamespace(
            create_subscription=subscribe,
            count_publishers=lambda topic: self.publishers if topic == "manual_rate" else 0,
            get_logger=lambda: logger,
        )

    def add_node(self, _node: Any) -> None:
        pass

    def spin_once(self, timeout_sec: float) -> None:
        if self.events:
            self.events.pop(0)()
            return
        self.waits_s.append(timeout_sec)
        assert len(self.waits_s) < 2000, "a wait without an end"
        self.clock.now_s += timeout_sec

    def server_is_ready(self) -> bool:
        return self.ready

    def send_goal_async(self, goal: Identify.Goal, feedback_callback: Callable[[Any], None]) -> Later:
        self.goals.append(goal)
        self.feedback = feedback_callback
        answer = Later(SimpleNamespace(result=self.result))
        handle = SimpleNamespace(accepted=self.accepted, get_result_async=lambda: answer)
        return Later(handle, self.answers)

    def sample(self, number: int, axis: str = "elevation", rate: tuple[float, float] = (1e-4, 2e-4)) -> None:
        self.on_sample(ManualRate(axis=axis, sample=number, rate=rate, position=(0.1, 0.001 * number)))


class Graph:
    """The managed processes, each change of which is noted."""

    def __init__(
        self, _node: Any, namespace: str, files: list[Path], logs: Path, _spin: Any, patience_s: float
    ) -> None:
        self.given = (namespace, files, logs, patience_s)
        self.changes: list[tuple[Any, ...]] = []
        self.ended = ""

    def start(self, names: tuple[str, ...]) -> None:
        self.changes.append(("start", *names))

    def configure(self, names: tuple[str, ...]) -> None:
        self.changes.append(("configure", *names))

    def activate(self, names: tuple[str, ...]) -> None:
        self.changes.append(("activate", *names))

    def change(self, names: tuple[str, ...], change: str) -> None:
        self.changes.append((change, *names))

    def check(self) -> None:
        if self.ended:
            raise NotStartedError(f"{self.ended} has ended")


@pytest.fixture
def antenna(monkeypatch: pytest.MonkeyPatch) -> Antenna:
    """Return an antenna in place of the ROS graph."""
    clock = Clock()
    made = Antenna(clock)
    monkeypatch.setattr(identify_antenna, "time", clock)
    monkeypatch.setattr(station_run, "rclpy", SimpleNamespace(create_node=made.node))
    monkeypatch.setattr(station_run, "make_executor", lambda: made)
    monkeypatch.setattr(identify_antenna, "ActionClient", lambda *_: made)
    monkeypatch.setattr(identify_antenna, "ManagedGraph", Graph)
    return made


def experimenter(folder: Path, *line: str) -> Experimenter:
    options = arguments([*SMALL, *line])
    return Experimenter(options, excitation(options), folder)


def test_without_options_it_is_the_published_experiment_on_both_axes() -> None:
    options = arguments([])
    assert (options.axes, options.sequences, options.held_out, options.seed) == (["azimuth", "elevation"], 8, 4, 1)
    assert (options.namespace, options.output, options.simulated) == ("/gs1", "runs/identification", False)
    assert (options.params_file, options.station) == ([], "dss13")
    params = excitation(options)
    assert (params.kind, params.samples, params.sample_s, params.high_hz) == ("white", 8192, 0.02, 12.0)
    given = [math.degrees(value) for value in (params.mean_rad_s, params.rms_rad_s, params.peak_rad_s)]
    assert given == pytest.approx([0.056, 0.028, 0.2])
    assert math.degrees(params.idle_rate_rad_s) == pytest.approx(1.84e-4)


def test_a_slow_control_period_bounds_the_band_by_half_its_rate() -> None:
    assert excitation(arguments(["--tick", "0.1", "--kind", "multisine"])).high_hz == pytest.approx(5.0)
    assert excitation(arguments(["--tick", "0.001"])).high_hz == pytest.approx(12.0)


@pytest.mark.parametrize("held_out", [1, 7])
def test_one_sequence_is_held_out_at_least_and_one_is_left(held_out: int) -> None:
    excitation(arguments(["--held-out", str(held_out)]))


@pytest.mark.parametrize(
    ("line", "complaint"),
    [
        ("--held-out 0", "held_out=0 must be >= 1 and < sequences=8"),
        ("--held-out 8", "held_out=8 must be >= 1 and < sequences=8"),
        ("--tick 0.0009", "0.0009 must be between 0.001 and 0.1"),
        ("--tick 0.11", "0.11 must be between 0.001 and 0.1"),
        ("--peak-deg-s 0.01", "together must be <="),
        ("--seed -1", "-1 must be a whole number"),
    ],
)
def test_what_cannot_be_driven_is_refused_before_anything_moves(
    line: str, complaint: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as ended:
        identify_antenna.main([*line.split(), "--output", str(tmp_path / "out")])
    assert ended.value.code == 2
    assert complaint in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("there", [True, False])
def test_the_folder_is_made_and_the_exit_code_is_that_of_the_experiment(
    there: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder, codes = tmp_path / "runs" / "one", []
    if there:
        folder.mkdir(parents=True)
    monkeypatch.setattr(identify_antenna, "execute", lambda _, params, output: codes.append((params, output)) or 7)
    with pytest.raises(SystemExit) as ended:
        identify_antenna.main([*SMALL, "--output", str(folder)])
    assert ended.value.code == 7
    ((params, output),) = codes
    assert params.samples == 64
    assert output == folder
    assert folder.is_dir()


@pytest.mark.parametrize(("ready", "publishers", "starts"), [(True, 1, True), (True, 0, False), (False, 1, False)])
def test_an_antenna_offers_the_action_and_its_samples(
    ready: bool, publishers: int, starts: bool, antenna: Antenna, tmp_path: Path
) -> None:
    antenna.ready, antenna.publishers = ready, publishers
    run = experimenter(tmp_path)
    if starts:
        run.start()
        assert antenna.clock.now_s == 0.5
    else:
        with pytest.raises(NotStartedError, match="no antenna offers identify in /gs1"):
            run.start()
        # Half a minute, in which it looks 20 times a second.
        assert antenna.clock.now_s == pytest.approx(30.5, abs=0.06)
        assert max(antenna.waits_s) <= 0.05
    assert run.graph is None


def test_an_antenna_that_comes_late_is_waited_for(antenna: Antenna, tmp_path: Path) -> None:
    antenna.ready = False
    antenna.events = [lambda: None, lambda: setattr(antenna, "ready", True)]
    experimenter(tmp_path).start()
    assert antenna.events == []


def test_the_user_ends_the_wait_at_once(antenna: Antenna, tmp_path: Path) -> None:
    antenna.ready = False
    run = experimenter(tmp_path)
    run.interrupt()
    with pytest.raises(NotStartedError):
        run.start()
    assert antenna.waits_s == []


def test_one_axis_is_driven_and_its_samples_are_put_where_they_belong(antenna: Antenna, tmp_path: Path) -> None:
    run = experimenter(tmp_path, "--seed", "9", "--mean-deg-s", "0.1", "--rms-deg-s", "0.05", "--idle-deg-s", "0.01")
    # Samples of before the experiment belong to nobody.
    antenna.sample(0)
    for number in reversed(range(128)):
        antenna.events.append(lambda n=number: antenna.sample(n, rate=(1e-4, 1e-6 * n)))
    recording = run.record("elevation")
    (goal,) = antenna.goals
    assert (goal.axis, goal.kind, goal.sequences, goal.samples, goal.seed) == ("elevation", "white", 2, 64, 9)
    rates = [math.degrees(value) for value in (goal.mean, goal.rms, goal.peak, goal.idle)]
    assert rates == pytest.approx([0.1, 0.05, 0.2, 0.01])
    assert recording.input_rad_s == pytest.approx(1e-6 * np.arange(128.0).reshape(2, 64))
    assert recording.encoder_rad[..., 1] == pytest.approx(1e-3 * np.arange(128.0).reshape(2, 64))
    assert antenna.waits_s == []
    assert antenna.warnings == []


def test_samples_of_another_axis_are_left_out_with_a_warning(
    antenna: Antenna, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    antenna.events = [lambda n=number: antenna.sample(n) for number in range(64)]
    antenna.events.append(lambda: antenna.sample(64, axis="azimuth"))
    recording = experimenter(tmp_path).record("elevation")
    assert recording.input_rad_s.shape == (1, 64)
    assert "azimuth" in " ".join(antenna.warnings)
    # Two seconds for samples that are late, and no more.
    assert antenna.clock.now_s == pytest.approx(2.5, abs=0.06)
    assert max(antenna.waits_s) <= 0.05
    assert "elevation: 64 samples were lost, 1 sequences are complete" in capsys.readouterr().err


def test_an_experiment_without_losses_reports_none(
    antenna: Antenna, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    antenna.events = [lambda n=number: antenna.sample(n) for number in range(128)]
    experimenter(tmp_path).record("elevation")
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize(("taken", "error"), [(0, NotStartedError), (1, EndedEarlyError)])
def test_an_experiment_that_fails_has_begun_when_samples_were_taken(
    taken: int, error: type[Exception], antenna: Antenna, tmp_path: Path
) -> None:
    antenna.result = Identify.Result(success=False, message="the wind is too high", samples_taken=taken)
    with pytest.raises(error, match="azimuth: the wind is too high"):
        experimenter(tmp_path).record("azimuth")


def test_a_goal_that_is_refused_or_unanswered_starts_nothing(antenna: Antenna, tmp_path: Path) -> None:
    antenna.accepted = False
    with pytest.raises(NotStartedError, match="azimuth: the goal was rejected, another experiment runs"):
        experimenter(tmp_path).record("azimuth")
    antenna.accepted, antenna.answers = True, False
    with pytest.raises(NotStartedError, match="the antenna does not answer the goal"):
        experimenter(tmp_path).record("azimuth")
    assert antenna.clock.now_s == pytest.approx(30.5, abs=0.06)


def test_progress_is_reported_once_in_ten_seconds(
    antenna: Antenna, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    antenna.result = Identify.Result(success=False, samples_taken=1)
    with pytest.raises(EndedEarlyError):
        experimenter(tmp_path).record("azimuth")
    for now_s, progress in ((0.5, 0.1), (5.0, 0.2), (10.4, 0.3), (10.5, 0.4), (11.0, 0.5)):
        antenna.clock.now_s = now_s
        antenna.feedback(SimpleNamespace(feedback=Identify.Feedback(progress=progress)))
    shown = capsys.readouterr().err.splitlines()
    assert shown == ["identify_antenna: azimuth: 10 %", "identify_antenna: azimuth: 40 %"]


def test_a_simulated_antenna_is_started_in_light_wind_and_its_time_last(antenna: Antenna, tmp_path: Path) -> None:
    run = experimenter(tmp_path, "--simulated", "--tick", "0.05", "--band", "S", "--params-file", "mine.yaml")
    run.start()
    graph: Any = run.graph
    assert graph.given == ("/gs1", [tmp_path / "run.yaml", Path("mine.yaml")], tmp_path / "logs", 30.0)
    assert graph.changes == [
        ("start", "simulation_clock", "antenna_servo"),
        ("configure", "simulation_clock", "antenna_servo"),
        ("activate", "antenna_servo"),
        ("activate", "simulation_clock"),
    ]
    written = yaml.safe_load((tmp_path / "run.yaml").read_text())
    # Speed 0: as fast as the machine can.
    clock = written["/**/simulation_clock"]["ros__parameters"]
    assert clock == {"start_s": 1.0e9, "speed": 0.0, "tick_s": 0.1}
    servo = written["/**/antenna_servo"]["ros__parameters"]
    assert Path(servo.pop("station")) == read_station("dss13").path.resolve()
    assert servo == {"band": "S", "wind.mean_speed_m_s": 0.3, "antenna.tick_s": 0.05}
    graph.ended, antenna.ready = "antenna_servo", False
    with pytest.raises(NotStartedError, match="antenna_servo has ended"):
        run._until(lambda: False, "never")


def recording_of(axis: str) -> Recording:
    random = np.random.default_rng(2)
    rates = random.normal(0.0, 1e-3, (2, 64))
    encoders = np.zeros((2, 64, 2))
    encoders[..., 0] = np.cumsum(rates, axis=1) * 0.02
    return Recording(axis, 0.02, rates, encoders)


@pytest.fixture
def finished(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Callable[..., int]:
    """Return `execute` for runs whose axes are recorded at once, or fail with what the test gives."""

    def execute(started: Exception | None = None, code: int | None = None) -> int:
        def start() -> None:
            if started is not None:
                raise started

        run = SimpleNamespace(start=start, record=recording_of, say=print)

        def run_to_end(_program: str, _make: Any, work: Callable[[Any], int]) -> int:
            done = work(run)
            return done if code is None else code

        monkeypatch.setattr(identify_antenna, "run_to_end", run_to_end)
        options = arguments(SMALL)
        return identify_antenna.execute(options, excitation(options), tmp_path)

    return execute


def test_the_models_of_both_axes_are_left_with_the_recordings(
    finished: Callable[..., int], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    studied: list[Any] = []
    monkeypatch.setattr(identify_antenna, "study", lambda *given: studied.append(given) or [])
    assert finished() == 0
    with np.load(tmp_path / "recordings.npz") as saved:
        assert saved["elevation_input_rad_s"].shape == (2, 64)
        assert saved["azimuth_sample_s"] == 0.02
    ((recordings, held_out),) = studied
    assert (sorted(recordings), held_out) == (["azimuth", "elevation"], 1)
    assert (tmp_path / "models.json").is_file()
    assert "valid band" in capsys.readouterr().out


def test_recordings_without_a_model_are_kept(
    finished: Callable[..., int], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def refuse(*_: Any) -> None:
        raise ValueError("azimuth: no coherence")

    monkeypatch.setattr(identify_antenna, "study", refuse)
    assert finished() == 1
    assert (tmp_path / "recordings.npz").is_file()
    assert not (tmp_path / "models.json").exists()
    assert "no model: azimuth: no coherence" in capsys.readouterr().err


@pytest.mark.parametrize(("error", "code"), [(EndedEarlyError("in the wind"), None), (None, 2), (None, 1)])
def test_an_experiment_that_did_not_end_leaves_nothing(
    finished: Callable[..., int], error: Exception | None, code: int | None, tmp_path: Path
) -> None:
    assert finished(error, code) == (code or 1)
    assert list(tmp_path.iterdir()) == []
