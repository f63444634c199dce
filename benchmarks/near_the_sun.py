"""Passes that are joined beside the Sun: how many end in a fault, and what the detour costs.

scripts/run-python benchmarks/near_the_sun.py [--station leo_3m7 ...] [--passes 2] [--apart 1.2 1.5 2.0 3.0]

The antenna stands on the path of a pass, ahead of the target or behind it, and joins it 4 s before the target
comes nearest to the Sun, at each of these distances (deg).  Printed a station: how many joined passes ended in a
latched fault of the guard, the nearest that axes and beam came to the Sun, and how long they took to the target,
which is compared with the same pass without a Sun.  The zone is one of the axes' angles: the beam of a mount with
lags, or with errors that are not known, may be nearer.  A pass that the certificate refuses is left out.
"""

import argparse
import dataclasses
import math
import tempfile
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rf_pointing.core import Boresight, JointReading
from rf_pointing.ephemeris import TopocentricTrack, find_elements, find_passes, sun, tle_lines, verification_elements
from rf_pointing.planning.forbidden_sky import angle_between
from rf_pointing.simulation import StationSetup, simulate_pass
from rf_pointing.station.antenna.receiver import Reception
from rf_pointing.station.description import read_station

Array = NDArray[np.float64]

EARTH_RAD_S = 7.292115e-5
DAY_S = 86400.0
STATIONS = ("dss13", "leo_3m7", "rotator_2m")
BEHIND_S = (-60.0, -40.0, -30.0, -20.0, -15.0, -10.0, -5.0, 5.0, 10.0, 15.0, 20.0, 30.0, 40.0, 60.0)
# The target is joined so long before it is nearest to the Sun, and followed so long after.
BEFORE_S, AFTER_S = 4.0, 30.0


class Meeting(NamedTuple):
    """A pass beside the Sun: its elements, its track, and when it is nearest to the Sun."""

    elements: Path
    track: TopocentricTrack
    nearest_t_s: float


class Joined(NamedTuple):
    """What became of a joined pass: the latched fault or "".

    `axes_sun_rad` and `beam_sun_rad` are the distances from the Sun in every tick, `error_rad` (n,) that of the beam
    from the target at `t_s` (n,).
    """

    fault: str
    axes_sun_rad: Array
    beam_sun_rad: Array
    error_rad: Array
    t_s: Array

    def settled_s(self, within_rad: float) -> float:
        """Return after how long the error stays within a bound, inf if it never does."""
        outside = np.flatnonzero(self.error_rad > within_rad)
        if not len(outside):
            return 0.0
        return math.inf if outside[-1] + 1 == len(self.t_s) else float(self.t_s[outside[-1] + 1] - self.t_s[0])


def _look(track: TopocentricTrack, times: Array) -> Array:
    found = track.sample(times)
    return np.column_stack([found.azimuth_rad, found.elevation_rad])


def meeting_of(station: str, rank: int, apart_rad: float, folder: Path) -> Meeting:
    """Return the pass of this rank (by height, below 65 deg) that comes so near the Sun.

    The satellite makes the same motion over the turning Earth, so much later that it meets the Sun.

    Raises
    ------
    ValueError
        When no time of the day brings the pass so near.
    """
    site, found = read_station(station).site, find_elements(verification_elements(), "28057")
    windows = find_passes(TopocentricTrack(found, site), found.epoch_t_s, 2.0 * DAY_S, math.radians(5.0))
    # An antenna of 1.8 deg/s has to reach the target within half a minute.
    slow = (each for each in windows if each.peak_elevation_rad < math.radians(65.0))
    window = sorted(slow, key=lambda each: -each.peak_elevation_rad)[rank]
    times = np.arange(window.aos_t_s + 40.0, window.los_t_s - 40.0, 2.0)
    path, later_s = _look(TopocentricTrack(found, site), times), np.arange(0.0, DAY_S, 20.0)
    apart = np.array(
        [angle_between(path, each) for each in _look(TopocentricTrack(sun(), site), window.tca_t_s + later_s)]
    )
    nearest = np.min(apart, axis=1)
    chosen = int(np.argmin(np.abs(nearest - apart_rad)))
    if abs(nearest[chosen] - apart_rad) > math.radians(0.05):
        raise ValueError(f"pass {rank} of {station} comes no nearer to {math.degrees(apart_rad):.2f} deg from the Sun")
    shift_s = float(later_s[chosen])
    node_rad = (found.ascending_node_rad + EARTH_RAD_S * shift_s) % (2.0 * math.pi)
    moved = dataclasses.replace(
        found, name="FLYER", epoch_t_s=found.epoch_t_s + shift_s, ascending_node_rad=node_rad
    )  # fmt: skip
    elements = folder / "flyer.tle"
    elements.write_text("\n".join(("FLYER", *tle_lines(moved))) + "\n")
    return Meeting(elements, TopocentricTrack(moved, site), float(times[int(np.argmin(apart[chosen]))]) + shift_s)


