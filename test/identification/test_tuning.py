"""Loops from an identified response: their margins against closed forms, on planted axes."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rf_pointing.identification.model import StateSpace
from rf_pointing.identification.tuning import tuned_loop

TICK_S = 0.02


def axis(delays: int, lag_s: float = 0.0, gain: float = 1.0) -> StateSpace:
    """Return an integrator behind a first-order lag and whole samples of delay, sampled exactly."""
    decay = math.exp(-TICK_S / lag_s) if lag_s else 0.0
    size = delays + 2
    a, b = np.zeros((size, size)), np.zeros((size, 1))
    # States: the delay line, the rate behind the lag, the position.
    for k in range(1, delays):
        a[k, k - 1] = 1.0
    entry = delays - 1
    a[-2, -2] = decay
    a[-1, -2] = lag_s * (1.0 - decay) if lag_s else 0.0
    a[-1, -1] = 1.0
    through = TICK_S - (lag_s * (1.0 - decay) if lag_s else 0.0)
    if delays:
        b[0, 0] = gain
        a[-2, entry], a[-1, entry] = 1.0 - decay, through
    else:
        b[-2, 0], b[-1, 0] = gain * (1.0 - decay), gain * through
    return StateSpace(a, b, np.eye(1, size, size - 1), np.zeros((1, 1)), TICK_S)


@settings(deadline=None, max_examples=25)
@given(delays=st.integers(0, 20), lag_s=st.floats(0.02, 0.3))
def test_the_loop_has_its_margins_on_a_planted_axis(delays: int, lag_s: float) -> None:
    found = tuned_loop(axis(delays, lag_s))
    # The lag of a first-order lag, of the samples of delay, and of half a period of holding.
    assert found.lag_s == pytest.approx(lag_s + (delays + 0.5) * TICK_S, rel=0.02)
    assert found.integral_gain == pytest.approx(0.25 * found.proportional_gain**2)
    # Closed form of the open loop: C G = (k_p + k_i T / (z - 1)) z^-n G0(z).
    w = np.geomspace(1e-2, 0.999 * math.pi / TICK_S, 20000)
    z = np.exp(1j * w * TICK_S)
    decay = math.exp(-TICK_S / lag_s)
    g0 = (TICK_S - lag_s * (1 - decay)) / (z - 1) + lag_s * (1 - decay) * (1 - decay) / ((z - 1) * (z - decay))
    loop = (found.proportional_gain + found.integral_gain * TICK_S / (z - 1)) * z**-delays * g0
    assert np.max(1.0 / np.abs(1.0 + loop)) <= 2.01
    phase = np.unwrap(np.angle(loop))
    crossing = int(np.argmax(np.abs(loop) < 1.0))
    assert math.degrees(phase[crossing]) > -180.0 + 28.9
    turning = np.flatnonzero(phase[crossing:] <= -math.pi)
    if len(turning):
        assert np.abs(loop[crossing + turning[0]]) <= 0.505


def test_an_axis_that_moves_twice_as_fast_as_commanded_gets_half_the_gain() -> None:
    one, two = (tuned_loop(axis(4, 0.1, gain)).proportional_gain for gain in (1.0, 2.0))
    # A little more: the integral part goes with the square of the gain.
    assert 0.5 * one < two < 0.6 * one


def test_a_response_that_does_not_follow_is_refused() -> None:
    still = StateSpace(np.array([[0.9]]), np.array([[-0.1]]), np.eye(1), np.zeros((1, 1)), TICK_S)
    with pytest.raises(ValueError, match=r"no loop of this response is within \|S\| <= 2"):
        tuned_loop(still)
