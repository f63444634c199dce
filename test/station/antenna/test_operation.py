"""An antenna in operation: ticks, faults and files in any order, restarts and full disks among them."""

import json
import math
import tempfile
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, precondition, rule

from rf_pointing.core import JointReading, JointTrajectory
from rf_pointing.planning import WrapCount
from rf_pointing.station.antenna.control_unit import AntennaStatus
from rf_pointing.station.antenna.loops import LoopParams
from rf_pointing.station.antenna.memory import SINCE, AntennaMemory
from rf_pointing.station.antenna.operation import WRAP_EVERY, AntennaOperation, Tick
from rf_pointing.station.antenna.simulated_antenna import AntennaParams, SimulatedAntenna, SimulationParams
from rf_pointing.station.pointing.status import Level
from test.drives.simulators import Gs232
from test.station.driven_antenna import MOTION, Driven
from test.station.stepped_antenna import CALM, STANDING, START_S, TICK_S, ramp

TICKS_A_STATUS = 5


class World:
    """An antenna in operation on a clock of the test, and what it sends."""

    def __init__(
        self, folder: Path | None = None, antenna: Any = None, tick_s: float = TICK_S, state: str = "", wrap: str = ""
    ) -> None:
        self.sent_joints: list[JointReading] = []
        self.truths: list[Any] = []
        self.statuses: list[tuple[AntennaStatus, float]] = []
        self.news: list[str] = []
        self.refused: list[str] = []
        self.ticks, self.wall_s, self.tick_s = 0, 50.0, tick_s
        if folder:
            state, wrap = str(folder / "state.json"), str(folder / "wrap.json")
        start = SimulationParams(start_azimuth_rad=STANDING[0], start_elevation_rad=STANDING[1], tick_s=tick_s)
        memory = AntennaMemory(state)
        self.antenna = antenna or SimulatedAntenna(memory.start(AntennaParams(antenna=start, wind=CALM)))
        self.operation = AntennaOperation(self.antenna, memory, wrap)

    @property
    def t_s(self) -> float:
        return round(START_S + self.tick_s * self.ticks, 6)

    def up(self) -> "World":
        self.note(self.operation.start(self.t_s))
        return self

    def tick(self, count: int = 1, **how: float) -> None:
        for _ in range(count):
            self.ticks, self.wall_s = self.ticks + 1, self.wall_s + self.tick_s
            self.note(self.operation.tick(self.t_s, self.t_s, self.wall_s, **how))

    def note(self, tick: Tick) -> None:
        self.sent_joints += [tick.reading] if tick.reading else []
        self.truths += [tick.boresight] if tick.boresight else []
        self.statuses += [(tick.status, self.operation.lateness_s)] if tick.status else []
        self.refused += tick.refused
        if tick.fault is not None:
            assert self.statuses[-1][0].fault == tick.fault == self.antenna.safety.latch.text
            self.news.append(tick.fault)

    def take(self, command: JointTrajectory, issued_s: float, now_s: float) -> None:
        self.refused += filter(None, [self.operation.take(command, "one", issued_s, now_s)])


@pytest.fixture
def world() -> World:
    return World().up()