def join(station: str, meeting: Meeting, behind_s: float, *, guarded: bool = True) -> Joined:
    """Fly the middle of a pass that begins with the axes so far behind the target on its path.

    `guarded`: with the Sun's zone of the station.
    """
    begin_s = meeting.nearest_t_s - BEFORE_S
    stands = meeting.track.target_at(begin_s - behind_s)
    lowest_deg = read_station(station).content.mount.azimuth.travel_deg[0]
    source = {"source.elements": str(meeting.elements), "source.satellite": "FLYER"}
    start = {
        "antenna.start_azimuth_deg": lowest_deg + (math.degrees(stands.azimuth_rad) - lowest_deg) % 360.0,
        "antenna.start_elevation_deg": math.degrees(stands.elevation_rad),
    }
    changes: dict[str, dict[str, object]] = {
        "antenna_servo": start, "pointing_controller": {}, "rf_receiver": source, "ephemeris_publisher": source
    }  # fmt: skip
    if not guarded:
        changes["antenna_servo"]["safety.gate.sun_radius_deg"] = 0.0
        changes["pointing_controller"].update({"gate.sun_radius_deg": 0.0, "machine.sun_radius_deg": 0.0})
    setup = StationSetup(station, changes=changes)
    (window,) = (
        each for each in find_passes(setup.track(), meeting.nearest_t_s - 1500.0, 3000.0, math.radians(5.0))
        if each.aos_t_s < meeting.nearest_t_s < each.los_t_s
    )  # fmt: skip
    antenna, receiver = setup.antenna(), setup.receiver()
    readings: list[tuple[float, ...]] = []
    looks: list[tuple[float, ...]] = []
    read, take = antenna.reading, receiver.take

    def noted(t_s: float) -> JointReading:
        reading = read(t_s)
        readings.append((t_s, *reading.position_rad.tolist()))
        return reading

    def seen(boresight: Boresight) -> Reception | None:
        looks.append((boresight.t_s, boresight.azimuth_rad, boresight.elevation_rad))
        return take(boresight)

    antenna.reading, receiver.take = noted, seen  # type: ignore[method-assign]
    setup.antenna, setup.receiver = lambda: antenna, lambda: receiver  # type: ignore[method-assign]
    log = simulate_pass(setup, dataclasses.replace(window, los_t_s=meeting.nearest_t_s + AFTER_S), begin_s, "program")
    track = TopocentricTrack(sun(), setup.station.site)
    axes, beam = (
        angle_between(rows[:, 1:], _look(track, rows[:, 0])) for rows in (np.array(readings), np.array(looks))
    )
    return Joined(antenna.safety.latch.text, axes, beam, np.hypot(*log.errors_rad().T), np.array(log.t_s))


def main() -> None:
    """Print a line a station."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--station", nargs="+", default=STATIONS)
    parser.add_argument("--passes", type=int, default=2, help="of each station, by height")
    parser.add_argument("--apart", type=float, nargs="+", default=[1.2, 1.35, 1.5, 2.0, 3.0], metavar="DEG")
    options = parser.parse_args()
    for station in options.station:
        flown, refused, faults, nearest, waits = 0, 0, [], [], []
        # A rotator holds the target within its dead band.
        within_rad = math.radians(1.0 if station == "rotator_2m" else 0.3)
        for rank in range(options.passes):
            for apart_deg in options.apart:
                with tempfile.TemporaryDirectory() as folder:
                    meeting = meeting_of(station, rank, math.radians(apart_deg), Path(folder))
                    for behind_s in BEHIND_S:
                        try:
                            joined, free = (join(station, meeting, behind_s, guarded=each) for each in (True, False))
                        except ValueError as error:
                            # The certificate refuses the pass, wherever the axes are.
                            refused += 1
                            print(f"    {station} pass {rank} {apart_deg} deg: {error}", flush=True)
                            break
                        flown += 1
                        if joined.fault:
                            faults.append((rank, apart_deg, behind_s, joined.fault))
                        nearest.append((joined.axes_sun_rad.min(), joined.beam_sun_rad.min()))
                        later_s = joined.settled_s(within_rad) - free.settled_s(within_rad)
                        waits.append(0.0 if math.isnan(later_s) else later_s)
        axes_deg, beam_deg = np.degrees(np.min(nearest, axis=0))
        never = sum(map(math.isinf, waits))
        waits = [each for each in waits if math.isfinite(each)]
        print(
            f"{station}: {len(faults)} faults in {flown} joined passes (and {refused} passes refused), "
            f"axes {axes_deg:.3f} deg and beam {beam_deg:.3f} deg from the Sun at the nearest, on the target later by "
            f"{np.median(waits):.1f} s (median), {np.max(waits):.1f} s (most), not in {AFTER_S:.0f} s in {never}",
            flush=True,
        )
        for fault in faults:
            print("   ", *fault)


if __name__ == "__main__":
    main()
