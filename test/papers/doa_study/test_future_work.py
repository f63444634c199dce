"""Consistency: planted covariances give the chi-square mean, and NaN is refused.

What lies beyond the paper, at a size a test can afford.
"""

import numpy as np
import pytest

from rf_pointing.array_sensors.doa.attitude_chain import match_directions
from rf_pointing.papers.doa_study import future_work as beyond
from rf_pointing.papers.doa_study.future_work import coupling_rmse_deg, nees, two_source_attitude_ratio


def test_errors_of_the_stated_covariance_score_their_dimension() -> None:
    stream = np.random.default_rng(9)
    root = stream.standard_normal((4, 4))
    errors = stream.standard_normal((50_000, 4)) @ root.T
    assert np.mean(nees(errors, root @ root.T)) == pytest.approx(4.0, abs=0.06)


def test_every_error_of_a_stack_is_weighted_by_its_own_covariance() -> None:
    errors = np.arange(1.0, 13.0).reshape(2, 3, 2)
    covariances = np.stack([np.eye(2) * (1.0 + place) for place in range(6)]).reshape(2, 3, 2, 2)
    expected = np.sum(errors**2, axis=2) / (1.0 + np.arange(6.0).reshape(2, 3))
    assert nees(errors, covariances) == pytest.approx(expected)
    assert float(nees(errors[0, 0], covariances[0, 1])) == pytest.approx(2.5)


def test_error_that_is_not_a_number_is_refused() -> None:
    with pytest.raises(ValueError, match=r"error=.* must be finite"):
        nees(np.array([[np.nan, 0.0]]), np.eye(2))


def test_two_stations_give_the_attitude_at_once_with_the_predicted_accuracy() -> None:
    rmse_deg, ratio = two_source_attitude_ratio(150, 3)
    assert rmse_deg < 1.0
    assert ratio == pytest.approx(1.0, abs=0.15)


def test_stations_are_matched_within_20_degrees(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[float] = []

    def match(found: np.ndarray, expected: np.ndarray, limit_rad: float) -> list[tuple[int, int]]:
        asked.append(limit_rad)
        return match_directions(found, expected, limit_rad)

    monkeypatch.setattr(beyond, "match_directions", match)
    two_source_attitude_ratio(2, 3)
    assert np.degrees(asked) == pytest.approx([20.0, 20.0])


def test_calibration_removes_the_coupling_error() -> None:
    bare, matched, ratio = coupling_rmse_deg(300, 3)
    assert bare > 3 * matched
    assert ratio == pytest.approx(1.0, abs=0.12)
    assert np.isfinite(matched)
