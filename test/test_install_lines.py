"""The README's lines for a machine with ROS 2, run with the genuine rosdep and colcon as far as no network is needed."""

import os
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

ROOT = Path(__file__).parents[1]
LINES = re.search(r"## With a ROS 2 install.*?```\n(.*?)```", (ROOT / "README.md").read_text(), re.DOTALL)[
    1
].splitlines()
ROSDEP = [sys.executable, "-c", "import sys; from rosdep2.main import rosdep_main; rosdep_main(sys.argv[1:])"]
FOLDERS = ("msg_defs", "extern", "config", "launch", "resource", "rf_pointing")


def words(start: str) -> list[str]:
    """Return the one line of the README that holds this, in words."""
    (line,) = (line for line in LINES if start in line)
    return shlex.split(line[line.index(start) :])


def test_the_workflow_runs_the_lines_of_the_readme() -> None:
    workflow = yaml.safe_load((ROOT / ".github/workflows/check.yml").read_text())
    steps = workflow["jobs"]["readme"]["steps"]
    assert "\n".join(LINES[1:]) in next(step["run"] for step in steps if step.get("working-directory") == "ws")


@pytest.fixture(scope="module")
def workspace(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A workspace with the checkout in src/rf_pointing; its package is linked, so that nothing is made in ours."""
    folder = tmp_path_factory.mktemp("ws")
    checkout = folder / "src/rf_pointing"
    checkout.mkdir(parents=True)
    for name in FOLDERS:
        (checkout / name).symlink_to(ROOT / name)
    for name in ("package.xml", "setup.py", "setup.cfg", "pyproject.toml"):
        shutil.copy(ROOT / name, checkout)
    return folder


def run(argv: list[str], folder: Path, **environment: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(argv, cwd=folder, env=os.environ | environment, capture_output=True, text=True, timeout=240)


@pytest.fixture(scope="module")
def rosdep(workspace: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """Environment of a rosdep that knows Ubuntu 24.04 and Jazzy from test/data instead of from the network."""
    pytest.importorskip("rosdep2", reason="rosdep is a library of the tests")
    folder = tmp_path_factory.mktemp("rosdep")
    keys = yaml.safe_load((ROOT / "test/data/rosdep_noble.yaml").read_text())
    distribution = {
        "release_platforms": {"ubuntu": ["noble"]}, "repositories": {}, "type": "distribution",
        "version": 2,
    }  # fmt: skip
    jazzy = {
        "distribution": [f"file://{folder}/distribution.yaml"],
        "distribution_cache": f"file://{folder}/cache.yaml", "distribution_status": "active",
        "distribution_type": "ros2", "python_version": 3,
    }  # fmt: skip
    cache = {
        "distribution_file": [distribution], "name": "jazzy", "release_package_xmls": {},
        "type": "cache", "version": 2,
    }  # fmt: skip
    for name, content in {
        "keys.yaml": {key: {"ubuntu": {"noble": [package]}} for key, package in keys.items()},
        "distribution.yaml": distribution,
        "cache.yaml": cache,
        "index.yaml": {"distributions": {"jazzy": jazzy}, "type": "index", "version": 4},
    }.items():
        (folder / name).write_text("%YAML 1.1\n---\n" + yaml.safe_dump(content))
    (folder / "sources").mkdir()
    (folder / "sources/10-stored.list").write_text(f"yaml file://{folder}/keys.yaml\n")
    environment = {
        "ROSDEP_SOURCE_PATH": str(folder / "sources"),
        "ROS_HOME": str(folder / "home"),
        "ROSDISTRO_INDEX_URL": f"file://{folder}/index.yaml",
        # What is here already is not on the machine of the README.
        "AMENT_PREFIX_PATH": str(folder),
    }
    updated = run([*ROSDEP, "update", "--rosdistro", "jazzy"], workspace, **environment)
    assert updated.returncode == 0, updated.stderr
    return environment


def test_rosdep_resolves_every_dependency_of_both_packages(workspace: Path, rosdep: dict[str, str]) -> None:
    line = [*ROSDEP, *words("rosdep install")[1:]]
    found = run(
        [*line, "--reinstall", "--simulate", "--rosdistro", "jazzy", "--os", "ubuntu:noble"], workspace, **rosdep
    )
    assert found.returncode == 0, found.stderr
    installed = set(re.findall(r"apt-get install -y (\S+)", found.stdout))
    assert {"ros-jazzy-rclpy", "ros-jazzy-rosidl-default-generators", "python3-numpy"} <= installed


def test_libraries_of_pip_follow_those_of_the_system_and_go_into_an_environment_of_their_own() -> None:
    order = [next(n for n, line in enumerate(LINES) if start in line) for start in ("rosdep", "venv ", "pip", "colcon")]
    assert order == sorted(order)
    assert "--system-site-packages" in words("python3 -m venv")
    assert not any("--break-system-packages" in line for line in LINES)


def test_colcon_finds_both_packages(workspace: Path) -> None:
    build = words("python3 -m colcon")
    folders = build[build.index("--base-paths") + 1 : build.index("--symlink-install")]
    listed = run([sys.executable, "-m", "colcon", "list", "--names-only", "--base-paths", *folders], workspace)
    assert listed.stdout.split() == ["rf_pointing", "rf_pointing_msgs"]


def test_plain_build_says_which_folders_colcon_is_to_be_given(workspace: Path) -> None:
    own = str(Path(sys.prefix))
    built = run([sys.executable, "-m", "colcon", "build"], workspace, AMENT_PREFIX_PATH=own)
    assert built.returncode != 0
    assert "colcon build --base-paths src/rf_pointing src/rf_pointing/msg_defs" in built.stderr
