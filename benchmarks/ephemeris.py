"""Speed of the ephemeris: look angles, one pass search, and a catalogue against skyfield's event search.

    scripts/run-python benchmarks/ephemeris.py --objects 10000 --against 1000

The catalogue is synthetic, with the mix of the real one: 75 % low orbits, 7 % navigation orbits, 10 % transfer orbits
and 8 % geostationary.  Events are compared with skyfield's after bringing each of those, which are good to half a
second, onto the mask with skyfield's own elevation, polar motion included.  All times are processor time of one core.
"""

import argparse
import math
import time
import timeit
from collections.abc import Callable
from typing import Any

import numpy as np

from rf_pointing.core import random_stream
from rf_pointing.core.constants import EARTH_MU_M3_S2, EARTH_RADIUS_M
from rf_pointing.ephemeris import (
    Elements,
    Site,
    TopocentricTrack,
    find_catalogue_passes,
    find_passes,
    read_elements,
    site,
)
from rf_pointing.ephemeris.tle import tle_lines

EPOCH_T_S = 1151347200.0
DAY_S = 86400.0
MASK_RAD = math.radians(5.0)


def synthetic_catalogue(count: int, seed: int = 1) -> list[Elements]:
    """Return `count` objects in the mix of the real catalogue."""
    rng = random_stream(seed, "synthetic catalogue")
    return [_synthetic(number, rng) for number in range(1, count + 1)]


def _synthetic(number: int, rng: np.random.Generator) -> Elements:
    kind = rng.choice(["low", "navigation", "transfer", "geostationary"], p=[0.75, 0.07, 0.10, 0.08])
    perigee_m, apogee_m, inclination_deg = {
        "low": (h := rng.uniform(400e3, 1200e3), h + rng.uniform(0.0, 30e3), rng.uniform(30.0, 105.0)),
        "navigation": (p := rng.uniform(19.0e6, 23.5e6), p + rng.uniform(0.0, 100e3), rng.uniform(53.0, 65.0)),
        "transfer": (rng.uniform(300e3, 1500e3), rng.uniform(15e6, 39e6), rng.uniform(5.0, 65.0)),
        "geostationary": (q := 35.786e6 + rng.uniform(-20e3, 20e3), q, rng.uniform(0.0, 10.0)),
    }[kind]
    near, far = EARTH_RADIUS_M + perigee_m, EARTH_RADIUS_M + max(apogee_m, perigee_m)
    angles = rng.uniform(0.0, 2.0 * math.pi, 3)
    return Elements(
        name=f"{kind} {number}",
        catalogue_number=number,
        epoch_t_s=EPOCH_T_S - rng.uniform(0.0, 2.0 * DAY_S),
        inclination_rad=math.radians(inclination_deg),
        ascending_node_rad=angles[0],
        eccentricity=(far - near) / (far + near),
        argument_of_perigee_rad=angles[1],
        mean_anomaly_rad=angles[2],
        mean_motion_rad_s=math.sqrt(EARTH_MU_M3_S2 / (0.5 * (near + far)) ** 3),
        drag_per_earth_radius=1e-5,
    )


def seconds(work: Callable[[], object], repeat: int = 1) -> float:
    """Return the least processor time of `repeat` runs, which other work on the machine hardly changes."""
    return min(timeit.repeat(work, number=1, repeat=repeat, timer=time.process_time))


