"""Manual-rate mode: an experiment drives one axis, commands are refused meanwhile, and every end is a controlled stop."""

import math

import numpy as np
import pytest

from rf_pointing.controllers import CommandPreprocessorParams
from rf_pointing.core import MDEG, random_stream
from rf_pointing.identification import ExcitationParams, IdentificationExperiment
from rf_pointing.servo import dss13_plant
from rf_pointing.station.antenna.loops import LoopParams
from rf_pointing.station.antenna.simulated_antenna import SimulatedAntenna

TICK_S = 0.02
PARAMS = ExcitationParams(samples=256)


def antenna() -> SimulatedAntenna:
    made = SimulatedAntenna()
    made.enable()
    return made


def experiment(made: SimulatedAntenna, sequences: int = 2, **changes: object) -> IdentificationExperiment:
    start = float(made.reading(0.0).position_rad[1])
    options = {
        "params": PARAMS, "axis": "elevation", "sequences": sequences, "start_rad": start,
        "travel_rad": made.axes.travel_rad[1], "random": random_stream(1, "excitation"),
    }  # fmt: skip
    return IdentificationExperiment(**(options | changes))


def run(made: SimulatedAntenna, ticks: int, start: int = 0) -> int:
    for tick in range(start, start + ticks):
        made.step(round(1e9 + tick * TICK_S, 6))
    return start + ticks


def test_the_experiment_commands_the_rates_and_records_the_encoders() -> None:
    made = antenna()
    tick = run(made, 50)
    running = experiment(made)
    assert made.identify(running) == ""
    assert made.mode == "manual_rate"
    for _ in range(512):
        before = made.reading(0.0).position_rad
        tick = run(made, 1, tick)
        rate, position, _ = running.newest
        np.testing.assert_array_equal(position, before)
        np.testing.assert_array_equal(made.status(0.0).rate_command_rad_s, rate)
        assert rate[0] == 0.0
    assert running.finished
    assert running.recording().input_rad_s.shape == (2, 256)


def test_the_end_of_the_experiment_is_a_controlled_stop_without_a_jump() -> None:
    made = antenna()
    running = experiment(made, 1, params=PARAMS.replace(mean_rad_s=math.radians(0.15), rms_rad_s=math.radians(0.01)))
    made.identify(running)
    tick = run(made, 256)
    given = made.status(0.0).rate_command_rad_s[1]
    tick = run(made, 1, tick)
    assert made.mode == "stopping"
    limit = CommandPreprocessorParams().acceleration_limit_rad_s2[1]
    # The first command of the loops may differ from the last manual one by what the stop asks for, and by the noise.
    assert abs(made.status(0.0).rate_command_rad_s[1] - given) < 3.0 * limit * TICK_S
    tick = run(made, 250, tick)
    assert made.mode == "holding"
    assert made.status(0.0).fault == ""
    rest = made.reading(0.0).position_rad
    run(made, 250, tick)
    np.testing.assert_allclose(made.reading(0.0).position_rad, rest, atol=2.0 * MDEG)


@pytest.mark.parametrize(("reason", "after"), [("stop was requested", "fault"), ("", "holding")])
def test_a_stop_aborts_it(reason: str, after: str) -> None:
    made = antenna()
    running = experiment(made)
    made.identify(running)
    tick = run(made, 100)
    made.stop(reason)
    assert running.abort_reason == "stop was requested"
    assert made.mode == "stopping"
    run(made, 250, tick)
    assert made.mode == after


def test_an_abort_from_outside_ends_it_at_the_next_tick() -> None:
    made = antenna()
    running = experiment(made)
    made.identify(running)
    tick = run(made, 100)
    running.abort("the goal was cancelled")
    run(made, 250, tick)
    assert made.mode == "holding"
    assert running.samples_taken == 100


def test_deactivation_ends_it_with_the_brakes_set() -> None:
    made = antenna()
    running = experiment(made)
    made.identify(running)
    run(made, 100)
    made.deactivate()
    assert made.mode == "inactive"
    assert running.abort_reason != ""


def test_another_sampling_time_and_too_large_a_rate_are_refused() -> None:
    made = antenna()
    assert "sample_s=0.01 must be 0.02" in made.identify(experiment(made, params=PARAMS.replace(sample_s=0.01)))
    slow = math.radians(0.05)
    made.retune(dss13_plant(), LoopParams(preprocessor=CommandPreprocessorParams(rate_limit_rad_s=(slow, slow))))
    assert "the rate limit" in made.identify(experiment(made))
    assert made.mode == "holding"
