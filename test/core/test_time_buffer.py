"""Where the beam was from a commanded direction, interpolated between two streams."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rf_pointing.core import JointReading, sky_offset_rad
from rf_pointing.core.signals import KEPT_S, BeamPosition, TimeBuffer

CENTRE = np.array([1.0, 0.8])


def reading(t_s: float, away: tuple[float, float]) -> JointReading:
    return JointReading(t_s=t_s, position_rad=CENTRE + np.array(away), velocity_rad_s=np.zeros(2))


def test_the_offset_is_on_the_sky_and_linear_between_readings() -> None:
    beam = BeamPosition()
    for t_s, share in ((0.0, 0.0), (1.0, 1.0)):
        beam.take_joints(reading(t_s, (0.004 * share, -0.002 * share)))
        beam.take_centre(t_s, CENTRE)
    offset = beam.offset(0.25)
    assert offset is not None
    np.testing.assert_allclose(offset, [0.001 * math.cos(0.8 - 0.0005), -0.0005], atol=1e-12)


def test_an_instant_known_on_one_side_only_is_not_answered() -> None:
    beam = BeamPosition()
    assert beam.offset(0.0) is None
    beam.take_joints(reading(0.0, (0.0, 0.0)))
    beam.take_joints(reading(1.0, (0.0, 0.0)))
    beam.take_centre(0.5, CENTRE)
    assert beam.offset(0.4) is None
    assert beam.offset(0.6) is None
    assert beam.offset(0.5) is not None
    assert beam.offset(1.1) is None


@given(st.lists(st.tuples(st.integers(-4, 6), st.floats(-9.0, 9.0)), min_size=1, max_size=12), st.floats(-0.2, 1.2))
def test_a_buffer_is_linear_over_what_it_keeps(rows: list[tuple[int, float]], share: float) -> None:
    """It keeps two seconds; a step back in time forgets what was known, and nothing is known outside."""
    buffer, kept, t_s = TimeBuffer(), list[tuple[float, float]](), 0.0
    assert buffer.at(t_s) is None
    for quarters, value in rows:
        t_s += 0.25 * quarters
        kept = [row for row in kept if quarters > 0 and t_s - row[0] <= KEPT_S] + [(t_s, value)]
        buffer.add(t_s, np.array([value]))
    times, values = zip(*kept, strict=True)
    wanted_s = times[0] + share * (times[-1] - times[0])
    found = buffer.at(wanted_s)
    if times[0] <= wanted_s <= times[-1]:
        assert found == pytest.approx([np.interp(wanted_s, times, values)], abs=1e-9)
    else:
        assert found is None


def test_over_the_top_the_offset_is_that_on_the_sky() -> None:
    """Right of the beam is left for the azimuth axis there, and up is down for the elevation axis."""
    beam, centre, away = BeamPosition(), np.array([1.0, 2.2]), np.array([0.003, -0.002])
    beam.take_joints(JointReading(t_s=0.0, position_rad=centre + away, velocity_rad_s=np.zeros(2)))
    beam.take_centre(0.0, centre)
    joints = centre + away
    wanted = sky_offset_rad(joints[0] + math.pi, math.pi - joints[1], centre[0] + math.pi, math.pi - centre[1])
    np.testing.assert_allclose(beam.offset(0.0), wanted, atol=1e-5)
    assert beam.offset(0.0)[1] == pytest.approx(0.002)
    # The direction tells the side, not where the dish has come to.
    near = BeamPosition()
    near.take_joints(JointReading(t_s=0.0, position_rad=[1.0, 1.58], velocity_rad_s=np.zeros(2)))
    near.take_centre(0.0, np.array([1.0, 1.56]))
    assert near.offset(0.0)[1] == pytest.approx(0.02)
