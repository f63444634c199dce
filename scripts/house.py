"""Measure the structure of the package and hold it against the bounds of `house.toml`.

Prints one row per quantity and fails when one is worse than its bound.  A bound may only fall
towards the wanted value: `--tighten` writes what is measured, and a bound that is looser than any
committed before is refused unless its line gives the reason (`because`).  `--report` only prints,
and adds the memory of the nodes; `--list` adds what was counted.

Most is read from the source.  Run, each in a process of its own: the imports, a controller period,
and `track` up to the start of its first node.
"""

import argparse
import ast
import gc
import importlib.util
import io
import json
import math
import os
import re
import subprocess
import sys
import tempfile
import tokenize
import tomllib
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import Any

PACKAGE = "rf_pointing"
BOUNDS = "scripts/house.toml"
OTHER_ROOMS = ("array_sensors", "papers")
"""Packages below the package that are not the station."""
SMALL_LINES = 60
SMALL_ON_PURPOSE: dict[str, str] = {
    "rf_pointing/calibration/ionosphere.py": "one physical model with its source, no step of the pipeline",
    "rf_pointing/api/keywords.py": "the rule of the public surface: angles and times by a name with its unit",
    "rf_pointing/ros/recorder.py": "examples record with it, too",
    "rf_pointing/ros/band_change.py": "nodes of one band stand on nothing of it",
    "rf_pointing/station/description/remarks.py": "nodes load the description without them",
    "rf_pointing/station/description/writing.py": "nodes load the description without it",
    "rf_pointing/station/derive/signal.py": "one block of the derivation, like its neighbours",
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
ONE_KEY = "hard_stop_deg"
"""Key of a station description that is derived into the parameters of one block."""
ONE_FIELD = "transmit_inhibit"
"""Field of a message, from the part that computes it to what shows it."""
ONE_COMMAND = "disable"
"""Command of the antenna that is the same for every mount and drive."""
LIVE_IMPORTS = ("nodes.monopulse_tracker", "nodes.simulation_clock", "commands.fetch_elements")
EIGHT_NODES = (
    "simulation_clock", "antenna_servo", "rf_receiver", "monopulse_tracker", "conscan_tracker",
    "bias_calibrator", "ephemeris_publisher", "pointing_controller",
)  # fmt: skip
"""Nodes of a simulated antenna."""
ASSEMBLY = ("api/", "commands/", "ros/", "station/")
COMPUTING = ("station/derive/",)
"""Rooms that put the parts together, and of these what computes; that is not on a word's way."""
NODE_LINES = 150
COLUMNS = 100
EXAMPLES = ("simulate_pass", "first_steps")
BY_NAME = {"delattr", "getattr", "hasattr", "object", "patch", "setattr"}
"""Calls that take the name of an attribute as a string."""
OF_NAMED_TUPLES = {"_asdict", "_fields", "_make", "_replace"}
"""Public in spite of their underscore."""
CONTROLLER_SETS = {"AutotrackParams", "ConscanParams", "SpiralParams"}
"""Parameter sets that only a list of all sets of the controller names together."""
DIRECTIVE = re.compile(r"#\s*(!|fmt:|noqa|type:|ruff:|mypy:|pragma|shellcheck|-\*-|isort:)")
SETTLED_PERIODS = 30
"""Periods in monopulse before the measured one: what a change of mode sets off is over by then."""


@dataclass(frozen=True)
class Row:
    """One quantity: its key in `house.toml`, what was measured, and what was counted."""

    key: str
    quantity: str
    measured: float
    counted: list[str] = field(default_factory=list)


@dataclass(frozen=True)
class Bound:
    """A line of `house.toml`: the bound of today, which is an upper one unless `least`."""

    today: float
    wanted: float
    least: bool = False
    because: str = ""

    def looser_than(self, today: float) -> bool:
        """Return whether this bound would let through what `today` does not."""
        return self.today < today if self.least else self.today > today

    def tightened(self, measured: float) -> float:
        """Return the bound that `measured` allows, between today's and the wanted one."""
        worst = min(measured, self.wanted) if self.least else max(measured, self.wanted)
        return max(self.today, worst) if self.least else min(self.today, worst)


def bounds_of(text: str) -> dict[str, Bound]:
    """Return the bounds of a file `house.toml` by key."""
    found = {}
    for key, line in tomllib.loads(text).items():
        least = "at_least" in line
        found[key] = Bound(line["at_least" if least else "at_most"], line["wanted"], least, line.get("because", ""))
    return found


def loosened(root: Path, bounds: dict[str, Bound]) -> list[str]:
    """Return the bounds without a reason that are looser than in a commit before."""
    git = ["git", "-C", str(root)]
    listed = subprocess.run([*git, "log", "--format=%H", "--", BOUNDS], capture_output=True, text=True, check=False)
    found = {}
    for commit in listed.stdout.split():
        shown = subprocess.run([*git, "show", f"{commit}:{BOUNDS}"], capture_output=True, text=True, check=False)
        for key, before in bounds_of(shown.stdout).items():
            if key in bounds and not bounds[key].because and bounds[key].looser_than(before.today):
                found[key] = f"{key} = {bounds[key].today:g} was {before.today:g} in {commit[:8]}"
    return list(found.values())


def tightened(text: str, rows: list[Row]) -> str:
    """Return the text of `house.toml` with the bounds that the rows allow."""
    bounds = bounds_of(text)
    for row in rows:
        bound = bounds[row.key].tightened(row.measured)
        text = re.sub(rf"(?m)^({row.key} = .*?at_\w+ = )[\d.]+", rf"\g<1>{bound:g}", text)
    return text


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
    def nodes(self) -> list[ast.AST]:
        """Every node of the syntax tree."""
        return list(ast.walk(self.tree))

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
        bodies = (getattr(node, "body", None) for node in self.nodes)
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
        self.tests = [*self._beside("test")]
        self.around = [*self._beside("examples"), *self._beside("benchmarks")]
        folders = ("msg", "srv", "action")
        found = [path for kind in folders for path in sorted((root / "msg_defs" / kind).glob(f"*.{kind}"))]
        found += [*sorted((root / PACKAGE / "web" / "page").glob("*.js")), root / "docs" / "my_station.md"]
        self.interfaces = {path.relative_to(root).as_posix(): path.read_text() for path in found}

    def _beside(self, folder: str) -> Iterator[Module]:
        for path in sorted((self.root / folder).rglob("*.py")):
            yield Module("", path.relative_to(self.root).as_posix(), path.read_text())

    def imported_by(self, module: str) -> dict[str, Any]:
        """Return files of the package and memory of a fresh process that has imported a module."""
        code = f"""
import json, sys
import {PACKAGE}.{module}
found = [getattr(each, "__file__", None) for name, each in sys.modules.items() if name.split(".")[0] == "{PACKAGE}"]
resident = open("/proc/self/status").read().split("VmRSS:")[1].split()[0]
print(json.dumps({{"files": [file for file in found if file], "kB": int(resident)}}))
"""
        environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(self.root), os.environ.get("PYTHONPATH", "")])}
        command = [sys.executable, "-c", code]
        run = subprocess.run(command, cwd=self.root, env=environment, capture_output=True, text=True, check=True)
        found: dict[str, Any] = json.loads(run.stdout)
        return found

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
        # Lazy packages name what they hand on below `if TYPE_CHECKING`.
        for node in where.nodes if where.is_package else ():
            if isinstance(node, ast.ImportFrom) and node.module:
                for alias in node.names:
                    if (alias.asname or alias.name) == name:
                        return self.origin(node.module, alias.name)
        submodule = f"{module}.{name}"
        return submodule if submodule in self.modules else module

    @cached_property
    def importers(self) -> dict[str, set[str]]:
        """For every module the modules that import what it defines, re-exports left out."""
        found: dict[str, set[str]] = {name: set() for name in self.modules}
        for importer in self.modules.values():
            for node in importer.nodes:
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
    """Lines of the station, of the tests, and their ratio to those of the package."""
    lines = sum(module.lines for module in source.station)
    product = sum(module.lines for module in source.modules.values())
    tests = sum(module.lines for module in source.tests)
    rooms: dict[str, int] = {}
    for module in source.tests:
        room = module.path.split("/")[1]
        rooms[room] = rooms.get(room, 0) + module.lines
    counted = [f"{count:6d}  {room}" for room, count in sorted(rooms.items(), key=lambda item: -item[1])]
    return [
        Row("station_lines", f"lines of the station, in {len(source.station)} modules", lines),
        Row("test_lines", "lines of the tests", tests, counted),
        Row("test_ratio", "lines of the tests / of the package", round(tests / product, 2)),
    ]


