"""The picture of the two conscan estimators: what it shows, and that it can be drawn."""

from pathlib import Path

import numpy as np
import pytest

from rf_pointing.papers.conscan_cases import draw, estimator_curves


def test_linear_estimator_is_biased_where_the_exact_one_is_not() -> None:
    curves = estimator_curves(40.0, 8000, seed=2, points=4)
    at = np.searchsorted(curves.error_mdeg, 6.0)
    # The modulation of exp is 2 I1(x)/I0(x) = x (1 - x^2/8): 0.4 % short at 6.8 mdeg, 0.8 % at 8.5 mdeg.
    assert curves.linear_bias[at] < -0.02
    assert np.all(np.abs(curves.exact_bias) < 4.0 * curves.exact_sigma / np.sqrt(8000))
    assert curves.exact_sigma == pytest.approx(curves.bound, rel=0.04)


def test_picture_is_written(tmp_path: Path) -> None:
    draw(tmp_path / "conscan.svg", runs=50)
    assert (tmp_path / "conscan.svg").read_text().count("<svg") == 1