class Machine(RuleBasedStateMachine):
    """Commands, requests, faults, restarts and a disk that fails."""

    @initialize()
    def begin(self) -> None:
        self.folder = Path(tempfile.mkdtemp()) / "kept"
        self.world = World(self.folder).up()
        self.disk = True

    @rule(count=st.integers(1, 40))
    def ticks(self, count: int) -> None:
        self.world.tick(count)
        self.check_words(count)

    def check_words(self, ticks: int) -> None:
        """A fault is known in its own tick, and in the file as soon as that can be written.

        Its end is known with the next status.
        """
        fault = self.world.antenna.safety.latch.text
        if fault or ticks >= TICKS_A_STATUS:
            assert self.world.statuses[-1][0].fault == fault
        if self.disk and ticks >= TICKS_A_STATUS:
            assert json.loads((self.folder / "state.json").read_text())["fault"] == fault
            assert self.world.operation.memory_report().message == "kept" or fault

    @rule(late_s=st.sampled_from([-0.05, 0.0, 0.01]))
    def command(self, late_s: float) -> None:
        world = self.world
        world.take(ramp(world.t_s), world.t_s + late_s, world.t_s + 0.015)

    @rule(name=st.sampled_from(["park", "stow", "disable", "resume", "reset_fault", "pause"]))
    def request(self, name: str) -> None:
        getattr(self.world.antenna, name)()

    @rule(words=st.sampled_from(["the door is open", "stop was requested"]))
    def fault(self, words: str) -> None:
        self.world.antenna.stop(words)

    @rule(jumped_s=st.sampled_from([0.0, 1.5]), stalled_s=st.sampled_from([0.0, 1.3]))
    def clock(self, jumped_s: float, stalled_s: float) -> None:
        self.world.tick(jumped_s=jumped_s, stalled_s=stalled_s)
        self.check_words(1)

    @rule()
    def disk_fails_or_comes_back(self) -> None:
        aside = self.folder.with_name("aside")
        if self.disk:
            self.folder.rename(aside)
            self.folder.write_text("")
        else:
            self.folder.unlink()
            aside.rename(self.folder)
        self.disk = not self.disk

    @precondition(lambda self: self.disk)
    @rule(crash=st.booleans())
    def restart(self, crash: bool) -> None:
        old = self.world
        old.tick(TICKS_A_STATUS * WRAP_EVERY)
        fault, place = old.antenna.safety.latch.text, old.antenna.axes.encoder_rad
        if crash:
            fault = fault or "antenna_servo failed: KeyError: 'x'"
            old.operation.fail(fault)
        old.operation.stop()
        self.world = World(self.folder).up()
        latched = self.world.antenna.safety.latch.text
        assert latched.removesuffix(SINCE) == fault.removesuffix(SINCE), "a fault outlives its process"
        assert np.max(np.abs(self.world.antenna.axes.encoder_rad - place)) < 0.2

    @invariant()
    def every_tick_gives_joints_and_truth_and_a_status_comes_each_tenth_of_a_second(self) -> None:
        if not hasattr(self, "world"):
            return
        world = self.world
        assert (len(world.sent_joints), len(world.truths)) == (world.ticks + 1, world.ticks)
        times = [status.t_s for status, _ in world.statuses] + [world.t_s]
        assert max(np.diff(times)) <= TICKS_A_STATUS * TICK_S + 1e-6


TestAnyOrder = Machine.TestCase
TestAnyOrder.settings = settings(max_examples=20, stateful_step_count=25, deadline=None)


@given(after_s=st.floats(0.0, 0.019), rate_rad_s=st.floats(-5e-3, 5e-3))
@settings(max_examples=20, deadline=None)
def test_the_same_pass_results_whether_clock_or_command_arrives_first(after_s: float, rate_rad_s: float) -> None:
    """A command issued at a tick, taken before that tick because the clock was read late, or after it."""
    paths = []
    for early in (True, False):
        world = World().up()
        world.tick(10)
        issued_s = round(world.t_s + TICK_S, 6)
        command = ramp(issued_s, rate_rad_s=rate_rad_s)
        if early:
            world.take(command, issued_s, issued_s + after_s)
        world.tick()
        if not early:
            world.take(command, issued_s, world.t_s + after_s)
        world.tick(60)
        assert world.refused == []
        paths.append([reading.position_rad.tolist() for reading in world.sent_joints])
    assert paths[0] == paths[1]


@pytest.mark.parametrize(
    ("how", "fault", "mode"),
    [
        ({"jumped_s": 1.5}, "the clock jumped by +1.50 s, at most 0.50 s", "fault"),
        ({"stalled_s": 1.3}, "", "parking"),
        ({}, "", "parking"),
    ],
)
def test_a_jump_of_the_clock_is_a_fault_and_a_stall_leaves_the_antenna_its_own_goal(
    world: World, how: dict[str, float], fault: str, mode: str
) -> None:
    world.tick(3)
    assert world.antenna.park() == ""
    world.tick(**how)
    world.tick(100)
    assert (world.antenna.safety.latch.text, world.antenna.mode) == (fault, mode)


