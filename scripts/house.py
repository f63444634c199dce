"""Measure the structure of the package and hold it against its bounds.

Prints one row per quantity and fails when a bound is not met; `--report` only prints, `--list` adds
what was counted.  Everything but the controller's period and the parameter page is read from the
source, without importing it.
"""

import argparse
import ast
import io
import math
import os
import re
import sys
import tokenize
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import Any

PACKAGE = "rf_pointing"
OTHER_ROOMS = ("array_sensors", "papers")
"""Packages below the package that are not the station."""
SMALL_LINES = 60
SMALL_ON_PURPOSE: dict[str, str] = {
    "rf_pointing/calibration/ionosphere.py": "one physical model with its source, no step of the pipeline",
    "rf_pointing/ros/recorder.py": "examples record with it, too",
}
"""Small modules with one importer that stay, each with the reason."""
SENSORS = ("monopulse", "conscan", "steptrack")
WIRE = re.compile(r"/(ros|nodes)/convert\w*\.py$")
"""Modules that turn messages into core types and back: the words are those of the wire."""
ROS_NAMES = {"Topic", "declare", "group", "node", "value"}
"""Calls whose first argument names a topic or a parameter set; a sensor's name may be such a name.
"""
ROS_TOPICS = {"listen", "listen_latest", "publisher", "stream"}
"""Calls whose first argument is a message type and whose second names a topic."""
AMBIGUOUS_MODES = {
    "array": "also a group of parameters and a type of JSON",
    "calibrate": "also an executable, a service and a request",
    "idle": "also a state of the executive and of a recorder",
    "slew": "also a motion of the safety gate, and a column of a certificate",
    "stow": "also a mode of the antenna and a service",
}
"""Mode names that other things bear too; as literals they are not counted."""
ONE_TRACKER = "conscan"
CONTROLLER_SETS = {"AutotrackParams", "ConscanParams", "SpiralParams"}
"""Parameter sets that only a list of all sets of the controller names together."""
DIRECTIVE = re.compile(r"#\s*(!|fmt:|noqa|type:|ruff:|mypy:|pragma|shellcheck|-\*-|isort:)")
SETTLED_PERIODS = 30
"""Periods in monopulse before the measured one: what a change of mode sets off is over by then."""


@dataclass(frozen=True)
class Row:
    """One quantity: what was measured, what is wanted, whether that holds, and what was counted."""

    quantity: str
    measured: str
    wanted: str
    holds: bool
    counted: list[str] = field(default_factory=list)


@dataclass(frozen=True)
class Module:
    """One source file of the package."""

    name: str
    path: str
    text: str

    @cached_property
    def tree(self) -> ast.Module:
        """The syntax tree."""
        return ast.parse(self.text)

    @cached_property
    def lines(self) -> int:
        """Lines of the file, empty ones too."""
        return len(self.text.splitlines())

    @property
    def is_package(self) -> bool:
        """Whether this is an `__init__`."""
        return self.path.endswith("__init__.py")

    @property
    def of_station(self) -> bool:
        """Whether this module belongs to the station."""
        return self.path.split("/")[1] not in OTHER_ROOMS

    @cached_property
    def docstrings(self) -> set[int]:
        """The ids of the nodes that are docstrings, of attributes too."""
        bodies = (getattr(node, "body", None) for node in ast.walk(self.tree))
        strings = (s for body in bodies if isinstance(body, list) for s in body if isinstance(s, ast.Expr))
        return {id(s.value) for s in strings if isinstance(s.value, ast.Constant)}


