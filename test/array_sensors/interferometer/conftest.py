"""Random relative poses off every symmetric point, and the report's worked example."""

import numpy as np
import pytest

from rf_pointing.array_sensors.interferometer.frames import attitude_from_euler, direction_from_angles
from rf_pointing.core import random_stream


@pytest.fixture
def rng() -> np.random.Generator:
    return random_stream(7, "interferometer tests")


@pytest.fixture
def poses(rng):
    """200 directions within 60 deg of boresight and attitudes within 60 deg of the same heading."""
    directions = direction_from_angles(*rng.uniform(-0.7, 0.7, (2, 200)))
    return directions, attitude_from_euler(*rng.uniform(-0.6, 0.6, (3, 200)))


@pytest.fixture
def worked_example():
    """Direction (30, 20) deg and attitude (10, -15, 25) deg: off every axis."""
    return direction_from_angles(*np.radians([30.0, 20.0])), attitude_from_euler(*np.radians([10.0, -15.0, 25.0]))
