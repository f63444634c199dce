"""The conformance report: sound drives pass every line, and each fault fails the line of its name."""

import math
from pathlib import Path

import pytest

from rf_pointing.commands import check_drive
from rf_pointing.drives import DriveParams, RotatorParams, SimulatedRotator
from rf_pointing.drives.conformance import ConformanceCheck, Line
from test.drives.benches import BOTH_AXES, TICK_S, Bench


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


def test_a_simulated_rotator_passes() -> None:
    params = DriveParams(type="simulated_rotator", rotator=RotatorParams())
    drive = SimulatedRotator(params, (1.0, 0.5))
    now = iter(range(100_000))
    lines = check_drive.check(ConformanceCheck(drive, params, lambda _: 0.02 * next(now)), move=True)
    assert [line.name for line in lines if not line.passed] == []
