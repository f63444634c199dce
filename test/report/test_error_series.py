"""The statistics of single sets of errors."""

import math

import numpy as np
import pytest

from rf_pointing.core import MDEG
from rf_pointing.report.error_series import statistics_of


def test_statistics_of_a_known_set() -> None:
    error = np.array([[3.0, 4.0], [-3.0, 4.0], [0.0, 0.0], [6.0, -8.0]]) * MDEG
    found = statistics_of(error, np.full(4, 10.0) * MDEG)
    assert found.cross_elevation.rms_mdeg == pytest.approx(math.sqrt(54.0 / 4.0))
    assert found.elevation.max_mdeg == pytest.approx(8.0)
    assert found.radial.p95_mdeg == pytest.approx(np.percentile([5.0, 5.0, 0.0, 10.0], 95.0))
    assert found.mean_loss_db == pytest.approx(40.0 * math.log10(2.0) * (0.25 + 0.25 + 0.0 + 1.0) / 4.0)
    assert found.inside_half_power_percent == pytest.approx(75.0)


def test_no_samples_give_nulls() -> None:
    found = statistics_of(np.zeros((0, 2)), np.zeros(0))
    assert found.samples == 0
    assert (found.radial.rms_mdeg, found.mean_loss_db, found.inside_half_power_percent) == (None, None, None)


def test_unknown_beam_gives_errors_but_no_loss() -> None:
    found = statistics_of(np.ones((3, 2)) * MDEG, np.full(3, np.nan))
    assert found.radial.rms_mdeg == pytest.approx(math.sqrt(2.0))
    assert (found.mean_loss_db, found.inside_half_power_percent) == (None, None)