class Source:
    """The package below one root."""

    def __init__(self, root: Path) -> None:
        self.root = root
        self.modules: dict[str, Module] = {}
        for path in sorted((root / PACKAGE).rglob("*.py")):
            relative = path.relative_to(root)
            parts = relative.with_suffix("").parts
            name = ".".join(parts[:-1] if parts[-1] == "__init__" else parts)
            self.modules[name] = Module(name, relative.as_posix(), path.read_text())
        self.station = [module for module in self.modules.values() if module.of_station]

    @cached_property
    def executables(self) -> set[str]:
        """Dotted names of the modules that the table `EXECUTABLES` of setup.py lists by package."""
        for node in ast.parse((self.root / "setup.py").read_text()).body:
            if isinstance(node, ast.Assign) and _last(node.targets[0]) == "EXECUTABLES":
                rooms = ast.literal_eval(node.value)
                return {f"{PACKAGE}.{room}.{name}" for room, names in rooms.items() for name in names}
        raise ValueError("setup.py has no table EXECUTABLES")

    def origin(self, module: str, name: str) -> str:
        """Return the module that defines `name` of `module`; re-exports are followed."""
        where = self.modules.get(module)
        if where is None:
            return module
        for node in where.tree.body if where.is_package else ():
            if isinstance(node, ast.ImportFrom) and node.module:
                for alias in node.names:
                    if (alias.asname or alias.name) == name:
                        return self.origin(node.module, alias.name)
        submodule = f"{module}.{name}"
        return submodule if submodule in self.modules else module

    @cached_property
    def importers(self) -> dict[str, set[str]]:
        """For every module the modules that import what it defines; a re-export is no import."""
        found: dict[str, set[str]] = {name: set() for name in self.modules}
        for importer in self.modules.values():
            for node in ast.walk(importer.tree):
                for imported in self._imported(node):
                    if imported in found and imported != importer.name and not importer.is_package:
                        found[imported].add(importer.name)
        return found

    def _imported(self, node: ast.AST) -> Iterator[str]:
        if isinstance(node, ast.ImportFrom) and node.module:
            yield from (self.origin(node.module, alias.name) for alias in node.names)
        elif isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)


def size(source: Source) -> list[Row]:
    """Modules and lines of the station, packages' `__init__` included."""
    modules, lines = len(source.station), sum(module.lines for module in source.station)
    measured = f"{modules} / {lines / 1000:.1f}k"
    return [Row("modules / lines of the station", measured, "<= 220 / <= 32k", modules <= 220 and lines <= 32000)]


def small_modules(source: Source) -> list[Row]:
    """Modules that may be a part of their only importer."""
    found = []
    for module in source.modules.values():
        importers = source.importers[module.name]
        small = module.lines < SMALL_LINES and not module.is_package and module.name not in source.executables
        if small and len(importers) == 1:
            reason = SMALL_ON_PURPOSE.get(module.path, "no reason given")
            found.append(f"{module.path} ({module.lines}) <- {next(iter(importers))}: {reason}")
    unexplained = sum(line.endswith("no reason given") for line in found)
    measured = f"{len(found)}, {unexplained} without a reason" if unexplained else f"{len(found)}"
    quantity = f"modules below {SMALL_LINES} lines with one importer"
    return [Row(quantity, measured, "<= 10, each with a reason", len(found) <= 10 and not unexplained, found)]


def period(source: Source) -> list[Row]:
    """One controller period in steady monopulse tracking.

    The files are those of the functions called below `PointingController.step`, comprehensions and
    generators included; a change is a call whose function is in another file than the call before.
    Python before 3.12 counts comprehensions as calls of their own.
    """
    calls = _calls_of_a_period(source.root)
    changes = sum(before != after for before, after in pairwise(calls))
    files = sorted(set(calls))
    counted = [f"{calls.count(file):4d} calls  {file}" for file in files]
    return [
        Row("files that one controller period runs through", f"{len(files)}", "<= 18", len(files) <= 18, counted),
        Row("changes of file in one controller period", f"{changes}", "<= 70", changes <= 70),
    ]


class _PeriodMeasuredError(Exception):
    """Ends the pass once a period was recorded."""


def _calls_of_a_period(root: Path) -> list[str]:
    from rf_pointing import simulation
    from rf_pointing.ephemeris import first_pass_above
    from rf_pointing.ephemeris.source import SourceParams, load_elements, load_track

    folder = str(root / PACKAGE) + os.sep
    calls: list[str] = []

    def note(frame: Any, event: str, _argument: object) -> None:
        if event == "call" and frame.f_code.co_filename.startswith(folder):
            calls.append(frame.f_code.co_filename.removeprefix(folder))

    controller = sys.modules[simulation.simulate_pass.__module__].PointingController
    step, settled = controller.step, 0

    def watched(self: Any, t_s: float) -> Any:
        nonlocal settled
        if settled < SETTLED_PERIODS:
            result = step(self, t_s)
            settled = settled + 1 if result[1].mode == "monopulse" else 0
            return result
        sys.setprofile(note)
        try:
            step(self, t_s)
        finally:
            sys.setprofile(None)
        raise _PeriodMeasuredError

    source = SourceParams(satellite="28057")
    start_s = load_elements(source).epoch_t_s
    window = first_pass_above(load_track(source), start_s, math.radians(40.0), math.radians(5.0), 86400.0)
    setup = simulation.StationSetup("dss13", "X")
    controller.step = watched
    try:
        simulation.simulate_pass(setup, window, math.floor(window.aos_t_s) - 150.0, "monopulse")
    except _PeriodMeasuredError:
        return calls
    finally:
        controller.step = step
    raise RuntimeError("the pass ended before a period in monopulse could be measured")


