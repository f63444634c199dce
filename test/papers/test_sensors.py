"""The sensors of `track` on the simulated station, the first minute of a pass each: found, held, and said so."""

import numpy as np
import pytest

from rf_pointing.core import MDEG
from rf_pointing.papers.autotrack_cases import acquired_s
from rf_pointing.papers.sensors import REQUIRED_MDEG, tracked
from rf_pointing.simulation import PassLog

SECONDS = 55.0


@pytest.mark.parametrize(("band", "sensor"), [("Ka", "conscan"), ("Ka", "steptrack"), ("X", "conscan")])
def test_a_scanning_sensor_holds_the_beam_within_what_the_dsn_asks(band: str, sensor: str) -> None:
    found = tracked(band, sensor, seconds=SECONDS)
    assert found.acquired_s < 30.0
    assert found.share == 1.0
    assert found.modes == (sensor,)
    assert found.beam_rad < REQUIRED_MDEG[band] * MDEG
    assert found.centre_rad < found.beam_rad


def test_acquired_is_the_time_from_which_the_error_stays_small() -> None:
    log = PassLog(
        t_s=[0.0, 1.0, 2.0, 3.0, 4.0],
        cross_elevation_rad=[5.0, 0.5, 5.0, 0.5, 0.5],
        elevation_rad=[0.0] * 5,
        mode=["search", "monopulse", "monopulse", "monopulse", "monopulse"],
    )
    assert acquired_s(log, 1.0) == 3.0
    assert acquired_s(log, 10.0) == 1.0
    log.mode[-1] = "coast"
    assert acquired_s(log, 1.0) == np.inf
