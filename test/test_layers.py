"""Imports flow in one direction: the table of docs/architecture.md, held against the code."""

import ast
import sys
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parents[1] / "rf_pointing"
ARCHITECTURE = PACKAGE.parent / "docs" / "architecture.md"
IMPORTED_AS = {
    "erfa": "pyerfa",
    "control": "python-control",
    "astropy_iers_data": "astropy-iers-data",
    "yaml": "PyYAML",
}
BASE = {"numpy"}
SIBLING = BASE | {"scipy"}
CONTROL = SIBLING | {"control"}
SIBLINGS = {
    "ephemeris": SIBLING | {"sgp4", "erfa", "astropy_iers_data"},
    "servo": CONTROL,
    "controllers": CONTROL,
    "rf": SIBLING,
    "tracking": SIBLING,
    "calibration": SIBLING | {"yaml"},
    "planning": SIBLING,
    "arrays": SIBLING,
    "attitude": SIBLING,
    "identification": CONTROL,
}
COMPOSED = set().union(*SIBLINGS.values())
ALLOWED_THIRD_PARTY = {
    "geometry": BASE,
    **SIBLINGS,
    "station": COMPOSED | {"yaml"},
    "simulation": COMPOSED | {"numba"},
    "reproduce": COMPOSED | {"matplotlib"},
    "report": COMPOSED | {"matplotlib", "rosbags", "yaml"},
    "nodes": None,
}
ALLOWED_FOLDERS = {
    "geometry": set(),
    **{folder: {"geometry"} for folder in SIBLINGS},
    "station": {"geometry", *SIBLINGS},
    "simulation": {"geometry", "station", *SIBLINGS},
    "reproduce": {"geometry", "station", "simulation", *SIBLINGS},
    "report": {"geometry", "station", "simulation", *SIBLINGS},
}


def modules() -> list[Path]:
    return sorted(path for path in PACKAGE.rglob("*.py") if path.parent != PACKAGE)


def imported_names(path: Path) -> set[str]:
    names = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: relative import"
            names.add(node.module or "")
    return names


@pytest.mark.parametrize("path", modules(), ids=lambda path: str(path.relative_to(PACKAGE)))
def test_module_imports_only_what_its_folder_may(path: Path) -> None:
    folder = path.relative_to(PACKAGE).parts[0]
    third_party = ALLOWED_THIRD_PARTY[folder]
    for name in imported_names(path):
        top, *rest = name.split(".")
        if top == "rf_pointing":
            allowed = ALLOWED_FOLDERS.get(folder)
            if allowed is not None and rest:
                assert rest[0] in allowed | {folder}, f"{folder} may not import {name}"
        elif third_party is not None and top not in sys.stdlib_module_names:
            assert top in third_party, f"{folder} may not import {name}"


def test_every_folder_is_in_the_table() -> None:
    folders = {path.relative_to(PACKAGE).parts[0] for path in modules()}
    assert folders <= set(ALLOWED_THIRD_PARTY)


@pytest.mark.parametrize("folder", ["geometry", *SIBLINGS])
def test_the_table_of_the_documentation_names_the_same_libraries(folder: str) -> None:
    (row,) = (
        line for line in ARCHITECTURE.read_text().splitlines() if line.startswith("| `") and f"`{folder}/`" in line
    )
    told = {name.strip() for name in row.strip("|").split("|")[2].split(",")} - {"geometry"}
    assert told == {IMPORTED_AS.get(name, name) for name in ALLOWED_THIRD_PARTY[folder]}
