"""The experiment on the antenna: bounded before it starts, watched while it runs, abortable."""

import math

import numpy as np
import pytest

from rf_pointing.core import random_stream
from rf_pointing.identification import ExcitationParams, IdentificationExperiment

PARAMS = ExcitationParams(samples=256)


def experiment(**changes: object) -> IdentificationExperiment:
    options = {
        "params": PARAMS,
        "axis": "elevation",
        "sequences": 4,
        "start_rad": 0.8,
        "travel_rad": (0.1, 1.5),
        "random": random_stream(1, "excitation"),
    }
    return IdentificationExperiment(**(options | changes))


def follow(run: IdentificationExperiment, samples: int) -> np.ndarray:
    position, rates = np.array([0.3, 0.8]), []
    for _ in range(samples):
        rates.append(run.command(position))
        position = position + rates[-1] * PARAMS.sample_s
    return np.array(rates)


def test_records_what_it_commanded_and_measured() -> None:
    run = experiment()
    rates = follow(run, 4 * 256)
    assert run.finished
    recording = run.recording()
    np.testing.assert_array_equal(recording.input_rad_s.ravel(), rates[:, 1])
    np.testing.assert_array_equal(rates[:, 0], np.zeros(1024))
    assert recording.output_rad("azimuth").shape == (4, 256)
    travelled = recording.output_rad("elevation").ravel()
    np.testing.assert_allclose(np.diff(travelled), rates[:-1, 1] * PARAMS.sample_s, atol=1e-12)


def test_sequences_alternate_sides_so_the_axis_comes_back() -> None:
    run = experiment()
    rates = follow(run, 4 * 256)[:, 1].reshape(4, 256)
    assert np.all(np.sign(np.mean(rates, axis=1)) == (1.0, -1.0, 1.0, -1.0))
    assert abs(np.sum(rates)) * PARAMS.sample_s < 1e-9


def test_an_experiment_that_would_leave_the_travel_is_refused_with_the_numbers() -> None:
    with pytest.raises(ValueError, match=r"elevation would run from 1\.4870 to 1\.49\d\d rad, must stay within 0\.11"):
        experiment(start_rad=1.487)


def test_an_axis_that_leaves_the_travel_ends_it() -> None:
    run = experiment()
    follow(run, 300)
    np.testing.assert_array_equal(run.command((0.3, 1.6)), np.zeros(2))
    assert run.finished
    assert run.abort_reason.startswith("elevation 1.600000 rad left")
    assert run.recording().input_rad_s.shape == (1, 256)


def test_abort_gives_zero_rate_from_then_on() -> None:
    run = experiment()
    follow(run, 10)
    run.abort("operator")
    np.testing.assert_array_equal(run.command((0.3, 0.8)), np.zeros(2))
    assert run.progress == pytest.approx(10 / 1024)
    with pytest.raises(ValueError, match="no sequence is complete: 10 of 256"):
        run.recording()


def test_a_non_finite_encoder_is_refused() -> None:
    with pytest.raises(ValueError, match="encoder_rad"):
        experiment().command((math.nan, 0.8))


def test_an_unknown_axis_is_refused() -> None:
    with pytest.raises(ValueError, match="axis='focus' must be one of azimuth, elevation"):
        experiment(axis="focus")


def test_the_other_axis_runs_at_the_idle_rate_while_the_experiment_lasts() -> None:
    run = experiment(params=PARAMS.replace(idle_rate_rad_s=3e-6), sequences=1)
    np.testing.assert_array_equal(follow(run, 256)[:, 0], 3e-6)
    np.testing.assert_array_equal(run.command((0.3, 0.8)), 0.0)