def small_modules(source: Source) -> list[Row]:
    """Modules that may be a part of their only importer."""
    found = []
    for module in source.modules.values():
        importers = source.importers[module.name]
        small = module.lines < SMALL_LINES and not module.is_package and module.name not in source.executables
        if small and len(importers) == 1:
            reason = SMALL_ON_PURPOSE.get(module.path, "no reason given")
            found.append(f"{module.path} ({module.lines}) <- {next(iter(importers))}: {reason}")
    unexplained = [line for line in found if line.endswith("no reason given")]
    return [
        Row("small_modules", f"modules below {SMALL_LINES} lines with one importer", len(found), found),
        Row("small_unexplained", "of these, without a reason", len(unexplained), unexplained),
    ]


def imports(source: Source) -> list[Row]:
    """Lines of the modules of the package that are loaded once a program is imported."""
    rows = []
    for name in LIVE_IMPORTS:
        loaded = source.imported_by(name)["files"]
        rooms: dict[str, int] = {}
        for file in loaded:
            path = Path(file).relative_to(source.root / PACKAGE)
            room = path.parts[0] if len(path.parts) > 1 else "."
            rooms[room] = rooms.get(room, 0) + len(Path(file).read_text().splitlines())
        counted = [f"{lines:6d}  {room}" for room, lines in sorted(rooms.items(), key=lambda item: -item[1])]
        program = name.split(".")[-1]
        rows.append(Row(f"below_{program}", f"lines below `import {program}`", sum(rooms.values()), counted))
    return rows


