"""Coverage of the sigma of `fit_bias_model` on raw data: `scripts/run-python benchmarks/calibration_trials.py`.

Each trial plants a random mount in random passes, adds noise and an orbit error to every pass, and runs what the
executable runs.  Printed per case: the share of the estimates within 1 and 2 sigma, the worst term of each, the rms of
(estimate - truth) / sigma, and with --select false and missed terms.  A share of T trials has a binomial error of
sqrt(p (1 - p) / T): 2.7 % at 68.3 % and 1.2 % at 95.4 % for 300.  A case holds if no term's share differs from that
of a normal distribution by more than chance: a two-sided exact binomial test at 5 % for the 28 shares of the 14 terms
together (Sidak), so 0.18 % for each, which for 300 trials is 59.7 to 76.3 % and 91.3 to 98.7 %.  NEES is the mean of
e' C^-1 e of all terms together, by their number: 1 +/- sqrt(2 / (14 T)) for a covariance that is right.

--points fits points with white noise instead.  --mount x_y, ha_dec or azimuth_elevation_tilt plants the terms of such
a mount and records the angles of its axes.

Orbit errors are those of elements: along the track (mean anomaly), across it (inclination, node) and in height
(eccentricity vector), propagated by SGP4; every pass has its own, as passes of different days have.
"""

import argparse
import os
import pickle
import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from itertools import product
from multiprocessing import Pool
from pathlib import Path

for variable in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"):
    os.environ.setdefault(variable, "1")

import numpy as np  # noqa: E402
from numpy.typing import NDArray  # noqa: E402
from scipy.signal import lfilter  # noqa: E402
from scipy.stats import binomtest  # noqa: E402

from rf_pointing.calibration import (  # noqa: E402
    BiasModel,
    FitOptions,
    FitResult,
    Observations,
    RawTracking,
    ReferenceTrack,
    TrackedPass,
    fit_bias_model,
)  # fmt: skip
from rf_pointing.calibration.terms import MOUNT_TERMS, names_of  # noqa: E402
from rf_pointing.core import MDEG, azel_from_unit_vector, random_stream, unit_vector_from_azel, wrap_rad  # noqa: E402
from rf_pointing.core.kinematics import LEVEL, Kinematics  # noqa: E402
from rf_pointing.core.mount_types import AZIMUTH_ELEVATION, MOUNTS  # noqa: E402
from rf_pointing.ephemeris import Elements, Site, TopocentricTrack, find_passes, site  # noqa: E402
from rf_pointing.station.campaign import recorded_input  # noqa: E402
from rf_pointing.station.campaign.offline_fit import FitData, FitRequest, OfflineFit  # noqa: E402
from rf_pointing.station.description.description import read_station  # noqa: E402

Array = NDArray[np.float64]

EPOCH_T_S = 1_700_000_000.0
SITES = ("Madrid DSS-63", "Goldstone DSS-13", "Mauritius ISTRAC", "Canberra DSS-43")
# The antenna that the data are said to be of; the sites above count.
STATION = read_station("dss13")
BAND = STATION.default_band
PASSES = 28
# Shares of a normal distribution.
WITHIN = ((1.0, 0.682689), (2.0, 0.954500))
SIGNIFICANT = 0.05
# Along the track, across it and in height, of the size of an orbit error.
SHARES = (1.0, 0.3, 0.2)
# One sigma of the planted terms; half of the terms are zero with --select.
PLANTED = {"rad": 60.0 * MDEG, "s": 0.5, "s^2": 0.3}
NOISE_RAD, CORRELATION_S = 4.0 * MDEG, 4.0
# At 88.8 deg the azimuth turns by a radian in 2 s: differences of samples a second apart were 3 mdeg off.
STENCIL_S = 0.2
# No mount records what it cannot follow: azimuth rate of the fastest station that ships.
FASTEST_RAD_S = np.radians(6.0)


@dataclass(frozen=True, eq=False)
class Seen:
    """One pass: its reference and its motion at the samples.

    `angles_rad` (2, 3, n) are azimuth and elevation STENCIL_S before, at and after them, `position_m`
    (3, n, 3) where the target is then, and `fields` (3, n, 3) how a metre of each error moves it.
    """

    reference: ReferenceTrack
    target: str
    at: ReferenceTrack
    angles_rad: Array
    position_m: Array
    fields: tuple[Array, ...]


