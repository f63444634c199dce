"""Gains and coupling from pilots: exact ones give them back, and what pilots do not determine is named."""

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.stats import chi2

from rf_pointing.array_sensors.doa.array import ArrayResponse, CircularArrayParams, coupling_basis, steering
from rf_pointing.papers.doa_study import future_work as beyond
from rf_pointing.papers.doa_study.directions import direction_from_polar
from rf_pointing.papers.doa_study.future_work import fit_response, nees_band

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
