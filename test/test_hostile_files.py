"""Every reader of files: whatever is in one, the answer is a sentence, and it comes soon."""

import json
import math
import os
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from random import Random
from typing import Any

import pytest
import yaml

from rf_pointing.api.satellite_list import satellites
from rf_pointing.calibration import read_model, read_observations, read_tdm, read_tracking
from rf_pointing.controllers import load_lqg_designs
from rf_pointing.core.parameters import read_parameter_files
from rf_pointing.ephemeris import find_elements, read_elements, tle_lines, verification_elements
from rf_pointing.ephemeris.source import SourceParams, load_target
from rf_pointing.operations import AlarmParams, read_procedure
from rf_pointing.operations.dictionary import TABLES, read_directives, read_tables
from rf_pointing.operations.pass_list import read_passes, row_of, to_calendar, to_csv, to_json
from rf_pointing.operations.recovery import read_table
from rf_pointing.station.description.description import STATIONS, read_station, station_from
from rf_pointing.tracking.cluster_tracker import read_calibration

LONGEST_S = 5.0
DISH = (STATIONS / "leo_3m7.yaml").read_text()


def _elements(path: Path) -> Any:
    return load_target(SourceParams(elements=str(path), satellite="x"))


READERS: dict[str, Callable[[Path], Any]] = {
    "tracking.csv": read_tracking, "points.csv": read_observations, "pass.tdm": read_tdm,
    "model.yaml": read_model, "model.json": read_model,
    "station.yaml": lambda path: read_parameter_files([path]), "designs.json": load_lqg_designs,
    "feed.yaml": read_calibration, "elements": _elements,
    "horizon.txt": lambda path: station_from(
        path.with_name("s.yaml"), DISH.replace("horizon_deg:", "horizon_file: horizon.txt #")
    ),
    "dish.yaml": read_station, "satellites": lambda path: satellites("", [str(path)]),
    "directives.yaml": lambda path: read_tables(AlarmParams(), directives=str(path)),
    "procedure.yaml": lambda path: read_tables(AlarmParams(), procedure=str(path)),
    "recovery.yaml": lambda path: read_tables(AlarmParams(), recovery=str(path)),
}  # fmt: skip
CONTENTS = {
    "empty": b"",
    "deep": b"[" * 200_000,
    "zeros": bytes(100_000),
    "every byte": bytes(range(256)) * 100,
    "one long line": b"x," * 20_000_000,
    "a long field": b'# station: a\n# band: X\n# target: b\n"' + b"a" * 500_000 + b'"\n1\n',
    "half a character": b'{"format": "\\ud800", "name": 1}',
    "wrong types": b'{"format": [1], "name": {"a": 1}, "azimuth": 3}',
    "designs of wrong types": b'{"format": "rf_pointing LQG designs 1", "azimuth": 3, "elevation": [1]}',
    "many segments": b"CCSDS_OEM_VERS = 2.0\n" + b"META_START\n" * 50_000,
    "an entity": b'<?xml version="1.0"?><!DOCTYPE l [<!ENTITY a "aaaa">]><omm>&a;</omm>',
    "deep segments": b"<segment>" * 100_000 + b"</segment>" * 100_000,
    "elements of wrong types": b'[{"OBJECT_NAME":["a"],"NORAD_CAT_ID":{"b":1},"EPOCH":3}]',
    "a pipe": b"",
    "a bomb": b"a: &a [x, x]\n" + b"".join(b"%c: &%c [*%c, *%c]\n" % (k, k, k - 1, k - 1) for k in range(98, 123)),
}


@pytest.mark.parametrize("content", CONTENTS)
@pytest.mark.parametrize("name", READERS)
def test_a_file_that_is_none_is_refused_with_a_sentence(tmp_path: Path, name: str, content: str) -> None:
    path = tmp_path / name
    if content == "a pipe":
        os.mkfifo(path)
    else:
        path.write_bytes(CONTENTS[content])
    begun_s = time.process_time()
    with pytest.raises(ValueError) as refused:
        READERS[name](path)
    assert time.process_time() - begun_s < LONGEST_S
    assert name in str(refused.value)