@dataclass(frozen=True, eq=False)
class Case:
    """What is planted besides the mount."""

    orbit_m: float
    rate_hz: float
    correlated: bool
    shared: bool = False

    @property
    def name(self) -> str:
        noise = "correlated" if self.correlated else "white"
        whose = " of each satellite" if self.shared else ""
        return f"{self.rate_hz:g} Hz, {noise}, orbit {self.orbit_m:g} m{whose}"


def constellation(random: np.random.Generator, count: int = 4) -> list[Elements]:
    """Return low satellites."""
    made = []
    for number in range(count):
        axis_m = 6.378e6 + random.uniform(500e3, 1300e3)
        made.append(
            Elements(
                name=f"T{number}",
                catalogue_number=90000 + number,
                epoch_t_s=EPOCH_T_S,
                inclination_rad=np.radians(random.uniform(55.0, 99.0)),
                ascending_node_rad=random.uniform(0.0, 2.0 * np.pi),
                eccentricity=random.uniform(0.0005, 0.004),
                argument_of_perigee_rad=random.uniform(0.0, 2.0 * np.pi),
                mean_anomaly_rad=random.uniform(0.0, 2.0 * np.pi),
                mean_motion_rad_s=float(np.sqrt(3.986e14 / axis_m**3)),
                drag_per_earth_radius=1e-5,
            )
        )
    return made


def changes(elements: Elements) -> list[Elements]:
    """Return the elements a hundred metres off in each of five directions."""
    axis_m = (3.986e14 / elements.mean_motion_rad_s**2) ** (1.0 / 3.0)
    off, e, w = 100.0 / axis_m, elements.eccentricity, elements.argument_of_perigee_rad
    # The eccentricity vector moves by `off` in both directions; the argument of latitude stays.
    moved = []
    for x, y in ((e * np.cos(w) + off, e * np.sin(w)), (e * np.cos(w), e * np.sin(w) + off)):
        perigee = float(np.arctan2(y, x))
        moved.append(
            replace(
                elements,
                eccentricity=float(np.hypot(x, y)),
                argument_of_perigee_rad=perigee,
                mean_anomaly_rad=elements.mean_anomaly_rad + w - perigee,
            )
        )
    node = off / np.sin(elements.inclination_rad)
    return [
        replace(elements, mean_anomaly_rad=elements.mean_anomaly_rad + off),
        replace(elements, inclination_rad=elements.inclination_rad + off),
        replace(
            elements,
            ascending_node_rad=elements.ascending_node_rad + node,
            mean_anomaly_rad=elements.mean_anomaly_rad - node * np.cos(elements.inclination_rad),
        ),
        *moved,
    ]


def campaign(
    number: int, rate_hz: float, *, place: Site | None = None, passes: int = PASSES, satellites: int = 4
) -> list[Seen]:
    """Return the passes of one campaign at one of the sites, or at `place`."""
    random, place = random_stream(number, "calibration trials"), place or site(SITES[number % len(SITES)])
    every = []
    for elements in constellation(random, satellites):
        track = TopocentricTrack(elements, place)
        every += [(elements, track, one) for one in find_passes(track, EPOCH_T_S, 3.0 * 86400.0, np.radians(10.0))]
    high = [one for one in every if one[2].peak_elevation_rad > np.radians(20.0)]
    if satellites == 4:
        chosen = [high[k] for k in sorted(random.choice(len(high), min(passes, len(high)), replace=False).tolist())]
    else:
        # As many passes of each, as far as there are.
        order, rank = random.permutation(len(high)), Counter[str]()
        turn = np.zeros(len(high))
        for k in order.tolist():
            turn[k] = rank[high[k][0].name]
            rank[high[k][0].name] += 1
        chosen = [high[k] for k in sorted(order[np.argsort(turn[order], kind="stable")][:passes].tolist())]
    return [seen_of(elements, track, one.aos_t_s, one.los_t_s, rate_hz) for elements, track, one in chosen]


def followed(azimuth_rad: Array, step_rad: float) -> NDArray[np.bool_]:
    """Return where (n,) an axis that turns by at most `step_rad` from sample to sample is on its target."""
    axis_rad, on = azimuth_rad[0], np.zeros(len(azimuth_rad), dtype=bool)
    for k, target_rad in enumerate(azimuth_rad):
        axis_rad += np.clip(target_rad - axis_rad, -step_rad, step_rad)
        on[k] = abs(axis_rad - target_rad) < 1e-9
    return on


