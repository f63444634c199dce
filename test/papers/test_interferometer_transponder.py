""" """

import numpy as np
import pytest
from scipy.special import iv

from rf_pointing.array_sensors.interferometer.system import CarrierPlan
from rf_pointing.papers.interferometer_transponder import (
    antennas_for_cone,
    choose_transponder,
    exponential_line,
    frequency_conflicts,
    mixed_powers_w,
    mixed_snr,
    modified_bessel,
    product_code,
    range_rate_from_offsets,
    signal_to_noise,
    square_law_lines,
)

SAMPLES, F1, F2 = 4096, 300, 170


def spectrum(device, s0: float, a1: float, a2: float):
    phase = 2.0 * np.pi * np.arange(SAMPLES) / SAMPLES
    output = device(s0 + a1 * np.cos(F1 * phase + 0.4) + a2 * np.cos(F2 * phase - 0.9))
    lines = np.abs(np.fft.rfft(output)) / SAMPLES
    lines[1:] *= 2.0
    return lines


def test_square_law_lines_are_those_of_the_spectrum() -> None:
    lines = spectrum(np.square, 0.3, 0.7, 0.4)
    expected = square_law_lines(0.3, 0.7, 0.4)
    bins = {"dc": 0, "difference": F1 - F2, "f1": F1, "f2": F2, "2f1": 2 * F1, "2f2": 2 * F2, "sum": F1 + F2}
    for name, position in bins.items():
        assert lines[position] == pytest.approx(expected[name], abs=1e-12)
    published = {"dc": 0.415, "difference": 0.28, "f1": 0.42, "f2": 0.24, "2f1": 0.245, "2f2": 0.08, "sum": 0.28}
    assert expected == pytest.approx(published)


def test_exponential_lines_are_those_of_the_spectrum() -> None:
    lines = spectrum(np.exp, 0.2, 0.6, 0.9)
    for order1, order2 in ((0, 0), (1, 0), (0, 1), (1, 1), (2, 1), (1, 2), (2, 2)):
        line = exponential_line(order1, order2, 0.6, 0.9, bias=0.2)
        assert lines[abs(order1 * F1 - order2 * F2)] == pytest.approx(line, abs=1e-10)
    assert exponential_line(1, 1, 0.6, 0.9) == pytest.approx(0.311901, abs=1e-6)


def test_small_drives_multiply() -> None:
    assert exponential_line(1, 1, 1e-3, 2e-3) == pytest.approx(1e-3 * 2e-3 / 2.0, rel=1e-5)


def test_modified_bessel_is_scipys() -> None:
    for order in range(5):
        for argument in (0.0, 0.7, 5.0, 29.0):
            assert modified_bessel(order, argument) == pytest.approx(iv(order, argument), rel=1e-12)


def test_only_odd_orders_carry_the_code() -> None:
    for code in (-1, 1):
        assert np.sign(exponential_line(1, 2, 0.5, 0.5, code1=code)) == code
        assert exponential_line(2, 1, 0.5, 0.5, code1=code) > 0.0


def test_reradiated_code_is_the_product_and_equal_codes_give_a_bare_carrier(rng) -> None:
    first, second = rng.choice([-1.0, 1.0], (2, 1023))
    np.testing.assert_array_equal(product_code(first, first), 1.0)
    product = product_code(first, second)
    # Low cross-correlation with either code, six standard deviations of a random code.
    for code in (first, second):
        assert abs(np.mean(product * code)) < 6.0 / np.sqrt(1023)


def test_impossible_codes_and_orders_are_refused() -> None:
    with pytest.raises(ValueError, match="of values -1 and 1"):
        product_code([1, 0], [1, 1])
    with pytest.raises(ValueError, match="code=2 must be -1 or 1"):
        exponential_line(1, 1, 0.1, 0.1, code1=2)
    with pytest.raises(ValueError, match="order=-1"):
        modified_bessel(-1, 0.1)


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


def test_the_reports_choice_is_the_carrier_repeater_and_a_code_only_against_interference() -> None:
    assert choose_transponder(interference=False).name == "multiple-carrier CW repeater"
    assert choose_transponder(interference=True).name == "coherent PN transponder"
    assert choose_transponder(interference=True, widest_input_hz=1e7).name == "SAW/clipper PN transponder"
    with pytest.raises(ValueError, match="leaves no transponder"):
        choose_transponder(interference=False, widest_input_hz=5.0)


def test_a_45_degree_cone_leaves_dipole_and_slot_and_stowing_only_the_slot() -> None:
    assert [a.name for a in antennas_for_cone(45.0)] == ["crossed dipole", "crossed slot"]
    assert [a.name for a in antennas_for_cone(45.0, flush=True)] == ["crossed slot"]
    assert len(antennas_for_cone(15.0)) == 3


def test_the_reports_return_link_lies_in_the_shuttle_band_it_says_to_avoid() -> None:
    assert frequency_conflicts(CarrierPlan()) == ("return carriers in shuttle S-band",)
    assert frequency_conflicts(CarrierPlan(return_hz=2.35e9)) == ()
    assert "forward carriers in GPS L1" in frequency_conflicts(CarrierPlan(return_hz=2.35e9, forward_hz=1.574e9))


def test_differencing_received_frequencies_leaves_doppler_without_the_oscillator_offset() -> None:
    plan, rate, offset = CarrierPlan(), -7.5, 1234.0
    mean = 0.5 * (plan.forward_carriers_hz + plan.return_carriers_hz)
    received = offset - mean * rate / plan.speed_of_light_m_s
    found = range_rate_from_offsets(received, plan)
    assert found[0] == pytest.approx(rate, abs=1e-6)
    assert found[1] == pytest.approx(offset, abs=1e-5)


def test_missing_frequencies_are_refused() -> None:
    with pytest.raises(ValueError, match="offsets_hz has shape"):
        range_rate_from_offsets(np.zeros(4), CarrierPlan())
