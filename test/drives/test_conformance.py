"""The conformance report: sound drives pass every line, and each fault fails the line of its name."""

import math
from pathlib import Path

import pytest

from rf_pointing.commands import check_drive
from rf_pointing.drives import DriveParams, RotatorParams, SimulatedRotator
from rf_pointing.drives.conformance import ConformanceCheck, Line
from rf_pointing.drives.drive import RATE, Capabilities, Drive, DriveReading, Pair
from test.drives.benches import BOTH_AXES, TICK_S, Bench
from test.drives.simulators import Easycomm


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


def test_a_wrong_sign_crossed_axes_and_a_wrong_speed_are_found() -> None:
    bench = Bench("easycomm 2")
    go = bench.device._go
    bench.device._go = lambda azimuth, elevation: go(240.0 - azimuth, elevation)
    assert "azimuth sign" in failed(bench)
    bench = Bench("easycomm 2")
    bench.device._go = lambda azimuth, elevation, to=bench.device._go: to(
        120.0 + elevation - 45.0, azimuth - 120.0 + 45.0
    )
    assert {"azimuth sign", "elevation sign"} <= failed(bench)
    bench = Bench("easycomm 2", rate_rad_s=(math.radians(3.0),) * 2)
    assert {"azimuth rate", "elevation rate"} <= failed(bench)


def test_a_stop_that_does_nothing_is_found() -> None:
    bench = Bench("easycomm 2")
    bench.device._stop = lambda: None
    bench.device.model.params = bench.device.model.params.replace(rate_rad_s=(math.radians(1.0),) * 2)
    assert "azimuth stop" in failed(bench)


def test_limits_that_do_not_cut_a_set_point_are_found() -> None:
    """A rotator layer without limits: nothing that is sent may be beyond the travel, and something must be sent."""
    bench = Bench("easycomm 2")
    lines = report(bench)
    assert "180.0 deg is cut to 180.0 deg" in lines["limits"].text
    bench.close()
    bench = Bench("easycomm 2")
    check = ConformanceCheck(bench.drive, bench.params, lambda _: bench.tick(TICK_S) and bench.t_s)
    check.still()
    check._rotator.follow = lambda *_: None
    assert not check._beyond().passed
    check._rotator.follow = lambda *_: check._drive.go_to((1.0, 4.0))
    assert not check._beyond().passed
    bench.close()


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