def seen_of(elements: Elements, track: TopocentricTrack, first_s: float, last_s: float, rate_hz: float) -> Seen:
    """Return one pass."""
    times = np.arange(np.ceil(first_s), last_s, 1.0 / rate_hz)
    times = times[followed(np.unwrap(track.sample(times).azimuth_rad), FASTEST_RAD_S / rate_hz)]
    look = track.sample(times)
    at = ReferenceTrack.of(look)
    around = (times + STENCIL_S * np.array([[-1.0], [0.0], [1.0]])).ravel()
    near = track.sample(around)
    angles = np.stack([near.azimuth_rad, near.elevation_rad]).reshape(2, 3, -1)
    apparent = near.range_m[:, np.newaxis] * unit_vector_from_azel(near.azimuth_rad, near.elevation_rad)
    base = np.array(track.relative_motion_at(around)[0].position).T
    fields = [
        ((np.array(TopocentricTrack(one, track.site).relative_motion_at(around)[0].position).T - base) / 100.0)
        for one in changes(elements)
    ]
    grid = np.arange(times[0] - 60.0, times[-1] + 60.0, recorded_input.REFERENCE_STEP_S)
    sampled = track.sample(grid)
    reference = ReferenceTrack.of(sampled)
    shape = (3, len(times), 3)
    return Seen(
        reference, elements.name, at, angles, apparent.reshape(shape), tuple(one.reshape(shape) for one in fields)
    )


def mount_at(kind: str, place: Site) -> Kinematics:
    """Return a mount of some kind at a site."""
    latitude, tilt = (
        (place.latitude_rad if kind == "ha_dec" else 0.0),
        np.radians(7.0 if kind.endswith("tilt") else 0.0),
    )
    return Kinematics(type=kind, latitude_rad=latitude, tilt_rad=float(tilt), train_rad=1.0 if tilt else 0.0)


def planted(random: np.random.Generator, mount: Kinematics = LEVEL) -> BiasModel:
    """Return a random mount without half of the terms."""
    terms = MOUNT_TERMS[mount.type]
    values = {term.name: PLANTED[term.unit] * random.standard_normal() * (random.random() < 0.5) for term in terms}
    return BiasModel.zero(mount).replace(**values)


def measured(
    seen: Seen, mount: BiasModel, case: Case, random: np.random.Generator, own: dict[str, Array] | None = None
) -> RawTracking:
    """Return what the station records of a pass; `own` keeps the errors that its satellite has in all passes."""
    size = case.orbit_m * np.array([SHARES[0], SHARES[1], SHARES[1], SHARES[2], SHARES[2]])
    errors = random.normal(size=5) * size
    if case.shared and own is not None:
        errors = own.setdefault(seen.target, errors)
    moved = seen.position_m + sum(m * one for m, one in zip(errors, seen.fields, strict=True))
    at = seen.at
    azimuth, elevation = azel_from_unit_vector(moved)
    around = np.stack([wrap_rad(azimuth - seen.angles_rad[0]), elevation - seen.angles_rad[1]])
    shift, rate = around[:, 1], (around[:, 2] - around[:, 0]) / (2.0 * STENCIL_S)
    bend = (around[:, 2] - 2.0 * shift + around[:, 0]) / STENCIL_S**2
    motion = at.motion()
    true = [motion[0] + shift[0], motion[1] + shift[1], motion[2] + rate[0], motion[3] + rate[1]]
    true += [motion[4] + bend[0], motion[5] + bend[1]]
    if mount.mount is not None and not mount.mount.level:
        pairs = [np.column_stack(true[k : k + 2]) for k in (0, 2, 4)]
        true = list(np.concatenate(mount.mount.to_axes(*pairs), axis=1).T)
    observed = np.stack(mount.apply(*true))
    # Some passes are windier than others.
    noise = NOISE_RAD * np.exp(0.3 * random.standard_normal()) * noise_of(len(at.t_s), case, random)
    noise[0] /= np.cos(true[1])
    observed += noise
    return RawTracking(
        station=STATION.name,
        band=BAND,
        target=seen.target,
        t_s=at.t_s,
        azimuth_rad=observed[0],
        elevation_rad=observed[1],
        range_m=None,
        range_rate_m_s=None,
        good=np.ones(len(at.t_s), dtype=bool),
    )


