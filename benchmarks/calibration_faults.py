"""What a fit does with data that are wrong as a whole: `scripts/run-python benchmarks/calibration_faults.py`.

Random passes of a planted mount (those of calibration_trials.py) with one fault each: a clock common to all passes, some
passes late, a wrong site, wrong weather, a wrong time scale, swapped or reversed axes.  Printed for each: the outcome of
the fit (refused, doubted, left out, silent), the largest error of a term in sigma, and what the fit says.
"""

import argparse
import warnings
from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import product
from multiprocessing import Pool

import calibration_trials as trials
import numpy as np

from rf_pointing.calibration import BiasModel, RawTracking, TrackedPass
from rf_pointing.core import random_stream
from rf_pointing.core.refraction import RadioRefraction
from rf_pointing.ephemeris import Site, site
from rf_pointing.station.campaign.offline_fit import FitData, FitRequest, OfflineFit
from rf_pointing.station.campaign.recorded_input import reference_of

Spoil = Callable[[int, RawTracking], RawTracking]
METRES_PER_RAD = 6.371e6
LAGS = {"azimuth": (-1.022, -1.907), "small": (0.12, -0.25), "unequal": (0.6, 0.35), "none": (0.0, 0.0)}


def late(seconds: float, which: frozenset[int] | None = None) -> Spoil:
    return lambda k, raw: replace(raw, t_s=raw.t_s + (seconds if which is None or k in which else 0.0))


def weather(factor: float, altitude_m: float) -> Spoil:
    air = RadioRefraction.standard(altitude_m)

    def bent(_: int, raw: RawTracking) -> RawTracking:
        return replace(raw, elevation_rad=raw.elevation_rad
                       + (factor - 1.0) * (raw.elevation_rad - air.remove(raw.elevation_rad)))  # fmt: skip

    return bent


def elsewhere(place: Site, east_m: float, north_m: float) -> Site:
    return replace(
        place, longitude_rad=place.longitude_rad + east_m / METRES_PER_RAD / np.cos(place.latitude_rad),
        latitude_rad=place.latitude_rad + north_m / METRES_PER_RAD,
    )  # fmt: skip


def cases(place: Site) -> dict[str, Spoil | Site]:
    few = {f"{count} of 16 late by {seconds} s": late(seconds, frozenset(range(1, 2 * count, 2)))
           for count in (1, 2, 4, 7, 8) for seconds in (0.12, 0.5)}  # fmt: skip
    swapped = lambda _, raw: replace(raw, azimuth_rad=raw.elevation_rad, elevation_rad=raw.azimuth_rad)  # noqa: E731
    return {
        "nothing": late(0.0), **few,
        "site 200 m": elsewhere(place, 120.0, -160.0), "site 5 km": elsewhere(place, 3e3, 4e3),
        "site 20 km": elsewhere(place, -16e3, 12e3),
        "refraction x 1.15": weather(1.15, place.altitude_m), "refraction x 0.9": weather(0.9, place.altitude_m),
        "GPS time": late(18.0), "TT": late(69.184), "TAI": late(37.0), "one hour": late(3600.0),
        "five hours": late(-5 * 3600.0),
        "reversed azimuth": lambda _, raw: replace(raw, azimuth_rad=-raw.azimuth_rad), "swapped axes": swapped,
    }  # fmt: skip


def outcome(
    number: int, spoil: Spoil | Site, mount: BiasModel, case: trials.Case, seed: int, passes: int, select: bool
) -> str:
    place = site(trials.SITES[number % len(trials.SITES)])
    random, own = random_stream(seed, f"faults {number}"), dict[str, np.ndarray]()
    seen = trials.campaign(number, case.rate_hz, passes=passes)
    raws = [trials.measured(one, mount, case, random, own) for one in seen]
    elements = trials.constellation(random_stream(number, "calibration trials"))
    if isinstance(spoil, Site):
        place = spoil
    else:
        raws = [spoil(k, raw) for k, raw in enumerate(raws)]
    try:
        data = FitData(None, [TrackedPass(raw, reference_of(raw, elements, place, 1e7)) for raw in raws])
        request = FitRequest(
            station=trials.STATION.name, band=trials.BAND, site=place, select=select, elements=elements
        )
        done = OfflineFit(request, data).run()
    except ValueError as error:
        return f"REFUSED {error}"
    worst = np.abs(trials.pulls(done.result, mount))
    k = int(np.nanargmax(worst))
    said = [*done.warnings, *(note for note in done.notes if "late" in note or "early" in note)]
    return f"{'said   ' if said else 'SILENT '} x{k + 1} {worst[k]:.1f} sigma: {' | '.join(said)}"


@dataclass(frozen=True)
class Job:
    """One campaign with one fault, by its name."""

    number: int
    orbit_m: float
    shared: bool
    name: str
    seed: int
    passes: int
    select: bool
    clock_s: float = 0.0
    lags: str = ""


def line(job: Job) -> str:
    """Return what the fit of one job says."""
    warnings.simplefilter("ignore")
    mount = trials.planted(random_stream(job.seed, f"mount {job.number}"))
    if job.lags:
        az, el = LAGS[job.lags]
        mount = mount.replace(azimuth_velocity_lag=az, elevation_velocity_lag=el,
                              azimuth_acceleration_lag=0.0, elevation_acceleration_lag=0.0)  # fmt: skip
        spoil: Spoil | Site = late(job.clock_s)
    else:
        spoil = cases(site(trials.SITES[job.number % 4]))[job.name]
    case = trials.Case(job.orbit_m, 1.0, False, job.shared)
    found = outcome(job.number, spoil, mount, case, job.seed, job.passes, job.select)
    return f"{trials.SITES[job.number % 4]:18s} {job.orbit_m:5.0f} m  {job.name:26s} {found}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, nargs="+", default=[1])
    parser.add_argument("--campaigns", type=int, nargs="+", default=[0, 1, 2])
    parser.add_argument("--orbits", type=float, nargs="+", default=[0.0, 150.0])
    parser.add_argument("--passes", type=int, default=16)
    parser.add_argument("--shared", action="store_true", help="one orbit error for all passes of a satellite")
    parser.add_argument("--clock", type=float, nargs="*", default=[0.5], help="lateness of all passes")
    parser.add_argument("--select", action="store_true", help="choose among the terms")
    parser.add_argument("--only", nargs="+", default=[""], help="cases whose name contains one of these")
    parser.add_argument("--workers", type=int, default=1, help="processes that share the cases")
    options = parser.parse_args()
    wanted = [(name, 0.0, "") for name in cases(site(trials.SITES[0]))]
    wanted += [(f"clock {seconds} s, lags {lags}", seconds, lags) for seconds in options.clock for lags in LAGS]
    jobs = [
        Job(number, orbit, options.shared, name, seed, options.passes, options.select, seconds, lags)
        for seed, number, orbit in product(options.seeds, options.campaigns, options.orbits)
        for name, seconds, lags in wanted
        if any(word in name for word in options.only)
    ]
    with Pool(options.workers) as pool:
        for text in pool.imap(line, jobs):
            print(text, flush=True)


if __name__ == "__main__":
    main()
