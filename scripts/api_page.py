"""Print docs/api.md: the front door as its docstrings describe it.

scripts/run-python scripts/api_page.py > docs/api.md
"""

import dataclasses
import inspect
import textwrap
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import rf_pointing as rp

HEAD = """# The front door

`import rf_pointing as rp` is all that a program, a notebook or a script needs; it loads what is
used when it is used, and needs no ROS except for `Station.track`. `help(rp.Station)` shows the same
text.

* **Angles** are taken by keyword, in degrees (`min_peak_deg=40.0`) or in radians
  (`min_peak_rad=0.7`), never both; every result says its unit in its name.
* **Times** are UTC: text (`start="2006-06-27T04:00:00"`), or seconds since 1970 (`start_t_s=...`).
* **Durations** say their unit: `hours=6.0`, `days=2`, `gap_s=30.0`.
* What is wrong is a `ValueError` that names the value and what it must be.

```python
{example}```

This page is made from the docstrings: `scripts/run-python scripts/api_page.py > docs/api.md`.
"""
GROUPS = {
    "Station and targets": ("Station", "elements", "catalogue", "Target"),
    "What a station gives": ("StationPass", "PassCertificate", "Plan", "Look", "SimulatedPass"),
    "A network of stations": ("plan_network", "NetworkPlan"),
    "Orbits": ("orbit_from_passes", "DeterminedOrbit", "orbit_covariance", "OrbitCovariance"),
    "Loops": ("tune", "Tuning"),
    "Studies": ("ensemble", "Ensemble"),
    "Recordings and calibration": (
        "Recording",
        "replay",
        "Replay",
        "check_clock",
        "ClockCheck",
        "ledger",
        "budget",
        "Ledger",
        "fit",
        "Fit",
        "read_model",
        "ModelVersion",
        "BiasModel",
        "Observations",
    ),
}


def page() -> str:
    """Return the text of the page."""
    example = (Path(__file__).parents[1] / "examples" / "first_steps.py").read_text()
    lines = [HEAD.format(example=example)]
    for title, names in GROUPS.items():
        lines.append(f"## {title}\n")
        for name in names:
            lines += section(name, getattr(rp, name))
    return "\n".join(lines).rstrip() + "\n"


def section(name: str, made: Any) -> Iterator[str]:
    """Yield the lines of one name."""
    first, rest = parts(made)
    yield f"### rp.{name}\n\n{textwrap.fill(first, 100)}\n"
    if rest:
        yield f"```text\n{rest}\n```\n"
    if not inspect.isclass(made) or not made.__module__.startswith("rf_pointing.api"):
        return
    if dataclasses.is_dataclass(made):
        listed = ", ".join(f"`{item.name}`" for item in dataclasses.fields(made))
        yield textwrap.fill(f"Fields: {listed}.", 100) + "\n"
    members = [(each, member) for each, member in vars(made).items() if each[0] != "_" and inspect.getdoc(member)]
    members = [(each, member) for each, member in members if not isinstance(member, str | int | float | classmethod)]
    yield "| member | what it is |\n|---|---|"
    for each, member in members:
        call = "()" if inspect.isfunction(member) else ""
        yield f"| `{each}{call}` | {parts(member)[0].replace('|', '/')} |"
    yield ""
    for each, member in members:
        if rest := parts(member)[1]:
            yield f"#### {name}.{each}\n\n```text\n{rest}\n```\n"


def parts(made: Any) -> tuple[str, str]:
    """Return the first paragraph of a docstring in a line, and the rest as it is."""
    first, _, rest = (inspect.getdoc(made) or "").partition("\n\n")
    return " ".join(first.split()), rest.strip()


if __name__ == "__main__":
    print(page(), end="")
