"""Rows and numbers that are compared with recorded ones, and what stands in for expensive runs.

With RECORD=1 in the environment the tests record instead of comparing; the difference of the files in `test/data/papers`
then shows what a change has moved.
"""

import csv
import math
import os
import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray

from rf_pointing.papers.row import Row, as_table

Array = NDArray[np.float64]
DATA = Path(__file__).parents[1] / "data" / "papers"
NUMBERS = ("paper", "ours", "tolerance", "factor")
WORDS = ("quantity", "source", "unit", "bound", "holds", "explained", "remark")
OURS_REL, OF_TOLERANCE = 1e-5, 0.01
"""How far ours may move: relative, and as a share of the row's own tolerance (rows of rounding errors)."""
PRINTED_NUMBER = re.compile(r"[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")


def alike(ours: str, recorded: str) -> bool:
    """Return whether two texts differ in no word and in no number by more than one in its last decimal place."""
    if PRINTED_NUMBER.sub("#", ours) != PRINTED_NUMBER.sub("#", recorded):
        return False
    pairs = zip(PRINTED_NUMBER.findall(ours), PRINTED_NUMBER.findall(recorded), strict=True)
    return all(
        one == other or ("." in other and abs(float(one) - float(other)) < 1.01 * 10.0 ** -len(other.partition(".")[2]))
        for one, other in pairs
    )


def check_rows(file: Path, name: str, rows: Sequence[Row], within: float = OURS_REL) -> None:
    """Fail where a row is not the recorded one of the table `name`."""
    if os.environ.get("RECORD"):
        lines = [
            [
                name,
                *(str(getattr(row, word)) for word in WORDS),
                *(f"{getattr(row, number):.12g}" for number in NUMBERS),
            ]
            for row in rows
        ]
        _record(file, name, lines, ["table", *WORDS, *NUMBERS])
        return
    with file.open(encoding="utf-8", newline="") as text:
        known = [line for line in csv.DictReader(text) if line["table"] == name]
    assert len(rows) == len(known)
    check_reasons(rows)
    for row, line in zip(rows, known, strict=True):
        for word in WORDS:
            assert alike(str(getattr(row, word)), line[word]), (word, getattr(row, word), line[word])
        expected = {number: float(line[number]) for number in NUMBERS}
        assert row.ours == pytest.approx(expected.pop("ours"), rel=within, abs=OF_TOLERANCE * row.tolerance), row
        # A published number may be a theory of ours, computed like the rest.
        assert {number: getattr(row, number) for number in expected} == pytest.approx(expected, rel=1e-7), row


def check_reasons(rows: Sequence[Row]) -> None:
    """Fail where a wrong value planted into an explained row is not printed as `NO`."""
    for row in rows:
        if row.due is None:
            continue
        low, high = row.due
        past = 1e-6 * max(abs(low), abs(high))
        values = (low - past, high + past, low - 3.0 * (high - low) - past, -high, math.nan, math.inf, -math.inf)
        wrong = [each for each in (replace(row, ours=value) for value in values) if not each.holds]
        # A bound may hold on one side of what is explained, and never on both.
        assert len(wrong) > len(values) // 2, row
        assert {as_table([each]).splitlines()[2].split()[-1] for each in wrong} == {"NO"}, row


def check_numbers(file: Path, name: str, numbers: ArrayLike, within: float, least: float = 1e-10) -> None:
    """Fail where a number is not the recorded one of the run `name`: relative and absolute."""
    if os.environ.get("RECORD"):
        _record(file, name, [[name, *(f"{number:.12g}" for number in flat(numbers))]], [])
        return
    with file.open(encoding="utf-8", newline="") as text:
        (known,) = (numbers for first, *numbers in csv.reader(text) if first == name)
    np.testing.assert_allclose(flat(numbers), np.array(known, dtype=np.float64), rtol=within, atol=least)


def _record(file: Path, name: str, lines: list[list[str]], head: list[str]) -> None:
    """Put the lines of `name` in the place of its old ones, or at the end."""
    kept: list[list[str]] = []
    if file.is_file():
        with file.open(encoding="utf-8", newline="") as text:
            kept = list(csv.reader(text))[1 if head else 0 :]
    place = next((number for number, line in enumerate(kept) if line[0] == name), len(kept))
    kept = [line for line in kept if line[0] != name]
    with file.open("w", encoding="utf-8", newline="") as text:
        csv.writer(text, lineterminator="\n").writerows(
            [*([head] if head else []), *kept[:place], *lines, *kept[place:]]
        )


def flat(*parts: ArrayLike) -> Array:
    """Return all numbers in one row; complex ones as two."""
    arrays = [np.atleast_1d(np.asarray(part)).ravel() for part in parts]
    return np.concatenate([a.view(np.float64) if np.iscomplexobj(a) else a.astype(np.float64) for a in arrays])


@contextmanager
def changed(module: ModuleType, **names: object) -> Iterator[None]:
    """Put fewer runs, or results of no run, in place of what takes long."""
    with pytest.MonkeyPatch.context() as patch:
        for name, value in names.items():
            patch.setattr(module, name, value)
        yield


def mark(*values: float) -> float:
    """Return a number between 1 and 2 that shows a change of any of the values."""
    return 1.5 + 0.5 * math.sin(sum((place + 1) * min(float(value), 1e3) for place, value in enumerate(values)))