def test_a_fault_is_published_in_its_own_tick_and_once_as_is_its_end(world: World) -> None:
    world.tick(6)
    world.antenna.stop("the door is open")
    world.tick(2)
    assert ([one.fault for one, _ in world.statuses[2:]], world.news) == (["the door is open"], ["the door is open"])
    report = world.operation.drive_report(world.t_s)
    assert (report.level, report.message) == (Level.ERROR, "the door is open")
    assert float(report.values["fault_at_s"]) == pytest.approx(world.t_s, abs=0.05)
    world.tick(300)
    assert world.antenna.reset_fault() == ""
    world.tick(1)
    assert world.news == ["the door is open", ""]


@given(waits_s=st.lists(st.floats(0.001, 0.5), min_size=2, max_size=20))
@settings(deadline=None, max_examples=10)
def test_the_lateness_of_a_tick_is_the_wall_time_beyond_the_period(waits_s: list[float]) -> None:
    world = World(tick_s=0.1).up()
    for wait_s in waits_s:
        world.wall_s += wait_s - 0.1
        world.tick()
    lateness_s = [late_s for _, late_s in world.statuses[1:]]
    assert lateness_s == pytest.approx([0.0, *(wait_s - 0.1 for wait_s in waits_s[1:])], abs=1e-9)


# What guards the antenna

WANTED: dict[str, Callable[[LoopParams], LoopParams]] = {
    "travel, rates": lambda loops: loops.replace(
        preprocessor=loops.preprocessor.replace(rate_limit_rad_s=(0.01, 0.01))
    ),
    "the largest rates": lambda loops: loops.replace(azimuth=loops.azimuth.replace(rate_limit_rad_s=0.01)),
    "an oscillation": lambda loops: loops.replace(oscillation=loops.oscillation.replace(threshold_rad=5e-4)),
    "commands far ahead": lambda loops: loops.replace(table=loops.table.replace(horizon_s=60.0)),
}


@pytest.mark.parametrize("words", WANTED)
def test_what_guards_the_antenna_changes_only_while_its_drives_are_disabled(world: World, words: str) -> None:
    present = LoopParams()
    sets = {"plant": AntennaParams().plant, "loops": WANTED[words](present)}
    with pytest.raises(
        ValueError, match=rf"{words}.* cannot change while the drives are enabled \(the antenna is holding"
    ):
        world.operation.check(present, sets, active=True, holder="")
    with pytest.raises(ValueError, match=f"{words}.* cannot change while /pointing_controller commands it"):
        world.operation.check(present, sets, active=False, holder="/pointing_controller")
    world.antenna.disable()
    world.tick(50)
    world.operation.check(present, sets, active=True, holder="/pointing_controller")


# The turn of the azimuth, and the end


@pytest.mark.parametrize("name", ["state", "wrap"])
def test_a_file_that_cannot_be_written_is_refused_before_the_antenna_moves(tmp_path: Path, name: str) -> None:
    (tmp_path / "file").write_text("")
    path = tmp_path / "file" / "kept.json"
    with pytest.raises(ValueError, match=f"{path} cannot be written"):
        World(**{name: str(path)})


def test_an_antenna_whose_disk_fails_goes_on_and_reports_both_files(tmp_path: Path) -> None:
    world, folder = World(tmp_path / "kept").up(), tmp_path / "kept"
    folder.rename(tmp_path / "aside")
    folder.write_text("")
    world.antenna.park()
    world.tick(300)
    report = world.operation.memory_report()
    assert report.level == Level.WARN
    assert all(f"{folder / name} cannot be written" in report.message for name in ("state.json", "wrap.json"))
    assert world.antenna.mode == "parking"
    folder.unlink()
    world.tick(TICKS_A_STATUS * WRAP_EVERY)
    assert world.operation.memory_report()[:2] == (Level.OK, "kept")


