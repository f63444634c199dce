"""From one path to another without a step, within the acceleration."""

import numpy as np
import pytest

from rf_pointing.core import MDEG
from rf_pointing.station.pointing.transition import OffsetTransition

ACCELERATION = 400 * MDEG
TIMES = 100.0 + np.arange(0.0, 6.0, 0.01)


@pytest.mark.parametrize(
    ("right", "up", "rate"), [(200.0, -50.0, 150.0), (150.0, 120.0, 30.0), (0.0, 0.0, 80.0), (3.0, 1.0, 0.0)]
)
def test_it_starts_as_given_ends_at_rest_and_stays_within_the_acceleration(
    right: float, up: float, rate: float
) -> None:
    offset, speed = np.array([right, up]) * MDEG, np.array([0.6, 0.8]) * rate * MDEG
    blend = OffsetTransition.within(100.0, offset, speed, ACCELERATION)
    position, velocity = blend.at(TIMES)
    np.testing.assert_allclose(position[0], offset, atol=1e-12)
    np.testing.assert_allclose(velocity[0], speed, atol=1e-12)
    np.testing.assert_allclose(position[-1], [0.0, 0.0], atol=1e-15)
    acceleration = np.diff(velocity, axis=0) / 0.01
    assert float(np.max(np.hypot(*acceleration.T))) <= 1.01 * ACCELERATION


def test_nothing_left_over_is_nothing_added() -> None:
    position, velocity = OffsetTransition().at(TIMES)
    assert not position.any()
    assert not velocity.any()
