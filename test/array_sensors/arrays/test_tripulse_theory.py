import numpy as np
import pytest

from rf_pointing.array_sensors.arrays.tripulse_array import TripulseArrayParams
from rf_pointing.array_sensors.arrays.tripulse_beams import closed_form_signals, monopulse_ratios
from rf_pointing.array_sensors.arrays.tripulse_inversion import invert_ratios, polar_angles_rad
from rf_pointing.array_sensors.arrays.tripulse_theory import (
    integration_time_s,
    polar_angle_variance_rad2,
    projection_variance,
    ratio_variance,
    ratio_variance_unequal,
)
from rf_pointing.core import random_stream

TRIALS = 200_000


def noise(rng: np.random.Generator, variance: float, shape: tuple[int, ...]) -> np.ndarray:
    return np.sqrt(variance / 2.0) * (rng.normal(size=shape) + 1j * rng.normal(size=shape))


@pytest.mark.parametrize(("snr_db", "within"), [(12.0, 0.05), (15.0, 0.03), (20.0, 0.015)])
@pytest.mark.parametrize("gamma", [0.1, 1.0])
def test_corrected_17_follows_monte_carlo_and_the_published_one_falls_short_at_large_gamma(
    snr_db: float, within: float, gamma: float
) -> None:
    rng, snr = random_stream(1, "variance 17"), 10.0 ** (snr_db / 10.0)
    n = noise(rng, 1.0 / snr, (TRIALS, 2))
    found = float(np.var(np.imag((1j * gamma + n[:, 0]) / (1.0 + n[:, 1]))))
    assert ratio_variance(snr, gamma) == pytest.approx(found, rel=within)
    if gamma == 1.0 and snr_db == 12.0:
        assert ratio_variance(snr, gamma, "published") < 0.93 * found


def test_unequal_noise_reduces_to_17_and_follows_monte_carlo() -> None:
    assert ratio_variance_unequal(0.01, 0.01, 0.3) == pytest.approx(ratio_variance(100.0, 0.3), rel=1e-12)
    rng = random_stream(1, "unequal noise")
    n1, n2 = noise(rng, 0.03, (TRIALS,)), noise(rng, 0.004, (TRIALS,))
    found = float(np.var(np.imag((0.4j + n2) / (1.0 + n1))))
    assert ratio_variance_unequal(0.03, 0.004, 0.4) == pytest.approx(found, rel=0.015)


def test_18_follows_monte_carlo_within_1_percent() -> None:
    params = TripulseArrayParams(n_x=8, n_y=12, spacing_y_wavelengths=1.7)
    element_snr = 10.0
    signals = closed_form_signals(params, [1e-5, -2e-5]) + noise(
        random_stream(1, "variance 18"), 1.0 / element_snr, (TRIALS, 3)
    )
    found = np.var(invert_ratios(params, monopulse_ratios(signals)), axis=0)
    np.testing.assert_allclose(projection_variance(params, element_snr), found, rtol=0.01)


@pytest.mark.parametrize("theta_deg", [5.0, 30.0])
def test_corrected_21_is_the_variance_of_theta_and_the_published_one_is_at_least_twice_it(theta_deg: float) -> None:
    theta, sigma = np.radians(theta_deg), 1e-4
    t = np.sin(theta) * np.array([np.cos(0.7), np.sin(0.7)])
    found = float(np.var(polar_angles_rad(t + sigma * random_stream(1, "variance 21").normal(size=(TRIALS, 2)))[0]))
    assert polar_angle_variance_rad2(sigma**2, theta) == pytest.approx(found, rel=0.01)
    assert polar_angle_variance_rad2(sigma**2, theta, "published") > 1.98 * found


def test_published_21_is_the_mean_square_of_the_total_angle_at_boresight() -> None:
    sigma = 1e-4
    t = sigma * random_stream(1, "total angle").normal(size=(TRIALS, 2))
    mean_square = float(np.mean(polar_angles_rad(t)[0] ** 2))
    assert polar_angle_variance_rad2(sigma**2, 0.0, "published") == pytest.approx(mean_square, rel=0.01)


def test_specification_of_the_paper_takes_80_microseconds() -> None:
    assert integration_time_s(TripulseArrayParams(), 37.0, 5.8e-5) == pytest.approx(80e-6, rel=0.01)


def test_integration_time_is_set_by_the_slower_axis() -> None:
    long_in_x = TripulseArrayParams(n_x=32, n_y=8)
    long_in_y = TripulseArrayParams(n_x=8, n_y=32)
    assert integration_time_s(long_in_x, 37.0, 1e-4) == integration_time_s(long_in_y, 37.0, 1e-4)
    assert integration_time_s(long_in_x, 37.0, 1e-4) == pytest.approx(
        4.0 * integration_time_s(TripulseArrayParams(), 37.0, 1e-4)
    )


@pytest.mark.parametrize("bad", [0.0, -1.0, np.nan, np.inf])
def test_snr_that_is_not_positive_is_refused(bad: float) -> None:
    with pytest.raises(ValueError, match="sum_snr"):
        ratio_variance(bad, 0.1)
    with pytest.raises(ValueError, match="element_snr"):
        projection_variance(TripulseArrayParams(), bad)


def test_published_21_is_refused_at_its_pole() -> None:
    with pytest.raises(ValueError, match="pole"):
        polar_angle_variance_rad2(1e-8, np.pi / 4.0, "published")
