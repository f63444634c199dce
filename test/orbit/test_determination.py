"""Planted orbits: the error is what the covariance says, and small changes move an orbit as they should."""

import numpy as np
import pytest

from rf_pointing.core.constants import EARTH_MU_M3_S2
from rf_pointing.orbit.determination import COMBINATIONS, determine, orbit_changes
from rf_pointing.orbit.motion import point_mass, propagate_together
from test.scripts import script_module

trials = script_module("benchmarks/orbit_from_passes.py")
COUNT = 40


@pytest.mark.parametrize("case", trials.CASES, ids=lambda case: case.name)
def test_errors_of_planted_orbits_are_those_of_the_covariance(case):
    """Of 300 trials 67 to 68 % are in the 68 % volume, 95 to 96 % in that of 95 %; of 40, within 3 sigma of that."""
    planted = trials.plant(case, COUNT, seed=7)
    found = trials.outcome(planted, determine(planted.prior, planted.passes, planted.dynamics, trials.PRIORS))
    for share, key in ((0.68, "68"), (0.95, "95")):
        assert abs(found[key] - share) < 3.0 * np.sqrt(share * (1.0 - share) / COUNT)
    assert found["better"] > 10.0
    assert found["rms_m"] == pytest.approx(found["sigma_m"], rel=0.4)


def test_changes_of_an_orbit_have_the_effect_of_their_names():
    radius = 7.1e6
    speed = np.sqrt(EARTH_MU_M3_S2 / radius)
    tilt = np.array([[1.0, 0.0, 0.0], [0.0, 0.6, -0.8], [0.0, 0.8, 0.6]])
    state = np.concatenate([tilt @ [radius, 0.0, 0.0], tilt @ [0.0, speed, 0.0]])
    change = orbit_changes(state)
    turn_s = 2.0 * np.pi * radius / speed
    moved = propagate_together(
        np.concatenate([state[np.newaxis], state + change.T]), [0.25 * turn_s, turn_s], point_mass
    )
    # Radial, along and across, after a quarter and a whole revolution.
    quarter = np.stack([tilt @ axis for axis in ([0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0])])
    whole = np.stack([tilt @ axis for axis in ([1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0])])
    off = [axes @ (row[1:, :3] - row[0, :3]).T for axes, row in zip((quarter, whole), moved, strict=True)]
    by_name = {name: (off[0][:, k], off[1][:, k]) for k, name in enumerate(COMBINATIONS)}
    # Three half turns of the difference of the semi-major axis each revolution.
    assert by_name["semi-major axis"][1] == pytest.approx([1.0, -3.0 * np.pi, 0.0], abs=2e-3)
    assert by_name["place along the track"][1] == pytest.approx([0.0, 1.0, 0.0], abs=2e-3)
    assert by_name["eccentricity along the radius"][1] == pytest.approx([-1.0, 0.0, 0.0], abs=2e-3)
    assert by_name["eccentricity along the radius"][0] == pytest.approx([0.0, 2.0, 0.0], abs=2e-3)
    assert by_name["eccentricity across it"][0] == pytest.approx([-1.0, 0.0, 0.0], abs=2e-3)
    assert by_name["cross-track a quarter of a revolution on"][0] == pytest.approx([0.0, 0.0, 1.0], abs=2e-3)
