"""The conformance report: sound drives pass every line, and each fault fails the line of its name."""

import math
import re
from dataclasses import replace
from pathlib import Path

import pytest

from rf_pointing.commands import check_drive
from rf_pointing.commands.check_drive import flown_rad
from rf_pointing.core import Line, Pair
from rf_pointing.drives import DriveParams, LinkParams, RotatorParams, SimulatedRotator, make_drive
from rf_pointing.drives.conformance import ConformanceCheck
from rf_pointing.drives.drive import RATE, Capabilities, Drive, DriveReading
from rf_pointing.station.derive.band import nearest_within
from rf_pointing.station.description import read_station, shipped_stations
from test.drives.benches import BOTH_AXES, TICK_S, Bench
from test.drives.rotctld import RealRotctld
from test.drives.simulators import Easycomm, Gs232, Rotctld, Simulator


def ticking(drive: Drive, params: DriveParams) -> ConformanceCheck:
    """Return a check for which each look at the clock takes a tick."""
    ticks = iter(range(1_000_000))
    return ConformanceCheck(drive, params, lambda _: TICK_S * next(ticks))


def report(bench: Bench) -> dict[str, Line]:
    def tick(_: float) -> float:
        bench.tick(TICK_S)
        return bench.t_s

    check = ConformanceCheck(bench.drive, bench.params, tick)
    return {line.name: line for line in check_drive.check(check, move=True)}