def memory(source: Source) -> list[Row]:
    """Resident memory of the nodes once they are imported, in MB of 1000 kB."""
    each = {name: source.imported_by(f"nodes.{name}")["kB"] / 1000.0 for name in EIGHT_NODES}
    counted = [f"{megabytes:6.1f}  {name}" for name, megabytes in each.items()]
    return [
        Row("tracker_megabytes", "memory of monopulse_tracker, imported, in MB", round(each["monopulse_tracker"])),
        Row("nodes_megabytes", "memory of the eight nodes, imported, in MB", round(sum(each.values())), counted),
    ]


def faces(source: Source) -> list[Row]:
    """How thin commands and nodes are."""
    taking = []
    for module in source.modules.values():
        for node in module.nodes:
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
                arguments = (*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs)
                if any("Namespace" in ast.unparse(each.annotation) for each in arguments if each.annotation):
                    taking.append(f"{module.path}:{node.lineno} {node.name}")
    nodes = [module for module in source.modules.values() if "nodes" in module.path.split("/")]
    found = ((module.path, node) for module in nodes for node in module.nodes if isinstance(node, ast.ClassDef))
    classes = sorted(((_lines(node), f"{path}:{node.lineno} {node.name}") for path, node in found), reverse=True)
    running = [module for module in nodes if module.name in source.executables and module.lines > NODE_LINES]
    long = [f"{module.lines:4d}  {module.path}" for module in sorted(running, key=lambda module: -module.lines)]
    return [
        Row("namespaces", "functions that take argparse.Namespace", len(taking), taking),
        Row("node_class", "longest class of a node, in lines", classes[0][0], [f"{n:4d}  {c}" for n, c in classes[:8]]),
        Row("long_nodes", f"nodes above {NODE_LINES} lines", len(long), long),
    ]


