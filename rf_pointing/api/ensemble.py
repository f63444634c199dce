"""Ensembles: every pass of days or years, some trials of each, for choosing before buying.

Each pass is flown alone by the whole simulated station, as if the antenna had no other (a plan of
many says which yield), with draws of its own: the results are the same however many processes share
them.  They are kept as lines of JSON, one a pass, and what is there already is not flown again.
"""

import hashlib
import json
import math
import os
import signal
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from dataclasses import asdict, dataclass, field
from functools import partial
from multiprocessing import get_context, parent_process
from pathlib import Path
from threading import Thread
from typing import Any, NamedTuple

import numpy as np

from rf_pointing.api.keywords import span_s, time_s
from rf_pointing.api.passes import StationPass
from rf_pointing.api.simulated import CLUSTER_S
from rf_pointing.api.station import BEFORE_S, Station
from rf_pointing.api.target import Target
from rf_pointing.core import DAY_S, MDEG, PassOutcome, require_between, utc_text
from rf_pointing.ephemeris import Elements, ElementUncertainty, Pass, TopocentricTrack, find_passes
from rf_pointing.simulation import StationSetup, merged, simulate_pass
from rf_pointing.simulation.draws import Draw

MOST_DAYS, MOST_TRIALS = 3650.0, 100_000
LONGEST_PASS_S = 3600.0
"""Longer passes are of high orbits, whose antenna hardly moves: services on them are not passes."""
RENEWED_S = DAY_S
"""Elements are renewed so often: the age of those in use, by which they are off."""
ATTEMPTS = 3
"""How often in a row processes may die without that any pass is flown."""
PERCENTILES = (50.0, 90.0, 99.0)

# In a trial the elements keep the age that was drawn, however long ago their epoch is.
GROWTHS = ("along_growth_m_s", "along_drag_m_s2", "cross_growth_m_s", "radial_growth_m_s")

Progress = Callable[[int, int], object]
Row = dict[str, Any]


class Trial(NamedTuple):
    """A trial of a pass, and what is drawn for it."""

    target: Target
    window: Pass
    trial: int
    draw: Draw
    age_s: float

    @property
    def key(self) -> str:
        """Name of the trial in the file of its ensemble."""
        return f"{self.target.satellite} {self.window.aos_t_s:.3f} {self.trial}"


@dataclass(frozen=True, eq=False)
class Ensemble:
    """Outcome of an ensemble: `rows`, one a pass, as they stand in its file.

    A row has satellite, aos_utc, trial, peak_elevation_deg, the draw (seed, wind_m_s,
    along_track_s, ...), and either `refused`, why certificate or wind allow no pass, or the
    outcome: duration_s, held_s, loss_db, rms_mdeg (while held), keyhole_s, late_s, starts, fault.
    """

    station: str
    sensor: str
    rows: tuple[Mapping[str, Any], ...] = field(repr=False)
    planned: int
    """Passes of the whole ensemble: more than the rows where it was interrupted."""

    @property
    def summary(self) -> dict[str, float]:
        """Shares (availability, refused), loss percentiles in dB, times and starts per pass."""
        flown = [row for row in self.rows if not row["refused"]]
        if not flown:
            count = float(len(self.rows))
            return {"passes": count, "refused": min(count, 1.0), "availability": 0.0}

        def mean(name: str, power: int = 1) -> float:
            return float(np.mean([row[name] ** power for row in flown]))

        losses = np.percentile([row["loss_db"] for row in flown], PERCENTILES).tolist()
        whole_s = math.fsum(row["duration_s"] for row in self.rows)
        return {
            "passes": float(len(self.rows)), "refused": 1.0 - len(flown) / len(self.rows),
            "availability": math.fsum(row["held_s"] for row in flown) / whole_s,
            **{f"loss_{each:g}_db": loss for each, loss in zip(PERCENTILES, losses, strict=True)},
            "rms_mdeg": math.sqrt(mean("rms_mdeg", 2)), "keyhole_s": mean("keyhole_s"),
            "late_s": mean("late_s"), "motor_starts": mean("starts"),
        }  # fmt: skip

    def __str__(self) -> str:
        found = self.summary
        lines = [f"{self.station}, {self.sensor}: {len(self.rows)} of {self.planned} passes"]
        words = {
            "refused": ("refused by certificate or wind", 100.0, "%"),
            "availability": ("target within the half-power beam", 100.0, "% of the time"),
            **{
                f"loss_{each:g}_db": (f"pointing loss, {each:g} % of the passes below", 1.0, "dB")
                for each in PERCENTILES
            },
            "rms_mdeg": ("pointing error while tracking", 1.0, "mdeg rms"),
            "keyhole_s": ("lost in keyholes", 1.0, "s a pass"),
            "late_s": ("slew later than the rise", 1.0, "s a pass"),
            "motor_starts": ("starts of both motors of a rotator", 1.0, "a pass"),
        }
        lines += [
            f"  {word:<42}{factor * found[name]:10.3f} {unit}"
            for name, (word, factor, unit) in words.items()
            if name in found
        ]
        return "\n".join(lines)


