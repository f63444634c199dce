"""A scanning dish over the top: what the crossing costs is what the certificate plans, and near what it must cost.

`benchmarks/zenith_passes.py` flies whole passes; here they are of 60 deg and higher.
"""

import math
from pathlib import Path
from typing import Any

import pytest

from rf_pointing.simulation import StationSetup
from test.scripts import script_module


@pytest.fixture(scope="module")
def script() -> Any:
    return script_module("benchmarks/zenith_passes.py")


@pytest.mark.parametrize(("band", "east", "most_s"), [("S", True, 5.0), ("X", False, 10.0)])
def test_conscan_loses_only_what_the_turn_costs(
    script: Any, band: str, east: bool, most_s: float, tmp_path: Path
) -> None:
    """A peak of 88.7 deg at 6 deg/s.  With a scan in the crossing 14 s (X) were lost, and all the rest (S)."""
    site = StationSetup("leo_3m7").station.site
    elements, window = script.overhead(site, 88.7, east, math.radians(60.0))
    flown = script.fly("leo_3m7", band, "conscan", elements, window, tmp_path / "overhead.tle")
    print(f"{band}: expected {flown.branch.lost_s:.1f} s, flown {flown.lost_s:.1f} s, at least {flown.least_s:.1f} s")
    assert flown.branch.over
    assert flown.lost_s <= most_s
    assert flown.lost_s == pytest.approx(flown.branch.lost_s, abs=0.5)
    # Acceleration and the share that the loop keeps of the axes cost a second or two.
    assert flown.least_s <= flown.lost_s <= flown.least_s + 3.0