def _lines(node: ast.ClassDef | ast.FunctionDef) -> int:
    return (node.end_lineno or node.lineno) - node.lineno + 1


def word_of_track(source: Source) -> list[Row]:
    """The way of the word after `--satellite` from `track`'s main to the start of the first node.

    Walked: all that runs of the assembly (`ASSEMBLY`), which a reader may have to visit.  Carrying:
    what of it is called with something that carries the word.  Climbs: functions that return such a
    thing to their caller.  The word is known by its identity, and found at most two levels deep.
    """
    with tempfile.TemporaryDirectory() as folder:
        measure = [sys.executable, __file__, "--root", str(source.root), "--word-of-track"]
        run = subprocess.run(measure, cwd=folder, capture_output=True, text=True, check=False)
    if run.returncode:
        raise RuntimeError(f"the word of track could not be followed: {run.stderr[-2000:]}")
    found = json.loads(run.stdout)
    return [
        Row("walk_files", "files that run between track's word and its target", len(found["ran in"]), found["ran in"]),
        Row("walk_functions", "functions that run between them", len(found["ran"]), found["ran"]),
        Row("word_files", "files that the word is carried through", len(found["files"]), found["files"]),
        Row("word_climbs", "functions that return it", len(found["climbs"]), found["climbs"]),
        Row("word_functions", "functions that it is carried through", len(found["functions"]), found["functions"]),
    ]


class _WordArrivedError(BaseException):
    """Ends `track` where it would start the first node; no handler of errors stops it."""


def follow_word(root: Path) -> dict[str, list[str]]:
    """Run `track` up to its first node, and return files, functions and climbs on the way."""
    from rf_pointing.commands import track

    # Joined when it runs, so that no constant is the same object.
    word, folder = "".join(["280", "57"]), str(root / PACKAGE) + os.sep
    kinds = ("ran in", "ran", "files", "functions", "climbs")
    found: dict[str, set[str]] = {kind: set() for kind in kinds}

    beside = 0

    def note(frame: Any, event: str, result: object) -> None:
        nonlocal beside
        code = frame.f_code
        file = code.co_filename.removeprefix(folder)
        # What a lazy import runs, and what is computed, is not on the way, nor is what they call.
        if code.co_name == "<module>" or file.startswith(COMPUTING):
            beside += {"call": 1, "return": -1}.get(event, 0)
        if beside or event not in ("call", "return") or code.co_name.startswith("<") or not file.startswith(ASSEMBLY):
            return
        if event == "call":
            found["ran in"].add(file)
            found["ran"].add(f"{file} {code.co_qualname}")
        if event == "call" and any(_carries(value, word) for value in frame.f_locals.values()):
            found["files"].add(file)
            found["functions"].add(f"{file} {code.co_qualname}")
        elif event == "return" and _carries(result, word):
            found["climbs"].add(f"{file} {code.co_qualname}")

    def arrived(*_arguments: object, **_named: object) -> None:
        raise _WordArrivedError

    subprocess.Popen = arrived  # type: ignore[assignment, misc]
    sys.setprofile(note)
    try:
        track.main(["--satellite", word])
    except _WordArrivedError:
        return {what: sorted(names) for what, names in found.items()}
    finally:
        sys.setprofile(None)
    raise RuntimeError("track ended before it has started a node")


