"""A small dish tracks a pass live by the array of patches on it alone."""

import json
import os
from pathlib import Path

import pytest

from .conftest import processes_of, start_track

pytestmark = pytest.mark.graph

PASS = ("--start", "2006-06-27T16:00:00", "--min-peak", "19", "--mask", "17.5")
"""The top of a pass of CBERS-2; its real satellite is 6 s ahead of its elements."""


def test_a_dish_tracks_a_pass_by_its_array_alone(tmp_path: Path) -> None:
    namespace = f"/array{os.getpid()}"
    run = start_track(
        "--station", "rotator_2m", "--sensor", "array", *PASS, "--ephemeris-error", "6", "--output", str(tmp_path),
        "--namespace", namespace,
    )  # fmt: skip
    said = run.communicate(timeout=200.0)[1]
    assert run.returncode == 0, said
    assert "10 nodes matched and active" in said
    found = json.loads((tmp_path / "summary.json").read_text())["headline"]
    # The encoders show steps of 0.1 deg; one error by the array's bound is 0.38 deg in each axis.
    assert found["error"]["radial"]["rms_mdeg"] < 440.0
    assert found["program_track_alone"]["radial"]["rms_mdeg"] > 1000.0
    assert processes_of(namespace) == []
