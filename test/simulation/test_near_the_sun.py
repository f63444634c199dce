"""An antenna that joins a pass by the Sun neither looks into it nor ends in a fault."""

import math
import sys
from pathlib import Path

import numpy as np
import pytest

from rf_pointing.core.dates import parse_utc
from rf_pointing.ephemeris import find_passes
from rf_pointing.ephemeris.solar import SunPermit
from rf_pointing.planning.forbidden_sky import ForbiddenSky
from rf_pointing.simulation import StationSetup
from rf_pointing.simulation.closed_loop import PointedAntenna, ticks
from rf_pointing.station.pointing.certificates import pass_profile

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


def test_the_sun_is_tracked_while_it_is_permitted_and_left_at_the_end_of_that() -> None:
    setup = StationSetup("leo_3m7", changes={"ephemeris_publisher": {"source.satellite": "Sun"}})
    track, antenna, controller = setup.track(), setup.antenna(), setup.controller()
    start_s = parse_utc("2026-06-21T09:00:00Z")
    midnight_s = parse_utc("2026-06-21T00:00:00Z")
    (window,) = find_passes(track, midnight_s, 86400.0, lambda a: np.full_like(a, math.radians(5.0)))
    antenna.enable()
    antenna.t_s = start_s
    pointed = PointedAntenna(antenna, controller, track, start_s, window.aos_t_s)
    controller.plan.take_profiles([pass_profile(track, window)])
    with pytest.raises(ValueError, match="from the Sun, must be >= .*station permit-sun"):
        controller.start(start_s, window, "program")
    permit = SunPermit(by="alice", until_t_s=start_s + 90.0, band=setup.band)
    assert antenna.permit_sun(permit, setup.band) == ""
    controller.permit_sun(permit, "another band")
    with pytest.raises(ValueError, match="from the Sun"):
        controller.start(start_s, window, "program")
    controller.permit_sun(permit, setup.band)
    controller.start(start_s, window, "program")
    apart_rad = {}
    for _, tick in ticks(pointed, round(130.0 / antenna.params.tick_s), first=1):
        sun = track.target_at(tick.t_s)
        there = (sun.azimuth_rad, sun.elevation_rad)
        here = tick.reading.position_rad.tolist()
        apart_rad[round(tick.t_s - start_s, 2)] = ForbiddenSky.sun_distance(*here, there)
    assert max(apart_rad[float(second)] for second in range(60, 87)) < math.radians(0.02)
    assert min(apart_rad[float(second)] for second in range(100, 130)) > math.radians(1.0)
    assert (controller.busy, antenna.safety.latch.text) == (False, "")
    assert controller.statistics.reason.startswith("over: alice lets the")
