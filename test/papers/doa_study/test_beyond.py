"""What lies beyond the paper, at a size a test can afford."""

import numpy as np
import pytest

from rf_pointing.papers.doa_study.beyond import coupling_rmse_deg, two_source_attitude_ratio


def test_two_stations_give_the_attitude_at_once_with_the_predicted_accuracy() -> None:
    rmse_deg, ratio = two_source_attitude_ratio(150, 3)
    assert rmse_deg < 1.0
    assert ratio == pytest.approx(1.0, abs=0.15)


def test_calibration_removes_the_coupling_error() -> None:
    bare, matched, ratio = coupling_rmse_deg(300, 3)
    assert bare > 3 * matched
    assert ratio == pytest.approx(1.0, abs=0.12)
    assert np.isfinite(matched)
