"""Averaging of a cluster: its closed form against a direct sum."""

import math

import numpy as np
import pytest

from rf_pointing.papers.servo_noise import averaging_gain


@pytest.mark.parametrize("cut_off_hz", [0.0, 3.0, 8.0, 14.0])
def test_averaging_gain_is_one_over_the_mean_of_the_squared_kernel(cut_off_hz: float) -> None:
    x = math.pi * 0.02 * (cut_off_hz + (25.0 - cut_off_hz) * (np.arange(200_000) + 0.5) / 200_000)
    passed = np.mean((np.sin(5.0 * x) / (5.0 * np.sin(x))) ** 2)
    assert averaging_gain(cut_off_hz) == pytest.approx(1.0 / passed, rel=1e-6)
