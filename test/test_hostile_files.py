"""Every reader of files: whatever is in one, the answer is a sentence, and it comes soon."""

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from rf_pointing.calibration import read_model, read_observations, read_tdm, read_tracking
from rf_pointing.controllers import load_lqg_designs
from rf_pointing.core.parameters import read_parameter_files
from rf_pointing.ephemeris import find_elements, read_elements, tle_lines, verification_elements
from rf_pointing.ephemeris.source import SourceParams, load_target
from rf_pointing.tracking.cluster_tracker import read_calibration

LONGEST_S = 5.0


def _elements(path: Path) -> Any:
    return load_target(SourceParams(elements=str(path), satellite="x"))


READERS: dict[str, Callable[[Path], Any]] = {
    "tracking.csv": read_tracking,
    "points.csv": read_observations,
    "pass.tdm": read_tdm,
    "model.yaml": read_model,
    "model.json": read_model,
    "station.yaml": lambda path: read_parameter_files([path]),
    "designs.json": load_lqg_designs,
    "feed.yaml": read_calibration,
    "elements": _elements,
}
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
    "a bomb": b"a: &a [x, x]\n" + b"".join(b"%c: &%c [*%c, *%c]\n" % (k, k, k - 1, k - 1) for k in range(98, 123)),
}


@pytest.mark.parametrize("content", CONTENTS)
@pytest.mark.parametrize("name", READERS)
def test_a_file_that_is_none_is_refused_with_a_sentence(tmp_path: Path, name: str, content: str) -> None:
    path = tmp_path / name
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
