"""An antenna that joins a pass by the Sun neither looks into it nor ends in a fault."""

import dataclasses
import math
from pathlib import Path

import numpy as np
import pytest

from rf_pointing.ephemeris import TopocentricTrack, find_elements, find_passes, sun, tle_lines, verification_elements
from rf_pointing.planning.forbidden_sky import angle_between
from rf_pointing.simulation import StationSetup, simulate_pass
from rf_pointing.station.description import read_station

EARTH_RAD_S = 7.292115e-5
DAY_S = 86400.0


def look(track: TopocentricTrack, times: np.ndarray) -> np.ndarray:
    found = track.sample(times)
    return np.column_stack([found.azimuth_rad, found.elevation_rad])


def meets_the_sun(name: str, rank: int, apart_deg: float, folder: Path) -> tuple[Path, TopocentricTrack, float]:
    """Return elements, the track and a time at which the pass of this rank is so far from the Sun.

    The satellite makes the same motion over the turning Earth, so much later that it meets the Sun.
    """
    site, found = read_station(name).site, find_elements(verification_elements(), "28057")
    windows = find_passes(TopocentricTrack(found, site), found.epoch_t_s, 2.0 * DAY_S, math.radians(5.0))
    # An antenna of 1.8 deg/s has to reach the target within half a minute.
    slow = (each for each in windows if each.peak_elevation_rad < math.radians(65.0))
    window = sorted(slow, key=lambda each: -each.peak_elevation_rad)[rank]
    path = look(TopocentricTrack(found, site), np.arange(window.aos_t_s + 40.0, window.los_t_s - 40.0, 2.0))
    later_s = np.arange(0.0, DAY_S, 20.0)
    apart = np.array(
        [angle_between(path, each) for each in look(TopocentricTrack(sun(), site), window.tca_t_s + later_s)]
    )
    nearest = np.min(apart, axis=1)
    chosen = int(np.argmin(np.abs(nearest - math.radians(apart_deg))))
    assert math.degrees(nearest[chosen]) == pytest.approx(apart_deg, abs=0.05)
    shift_s = float(later_s[chosen])
    node_rad = (found.ascending_node_rad + EARTH_RAD_S * shift_s) % (2.0 * math.pi)
    epoch_s = found.epoch_t_s + shift_s
    moved = dataclasses.replace(found, name="FLYER", epoch_t_s=epoch_s, ascending_node_rad=node_rad)
    elements = folder / "flyer.tle"
    elements.write_text("\n".join(("FLYER", *tle_lines(moved))) + "\n")
    return (
        elements,
        TopocentricTrack(moved, site),
        window.aos_t_s + 40.0 + 2.0 * int(np.argmin(apart[chosen])) + shift_s,
    )


@pytest.mark.parametrize("behind_s", [30.0, -15.0])
@pytest.mark.parametrize(("name", "rank"), [("dss13", 0), ("leo_3m7", 1), ("rotator_2m", 1)])
def test_an_antenna_joins_a_pass_by_the_sun_without_a_fault(
    name: str, rank: int, behind_s: float, tmp_path: Path
) -> None:
    elements, track, nearest_s = meets_the_sun(name, rank, 1.35, tmp_path)
    begin_s = nearest_s - 4.0
    stands = track.target_at(begin_s - behind_s)
    lowest_deg = read_station(name).content.mount.azimuth.travel_deg[0]
    source = {"source.elements": str(elements), "source.satellite": "FLYER"}
    start = {
        "antenna.start_azimuth_deg": lowest_deg + (math.degrees(stands.azimuth_rad) - lowest_deg) % 360.0,
        "antenna.start_elevation_deg": math.degrees(stands.elevation_rad),
    }
    setup = StationSetup(name, changes={"antenna_servo": start, "rf_receiver": source, "ephemeris_publisher": source})
    (window,) = (
        each for each in find_passes(setup.track(), nearest_s - 1500.0, 3000.0, math.radians(5.0))
        if each.aos_t_s < nearest_s < each.los_t_s
    )  # fmt: skip
    antenna = setup.antenna()
    setup.antenna = lambda: antenna  # type: ignore[method-assign]
    log = simulate_pass(setup, dataclasses.replace(window, los_t_s=nearest_s + 30.0), begin_s, "program")
    assert antenna.safety.latch.text == ""
    # It has the target in the end, a rotator within its dead band.
    assert float(np.max(np.hypot(*log.errors_rad()[-20:].T))) < math.radians(1.0 if name == "rotator_2m" else 0.3)
