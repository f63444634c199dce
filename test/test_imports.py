"""What an import costs: eight nodes run on a station's computer, and each loads what it needs."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

import rf_pointing

PACKAGE = Path(rf_pointing.__file__).parent
MOST_LINES = 8000
HEAVY = {"scipy", "serial", "matplotlib", "requests", "importlib.metadata", "_hashlib"}
PROGRAM = "import sys, importlib; importlib.import_module(sys.argv[1]); print(*sys.modules)"


def loaded_by(module: str) -> set[str]:
    """Return the modules that a fresh interpreter holds after one import."""
    run = subprocess.run([sys.executable, "-c", PROGRAM, module], capture_output=True, text=True, check=True)
    return set(run.stdout.split())


def lines_of(modules: set[str]) -> int:
    ours = [name.replace(".", "/") for name in modules if name.startswith("rf_pointing.")]
    files = [path for name in ours for path in (PACKAGE.parent / f"{name}.py", PACKAGE.parent / name / "__init__.py")]
    return sum(len(path.read_text().splitlines()) for path in files if path.is_file())


@pytest.mark.parametrize(
    "module", ["nodes.monopulse_tracker", "nodes.conscan_tracker", "nodes.simulation_clock", "commands.fetch_elements"]
)
def test_a_small_program_stands_on_little_of_the_package(module: str) -> None:
    if module.startswith("nodes"):
        pytest.importorskip("rclpy", reason="nodes need ROS 2")
    assert lines_of(loaded_by(f"rf_pointing.{module}")) <= MOST_LINES


@pytest.mark.parametrize("node", ["antenna_servo", "rf_receiver", "monopulse_tracker", "bias_calibrator",
                                  "ephemeris_publisher", "pointing_controller"])  # fmt: skip
def test_a_node_loads_no_library_that_a_pass_does_not_need(node: str) -> None:
    pytest.importorskip("rclpy", reason="nodes need ROS 2")
    # numpy 1.26 itself loads OpenSSL.
    assert not loaded_by(f"rf_pointing.nodes.{node}") & (HEAVY - loaded_by("numpy"))


def test_a_node_that_checks_the_parameters_of_all_loads_nothing_more() -> None:
    """It took 2 s of each start and 77 MB once."""
    program = "import sys; from rf_pointing.station.description import read_station; read_station('dss13'); print(*sys.modules)"
    run = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert not set(run.stdout.split()) & {"scipy", "matplotlib", "requests"}


def test_a_package_gives_its_exports_at_first_use_and_refuses_another_name() -> None:
    from rf_pointing import planning

    assert planning.HorizonMask.__module__ == "rf_pointing.planning.horizon"
    with pytest.raises(AttributeError, match="module 'rf_pointing.planning' has no attribute 'HorizonMusk'"):
        _ = planning.HorizonMusk


@pytest.mark.parametrize("path", sorted(PACKAGE.rglob("__init__.py")), ids=lambda path: path.parent.name)
def test_no_export_has_the_name_of_a_module_of_its_package(path: Path) -> None:
    """Python binds a loaded module to its name: an export of that name would be the one or the other."""
    if "lazily(" not in path.read_text():
        return
    imports = [node for node in ast.walk(ast.parse(path.read_text())) if isinstance(node, ast.ImportFrom)]
    exports = {name.name for node in imports for name in node.names}
    assert not exports & {each.stem for each in path.parent.glob("*.py")}
