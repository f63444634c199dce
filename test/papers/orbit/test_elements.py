import math

import numpy as np
import pytest

from rf_pointing.core.constants import EARTH_MU_M3_S2
from rf_pointing.papers.orbit import Elements


def test_elements_and_state_are_inverses_for_random_orbits(random):
    for _ in range(50):
        given = Elements(
            semi_major_axis_m=random.uniform(6.8e6, 4.2e7),
            eccentricity=random.uniform(0.001, 0.7),
            inclination_rad=random.uniform(0.05, 3.0),
            node_rad=random.uniform(0.0, 6.28),
            perigee_rad=random.uniform(0.0, 6.28),
            mean_anomaly_rad=random.uniform(0.0, 6.28),
        )
        back = Elements.from_state(given.state())
        assert np.allclose(back.state(), given.state(), rtol=1e-11)
        assert back.semi_major_axis_m == pytest.approx(given.semi_major_axis_m, rel=1e-12)
        assert back.node_rad == pytest.approx(given.node_rad, abs=1e-10)


def test_perigee_speed_is_that_of_the_vis_viva_equation():
    a, e = 7.2e6, 0.1
    state = Elements(
        semi_major_axis_m=a,
        eccentricity=e,
        inclination_rad=1.0,
        node_rad=0.3,
        perigee_rad=0.7,
        mean_anomaly_rad=0.0,
    ).state()
    assert np.linalg.norm(state[:3]) == pytest.approx(a * (1 - e), rel=1e-13)
    assert np.linalg.norm(state[3:]) == pytest.approx(math.sqrt(EARTH_MU_M3_S2 / a * (1 + e) / (1 - e)), rel=1e-13)


def test_an_open_orbit_is_refused():
    with pytest.raises(ValueError, match="not a closed orbit"):
        Elements.from_state([7e6, 0.0, 0.0, 0.0, 12000.0, 100.0])
