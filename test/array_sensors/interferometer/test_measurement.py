import numpy as np
import pytest

from rf_pointing.array_sensors.interferometer.measurement import (
    InterferometerMeasurement,
    phase_rate_sigma_rad_s,
    phase_variance,
)


def measurement(**changes) -> InterferometerMeasurement:
    fields = {
        "t_s": 1.0, "phase_rad": np.zeros((9, 3, 3)), "phase_rate_rad_s": np.zeros((9, 3, 3)),
        "amplitudes": np.eye(2), "amplitude_sigma": 0.01, "snr_forward": np.full(9, 100.0),
        "snr_return": np.full((9, 3, 3), 100.0), "locked": np.ones((9, 3, 3), dtype=bool),
    }  # fmt: skip
    return InterferometerMeasurement(**{**fields, **changes})


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"t_s": float("nan")}, "t_s=nan must be finite"),
        ({"phase_rad": np.full((9, 3, 3), np.nan)}, r"(?s)phase_rad=.* must be finite"),
        ({"phase_rate_rad_s": np.zeros((8, 3, 3))}, "phase_rate_rad_s has shape"),
        ({"amplitudes": np.array([[np.inf, 0.0], [0.0, 1.0]])}, r"(?s)amplitudes=.* must be finite"),
        ({"amplitude_sigma": 0.0}, r"amplitude_sigma=0.0 must be > 0"),
        ({"amplitude_sigma": float("nan")}, "amplitude_sigma=nan must be finite"),
        ({"amplitude_sigma": float("inf")}, "amplitude_sigma=inf must be finite"),
        ({"snr_forward": np.ones((9, 1))}, "snr_forward has shape"),
        ({"locked": np.ones((9, 3), dtype=bool)}, "locked has shape .* must be .* of bool"),
        ({"snr_return": np.zeros((9, 4, 4))}, "snr_return has shape"),
        ({"locked": np.ones((9, 3, 3))}, "locked has shape .* must be .* of bool"),
    ],
)
def test_incomplete_or_undefined_measurements_are_refused(changes, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        measurement(**changes)


def test_phase_of_a_noisy_phasor_has_the_variance_of_half_the_inverse_ratio(rng) -> None:
    ratio = 1e3
    noise = (rng.normal(size=100_000) + 1j * rng.normal(size=100_000)) * np.sqrt(0.5 / ratio)
    assert np.var(np.angle(1.0 + noise)) == pytest.approx(phase_variance(ratio), rel=0.02)


def test_frequency_of_a_noisy_tone_meets_the_cramer_rao_ratio(rng) -> None:
    dwell, count, sigma = 0.1, 400, 0.05
    times = (np.arange(count) + 0.5) / count * dwell - 0.5 * dwell
    phases = rng.normal(0.0, sigma, (4000, count))
    slopes = phases @ times / np.sum(times**2)
    expected = phase_rate_sigma_rad_s(sigma / np.sqrt(count), dwell)
    assert np.std(slopes) == pytest.approx(expected, rel=0.04)


def test_a_link_without_signal_is_refused() -> None:
    with pytest.raises(ValueError, match=r"snr=0.0 must be > 0"):
        phase_variance([1.0, 0.0])
