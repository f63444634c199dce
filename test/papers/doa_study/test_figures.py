"""Pictures are written."""

from pathlib import Path

import numpy as np

from rf_pointing.papers.doa_study.accuracy import AccuracyPoint
from rf_pointing.papers.doa_study.attitude_runs import CaseResult
from rf_pointing.papers.doa_study.direction_errors import DirectionCase
from rf_pointing.papers.doa_study.figures import draw_accuracy, draw_convergence

PNG = b"\x89PNG"


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
