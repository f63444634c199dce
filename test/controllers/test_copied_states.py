"""Laws, wind and plant keep all that they remember in their states: one that is given another's goes on as that."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from rf_pointing import controllers
from rf_pointing.core import random_stream
from rf_pointing.servo import AntennaPlant, Wind, WindParams, dss13_plant
from test.controllers.test_trajectory_buffer import message

LQG, _ = controllers.load_lqg_designs()
LATE = dss13_plant().replace(azimuth=dss13_plant().azimuth.replace(drive_delay_s=0.03))


def loop_step(loop: Any, _t_s: float, row: np.ndarray) -> Any:
    command = loop.output(*row)
    loop.update(0.02, 0.9 * command)
    return command, str(loop.state)


def integrator_step(tracker: controllers.TrackerIntegrator, t_s: float, row: np.ndarray) -> Any:
    tracker.update(t_s, row[:2])
    return tracker.at(t_s + 0.05)


def plant_step(antenna: AntennaPlant, _t_s: float, row: np.ndarray) -> Any:
    antenna.step(row[:2], 5e7 * row[1:], 0.0207)
    return antenna.encoder_rad, antenna.state.x[:2]


STEPS: dict[str, tuple[Callable[[], Any], Callable[[Any, float, np.ndarray], Any]]] = {
    "position loop": (lambda: controllers.PositionLoop(controllers.PositionLoopParams()), loop_step),
    "LQG loop": (lambda: controllers.LqgLoop(LQG, controllers.LqgLoopParams()), loop_step),
    "tracker integrator": (
        lambda: controllers.TrackerIntegrator(controllers.TrackerIntegratorParams()),
        integrator_step,
    ),
    "oscillation detector": (
        lambda: controllers.OscillationDetector(controllers.OscillationDetectorParams()),
        lambda one, t_s, _: (one.update(7e-4 * math.sin(2.5 * t_s), 0.02), repr(one.state)),
    ),
    "preprocessor": (
        lambda: controllers.CommandPreprocessor(controllers.CommandPreprocessorParams()),
        lambda one, _, row: one.step((0.4, 0.9), row[:2], (0.0, 0.0), 0.02),
    ),
    "trajectory buffer": (
        lambda: controllers.TrajectoryBuffer(controllers.TrajectoryBufferParams()),
        lambda one, t_s, _: (one.accept(message(t_s, t_s + 1.0), t_s), one.at(t_s - 0.05).position_rad),
    ),
    "wind": (
        lambda: Wind(WindParams(mean_speed_m_s=8.0), random_stream(5, "wind")),
        lambda one, *_: one.step(0.017, 0.3, 0.7),
    ),
    "plant": (lambda: AntennaPlant(LATE, random_stream(99, "plant")), plant_step),
}


@pytest.mark.parametrize("name", STEPS)
def test_what_is_given_the_state_of_another_continues_as_that(name: str, random: np.random.Generator) -> None:
    make, step = STEPS[name]
    rows, first, second = 1e-3 * random.standard_normal((80, 3)), make(), make()
    for k in range(40):
        step(first, 0.1 * k, rows[k])
    second.state = first.state
    for k in range(40, 80):
        for mine, other in zip(step(first, 0.1 * k, rows[k]), step(second, 0.1 * k, rows[k]), strict=True):
            np.testing.assert_array_equal(mine, other)
