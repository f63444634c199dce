"""The position loop alone: its terms, its limits, its changes of mode."""

import cmath
import math
from dataclasses import replace

import numpy as np
import pytest

from rf_pointing.controllers import PositionLoop, PositionLoopParams, dss13_loops, dss13_lqg_loops, load_lqg_designs
from rf_pointing.controllers.filters import Section, SectionParams

PLAIN = PositionLoopParams(notch_enabled=False)


def test_settled_output_is_proportional_plus_integral_plus_rate() -> None:
    loop = PositionLoop(PLAIN)
    loop.reset(0.0, 2e-3, 0.0, 2e-3)
    loop.update(0.02, loop.output(0.0, 2e-3, 0.0))
    for _ in range(50):
        loop.update(0.02, loop.output(1.0 + 1e-4, 2e-3, 1.0))
    assert loop.output(1.0 + 1e-4, 2e-3, 1.0) == pytest.approx(2e-3 + 0.5e-4 + 1.8 * 50 * 0.02 * 1e-4, rel=1e-9)


def test_feedforward_rises_with_the_band_limit() -> None:
    loop = PositionLoop(PLAIN.replace(feedforward_band_hz=1.0))
    outputs = []
    for _ in range(100):
        outputs.append(loop.output(0.0, 1e-3, 0.0))
        loop.update(0.02, outputs[-1])
    time = 0.02 * np.arange(100) + 0.01
    np.testing.assert_allclose(outputs, 1e-3 * (1.0 - np.exp(-2.0 * math.pi * time)), atol=1e-3 * 0.01)


def test_acceleration_is_fed_forward_by_the_lead() -> None:
    loop = PositionLoop(PLAIN.replace(feedforward_lead_s=0.066))
    loop.reset(0.0, 0.066 * 1e-3, 0.0, 0.066 * 1e-3)
    assert loop.output(0.0, 0.0, 0.0, acceleration_rad_s2=1e-3) == pytest.approx(0.066e-3, rel=1e-9)


def test_output_stays_within_the_rate_limit() -> None:
    loop = PositionLoop(PLAIN.replace(rate_limit_rad_s=0.01))
    assert loop.output(1.0, 0.0, 0.0) == 0.01
    assert loop.output(-1.0, 0.0, 0.0) == -0.01


def test_integral_does_not_wind_up_while_the_drive_is_saturated() -> None:
    loop = PositionLoop(PLAIN.replace(rate_limit_rad_s=0.01))
    for _ in range(2000):
        loop.update(0.02, loop.output(0.5, 0.0, 0.0))
    assert 1.8 * loop.state.integral_rad_s == pytest.approx(0.01, rel=1e-6)
    assert loop.output(-1e-3, 0.0, 0.0) < 0.01


@pytest.mark.parametrize("params", [PLAIN, PositionLoopParams(), PositionLoopParams(shaping_enabled=True)])
def test_reset_makes_the_next_output_the_given_command(params: PositionLoopParams) -> None:
    loop = PositionLoop(params)
    loop.reset(0.3, 4e-3, 0.2999, 6.5e-3)
    assert loop.output(0.3, 4e-3, 0.2999) == pytest.approx(6.5e-3, abs=1e-15)


@pytest.mark.parametrize(
    "changes",
    [
        {"proportional_gain": 0.9},
        {"integral_gain": 0.7},
        {"feedforward_gain": 0.0},
        {"notch_damping": 0.3},
        {"notch_frequency_hz": 2.3},
    ],
)
def test_retuning_in_steady_motion_makes_no_jump(changes: dict[str, float]) -> None:
    loop = PositionLoop(PositionLoopParams())
    loop.reset(0.3, 4e-3, 0.2999, 6.5e-3)
    command = loop.output(0.3, 4e-3, 0.2999)
    loop.retune(loop.params.replace(**changes))
    assert loop.output(0.3, 4e-3, 0.2999) == pytest.approx(command, abs=1e-15)


def test_an_impossible_retune_leaves_everything_as_it_was() -> None:
    loop = PositionLoop(PositionLoopParams())
    before = loop.params
    with pytest.raises(ValueError, match=r"zero_hz=26\.0 must be < 25\.0"):
        loop.retune(before.replace(notch_frequency_hz=26.0, proportional_gain=0.9))
    assert loop.params is before


def test_a_copied_state_does_not_follow_the_loop() -> None:
    loop = PositionLoop(PositionLoopParams())
    kept = loop.state
    reference = replace(kept, filters=tuple(map(replace, kept.filters)))
    loop.update(0.02, loop.output(1e-3, 0.0, 0.0))
    assert kept == reference


