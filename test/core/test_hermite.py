"""The quintic against polynomials it must reproduce."""

import numpy as np
import pytest

from rf_pointing.core import Motion, Quintic


def state(coefficients: np.ndarray, t: float) -> Motion:
    """Position, velocity and acceleration of polynomials (axes, 6), highest power first."""
    first = [np.polyder(row) for row in coefficients]
    second = [np.polyder(row, 2) for row in coefficients]
    return Motion(*(np.array([np.polyval(row, t) for row in rows]) for rows in (coefficients, first, second)))


def test_polynomials_of_degree_five_are_exact(random: np.random.Generator) -> None:
    for _ in range(50):
        coefficients, span = random.standard_normal((2, 6)), random.uniform(0.05, 3.0)
        times = random.uniform(0.0, span, 7)
        motion = Quintic(state(coefficients, 0.0), state(coefficients, span), span).at(times)
        for row, t in enumerate(times):
            for part, wanted in zip(motion, state(coefficients, t), strict=True):
                np.testing.assert_allclose(part[row], wanted, rtol=1e-9, atol=1e-9)


def test_both_ends_are_met(random: np.random.Generator) -> None:
    start, end = (Motion(*random.standard_normal((3, 2))) for _ in range(2))
    motion = Quintic(start, end, 0.7).at([0.0, 0.7])
    for part, first, last in zip(motion, start, end, strict=True):
        np.testing.assert_allclose(part, [first, last], atol=1e-11)


def test_one_time_gives_one_row_of_axes(random: np.random.Generator) -> None:
    start, end = (Motion(*random.standard_normal((3, 2))) for _ in range(2))
    one, many = (Quintic(start, end, 0.7).at(t) for t in (0.3, [0.3]))
    for single, rows in zip(one, many, strict=True):
        assert single.shape == (2,)
        np.testing.assert_array_equal(single, rows[0])


def test_a_six_degree_polynomial_is_off_by_the_known_remainder() -> None:
    """The remainder of quintic Hermite interpolation is f6/720 t^3 (h - t)^3, so t^6 is off by t^3 (h - t)^3."""
    power = np.array([[1.0, 0, 0, 0, 0, 0, 0]])
    motion = Quintic(state(power, 0.0), state(power, 2.0), 2.0).at(0.5)
    assert 0.5**6 - motion.position[0] == pytest.approx(-(0.5**3) * 1.5**3, rel=1e-12)


@pytest.mark.parametrize("duration_s", [0.0, -1.0, float("nan")])
def test_a_duration_that_is_not_positive_is_refused(duration_s: float) -> None:
    rest = Motion(*np.zeros((3, 2)))
    with pytest.raises(ValueError, match=r"duration_s=.* must be > 0"):
        Quintic(rest, rest, duration_s)
