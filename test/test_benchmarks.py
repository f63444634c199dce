"""The driver of the benchmarks: it knows every one of them, and one that fails is reported."""

import subprocess
import sys

import pytest

from test.scripts import ROOT, script_module

driver = script_module("benchmarks/run.py")


def test_every_benchmark_is_run_quickly_or_named_among_those_that_are_not() -> None:
    named = [*driver.QUICK, *driver.WALL_TIME, *driver.MINUTES, *driver.PARTS, "run"]
    assert sorted(named) == sorted(path.stem for path in (ROOT / "benchmarks").glob("*.py"))


def test_a_benchmark_that_is_refused_its_arguments_has_failed() -> None:
    assert driver.run("period_calls", "--periods none", 60.0).code == 2


def test_a_benchmark_that_takes_too_long_is_ended_without_a_code() -> None:
    assert driver.run("arrays", "", 0.1).code is None


@pytest.mark.parametrize("name", ["soak", "slews_on_a_drive"])
def test_what_runs_in_wall_time_can_be_run_on_a_busy_machine(name: str) -> None:
    script = [sys.executable, str(ROOT / f"benchmarks/{name}.py"), "--help"]
    assert "--busy" in subprocess.run(script, capture_output=True, text=True, timeout=60, check=True).stdout
