"""How many small faults in the code do the tests find?

    scripts/run-python benchmarks/mutants.py --folder tracking --count 25 --seed 1

Draws places from all modules of a folder of rf_pointing, covered by tests or not, puts one fault at a time into a copy of
the tree and runs the tests that can find it.  One run of the folder's tests records which functions each of them calls.
A fault is then given to the tests that call its function, cheapest first, then to the others of the same files (a value
kept from an earlier test hides a call), and with `--importers` to the tests of other folders that name something the
module defines.  The first failure ends the run.  Each run is forked from one process that has imported the libraries,
and its bound counts processor time: a busy machine changes no verdict.  A fault that survives either shows a test that
is missing, or changes nothing that can be seen (a loop bound that is never reached); those are for the reader to tell
apart.  With `--results FILE` each verdict is written as it comes, and a second run goes on behind the last one.

The faults: a comparison or a condition the other way, one more or one less at a bound of whole numbers, + for -, * for /,
`and` for `or`, a constant inside a function larger, a sign lost, a returned sign wrong, a call left out.  Messages,
annotations, decorators and pictures are left alone, and so are declared parameters and constants at module level, which
are settings.
"""

import argparse
import ast
import contextlib
import copy
import importlib
import importlib.util
import json
import math
import os
import random
import re
import resource
import shutil
import signal
import sys
import tempfile
import threading
import time
import warnings
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from types import FrameType

import pytest

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = "rf_pointing"
NOT_COPIED = shutil.ignore_patterns(".*", "__pycache__", "build", "install", "log")
# Messages, logs and declared settings.
QUIET_CALLS = ("parameter", "warn", "warning", "info", "debug", "error", "print", "say", "ValueError", "join")
# Imported once, before the forks; pytest itself refuses plugins that are imported before it starts.
LIBRARIES = ("astropy", "jinja2", "matplotlib", "numpy", "rclpy", "scipy", "sgp4", "skyfield", "yaml")
OPPOSITE: dict[type[ast.cmpop], type[ast.cmpop]] = {
    ast.Lt: ast.GtE, ast.GtE: ast.Lt, ast.Gt: ast.LtE, ast.LtE: ast.Gt, ast.Eq: ast.NotEq, ast.NotEq: ast.Eq,
    ast.Is: ast.IsNot, ast.IsNot: ast.Is, ast.In: ast.NotIn, ast.NotIn: ast.In,
}  # fmt: skip
BOUND: dict[type[ast.cmpop], type[ast.cmpop]] = {ast.Lt: ast.LtE, ast.LtE: ast.Lt, ast.Gt: ast.GtE, ast.GtE: ast.Gt}
ARITHMETIC: dict[type[ast.operator], type[ast.operator]] = {
    ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult, ast.FloorDiv: ast.Mult,
}  # fmt: skip


@dataclass(frozen=True)
class Mutant:
    """One fault: the file, the bytes it replaces and what stands there instead."""

    path: Path
    line: int
    begin: int
    end: int
    old: str
    new: str
    function: int
    """First line of the innermost function around the place."""

    def __str__(self) -> str:
        old, new = (text if len(text) <= 90 else text[:87] + "..." for text in (self.old, self.new))
        return f"{self.path}:{self.line}  {old}  ->  {new}"

    def apply(self, tree: Path) -> bytes:
        """Put the fault into a copy of the tree; return the file as it was."""
        file = tree / self.path
        source = file.read_bytes()
        rewrite(file, source[: self.begin] + self.new.encode() + source[self.end :])
        return source


def rewrite(file: Path, source: bytes) -> None:
    """Write a module; its compiled form goes, which a change of one character may not outdate."""
    file.write_bytes(source)
    Path(importlib.util.cache_from_source(str(file))).unlink(missing_ok=True)


def mutants_of(path: Path) -> list[Mutant]:
    """Return every fault that the module (relative to the tree) can be given."""
    source = (ROOT / path).read_bytes()
    if re.search(rb"(?:import|from) matplotlib|picture_style import [^)]*\bfigure\b", source):
        return []
    starts = [0]
    for row in source.splitlines(keepends=True):
        starts.append(starts[-1] + len(row))

    def place(node: ast.expr | ast.stmt) -> tuple[int, int]:
        end_line, end_column = node.end_lineno or node.lineno, node.end_col_offset or 0
        return starts[node.lineno - 1] + node.col_offset, starts[end_line - 1] + end_column

    parsed = ast.parse(source)
    functions = [node for node in ast.walk(parsed) if isinstance(node, ast.FunctionDef)]

    def around(node: ast.expr | ast.stmt) -> int:
        return max(
            min([function.lineno, *(decorator.lineno for decorator in function.decorator_list)])
            for function in functions
            if function.lineno <= node.lineno <= (function.end_lineno or function.lineno)
        )

    return [
        Mutant(path, node.lineno, *place(node), ast.unparse(node), text, around(node))
        for node, text in _faults(parsed, False)
    ]


