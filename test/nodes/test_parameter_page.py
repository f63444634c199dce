"""docs/parameters.md is what the nodes declare."""

from pathlib import Path
from typing import Any

import pytest

from test.scripts import script_module

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "parameters.md"


@pytest.fixture(scope="module")
def script() -> Any:
    return script_module("scripts/parameter_page.py")


@pytest.fixture
def declared(script: Any, ros_domain: int) -> dict[str, list[Any]]:
    return dict(script.declarations())


def test_the_page_is_what_the_generator_prints(script: Any, declared: dict[str, list[Any]]) -> None:
    assert PAGE.read_text() == script.parameter_page(declared), (
        "run scripts/run-python scripts/parameter_page.py > docs/parameters.md"
    )


def test_a_row_states_the_edge_name_the_unit_in_degrees_and_the_bounds(declared: dict[str, list[Any]]) -> None:
    (row,) = (each for each in declared["antenna_servo"] if each.name == "safety.gate.sun_radius_deg")
    assert (row.unit, row.default, row.bounds, row.live) == ("deg", "1", "0 to 28.65", False)


def test_a_live_parameter_takes_effect_at_once(declared: dict[str, list[Any]]) -> None:
    (row,) = (each for each in declared["pointing_controller"] if each.name == "autotrack.sensor")
    assert row.row().startswith(
        "| `autotrack.sensor` | | `auto` | `auto`, `monopulse`, `conscan`, `steptrack`, `array`, `none`"
    )
    assert "| at once |" in row.row()


def test_every_parameter_has_a_line(script: Any, declared: dict[str, list[Any]]) -> None:
    lines = script.documented(PAGE.read_text())
    assert (
        not {(node, p.name) for node, all_ in declared.items() for p in all_ if p.prefix not in script.EVERY_NODE}
        - lines
    )