def ensemble(
    station: Station,
    targets: Sequence[Target],
    *,
    start: str | None = None,
    start_t_s: float | None = None,
    days: float = 1.0,
    trials: int = 1,
    seed: int = 1,
    sensor: str | None = None,
    min_peak_deg: float = 0.0,
    changes: Mapping[str, Mapping[str, object]] | None = None,
    workers: int | None = None,
    output: str | Path | None = None,
    progress: Progress | None = None,
) -> Ensemble:
    """Return the outcome of every pass of some days, flown with wind, noise and old elements.

    Parameters
    ----------
    station : its description's mean wind is that of the Rayleigh distribution which is drawn from.
    targets : satellites; passes longer than an hour are left out.
    start, start_t_s : begin, UTC text or s since 1970; by default the newest epoch of the elements.
    days : length, at most ten years.  The elements count as renewed every day.
    trials : how often each pass is flown, each time with other draws.
    seed : of all draws.
    sensor : of the passes; by default the station's.
    min_peak_deg : least peak of a pass.
    changes : parameters by node and dotted name, as of `Station.simulate`.
    workers : processes; by default one for each processor.  The results do not depend on it.
    output : file of the rows (JSON lines).  One that exists goes on: an ensemble that was
        interrupted flies only what is missing.
    progress : called with the passes done and all of them.

    Raises
    ------
    ValueError
        A sensor that the band does not have, targets without elements, no pass, and a file of
        another ensemble.

    Examples
    --------
    >>> print(rp.ensemble(rp.Station("leo_3m7"), [rp.elements("CBERS 2")], days=30.0, trials=5))
    """
    require_between("days", days, 0.01, MOST_DAYS)
    require_between("trials", float(trials), 1.0, float(MOST_TRIALS))
    require_between("workers", float(workers or 1), 1.0, 256.0)
    if not targets:
        raise ValueError("targets: give at least one satellite")
    if bodies := [each.name for each in targets if not isinstance(each.found, Elements)]:
        which = f"without any are {', '.join(bodies)}"
        raise ValueError(f"targets: an ensemble draws the errors of elements; {which}")
    chosen = station.description.chosen_sensor(sensor, station.band)
    begin_s = time_s("start", start, start_t_s)
    begin_s = max(each.first_t_s for each in targets) if begin_s is None else begin_s
    changes = changes or {}
    setup = StationSetup(station.description, station.band, changes=changes, model=station.model)
    wind, law = setup.sets("antenna_servo")["wind"], setup.sets("ephemeris_publisher")["uncertainty"]
    span, least_rad = (begin_s, span_s(None, days)), math.radians(min_peak_deg)
    passes = [
        _trial(target, window, k, seed, wind.mean_speed_m_s, law)
        for target in targets
        for window in _passes(station, target, *span, least_rad)
        for k in range(trials)
    ]
    if not passes:
        names = ", ".join(each.name for each in targets)
        raise ValueError(f"no pass of {names} within {days:g} days")
    what = {
        "station": station.name, "band": station.band, "sensor": chosen, "seed": seed,
        "trials": trials, "passes": len(passes), "of": _digest(station, passes, changes),
    }  # fmt: skip
    kept = _Rows(None if output is None else Path(output), what)
    # In the order of time: an ensemble that is interrupted covers its first days.
    passes.sort(key=lambda each: (each.window.aos_t_s, each.key))
    missing = [each for each in passes if each.key not in kept.rows]
    fly_one = partial(fly, station, chosen, changes, law)
    try:
        for row in _flown(fly_one, missing, workers or os.cpu_count() or 1):
            kept.add(row)
            if progress is not None:
                progress(len(kept.rows), len(passes))
    except KeyboardInterrupt:
        # What is done is kept, and is an ensemble of fewer passes.
        pass
    ordered = tuple(kept.rows[each.key] for each in passes if each.key in kept.rows)
    return Ensemble(station.name, chosen, ordered, len(passes))


