"""How many small faults in the code do the tests find?

    scripts/run-python benchmarks/mutants.py --folder tracking --count 25 --seed 1

Draws places from all modules of a folder of rf_pointing, covered by tests or not, puts one fault at a time into a copy of
the tree and runs the tests that can find it: those of the module's own name, the other tests of its folder, and with
`--importers` those of other folders that name something the module defines.  The first failure ends the run.  A fault
that survives either shows a test that is missing, or changes nothing that can be seen (a loop bound that is never
reached); those are for the reader to tell apart.

The faults: a comparison or a condition the other way, one more or one less at a bound of whole numbers, + for -, * for /,
`and` for `or`, a constant inside a function larger, a sign lost, a returned sign wrong, a call left out.  Messages,
annotations, decorators and pictures are left alone, and so are declared parameters and constants at module level, which
are settings.
"""

import argparse
import ast
import copy
import importlib.util
import os
import random
import re
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = "rf_pointing"
NOT_COPIED = shutil.ignore_patterns(".*", "__pycache__", "build", "install", "log")
# Messages, logs and declared settings.
QUIET_CALLS = ("parameter", "warn", "warning", "info", "debug", "error", "print", "ValueError", "join")
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
    if b"matplotlib" in source:
        return []
    starts = [0]
    for row in source.splitlines(keepends=True):
        starts.append(starts[-1] + len(row))

    def place(node: ast.expr | ast.stmt) -> tuple[int, int]:
        end_line, end_column = node.end_lineno or node.lineno, node.end_col_offset or 0
        return starts[node.lineno - 1] + node.col_offset, starts[end_line - 1] + end_column

    return [
        Mutant(path, node.lineno, *place(node), ast.unparse(node), text)
        for node, text in _faults(ast.parse(source), False)
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


class Suite:
    """Runs the tests of a copy of the tree that can find a fault in a module."""

    def __init__(self, tree: Path, limit_s: float, importers: bool) -> None:
        self.tree, self.limit_s, self.importers = tree, limit_s, importers
        self._clean: dict[tuple[str, ...], bool] = {}

    def verdict(self, mutant: Mutant) -> str:
        """Return "killed", "timed out", "survived", or "undecided" where `limit_s` is too short."""
        before = mutant.apply(self.tree)
        try:
            results = []
            for tests in self.stages(mutant.path):
                results.append((tests, self._run(tests, self.limit_s)))
                if results[-1][1] == "killed":
                    return "killed"
        finally:
            rewrite(self.tree / mutant.path, before)
        # Tests that take about as long without the fault have not found it.
        late = [tests for tests, result in results if result == "timed out"]
        if not late:
            return "survived"
        return "timed out" if any(self._clean_in_time(tests) for tests in late) else "undecided"

    def stages(self, module: Path) -> list[tuple[str, ...]]:
        """Return the test files of a module, nearest first."""
        room = Path("test", *module.parts[1:-1])
        own = [room / f"test_{module.stem}.py"]
        own = [path for path in own if (self.tree / path).is_file()]
        near = [path for path in self._tests(room) if path not in own]
        text = (self.tree / module).read_text(encoding="utf-8")
        public = re.findall(r"^(?:class|def) ([A-Za-z]\w*)|^([A-Z]\w*)\b.*=", text, re.MULTILINE)
        names = re.compile(r"\b(" + "|".join([module.stem, *(a or b for a, b in public)]) + r")\b")
        # The tests of the same room that name what the module defines go before the others.
        near.sort(key=lambda path: not names.search((self.tree / path).read_text(encoding="utf-8")))
        far = []
        if self.importers:
            imported = re.compile(rf"{PACKAGE}\.{'.'.join(module.parts[1:-1])}\b")
            for path in self._tests(Path("test")):
                words = (self.tree / path).read_text(encoding="utf-8")
                if path not in [*own, *near] and imported.search(words) and names.search(words):
                    far.append(path)
        return [tuple(map(str, paths)) for paths in (own, near, far) if paths]

    def _tests(self, folder: Path) -> list[Path]:
        # Live graphs take minutes each.
        return sorted(
            path.relative_to(self.tree)
            for path in (self.tree / folder).rglob("test_*.py")
            if not {"graph", "faults"} & set(path.relative_to(self.tree).parts)
        )

    def _run(self, tests: tuple[str, ...], limit_s: float) -> str:
        command = [sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider", "-m", "not graph", *tests]
        paths = f"{self.tree}{os.pathsep}{os.environ.get('PYTHONPATH', '')}"
        try:
            done = subprocess.run(
                command, cwd=self.tree, env=os.environ | {"PYTHONPATH": paths}, timeout=limit_s, check=False,
                stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
            )  # fmt: skip
        except subprocess.TimeoutExpired:
            return "timed out"
        # 5: no test applies.
        return "survived" if done.returncode in (0, 5) else "killed"

    def _clean_in_time(self, tests: tuple[str, ...]) -> bool:
        if tests not in self._clean:
            self._clean[tests] = self._run(tests, self.limit_s / 3.0) == "survived"
        return self._clean[tests]


def main() -> int:
    """Sample, try and print; the exit status says whether a fault survived."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--folder", nargs="+", default=["calibration", "ephemeris", "planning", "tracking"])
    parser.add_argument("--count", type=int, default=25, help="faults per folder")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--limit", type=float, default=120.0, help="seconds for one group of test files")
    parser.add_argument("--importers", action="store_true", help="also run tests of other folders, which takes longer")
    parser.add_argument("--only", default="", help="only modules or faults whose line contains this text")
    options = parser.parse_args()
    rows = []
    with tempfile.TemporaryDirectory(prefix="mutants_") as scratch:
        tree = Path(scratch) / "tree"
        shutil.copytree(ROOT, tree, ignore=NOT_COPIED, symlinks=True)
        suite = Suite(tree, options.limit, options.importers)
        for folder in options.folder:
            modules = sorted(path.relative_to(ROOT) for path in (ROOT / PACKAGE / folder).rglob("*.py"))
            all_faults = [fault for path in modules for fault in mutants_of(path) if options.only in str(fault)]
            if not all_faults:
                parser.error(f"--folder {folder}: no place for a fault in {PACKAGE}/{folder}")
            chosen = random.Random(options.seed).sample(all_faults, min(options.count, len(all_faults)))
            verdicts = []
            for fault in chosen:
                begun = time.monotonic()
                verdicts.append(suite.verdict(fault))
                print(f"{verdicts[-1]:9s} {time.monotonic() - begun:5.0f} s  {fault}", flush=True)
            rows.append((folder, *(verdicts.count(word) for word in ("killed", "timed out", "survived", "undecided"))))
    print(f"\n{'folder':24s} killed  timed out  survived  undecided  found")
    for folder, killed, late, survived, undecided in rows:
        share = 100.0 * (killed + late) / max(killed + late + survived, 1)
        print(f"{folder:24s} {killed:6d} {late:10d} {survived:9d} {undecided:10d} {share:5.0f} %")
    return int(any(row[3] for row in rows))


if __name__ == "__main__":
    sys.exit(main())
