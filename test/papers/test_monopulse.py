"""The stable false lock of a uniform aperture."""

import numpy as np
import pytest

from rf_pointing.papers.monopulse import BEAM_RAD, false_lock_rad
from rf_pointing.rf import BeamParams, MonopulseFeed, MonopulseFeedParams


def test_the_planted_false_lock_attracts_in_every_direction_and_the_null_on_an_axis_does_not() -> None:
    feed, x = MonopulseFeed(MonopulseFeedParams(), BeamParams.for_band("Ka", "uniform")), false_lock_rad()

    def slopes(place: np.ndarray) -> np.ndarray:
        step = 1e-4 * BEAM_RAD
        columns = []
        for axis in np.eye(2):
            ends = [feed.voltages(*(place + sign * step * axis)) for sign in (1.0, -1.0)]
            ratios = [
                [(v.difference_cross_elevation / v.sum).real, (v.difference_elevation / v.sum).real] for v in ends
            ]
            columns.append((np.array(ratios[0]) - np.array(ratios[1])) / (2.0 * step) * BEAM_RAD / 1.57)
        return np.linalg.eigvalsh(np.array(columns).T)

    assert x / BEAM_RAD == pytest.approx(1.08, abs=0.005)
    assert slopes(np.array([x, x])) == pytest.approx([1.66, 9.3], abs=0.1)
    # Radially 10 times as steep as the main beam, but repelling across.
    assert slopes(np.array([1.396 * BEAM_RAD, 0.0])) == pytest.approx([-1.8, 10.3], abs=0.3)
