"""Rows as recorded: published number, tolerance, ours, whether it holds, the remark.

Papers that take seconds are run whole.  Passes of the whole station, and the hours of the DOA study, are planted: a log
or a result that shows every number of the case that it was asked for.
"""

import math
from collections.abc import Callable
from types import SimpleNamespace

import numpy as np
import pytest

from rf_pointing.core import MDEG, MonopulseCluster, random_stream
from rf_pointing.ephemeris import Pass
from rf_pointing.papers import (
    autotrack,
    conscan,
    doa,
    interferometer,
    monopulse,
    nco,
    network,
    orbit,
    receive,
    satcal,
    sensors,
    servo_feedforward,
    servo_identification,
    servo_monopulse,
    servo_noise,
    servo_wind,
    tripulse,
    tripulse_attitude,
)
from rf_pointing.papers.autotrack_cases import Case
from rf_pointing.papers.doa_study.attitude_runs import CaseResult, RunTask
from rf_pointing.papers.row import Row
from rf_pointing.simulation import PassLog
from test.papers.doa_study.test_recorded_study import planted
from test.papers.recorded import DATA, OURS_REL, changed, check_reasons, check_rows, mark

FLOWN_REL = 2e-3
"""Of flights: friction and encoder steps make the last bits of a loop larger."""


def planted_pass(case: Case, window: Pass, heard: Callable[[SimpleNamespace], object] | None = None) -> PassLog:
    """Return a log of search, tracking, ten dropouts and a hold-off, whose sizes show seed, time and changes of the case."""
    numbers = [value for node in sorted(case.changes) for _, value in sorted(case.changes[node].items())]
    asked = [float(value) for value in numbers if isinstance(value, int | float)]
    size = mark(case.seed, case.seconds, len(case.band), len(case.sensor), *asked)
    t_s = math.floor(window.aos_t_s) - 5.0 + 0.1 * np.arange(round(10.0 * min(case.seconds, 120.0)) + 60)
    since = t_s - t_s[0]
    receiver = case.changes.get("rf_receiver", {})
    silent = (since > 40.0) & (since % 6.0 < 2.0) & ("signal.dropouts.count" in receiver)
    tracking = {"auto": "monopulse"}.get(case.sensor, case.sensor)
    mode = np.where(
        since < 9.0 * size, "search", np.where((since % 6.0 < 1.5 + size) & np.roll(silent, 15), "coast", tracking)
    )
    held_off = (
        39.9 + size
        if "signal.sign_flip_after_s" in receiver
        else 60.0
        if case.seed % 2 and case.seconds == 600.0
        else 1e9
    )
    mode = np.where(since >= held_off, "hand_back", mode)
    error = (
        MDEG
        * size
        * (1.0 + 40.0 * np.exp(-since / 4.0))[:, None]
        * np.stack([np.cos(since), 0.7 * np.sin(since)], axis=1)
    )
    log = PassLog(
        t_s=t_s.tolist(), cross_elevation_rad=error[:, 0].tolist(), elevation_rad=error[:, 1].tolist(), mode=mode.tolist(),
        carrier_to_noise_db_hz=np.where(silent, 0.0, 30.0 + size).tolist(), command_t_s=t_s.tolist(),
        command_rad=list(zip(1e-4 * size * since**3, 1e-5 * np.cos(since * size), strict=True)),
    )  # fmt: skip
    if heard is not None:
        random = random_stream(case.seed, f"samples {case.band}")
        for begin in t_s:
            noise = 0.01 * size * random.standard_normal((2, 5)) + 0j
            heard(SimpleNamespace(cluster=MonopulseCluster(
                t_s=begin + 0.02 * np.arange(5), sum=np.ones(5, dtype=complex), difference_cross_elevation=noise[0],
                difference_elevation=noise[1], carrier_to_noise_db_hz=60.0,
            )))  # fmt: skip
    return log


def flown_by_the_station() -> list[Row]:
    with changed(autotrack, fly=planted_pass), changed(sensors, fly=planted_pass):
        return [*autotrack.rows(2), *sensors.rows(3)]


def tripulse_rows() -> list[Row]:
    """A quarter of the frames: what is scored over them follows their number."""
    with changed(tripulse_attitude, FRAMES=100):
        return tripulse.rows()


def doa_tables() -> list[Row]:
    """Return the rows of the command from results of no run: which result each row is made of."""

    def run(task: RunTask) -> list[CaseResult]:
        size = mark(task.trials, task.seed, task.published, task.music_inside, task.duration_s / 1e3, len(task.cases))
        return [planted(case, size * (1.0 + 0.1 * case.refined), 0.01) for case in task.cases]

    with changed(
        doa,
        run=run,
        accuracy_rows=lambda *_: [],
        direction_rows=lambda _: [],
        scene_rows=list,
        future_rows=lambda _: [],
    ):
        return [*doa.rows(1, trials=3), *doa.rows(1, trials=60, music_inside=True)]


TABLES: dict[str, tuple[Callable[[], list[Row]], float, str]] = {
    "PI83": (interferometer.rows, OURS_REL, "interferometer"),
    "TRIPULSE": (tripulse_rows, OURS_REL, "tripulse"), "CONSCAN": (conscan.rows, OURS_REL, "conscan"),
    "SATCAL": (lambda: satcal.rows(1, satcal.Effort(campaigns=60, white=20, radars=80)), FLOWN_REL, "satcal"),
    "BWG monopulse in the station's code": (monopulse.rows, FLOWN_REL, "monopulse"),
    "BWG feedforward": (servo_feedforward.feedforward_rows, FLOWN_REL, "servo"),
    "BWG monopulse": (servo_monopulse.monopulse_rows, FLOWN_REL, "servo"),
    "BWG noise": (servo_noise.noise_rows, FLOWN_REL, "servo"),
    "BWG wind": (servo_wind.wind_rows, FLOWN_REL, "servo"),
    "DSS13-ID": (servo_identification.identification_rows, FLOWN_REL, "servo"),
    "autotrack and sensors, planted": (flown_by_the_station, OURS_REL, "autotrack sensors"),
    "DOA command, planted": (doa_tables, OURS_REL, "doa"), "orbit": (orbit.rows, 1e-4, "orbit"),
}  # fmt: skip
"""How the rows of each table are made, how far they may move, and the papers that they are of."""
CLOSED_FORMS = {"nco": nco.rows, "network": network.rows, "receive": receive.rows}
"""Papers whose own tests compare their numbers."""


@pytest.mark.parametrize("name", TABLES)
def test_every_row_is_the_recorded_one(name: str) -> None:
    rows, within, _ = TABLES[name]
    check_rows(DATA / "rows.csv", name, rows(), within)


@pytest.mark.parametrize("paper", CLOSED_FORMS)
def test_a_wrong_value_in_an_explained_row_is_not_explained(paper: str) -> None:
    rows = CLOSED_FORMS[paper](1)
    assert any(row.due for row in rows)
    check_reasons(rows)
