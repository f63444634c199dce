"""A planted spin comes out with an honest sigma, and noise has none."""

import numpy as np
import pytest

from rf_pointing.receiver.spin import Spin, SpinWatch

PERIOD_S = 0.1


def estimated(frequency_hz: float, depth: float, noise: float, seed: int) -> Spin | None:
    """Return the spin in powers that rise and fall as in a pass, too."""
    rng, watch = np.random.default_rng(seed), SpinWatch()
    phase = rng.uniform(0.0, 2.0 * np.pi)
    for t_s in 1e9 + PERIOD_S * np.arange(600):
        trend = 1e-12 * (1.0 + 0.5 * np.sin((t_s - 1e9) / 60.0))
        turning = 1.0 + depth * np.cos(2.0 * np.pi * frequency_hz * (t_s - 1e9) + phase)
        watch.take(float(t_s), float(trend * turning * (1.0 + noise * rng.standard_normal())))
    return watch.estimate()


@pytest.mark.parametrize(
    ("frequency_hz", "depth", "noise"), [(0.08, 0.1, 0.1), (0.31, 0.4, 0.05), (1.7, 0.4, 0.05), (4.2, 0.1, 0.1)]
)
def test_a_spin_is_found_with_its_sigma(frequency_hz: float, depth: float, noise: float) -> None:
    found = [estimated(frequency_hz, depth, noise, seed) for seed in range(20)]
    off = np.array([(each.frequency_hz - frequency_hz) / each.sigma_hz for each in found])
    assert abs(np.mean(off)) < 0.7
    assert 0.6 < np.std(off) < 1.5
    assert np.mean([each.depth for each in found]) == pytest.approx(depth, rel=0.1)


def test_noise_has_no_spin() -> None:
    # One of 100 or none of 62 shows the same share, 4.7 %, at 95 %.
    assert not any(estimated(1.0, 0.0, 0.2, seed) for seed in range(62))
