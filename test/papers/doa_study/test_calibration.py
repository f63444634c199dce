"""Gains and coupling from pilots: exact ones give them back, and what pilots do not determine is named."""

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.stats import chi2

from rf_pointing.array_sensors.doa.array import ArrayResponse, CircularArrayParams, coupling_basis, steering
from rf_pointing.papers.doa_study import future_work as beyond
from rf_pointing.papers.doa_study.directions import direction_from_polar
from rf_pointing.papers.doa_study.future_work import _fit, _require_rank, fit_response, nees_band

ARRAY = CircularArrayParams()
TOWARDS = direction_from_polar(np.linspace(0.3, 0.9, 6), np.array([0.1, 1.3, 2.2, 3.7, 4.4, 5.8]))


def covariances(response: ArrayResponse) -> NDArray[np.complex128]:
    received = steering(ARRAY, TOWARDS) @ response.matrix.T
    return received[:, :, None] * received[:, None, :].conj() + np.eye(ARRAY.elements)


@pytest.fixture(scope="module")
def response() -> ArrayResponse:
    gain = 1.0 + 0.1 * np.exp(1j * np.arange(ARRAY.elements))
    return ArrayResponse(gain=gain / gain[0], coupling=beyond.COUPLING)


def test_exact_pilots_give_gain_and_coupling_back(response: ArrayResponse) -> None:
    fit = fit_response(ARRAY, TOWARDS, covariances(response))
    assert fit.response.gain == pytest.approx(response.gain, abs=1e-9)
    assert fit.response.coupling == pytest.approx(response.coupling, abs=1e-9)
    assert np.abs(fit.residual).max() < 1e-9
    assert fit.rank == ARRAY.elements - 1 + ARRAY.elements // 2
    assert np.diag(fit.correlation).real == pytest.approx(np.ones(fit.rank), abs=1e-9)
    assert 3 <= fit.iterations <= 12
    assert coupling_basis(ARRAY.elements).shape == (7, 12, 12)


def test_an_ideal_array_is_found_in_one_iteration() -> None:
    ideal = ArrayResponse(gain=np.ones(12, dtype=complex), coupling=np.zeros(6, dtype=complex))
    assert fit_response(ARRAY, TOWARDS, covariances(ideal)).iterations == 1


def test_the_last_iteration_allowed_may_converge(response: ArrayResponse, monkeypatch: pytest.MonkeyPatch) -> None:
    needed = fit_response(ARRAY, TOWARDS, covariances(response)).iterations
    monkeypatch.setattr(beyond, "MAX_ITERATIONS", needed)
    assert fit_response(ARRAY, TOWARDS, covariances(response)).iterations == needed
    monkeypatch.setattr(beyond, "MAX_ITERATIONS", needed - 1)
    with pytest.raises(ValueError, match=f"did not converge in {needed - 1} iterations"):
        fit_response(ARRAY, TOWARDS, covariances(response))


def test_directions_of_another_number_and_too_few_pilots_are_refused(response: ArrayResponse) -> None:
    with pytest.raises(ValueError, match=r"directions has shape \(5, 3\), must be \(6, 3\)"):
        fit_response(ARRAY, TOWARDS[:5], covariances(response))
    with pytest.raises(ValueError, match="pilots do not determine"):
        fit_response(ARRAY, TOWARDS[:1], covariances(response)[:1])


@pytest.mark.parametrize(
    ("column", "name"),
    [(0, r"gain\[1\]"), (7, r"gain\[8\]"), (10, r"gain\[11\]"), (11, r"coupling\[0\]"), (16, r"coupling\[5\]")],
)
def test_the_unknown_without_a_share_in_any_equation_is_named(column: int, name: str) -> None:
    jacobian = np.eye(20, 17, dtype=complex)
    jacobian[column, column] = 0.0
    with pytest.raises(ValueError, match=f"pilots do not determine {name}: condition"):
        _require_rank(jacobian, 12)


