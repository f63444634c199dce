"""The root finder against roots known in closed form."""

import math

import pytest

from rf_pointing.rf.root import bracketed_root


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