def test_a_turn_that_is_not_the_encoder_s_latches_a_fault(tmp_path: Path) -> None:
    wrap = tmp_path / "wrap.json"
    World(tmp_path).up().operation.stop()
    assert json.loads(wrap.read_text())["azimuth_rad"] == pytest.approx(STANDING[0], abs=1e-5)
    assert World(tmp_path).antenna.safety.latch.text == "", "the same turn"
    WrapCount(wrap).keep(STANDING[0] + 2.0 * math.pi)
    doubtful = World(tmp_path)
    assert "the wrap file names another turn than the encoder" in doubtful.antenna.safety.latch.text
    doubtful.up().tick(TICKS_A_STATUS * WRAP_EVERY)
    assert json.loads(wrap.read_text())["azimuth_rad"] > 6.0, "a fault leaves the turn of before it in the file"


@pytest.mark.parametrize("moved_deg", [0.0, 12.0, -170.0])
def test_a_drive_that_reads_all_turns_leaves_none_in_doubt_wherever_it_ran_on_to(
    tmp_path: Path, moved_deg: float
) -> None:
    driven = Driven("gs232")
    azimuth_rad = float(driven.antenna.axes.encoder_rad[0]) + math.radians(moved_deg)
    (tmp_path / "wrap.json").write_text(json.dumps({"azimuth_rad": azimuth_rad}))
    world = World(tmp_path, driven.antenna)
    assert world.antenna.safety.latch.text == ""
    kept = json.loads((tmp_path / "wrap.json").read_text())["azimuth_rad"]
    assert kept == pytest.approx(azimuth_rad - math.radians(moved_deg))


@pytest.mark.parametrize("kept_deg", [370.0, None])
def test_a_one_turn_azimuth_needs_a_kept_turn(tmp_path: Path, kept_deg: float | None) -> None:
    device = Gs232(start_deg=(370.0, 45.0))
    device.one_turn = True
    motion = MOTION.replace(travel_min_rad=(0.0, 0.0), travel_max_rad=(math.radians(450.0), math.pi))
    driven = Driven("gs232", device, motion=motion, zero_rad=(0.0, 0.0), reads_one_turn=True)
    if kept_deg:
        (tmp_path / "wrap.json").write_text(json.dumps({"azimuth_rad": math.radians(kept_deg)}))
    world = World(tmp_path if kept_deg else None, driven.antenna)
    if kept_deg:
        assert math.degrees(world.antenna.axes.encoder_rad[0]) == pytest.approx(kept_deg)
    else:
        assert "no wrap_file keeps its turn: look at the cables, then reset" in world.antenna.safety.latch.text


def test_a_stop_that_fails_leaves_the_brakes(world: World, monkeypatch: pytest.MonkeyPatch) -> None:
    def fails() -> None:
        raise RuntimeError("no answer")

    world.tick(3)
    monkeypatch.setattr(world.antenna, "deactivate", fails)
    with pytest.raises(RuntimeError, match="no answer"):
        world.operation.stop()
    assert world.antenna.safety.latch.text == "the stop has failed: no answer"
    assert not world.antenna.hardware.powered


# A drive


def test_a_lost_drive_refuses_the_start_and_its_report_says_so() -> None:
    driven = Driven("gs232")
    world = World(antenna=driven.antenna)
    report = world.operation.device_report(driven.t_s)
    assert (report.level, report.message) == (Level.OK, "gs232")
    assert {"set_points", "azimuth_starts", "elevation_reversals", "latency_s", "age_s", "status"} <= set(report.values)
    driven.device.silent = True
    driven.run(3.0)
    with pytest.raises(ValueError, match="drive lost"):
        world.operation.start(driven.t_s)
    assert world.operation.device_report(driven.t_s).level == Level.ERROR


def test_an_oscillating_axis_is_an_error_with_its_swings(world: World, monkeypatch: pytest.MonkeyPatch) -> None:
    assert world.operation.oscillation_report()[:2] == (Level.OK, "none")
    calm = SimpleNamespace(oscillating=False, reason="", state=SimpleNamespace(row=[]))
    wild = SimpleNamespace(oscillating=True, reason="0.3 deg at 1.2 Hz", state=SimpleNamespace(row=[1, 2, 3]))
    monkeypatch.setattr(world.antenna.axes.loops, "watch", [calm, wild])
    assert world.operation.oscillation_report() == (
        Level.ERROR, "elevation: 0.3 deg at 1.2 Hz", {"azimuth_swings_in_a_row": 0, "elevation_swings_in_a_row": 3},
    )  # fmt: skip
