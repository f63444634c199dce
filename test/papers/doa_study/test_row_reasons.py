"""Where the explanations of the DOA rows begin and end: outliers, lost trials, the grid, the bound, the passes."""

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from rf_pointing.papers.doa_study import filter_rows
from rf_pointing.papers.doa_study.attitude_runs import CaseResult
from rf_pointing.papers.doa_study.directions import DirectionCase

CLEAR = DirectionCase(snapshots=100, snr_db=0.0)


def result(
    case: DirectionCase = CLEAR,
    *,
    worst_deg: float = 1.0,
    sigma_deg: float = 1.0,
    outliers: float = 0.0,
    history: NDArray[np.float32] | None = None,
) -> CaseResult:
    quiet = np.full((60, 10), 0.1, dtype=np.float32)
    return CaseResult(
        case=case, theta_deg=1.0, phi_deg=1.0, roll_deg=0.5 * worst_deg, pitch_deg=0.7 * worst_deg, yaw_deg=worst_deg,
        sigma_deg=sigma_deg, outliers=outliers, history_deg=quiet if history is None else history,
        rate_history_deg_s=quiet,
    )  # fmt: skip


def lost(count: int, trials: int = 200, left_deg: float = 113.0) -> NDArray[np.float32]:
    """Return trials of which the first `count` end on a wrong turn, the others 1 deg off in each axis."""
    history = np.full((60, trials), math.sqrt(3.0), dtype=np.float32)
    history[:, :count] = left_deg
    return history


def test_a_trial_is_lost_that_ends_more_than_ten_degrees_off() -> None:
    history = np.full((60, 4), 50.0, dtype=np.float32)
    history[-1] = [9.9, 10.1, 0.3, 12.0]
    assert filter_rows.locked_wrongly(result(history=history)).tolist() == [False, True, False, True]


def test_the_share_of_the_claim_is_that_of_the_trials_that_were_not_lost() -> None:
    assert filter_rows.share_of_claim(result(sigma_deg=0.5)) == pytest.approx(2.0)
    assert filter_rows.share_of_claim(result(sigma_deg=0.0)) == pytest.approx(1e12)
    assert filter_rows.share_of_claim(result(history=lost(3), sigma_deg=0.4)) == pytest.approx(2.5)
    assert filter_rows.share_of_claim(result(history=lost(200))) == math.inf
    history = lost(3)
    history[:30] *= 2.0
    assert filter_rows.share_of_claim(result(history=history)) == pytest.approx(math.sqrt(2.5))


def test_the_convergence_is_to_2_and_half_a_degree_and_a_tenth_of_a_degree_a_second() -> None:
    history = np.full((400, 3), 0.1, dtype=np.float32)
    history[:90, 1], history[:40, 2] = 2.1, 2.5
    rates = np.full((400, 3), 0.05, dtype=np.float32)
    rates[:70, 0] = 0.11
    made = replace(result(history=history), rate_history_deg_s=rates)
    found = filter_rows.convergence_rows({CLEAR: made})
    # The mean over 100 s falls to half a degree where a fifth of it is still 2.1.
    assert [row.ours for row in found] == [90.0, pytest.approx(170.0, abs=1.0), 70.0]
    assert [row.paper for row in found] == [1350.0, 1500.0, 1000.0]


@pytest.mark.parametrize(
    ("ratio", "explained"), [(5.5, False), (5.7, True), (35.0, True), (39.4, True), (39.7, False), (45.0, False)]
)
def test_a_thousand_times_the_process_noise_grows_sigma_by_its_fourth_to_its_square_root(
    ratio: float, explained: bool
) -> None:
    ours, printed = result(sigma_deg=0.2), result(sigma_deg=0.2 * ratio)
    rows = filter_rows.filter_rows(result(), result(), [ours, printed])
    (row,) = (row for row in rows if "predicts for itself" in row.quantity)
    assert row.explained is explained
    assert row.paper == 0.094
    assert row.ours == pytest.approx(0.2 * ratio)


def test_an_error_that_is_never_above_the_limit_settles_at_once() -> None:
    assert filter_rows.settling_time_s(np.zeros((50, 2), dtype=np.float32), 0.5, 1) == 0.0
    assert filter_rows.settling_time_s(np.zeros((50, 2), dtype=np.float32), 0.5, 20) == 0.0
