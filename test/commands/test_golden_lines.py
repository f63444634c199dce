"""Golden command lines: what the offline commands print, and their exit codes, as test/data/command_lines has them.

Each file there is a session in one folder:

    # a claim
    $ NAME ARGUMENT ... > FILE     a command of the package, or echo, cat, ls; `> FILE` keeps its output
    | a line of stdout
    ! a line of stderr
    ? 2                            the exit code, where it is not 0

Whole numbers must be equal; others may differ in the last digit that is printed.  After a change that
is meant, `WRITE_SESSIONS=1 scripts/test test/commands/test_golden_lines.py` writes the sessions again.
"""

import contextlib
import fnmatch
import importlib
import io
import os
import re
import shlex
import sys
import time
from pathlib import Path
from unittest import mock

import pytest

from rf_pointing.report.definitions import definitions
from rf_pointing.station.description import STATIONS
from test.commands.planted_campaign import write_campaign
from test.report.conftest import MSG_DEFS, SyntheticRun

FOLDER = Path(__file__).parents[1] / "data" / "command_lines"
NOW_S = 1.8e9
NUMBER = re.compile(r"-?\d+\.\d+(?:e[+-]?\d+)?|\d+")


def fill(folder: Path, text: str) -> None:
    """Write what a session uses."""
    if re.search(r"\w+\.(csv|tle)", text):
        write_campaign(folder)
    if " bag " in text or " bag\n" in text:
        SyntheticRun(seconds=12.0).write(
            folder / "bag", definitions(MSG_DEFS), {"station": "Goldstone DSS-13", "band": "X"}
        )


def run(words: list[str], folder: Path) -> tuple[str, str, int]:
    """Return what a command line prints on stdout and stderr, and its exit code."""
    name, *arguments = words
    if name == "echo":
        return "\n".join(arguments) + "\n", "", 0
    if name == "cat":
        return Path(arguments[0]).read_text(), "", 0
    if name == "ls":
        found = sorted(str(p.relative_to(folder)) for p in folder.rglob("*") if fnmatch.fnmatch(p.name, arguments[0]))
        return "".join(f"{each}\n" for each in found), "", 0
    out, err, code = io.StringIO(), io.StringIO(), 0
    main = importlib.import_module(f"rf_pointing.commands.{name}").main
    with (
        mock.patch.object(sys, "argv", words), mock.patch.object(time, "time", return_value=NOW_S),
        contextlib.redirect_stdout(out), contextlib.redirect_stderr(err),
    ):  # fmt: skip
        try:
            main()
        except SystemExit as ended:
            code = int(ended.code or 0)
    # How a usage is wrapped depends on the version of Python.
    return out.getvalue(), re.sub(r"usage: (.|\n)*?(?=^\w+: error)", "", err.getvalue(), flags=re.MULTILINE), code


def play(session: Path, folder: Path) -> str:
    """Return the session as it is now: its claims and commands, with what they print."""
    lines = []
    text = session.read_text()
    fill(folder, text)
    for line in text.splitlines():
        if line.startswith("$ "):
            words = shlex.split(line[2:])
            kept = words[-1] if len(words) > 2 and words[-2] == ">" else ""
            out, err, code = run(words[:-2] if kept else words, folder)
            if kept:
                Path(kept).write_text(out)
            lines += [line, *(f"| {each}".rstrip() for each in ("" if kept else out).splitlines())]
            lines += [f"! {each}".rstrip() for each in err.splitlines()] + ([f"? {code}"] if code else [])
        elif not line.startswith(("|", "!", "?")):
            lines.append(line)
    found = "\n".join(lines) + "\n"
    for path, name in ((folder, "HERE"), (STATIONS, "STATIONS")):
        found = found.replace(str(path), name)
    return found


def same(line: str, wanted: str) -> bool:
    """Return whether two lines are equal up to the last digit of numbers with a point."""
    if NUMBER.sub("0", line) != NUMBER.sub("0", wanted):
        return False
    pairs = zip(NUMBER.findall(line), NUMBER.findall(wanted), strict=True)
    return all(a == b or ("." in b and abs(float(a) - float(b)) <= 1.01 * last_digit(b)) for a, b in pairs)


def last_digit(number: str) -> float:
    mantissa, _, exponent = number.partition("e")
    # A float in full has digits that the processor decides.
    return max(10.0 ** (int(exponent or 0) - len(mantissa.partition(".")[2])), 1e-7 * abs(float(number)))


@pytest.mark.parametrize("session", sorted(FOLDER.glob("*.txt")), ids=lambda path: path.stem)
def test_a_command_prints_what_it_always_printed(
    session: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    text = play(session, tmp_path)
    if os.environ.get("WRITE_SESSIONS"):
        session.write_text(text)
    found, wanted = text.splitlines(), session.read_text().splitlines()
    differing = [f"{a}\n  instead of\n{b}" for a, b in zip(found, wanted, strict=False) if not same(a, b)]
    assert not differing
    assert len(found) == len(wanted)