def _carries(value: Any, word: str, levels: int = 2) -> bool:
    """Return whether a value is the word, or holds it so many levels deep."""
    if value is word or not levels:
        return value is word
    if isinstance(value, dict):
        held: Iterable[Any] = value.values()
    else:
        held = value if isinstance(value, list | tuple | set) else getattr(value, "__dict__", {}).values()
    return any(_carries(each, word, levels - 1) for each in held)


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
        Row("period_files", "files that one controller period runs through", len(files), counted),
        Row("period_changes", "changes of file in one controller period", changes),
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


def places(source: Source) -> list[Row]:
    """Files that a new key, message field, tracker or command is written into.

    Counted are those that name one that exists; docstrings and comments are not names.  The own
    modules of the tracker, `tracking/conscan*`, are not counted; its node is.
    """
    own = f"/tracking/{ONE_TRACKER}"
    rows = []
    for key, what, word in (
        ("key_files", "station key", ONE_KEY),
        ("field_files", "message field", ONE_FIELD),
        ("tracker_files", "tracker", ONE_TRACKER),
        ("command_files", "mount-independent command", ONE_COMMAND),
    ):
        modules = (module for module in source.station if own not in module.path)
        # Not where it is a part of another word, as in --disable-external-lib-logs.
        whole = re.compile(word if word == ONE_TRACKER else rf"(?<!-)\b{word}\b(?!-)")
        found = [m.path for m in modules if any(whole.search(name.lower()) for name in _words(m))]
        if word != ONE_TRACKER:
            found += [path for path, text in source.interfaces.items() if re.search(rf"\b{word}\b", text)]
        rows.append(Row(key, f"files of a new {what}, like `{word}`", len(found), found))
    return rows


def _words(module: Module) -> Iterator[str]:
    """Yield every identifier, imported module and string of the code."""
    for node in module.nodes:
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
            strings = (n for n in module.nodes if isinstance(n, ast.Constant) and n.value in words)
            hits = [string for string in strings if id(string) not in enum]
            lines = {n.lineno for n in hits if id(n) not in edge}
            counted += [f"{module.path}:{line}" for line in sorted(lines)]
            ros += len({n.lineno for n in hits if id(n) in edge} - lines)
        if not words:
            raise ValueError(f"no {what} is known: the enum of modes was not found")
        also = [f"and {ros} names of topics and parameter sets"] if ros else []
        quantity = f"lines with a {what} name as a string literal"
        rows.append(Row(f"{what}_literals", quantity, len(counted), counted + also))
    return rows


def _members(source: Source, enum: str) -> set[str]:
    """Return the values of the members of the station's enum of this name."""
    classes = (n for m in source.station for n in m.nodes if isinstance(n, ast.ClassDef) and n.name == enum)
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
        loops = [n for n in module.nodes if isinstance(n, ast.For | ast.While) and _steps_a_plant(n)]
        inner = {id(below) for loop in loops for below in ast.walk(loop) if below is not loop}
        found += [f"{module.path}:{loop.lineno}" for loop in loops if id(loop) not in inner]
    return [Row("time_loops", "time loops of the servo", len(found), found)]


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
    modules = [*source.modules.values(), *source.tests, *source.around]
    found = [
        f"{module.path}:{getattr(node, 'lineno', 0)}"
        for module in modules
        if all(name in module.text for name in CONTROLLER_SETS)
        for node in module.nodes
        if CONTROLLER_SETS.issubset(_wired(node))
    ]
    return [Row("wirings", "wirings of the controller's parameters", len(found), found)]


def _wired(node: ast.AST) -> Iterable[str]:
    if isinstance(node, ast.ClassDef):
        parts: list[ast.AST] = [statement for statement in node.body if isinstance(statement, ast.AnnAssign)]
    else:
        parts = [node] if isinstance(node, ast.Call | ast.Dict) else []
    return (_last(below) for part in parts for below in ast.walk(part))


def comments(source: Source) -> list[Row]:
    """Lines with a comment that is not a directive for a tool."""
    rows = []
    for what, modules in (("station", source.station), ("package", list(source.modules.values()))):
        lines = sum(module.lines for module in modules)
        share = 100.0 * sum(_commented(module.text) for module in modules) / lines
        rows.append(Row(f"{what}_comments", f"comments, % of the lines of the {what}", round(share, 1)))
    return rows


