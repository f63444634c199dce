"""The package holds together: launch files compile, executables exist, and both packages state the same version."""

import ast
import importlib.util
import os
import re
import shutil
import subprocess
import sys
import sysconfig
import xml.etree.ElementTree as ElementTree
import zipfile
from pathlib import Path
from typing import Any

import pytest

from rf_pointing import __version__
from rf_pointing.tracking.sensors import SENSORS

ROOT = Path(__file__).parents[1]


def executables() -> dict[str, str]:
    """Return the package of each executable."""
    tree = ast.parse((ROOT / "setup.py").read_text())
    for node in tree.body:
        if isinstance(node, ast.Assign) and getattr(node.targets[0], "id", "") == "EXECUTABLES":
            rooms = ast.literal_eval(node.value)
            return {name: room for room, names in rooms.items() for name in names}
    raise AssertionError("setup.py has no EXECUTABLES")


@pytest.mark.parametrize("path", sorted((ROOT / "launch").glob("*.py")), ids=lambda path: path.name)
def test_launch_file_compiles_and_offers_a_description(path: Path) -> None:
    tree = ast.parse(path.read_text(), filename=str(path))
    compile(tree, str(path), "exec")
    assert "generate_launch_description" in {n.name for n in tree.body if isinstance(n, ast.FunctionDef)}


@pytest.mark.parametrize(("name", "room"), executables().items())
def test_executable_has_a_main_in_the_module_of_its_name(name: str, room: str) -> None:
    spec = importlib.util.find_spec(f"rf_pointing.{room}.{name}")
    assert spec is not None
    assert spec.origin is not None
    assert re.search(r"^(def main\(|main = \w+\.main$)", Path(spec.origin).read_text(), re.MULTILINE)


def test_launched_nodes_are_executables() -> None:
    # The table itself needs ROS to be imported.
    source = (ROOT / "rf_pointing/ros/graph.py").read_text()
    named = set(re.findall(r'GraphNode\(\s*"(\w+)"', source))
    assert named
    # The trackers' are those of their traits.
    named |= {traits.node for traits in SENSORS.values() if not traits.own_level}
    # These are started where they are wanted, and are no part of a graph.
    named |= set(
        re.findall(r'^(?:EXECUTIVE|ALARMS|DESCRIPTION|OPERATOR_PAGE|RADIO|ROTCTLD) = "(\w+)"', source, re.MULTILINE)
    )
    of_array = set(re.findall(r'GraphNode\(\s*"(array_\w+)"', source))
    # Not a node: it runs several of them.
    named.add("station_process")
    assert named - of_array == {name for name, room in executables().items() if room == "nodes"}
    assert of_array <= set(executables())


def test_versions_agree() -> None:
    for manifest in ("package.xml", "msg_defs/package.xml"):
        found = ElementTree.parse(ROOT / manifest).getroot().findtext("version")
        assert found == __version__, manifest
    assert f'version="{__version__}"' in (ROOT / "setup.py").read_text()


def setup_of(monkeypatch: pytest.MonkeyPatch, *argv: str) -> dict[str, Any]:
    """Return what setup.py declares when a tool calls it like this."""
    import setuptools

    given: dict[str, Any] = {}
    monkeypatch.setattr(setuptools, "setup", given.update)
    monkeypatch.setattr(sys, "argv", ["setup.py", *argv])
    monkeypatch.chdir(ROOT)
    exec(compile((ROOT / "setup.py").read_text(), "setup.py", "exec"), {"__name__": "setup"})
    return given


def test_every_file_of_config_is_installed(monkeypatch: pytest.MonkeyPatch) -> None:
    installed = {name for _, names in setup_of(monkeypatch)["data_files"] for name in names}
    wanted = {str(path.relative_to(ROOT)) for path in (ROOT / "config").rglob("*") if path.is_file()}
    assert wanted <= installed


