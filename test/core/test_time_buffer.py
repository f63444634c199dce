"""Where the beam was from a commanded direction, interpolated between two streams."""

import math

import numpy as np

from rf_pointing.core import JointReading
from rf_pointing.core.signals import KEPT_S, BeamPosition

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


def test_a_step_back_in_time_forgets_what_was_known() -> None:
    beam = BeamPosition()
    for t_s in (5.0, 6.0, 1.0):
        beam.take_joints(reading(t_s, (0.0, 0.0)))
        beam.take_centre(t_s, CENTRE)
    assert beam.offset(5.5) is None
    assert beam.offset(1.0) is not None


def test_old_readings_are_dropped() -> None:
    beam = BeamPosition()
    for t_s in np.arange(0.0, KEPT_S + 1.01, 0.5):
        beam.take_joints(reading(float(t_s), (0.0, 0.0)))
        beam.take_centre(float(t_s), CENTRE)
    assert beam.offset(0.5) is None
    assert beam.offset(1.5) is not None
