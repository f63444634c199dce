"""DOA recomputed: Tables 1 and 2, the scene, the accuracy of MUSIC, the filters, open questions.

The paper's stations, process noise and grid of truths are not published.  Ours: eight stations
along the track (`nadir_scene`), Q = 1e-12 E_6, RMSE (34) from 2000 s on, because with the transient
it would only measure the start.  By default every row rests on two trials of 20 000 steps and on
20 000 real MUSIC estimates, which takes a minute.  `reproduce doa --trials 200 --workers 2` runs
the paper's 200 trials; `--music-inside` replaces the pools of estimates by MUSIC at every step of
every trial.
"""

from concurrent.futures import Executor
from dataclasses import dataclass

from rf_pointing.array_sensors.attitude.multiplicative_filter import PRINTED_Q, TABLE_Q
from rf_pointing.papers.doa_study.attitude_runs import CaseResult, RunTask, run
from rf_pointing.papers.doa_study.direction_rows import accuracy_rows, direction_rows, scene_rows
from rf_pointing.papers.doa_study.directions import DirectionCase
from rf_pointing.papers.doa_study.filter_rows import attitude_rows, convergence_rows, filter_rows
from rf_pointing.papers.doa_study.future_work import future_rows
from rf_pointing.papers.row import Row
from rf_pointing.papers.sweeps import sweep

TABLE_1_DB = (-14.0, -12.0, -10.0, -8.0, -6.0, -2.0, 0.0, 14.0)
TABLE_2_SNAPSHOTS = (1, 10, 20, 50, 1000)
CASES_PER_TASK = 6
"""Refined and grid of three rows: 1200 filters of 200 trials still fit into the processor's
cache."""
FEW_TRIALS = 10
CHECKED_TRIALS = 40
CHECKED = DirectionCase(snapshots=100, snr_db=0.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class DoaTables:
    """Every row of Tables 1 and 2 by its case, the row at 0 dB the other way round, the printed
    filter with two Q.

    `other_way` is the row with MUSIC inside the loop where the tables draw from pools, and drawn
    where they do not.
    """

    rows: dict[DirectionCase, CaseResult]
    other_way: CaseResult
    published: list[CaseResult]


def rows(
    seed: int = 1, *, trials: int = 2, executor: Executor | None = None, music_inside: bool = False
) -> list[Row]:
    """Return the published numbers of DOA and ours, contradicted entries included."""
    tables = run_tables(seed, trials, executor, music_inside=music_inside)
    here = tables.rows[CHECKED]
    inside, drawn = (here, tables.other_way) if music_inside else (tables.other_way, here)
    return [
        *scene_rows(),
        *accuracy_rows(seed, executor),
        *direction_rows(tables.rows),
        *attitude_rows(tables.rows),
        *convergence_rows(tables.rows),
        *filter_rows(inside, drawn, tables.published),
        *future_rows(seed),
    ]


def table_cases() -> tuple[DirectionCase, ...]:
    """Return the 13 different rows of Tables 1 and 2, each refined and on the grid (0 dB, L = 100
    stands in both).
    """
    levels = [
        *((100, snr_db) for snr_db in TABLE_1_DB),
        *((count, 0.0) for count in TABLE_2_SNAPSHOTS),
    ]
    return tuple(
        DirectionCase(snapshots=snapshots, snr_db=snr_db, refined=refined)
        for snapshots, snr_db in levels
        for refined in (True, False)
    )


def run_tables(
    seed: int, trials: int, executor: Executor | None = None, *, music_inside: bool = False
) -> DoaTables:
    """Return every row, in tasks that any executor can share out.

    `music_inside` runs MUSIC at every step of every trial instead of drawing from pools of 20 000
    estimates.
    """
    cases = table_cases()
    # Few trials: two large tasks; many: small ones, so that every process has work to the end.
    size = len(cases) // 2 if trials <= FEW_TRIALS else CASES_PER_TASK
    tasks = [
        RunTask(
            cases=cases[start : start + size], trials=trials, seed=seed, music_inside=music_inside
        )
        for start in range(0, len(cases), size)
    ]
    few = min(trials, CHECKED_TRIALS)
    # The seed differs: pool and loop must not share their noise, or their ratio would prove
    # nothing.
    other = RunTask(cases=(CHECKED,), trials=few, seed=seed + 1, music_inside=not music_inside)
    printed = tuple(
        DirectionCase(snapshots=100, snr_db=0.0, refined=False, q=q) for q in (TABLE_Q, PRINTED_Q)
    )
    # The filter as printed settles within 2000 s; the last 1000 s are averaged.
    published = RunTask(cases=printed, trials=few, seed=seed, published=True, duration_s=3000.0)
    other_way, printed_filter, *groups = sweep(run, [other, published, *tasks], executor)
    return DoaTables(
        rows={result.case: result for group in groups for result in group},
        other_way=other_way[0],
        published=printed_filter,
    )
