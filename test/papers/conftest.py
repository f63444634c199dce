"""Random numbers and the worked example of test/array_sensors/interferometer serve here too."""

from test.array_sensors.interferometer.conftest import rng, worked_example

__all__ = ["rng", "worked_example"]