def _faults(node: ast.AST, in_function: bool) -> Iterator[tuple[ast.expr | ast.stmt, str]]:
    if isinstance(node, ast.Raise | ast.Assert | ast.JoinedStr | ast.Import | ast.ImportFrom):
        return
    if isinstance(node, ast.Call) and _name(node.func) in QUIET_CALLS:
        return
    if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
        return
    # `zip(..., strict=True)` asserts and does nothing else.
    if isinstance(node, ast.keyword) and node.arg == "strict":
        return
    inside = in_function or isinstance(node, ast.FunctionDef)
    if inside:
        yield from _faults_here(node)
    for field, value in ast.iter_fields(node):
        if field in ("annotation", "returns", "decorator_list", "type_params", "bases"):
            continue
        for child in value if isinstance(value, list) else [value]:
            if isinstance(child, ast.AST):
                yield from _faults(child, inside)


def _faults_here(node: ast.AST) -> Iterator[tuple[ast.expr | ast.stmt, str]]:
    match node:
        case ast.Compare(ops=[op], left=left, comparators=[right]):
            yield node, _changed(node, ops=[OPPOSITE[type(op)]()])
            if type(op) in BOUND and (_whole(left) or _whole(right)):
                yield node, _changed(node, ops=[BOUND[type(op)]()])
        case ast.BinOp(op=op, left=left) if type(op) in ARITHMETIC and not isinstance(left, ast.JoinedStr):
            yield node, _changed(node, op=ARITHMETIC[type(op)]())
        case ast.BoolOp(op=op):
            yield node, _changed(node, op=ast.Or() if isinstance(op, ast.And) else ast.And())
        case ast.UnaryOp(op=ast.Not() | ast.USub(), operand=operand):
            yield node, f"({ast.unparse(operand)})"
        case ast.If(test=ast.Name() | ast.Attribute() | ast.Call() as test):
            yield test, f"(not {ast.unparse(test)})"
        case ast.Constant(value=bool(value)):
            yield node, str(not value)
        case ast.Constant(value=int(value)):
            yield node, str(value + 1)
        case ast.Constant(value=float(value)):
            yield node, repr(1.3 * value if value else 1.0)
        case ast.Expr(value=ast.Call(func=func)) if _name(func) not in QUIET_CALLS:
            yield node, "pass"
        case ast.FunctionDef(returns=ast.Name(id="float" | "Array")):
            for inner in ast.walk(node):
                if isinstance(inner, ast.Return) and inner.value is not None:
                    yield inner, f"return -({ast.unparse(inner.value)})"


def _changed(node: ast.expr, **fields: object) -> str:
    changed = copy.copy(node)
    for name, value in fields.items():
        setattr(changed, name, value)
    return f"({ast.unparse(changed)})"


def _name(function: ast.expr) -> str:
    return function.attr if isinstance(function, ast.Attribute) else getattr(function, "id", "")


def _whole(node: ast.expr) -> bool:
    counted = isinstance(node, ast.Call) and _name(node.func) == "len"
    return counted or (isinstance(node, ast.Constant) and type(node.value) is int)


@dataclass
class Calls:
    """What a clean run of tests shows: their seconds, the functions they call and the libraries they import."""

    seconds: dict[str, float]
    tests_of: dict[str, list[str]]
    libraries: list[str]