def _commented(text: str) -> int:
    tokens = tokenize.generate_tokens(io.StringIO(text).readline)
    return len({t.start[0] for t in tokens if t.type == tokenize.COMMENT and not DIRECTIVE.match(t.string)})


def parameters(source: Source) -> list[Row]:
    """Parameters that a node declares and docs/parameters.md does not list."""
    import parameter_page

    page = source.root / "docs" / "parameters.md"
    wanted = parameter_page.documented(parameter_page.parameter_page(parameter_page.declarations()))
    missing = wanted - (parameter_page.documented(page.read_text()) if page.exists() else set())
    counted = [f"{node} {name}" for node, name in sorted(missing)]
    return [Row("unlisted_parameters", "parameters without a line in docs/parameters.md", len(missing), counted)]


def examples(source: Source) -> list[Row]:
    """Modules of the package that an example imports."""
    rows = []
    for name in EXAMPLES:
        tree = ast.parse((source.root / "examples" / f"{name}.py").read_text())
        found = set()
        for node in ast.walk(tree):
            if isinstance(node, ast.Import):
                found |= {alias.name for alias in node.names}
            elif isinstance(node, ast.ImportFrom) and node.module:
                found.add(node.module)
        ours = sorted(module for module in found if module.split(".")[0] == PACKAGE)
        rows.append(Row(f"imports_{name}", f"modules that examples/{name}.py imports", len(ours), ours))
    return rows


def private_names(source: Source) -> list[Row]:
    """Uses of `_names` in the tests that the test module does not define itself.

    As an attribute, in an import, or as the string of a call of `BY_NAME`.
    """
    found, tests = [], []
    for module in source.tests:
        own = _defined(module.nodes)
        uses = [(node, name) for node in module.nodes for name in _private(node) if name not in own]
        found += [f"{module.path}:{node.lineno} {name}" for node, name in uses]
        lines = {node.lineno for node, _ in uses}
        functions = (
            node for node in module.nodes if isinstance(node, ast.FunctionDef) and node.name.startswith("test")
        )
        using = (node for node in functions if lines & set(range(node.lineno, node.lineno + _lines(node))))
        tests += [f"{module.path}:{node.lineno} {node.name}" for node in using]
    return [
        Row("private_uses", "uses of another module's private names in tests", len(found), sorted(found)),
        Row("private_tests", "tests with such a use", len(tests), sorted(tests)),
    ]


def _defined(nodes: Iterable[ast.AST]) -> set[str]:
    """Return the names that a module defines, attributes of `self` included."""
    found = set()
    for node in nodes:
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            found.add(node.name)
        elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            found.add(node.id)
        elif (
            isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Store) and _last(node.value) in ("self", "cls")
        ):
            found.add(node.attr)
    return found | OF_NAMED_TUPLES


def _private(node: ast.AST) -> Iterator[str]:
    """Yield the private names that a node of the syntax tree uses."""
    names = []
    if isinstance(node, ast.Attribute):
        names = [node.attr]
    elif isinstance(node, ast.alias):
        names = [node.name]
    elif isinstance(node, ast.Call) and _last(node.func) in BY_NAME:
        strings = (each.value for each in node.args if isinstance(each, ast.Constant))
        names = [value.split(".")[-1] for value in strings if isinstance(value, str)]
    yield from (name for name in names if re.match(r"_[A-Za-z]", name))


