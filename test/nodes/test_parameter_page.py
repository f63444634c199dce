"""docs/parameters.md is what the nodes declare."""

from pathlib import Path

from test.scripts import script_module

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "parameters.md"


def test_the_page_is_what_the_generator_prints(ros_domain: int) -> None:
    script = script_module("scripts/parameter_page.py")
    declared = script.declarations()
    assert PAGE.read_text() == script.parameter_page(declared), (
        "run scripts/run-python scripts/parameter_page.py > docs/parameters.md"
    )
    (row,) = (each for each in declared["antenna_servo"] if each.name == "safety.gate.sun_radius_deg")
    assert (row.unit, row.default, row.bounds, row.live) == ("deg", "1", "0 to 28.65", False)
