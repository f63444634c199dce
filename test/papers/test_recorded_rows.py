"""Tables that cost little, row by row as recorded: the published number, its tolerance, ours, and whether it holds.

After an intended change run this file itself; the difference of `test/data/papers/rows.csv` then shows what it moved:

    scripts/run-python test/papers/test_recorded_rows.py
"""

import csv
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from rf_pointing.core import MDEG
from rf_pointing.papers import (
    conscan,
    interferometer,
    interferometer_claims,
    interferometer_simulation,
    monopulse,
    servo_feedforward,
    servo_wind,
    tripulse,
    tripulse_attitude,
    tripulse_noise,
)
from rf_pointing.papers.doa import table_cases
from rf_pointing.papers.doa_study import direction_rows, filter_rows
from rf_pointing.papers.doa_study.attitude_runs import CaseResult
from rf_pointing.papers.doa_study.directions import DirectionCase
from rf_pointing.papers.row import Row

FILE = Path(__file__).parents[1] / "data" / "papers" / "rows.csv"
NUMBERS = ("paper", "ours", "tolerance", "factor")
WORDS = ("quantity", "source", "unit", "bound", "holds", "explained")
OURS_REL, OF_TOLERANCE = 1e-5, 0.01
"""How far ours may move: relative, and as a share of the row's own tolerance (rows of rounding errors)."""
# Of no pass: the rows are to name and scale the right axis.
ERROR_RAD = MDEG * np.array([[0.1, -0.7], [-0.15, 0.6]])


def planted(case: DirectionCase, scale: float, outliers: float = 0.0) -> CaseResult:
    """Return a result whose errors all differ; a tenth of the trials turns within the first 200 s."""
    history = np.full((400, 10), 0.3, dtype=np.float32)
    history[:200, :1], history[:50] = 1.7, 5.0
    return CaseResult(
        case=case, theta_deg=0.6 * scale, phi_deg=0.7 * scale, roll_deg=0.11 * scale, pitch_deg=0.13 * scale,
        yaw_deg=0.17 * scale, sigma_deg=0.12, outliers=outliers, history_deg=history,
        rate_history_deg_s=0.1 * history,
    )  # fmt: skip


def planted_tables() -> dict[DirectionCase, CaseResult]:
    scales = {case: 1.0 + 0.1 * place + (0.0 if case.refined else 0.5) for place, case in enumerate(table_cases())}
    return {case: planted(case, scale, 0.002 * scale) for case, scale in scales.items()}


def planted_filters() -> list[Row]:
    case = DirectionCase(snapshots=100, snr_db=0.0)
    inside, drawn, ours, printed = (planted(case, scale) for scale in (1.0, 1.1, 1.2, 1.3))
    return filter_rows.filter_rows(inside, drawn, [ours, printed])


TABLES: dict[str, Callable[[], list[Row]]] = {
    "PI83 Table 7-1": interferometer._table_7_1,
    "PI83 Table 8-1": interferometer._table_8_1,
    "PI83 Tables 8-2 and 8-3": interferometer._tables_8_2_and_8_3,
    "PI83 design chain": interferometer_claims.chain_rows,
    "PI83 estimators": interferometer_claims.estimator_rows,
    "PI83 links": interferometer_claims.link_rows,
    "PI83 short range": lambda: interferometer_simulation._short_range_rows(1),
    "PI83 powers": lambda: interferometer_simulation._power_rows(1),
    "TRIPULSE times": tripulse._time_rows,
    "TRIPULSE phases": lambda: tripulse._phase_rows(1),
    "TRIPULSE noise": lambda: tripulse_noise.noise_rows(1),
    "TRIPULSE beyond": lambda: tripulse_noise.beyond_rows(1),
    "TRIPULSE attitude": lambda: tripulse_attitude.attitude_rows(1),
    "CONSCAN slope and loss": conscan._slope_and_loss,
    "CONSCAN errors": lambda: conscan._error_rows(1),
    "CONSCAN periods": lambda: conscan._period_rows(1),
    "BWG averaging": lambda: monopulse._averaging_rows(1),
    "BWG feedforward, settled": lambda: servo_feedforward._settled(ERROR_RAD),
    "BWG feedforward, from rest": servo_feedforward._start,
    "BWG feedforward, without": lambda: servo_feedforward._without(9.0 * ERROR_RAD, ERROR_RAD),
    "BWG feedforward, gain": servo_feedforward._gain,
    "BWG wind rejection": servo_wind._rejection,
    "DOA scene": direction_rows.scene_rows,
    "DOA directions, planted": lambda: direction_rows.direction_rows(planted_tables()),
    "DOA attitudes, planted": lambda: filter_rows.attitude_rows(planted_tables()),
    "DOA convergence, planted": lambda: filter_rows.convergence_rows(planted_tables()),
    "DOA filters, planted": planted_filters,
}


def recorded(name: str) -> list[dict[str, str]]:
    with FILE.open(encoding="utf-8", newline="") as file:
        return [line for line in csv.DictReader(file) if line["table"] == name]


@pytest.mark.parametrize("name", TABLES)
def test_every_row_is_the_recorded_one(name: str) -> None:
    rows, lines = TABLES[name](), recorded(name)
    assert [row.quantity for row in rows] == [line["quantity"] for line in lines]
    for row, line in zip(rows, lines, strict=True):
        assert {word: str(getattr(row, word)) for word in WORDS} == {word: line[word] for word in WORDS}
        expected = {number: float(line[number]) for number in NUMBERS}
        assert row.ours == pytest.approx(expected.pop("ours"), rel=OURS_REL, abs=OF_TOLERANCE * row.tolerance), row
        # A published number may be a theory of ours, computed like the rest.
        assert {number: getattr(row, number) for number in expected} == pytest.approx(expected, rel=1e-9), row


def main() -> None:
    with FILE.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["table", *WORDS, *NUMBERS])
        for name, table in TABLES.items():
            for row in table():
                numbers = [f"{getattr(row, number):.12g}" for number in NUMBERS]
                writer.writerow([name, *(str(getattr(row, word)) for word in WORDS), *numbers])


if __name__ == "__main__":
    main()
