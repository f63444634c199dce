"""DOA recomputed: Tables 1 and 2 row by row, the scene, the accuracy of MUSIC, the filters, and what lies beyond.

The paper's stations, process noise and grid of truths are not published.  Ours, beside every result: eight stations
along the track (`nadir_scene`), Q = 1e-12 E_6, RMSE (34) from 2000 s on, because with the transient it would only measure
the start.  `rows(seed, trials=200, executor=...)` is the full table; the default of 2 trials takes a minute and a half.
"""

from concurrent.futures import Executor

import numpy as np

from rf_pointing.arrays.tripulse_montecarlo import sweep
from rf_pointing.attitude.process_noise import PRINTED_Q, TABLE_Q
from rf_pointing.reproduce.doa_study.attitude_runs import CaseResult, RunTask, run
from rf_pointing.reproduce.doa_study.beyond_rows import beyond_rows
from rf_pointing.reproduce.doa_study.direction_errors import DirectionCase
from rf_pointing.reproduce.doa_study.direction_rows import accuracy_rows, direction_rows, scene_rows
from rf_pointing.reproduce.doa_study.filter_rows import attitude_rows, convergence_rows, filter_rows
from rf_pointing.reproduce.row import Row

__all__ = ["full_tables", "rows", "table_cases"]

TABLE_1_DB = (-14.0, -12.0, -10.0, -8.0, -6.0, -2.0, 0.0, 14.0)
TABLE_2_SNAPSHOTS = (1, 10, 20, 50, 1000)
CASES_PER_TASK = 7


def rows(seed: int = 1, *, trials: int = 2, executor: Executor | None = None) -> list[Row]:
    """Return the published numbers of DOA beside ours, contradicted entries included."""
    tables = full_tables(seed, trials, executor)
    inside = DirectionCase(snapshots=100, snr_db=0.0, music_inside=True)
    checked = run(RunTask(cases=(inside,), trials=trials, seed=seed + 1))[0] if trials > 2 else tables[inside]
    return [
        *scene_rows(),
        *accuracy_rows(seed, executor),
        *direction_rows(tables),
        *attitude_rows(tables),
        *convergence_rows(tables),
        *filter_rows(tables, checked, _published(seed, trials), trials),
        *beyond_rows(seed),
    ]


def table_cases(refined: bool) -> tuple[DirectionCase, ...]:
    """Return the 13 different rows of Tables 1 and 2 (the row at 0 dB and 100 snapshots stands in both)."""
    first = [DirectionCase(snapshots=100, snr_db=snr_db, refined=refined) for snr_db in TABLE_1_DB]
    second = [DirectionCase(snapshots=count, snr_db=0.0, refined=refined) for count in TABLE_2_SNAPSHOTS]
    return (*first, *second)


def full_tables(
    seed: int, trials: int, executor: Executor | None = None, *, music_inside: bool = False
) -> dict[DirectionCase, CaseResult]:
    """Return the result of every row, refined and on the 1-deg grid, in batches that any executor can share out.

    `music_inside` runs MUSIC at every step of every trial instead of drawing from pools of 20 000 estimates.
    """
    refined = {False: table_cases(False), True: table_cases(True)}
    inside = DirectionCase(snapshots=100, snr_db=0.0, music_inside=True)
    cases = [*refined[True], *refined[False]]
    if music_inside:
        cases = [_inside(case) for case in cases]
    elif trials <= 2:
        cases.append(inside)
    size = len(cases) if trials <= 2 else CASES_PER_TASK
    tasks = [
        RunTask(cases=tuple(cases[start : start + size]), trials=trials, seed=seed)
        for start in range(0, len(cases), size)
    ]
    return {result.case: result for group in sweep(run, tasks, executor) for result in group}


def _inside(case: DirectionCase) -> DirectionCase:
    return DirectionCase(snapshots=case.snapshots, snr_db=case.snr_db, refined=case.refined, music_inside=True)


def _published(seed: int, trials: int) -> list[CaseResult]:
    """Return the printed filter at 0 dB and 100 snapshots with our Q and with the printed one."""
    cases = tuple(DirectionCase(snapshots=100, snr_db=0.0, refined=False, q=q) for q in (TABLE_Q, PRINTED_Q))
    task = RunTask(cases=cases, trials=int(np.clip(trials, 2, 20)), seed=seed, published=True, duration_s=3000.0)
    return run(task)