def prose(source: Source) -> list[Row]:
    """Lines over 100 columns of the package, and sentences that test/test_language.py finds."""
    path = source.root / "test" / "test_language.py"
    spec = importlib.util.spec_from_file_location("test_language", path)
    assert spec is not None
    assert spec.loader is not None
    language = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(language)
    of_prose, of_code = [], []
    for module in source.modules.values():
        texts = language.lines_of_prose(Path(source.root / module.path))
        for number, line in enumerate(module.text.splitlines(), 1):
            if len(line) > COLUMNS:
                (of_prose if number in texts else of_code).append(f"{module.path}:{number}")
    sentences = [
        line for paths in language.rooms().values() for path in paths for line in language.weak_sentences(path)
    ]
    return [
        Row("long_prose", f"lines of prose over {COLUMNS} columns", len(of_prose), of_prose),
        Row("long_code", f"lines of code over {COLUMNS} columns", len(of_code), of_code),
        Row("weak_sentences", "sentences like `is none`, docstrings without a verb", len(sentences), sentences),
    ]


MEASURES: tuple[Callable[[Source], list[Row]], ...] = (
    size,
    small_modules,
    imports,
    faces,
    word_of_track,
    places,
    examples,
    private_names,
    prose,
    period,
    literals,
    time_loops,
    wirings,
    comments,
    parameters,
)


def table(rows: list[Row], bounds: dict[str, Bound]) -> str:
    """Return the rows as a table; a star marks what is worse than its bound."""
    cells = [("", "quantity", "measured", "bound", "wanted")]
    for row in rows:
        bound = bounds[row.key]
        sign = ">= " if bound.least else "<= "
        star = "*" if broken(row, bounds) else ""
        cells.append((star, row.quantity, f"{row.measured:,}", f"{sign}{bound.today:,}", f"{sign}{bound.wanted:,}"))
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    lines = [" | ".join(cell.ljust(width) for cell, width in zip(line, widths, strict=True)) for line in cells]
    lines.insert(1, "-|-".join("-" * width for width in widths))
    return "\n".join(f"| {line} |" if "-|-" not in line else f"|-{line}-|" for line in lines)


def broken(row: Row, bounds: dict[str, Bound]) -> bool:
    """Return whether a quantity is worse than its bound."""
    bound = bounds[row.key]
    return row.measured < bound.today if bound.least else row.measured > bound.today


def main() -> int:
    """Print the table; return 1 when a bound is not met or was loosened."""
    parser = argparse.ArgumentParser(description="Measure the structure of the package against its bounds.")
    parser.add_argument("--root", type=Path, default=Path(__file__).parents[1], help="checkout to measure")
    parser.add_argument("--report", action="store_true", help="add the memory, and succeed whatever was measured")
    parser.add_argument("--list", nargs="*", metavar="KEY", help="add what was counted, of all or of these quantities")
    parser.add_argument("--tighten", action="store_true", help=f"write what was measured into {BOUNDS}")
    parser.add_argument("--word-of-track", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    root = options.root.resolve()
    # Nothing becomes garbage: the collector would only walk the syntax trees again and again.
    gc.disable()
    # The checkout that is measured is the one that is imported, whatever is installed.
    sys.path[:0] = [str(root), str(root / "scripts")]
    if options.word_of_track:
        print(json.dumps(follow_word(root)))
        return 0
    source, file = Source(root), root / BOUNDS
    measures = (*MEASURES, memory) if options.report else MEASURES
    rows = [row for measure in measures for row in measure(source)]
    if options.tighten:
        file.write_text(tightened(file.read_text(), rows))
    bounds = bounds_of(file.read_text())
    print(table(rows, bounds))
    for row in rows if options.list is not None else ():
        if row.counted and (not options.list or row.key in options.list):
            print(f"\n{row.key}: {row.quantity}:", *row.counted, sep="\n    ")
    worse = [row for row in rows if broken(row, bounds)]
    for row in worse:
        print(f"house: {row.quantity}: {row.measured:g}, bound {bounds[row.key].today:g}; see --list {row.key}")
    raised = loosened(root, bounds)
    for line in raised:
        print(f"house: a bound only falls: {line}; give the reason in its line, because = '...'")
    return 1 if (worse or raised) and not options.report else 0


if __name__ == "__main__":
    sys.exit(main())
