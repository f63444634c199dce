"""The environment of the scripts: made once, kept under running processes; and what `pip install .` brings."""

import ast
import platform
import re
import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
STUBS = """
has_jazzy() { false; }
need() { :; }
make_wheel_environment() {
  mkdir -p "$STATE/env/bin"
  printf '#!/bin/sh\\necho Python VERSION\\n' > "$STATE/env/bin/python"
  chmod +x "$STATE/env/bin/python"
  echo made >> "$STATE/made"
}
install_wheels() { echo "$@" >> "$STATE/added"; }
build_interfaces() {
  mkdir -p "$STATE/install"
  ! grep -q broken "$ROOT/msg_defs/one.txt" || return 1
  touch "$STATE/install/local_setup.bash"
  echo built >> "$STATE/interfaces-built"
}
build_workspace() { :; }
""".replace("VERSION", platform.python_version())


@pytest.fixture
def root(tmp_path: Path) -> Path:
    (tmp_path / "scripts").mkdir()
    shutil.copy(ROOT / "scripts/environment.sh", tmp_path / "scripts")
    shutil.copytree(ROOT / "requirements", tmp_path / "requirements")
    for folder in ("msg_defs", "extern", "config", "launch"):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "one.txt").touch()
    for name in ("setup.py", "setup.cfg", "package.xml"):
        (tmp_path / name).touch()
    return tmp_path


def enter(root: Path, then: str = ":") -> subprocess.CompletedProcess[str]:
    script = f'set -euo pipefail; . "{root}/scripts/environment.sh"; {STUBS} enter_environment; {then}'
    return subprocess.run(["bash", "-c", script], capture_output=True, text=True, timeout=60)


def times_made(root: Path, what: str = "made") -> int:
    return len((root / ".ros" / what).read_text().splitlines())


def test_environment_is_made_once_and_whatever_python_comes_first_on_the_path(root: Path) -> None:
    other = root / "other"
    other.mkdir()
    (other / "python3").write_text("#!/bin/sh\necho Python 3.13.1\n")
    (other / "python3").chmod(0o755)
    assert enter(root).returncode == 0
    assert enter(root, f"export PATH={other}:$PATH; enter_environment").returncode == 0
    assert times_made(root) == 1


def test_wheels_of_the_tests_come_with_the_tests_and_stay_as_long_as_the_environment(root: Path) -> None:
    added = root / ".ros/added"
    enter(root)
    assert not added.exists()
    for _ in range(2):
        enter(root, "enter_environment tests")
    assert added.read_text() == "test extras\n"


def test_interfaces_are_built_again_only_if_one_changed(root: Path) -> None:
    enter(root)
    (root / "setup.py").write_text("# another executable\n")
    enter(root)
    (root / "launch/other.py").touch()
    enter(root)
    built = root / ".ros/interfaces-built"
    assert built.read_text().count("built") == 1
    (root / "msg_defs/one.txt").write_text("float64 angle\n")
    enter(root)
    assert built.read_text().count("built") == 2
    # What a build that failed has begun to replace is made again.
    for text, count in (("broken", 2), ("float64 angle\n", 3)):
        (root / "msg_defs/one.txt").write_text(text)
        enter(root)
        assert built.read_text().count("built") == count


def test_compiled_files_are_kept_in_the_state_where_they_may_not_be_beside_the_sources(root: Path) -> None:
    show = "python3 -c 'import sys; print(sys.dont_write_bytecode, sys.pycache_prefix)'"
    there = enter(root, f"unset PYTHONPYCACHEPREFIX; export PYTHONDONTWRITEBYTECODE=1; enter_environment; {show}")
    assert there.stdout == f"False {root / '.ros/bytecode'}\n"


@pytest.mark.parametrize(
    ("changed", "made"), [("requirements/runtime.txt", "made"), ("msg_defs/one.txt", "interfaces-built")]
)
def test_what_is_in_use_is_not_replaced(root: Path, changed: str, made: str) -> None:
    enter(root)
    # As scripts/run does: the process replaces the shell and keeps its lock.
    running = subprocess.Popen(
        ["bash", "-c", f'. "{root}/scripts/environment.sh"; {STUBS} enter_environment; echo in; exec sleep 60'],
        stdout=subprocess.PIPE,
    )
    try:
        assert running.stdout is not None
        assert running.stdout.readline() == b"in\n"
        (root / changed).write_text("numpy==2.0\n")
        refused = enter(root)
        assert refused.returncode == 1
        assert "processes run from it: end them first" in refused.stderr
        assert times_made(root, made) == 1
    finally:
        running.kill()
        running.communicate()
    assert enter(root).returncode == 0
    assert times_made(root, made) == 2


def test_pip_brings_every_library_of_the_core_in_the_version_that_is_tested() -> None:
    tree = ast.parse((ROOT / "setup.py").read_text())
    (libraries,) = [
        ast.literal_eval(node.value)
        for node in tree.body
        if isinstance(node, ast.Assign) and getattr(node.targets[0], "id", "") == "LIBRARIES"
    ]
    oldest = dict((re.split(">=|$", line, maxsplit=1)[:2]) for line in libraries)
    pinned = {}
    for name in ("numeric", "runtime"):
        lines = (ROOT / f"requirements/{name}.txt").read_text().splitlines()
        pinned |= dict(line.split("==") for line in lines if line and not line.startswith("#"))
    assert oldest.keys() == pinned.keys()
    for name, version in oldest.items():
        assert [int(part) for part in version.split(".") if part] <= [int(part) for part in pinned[name].split(".")]


def test_every_script_that_runs_tests_brings_their_libraries() -> None:
    """A clone has neither pytest-timeout nor hypothesis until a script asks for them."""
    scripts = {path.name: path.read_text() for path in (ROOT / "scripts").iterdir() if path.suffix == ""}
    running = [name for name, text in scripts.items() if "-m pytest" in text]
    assert {"soak", "test"} <= set(running)
    assert [name for name in running if "\nenter_environment tests\n" not in scripts[name]] == []
