import math

import numpy as np
import pytest

from rf_pointing.calibration import Ionosphere
from rf_pointing.core import MDEG

S_BAND = Ionosphere(electrons_per_m2=5e17, frequency_hz=2.25e9)


def test_vertical_delay_is_403_tec_over_frequency_squared():
    assert float(S_BAND.delay_m(np.array(math.pi / 2.0))) == pytest.approx(40.3 * 5e17 / 2.25e9**2)


def test_bending_is_the_slope_of_the_delay_seen_from_a_moved_station():
    elevation, distance, step = np.array([0.2, 0.5, 1.0]), np.array([2.2e6, 1.4e6, 9e5]), 1e-5
    slope = (S_BAND.delay_m(elevation + step) - S_BAND.delay_m(elevation - step)) / (2.0 * step)
    expected = -slope * (1.0 / distance + 1.0 / (6.371e6 * np.sin(elevation)))
    assert S_BAND.bending(elevation, distance) == pytest.approx(expected, rel=1e-7)


def test_ionosphere_at_10_deg_bends_s_band_upward_by_a_few_millidegrees_at_most():
    bending = float(S_BAND.bending(np.array(math.radians(10.0)), np.array(2.4e6))) / MDEG
    assert 0.5 < bending < 5.0