def test_gains_that_the_drive_cannot_follow_are_refused() -> None:
    with pytest.raises(ValueError, match=r"proportional_gain=0\.1 must be > 0\.1621 .*would be unstable"):
        PositionLoopParams(proportional_gain=0.1)


def test_the_refused_gains_are_those_that_make_the_lagging_loop_unstable() -> None:
    """Poles of lag s^3 + s^2 + k_p s + k_i on both sides of the bound."""
    for factor, stable in ((0.99, False), (1.01, True)):
        gain = factor * 1.8 * 0.06
        poles = np.roots([0.06, 1.0, gain, 1.8])
        assert (np.max(poles.real) < 0.0) == stable
        if stable:
            PLAIN.replace(proportional_gain=gain)
        else:
            with pytest.raises(ValueError, match="must be >"):
                PLAIN.replace(proportional_gain=gain)


def test_shaping_acts_on_the_feedback_and_not_on_the_feedforward() -> None:
    shaped = PLAIN.replace(shaping_enabled=True, integral_gain=0.0, feedforward_band_hz=100.0)
    section, loop = Section(shaped.shaping), PositionLoop(shaped)
    reference = PositionLoop(shaped.replace(shaping_enabled=False, proportional_gain=0.0))
    for error in 1e-3 * np.random.default_rng(2).standard_normal(40):
        expected = section.output(0.5 * error) + reference.output(error, 2e-3, 0.0)
        assert loop.output(error, 2e-3, 0.0) == pytest.approx(expected, abs=1e-15)
        for part in (loop, reference):
            part.update(0.02, part.state.command_rad_s)
        section.update(0.02)


def delay_s(section: SectionParams) -> float:
    """Delay of a section at low frequencies, from the phase of its transfer function."""
    s, zero, pole = 1e-3j, 2.0 * math.pi * section.zero_hz, 2.0 * math.pi * section.pole_hz
    above = s**2 / zero**2 + 2.0 * section.zero_damping * s / zero + 1.0
    below = s**2 / pole**2 + 2.0 * section.pole_damping * s / pole + 1.0
    return -cmath.phase(above / below) / 1e-3


@pytest.mark.parametrize("params", [PLAIN, PositionLoopParams(shaping_enabled=True)])
def test_the_matrices_of_the_loop_are_those_of_the_running_one(params: PositionLoopParams) -> None:
    a, b, c, d = params.matrices(0.02)
    loop, state = PositionLoop(params), np.zeros(len(a))
    for error in 1e-3 * np.random.default_rng(7).standard_normal(60):
        command = loop.output(error, 0.0, 0.0)
        assert command == pytest.approx((c @ state + d[0] * error).item(), abs=1e-14)
        loop.update(0.02, command)
        state = a @ state + b[:, 0] * error


def test_what_is_no_number_is_refused_wherever_it_enters() -> None:
    loop = PositionLoop(PLAIN)
    for attempt, words in (
        (lambda: loop.reset(math.nan, 0.0, 0.0, 0.0), "position_rad"),
        (lambda: loop.reset(0.0, 0.0, math.nan, 0.0), "measured_rad"),
        (lambda: loop.output(0.0, 0.0, 0.0, math.nan), "acceleration_rad_s2"),
        (lambda: loop.update(0.02, math.nan), "applied_rad_s"),
        (lambda: loop.update(0.99e-5, 0.0), "dt_s"),
        (lambda: loop.update(1.01, 0.0), "dt_s"),
    ):
        with pytest.raises(ValueError, match=words):
            attempt()
    for usual_s in (1e-5, 1.0):
        loop.update(usual_s, 0.0)


def test_tuned_loops_lead_by_the_delay_of_drive_low_pass_and_notch() -> None:
    """A drive of 20 rad/s, half a sample of 20 ms, a low-pass of 10 Hz, and the notch by its phase."""
    tuned = dss13_loops("tuned")
    for loop in tuned:
        assert loop.feedforward_lead_s == pytest.approx(0.06 + 0.5 / (10.0 * math.pi) + delay_s(loop.notch), rel=1e-5)
    for each, loop in zip(load_lqg_designs(), dss13_lqg_loops(), strict=True):
        expected = 0.06 + 0.5 / (10.0 * math.pi) + delay_s(each.weights.notch)
        assert loop.feedforward_lead_s == pytest.approx(expected, rel=1e-5)
    assert tuned[0].proportional_gain > tuned[1].proportional_gain > 5.0
    assert dss13_loops("published") == (PositionLoopParams(), PositionLoopParams())
    with pytest.raises(ValueError, match="gains='other' must be one of published, tuned"):
        dss13_loops("other")
