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
from rf_pointing.papers.doa_study.attitude_runs import CaseResult
from rf_pointing.papers.doa_study.directions import DirectionCase

PNG = b"\x89PNG"


def planted(ratios: dict[float, float]) -> list[AccuracyPoint]:
    return [
        AccuracyPoint(
            snr_db=snr_db,
            effective_snr=10 ** (snr_db / 10 + 2),
            theta_deg=ratio,
            phi_deg=ratio,
            theta_bound_deg=1.0,
            phi_bound_deg=1.0,
            grid_theta_deg=ratio,
            grid_phi_deg=ratio,
            outliers=0.0,
        )
        for snr_db, ratio in ratios.items()
    ]


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
    points = [
        AccuracyPoint(
            snr_db=snr_db,
            effective_snr=100.0,
            theta_deg=1.0,
            phi_deg=1.2,
            theta_bound_deg=0.9,
            phi_bound_deg=1.1,
            grid_theta_deg=1.1,
            grid_phi_deg=1.3,
            outliers=0.01,
        )
        for snr_db in (-10.0, 0.0)
    ]
    draw_accuracy(points, 100, tmp_path / "accuracy.png")
    case = DirectionCase(snapshots=100, snr_db=0.0)
    history = np.geomspace(50.0, 0.1, 40, dtype=np.float32)[:, None]
    result = CaseResult(
        case=case,
        theta_deg=1.0,
        phi_deg=1.0,
        roll_deg=0.1,
        pitch_deg=0.1,
        yaw_deg=0.1,
        sigma_deg=0.1,
        outliers=0.0,
        history_deg=history,
        rate_history_deg_s=history,
    )
    draw_convergence([result], tmp_path / "convergence.png")
    for name in ("accuracy.png", "convergence.png"):
        assert (tmp_path / name).read_bytes().startswith(PNG)
