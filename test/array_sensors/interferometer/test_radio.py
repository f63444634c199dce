""" """

import numpy as np
import pytest

from rf_pointing.array_sensors.interferometer.radio import (
    LinkParams,
    RadioParams,
    amplitude_sigma,
    link_snr,
    path_loss,
    required_power_w,
    signal_to_noise_ratios,
)
from rf_pointing.array_sensors.interferometer.system import ArrayParams, CarrierPlan, path_lengths
from rf_pointing.papers.interferometer_simulation import (
    carrier_phases,
    require_gaussian_regime,
    simulate_amplitudes,
    simulate_phases,
)
from rf_pointing.papers.interferometer_transponder import nonlinear_reflector, simple_repeater

DB = 0.1
DOUBLE_DB = 10.0 * np.log10(2.0)
PLAN, LINK, RADIO, ARRAYS = CarrierPlan(speed_of_light_m_s=3.0e8), LinkParams(), RadioParams(), ArrayParams()


def chapter5(bandwidth_hz: float) -> LinkParams:
    return LinkParams(
        bandwidth_hz=bandwidth_hz, noise_figure_db=3.0, transmit_gain_db=DOUBLE_DB, receive_gain_db=DOUBLE_DB
    )


def db(ratio) -> float:
    return float(10.0 * np.log10(ratio))


def reflector(range_m: float, gain_db: float, loss: str = "corrected", power_w: float = 1.0):
    return nonlinear_reflector(power_w, range_m, gain_db, 20e9, 2e9, chapter5(1e3), chapter5(1.0), loss=loss)


@pytest.mark.parametrize(
    ("snr_db", "forward_hz", "expected_w"),
    [(40.0, 3.42e9, 2.134), (40.0, 2.42e9, 1.069), (20.0, 3.42e9, 0.02134), (46.0, 2.5e9, 4.540), (46.0, 1.7e9, 2.099)],
)
def test_powers_of_tables_8_2_and_8_3(snr_db: float, forward_hz: float, expected_w: float) -> None:
    power = required_power_w(10.0 ** (0.1 * snr_db), 1e5, forward_hz, LinkParams())
    assert power == pytest.approx(expected_w, rel=1e-3)
    assert link_snr(power, 1e5, forward_hz, LinkParams()) == pytest.approx(10.0 ** (0.1 * snr_db))


def test_tables_belong_to_3_42_gigahertz_not_to_the_printed_3_424() -> None:
    printed = [required_power_w(1e4, 1e5, f, LinkParams()) for f in (3.424e9, 2.424e9)]
    assert printed == pytest.approx([2.1392, 1.0721], abs=1e-4)
    assert abs(printed[0] - 2.134) > 0.002
    unrounded = [required_power_w(10**4.564, 1e5, f, LinkParams()) for f in (2.5e9, 1.7e9)]
    assert unrounded == pytest.approx([4.179, 1.932], abs=2e-3)


def test_path_loss_of_the_chapter_5_misprint_is_four_times_too_much() -> None:
    corrected, printed = (path_loss(1e3, 2e9, variant=v) for v in ("corrected", "published"))
    assert corrected == pytest.approx((4.0 * np.pi * 1e3 * 2e9 / 3e8) ** 2)
    assert printed / corrected == pytest.approx(4.0)


@pytest.mark.parametrize(("range_km", "expected"), [(0.1, -59.51), (1.0, -119.51), (10.0, -179.51), (100.0, -239.51)])
def test_reflector_without_gain_returns_minus_60_to_minus_240_db(range_km: float, expected: float) -> None:
    assert db(reflector(1e3 * range_km, 0.0).snr_return) == pytest.approx(expected, abs=DB)


def test_the_misprinted_loss_and_the_misprinted_megawatt_miss_the_minus_240_db() -> None:
    assert db(reflector(1e5, 0.0, loss="published").snr_return) == pytest.approx(-257.6, abs=DB)
    assert db(reflector(1e5, 0.0, power_w=1e6).snr_return) == pytest.approx(-119.5, abs=DB)


@pytest.mark.parametrize(("range_km", "gain", "expected"), [(1, 140, 20.49), (10, 200, 20.42), (100, 260, 16.27)])
def test_reflector_gains_of_figure_5_6(range_km: float, gain: float, expected: float) -> None:
    assert db(reflector(1e3 * range_km, gain).snr_return) == pytest.approx(expected, abs=DB)


def test_forward_link_of_figure_5_5() -> None:
    def output_db(power_w: float, range_m: float, bandwidth_hz: float) -> float:
        link = chapter5(bandwidth_hz)
        return db(nonlinear_reflector(power_w, range_m, 0.0, 20e9, 2e9, link, link).snr_output)

    assert output_db(1.0, 6.53e3, 1e7) == pytest.approx(0.0, abs=DB)
    assert output_db(10.0, 65.3e3, 1e6) == pytest.approx(0.0, abs=DB)
    assert output_db(1.0, 1e5, 1e3) == pytest.approx(18.33, abs=DB)
    assert output_db(1.0, 1e4, 1e7) == pytest.approx(-5.50, abs=DB)


def test_reflector_at_high_ratio_repeats_3_db_less_when_all_noise_is_counted() -> None:
    link = chapter5(1e3)
    both = [
        nonlinear_reflector(1.0, 1e4, 0.0, 20e9, 2e9, link, link, mixing=v).snr_output
        for v in ("published", "corrected")
    ]
    assert db(both[0] / both[1]) == pytest.approx(3.0, abs=DB)


def test_repeater_of_figures_5_7_to_5_9() -> None:
    far = simple_repeater(1.0, 1e5, 120.0, 20e9, 2e9, chapter5(1e3), chapter5(1.0))
    assert db(far.snr_output) == pytest.approx(18.39, abs=DB)
    assert db(far.snr_return) == pytest.approx(18.31, abs=DB)
    for gain, expected in ((100.0, 22.2), (120.0, 34.2)):
        low = simple_repeater(0.1, 1e5, gain, 3e9, 2e9, chapter5(100.0), chapter5(1.0))
        assert db(low.snr_return) == pytest.approx(expected, abs=DB)
    assert db(low.snr_input) == pytest.approx(34.87, abs=DB)
    wide = [simple_repeater(1.0, r, 0.0, 3e9, 2e9, chapter5(1e6), chapter5(1.0)).snr_output for r in (1e4, 1e5)]
    assert [db(r) for r in wide] == pytest.approx([24.87, 4.87], abs=DB)


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
