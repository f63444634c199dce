"""What a crossing costs, in closed form: an error that grows and falls in straight lines."""

import math

import numpy as np
import pytest

from rf_pointing.planning.crossing import Crossing
from rf_pointing.planning.loss import PassLoss

BEAM_RAD = 0.001
RISE_S, PEAK_RAD = 20.0, 0.002


def gain(error: np.ndarray) -> np.ndarray:
    return np.exp(-4.0 * math.log(2.0) * (error / BEAM_RAD) ** 2)


def test_a_triangle_of_error_has_the_loss_of_its_integrals() -> None:
    t = np.arange(0.0, 2.0 * RISE_S + 1e-9, 0.01)
    error = PEAK_RAD * (1.0 - np.abs(t / RISE_S - 1.0))
    still = np.zeros((len(t), 2))
    loss = PassLoss.of(Crossing(t, still, still, still, error), 400.0, gain)
    assert loss.off_s == pytest.approx(2.0 * RISE_S * 0.95, abs=0.03)
    # 3 dB where exp(-4 ln 2 x^2) = 10^-0.3: at x = 0.4991 beamwidths, a quarter of the peak.
    assert loss.below_s == pytest.approx(2.0 * RISE_S * (1.0 - 0.49912 * BEAM_RAD / PEAK_RAD), abs=0.03)
    received_s = 2.0 * RISE_S * BEAM_RAD / PEAK_RAD * 0.5 * math.sqrt(math.pi / (4.0 * math.log(2.0)))
    assert loss.signal_s == pytest.approx(2.0 * RISE_S - received_s, abs=0.01)
    assert loss.peak_db == pytest.approx(40.0 * math.log10(2.0) * (PEAK_RAD / BEAM_RAD) ** 2, abs=1e-6)
    assert loss.mean_db == pytest.approx(-10.0 * math.log10(1.0 - loss.signal_s / 400.0))


def test_without_a_crossing_nothing_is_lost() -> None:
    assert PassLoss.of(None, 600.0, gain) == PassLoss(0.0, 0.0, 0.0, 0.0, 0.0)