@pytest.mark.parametrize(
    ("argv", "every"),
    [
        (["develop", "--editable"], True),
        (["egg_info", "build", "install", "--prefix", "/opt/ros/jazzy"], True),
        (["bdist_wheel"], False),
        (["editable_wheel"], False),
        (["dist_info"], False),
    ],
)
def test_an_install_into_ros_has_every_executable_and_any_other_one_command(
    argv: list[str], every: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    points = setup_of(monkeypatch, *argv)["entry_points"]
    names = {name: {each.partition(" = ")[0] for each in group} for name, group in points.items()}
    assert names["rf_pointing.executables"] == set(executables())
    assert names["console_scripts"] == (set(executables()) if every else {"rf-pointing"})


def test_the_build_of_this_tree_has_every_executable_where_ros2_run_looks() -> None:
    index = pytest.importorskip("ament_index_python.packages", reason="needs a build in ROS")
    folder = Path(index.get_package_prefix("rf_pointing")) / "lib" / "rf_pointing"
    assert {path.name for path in folder.iterdir()} == set(executables())
    assert all(os.access(path, os.X_OK) for path in folder.iterdir())


def wheel_of(source: Path, wheel: Path) -> Path:
    """Write the wheel of a tree; `bdist_wheel` itself is not among the pinned packages."""
    content = source / "content"
    content.mkdir()
    steps = ["egg_info", "-e", content, "build_py", "-d", content]
    subprocess.run([sys.executable, "setup.py", "-q", *steps], cwd=source, check=True, capture_output=True)
    info = (content / "rf_pointing.egg-info").rename(content / f"rf_pointing-{__version__}.dist-info")
    (info / "PKG-INFO").rename(info / "METADATA")
    (info / "WHEEL").write_text("Wheel-Version: 1.0\nGenerator: test\nRoot-Is-Purelib: true\nTag: py3-none-any\n")
    files = [path.relative_to(content) for path in content.rglob("*") if path.is_file()]
    (info / "RECORD").write_text("".join(f"{path},,\n" for path in files))
    with zipfile.ZipFile(wheel, "w") as written:
        for path in (*files, (info / "RECORD").relative_to(content)):
            written.write(content / path, path)
    return wheel


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the `bin` of a fresh virtual environment into which pip has installed this tree."""
    folder = tmp_path_factory.mktemp("pip")
    source, bin_folder = folder / "source", folder / "venv" / "bin"
    ignored = shutil.ignore_patterns(".*", "build", "*.egg-info", "__pycache__", "test", "runs")
    shutil.copytree(ROOT, source, ignore=ignored)
    pip = [sys.executable, "-m", "pip", "--disable-pip-version-check"]
    made = wheel_of(source, folder / f"rf_pointing-{__version__}-py3-none-any.whl")
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", folder / "venv"], check=True)
    before = {path.name for path in bin_folder.iterdir()}
    subprocess.run(
        [*pip, "--python", bin_folder / "python", "install", "--no-deps", "--no-index", "-q", made], check=True
    )
    assert {path.name for path in bin_folder.iterdir()} - before == {"rf-pointing"}
    return bin_folder


def test_pip_puts_one_command_on_the_path_that_lists_and_starts_the_others(installed: Path) -> None:
    libraries = {**os.environ, "PYTHONPATH": sysconfig.get_path("purelib")}

    def run(*words: str, alone: bool = False) -> subprocess.CompletedProcess[str]:
        environment = {"PATH": os.environ["PATH"]} if alone else libraries
        return subprocess.run(
            [installed / "rf-pointing", *words], capture_output=True, text=True, env=environment, cwd="/", timeout=60
        )

    listed = run(alone=True)
    assert listed.returncode == 0
    for name in executables():
        (line,) = [line for line in listed.stdout.splitlines() if line.startswith(f"  {name} ")]
        assert len(line.split()) > 3
    wrong = run("plan_pases", alone=True)
    assert (wrong.returncode, "did you mean plan_passes?" in wrong.stderr) == (2, True)
    assert run("plan-passes", "--help").stdout.startswith("usage: plan_passes")
    assert "Goldstone DSS-13: " in run("check_station", "dss13").stdout
    refused = run("check_station", "Atlantis")
    assert (refused.returncode, "no such file" in refused.stderr) == (2, True)
    # Without ROS the nodes say what they need.
    live = subprocess.run(
        [installed / "python", "-c", "import sys; sys.modules['rclpy'] = None; from rf_pointing.__main__ import main; "
         "main(['antenna_servo'])"], capture_output=True, text=True, env=libraries, cwd="/", timeout=60,
    )  # fmt: skip
    assert (live.returncode, "antenna_servo needs ROS 2 Jazzy" in live.stderr) == (2, True)
