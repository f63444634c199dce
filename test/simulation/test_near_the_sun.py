"""An antenna that joins a pass by the Sun neither looks into it nor ends in a fault."""

import math
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[2] / "benchmarks"))
from near_the_sun import join, meeting_of


@pytest.mark.parametrize("behind_s", [30.0, -15.0])
@pytest.mark.parametrize(("name", "rank"), [("dss13", 0), ("leo_3m7", 1), ("rotator_2m", 1)])
def test_an_antenna_joins_a_pass_by_the_sun_without_a_fault(
    name: str, rank: int, behind_s: float, tmp_path: Path
) -> None:
    joined = join(name, meeting_of(name, rank, math.radians(1.35), tmp_path), behind_s)
    assert joined.fault == ""
    # The zone is one of the axes' angles; a rotator has a dead band of 0.1 deg.
    assert float(joined.axes_sun_rad.min()) > math.radians(0.9 if name == "rotator_2m" else 1.0)
    # It has the target in the end, a rotator within its dead band.
    assert float(joined.error_rad[-20:].max()) < math.radians(1.0 if name == "rotator_2m" else 0.3)
