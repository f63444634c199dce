"""Gust filter against Davenport's spectrum and its closed-form variance."""

import numpy as np
import pytest

from rf_pointing.core import random_stream
from rf_pointing.servo import GustFilter, davenport_psd


@pytest.mark.parametrize("speed_m_s", [3.0, 8.0, 20.0])
def test_filter_spectrum_is_davenports_within_three_tenths_of_a_decibel(speed_m_s: float) -> None:
    frequency = np.geomspace(0.3, 1000.0, 200) * speed_m_s / 1200.0
    ratio = GustFilter.davenport(speed_m_s, 0.005).psd(frequency) / davenport_psd(frequency, speed_m_s, 0.005)
    assert np.max(np.abs(10.0 * np.log10(ratio))) < 0.3


def test_davenport_spectrum_integrates_to_six_kappa_speed_squared() -> None:
    frequency = np.geomspace(1e-6, 1e4, 200_001)
    variance = np.trapezoid(davenport_psd(frequency, 8.0, 0.005), frequency)
    assert variance == pytest.approx(6.0 * 0.005 * 64.0, rel=1e-3)
    assert GustFilter.davenport(8.0, 0.005).variance_m2_s2 == pytest.approx(variance, rel=0.02)


def test_sampled_gusts_keep_the_stationary_covariance_at_any_step() -> None:
    gust = GustFilter.davenport(8.0, 0.005)
    root = gust.stationary_factor()
    stationary = root @ root.T
    for dt_s in (0.02, 0.1, 1.0):
        decay, noise = gust.step_matrices(dt_s)
        stepped = np.outer(decay, decay) * stationary + noise @ noise.T
        np.testing.assert_allclose(stepped, stationary, rtol=1e-9)


def test_simulated_gusts_have_the_filters_one_step_correlation() -> None:
    gust = GustFilter.davenport(8.0, 0.005)
    random = random_stream(3, "gust")
    decay, noise = gust.step_matrices(0.5)
    state = gust.stationary_factor() @ random.standard_normal(4)
    speeds = []
    for _ in range(40_000):
        state = decay * state + noise @ random.standard_normal(4)
        speeds.append(float(state @ gust.residues))
    root = gust.stationary_factor()
    expected = gust.residues @ (decay * (root @ root.T @ gust.residues)) / gust.variance_m2_s2
    measured = np.corrcoef(speeds[:-1], speeds[1:])[0, 1]
    assert measured == pytest.approx(expected, abs=0.01)


def test_calm_air_has_no_davenport_filter() -> None:
    with pytest.raises(ValueError, match=r"mean_speed_m_s=0\.0 must be >= 0\.001"):
        GustFilter.davenport(0.0, 0.005)