def test_of_equally_undetermined_unknowns_the_first_is_named() -> None:
    with pytest.raises(ValueError, match=r"determine gain\[6\]: condition"):
        _require_rank(np.eye(5, 17, dtype=complex), 12)
    jacobian = np.eye(20, 17, dtype=complex)
    jacobian[3] = 0.0
    jacobian[3, [3, 4]] = jacobian[4, [3, 4]] = [0.6, 0.8]
    # The lost combination is 0.8 of the fourth less 0.6 of the fifth.
    with pytest.raises(ValueError, match=r"determine gain\[4\]"):
        _require_rank(jacobian, 12)


def test_a_condition_of_a_million_is_still_determined() -> None:
    jacobian = 2.0 * np.eye(20, 17, dtype=complex)
    jacobian[4, 4] = 3.0
    jacobian[9, 9] = 3.02e-6
    _require_rank(jacobian, 12)
    jacobian[9, 9] = 2.98e-6
    with pytest.raises(ValueError, match=r"determine gain\[10\]"):
        _require_rank(jacobian, 12)


def test_covariance_is_that_of_the_residuals_over_the_equations_left() -> None:
    """Three pilots of four elements: twelve equations less three amplitudes less seven unknowns."""
    response = ArrayResponse(gain=np.ones(4, dtype=complex), coupling=np.zeros(2, dtype=complex))
    residual = np.full((3, 4), 0.3 + 0.4j)
    jacobian = np.zeros((12, 7), dtype=complex)
    jacobian[range(7), range(7)] = [1.0, 2.0, 4.0, 1j, 5.0, 1.0, 4e-6]
    fit = _fit(response, residual, jacobian, 4)
    variance = 12 * 0.25 / 2
    assert np.diag(fit.covariance).real == pytest.approx(variance / np.abs(np.diag(jacobian)) ** 2)
    assert fit.correlation == pytest.approx(np.eye(7), abs=1e-12)
    # 4e-6 is less than a millionth of 5.
    assert (fit.rank, fit.condition, fit.iterations) == (6, pytest.approx(5.0 / 4e-6), 4)
    jacobian[6, 6] = 5.1e-6
    assert _fit(response, residual, jacobian, 4).rank == 7


def test_one_equation_must_be_left() -> None:
    response = ArrayResponse(gain=np.ones(4, dtype=complex), coupling=np.zeros(2, dtype=complex))
    residual = np.full((3, 4), 0.3 + 0.4j)
    assert np.trace(_fit(response, residual, np.eye(12, 8, dtype=complex), 1).covariance).real == pytest.approx(24.0)
    with pytest.raises(ValueError, match="pilots=3 leave 0 degrees of freedom"):
        _fit(response, residual, np.eye(12, 9, dtype=complex), 1)


def test_the_band_of_one_run_of_one_dimension_and_its_limits() -> None:
    assert nees_band(1, 1) == pytest.approx((chi2.ppf(0.025, 1), chi2.ppf(0.975, 1)), rel=1e-9)
    assert nees_band(3, 2, 0.8) == pytest.approx((chi2.ppf(0.1, 6) / 2, chi2.ppf(0.9, 6) / 2), rel=1e-9)
    for dimension, runs, confidence, name in (
        (0, 1, 0.95, "dimension"), (1, 0, 0.95, "runs"), (1, 1, 0.9e-6, "confidence"), (1, 1, 1.0 - 0.9e-6, "confidence"),
    ):  # fmt: skip
        with pytest.raises(ValueError, match=f"{name}="):
            nees_band(dimension, runs, confidence)
    for confidence in (1.1e-6, 1.0 - 1.1e-6):
        low, high = nees_band(2, 3, confidence)
        assert low < high


def test_consistency_is_flown_for_400_s_and_a_start_for_30_s_after_the_hand_off(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    asked: list[Any] = []

    def scene(duration_s: float, start_s: float) -> None:
        asked.append((duration_s, start_s))
        raise InterruptedError

    monkeypatch.setattr(beyond, "nadir_scene", scene)
    for study in (beyond.mean_nees, beyond.any_start_error_deg):
        with pytest.raises(InterruptedError):
            study(1, 1)
    assert asked == [(400.0, 400.0), (355.0, 300.0)]
