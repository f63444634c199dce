"""Processor time of one object's pass search beside skyfield's, and a check by brute force.

    scripts/run-python benchmarks/pass_search.py --objects 300

The objects are those of benchmarks/ephemeris.py, with a tenth at an eccentricity of 0.95, over
sites to both poles.  Both search 24 h above 5 deg in the same run; skyfield gives times of events,
good to half a second, ours whole passes in refraction, good to 0.1 ms.  Brute force samples the
track every 10 s.
"""

import argparse
import math
from dataclasses import replace

import numpy as np
from ephemeris import DAY_S, EPOCH_T_S, MASK_RAD, Skyfield, seconds, synthetic_catalogue

from rf_pointing.core.constants import EARTH_MU_M3_S2
from rf_pointing.ephemeris import Elements, Site, TopocentricTrack, find_passes, read_elements
from rf_pointing.ephemeris.tle import tle_lines

LATITUDES_DEG = (35.2, -35.4, 89.99, -89.99, 78.2, 0.0)


def as_read(one: Elements, number: int) -> Elements:
    """Return an object as its lines give it, every tenth with an eccentricity of 0.95."""
    if number % 10 == 9:
        axis_m = 6.9e6 / 0.05
        one = replace(one, eccentricity=0.95, mean_motion_rad_s=math.sqrt(EARTH_MU_M3_S2 / axis_m**3))
    return read_elements("\n".join((one.name, *tle_lines(one))))[0]


def wrong(track: TopocentricTrack) -> str:
    """Return in what the passes differ from brute force, "" for nothing."""
    found = find_passes(track, EPOCH_T_S, DAY_S, MASK_RAD)
    # An object may decay within the day.
    times = np.arange(EPOCH_T_S, min(EPOCH_T_S + DAY_S, track.spans_t_s[0][1]), 10.0)
    inside = np.zeros(len(times), dtype=bool)
    for one in found:
        inside |= (times >= one.aos_t_s) & (times <= one.los_t_s)
    looks = track.sample(times)
    other = (looks.elevation_rad > MASK_RAD) != inside
    edges = [
        t for one in found for t, cut in ((one.aos_t_s, one.rises_before), (one.los_t_s, one.sets_after)) if not cut
    ]
    at = track.sample(np.array(edges)) if edges else looks
    off_s = np.abs(at.elevation_rad - MASK_RAD) / np.abs(at.elevation_rate_rad_s) if edges else np.zeros(1)
    late = f"an edge is {off_s.max() * 1e3:.2f} ms off" if off_s.max() > 2e-4 else ""
    return f"{int(other.sum())} of {len(times)} instants" if np.any(other) else late


def main() -> None:
    """Search with both and print the ratio."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--objects", type=int, default=300)
    parser.add_argument("--seed", type=int, default=36)
    options = parser.parse_args()
    read = [as_read(one, number) for number, one in enumerate(synthetic_catalogue(options.objects, seed=options.seed))]
    anywhere = Site.from_degrees(0.0, 0.0, 0.0)
    # Sun and Moon have brought some of the most eccentric ones down.
    objects = [one for one in read if TopocentricTrack(one, anywhere).spans_t_s[0][1] > EPOCH_T_S + DAY_S]
    ours_s = theirs_s = 0.0
    passes, differing = 0, list[str]()
    for place in (Site.from_degrees(latitude, 12.0, 100.0) for latitude in LATITUDES_DEG):
        mine = objects[LATITUDES_DEG.index(round(math.degrees(place.latitude_rad), 2)) :: len(LATITUDES_DEG)]
        tracks, other = [TopocentricTrack(one, place) for one in mine], Skyfield(mine, place)
        found = [find_passes(track, EPOCH_T_S, DAY_S, MASK_RAD) for track in tracks]
        other.search()
        passes += sum(map(len, found))
        ours_s += seconds(lambda tracks=tracks: [find_passes(t, EPOCH_T_S, DAY_S, MASK_RAD) for t in tracks], 3)
        theirs_s += seconds(other.search, 3)
        differing += [f"{track.name}: {text}" for track in tracks if (text := wrong(track))]
    print(f"find_passes            {1e3 * ours_s / len(objects):6.2f} ms an object, {passes} passes")
    print(f"skyfield find_events   {1e3 * theirs_s / len(objects):6.2f} ms an object")
    print(f"ratio                  {ours_s / theirs_s:6.2f}")
    print(f"other than by brute force: {len(differing)} of {len(objects)}", *differing, sep="\n  ")


if __name__ == "__main__":
    main()
