"""A preliminary orbit from the first pass: its noise, its model, and no error without either."""

from types import SimpleNamespace

import numpy as np
import pytest

from rf_pointing.core import random_stream
from rf_pointing.papers.satcal_campaign import model_of
from rf_pointing.papers.satcal_orbit import preliminary_check


def test_every_preliminary_run_draws_its_own_noise_and_is_corrected_with_its_own_model() -> None:
    planted = model_of({"azimuth_offset": 0.3, "elevation_offset": -0.1})
    models = [planted, model_of({"azimuth_offset": 0.25})]
    random = random_stream(3, "runs")
    once = preliminary_check(planted, models, random_stream(3, "runs"))
    first, second = (preliminary_check(planted, [model], random) for model in models)
    assert once.uncorrected == pytest.approx(np.concatenate([first.uncorrected, second.uncorrected]))
    assert once.corrected == pytest.approx(np.concatenate([first.corrected, second.corrected]))


def test_a_preliminary_orbit_without_noise_is_exact_where_the_model_is() -> None:
    planted = model_of({"azimuth_offset": 0.3, "elevation_offset": -0.1})
    check = preliminary_check(planted, [planted], SimpleNamespace(standard_normal=np.zeros))  # type: ignore[arg-type]
    assert np.abs(check.corrected).max() < 1e-3
    assert np.abs(check.uncorrected).min() > 1e-2
