"""The package holds together: launch files compile, executables exist, and both packages state the same version."""

import ast
import importlib.util
import re
import xml.etree.ElementTree as ElementTree
from pathlib import Path
from typing import Any

import pytest

from rf_pointing import __version__

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
    assert re.search(r"^def main\(", Path(spec.origin).read_text(), re.MULTILINE)


def test_launched_nodes_are_executables() -> None:
    # The table itself needs ROS to be imported.
    source = (ROOT / "rf_pointing/ros/graph.py").read_text()
    named = set(re.findall(r'GraphNode\(\s*"(\w+)"', source))
    assert named
    # These are started where they are wanted, and are no part of a graph.
    named |= set(re.findall(r'^(?:EXECUTIVE|DESCRIPTION|OPERATOR_PAGE|ROTCTLD) = "(\w+)"', source, re.MULTILINE))
    of_array = set(re.findall(r'GraphNode\(\s*"(array_\w+)"', source))
    assert named - of_array == {name for name, room in executables().items() if room == "nodes"}
    assert of_array <= set(executables())


def test_versions_agree() -> None:
    for manifest in ("package.xml", "msg_defs/package.xml"):
        found = ElementTree.parse(ROOT / manifest).getroot().findtext("version")
        assert found == __version__, manifest
    assert f'version="{__version__}"' in (ROOT / "setup.py").read_text()


def test_every_file_of_config_is_installed(monkeypatch: pytest.MonkeyPatch) -> None:
    import setuptools

    given: dict[str, Any] = {}
    monkeypatch.setattr(setuptools, "setup", given.update)
    monkeypatch.chdir(ROOT)
    exec(compile((ROOT / "setup.py").read_text(), "setup.py", "exec"), {"__name__": "setup"})
    installed = {name for _, names in given["data_files"] for name in names}
    wanted = {str(path.relative_to(ROOT)) for path in (ROOT / "config").rglob("*") if path.is_file()}
    assert wanted <= installed
