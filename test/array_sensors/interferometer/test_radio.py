import numpy as np
import pytest

from rf_pointing.array_sensors.interferometer.radio import (
    LinkParams,
    RadioParams,
    amplitude_sigma,
    path_loss,
    signal_to_noise_ratios,
)
from rf_pointing.array_sensors.interferometer.system import ArrayParams, CarrierPlan, path_lengths
from rf_pointing.papers.interferometer_simulation import (
    carrier_phases,
    require_gaussian_regime,
    simulate_amplitudes,
    simulate_phases,
)

PLAN, LINK, RADIO, ARRAYS = CarrierPlan(speed_of_light_m_s=3.0e8), LinkParams(), RadioParams(), ArrayParams()


def test_path_loss_of_the_chapter_5_misprint_is_four_times_too_much() -> None:
    corrected, printed = (path_loss(1e3, 2e9, variant=v) for v in ("corrected", "published"))
    assert corrected == pytest.approx((4.0 * np.pi * 1e3 * 2e9 / 3e8) ** 2)
    assert printed / corrected == pytest.approx(4.0)


def test_zero_range_is_refused() -> None:
    with pytest.raises(ValueError, match=r"range_m=0.0 must be > 0"):
        path_loss([1.0, 0.0], 1e9)


def test_power_ratios_at_100_km() -> None:
    forward, back = signal_to_noise_ratios(1e5, np.full((3, 3), 1e5), RADIO, PLAN, LINK)
    assert 10.0 * np.log10(forward[[0, -1]]) == pytest.approx([41.29, 40.18], abs=0.03)
    assert 10.0 * np.log10(back[[0, -1], 1, 2]) == pytest.approx([41.80, 40.19], abs=0.03)


def test_forward_noise_is_shared_by_the_nine_paths_and_return_noise_is_not(worked_example, rng) -> None:
    xi, attitude = worked_example
    phases = simulate_phases(1e5 * xi, attitude, ARRAYS, RADIO, PLAN, LINK, rng, 4000)
    lengths = path_lengths(1e5 * xi, attitude, ARRAYS)
    noise = np.angle(np.exp(1j * (phases - carrier_phases(lengths[0, 0], lengths[1:, 1:], PLAN))))
    forward, back = signal_to_noise_ratios(lengths[0, 0], lengths[1:, 1:], RADIO, PLAN, LINK)
    covariance = np.cov(noise[:, 0].reshape(-1, 9).T)
    expected = np.diag(0.5 / back[0].ravel()) + 0.5 / forward[0]
    np.testing.assert_allclose(covariance, expected, atol=0.12 * expected[0, 1])
    assert abs(np.corrcoef(noise[:, 0, 0, 0], noise[:, 1, 0, 0])[0, 1]) < 0.06


def test_phases_are_wrapped(worked_example, rng) -> None:
    xi, attitude = worked_example
    phases = simulate_phases(50.0 * xi, attitude, ARRAYS, RADIO, PLAN, LINK, rng)
    assert phases.shape == (1, 9, 3, 3)
    assert np.all((phases >= 0.0) & (phases < 2.0 * np.pi))


def test_the_listing_makes_the_amplitudes_three_times_too_good() -> None:
    listing, corrected = (amplitude_sigma(1e5, RADIO, PLAN, LINK, v) for v in ("published", "corrected"))
    # A third from averaging one draw like nine, and the square root of two from the forward power.
    assert corrected / listing == pytest.approx(3.0 * np.sqrt(2.0), rel=0.15)


def test_scatter_of_the_amplitudes_is_the_stated_sigma(rng) -> None:
    noisy = simulate_amplitudes(np.eye(2), 0.02, rng, 5000)
    assert np.std(noisy - np.eye(2)) == pytest.approx(0.02, rel=0.03)


def test_links_below_10_db_are_refused(rng) -> None:
    weak = RadioParams(return_power_w=5e-4)
    with pytest.raises(ValueError, match=r"return link snr=.* must be >= 10"):
        simulate_phases([1e5, 0.0, 0.0], np.eye(3), ARRAYS, weak, PLAN, LINK, rng)
    with pytest.raises(ValueError, match="forward link snr=9"):
        require_gaussian_regime([9.0], [100.0])
