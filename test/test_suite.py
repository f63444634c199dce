"""A test that dies or hangs costs itself only, and a limit in wall time follows the machine."""

import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from test import conftest

ROOT = Path(__file__).parents[1]
GOOD = """
import ctypes, os, time
import pytest

@pytest.mark.parametrize("number", range(30))
def test_before(number):
    pass

{bad}

@pytest.mark.parametrize("number", range(30))
def test_after(number):
    time.sleep(0.01)
"""
DIES = "def test_dies():\n    os._exit(3)"
HANGS = "def test_hangs():\n    while True:\n        time.sleep(0.1)"
# A lock that its owner takes again: no signal ends that wait.
DEAD = """
def test_hangs_in_a_library():
    lock = ctypes.create_string_buffer(64)
    for _ in range(2):
        ctypes.CDLL(None).pthread_mutex_lock(lock)
"""


def options() -> list[str]:
    """Return what scripts/test gives pytest so that tests do not end each other."""
    script = (ROOT / "scripts" / "test").read_text()
    names = ["APART"] if pytest.version_tuple >= (8, 4) else ["APART", "OLD"]
    return [word for name in names for word in shlex.split(re.findall(rf"^{name}=\((.*)\)$", script, re.M)[0])]


def test_tests_that_die_or_hang_fail_and_all_others_run(tmp_path: Path) -> None:
    for name, bad in (("one", DIES), ("two", DIES), ("three", HANGS), ("four", DEAD)):
        (tmp_path / f"test_{name}.py").write_text(GOOD.format(bad=bad))
    (tmp_path / "conftest.py").write_text((ROOT / "test" / "by_file.py").read_text())
    (tmp_path / "pytest.ini").write_text("[pytest]\ntimeout = 2\n")
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-n", "2", *options()]
    quick = ["-o", "faulthandler_timeout=5"]
    run = subprocess.run([*command, *quick], cwd=tmp_path, capture_output=True, text=True, check=False)
    failed = re.findall(r"^FAILED test_(\w+)\.py::test_(dies|hangs\w*)", run.stdout, re.MULTILINE)
    assert sorted(failed) == [("four", "hangs_in_a_library"), ("one", "dies"), ("three", "hangs"), ("two", "dies")]
    assert "4 failed, 240 passed" in run.stdout, run.stdout[-3000:]


def test_a_limit_in_wall_time_grows_with_the_slowness(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(conftest, "slowness", lambda: 3.0)
    assert [conftest.within(taken_s, 2.0) for taken_s in (1.9, 5.9, 6.1)] == [True, True, False]


def test_a_machine_that_is_too_slow_skips_a_test_that_missed_its_limit(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(conftest, "slowness", lambda: conftest.TOO_SLOW + 1.0)
    assert conftest.within(1.9, 2.0)
    with pytest.raises(pytest.skip.Exception, match="this machine is too slow for this test: 9 times"):
        conftest.within(100.0, 2.0)