def places_of_a_tracker(source: Source) -> list[Row]:
    """Modules of the station whose code names one tracker; a new one is written into as many.

    Its node is counted, its own modules `tracking/conscan*` are not, nor are docstrings and
    comments.
    """
    own = f"/tracking/{ONE_TRACKER}"
    others = (module for module in source.station if own not in module.path)
    found = [m.path for m in others if any(ONE_TRACKER in word.lower() for word in _words(m))]
    return [Row("places that a new tracker touches", f"{len(found)}", "<= 8", len(found) <= 8, found)]


def _words(module: Module) -> Iterator[str]:
    """Yield every identifier, imported module and string of the code."""
    for node in ast.walk(module.tree):
        if isinstance(node, ast.Constant):
            if isinstance(node.value, str) and id(node) not in module.docstrings:
                yield node.value
        else:
            for name in ("id", "attr", "arg", "name", "asname", "module"):
                value = getattr(node, name, None)
                if isinstance(value, str):
                    yield value


def literals(source: Source) -> list[Row]:
    """Lines with the name of a sensor or a mode as a string, outside the enums and the wire
    conversions.

    Names of ROS topics and parameter sets are counted apart: they may stay.
    """
    modes = _members(source, "Mode") - set(SENSORS) - set(AMBIGUOUS_MODES)
    rows = []
    for what, words in (("sensor", set(SENSORS)), ("mode", modes)):
        counted: list[str] = []
        ros = 0
        for module in source.station:
            if WIRE.search(f"/{module.path}"):
                continue
            edge = {id(node) for node in _ros_names(module.tree)}
            enum = {id(node) for node in _enum_values(module.tree)}
            strings = (n for n in ast.walk(module.tree) if isinstance(n, ast.Constant) and n.value in words)
            hits = [string for string in strings if id(string) not in enum]
            lines = {n.lineno for n in hits if id(n) not in edge}
            counted += [f"{module.path}:{line}" for line in sorted(lines)]
            ros += len({n.lineno for n in hits if id(n) in edge} - lines)
        files = len({line.split(":")[0] for line in counted})
        measured = f"{len(counted)} in {files} files" + (f", and {ros} ROS names" if ros else "")
        holds = not counted and bool(words)
        rows.append(Row(f"lines with a {what} name as a string literal", measured, "0", holds, counted))
    return rows


def _members(source: Source, enum: str) -> set[str]:
    """Return the values of the members of the station's enum of this name."""
    classes = (n for m in source.station for n in ast.walk(m.tree) if isinstance(n, ast.ClassDef) and n.name == enum)
    return {str(value.value) for each in classes for value in _enum_values(each)}


def _enum_values(tree: ast.AST) -> Iterator[ast.Constant]:
    """Yield the strings assigned in the body of a StrEnum."""
    for node in ast.walk(tree):
        if isinstance(node, ast.ClassDef) and any(_last(base) == "StrEnum" for base in node.bases):
            for statement in node.body:
                if isinstance(statement, ast.Assign) and isinstance(statement.value, ast.Constant):
                    yield statement.value


def _ros_names(tree: ast.AST) -> Iterator[ast.AST]:
    for node in ast.walk(tree):
        if isinstance(node, ast.Call):
            yield from node.args[:1] if _last(node.func) in ROS_NAMES else ()
            yield from node.args[1:2] if _last(node.func) in ROS_TOPICS else ()


def _last(node: ast.AST) -> str:
    """Return the last part of a dotted name."""
    if isinstance(node, ast.Attribute):
        return node.attr
    return node.id if isinstance(node, ast.Name) else ""


def time_loops(source: Source) -> list[Row]:
    """Loops that step plant or antenna: `plant.step`, `antenna.step`, or a passed `step(k)`."""
    found = []
    for module in source.modules.values():
        loops = [n for n in ast.walk(module.tree) if isinstance(n, ast.For | ast.While) and _steps_a_plant(n)]
        inner = {id(below) for loop in loops for below in ast.walk(loop) if below is not loop}
        found += [f"{module.path}:{loop.lineno}" for loop in loops if id(loop) not in inner]
    return [Row("time loops of the servo", f"{len(found)}", "1", len(found) == 1, found)]