def noise_of(count: int, case: Case, random: np.random.Generator) -> Array:
    """Return noise (2, count) of unit variance."""
    white = random.standard_normal((2, count))
    if not case.correlated:
        return white
    decay = np.exp(-1.0 / (case.rate_hz * CORRELATION_S))
    start = random.standard_normal((2, 1)) * decay
    slow = lfilter([np.sqrt(1.0 - decay**2)], [1.0, -decay], random.standard_normal((2, count)), zi=start)[0]
    return np.asarray(np.sqrt(0.5) * (white + slow))


@dataclass(frozen=True, eq=False)
class Outcome:
    """(estimate - truth) / sigma of all terms and of the chosen ones (trials, 14), and the truth.

    NaN: not chosen.  Those `kept` are fitted since others depend on them.
    """

    full: Array
    chosen: Array
    kept: NDArray[np.bool_]
    truth: Array
    seconds: Array
    nees: Array
    refused: list[str]


@dataclass(frozen=True)
class Job:
    """One trial: what is planted, in which campaign, and how it is fitted."""

    case: Case
    seed: int
    number: int
    satellites: int
    select: bool
    kind: str = AZIMUTH_ELEVATION


@cache
def geometry(number: int, rate_hz: float, satellites: int) -> list[Seen]:
    """Return the passes of a campaign, simulated once by each process."""
    return campaign(number, rate_hz, satellites=satellites)


def run_trial(job: Job) -> tuple[object, ...] | str:
    """Simulate and fit; return the row of `Outcome`, or why the fit is refused."""
    random, own = random_stream(job.seed, f"trials {job.case.name}"), dict[str, Array]()
    place = site(SITES[job.number % len(SITES)])
    axes = mount_at(job.kind, place)
    mount = planted(random, axes)
    passes = [
        TrackedPass(measured(one, mount, job.case, random, own), one.reference.on(axes))
        for one in geometry(job.number, job.case.rate_hz, job.satellites)
    ]
    # The clock of the trials is right: some of the planted mounts lag alike in both axes.
    request = FitRequest(
        station=STATION.name, band=BAND, site=place, mount=axes, terms=names_of(job.kind), time_error_s=0.0,
        select=job.select,
    )  # fmt: skip
    start = time.process_time()
    try:
        done = OfflineFit(request, FitData(None, passes)).run()
    except ValueError as error:
        return str(error)
    kept, truth = zip(*((name in done.kept, mount.coefficients[name]) for name in names_of(job.kind)), strict=True)
    every = done.full or done.result
    return pulls(every, mount), pulls(done.result, mount), kept, truth, time.process_time() - start, nees(every, mount)


