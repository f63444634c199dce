"""The bare antenna moves as its plant does."""

import numpy as np

from rf_pointing.core import random_stream
from rf_pointing.papers.bare_antenna import BareAntenna
from rf_pointing.servo import AntennaPlant, Wind, WindParams, dss13_plant
from rf_pointing.simulation.closed_loop import ticks

TICK_S = 0.02


def test_a_bare_antenna_turns_at_the_rates_that_it_is_given() -> None:
    plant = AntennaPlant(dss13_plant(ideal=True), random_stream(1, "encoder"), (0.3, 0.9))
    wind = Wind(WindParams(), random_stream(1, "wind"))
    antenna = BareAntenna(plant, wind, TICK_S, lambda k, _encoder_rad: (1e-3 if k < 100 else 0.0, 0.0))
    for _ in ticks(antenna, 500):
        pass
    np.testing.assert_allclose(plant.true_joint_rad, (0.3 + 100 * TICK_S * 1e-3, 0.9), atol=2e-5)
