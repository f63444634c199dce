"""What the autotrack rows measure, on logs of no flight: flips, hold-offs, acquisitions, dropouts, averaging."""

import math

import numpy as np
import pytest

from rf_pointing.core import MDEG
from rf_pointing.papers import autotrack
from rf_pointing.papers.autotrack_cases import (
    command_accelerations_rad_s2,
    reacquisitions_s,
)
from rf_pointing.simulation import PassLog

START_S = 995.0


def log_of(modes: list[str], errors_rad: list[float] | None = None, step_s: float = 0.5) -> PassLog:
    """Return a log with these modes, one a step, and errors whose components are as 3 to 4."""
    size = np.zeros(len(modes)) if errors_rad is None else np.array(errors_rad)
    return PassLog(
        t_s=[START_S + step_s * k for k in range(len(modes))],
        cross_elevation_rad=(0.6 * size).tolist(),
        elevation_rad=(0.8 * size).tolist(),
        mode=list(modes),
        carrier_to_noise_db_hz=[45.0] * len(modes),
        command_t_s=[START_S + 0.1 * k for k in range(6)],
        command_rad=[(1e-4 * k**2, 5e-5 * k**3) for k in range(6)],
    )


def test_radial_rms_counts_one_mode_from_a_time_on() -> None:
    log = log_of(["monopulse", "coast", "monopulse", "monopulse"], [9.0 * MDEG, 5.0 * MDEG, 3.0 * MDEG, 4.0 * MDEG])
    assert autotrack.radial_rms_mdeg(log, "monopulse", START_S + 1.0) == pytest.approx(math.sqrt(12.5))
    assert autotrack.radial_rms_mdeg(log, "coast", 0.0) == pytest.approx(5.0)
    assert autotrack.radial_rms_mdeg(log, "conscan", 0.0) == math.inf


def test_reacquisition_counts_from_the_return_of_the_carrier_to_the_mode() -> None:
    log = log_of(["monopulse"] * 3 + ["coast"] * 5 + ["monopulse"] * 4)
    log.carrier_to_noise_db_hz[4:6] = [0.0, -3.0]
    log.carrier_to_noise_db_hz[10:11] = [0.0]
    # Back at the 6th step, tracked at the 8th; then back at the 11th in the mode itself.
    assert reacquisitions_s(log, "monopulse").tolist() == [pytest.approx(1.0), 0.0]
    assert reacquisitions_s(log, "conscan").tolist() == [math.inf, math.inf]


def test_command_accelerations_are_second_differences_after_a_time() -> None:
    log = log_of(["monopulse"])
    found = command_accelerations_rad_s2(log, START_S + 0.15)
    # 1e-4 k^2 and 5e-5 k^3 a tenth of a second apart, from the second inner command on.
    assert found == pytest.approx(np.column_stack([[0.02] * 3, 0.03 * np.array([2.0, 3.0, 4.0])]))
