"""The sensors of `track` on the simulated station, the first minute of a pass each: found, held, and said so."""

import pytest

from rf_pointing.core import MDEG
from rf_pointing.papers.sensors import REQUIRED_MDEG, tracked

SECONDS = 55.0


@pytest.mark.parametrize(("band", "sensor"), [("Ka", "conscan"), ("Ka", "steptrack"), ("X", "conscan")])
def test_a_scanning_sensor_holds_the_beam_within_what_the_dsn_asks(band: str, sensor: str) -> None:
    found = tracked(band, sensor, seconds=SECONDS)
    assert found.acquired_s < 30.0
    assert found.share == 1.0
    assert found.modes == (sensor,)
    assert found.beam_rad < REQUIRED_MDEG[band] * MDEG
    assert found.centre_rad < found.beam_rad
