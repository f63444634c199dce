"""Print docs/parameters.md: every ROS parameter of every node, as the nodes declare them.

    scripts/run-python scripts/parameter_page.py > docs/parameters.md

A node is made, its declarations are read and it is destroyed; nothing is configured or published.
"""

import dataclasses
import importlib
import inspect
import re
import sys
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import rclpy
from rclpy.signals import SignalHandlerOptions

import rf_pointing
from rf_pointing.core import leaves, parameter_unit, to_degrees
from rf_pointing.ros.managed import ManagedNode
from rf_pointing.ros.station_node import StationParams

PACKAGE = Path(rf_pointing.__file__).parent
STATION = "dss13"
"""The station whose numbers the page shows as defaults."""
EVERY_NODE = ("lifecycle", "description")
"""Prefixes of the sets that every node has; the page shows them once."""
HEADER = """\
# Parameters

Every ROS parameter of every node. A name is written as in a parameter file below
`ros__parameters`: its prefix, a dot, and its own name, which ends in its unit. Angles are in
degrees. A number outside its range is refused; the message states the name and the bound, and every
other value stays as it was.

*Takes effect* says when a change counts: **at once** while the node runs, or **configure**: only
before the node is configured, so deactivate it and clean it up first. A key there is the place in
the [station description](my_station.md) that gives the number, for all nodes at once; a parameter
file may repeat it and cannot change it, so the file that `ros2 param dump` writes starts the same
node again with `--params-file`. An unknown name is refused with the nearest known one. The defaults
are those of the station `dss13` at X band.

This page is made by `scripts/run-python scripts/parameter_page.py > docs/parameters.md`; a test
compares it with what the nodes declare.
"""
ROW = "| {name} | {unit} | {default} | {bounds} | {effect} | {description} |"
COLUMNS = ["Parameter", "Unit", "Default", "Range", "Takes effect", "Meaning"]


@dataclasses.dataclass(frozen=True)
class Declared:
    """One parameter of one node, in the words of the page."""

    prefix: str
    name: str
    unit: str
    default: str
    bounds: str
    live: bool
    description: str
    station_key: str

    def row(self) -> str:
        """Return its line of the table."""
        cells = {
            "name": f"`{self.name}`",
            "unit": "" if self.unit == "1" else self.unit,
            "default": f"`{self.default}`",
            "bounds": self.bounds,
            "effect": "; ".join(filter(None, (self._effect(), f"`{self.station_key}`" if self.station_key else ""))),
            "description": self.description.replace("|", "\\|"),
        }
        return re.sub(r" {2,}", " ", ROW.format(**cells))

    def _effect(self) -> str:
        if self.live:
            return "at once"
        return "" if self.station_key else "configure"


def node_classes() -> list[type[ManagedNode]]:
    """Return the class of every managed node of the package, by the order of their names."""
    found = []
    for path in sorted(PACKAGE.rglob("nodes/*.py")):
        # Others, such as the helpers of launch files, import packages that a node does not need.
        text = path.read_text()
        if re.search(r"\((Managed|Station)Node\)", text) and re.search(r"^(def )?main\b", text, re.MULTILINE):
            name = ".".join(path.relative_to(PACKAGE.parent).with_suffix("").parts)
            module = importlib.import_module(name)
            members = [member for _, member in inspect.getmembers(module, inspect.isclass)]
            found += [each for each in members if issubclass(each, ManagedNode) and each.__module__ == name]
    return found


def declarations() -> dict[str, list[Declared]]:
    """Return the parameters of every node by its name, in the order of their declaration."""
    # A namespace of its own: the name of a node that runs on this machine is taken.
    given = ["--ros-args", "-r", "__ns:=/parameter_page", "-p", f"station:={STATION}"]
    rclpy.init(args=given, signal_handler_options=SignalHandlerOptions.NO)
    try:
        return dict(sorted(_of_node(each) for each in node_classes()))
    finally:
        rclpy.try_shutdown()


def parameter_page(nodes: dict[str, list[Declared]]) -> str:
    """Return the page."""
    shared, tables = {}, []
    nodes_of = Counter(each.name for parameters in nodes.values() for each in parameters)
    for node, parameters in nodes.items():
        common = [each for each in parameters if each.prefix in EVERY_NODE and nodes_of[each.name] > 1]
        own = [each for each in parameters if each not in common]
        shared |= {each.name: each for each in common}
        tables.append((node, own))
    index = [f"- [{node}](#{node}): {len(own)} parameters" for node, own in tables]
    blocks = [HEADER, "\n".join(["- [Every node](#every-node)", *index]) + "\n"]
    for title, own in [("Every node", list(shared.values())), *tables]:
        blocks.append("\n".join([f"## {title}", "", *_table(own)]) + "\n")
    return "\n".join(blocks)


def documented(page: str) -> set[tuple[str, str]]:
    """Return heading and name of every parameter that has a line in `page`."""
    found, heading = set(), ""
    for line in page.splitlines():
        if line.startswith("## "):
            heading = line.removeprefix("## ")
        elif line.startswith("| `"):
            found.add((heading, line.split("`")[1]))
    return found


def _table(parameters: list[Declared]) -> Iterator[str]:
    yield "| " + " | ".join(COLUMNS) + " |"
    yield "|" + "---|" * len(COLUMNS)
    yield from (each.row() for each in parameters)


def _of_node(kind: type[ManagedNode]) -> tuple[str, list[Declared]]:
    node = kind()
    try:
        return node.get_name(), list(_read(node.parameters))
    finally:
        node.lock.release()
        node.destroy_node()


def _read(groups: Any) -> Iterator[Declared]:
    sets = {group: leaves(defaults) for group, defaults in groups.declared().items()}
    sets |= {"description": leaves(StationParams())} if "description" in sets else {}
    for name, (group, edge) in groups.names().items():
        item, value = sets[group][edge]
        yield Declared(
            group, name, parameter_unit(edge), _value(value, 9), _bounds(item), name in groups.live,
            item.metadata["description"], groups.station_key(name),
        )  # fmt: skip


def _bounds(item: "dataclasses.Field[Any]") -> str:
    if item.metadata["choices"]:
        return ", ".join(f"`{choice}`" for choice in item.metadata["choices"])
    # Bounds are round in radians; in degrees four digits are as many as a reader needs.
    ends = (to_degrees(item.name, item.metadata[side])[1] for side in ("low", "high"))
    low, high = ("" if end is None else _value(end, 4) for end in ends)
    if low and high:
        return f"{low} to {high}"
    return f"from {low}" if low else f"to {high}" if high else ""


def _value(value: Any, digits: int) -> str:
    """Return a value as a parameter file has it, a number with so many significant digits."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, tuple):
        return f"[{', '.join(_value(each, digits) for each in value)}]"
    if isinstance(value, float):
        return f"{value:.{digits}g}"
    # A file of the package is the same in every checkout.
    return '""' if value == "" else str(value).removeprefix(f"{PACKAGE.resolve().parent}/")


def main() -> None:
    """Print the page."""
    sys.stdout.write(parameter_page(declarations()))


if __name__ == "__main__":
    main()