class _Rows:
    """The rows of an ensemble by pass, and their file; the first line says what it is of."""

    def __init__(self, path: Path | None, what: Mapping[str, Any]) -> None:
        self.path, self.rows = path, dict[str, Mapping[str, Any]]()
        if path is None:
            return
        path.parent.mkdir(parents=True, exist_ok=True)
        text = path.read_text() if path.exists() else ""
        # A line without its end was cut off with the process that wrote it.
        lines = text[: text.rfind("\n") + 1].splitlines()
        try:
            read = [json.loads(line) for line in lines]
        except ValueError as error:
            raise ValueError(f"{path} is not the file of an ensemble: {error}") from error
        if read and read[0] != dict(what):
            raise ValueError(f"{path} is of another ensemble; give another file, or remove it")
        self.rows = {row["pass"]: row for row in read[1:]}
        whole = "".join(f"{line}\n" for line in lines) or f"{json.dumps(what)}\n"
        if whole != text:
            path.write_text(whole)

    def add(self, row: Mapping[str, Any]) -> None:
        """Keep a row."""
        self.rows[row["pass"]] = row
        if self.path is not None:
            with self.path.open("a") as file:
                file.write(f"{json.dumps(row)}\n")


def _begin_worker() -> None:
    # The terminal sends Ctrl-C to all processes: the first one says what is kept.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    # Killed, the first one would leave its workers computing.
    Thread(target=_end_with, args=(parent_process(),), daemon=True).start()


def _end_with(first: Any) -> None:
    first.join()
    os._exit(1)


def _flown(fly_one: Callable[[Trial], Row], trials: Sequence[Trial], workers: int) -> Iterator[Row]:
    """Yield the rows of passes as they are done; those of a process that dies are flown again."""
    waiting, deaths = list(range(len(trials))), 0
    while waiting:
        # Not forked: a thread of a library may hold a lock at that moment.
        with ProcessPoolExecutor(min(workers, len(waiting)), get_context("spawn"), _begin_worker) as pool:
            running: dict[Future[Row], int] = {pool.submit(fly_one, trials[k]): k for k in waiting}
            waiting = []
            try:
                while running:
                    for done in wait(running, return_when=FIRST_COMPLETED).done:
                        k = running.pop(done)
                        try:
                            row = done.result()
                        except BrokenProcessPool:
                            # One that dies ends its pool: a new one gets all that was not done.
                            waiting.append(k)
                            continue
                        deaths = 0
                        yield row
            finally:
                # Ctrl-C must not wait for passes that have not begun.
                pool.shutdown(wait=False, cancel_futures=True)
        deaths += bool(waiting)
        if deaths >= ATTEMPTS:
            raise ChildProcessError(f"processes died {deaths} times in a row without flying a pass")


