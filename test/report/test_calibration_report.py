"""The page of a calibration: what it says where there is no model."""

from pathlib import Path

import numpy as np
import pytest

from rf_pointing.calibration import Observations
from rf_pointing.report.calibration_report import write_campaign_report


@pytest.mark.parametrize("count", [0, 40])
def test_a_campaign_without_a_model_has_a_page_with_its_reasons(tmp_path: Path, count: int) -> None:
    why = ["0 of 2 passes observed; BEACON 7: no observation, 3 s on target; 99 errors: <not valid>"]
    column = np.linspace(0.3, 0.9, count)
    motion = {name: np.zeros(count) for name in (
        "azimuth_rate_rad_s", "elevation_rate_rad_s", "azimuth_acceleration_rad_s2", "elevation_acceleration_rad_s2",
    )}  # fmt: skip
    points = Observations(
        station="gs1", band="X", pass_id=np.zeros(count, dtype=int), t_s=1e9 + np.arange(count),
        observed_azimuth_rad=column, observed_elevation_rad=column, true_azimuth_rad=column, true_elevation_rad=column,
        sigma_azimuth_rad=np.full(count, 1e-4), sigma_elevation_rad=np.full(count, 1e-4), **motion,
    ) if count else None  # fmt: skip
    page = write_campaign_report(tmp_path / "run", points, why).read_text()
    assert "BEACON 7" in page
    assert "&lt;not valid&gt;" in page
    assert f">{count}<" in page
    assert (tmp_path / "run" / "coverage.png").exists() is bool(count)
