"""The loss that a certificate predicts is the loss that the simulated antenna then has."""

import math

import pytest

from rf_pointing.ephemeris import TopocentricTrack, find_elements, first_pass_above, site, verification_elements
from rf_pointing.simulation.keyhole import KeyholeCase, fly

SAME_S = 1.0
"""Loops, structure and drives follow the crossing with a delay and an overshoot worth less than this."""


@pytest.mark.parametrize(("day", "least_deg", "beam_deg"), [(4.2, 82.0, 1.0), (1.5, 89.8, 0.264)])
def test_predicted_loss_is_simulated_loss(day: float, least_deg: float, beam_deg: float) -> None:
    elements = find_elements(verification_elements(), "28057")
    track = TopocentricTrack(elements, site("Goldstone DSS-13"))
    start_s = elements.epoch_t_s + day * 86400.0
    window = first_pass_above(track, start_s, math.radians(least_deg), math.radians(5.0), 86400.0)
    run = fly(KeyholeCase(track=track, window=window, beamwidth_rad=math.radians(beam_deg)))
    assert run.predicted_lost_s > 10.0
    assert run.simulated_lost_s == pytest.approx(run.predicted_lost_s, abs=SAME_S)
    assert run.simulated_below_s == pytest.approx(run.predicted_below_s, abs=SAME_S)