def _steps_a_plant(loop: ast.AST) -> bool:
    for node in ast.walk(loop):
        if isinstance(node, ast.Call) and _last(node.func) == "step":
            passed = isinstance(node.func, ast.Name)
            owner = _last(node.func.value).strip("_") if isinstance(node.func, ast.Attribute) else ""
            if passed or owner in ("plant", "antenna"):
                return True
    return False


def wirings(source: Source) -> list[Row]:
    """Calls, dicts and classes that name the controller's parameter sets one by one, tests
    included.
    """
    found = []
    for folder in (PACKAGE, "test", "examples", "benchmarks"):
        for path in sorted((source.root / folder).rglob("*.py")):
            nodes = ast.walk(ast.parse(path.read_text()))
            lines = [node.lineno for node in nodes if CONTROLLER_SETS.issubset(_wired(node))]
            found += [f"{path.relative_to(source.root)}:{line}" for line in lines]
    return [Row("wirings of the controller's parameters", f"{len(found)}", "1", len(found) == 1, found)]


def _wired(node: ast.AST) -> Iterable[str]:
    if isinstance(node, ast.ClassDef):
        parts: list[ast.AST] = [statement for statement in node.body if isinstance(statement, ast.AnnAssign)]
    else:
        parts = [node] if isinstance(node, ast.Call | ast.Dict) else []
    return (_last(below) for part in parts for below in ast.walk(part))


def comments(source: Source) -> list[Row]:
    """Lines with a comment that is no directive for a tool."""
    rows = []
    for what, modules in (("the station", source.station), ("the package", list(source.modules.values()))):
        lines = sum(module.lines for module in modules)
        share = 100.0 * sum(_commented(module.text) for module in modules) / lines
        rows.append(Row(f"comments, share of the lines of {what}", f"{share:.1f} %", ">= 3 %", share >= 3.0))
    return rows


def _commented(text: str) -> int:
    tokens = tokenize.generate_tokens(io.StringIO(text).readline)
    return len({t.start[0] for t in tokens if t.type == tokenize.COMMENT and not DIRECTIVE.match(t.string)})


def parameters(source: Source) -> list[Row]:
    """Parameters that a node declares and docs/parameters.md does not list."""
    quantity = "parameters without a line in docs/parameters.md"
    try:
        import parameter_page
    except ModuleNotFoundError as error:
        return [Row(quantity, f"not measured: {error}", "0", False)]
    page = source.root / "docs" / "parameters.md"
    wanted = parameter_page.documented(parameter_page.parameter_page(parameter_page.declarations()))
    missing = wanted - (parameter_page.documented(page.read_text()) if page.exists() else set())
    counted = [f"{node} {name}" for node, name in sorted(missing)]
    return [Row(quantity, f"{len(missing)} of {len(wanted)}", "0", not missing, counted)]


MEASURES: tuple[Callable[[Source], list[Row]], ...] = (
    size,
    small_modules,
    period,
    places_of_a_tracker,
    literals,
    time_loops,
    wirings,
    comments,
    parameters,
)


def table(rows: list[Row]) -> str:
    """Return the rows as a table."""
    cells = [("", "quantity", "measured", "wanted")]
    cells += [("" if row.holds else "*", row.quantity, row.measured, row.wanted) for row in rows]
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    lines = [" | ".join(cell.ljust(width) for cell, width in zip(line, widths, strict=True)) for line in cells]
    lines.insert(1, "-|-".join("-" * width for width in widths))
    return "\n".join(f"| {line} |" if "-|-" not in line else f"|-{line}-|" for line in lines)


def main() -> int:
    """Print the table; return 1 when a bound is not met."""
    parser = argparse.ArgumentParser(description="Measure the structure of the package against its bounds.")
    parser.add_argument("--root", type=Path, default=Path(__file__).parents[1], help="checkout to measure")
    parser.add_argument("--report", action="store_true", help="print only, and succeed whatever was measured")
    parser.add_argument("--list", action="store_true", help="add what was counted")
    options = parser.parse_args()
    root = options.root.resolve()
    # The checkout that is measured is the one that is imported, whatever is installed.
    sys.path[:0] = [str(root), str(root / "scripts")]
    source = Source(root)
    rows = [row for measure in MEASURES for row in measure(source)]
    print(table(rows))
    for row in rows if options.list else ():
        if row.counted:
            print(f"\n{row.quantity}:", *row.counted, sep="\n    ")
    return 0 if options.report or all(row.holds for row in rows) else 1


if __name__ == "__main__":
    sys.exit(main())