def test_a_device_that_is_not_there_is_one_line(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    (file := tmp_path / "drive.yaml").write_text(
        "/**/antenna_servo: {ros__parameters: {drive: {type: gs232, link: {device: /dev/nothing}}}}"
    )
    params = check_drive.read_drive([file])
    assert (params.type, params.link.device) == ("gs232", "/dev/nothing")
    now = iter(range(10_000))
    from rf_pointing.drives import make_drive

    check = ConformanceCheck(make_drive(params), params, lambda _: 0.02 * next(now))
    (line,) = check_drive.check(check, move=True)
    assert not line.passed
    assert "/dev/nothing" in line.text


def test_before_the_first_check_no_time_passes() -> None:
    waited: list[float] = []
    drive = SimulatedRotator(DriveParams(type="simulated_rotator", rotator=RotatorParams()), (1.0, 0.5))
    ConformanceCheck(drive, DriveParams(), lambda longest_s: float(waited.append(longest_s) or 0.0))
    assert waited == [0.0]


def test_a_simulated_rotator_passes() -> None:
    params = DriveParams(type="simulated_rotator", rotator=RotatorParams())
    drive = SimulatedRotator(params, (1.0, 0.5))
    now = iter(range(100_000))
    lines = check_drive.check(ConformanceCheck(drive, params, lambda _: 0.02 * next(now)), move=True)
    assert [line.name for line in lines if not line.passed] == []


@pytest.mark.parametrize("start_deg", [(5.0, 4.0), (445.0, 176.0)])
def test_a_sound_drive_near_an_end_of_its_travel_is_moved_towards_the_middle(start_deg: Pair) -> None:
    bench = Bench("easycomm 2", Easycomm(start_deg), travel_max_rad=(math.radians(450.0), math.radians(180.0)))
    assert failed(bench) == set()


class RateDrive(Drive):
    """A drive that takes rates: it stops by itself when none came for half a second.

    `creep`: the share of the last rate that is left when it is stale.
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

    def step(self, t_s: float) -> DriveReading | None:
        if self.forgets and t_s - self.taken_s > 0.5:
            self.rate = [self.creep * each for each in self.asked]
        for axis in (0, 1):
            self.position[axis] += (self.rate[axis] + self.drift) * (t_s - self.t_s)
            self.least[axis] = min(self.least[axis], self.position[axis])
            self.most[axis] = max(self.most[axis], self.position[axis])
        self.t_s, self.count = t_s, self.count + 1
        if self.count % self.every == 0:
            self.reading = DriveReading(t_s=t_s - self.late_s, position_rad=(self.position[0], self.position[1]))
        return self.reading

    def enable(self) -> None:
        self.held = False

    def turn(self, rate_rad_s: Pair) -> None:
        if self.held:
            return
        self.taken_s = self.t_s
        rate = rate_rad_s[::-1] if self.crossed else rate_rad_s
        self.rate = self.asked = [gain * each for gain, each in zip(self.gain, rate, strict=True)]

    def stop(self) -> None:
        if self.stops:
            self.rate, self.held = [0.0, 0.0], self.latches
            self.asked = [0.0, 0.0]


def failed_rates(drive: RateDrive) -> set[str]:
    travel = {"travel_min_rad": (0.0, 0.0), "travel_max_rad": (math.radians(200.0), math.radians(90.0))}
    ticks = iter(range(1_000_000))
    params = DriveParams(rotator=RotatorParams(**travel))
    check = ConformanceCheck(drive, params, lambda _: TICK_S * next(ticks))
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
        assert math.degrees(drive.position[axis]) == pytest.approx(start, abs=1.0)


@pytest.mark.parametrize(
    ("changes", "lines"),
    [
        ({"gain": [-1.0, 1.0]}, {"azimuth sign", "azimuth rate"}),
        ({"gain": [1.0, -1.0]}, {"elevation sign", "elevation rate"}),
        ({"gain": [1.0, 0.7]}, {"elevation rate"}),
        ({"gain": [1.3, 1.0]}, {"azimuth rate"}),
        ({"gain": [0.8, 1.2]}, set()),
        ({"crossed": True}, {"azimuth sign", "azimuth rate", "elevation sign", "elevation rate"}),
        ({"forgets": False}, {"stale command"}),
        ({"forgets": False, "stops": False}, {"azimuth stop", "elevation stop", "stale command", "rest after a stop"}),
        ({"late_s": 3.0}, {"age of readings"}),
        ({"late_s": -0.5}, {"age of readings"}),
        ({"every": 2}, {"period of readings"}),
        ({"drift": 1e-3}, {"rest"}),
    ],
)
def test_each_fault_of_a_drive_of_rates_fails_the_line_of_its_name(changes: dict[str, object], lines: set[str]) -> None:
    drive = RateDrive()
    for name, value in changes.items():
        setattr(drive, name, value)
    found = failed_rates(drive)
    assert lines <= found if lines else found == set()


@pytest.mark.parametrize("latches", [False, True])
def test_only_the_stale_command_fails_where_a_drive_goes_on_for_ever(latches: bool) -> None:
    """It is enabled after each stop, or its rate would not be taken, and stopped at last: it rests then."""
    drive = RateDrive()
    drive.forgets, drive.latches = False, latches
    assert failed_rates(drive) == {"stale command"}
    assert drive.rate == [0.0, 0.0]


def test_a_drive_that_must_be_enabled_after_a_stop_passes() -> None:
    drive = RateDrive()
    drive.latches = True
    assert failed_rates(drive) == set()


@pytest.mark.parametrize(("creep", "fails"), [(0.08, set()), (0.12, {"stale command"})])
def test_a_drive_that_creeps_on_at_a_tenth_of_its_last_rate_fails(creep: float, fails: set[str]) -> None:
    drive = RateDrive()
    drive.creep = creep
    assert failed_rates(drive) == fails
