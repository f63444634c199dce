"""The threshold: found where a planted curve crosses, refused where it does not.

Pictures are written.
"""

from pathlib import Path

import numpy as np
import pytest

from rf_pointing.papers.doa_study.accuracy import (
    AccuracyPoint,
    accuracy_curve,
    draw_accuracy,
    draw_convergence,
    threshold,
)
from rf_pointing.papers.doa_study.directions import DirectionCase
from test.papers.doa_study.test_recorded_study import planted as a_result

PNG = b"\x89PNG"


def planted(ratios: dict[float, float]) -> list[AccuracyPoint]:
    return [
        AccuracyPoint(
            snr_db=snr_db, effective_snr=10 ** (snr_db / 10 + 2), theta_deg=ratio, phi_deg=ratio,
            theta_bound_deg=1.0, phi_bound_deg=1.0, grid_theta_deg=ratio, grid_phi_deg=ratio,
            outliers=0.0,
        )
        for snr_db, ratio in ratios.items()
    ]  # fmt: skip


def test_crossing_is_interpolated() -> None:
    snr_db, effective = threshold(planted({-4.0: 2.0, -2.0: 1.09, 0.0: 1.01, 2.0: 1.0}))
    assert snr_db == pytest.approx(-1.0)
    assert effective == pytest.approx(10**1.9)


def test_curve_that_does_not_cross_is_refused() -> None:
    with pytest.raises(ValueError, match="does not cross"):
        threshold(planted({0.0: 1.0, 2.0: 1.0}))


def test_measured_curve_has_its_threshold_between_minus_11_and_minus_8_decibel() -> None:
    curve = accuracy_curve(100, (-12.0, -11.0, -8.0, -4.0), estimates=4000, seed=2)
    assert -11.0 < threshold(curve)[0] < -7.5
    assert curve[0].outliers > 1e-3 > curve[2].outliers
    assert np.degrees(0.005) < curve[-1].theta_bound_deg < 1.0


def test_accuracy_and_convergence_become_pictures(tmp_path: Path) -> None:
    draw_accuracy(planted({-10.0: 1.2, 0.0: 1.0}), 100, tmp_path / "accuracy.png")
    draw_convergence([a_result(DirectionCase(snapshots=100, snr_db=0.0), 1.0)], tmp_path / "convergence.png")
    for name in ("accuracy.png", "convergence.png"):
        assert (tmp_path / name).read_bytes().startswith(PNG)
