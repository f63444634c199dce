import numpy as np
import pytest
from scipy.special import iv

from rf_pointing.array_sensors.arrays.interferometer.mixer import (
    exponential_line,
    modified_bessel,
    product_code,
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