def run_trials(
    case: Case,
    trials: int,
    campaigns: Sequence[int],
    seed: int,
    satellites: Sequence[int],
    select: bool,
    keep: Path | None,
    kind: str = AZIMUTH_ELEVATION,
    workers: int = 1,
) -> Outcome:
    """Simulate and fit; constellations and campaigns take turns.  What `keep` has of a case is not run again."""
    key = f"{case.name}, {satellites} satellites, {campaigns} campaigns, seed {seed}, {select}, {kind}".replace(
        " ", "_"
    )
    store = keep / f"{key}.pickle" if keep else None
    rows: list[tuple[object, ...] | str] = pickle.loads(store.read_bytes()) if store and store.exists() else []
    jobs = [
        Job(case, seed + trial, campaigns[trial // len(satellites) % len(campaigns)],
            satellites[trial % len(satellites)], select, kind)
        for trial in range(len(rows), trials)
    ]  # fmt: skip
    with Pool(workers) as pool:
        for row in pool.imap(run_trial, jobs):
            rows.append(row)
            if store:
                store.write_bytes(pickle.dumps(rows))
    fitted = zip(*(row for row in rows if not isinstance(row, str)), strict=True)
    return Outcome(*map(np.array, fitted), [row for row in rows if isinstance(row, str)])


def points_of(seen: list[Seen], mount: BiasModel, axes: Kinematics, random: np.random.Generator) -> Observations:
    """Return a point every 10 s of all passes with white noise and no other error."""
    parts = []
    for number, one in enumerate(seen):
        rows = one.at.t_s[:: max(1, round(10.0 / (one.at.t_s[1] - one.at.t_s[0])))]
        track = one.at.on(axes).at(rows)
        motion, sigma = track.motion(), np.full(len(rows), NOISE_RAD)
        noise = random.standard_normal((2, len(rows))) * [sigma / np.cos(motion[1]), sigma]
        observed = np.stack(mount.apply(*motion)) + noise
        parts.append(
            Observations(
                station=STATION.name, band=BAND, mount=axes, t_s=rows, pass_id=np.full(len(rows), number),
                observed_azimuth_rad=observed[0], observed_elevation_rad=observed[1],
                sigma_azimuth_rad=sigma / np.cos(motion[1]), sigma_elevation_rad=sigma, **track.truth(),
            )
        )  # fmt: skip
    return Observations.concatenate(parts)


def pulls(fit: FitResult, mount: BiasModel) -> Array:
    """Return (estimate - truth) / sigma of every term (14,), NaN for those that were not fitted."""
    names = tuple(mount.coefficients)
    found = np.full(len(names), np.nan)
    for name, value, sigma in zip(fit.names, fit.values, fit.sigma, strict=True):
        found[names.index(name)] = (value - mount.coefficients[name]) / sigma
    return found


def nees(fit: FitResult, mount: BiasModel) -> float:
    """Return the squared error of all fitted terms together, by its covariance and their number."""
    error = fit.values - [mount.coefficients[name] for name in fit.names]
    return float(error @ np.linalg.solve(fit.covariance, error)) / len(error)


def shares(pull: Array, within: float) -> Array:
    """Return the share of each term's pulls that are within so many sigma."""
    known = np.isfinite(pull)
    return np.asarray(
        np.sum(np.abs(np.where(known, pull, np.inf)) <= within, axis=0) / np.maximum(np.sum(known, axis=0), 1)
    )


def chance(pull: Array) -> tuple[float, str]:
    """Return the probability of a share as far off as the worst of all terms, and which that is."""
    known = np.isfinite(pull)
    found = []
    for limit, expected in WITHIN:
        for term, (row, there) in enumerate(zip(pull.T, known.T, strict=True)):
            if np.any(there):
                inside = int(np.sum(np.abs(row[there]) <= limit))
                one = binomtest(inside, int(np.sum(there)), expected).pvalue
                found.append((float(one), f"x{term + 1} {100.0 * inside / np.sum(there):.1f} % within {limit:g} sigma"))
    least, which = min(found)
    return 1.0 - (1.0 - least) ** len(found), which


def describe(name: str, pull: Array, verbose: bool) -> str:
    """Return the lines of one case."""
    known = np.isfinite(pull)
    one, two = shares(pull, 1.0), shares(pull, 2.0)
    total = [100.0 * np.mean(np.abs(pull[known]) <= limit) for limit in (1.0, 2.0)]
    # Terms of one fit depend on each other: the error of the share of all is that between trials.
    inside = [np.where(known, (np.abs(pull) <= limit) - expected, 0.0).sum(axis=1) for limit, expected in WITHIN]
    spread = [100.0 * float(np.std(one)) * np.sqrt(len(pull)) / np.sum(known) for one in inside]
    counts = np.maximum(np.sum(known, axis=0), 1)
    rms = np.sqrt(np.sum(np.where(known, pull, 0.0) ** 2, axis=0) / counts)
    mean = np.sum(np.where(known, pull, 0.0), axis=0) / counts
    worst = [
        f"x{np.argmin(values) + 1} {100.0 * np.min(values):.0f} .. x{np.argmax(values) + 1} {100.0 * np.max(values):.0f}"
        for values in (one, two)
    ]
    whole = 100.0 * np.mean(np.all(np.abs(np.where(known, pull, 0.0)) <= 3.0, axis=1))
    lines = [
        f"{name:46s} 1 sigma {total[0]:4.1f} +/- {spread[0]:.1f} % ({worst[0]}), 2 sigma {total[1]:4.1f} +/- {spread[1]:.1f} % "
        f"({worst[1]}), all terms within 3: "
        f"{whole:.0f} %, rms {np.nanmin(rms):.2f} .. {np.nanmax(rms):.2f}"
    ]
    probability, which = chance(pull)
    verdict = "holds" if probability >= SIGNIFICANT else "MISSES"
    lines.append(f"    {verdict}: the worst of all terms is {which}, probability {probability:.3f}")
    if verbose:
        lines += [
            f"    {word:8s}" + " ".join(f"{100.0 * v:5.0f}" for v in row)
            for word, row in (("1 sigma", one), ("2 sigma", two))
        ]
        lines += [f"    {word:8s}" + " ".join(f"{v:5.2f}" for v in row) for word, row in (("rms", rms), ("mean", mean))]
    return "\n".join(lines)


def point_trials(options: argparse.Namespace) -> None:
    """Print the same of fits of points with white noise: the terms and their partials alone."""
    rows = []
    for trial in range(options.trials):
        random = random_stream(options.seed + trial, "points")
        axes = mount_at(options.mount, site(SITES[trial % options.campaigns % len(SITES)]))
        mount = planted(random, axes)
        points = points_of(geometry(trial % options.campaigns, 1.0, 4), mount, axes, random)
        fit = fit_bias_model(points, options=FitOptions(form="rotation", edit_sigma=0.0))
        rows.append((pulls(fit, mount), nees(fit, mount)))
    pull, size = (np.array(each) for each in zip(*rows, strict=True))
    print(describe(f"{options.mount}, points with white noise", pull, options.verbose))
    print(f"    NEES {np.mean(size):.3f} +/- {np.std(size) / np.sqrt(len(size)):.3f}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--trials", type=int, default=300)
    parser.add_argument("--campaigns", type=int, default=6, help="geometries that take turns")
    parser.add_argument("--first-campaign", type=int, default=0, help="the first of them")
    parser.add_argument("--workers", type=int, default=1, help="processes that share the trials")
    parser.add_argument("--seed", type=int, default=100_000)
    parser.add_argument("--rates", type=float, nargs="+", default=[1.0, 5.0])
    parser.add_argument("--noise", nargs="+", choices=("white", "correlated"), default=["white", "correlated"])
    parser.add_argument("--orbits", type=float, nargs="+", default=[0.0, 150.0, 1000.0])
    parser.add_argument("--mount", choices=tuple(MOUNTS), default=AZIMUTH_ELEVATION)
    parser.add_argument(
        "--satellites", type=int, nargs="+", default=[4], help="among which the passes are; more than one take turns"
    )
    parser.add_argument("--points", action="store_true", help="fits of points with white noise, without raw data")
    parser.add_argument("--shared", action="store_true", help="one orbit error for all passes of a satellite")
    parser.add_argument("--all-terms", action="store_true", help="without the choice of terms")
    parser.add_argument("--keep", type=Path, help="directory of what was run, from which a run goes on")
    parser.add_argument("--verbose", action="store_true", help="every term")
    options = parser.parse_args()
    if options.points:
        point_trials(options)
        return
    numbers = range(options.first_campaign, options.first_campaign + options.campaigns)
    for rate, noise, orbit in product(options.rates, options.noise, options.orbits):
        case = Case(orbit, rate, noise == "correlated", options.shared)
        found = run_trials(
            case,
            options.trials,
            numbers,
            options.seed,
            options.satellites,
            not options.all_terms,
            options.keep,
            options.mount,
            options.workers,
        )
        each = ", ".join(f"{PASSES / count:.0f}" for count in options.satellites)
        print(f"{each} passes of each of {', '.join(map(str, options.satellites))} satellites:")
        print(describe(case.name, found.full, options.verbose))
        print(f"    NEES {np.mean(found.nees):.3f} +/- {np.std(found.nees) / np.sqrt(len(found.nees)):.3f}", flush=True)
        if options.all_terms:
            print(f"    {len(found.refused)} refused{': ' + found.refused[0] if found.refused else ''}", flush=True)
            continue
        print(describe(f"{case.name}, --select", found.chosen, options.verbose))
        known, zero = np.isfinite(found.chosen) & ~found.kept, found.truth == 0.0
        false, missed = np.sum(known & zero) / np.sum(zero), np.sum(~known & ~zero) / np.sum(~zero)
        milliseconds = 1e3 * float(np.median(found.seconds))
        print(
            f"    chosen: {100.0 * false:.1f} % false, {100.0 * missed:.1f} % missed, "
            f"{100.0 * np.mean(found.kept):.1f} % of all kept; {milliseconds:.0f} ms a fit"
            f"; {len(found.refused)} refused{': ' + found.refused[0] if found.refused else ''}",
            flush=True,
        )


if __name__ == "__main__":
    main()
