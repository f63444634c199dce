"""Passes on a grid, in closed form: a dip below the mask between two grid points separates two passes."""

import numpy as np
import pytest

from rf_pointing.ephemeris.grid_passes import MARGIN, SampledSky, passes_on_grid

STEP_S, COUNT = 60.0, 24
MIDDLE_S = STEP_S * (COUNT / 2 + 0.5)
"""Half way between two grid points."""
SINE_MASK, DIP_S, OUTER_S = 0.1, 20.0, 600.0
RANGE_M = 2e6


def sky() -> SampledSky:
    """One object whose sine of elevation is above the mask between 20 and 600 s on both sides of the middle."""
    x = STEP_S * np.arange(-MARGIN, COUNT + MARGIN + 1) - MIDDLE_S
    sine = SINE_MASK + 4e-13 * (x**2 - DIP_S**2) * (OUTER_S**2 - x**2)
    enu = RANGE_M * np.column_stack([np.zeros_like(x), np.sqrt(1.0 - sine**2), sine])
    return SampledSky(enu[None], 0.0, STEP_S)


def test_a_dip_between_two_grid_points_separates_two_passes() -> None:
    found = passes_on_grid(sky(), np.array([True]), STEP_S * COUNT, SINE_MASK)
    order = np.argsort(found.aos_s)
    assert not found.rises_before.any()
    assert not found.sets_after.any()
    peak_s = np.sqrt(0.5 * (DIP_S**2 + OUTER_S**2))
    assert found.aos_s[order] - MIDDLE_S == pytest.approx([-OUTER_S, DIP_S], abs=0.02)
    assert found.los_s[order] - MIDDLE_S == pytest.approx([-DIP_S, OUTER_S], abs=0.02)
    assert found.tca_s[order] - MIDDLE_S == pytest.approx([-peak_s, peak_s], abs=0.1)