def test_a_hundred_megabytes_of_elements_are_refused_and_an_unknown_name_is_answered_soon(tmp_path: Path) -> None:
    lines = "\n".join(tle_lines(verification_elements()[1])) + "\n"
    path = tmp_path / "many.tle"
    path.write_text(lines * (100 * 2**20 // len(lines)))
    begun_s = time.process_time()
    with pytest.raises(ValueError, match="many.tle is longer than 32 MiB"):
        _elements(path)
    many = read_elements(lines * 2000) * 50
    with pytest.raises(ValueError, match="is not among 100000 elements"):
        find_elements(many, "ISS")
    assert time.process_time() - begun_s < LONGEST_S


def _shown(text: str) -> None:
    """Read a list of passes, and write in every form what was taken of it."""
    found = read_passes(text, every=False)
    again = (read_passes(each) for each in (to_json(found), to_csv(found), to_calendar(found, "x", 0.0)))
    first, *others = ([row_of(item) for item in each] for each in again)
    assert others == [first, first]


PASSES = read_passes("target,aos_utc,los_utc,priority\n" + "".join(
    f"{name},2026-01-01T0{k}:00:00Z,2026-01-01T0{k}:10:00Z,{k}\n" for k, name in enumerate(("ISS", "NOAA 19"))
))  # fmt: skip
ARGUMENTS = {name: row.takes for name, row in read_tables(AlarmParams()).directives.items()}
TEXTS: dict[str, tuple[str, Callable[[str], Any]]] = {
    "passes as JSON": (to_json(PASSES), _shown),
    "passes as a table": (to_csv(PASSES), _shown),
    "passes as a calendar": (to_calendar(PASSES, "x", 0.0), _shown),
    "directives": ((TABLES / "directives.yaml").read_text(), read_directives),
    "procedure": ((TABLES / "pass.yaml").read_text(), lambda text: read_procedure(text, ARGUMENTS)),
    "recovery": ((TABLES / "recovery.yaml").read_text(), lambda text: read_table(text, ARGUMENTS, AlarmParams())),
    "station": (DISH, lambda text: station_from(STATIONS / "leo_3m7.yaml", text).digest),
}
VALUES = (
    None, True, [], {}, [1, "a"], {"a": 1, 2: 3}, "", "x" * 300, "../../x", "a\nb", "\ud800", "${x}", "x.y", -1, 0.5, math.inf,
    math.nan, 10**400, 10**30, "1e400", "2026-01-01T00:00:00Z", "0001-01-01T00:00:00+14:00",
)  # fmt: skip
SIGNS = (
    "\r", ",", '"', "\n", ":", "[", "{", "&a ", "*a", "- ", "!!int ", "\0", "\u2028",
    "BEGIN:VEVENT\r\n", ";TZID=X:",
)  # fmt: skip


def _changed(value: Any, random: Random, chance: float) -> Any:
    """Return a value in which about a share `chance` of all values and keys are others."""
    if random.random() < chance:
        return random.choice(VALUES)
    if isinstance(value, dict):
        return {random.choice((key, 7, "x")) if random.random() < chance else key: _changed(each, random, chance)
                for key, each in value.items()}  # fmt: skip
    return [_changed(each, random, chance) for each in value] if isinstance(value, list) else value


def _spliced(text: str, random: Random) -> str:
    """Return a text with something else in a few places."""
    for _ in range(random.randint(1, 3)):
        at, gone = random.randrange(len(text)), random.choice((0, 1, 30))
        text = text[:at] + str(random.choice((*SIGNS, *VALUES))) + text[at + gone :]
    return text


@pytest.mark.parametrize("name", TEXTS)
def test_a_list_or_table_with_anything_in_it_is_read_or_refused_soon(name: str) -> None:
    random, (text, read) = Random(name), TEXTS[name]
    structure = None if text.startswith(("BEGIN", "id")) else yaml.safe_load(text)
    taken = 0
    for _ in range(40 if name == "station" else 200):
        changed = _spliced(text, random)
        if structure is not None and random.random() < 0.6:
            # JSON is YAML; an infinity of JSON is a text to YAML.
            changed = json.dumps(_changed(structure, random, 0.02))
        begun_s = time.process_time()
        with suppress(ValueError):
            read(changed)
            taken += 1
        assert time.process_time() - begun_s < LONGEST_S
    assert taken, "every text is refused: nothing is tried"