@pytest.mark.parametrize("name", BOTH_AXES)
def test_a_sound_drive_passes_every_line(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    bench = Bench(name, travel_max_rad=(math.radians(450.0), math.radians(180.0)))
    lines = report(bench)
    bench.close()
    assert [line.name for line in lines.values() if not line.passed] == []
    assert len(lines) == 6 + 10 + 3 - 1
    assert "pass  azimuth sign" in capsys.readouterr().out


def failed(bench: Bench) -> set[str]:
    names = {name for name, line in report(bench).items() if not line.passed}
    bench.close()
    return names


def test_a_device_outside_its_travel_does_not_move() -> None:
    bench = Bench("gs232", travel_min_rad=(math.radians(130.0), 0.0))
    lines = report(bench)
    sent = len(bench.device.set_points)
    bench.close()
    assert [line.name for line in lines.values() if not line.passed] == ["travel"]
    assert sent == 0


def test_noise_and_lost_answers_are_losses() -> None:
    bench = Bench("gs232")
    bench.device.noise = b"\x00}\r\n"
    assert "losses" in failed(bench)


def test_a_device_that_is_not_there_is_one_line() -> None:
    params = DriveParams(type="gs232", link=LinkParams(device="/dev/nothing"))
    (line,) = check_drive.check(ticking(make_drive(params), params), move=True)
    assert not line.passed
    assert "/dev/nothing" in line.text


def test_before_the_first_check_no_time_passes() -> None:
    waited: list[float] = []
    drive = SimulatedRotator(DriveParams(type="simulated_rotator", rotator=RotatorParams()), (1.0, 0.5))
    ConformanceCheck(drive, DriveParams(), lambda longest_s: float(waited.append(longest_s) or 0.0))
    assert waited == [0.0]


def test_a_simulated_rotator_passes() -> None:
    params = DriveParams(type="simulated_rotator", rotator=RotatorParams())
    lines = check_drive.check(ticking(SimulatedRotator(params, (1.0, 0.5)), params), move=True)
    assert [line.name for line in lines if not line.passed] == []


@pytest.mark.parametrize("start_deg", [(5.0, 4.0), (445.0, 176.0)])
def test_a_sound_drive_near_an_end_of_its_travel_is_moved_towards_the_middle(start_deg: Pair) -> None:
    bench = Bench("easycomm 2", Easycomm(start_deg), travel_max_rad=(math.radians(450.0), math.radians(180.0)))
    assert failed(bench) == set()


class RateDrive(Drive):
    """A drive that takes rates: it stops by itself when none came for half a second.

    `creep`: the share of the last rate that is left when it is stale.
    `runs_on_s`: how long it goes on after a stop; `leak`: the rate of the azimuth from then on until it is enabled.
    `drifts_s`: until when it drifts.  `turns`: the rates that it was given.
    `latches`: after a stop it takes rates only when it has been enabled again.
    The faults: `gain` of each axis, `forgets` whether it stops by itself, `crossed` the axes, `stops` whether a stop does
    anything, `late_s` how old its readings are, `every` how many readings it leaves out.
    """

    def __init__(self, start_deg: Pair = (20.0, 30.0)) -> None:
        self.capabilities = Capabilities(
            set_points=RATE, resolution_rad=(1e-4, 1e-4), rate_rad_s=(0.05, 0.03), period_s=TICK_S
        )
        self.gain, self.forgets, self.crossed, self.stops = [1.0, 1.0], True, False, True
        self.late_s, self.every, self.drift = 0.0, 1, 0.0
        self.latches, self.held = False, False
        self.asked, self.creep = [0.0, 0.0], 0.0
        self.position, self.rate = [math.radians(angle) for angle in start_deg], [0.0, 0.0]
        self.least = list(self.position)
        self.most = list(self.position)
        self.t_s = self.taken_s = 0.0
        self.count, self.reading = 0, None
        self.drifts_s, self.runs_on_s, self.leak = math.inf, 0.0, 0.0
        self.stopped_s, self.turns = math.inf, []

    def step(self, t_s: float) -> DriveReading | None:
        if self.forgets and t_s - self.taken_s > 0.5:
            self.rate = [self.creep * each for each in self.asked]
        if t_s - self.stopped_s > self.runs_on_s:
            self.rate, self.asked = [self.leak, 0.0], [0.0, 0.0]
        drift = self.drift if t_s < self.drifts_s else 0.0
        for axis in (0, 1):
            self.position[axis] += (self.rate[axis] + drift) * (t_s - self.t_s)
            self.least[axis] = min(self.least[axis], self.position[axis])
            self.most[axis] = max(self.most[axis], self.position[axis])
        self.t_s, self.count = t_s, self.count + 1
        if self.count % self.every == 0:
            self.reading = DriveReading(t_s=t_s - self.late_s, position_rad=(self.position[0], self.position[1]))
        return self.reading

    def enable(self) -> None:
        self.held, self.stopped_s = False, math.inf

    def turn(self, rate_rad_s: Pair) -> None:
        if self.held:
            return
        self.taken_s = self.t_s
        self.turns.append(rate_rad_s)
        rate = rate_rad_s[::-1] if self.crossed else rate_rad_s
        self.rate = self.asked = [gain * each for gain, each in zip(self.gain, rate, strict=True)]

    def stop(self) -> None:
        if self.stops:
            self.stopped_s, self.held = self.t_s, self.latches
            if not self.runs_on_s:
                self.rate, self.asked = [0.0, 0.0], [0.0, 0.0]


def failed_rates(drive: RateDrive) -> set[str]:
    travel = {"travel_min_rad": (0.0, 0.0), "travel_max_rad": (math.radians(200.0), math.radians(90.0))}
    check = ticking(drive, DriveParams(rotator=RotatorParams(**travel)))
    return {line.name for line in check_drive.check(check, move=True) if not line.passed}


@pytest.mark.parametrize("start_deg", [(20.0, 30.0), (195.0, 86.0), (5.0, 4.0)])
def test_a_sound_drive_of_rates_passes_moves_10_deg_inward_and_comes_back(start_deg: Pair) -> None:
    drive = RateDrive(start_deg)
    assert failed_rates(drive) == set()
    for axis, (start, end) in enumerate(zip(start_deg, (200.0, 90.0), strict=True)):
        inward = 1.0 if start < 0.5 * end else -1.0
        moved = [math.degrees(edge) - start for edge in (drive.least[axis], drive.most[axis])]
        # 10 deg or 20 s, 2 s in which the rate is measured, and 1 s at a tenth of the rate for the stale command.
        rate_deg_s = 0.3 * math.degrees(drive.capabilities.rate_rad_s[axis])
        way_deg = min(10.0, 20.0 * rate_deg_s) + 2.0 * rate_deg_s
        assert max(each * inward for each in moved) == pytest.approx(way_deg, abs=1.0)
        assert min(each * inward for each in moved) > -1.0
        # Back, and on for the second of the stale command and the half one until it is forgotten.
        stale_deg = 1.5 * 0.1 * math.degrees(drive.capabilities.rate_rad_s[0]) if axis == 0 else 0.0
        assert math.degrees(drive.position[axis]) == pytest.approx(start + stale_deg, abs=0.1)
        # At three tenths of the largest rate, and the stale command at a tenth of that of the azimuth for a second.
        assert max(abs(turn[axis]) for turn in drive.turns) == pytest.approx(0.3 * drive.capabilities.rate_rad_s[axis])
    assert drive.turns[-1] == pytest.approx((0.1 * drive.capabilities.rate_rad_s[0], 0.0))
    assert drive.turns.count(drive.turns[-1]) == pytest.approx(51, abs=2)


def test_a_drive_without_elevation_moves_its_azimuth_alone() -> None:
    drive = RateDrive()
    drive.capabilities = replace(drive.capabilities, has_elevation=False)
    params = DriveParams(rotator=RotatorParams(travel_max_rad=(math.radians(200.0), math.radians(90.0))))
    names = {line.name for line in ticking(drive, params).moving()}
    assert {"azimuth sign", "azimuth rate", "azimuth stop"} <= names
    assert not {name for name in names if "elevation" in name}
    assert all(turn[1] == 0.0 for turn in drive.turns)


class Logged(SimulatedRotator):
    """A simulated rotator that notes where its model is when it is stopped."""

    def __init__(self, params: DriveParams, position_rad: Pair) -> None:
        super().__init__(params, position_rad)
        self.stops: list[list[float]] = []

    def stop(self) -> None:
        self.stops.append([math.degrees(each) for each in self.model.position_rad])
        super().stop()


DEG = math.pi / 180.0
SLOW = RotatorParams(
    rate_rad_s=(1.5 * DEG, 1.0 * DEG), resolution_rad=(0.1 * DEG, 0.2 * DEG), latency_s=0.3, minimum_interval_s=0.4,
    zero_rad=(-100.0 * DEG, 5.0 * DEG), travel_min_rad=(-180.0 * DEG, 5.0 * DEG), travel_max_rad=(260.0 * DEG, 95.0 * DEG),
)  # fmt: skip


def slow_report(start_deg: Pair, **changes: object) -> tuple[dict[str, Line], Logged, list[float]]:
    params = DriveParams(type="simulated_rotator", rotator=SLOW, link=LinkParams(poll_period_s=0.25))
    drive, ticks, waited = Logged(params, (start_deg[0] * DEG, start_deg[1] * DEG)), iter(range(100_000)), []
    drive.capabilities = replace(drive.capabilities, **changes)
    check = ConformanceCheck(drive, params, lambda longest_s: waited.append(longest_s) or TICK_S * next(ticks))
    lines = check.still()
    if all(line.passed for line in lines):
        lines += check.moving()[:-1]
    return {line.name: line for line in lines}, drive, waited


def numbers(line: Line) -> list[float]:
    return [float(each) for each in re.findall(r"[-+]?\d+\.?\d*", line.text)]


def test_the_report_has_the_figures_of_the_drive() -> None:
    lines, drive, waited = slow_report((-50.0, 20.0))
    assert [name for name, line in lines.items() if not line.passed] == []
    expected = {
        "connection": [0.02], "period of readings": [12, 3, 12],
        "age of readings": [0.0, 0.0, 0.0, 1.0], "rest": [0.0, 0.0, 0.15, 0.3],
        "travel": [-50.0, 20.0, -180.0, 5.0, 260.0, 95.0], "azimuth sign": [10.0, 10.0, 0.0],
        "azimuth arrival": [0.0, 0.2], "azimuth rate": [1.5, 1.5], "azimuth latency": [0.3, 0.3],
        "elevation sign": [10.0, 10.0, 0.0], "elevation arrival": [0.0, 0.4],
        "elevation rate": [1.0, 1.0], "elevation latency": [0.3, 0.3], "limits": [95.0, 95.0],
        "rest after a stop": [0.0, 0.0, 0.15, 0.3],
    }  # fmt: skip
    for name, values in expected.items():
        assert numbers(lines[name]) == pytest.approx(values, abs=0.06), name
    assert lines["losses"].text == "nothing was lost"
    assert set(waited) == {0.0, 0.02}
    # On the way back a command takes 0.9 s, of which a motion must last 0.4 s to be one; then it is half the way.
    for axis, (out_deg, rate) in enumerate(((-50.0 + 100.0 + 10.0, 1.5), (20.0 - 5.0 + 10.0, 1.0))):
        assert drive.stops[axis][axis] == pytest.approx(out_deg - 0.5 * rate - 5.0, abs=0.1)
    # Until the next reading, at most 0.25 s and a step, the report sees the axis where it was.
    assert 0.0 <= numbers(lines["azimuth stop"])[0] <= 0.25 * 1.5 + 0.2
    assert [math.degrees(each) for each in drive.model.position_rad] == pytest.approx([50.0, 15.0], abs=0.2)


def test_losses_are_named_with_their_counts() -> None:
    drive = SimulatedRotator(DriveParams(type="simulated_rotator"), (1.0, 0.5))
    drive.losses.update({"noise": 5})
    ticks = iter(range(10_000))

    def tick(_: float) -> float:
        count = next(ticks)
        if count == 50:
            drive.losses.update({"noise": 3, "late answer": 9, "connection": 0})
        return TICK_S * count

    line = ConformanceCheck(drive, DriveParams(), tick).still()[-1]
    assert (line.name, line.passed, line.text) == ("losses", False, "noise: 3")


def test_a_rate_is_not_judged_from_a_single_reading_on_the_way() -> None:
    """6 deg/s, read every 1.5 s: between 15 and 85 % of 10 deg there is one reading at most."""
    params = DriveParams(type="simulated_rotator", link=LinkParams(poll_period_s=1.5))
    check = ticking(SimulatedRotator(params, (1.0, 0.5)), params)
    assert check.still()[0].passed
    lines = {line.name: line for line in check.moving()}
    for name in ("azimuth rate", "elevation rate"):
        assert (lines[name].passed, lines[name].text) == (True, "the way is too short to measure it")


@pytest.mark.parametrize(
    ("changes", "lines"),
    [
        ({"gain": [-1.0, 1.0]}, {"azimuth sign", "azimuth rate"}),
        ({"gain": [1.0, -1.0]}, {"elevation sign", "elevation rate"}),
        ({"gain": [1.0, 0.7]}, {"elevation rate"}), ({"gain": [1.3, 1.0]}, {"azimuth rate"}),
        ({"gain": [0.8, 1.2]}, set()),
        ({"crossed": True}, {"azimuth sign", "azimuth rate", "elevation sign", "elevation rate"}),
        ({"forgets": False}, {"stale command"}),
        ({"forgets": False, "latches": True}, {"stale command"}),
        ({"forgets": False, "stops": False}, {"azimuth stop", "elevation stop", "stale command", "rest after a stop"}),
        ({"late_s": 3.0}, {"age of readings"}), ({"late_s": -0.5}, {"age of readings"}),
        ({"every": 2}, {"period of readings"}), ({"drift": 1e-3}, {"rest"}),
        # In 1.5 s by 1.7 and by 1.3 steps of its encoders; until shortly before the middle of the 3 s.
        ({"drift": 1.15e-4}, {"rest"}), ({"drift": 0.85e-4}, set()),
        ({"drift": 1e-3, "drifts_s": 1.3}, set()), ({"late_s": -1.2e-3}, {"age of readings"}),
        ({"late_s": -0.9e-3}, set()), ({"held": True}, set()), ({"latches": True}, set()),
        # At a tenth of its last rate.
        ({"creep": 0.08}, set()), ({"creep": 0.12}, {"stale command"}),
    ],
)  # fmt: skip
def test_each_fault_of_a_drive_of_rates_fails_the_line_of_its_name(changes: dict[str, object], lines: set[str]) -> None:
    drive = RateDrive()
    for name, value in changes.items():
        setattr(drive, name, value)
    assert failed_rates(drive) == lines


@pytest.mark.parametrize("name", ["gs232 b_azimuth", "gs232 a_azimuth", "gs232", "hamlib"])
def test_a_rotator_without_elevation_passes_and_is_named_as_one(name: str) -> None:
    if name == "hamlib":
        device: Simulator = Rotctld()
        device.kind = b"Az"  # type: ignore[attr-defined]
    else:
        device = Gs232(b="b" in name.split()[-1], elevation=False)
    bench = Bench(name, device, travel_max_rad=(math.radians(450.0), math.radians(180.0)))
    assert not bench.drive.capabilities.has_elevation
    lines = report(bench)
    bench.close()
    assert [line.name for line in lines.values() if not line.passed and line.name != "limits"] == []
    assert "the device has no elevation" in lines["travel"].text
    assert not any(line.startswith("elevation") for line in lines)


STATIONS = [*shipped_stations(), *map(str, sorted(Path(__file__).parents[2].glob("examples/*.yaml")))]


@pytest.mark.parametrize("short_deg", [0.0, 1.0])
@pytest.mark.parametrize("station", STATIONS)
def test_a_device_with_exactly_the_travel_of_a_station_passes_and_one_with_less_does_not(
    station: str, short_deg: float
) -> None:
    mount = read_station(station).content.mount
    (west, east), (low, high) = (axis.travel_deg for axis in mount.pair)
    device = Rotctld((nearest_within(0.0, (west, east)), 0.5 * (low + high)))
    device.travel_deg = (west, east - short_deg), (low, high)
    bench = Bench("hamlib", device)
    rotator = read_station(station).sets("antenna_servo")["drive"].rotator
    params = bench.params.replace(rotator=rotator.replace(zero_rad=(0.0, 0.0)))
    check = ConformanceCheck(bench.drive, params, lambda _: (bench.tick(), bench.t_s)[1], flown_rad=flown_rad(station))
    lines = check.still()
    bench.close()
    assert [each.name for each in lines if not each.passed] == (["travel"] if short_deg else [])
    (line,) = (line for line in lines if line.name == "travel")
    assert f"flown {west:.2f}, {low:.2f} to {east:.2f}, {high:.2f} deg" in line.text
    assert f"the device states {west:.2f}, {low:.2f} to {east - short_deg:.2f}, {high:.2f} deg" in line.text


def test_the_first_step_of_the_documents_passes_on_the_dummy_rotator(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """`rotctld -m 1` and examples/hamlib_rotator.yaml, as own_antenna.md says, on a port of the test's own."""
    real = RealRotctld()
    example = (Path(__file__).parents[2] / "examples" / "hamlib_rotator.yaml").read_text()
    (own := tmp_path / "own.yaml").write_text(re.sub(r"port: \d+", f"port: {real.port}", example))
    monkeypatch.setattr("sys.argv", ["check_drive", "--station", str(own)])
    with pytest.raises(SystemExit) as ended:
        check_drive.main()
    real.kill()
    assert capsys.readouterr().out.splitlines()[-1] == "6 of 6 passed"
    assert ended.value.code == 0