def fly(
    station: Station, sensor: str, changes: Mapping[str, Mapping[str, object]],
    law: ElementUncertainty, one: Trial,
) -> Row:  # fmt: skip
    """Return the row of a pass; runs in a process of its own."""
    window = one.window
    row = {
        "pass": one.key, "satellite": one.target.name, "aos_utc": utc_text(window.aos_t_s),
        "trial": one.trial, "peak_elevation_deg": math.degrees(window.peak_elevation_rad),
        "duration_s": window.duration_s,
        **asdict(one.draw), "refused": "",
    }  # fmt: skip
    # Years from their epoch elements do not say where a satellite is, but still how it passes.
    sizes = zip(("along_m", "cross_m", "radial_m"), law.sigmas_m(one.age_s), strict=True)
    known = {f"uncertainty.{name}": 0.0 for name in GROWTHS}
    known |= {f"uncertainty.{name}": size_m for name, size_m in sizes}
    old = {"source.max_age_days": MOST_DAYS}
    over = merged({"ephemeris_publisher": {**known, **old}, "rf_receiver": old}, one.draw.changes, changes)
    starts = [0]

    def take(topic: str, signal: Any) -> None:
        if topic == "antenna_status":
            starts[0] = int(np.sum(signal.starts))

    own = StationPass.of_window(window, one.target, station, window.aos_t_s)
    setup, start_s = station.setup(own, one.draw.seed, over), math.floor(window.aos_t_s) - BEFORE_S
    try:
        log = simulate_pass(setup, window, start_s, sensor, on_signal=take)
    except ValueError as error:
        # No branch works: the certificate says why.
        return row | {"refused": str(error)}
    inside = np.array(log.t_s) >= window.aos_t_s
    errors = log.errors_rad()[inside]
    distance, width = np.hypot(*errors.T), math.radians(station.beamwidth_deg)
    outcome = PassOutcome.of(distance, width, CLUSTER_S) if len(errors) else PassOutcome()
    # A fault ends the log: what it lacks is lost.
    outcome += PassOutcome.unseen(max(window.duration_s - outcome.duration_s, 0.0))
    held = distance[distance <= 0.5 * width]
    branch = log.certificate.chosen if log.certificate else None
    return row | {
        # Samples of a tenth of a second may add up to more than the pass.
        "held_s": min(outcome.tracked_s, window.duration_s), "loss_db": outcome.mean_loss_db,
        "rms_mdeg": float(np.sqrt(np.mean(held**2))) / MDEG if len(held) else 0.0,
        "keyhole_s": branch.keyhole_s if branch else 0.0,
        "late_s": branch.late_s if branch else 0.0, "starts": starts[0], "fault": log.fault,
    }  # fmt: skip


def _trial(
    target: Target, window: Pass, trial: int, seed: int, wind_m_s: float, law: ElementUncertainty
) -> Trial:  # fmt: skip
    age_s = (window.aos_t_s - target.first_t_s) % RENEWED_S
    return Trial(target, window, trial, Draw.of(window, trial, seed, wind_m_s, law, age_s), age_s)


def _passes(
    station: Station, target: Target, begin_s: float, duration_s: float, least_rad: float
) -> list[Pass]:  # fmt: skip
    track = TopocentricTrack(target.found, station.site, max_age_s=MOST_DAYS * DAY_S)
    above = station.rules.mask.above(station.lowest_rad)
    return [
        window
        for window in find_passes(track, begin_s, duration_s, above)
        # One that goes on at either end of the search is cut off there.
        if window.peak_elevation_rad >= least_rad and window.duration_s <= LONGEST_PASS_S
        and window.aos_t_s > begin_s and window.los_t_s < begin_s + duration_s
    ]  # fmt: skip


def _digest(station: Station, passes: Sequence[Trial], changes: Mapping[str, Any]) -> str:
    """Return what identifies the station and its passes, for a file that goes on."""
    # With the values and not the file: a comment in a description changes no result.
    own = station.description.content, dict(station.model.coefficients), changes
    return hashlib.sha256(repr((own, [each.key for each in passes])).encode()).hexdigest()[:16]
