"""The bare antenna moves as its plant does."""

from types import SimpleNamespace

import numpy as np
import pytest

from rf_pointing.core import random_stream
from rf_pointing.papers.bare_antenna import BareAntenna, LawsOnCommand
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


class Plant:
    """Stands in for a plant: notes how it is stepped."""

    def __init__(self) -> None:
        self.encoder_rad = np.array([0.3, 0.9])
        self.state = SimpleNamespace(x=np.zeros(8))
        self.steps: list[tuple[object, object, float]] = []

    def step(self, rates: object, wind: object, tick_s: float) -> None:
        self.steps.append((rates, wind, tick_s))


@pytest.mark.parametrize("known", [False, True])
def test_the_wind_meets_the_dish_at_its_attitude_or_else_where_the_encoders_say(known: bool) -> None:
    plant = Plant()
    wind = SimpleNamespace(step=lambda *asked: asked)
    attitude = (lambda k: (0.1 * k, 0.2)) if known else None
    antenna = BareAntenna(plant, wind, TICK_S, lambda k, encoder_rad: (k, *encoder_rad), attitude)
    assert antenna.step(7) == (7, 0.3, 0.9)
    met = (TICK_S, 0.1 * 7, 0.2) if known else (TICK_S, 0.3, 0.9)
    assert plant.steps == [((7, 0.3, 0.9), met, TICK_S)]


def test_settled_drives_and_laws_move_with_their_target() -> None:
    plant = Plant()
    resets: list[tuple[int, float, float, float, float]] = []
    laws = [SimpleNamespace(reset=lambda *given, axis=axis: resets.append((axis, *given))) for axis in (0, 1)]
    follower = LawsOnCommand(laws, TICK_S, lambda _: (np.zeros(2),) * 3)
    follower.settle(plant, np.array([0.3, 0.9]), np.array([1e-3, -2e-3]))
    assert plant.state.x.tolist() == [0.0, 0.0, 1e-3, -2e-3, 0.0, 0.0, 0.0, 0.0]
    assert resets == [(0, 0.3, 1e-3, 0.3, 1e-3), (1, 0.9, -2e-3, 0.9, -2e-3)]
