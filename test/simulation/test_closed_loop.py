"""The time loop: what the caller changes between two ticks is in force in the next one."""

import numpy as np

from rf_pointing.core import random_stream
from rf_pointing.servo import AntennaPlant, Wind, WindParams, dss13_plant
from rf_pointing.simulation.closed_loop import BareAntenna, ticks

TICK_S = 0.02


class Counted:
    """Returns what it was last given, and keeps the ticks that it was moved through."""

    def __init__(self) -> None:
        self.given, self.moved = 0, []

    def step(self, k: int) -> int:
        self.moved.append(k)
        return self.given


def test_a_change_between_two_ticks_acts_in_the_next() -> None:
    antenna, seen = Counted(), []
    for k, output in ticks(antenna, 3, first=5):
        seen.append((k, output))
        antenna.given = 10 * k
    assert seen == [(5, 0), (6, 50), (7, 60)]


def test_no_tick_is_moved_through_before_it_is_asked_for_and_without_count_the_caller_ends_the_loop() -> None:
    antenna = Counted()
    loop = ticks(antenna)
    assert antenna.moved == []
    for k, _ in loop:
        if k == 4:
            break
    assert antenna.moved == [0, 1, 2, 3, 4]


def test_a_bare_antenna_turns_at_the_rates_that_it_is_given() -> None:
    plant = AntennaPlant(dss13_plant(ideal=True), random_stream(1, "encoder"), (0.3, 0.9))
    wind = Wind(WindParams(), random_stream(1, "wind"))
    antenna = BareAntenna(plant, wind, TICK_S, lambda k, _encoder_rad: (1e-3 if k < 100 else 0.0, 0.0))
    for _ in ticks(antenna, 500):
        pass
    np.testing.assert_allclose(plant.true_joint_rad, (0.3 + 100 * TICK_S * 1e-3, 0.9), atol=2e-5)