class Recorder:
    """A plugin of pytest: notes the functions of the package that each test calls."""

    def __init__(self, tree: Path) -> None:
        self.package = f"{tree / PACKAGE}{os.sep}"
        self.seconds: dict[str, float] = {}
        self.called: dict[str, set[str]] = {}
        self._now: set[str] = set()

    @pytest.hookimpl(hookwrapper=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> Iterator[None]:
        self._now = self.called.setdefault(item.nodeid, set())
        begun = time.process_time()
        sys.settrace(self._trace)
        threading.settrace(self._trace)
        yield
        sys.settrace(None)
        self.seconds[item.nodeid] = time.process_time() - begun

    def _trace(self, frame: FrameType, _event: str, _arg: object) -> None:
        code = frame.f_code
        # Nothing is returned: lines are not traced, which keeps the run nearly as fast as without.
        if code.co_filename.startswith(self.package):
            self._now.add(f"{code.co_filename.removeprefix(self.package)}:{code.co_firstlineno}")

    def calls(self) -> Calls:
        """Return what was recorded."""
        tests_of: dict[str, list[str]] = {}
        for test, functions in self.called.items():
            for function in functions:
                tests_of.setdefault(function, []).append(test)
        libraries = [name for name in sys.modules if name.partition(".")[0] in LIBRARIES]
        return Calls(self.seconds, tests_of, libraries)


class Suite:
    """Runs the tests of a copy of the tree that can find a fault in a module."""

    def __init__(self, tree: Path, limit_s: float, importers: bool) -> None:
        self.tree, self.limit_s, self.importers = tree, limit_s, importers
        self._calls: dict[Path, Calls] = {}

    def verdict(self, mutant: Mutant) -> str:
        """Return "killed", "timed out", "survived", or "undecided" where the machine is too slow."""
        groups = self.groups(mutant)
        before = mutant.apply(self.tree)
        try:
            for tests, limit_s in groups:
                result = self._run(tests, limit_s)
                if result != "survived":
                    return result
        finally:
            rewrite(self.tree / mutant.path, before)
        return "survived"

    def groups(self, mutant: Mutant) -> list[tuple[list[str], float]]:
        """Return the tests that can find a fault, nearest first, each group with its bound in seconds of the processor."""
        room = Path("test", mutant.path.parts[1])
        calls = self._calls_of(room)
        within = str(mutant.path.relative_to(PACKAGE))
        callers = set(calls.tests_of.get(f"{within}:{mutant.function}", ()))
        if not callers:
            # A function that runs on import belongs to every test of its module.
            callers = {
                test for test in calls.seconds if Path(test.partition("::")[0]).stem == f"test_{mutant.path.stem}"
            }
        own = [test for test in callers if _file(test).stem == f"test_{mutant.path.stem}"]
        files = set(map(_file, callers))
        others = [test for test in calls.seconds if test not in callers and _file(test) in files]
        # A fault that makes its tests take several times as long has been found.
        chosen = [
            (
                sorted(tests, key=calls.seconds.__getitem__),
                self.limit_s + 5.0 * sum(calls.seconds[test] for test in tests),
            )
            for tests in (own, callers.difference(own), others)
        ]
        far = [(self._importers(mutant.path), 10.0 * self.limit_s)] if self.importers else []
        return [(tests, limit_s) for tests, limit_s in chosen + far if tests]

    def _importers(self, module: Path) -> list[str]:
        text = (self.tree / module).read_text(encoding="utf-8")
        public = re.findall(r"^(?:class|def) ([A-Za-z]\w*)|^([A-Z]\w*)\b.*=", text, re.MULTILINE)
        names = re.compile(r"\b(" + "|".join([module.stem, *(a or b for a, b in public)]) + r")\b")
        imported = re.compile(rf"{PACKAGE}\.{'.'.join(module.parts[1:-1])}\b")
        room = Path("test", module.parts[1])
        words = {path: (self.tree / path).read_text(encoding="utf-8") for path in self._tests(Path("test"))}
        return [
            str(path)
            for path, text in words.items()
            if room not in path.parents and imported.search(text) and names.search(text)
        ]

    def _calls_of(self, room: Path) -> Calls:
        if room not in self._calls:
            files = [str(path) for path in self._tests(room)]
            result = self.tree / f"calls_{room.name}.json"
            if os.fork() == 0:
                try:
                    recorder = Recorder(self.tree)
                    self._child(files, stop=False, plugins=[recorder])
                    result.write_text(json.dumps(asdict(recorder.calls())), encoding="utf-8")
                finally:
                    # The copy of the tree belongs to the first process.
                    os._exit(0)
            os.wait()
            self._calls[room] = Calls(**json.loads(result.read_text(encoding="utf-8")))
            _import_all(self._calls[room].libraries)
            seconds = self._calls[room].seconds
            cheapest = sorted(seconds, key=seconds.__getitem__)[:20]
            if self._run(cheapest, 10.0 * self.limit_s) != "survived":
                raise RuntimeError(f"{room}: the tests fail without a fault; run them by themselves first")
        return self._calls[room]

    def _tests(self, folder: Path) -> list[Path]:
        # Live graphs take minutes each.
        return sorted(
            path.relative_to(self.tree)
            for path in (self.tree / folder).rglob("test_*.py")
            if not {"graph", "faults"} & set(path.relative_to(self.tree).parts)
        )

    def _child(self, tests: list[str], stop: bool, plugins: list[object]) -> int:
        """Run pytest in a forked process."""
        os.setsid()
        os.chdir(self.tree)
        sys.path.insert(0, str(self.tree))
        os.environ["PYTHONPATH"] = f"{self.tree}{os.pathsep}{os.environ.get('PYTHONPATH', '')}"
        quiet = os.open(os.devnull, os.O_WRONLY)
        os.dup2(quiet, 1)
        os.dup2(quiet, 2)
        first = ["-x"] if stop else []
        return int(pytest.main([*first, "-q", "-p", "no:cacheprovider", "-m", "not graph", *tests], plugins))

    def _run(self, tests: list[str], limit_s: float) -> str:
        child = os.fork()
        if child == 0:
            resource.setrlimit(resource.RLIMIT_CPU, (math.ceil(limit_s), math.ceil(limit_s) + 1))
            status = 1
            try:
                status = self._child(tests, stop=True, plugins=[])
            finally:
                os._exit(status)
        latest = time.monotonic() + 20.0 * limit_s
        while (ended := os.waitpid(child, os.WNOHANG))[0] == 0:
            if time.monotonic() > latest:
                os.killpg(child, signal.SIGKILL)
                os.waitpid(child, 0)
                return "undecided"
            time.sleep(0.02)
        if os.WIFSIGNALED(ended[1]):
            return "timed out" if os.WTERMSIG(ended[1]) in (signal.SIGXCPU, signal.SIGKILL) else "killed"
        # 5: no test applies.
        return "survived" if os.WEXITSTATUS(ended[1]) in (0, 5) else "killed"


def _file(test: str) -> Path:
    return Path(test.partition("::")[0])


def _import_all(libraries: list[str]) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for name in libraries:
            # Some parts of libraries cannot be imported by name alone; a test then does it itself.
            with contextlib.suppress(Exception):
                importlib.import_module(name)


def main() -> int:
    """Sample, try and print; the exit status says whether a fault survived."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--folder", nargs="+", default=["calibration", "ephemeris", "planning", "tracking"])
    parser.add_argument("--count", type=int, default=25, help="faults per folder")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--limit", type=float, default=30.0, help="seconds beyond five times those of the clean tests")
    parser.add_argument("--importers", action="store_true", help="also run tests of other folders, which takes longer")
    parser.add_argument("--results", type=Path, help="file of verdicts; what it already holds is not tried again")
    parser.add_argument(
        "--only", nargs="+", default=[""], help="only modules or faults whose line contains one of these"
    )
    options = parser.parse_args()
    rows = []
    with tempfile.TemporaryDirectory(prefix="mutants_") as scratch:
        tree = Path(scratch) / "tree"
        shutil.copytree(ROOT, tree, ignore=NOT_COPIED, symlinks=True)
        suite = Suite(tree, options.limit, options.importers)
        known = {}
        if options.results and options.results.is_file():
            for row in options.results.read_text(encoding="utf-8").splitlines():
                known[row[19:]] = row[:9].strip()
        for folder in options.folder:
            modules = sorted(path.relative_to(ROOT) for path in (ROOT / PACKAGE / folder).rglob("*.py"))
            all_faults = [
                fault
                for path in modules
                for fault in mutants_of(path)
                if any(text in str(fault) for text in options.only)
            ]
            if not all_faults:
                parser.error(f"--folder {folder}: no place for a fault in {PACKAGE}/{folder}")
            chosen = random.Random(options.seed).sample(all_faults, min(options.count, len(all_faults)))
            verdicts = []
            for fault in chosen:
                if str(fault) in known:
                    verdicts.append(known[str(fault)])
                    continue
                begun = time.monotonic()
                verdicts.append(suite.verdict(fault))
                row = f"{verdicts[-1]:9s} {time.monotonic() - begun:5.0f} s  {fault}"
                print(row, flush=True)
                if options.results:
                    with options.results.open("a", encoding="utf-8") as results:
                        results.write(f"{row}\n")
            rows.append((folder, *(verdicts.count(word) for word in ("killed", "timed out", "survived", "undecided"))))
    print(f"\n{'folder':24s} killed  timed out  survived  undecided  found")
    for folder, killed, late, survived, undecided in rows:
        share = 100.0 * (killed + late) / max(killed + late + survived, 1)
        print(f"{folder:24s} {killed:6d} {late:10d} {survived:9d} {undecided:10d} {share:5.0f} %")
    return int(any(row[3] for row in rows))


if __name__ == "__main__":
    sys.exit(main())
