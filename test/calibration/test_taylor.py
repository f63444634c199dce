import numpy as np
import pytest

from rf_pointing.calibration import taylor

T = 0.37


def series_at(value, first, second, third):
    return taylor.from_derivatives(np.array([value]), np.array([first]), np.array([second]), np.array([third]))


def derivatives(series):
    return [float(series[0, 0]), float(series[1, 0]), 2.0 * float(series[2, 0]), 6.0 * float(series[3, 0])]


A = series_at(np.sin(T) + 2.0, np.cos(T), -np.sin(T), -np.cos(T))
B = series_at(np.exp(T), np.exp(T), np.exp(T), np.exp(T))


def test_product_of_sine_and_exponential_has_its_closed_form_derivatives():
    s, c, e = np.sin(T), np.cos(T), np.exp(T)
    expected = [e * (s + 2), e * (s + 2 + c), e * (2 + 2 * c), e * (2 + 2 * c - 2 * s)]
    assert derivatives(taylor.multiply(A, B)) == pytest.approx(expected, rel=1e-14)


def test_quotient_times_divisor_gives_the_dividend_back():
    assert np.allclose(taylor.multiply(taylor.divide(A, B), B), A, rtol=1e-14, atol=0.0)


def test_square_of_the_square_root_gives_the_argument_back():
    root = taylor.square_root(A)
    assert np.allclose(taylor.multiply(root, root), A, rtol=1e-14)


def test_sine_of_a_line_has_its_closed_form_derivatives():
    sine, cosine = taylor.sine_cosine(series_at(0.4, 3.0, 0.0, 0.0))
    assert derivatives(sine) == pytest.approx([np.sin(0.4), 3 * np.cos(0.4), -9 * np.sin(0.4), -27 * np.cos(0.4)])
    assert derivatives(cosine) == pytest.approx([np.cos(0.4), -3 * np.sin(0.4), -9 * np.cos(0.4), 27 * np.sin(0.4)])


def test_angle_of_undoes_sine_and_cosine_in_all_quadrants():
    for angle in (-3.0, -1.2, 0.3, 2.9):
        series = series_at(angle, 0.7, -0.4, 0.2)
        scaled = [taylor.multiply(part, B) for part in taylor.sine_cosine(series)]
        assert np.allclose(taylor.angle_of(*scaled), series, rtol=0.0, atol=1e-14)


def test_derivative_shifts_the_series():
    shifted = taylor.derivative(A)
    assert derivatives(shifted)[:3] == pytest.approx(derivatives(A)[1:])
    assert derivatives(taylor.derivative(A, 2))[:2] == pytest.approx(derivatives(A)[2:])
