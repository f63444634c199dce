"""`import rf_pointing as rp` costs nothing until it is used, offers what docs/api.md says, and no more."""

import ast
import importlib.util
import inspect
import pydoc
import subprocess
import sys
from pathlib import Path

import pytest

import rf_pointing as rp

ROOT = Path(__file__).parents[2]


def test_importing_it_loads_neither_numpy_nor_any_room() -> None:
    code = "import sys, rf_pointing; print([m for m in sys.modules if m.split('.')[0] in ('numpy', 'scipy') or "
    code += "m.startswith('rf_pointing.')])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_no_name_of_it_needs_ros() -> None:
    code = f"import sys, rf_pointing as rp; [getattr(rp, n) for n in {rp.__all__}]; print('rclpy' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "False"


@pytest.mark.parametrize("name", rp.__all__)
def test_every_name_is_there_documented_and_seen_by_a_type_checker(name: str) -> None:
    assert name in dir(rp)
    made = getattr(rp, name)
    assert inspect.getdoc(made)
    tree = ast.parse((ROOT / "rf_pointing" / "__init__.py").read_text())
    typed = {
        alias.asname or alias.name
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }
    assert name in typed
    own = (
        {each: member for each, member in vars(made).items() if not each.startswith("_")}
        if inspect.isclass(made)
        else {}
    )
    for each, member in own.items():
        if callable(member) or isinstance(member, property):
            assert inspect.getdoc(member), f"{name}.{each}"


def test_help_shows_the_names() -> None:
    text = pydoc.render_doc(rp, renderer=pydoc.plaintext)
    assert not [name for name in rp.__all__ if name not in text]


def test_a_wrong_name_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="module 'rf_pointing' has no attribute 'Stations'"):
        _ = rp.Stations  # type: ignore[attr-defined]


def test_the_page_of_the_front_door_is_made_from_the_docstrings_and_has_every_name() -> None:
    spec = importlib.util.spec_from_file_location("api_page", ROOT / "scripts" / "api_page.py")
    assert spec is not None
    assert spec.loader is not None
    made = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(made)
    assert sorted(name for names in made.GROUPS.values() for name in names) == sorted(rp.__all__)
    assert (ROOT / "docs" / "api.md").read_text() == made.page()


def test_examples_need_nothing_else() -> None:
    """Own drives and trackers derive from what the package lets others extend; array sensors have a door of their own."""
    for path in sorted((ROOT / "examples").glob("*.py")):
        tree = ast.parse(path.read_text())
        used = {node.module for node in ast.walk(tree) if isinstance(node, ast.ImportFrom) and node.module}
        mine = {name for name in used if name.split(".")[0] == "rf_pointing"}
        allowed = {
            "own_drive.py": {"rf_pointing.drives"},
            # A node of another stack that commands the antenna signs as ours do.
            "follow_joint_trajectory.py": {"rf_pointing.ros.signed_commands", "rf_pointing.station.parameters"},
            "own_receiver.py": {"rf_pointing.receiver"},
            "topic_drive_node.py": {"rf_pointing.ros.driver_node"},
            "own_tracker.py": {
                "rf_pointing.core",
                "rf_pointing.core.signals",
                "rf_pointing.tracking.scan",
                "rf_pointing.tracking.sensors",
            },
            "array_sensors.py": {
                "rf_pointing.array_sensors.nodes.array_graph",
                "rf_pointing.array_sensors.report.page",
            },
        }
        assert mine <= allowed.get(path.name, set()), path.name
