"""`check_drive` ends the drive whatever happens, and its exit code says how the drive did."""

import math
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from rf_pointing.commands import check_drive
from rf_pointing.core.checks import Line
from rf_pointing.drives import DriveParams
from rf_pointing.station.description import read_station

GOOD, BAD = Line("rest", True, "0.1 mdeg"), Line("losses", False, "3 lost")


class Bench:
    """A drive, and checks of it whose lines the test gives."""

    def __init__(self) -> None:
        self.still, self.moving = [GOOD], [GOOD, GOOD]
        self.events: list[Any] = []
        self.params: Any = None
        self.way_deg = 0.0
        self.interrupted = False

    def stop(self) -> None:
        self.events.append("stop")

    def step(self, t_s: float) -> None:
        self.events.append(t_s)

    def close(self) -> None:
        self.events.append("close")

    def make(self, params: DriveParams) -> "Bench":
        self.params = params
        return self

    def checks(self, _drive: Any, _params: DriveParams, tick: Any, way_rad: float, *_axes: Any) -> Any:
        assert tick is check_drive.tick
        self.way_deg = math.degrees(way_rad)
        return SimpleNamespace(still=self._still, moving=lambda: self.moving)

    def _still(self) -> list[Line]:
        if self.interrupted:
            raise KeyboardInterrupt
        return self.still


@pytest.fixture
def bench(monkeypatch: pytest.MonkeyPatch) -> Bench:
    made = Bench()
    monkeypatch.setattr(check_drive, "make_drive", made.make)
    monkeypatch.setattr(check_drive, "ConformanceCheck", made.checks)
    monkeypatch.setattr(check_drive, "time", SimpleNamespace(time=lambda: 7.0))
    return made


def run(monkeypatch: pytest.MonkeyPatch, *line: str) -> int:
    monkeypatch.setattr(sys, "argv", ["check_drive", *line])
    with pytest.raises(SystemExit) as ended:
        check_drive.main()
    assert isinstance(ended.value.code, int)
    return ended.value.code


@pytest.mark.parametrize(
    ("still", "moving", "move", "code", "printed"),
    [
        ([GOOD], [GOOD, GOOD], True, 0, "3 of 3 passed"),
        ([GOOD], [GOOD, BAD], True, 1, "2 of 3 passed"),
        ([GOOD], [BAD], False, 0, "1 of 1 passed"),
        ([GOOD, BAD, BAD], [GOOD], True, 1, "1 of 3 passed"),
        ([BAD], [GOOD], False, 1, "0 of 1 passed"),
    ],
)
def test_the_exit_code_is_that_of_the_lines_and_motion_needs_all_to_be_well(
    still: list[Line], moving: list[Line], move: bool, code: int, printed: str, bench: Bench,
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    bench.still, bench.moving = still, moving
    assert run(monkeypatch, "--station", "dss13", *(["--move"] if move else [])) == code
    moved = move and BAD not in still
    lines = [str(line) for line in (still + moving if moved else still)]
    assert capsys.readouterr().out.splitlines() == [*lines, printed]
    # The stop reaches the device with the next step.
    assert bench.events == ["stop", 7.0, "close"]


def test_an_interrupted_check_stops_the_drive(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    bench.interrupted = True
    assert run(monkeypatch, "--station", "dss13") == 2
    assert bench.events == ["stop", 7.0, "close"]


@pytest.mark.parametrize(("line", "way_deg"), [([], 10.0), (["--degrees", "0.1"], 0.1), (["--degrees", "90"], 90.0)])
def test_the_axes_are_moved_by_ten_degrees_or_as_stated(
    line: list[str], way_deg: float, bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    run(monkeypatch, "--station", "dss13", *line)
    assert bench.way_deg == pytest.approx(way_deg)


@pytest.mark.parametrize(
    ("line", "complaint"),
    [
        ("--station dss13 --degrees 0.09", "0.09 must be between 0.1 and 90"),
        ("--station dss13 --degrees 91", "91 must be between 0.1 and 90"),
        ("", "--station --params-file is required"),
        ("--station dss13 --params-file a.yaml", "not allowed with"),
        ("--station nowhere", "nowhere"),
    ],
)
def test_without_one_drive_nothing_is_made(
    line: str, complaint: str, bench: Bench, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(monkeypatch, *line.split()) == 2
    assert complaint in capsys.readouterr().err
    assert bench.events == []


def test_the_drive_is_that_of_the_station_or_of_the_files(
    bench: Bench, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    station, files = tmp_path / "roof.yaml", [tmp_path / "a.yaml", tmp_path / "b.yaml"]
    read_station("dss13").write(station, {"drive.type": "hamlib", "wind.anemometer": False})
    run(monkeypatch, "--station", str(station))
    assert bench.params.type == "hamlib"
    for file, text in zip(files, ("type: gs232", "link: {device: /dev/nothing}"), strict=True):
        file.write_text(f"/**/antenna_servo: {{ros__parameters: {{drive: {{{text}}}}}}}")
    run(monkeypatch, "--params-file", str(files[0]), "--params-file", str(files[1]))
    assert (bench.params.type, bench.params.link.device) == ("gs232", "/dev/nothing")
    assert check_drive.read_drive([files[1]], str(station)).type == "hamlib"


@pytest.mark.parametrize("name", ["drive.tpye", "antena.tick_s"])
def test_a_name_that_the_servo_does_not_have_is_refused(name: str, tmp_path: Path) -> None:
    (tmp_path / "a.yaml").write_text(f"/**/antenna_servo: {{ros__parameters: {{{name}: 1}}}}")
    with pytest.raises(ValueError, match=name):
        check_drive.read_drive([tmp_path / "a.yaml"])


def test_a_tick_waits_as_long_as_it_may(monkeypatch: pytest.MonkeyPatch) -> None:
    waits: list[float] = []
    monkeypatch.setattr(check_drive, "time", SimpleNamespace(sleep=waits.append, time=lambda: 9.0))
    assert check_drive.tick(0.02) == 9.0
    assert waits == [0.02]
