"""Spin period from a record of carrier power."""

import math

import numpy as np
import pytest

from rf_pointing.core import random_stream
from rf_pointing.tracking import spin_period_s


@pytest.mark.parametrize("period_s", [4.7, 11.3, 29.0])
def test_planted_period_is_found_in_noise_and_uneven_times(period_s: float) -> None:
    rng = random_stream(2, "spin")
    t_s = np.sort(rng.uniform(0.0, 200.0, 300))
    power = 5.0 * (1.0 + 0.1 * np.cos(2.0 * math.pi * t_s / period_s + 0.9)) + 0.2 * rng.standard_normal(300)
    found, share = spin_period_s(t_s, power, 2.0, 60.0)
    # Cramér-Rao: sigma_f = sqrt(6 / N) / (pi T) noise/amplitude = 1e-4 Hz.
    assert 1.0 / found == pytest.approx(1.0 / period_s, abs=5e-4)
    assert share == pytest.approx(0.125 / (0.125 + 0.04), abs=0.12)


def test_noise_alone_explains_almost_nothing() -> None:
    rng = random_stream(3, "spin")
    _, share = spin_period_s(np.arange(200.0), 1.0 + 0.1 * rng.standard_normal(200), 4.0, 60.0)
    assert share < 0.12


def test_record_shorter_than_the_longest_period_is_refused() -> None:
    with pytest.raises(ValueError, match=r"longest_s=30.0 must be <= 19.0"):
        spin_period_s(np.arange(20.0), np.ones(20), 4.0, 30.0)
