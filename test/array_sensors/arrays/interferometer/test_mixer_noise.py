import numpy as np
import pytest

from rf_pointing.array_sensors.arrays.interferometer.mixer_noise import mixed_powers_w, mixed_snr, signal_to_noise


def db(ratio: float) -> float:
    return float(10.0 * np.log10(ratio))


def test_equal_inputs_at_minus_10_db() -> None:
    assert mixed_snr(0.1, 0.1, "published") == pytest.approx(0.0090909, abs=1e-7)
    assert db(mixed_snr(0.1, 0.1, "published")) == pytest.approx(-20.414, abs=1e-3)
    assert db(mixed_snr(0.1, 0.1)) == pytest.approx(-20.792, abs=1e-3)


def test_high_input_ratio_costs_nothing_as_published_and_3_db_in_truth() -> None:
    assert db(mixed_snr(100.0, 100.0, "published")) == pytest.approx(19.957, abs=1e-3)
    assert db(mixed_snr(100.0, 100.0)) == pytest.approx(16.968, abs=1e-3)


@pytest.mark.parametrize("variant", ["published", "corrected"])
def test_ratio_is_that_of_the_powers(variant: str) -> None:
    signal, noise = mixed_powers_w(3.0, 0.5, 2.0, 0.25, variant)
    assert mixed_snr(3.0 / 0.5, 2.0 / 0.25, variant) == pytest.approx(signal / noise)


def test_simulated_product_of_noisy_signals_follows_the_corrected_ratio(rng) -> None:
    count, amplitudes, sigmas = 400_000, (1.4, 0.8), (0.9, 0.5)
    envelopes = [
        a + s * (rng.normal(size=count) - 1j * rng.normal(size=count)) for a, s in zip(amplitudes, sigmas, strict=True)
    ]
    # Envelope of the difference-frequency product of two narrowband signals.
    product = 0.5 * envelopes[0] * np.conj(envelopes[1])
    signal, noise = 0.5 * np.abs(np.mean(product)) ** 2, 0.5 * np.var(product)
    ratios = [signal_to_noise(a, s) for a, s in zip(amplitudes, sigmas, strict=True)]
    assert signal / noise == pytest.approx(float(mixed_snr(*ratios)), rel=0.02)
    assert float(mixed_snr(*ratios, "published")) > 1.2 * signal / noise
