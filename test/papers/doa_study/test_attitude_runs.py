"""The batch of filters: converges as promised, says what it ran, and refuses a mixture it cannot run."""

from dataclasses import replace

import numpy as np
import pytest

from rf_pointing.array_sensors.attitude.process_noise import PRINTED_Q
from rf_pointing.papers.doa_study.attitude_runs import RunTask, run
from rf_pointing.papers.doa_study.direction_errors import DirectionCase

CLEAR = DirectionCase(snapshots=100, snr_db=0.0)
GRID = DirectionCase(snapshots=100, snr_db=0.0, refined=False)


def test_filters_converge_from_50_degrees_at_the_first_hand_off() -> None:
    task = RunTask(cases=(CLEAR, GRID), trials=2, seed=3, duration_s=680.0, settled_s=660.0, pool=2000)
    inside = replace(task, cases=(CLEAR,), music_inside=True)
    results = [*run(task), *run(inside)]
    assert [result.case for result in results] == [CLEAR, GRID, CLEAR]
    for result in results:
        assert result.history_deg.shape == (680, 2)
        assert result.history_deg[1].min() > 30.0
        assert result.history_deg[660:].max() < 1.0
        assert result.rate_history_deg_s[660:].max() < 0.05
        assert result.sigma_deg < 1.0
    assert results[0].theta_deg == pytest.approx(results[2].theta_deg, rel=0.15)


def test_printed_filter_with_the_printed_noise_predicts_degrees() -> None:
    case = DirectionCase(snapshots=100, snr_db=0.0, q=PRINTED_Q)
    (result,) = run(
        RunTask(cases=(case,), trials=1, seed=1, published=True, duration_s=400.0, settled_s=300.0, pool=1000)
    )
    assert result.sigma_deg > 1.0
    assert np.all(np.isfinite(result.history_deg))


def test_two_process_noises_in_one_task_are_refused() -> None:
    other = DirectionCase(snapshots=100, snr_db=0.0, q=PRINTED_Q)
    with pytest.raises(ValueError, match="cases differ in q"):
        run(RunTask(cases=(CLEAR, other), trials=1, seed=1, duration_s=10.0, settled_s=1.0, pool=1000))


def test_average_that_would_begin_after_the_end_is_refused() -> None:
    with pytest.raises(ValueError, match="settled_s="):
        run(RunTask(cases=(CLEAR,), trials=1, seed=1, duration_s=10.0, settled_s=10.0, pool=1000))
