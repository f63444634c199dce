"""Pages of a report as HTML that needs no other file, from the templates in `templates/`.

Values that a template shows are escaped; numbers have a fixed number of significant digits.
"""

import base64
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined

Cell = str | float | int | None


def render(template: str, **values: Any) -> str:
    """Return the page of a template."""
    return _TEMPLATES.get_template(template).render(**values)


def number(value: float | int | None, digits: int = 3) -> str:
    """Return a number with `digits` significant figures and no powers of ten; a dash for None."""
    if value is None:
        return "–"
    if isinstance(value, int):
        return f"{value:,}".replace(",", "\u202f")
    if value == 0.0:
        return "0"
    # Round first: 0.9996 has one digit before the point only after it.
    shown = float(f"{value:.{digits}g}")
    exponent = int(f"{abs(shown):e}".partition("e")[2])
    decimals = max(0, digits - 1 - exponent)
    return f"{shown:,.{min(decimals, 9)}f}".replace(",", "\u202f")


_TEMPLATES = Environment(
    # From the source folder: the package is installed as links to it or as plain files.
    loader=FileSystemLoader(Path(__file__).with_name("templates")),
    autoescape=True,
    trim_blocks=True,
    lstrip_blocks=True,
    # A misspelt name in a template is an error, not an empty place in the page.
    undefined=StrictUndefined,
)
_TEMPLATES.filters |= {
    "number": number,
    "rms": lambda error: f"{number(error.cross_elevation.rms_mdeg)} / {number(error.elevation.rms_mdeg)}",
    "clock": lambda utc: utc.replace("T", " ").removesuffix("Z").partition(".")[0],
    "base64": lambda path: base64.b64encode(path.read_bytes()).decode("ascii"),
}