class Skyfield:
    """The same objects in skyfield."""

    def __init__(self, elements: list[Elements], place: Site) -> None:
        from skyfield.api import EarthSatellite, load, wgs84

        self.scale = load.timescale(builtin=True)
        latitude, longitude = math.degrees(place.latitude_rad), math.degrees(place.longitude_rad)
        self.observer = wgs84.latlon(latitude, longitude, place.altitude_m)
        self.satellites = [EarthSatellite(*tle_lines(one), one.name, self.scale) for one in elements]
        self.start, self.end = self.scale.utc(2006, 6, 26, 18, 40), self.scale.utc(2006, 6, 27, 18, 40)

    def search(self) -> list[Any]:
        """Return the times and kinds of the events of each object, as found."""
        return [s.find_events(self.observer, self.start, self.end, altitude_degrees=5.0) for s in self.satellites]

    def install_polar_motion(self) -> None:
        """Skyfield leaves polar motion out unless told."""
        import astropy_iers_data
        from skyfield.data import iers

        with open(astropy_iers_data.IERS_A_FILE, "rb") as file:
            iers.install_polar_motion_table(self.scale, iers.parse_x_y_dut1_from_finals_all(file))

    def elevation_rad(self, index: int, seconds_after_start: np.ndarray) -> np.ndarray:
        """Return the elevation of one object."""
        at = self.scale.tt_jd(self.start.whole, self.start.tt_fraction + seconds_after_start / DAY_S)
        return (self.satellites[index] - self.observer).at(at).altaz()[0].radians

    def refined(self, index: int, times: Any, kinds: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the rises and sets [s after the start], brought onto the mask."""
        found = ((times.tt - self.start.tt) * DAY_S)[kinds != 1]
        for _ in range(4):
            height = self.elevation_rad(index, found)
            found = found - (height - MASK_RAD) / ((self.elevation_rad(index, found + 0.5) - height) / 0.5)
        return found[kinds[kinds != 1] == 0], found[kinds[kinds != 1] == 2]

    def crossings(self, index: int) -> int:
        """Return how often the elevation crosses the mask on a grid of 10 s."""
        return int(np.count_nonzero(np.diff(self.elevation_rad(index, np.arange(0.0, DAY_S, 10.0)) > MASK_RAD)))


def compare(elements: list[Elements], place: Site) -> None:
    """Print both times, the largest difference of an event, and who is right where the events are not the same."""
    # Both sides read the same lines: their eight decimals of a day are 0.4 ms.
    same = [read_elements("\n".join((one.name, *tle_lines(one))))[0] for one in elements]
    other = Skyfield(same, place)
    raw: list[Any] = []
    theirs_s = seconds(lambda: raw.extend(other.search()))
    other.install_polar_motion()
    options = {"refraction": None, "light_time": "none"}
    found = find_catalogue_passes(same, place, EPOCH_T_S, DAY_S, MASK_RAD, **options)
    ours_s = seconds(lambda: find_catalogue_passes(same, place, EPOCH_T_S, DAY_S, MASK_RAD, **options), repeat=3)
    worst, events, right = 0.0, 0, []
    for index, (one, (times, kinds)) in enumerate(zip(same, raw, strict=True)):
        passes = [p for p in found.passes if p.target is one]
        ours = [p.aos_t_s for p in passes if not p.rises_before], [p.los_t_s for p in passes if not p.sets_after]
        theirs = other.refined(index, times, kinds)
        if [len(mine) for mine in ours] == [len(wanted) for wanted in theirs]:
            events += len(ours[0]) + len(ours[1])
            apart = np.concatenate([np.sort(a) - EPOCH_T_S - np.sort(b) for a, b in zip(ours, theirs, strict=True)])
            worst = max(worst, float(np.max(np.abs(apart), initial=0.0)))
        else:
            right.append(other.crossings(index) == len(ours[0]) + len(ours[1]))
    print(f"skyfield find_events, {len(same)} objects, 24 h      {theirs_s:8.2f} s")
    print(f"find_catalogue_passes, the same                {ours_s:8.2f} s   {theirs_s / ours_s:.0f} x faster")
    print(f"largest difference of {events} events             {worst:8.4f} s")
    print(f"objects with other events: {len(right)}, ours as on skyfield's own 10 s grid: {sum(right)}")


def main() -> None:
    """Run all measurements."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--objects", type=int, default=10000)
    parser.add_argument("--against", type=int, default=1000, help="objects to give to skyfield")
    arguments = parser.parse_args()
    place, catalogue = site("Goldstone DSS-13"), synthetic_catalogue(arguments.objects)
    low = next(one for one in catalogue if one.name.startswith("low"))
    track = TopocentricTrack(low, place)
    track.target_at(EPOCH_T_S)
    call_us = seconds(lambda: [track.target_at(EPOCH_T_S + k) for k in range(1000)], repeat=5) * 1e3
    print(f"target_at                                      {call_us:8.1f} us")
    array_us = seconds(lambda: track.sample(EPOCH_T_S + np.arange(0.0, 1e4, 0.1)), repeat=3) * 10.0
    print(f"sample, per time of 100 000                    {array_us:8.2f} us")
    one_s = seconds(lambda: find_passes(track, EPOCH_T_S, DAY_S, MASK_RAD), repeat=3)
    print(f"find_passes, one low orbit, 24 h               {one_s:8.3f} s")
    results = []
    many_s = seconds(lambda: results.append(find_catalogue_passes(catalogue, place, EPOCH_T_S, DAY_S, MASK_RAD)))
    print(f"find_catalogue_passes, {len(catalogue)} objects, 24 h    {many_s:8.2f} s")
    print(f"   {len(results[0].passes)} passes, {len(results[0].unsearched)} objects refused")
    compare(catalogue[: arguments.against], place)


if __name__ == "__main__":
    main()
