"""The root finder against roots known in closed form.

Vectorised roots: closed forms, awkward functions, and intervals without a root.
"""

import math

import numpy as np
import pytest

from rf_pointing.core.roots import bracketed_root, roots_between


@pytest.mark.parametrize(
    ("function", "low", "high", "root"),
    [
        (lambda x: x * x - 2.0, 0.0, 2.0, math.sqrt(2.0)),
        (math.cos, 0.1, 3.0, 0.5 * math.pi),
        (lambda x: math.exp(-4.0 * math.log(2.0) * x * x) - 0.5, 0.2, 1.6, 0.5),
        (lambda x: x**9 - 1e-9, 0.0, 1.0, 0.1),
        (lambda x: x - 0.25, 0.25, 1.0, 0.25),
    ],
)
def test_the_root_is_found_to_rounding(function, low: float, high: float, root: float) -> None:  # type: ignore[no-untyped-def]
    assert bracketed_root(function, low, high) == pytest.approx(root, rel=1e-12)
    assert bracketed_root(lambda x: -function(x), low, high) == pytest.approx(root, rel=1e-12)


def test_a_bracket_without_a_sign_change_is_refused() -> None:
    with pytest.raises(ValueError, match="no sign change between 1"):
        bracketed_root(lambda x: x * x + 1.0, 1.0, 2.0)


def test_roots_of_different_functions_are_found_at_once() -> None:
    power = np.array([1.0, 2.0, 3.0, 9.0, 21.0])
    found = roots_between(lambda x: x**power - 0.5, np.zeros(5), np.full(5, 1.5), 1e-12)
    np.testing.assert_allclose(found, 0.5 ** (1.0 / power), rtol=0.0, atol=1e-12)


def test_a_smooth_root_takes_few_calls() -> None:
    calls = 0

    def function(x: np.ndarray) -> np.ndarray:
        nonlocal calls
        calls += 1
        return np.sin(x - 0.123)

    roots_between(function, np.array([-1.0]), np.array([1.4]), 1e-6)
    assert calls <= 9


def test_steps_flats_and_roots_at_the_ends_are_found() -> None:
    step = roots_between(lambda x: np.where(x < 0.7, -1.0, 1e-3), np.array([0.0]), np.array([10.0]), 1e-6)
    np.testing.assert_allclose(step, 0.7, atol=1e-6)
    end = roots_between(lambda x: x - 3.0, np.array([3.0]), np.array([5.0]), 1e-6)
    np.testing.assert_allclose(end, 3.0, atol=1e-6)


def test_no_interval_gives_no_root() -> None:
    assert roots_between(np.sin, np.array([]), np.array([]), 1e-6).size == 0


def test_an_interval_without_change_of_sign_is_refused() -> None:
    with pytest.raises(ValueError, match=r"no change of sign in the interval that starts at 2\.0"):
        roots_between(lambda x: x, np.array([-1.0, 2.0]), np.array([1.0, 3.0]), 1e-6)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_root_near_a_flat_end_does_not_creep(sign: float) -> None:
    """Plain regula falsi moves one end alone: it takes over 200 calls for either of these."""
    for function, low, high in ((lambda x: x**9 - 1e-3, 0.0, 1.0), (lambda x: 1e-3 - (1.0 - x) ** 9, 0.0, 1.0)):
        calls = []

        def counted(x: float, function=function, calls=calls) -> float:  # type: ignore[no-untyped-def]
            calls.append(x)
            return sign * function(x)

        bracketed_root(counted, low, high)
        assert len(calls) <= 40
