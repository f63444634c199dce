"""A clock that was killed goes on where time stood, and one that was not begins at its start."""

from pathlib import Path

import pytest

from rf_pointing.nodes.simulation_clock import ClockMemory

START_S = 1_151_384_000.0


def test_the_newest_time_outlives_the_process(tmp_path: Path) -> None:
    kept = ClockMemory(tmp_path / "clock.time", START_S)
    for tick in range(5):
        kept.keep(START_S + 0.02 * tick, 100.0 + tick)
    assert ClockMemory(tmp_path / "clock.time", START_S).recover(105.0) == START_S + 0.08


@pytest.mark.parametrize(
    ("start_s", "wall_s"), [(START_S, 130.0), (START_S, 50.0), (START_S + 1.0, 101.0)], ids=["late", "reboot", "start"]
)
def test_another_run_begins_anew(tmp_path: Path, start_s: float, wall_s: float) -> None:
    """Longer ago than a graph waits, before the machine was started, or with another beginning of time."""
    ClockMemory(tmp_path / "clock.time", START_S).keep(START_S + 7.0, 100.0)
    assert ClockMemory(tmp_path / "clock.time", start_s).recover(wall_s) is None


def test_an_orderly_end_and_a_broken_file_leave_nothing(tmp_path: Path) -> None:
    path = tmp_path / "clock.time"
    assert ClockMemory(path, START_S).recover(1.0) is None
    kept = ClockMemory(path, START_S)
    kept.keep(START_S + 7.0, 100.0)
    kept.forget()
    assert not path.exists()
    path.write_bytes(b"half")
    assert ClockMemory(path, START_S).recover(101.0) is None
