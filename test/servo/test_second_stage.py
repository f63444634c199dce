"""The simulated second stage against closed forms."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rf_pointing.core.second_stage import SecondStageParams
from rf_pointing.servo.second_stage import StagePlant

PARAMS = SecondStageParams(travel_rad=1e-3, rate_rad_s=1.0, bandwidth_hz=5.0, latency_s=0.05)
POLE = 2.0 * math.pi * 5.0


def moved(params: SecondStageParams, wanted: tuple[float, float], steps: list[float]) -> np.ndarray:
    stage = StagePlant(params)
    stage.command(np.array(wanted))
    for step_s in steps:
        stage.step(step_s)
    return stage.deflection_rad


@given(st.lists(st.floats(1e-3, 0.05), min_size=1, max_size=12))
def test_a_step_is_an_exponential_after_the_latency_at_any_time_step(steps: list[float]) -> None:
    since_s = max(0.0, sum(steps) - 0.05)
    expected = np.array([4e-4, -2e-4]) * -math.expm1(-POLE * since_s)
    np.testing.assert_allclose(moved(PARAMS, (4e-4, -2e-4), steps), expected, rtol=1e-9, atol=1e-15)


@given(st.lists(st.floats(1e-3, 0.05), min_size=1, max_size=12))
def test_far_off_it_slews_at_its_rate_and_ends_in_the_exponential(steps: list[float]) -> None:
    rate = 5e-3
    since_s = max(0.0, sum(steps) - 0.05)
    slewing_s = (8e-4 - rate / POLE) / rate
    expected = rate * since_s
    if since_s > slewing_s:
        expected = 8e-4 - rate / POLE * math.exp(-POLE * (since_s - slewing_s))
    found = moved(PARAMS.replace(rate_rad_s=rate), (8e-4, 0.0), steps)
    assert found[0] == pytest.approx(expected, rel=1e-9, abs=1e-15)


def test_it_stops_at_the_end_of_its_travel() -> None:
    assert moved(PARAMS, (1.0, -1.0), [0.5] * 4).tolist() == pytest.approx([1e-3, -1e-3], rel=1e-9)


@given(st.lists(st.tuples(st.floats(-1e-3, 1e-3), st.floats(0.001, 0.2)), min_size=2, max_size=20))
def test_a_copied_state_goes_on_identically(commands: list[tuple[float, float]]) -> None:
    first, second = StagePlant(PARAMS), StagePlant(PARAMS)
    for wanted, step_s in commands[:1]:
        first.command(np.array([wanted, 0.0]))
        first.step(step_s)
    second.state = first.state
    for wanted, step_s in commands[1:]:
        for stage in (first, second):
            stage.command(np.array([wanted, -wanted]))
            stage.step(step_s)
    assert first.deflection_rad.tolist() == second.deflection_rad.tolist()
