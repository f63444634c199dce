"""The table as JSON: its keys do not change by accident, and no number in it is NaN."""

import dataclasses
import json
import math
import typing
from pathlib import Path
from typing import Any

from rf_pointing.report.summary import Spread, Summary, to_json

KEYS = Path(__file__).parent / "data" / "summary_keys.json"


def keys_of(kind: Any) -> Any:
    """The keys below a dataclass, a list of them, or an optional one; None below anything else."""
    if dataclasses.is_dataclass(kind):
        hints = typing.get_type_hints(kind)
        return {item.name: keys_of(hints[item.name]) for item in dataclasses.fields(kind)}
    inner = [keys_of(argument) for argument in typing.get_args(kind)]
    return next((keys for keys in inner if keys is not None), None)


def test_keys_are_those_of_schema_2() -> None:
    assert keys_of(Summary) == json.loads(KEYS.read_text())


def test_numbers_that_are_not_finite_are_null() -> None:
    spread = Spread(rms_mdeg=math.nan, p95_mdeg=math.inf, max_mdeg=1.5)
    assert to_json(spread).startswith('{\n  "rms_mdeg": null,\n'), "two blanks: it is read by people too"
    assert json.loads(to_json(spread)) == {"rms_mdeg": None, "p95_mdeg": None, "max_mdeg": 1.5}  # type: ignore[arg-type]


def test_every_number_names_its_unit() -> None:
    units = ("_mdeg", "_deg", "_deg_s", "_deg_s2", "_db", "_db_hz", "_s", "_ms", "_hz", "_percent")
    without = {"speed"}

    def check(kind: Any) -> None:
        hints = typing.get_type_hints(kind)
        for item in dataclasses.fields(kind):
            if hints[item.name] in (float, float | None) and item.name not in (*without, "seconds"):
                assert item.name.endswith(units), item.name
            for inner in (hints[item.name], *typing.get_args(hints[item.name])):
                if dataclasses.is_dataclass(inner):
                    check(inner)

    check(Summary)
