"""The plan of a network beside the bound of its integer programme, and what it takes.

    scripts/run-python benchmarks/network_plan.py --stations 10 --objects 200 --hours 24

Satellites are the low ones of the synthetic catalogue of benchmarks/ephemeris.py, stations the shipped 3.7-m dish at
ten places.  The bound is that of all fractions (HiGHS), which no plan can exceed.
"""

import argparse
import dataclasses
import math
import time

from ephemeris import EPOCH_T_S, synthetic_catalogue

import rf_pointing as rp
from rf_pointing.ephemeris import Site
from rf_pointing.planning import network
from rf_pointing.station.pointing.multi_satellite_plan import Fate, Wish
from rf_pointing.station.pointing.network_plan import plan_days

PLACES = (
    (40, -105),
    (48, 11),
    (35, 139),
    (-33, 149),
    (-30, -71),
    (69, 18),
    (19, -155),
    (-26, 28),
    (64, -147),
    (1, 104),
)
LOW_RAD_S = math.tau / (130.0 * 60.0)
"""Mean motion of a satellite that is low."""


def main() -> None:
    """Plan once, and print time, contacts and the distance from the bound."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--stations", type=int, default=10)
    parser.add_argument("--objects", type=int, default=200)
    parser.add_argument("--hours", type=float, default=24.0)
    options = parser.parse_args()
    low = [one for one in synthetic_catalogue(4 * options.objects) if one.mean_motion_rad_s > LOW_RAD_S]
    wishes = [Wish(target=one) for one in low[: options.objects]]
    station = rp.Station("leo_3m7")
    antennas = [
        dataclasses.replace(
            station.antenna(station.lowest_rad),
            site=Site(latitude_rad=math.radians(place[0]), longitude_rad=math.radians(place[1]), altitude_m=500.0),
        )
        for place in PLACES[: options.stations]
    ]
    solving, solve = [0.0, 0.0], network.Programme.assign

    def timed(*given: object, **more: object) -> network.Assignment:
        begun = time.process_time()
        found: network.Assignment = solve(*given, **more)  # type: ignore[arg-type]
        solving[0] += time.process_time() - begun
        solving[1] += 1
        return found

    network.Programme.assign = timed  # type: ignore[method-assign,assignment]
    wall, cpu = time.perf_counter(), time.process_time()
    found = plan_days(
        wishes, antennas, EPOCH_T_S, 3600.0 * options.hours, names=[str(place) for place in PLACES],
        clear=[1.0] * len(antennas), gap_s=10.0,
    )  # fmt: skip
    wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
    passes = [item for day in found.days for item in day.passes]
    fates = {str(fate): sum(item.fate is fate for item in passes) for fate in Fate}
    print(f"{len(antennas)} stations, {len(wishes)} satellites, {options.hours:g} h: {len(passes)} passes, {fates}")
    print(f"below the bound by {found.better_by:.2%}; {wall:.1f} s, processor {cpu:.1f} s, of these {solving[0]:.1f} s in "
          f"{solving[1]:.0f} choices")  # fmt: skip


if __name__ == "__main__":
    main()
