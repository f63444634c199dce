"""What a network could know: laws of covariances, and the effect of a wrong Earth against integrations."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from rf_pointing.core.constants import EARTH_MU_M3_S2
from rf_pointing.orbit.forces import Disturbances
from rf_pointing.orbit.study import Before, Considered, Knowledge, Tracking, known_orbit
from rf_pointing.papers.satcal_motion import Site, turning_station

STATE = np.array([7.0e6, 2.0e5, -3.0e5, 400.0, 1200.0, 7400.0])
EPOCH = 757382400.0
SITES = [("north", 0.9, 0.2), ("south", -0.5, 2.4), ("east", 0.3, 1.5)]
TIGHT = Before(position_m=1e-3, velocity_m_s=1e-6, radiation=1e-9, air=1e-9)


def known(tracking: Tracking, before: Before, considered: Considered) -> Knowledge:
    t_s = EPOCH + np.arange(0.0, 30000.0, 60.0)
    motions = {
        name: turning_station(t_s, Site(name=name, latitude_rad=latitude, longitude_rad=longitude))
        for name, latitude, longitude in SITES
    }
    return known_orbit(
        EPOCH, STATE, motions, t_s, tracking, forces=Disturbances(), before=before, considered=considered,
        until_t_s=EPOCH + 20000.0,
    )  # fmt: skip


def test_twice_the_errors_are_twice_the_sigma():
    one = known(
        Tracking(angle_sigma_rad=1e-4, angle_bias_rad=2e-4, range_sigma_m=7.0, zenith_delay_m=0.1),
        Before(),
        Considered(),
    )
    two = known(
        Tracking(angle_sigma_rad=2e-4, angle_bias_rad=4e-4, range_sigma_m=14.0, range_bias_m=20.0, zenith_delay_m=0.2),
        Before(position_m=1e4, velocity_m_s=100.0, radiation=0.1, air=0.6),
        Considered(station_m=0.2, gm=4e-9, pole_m=0.5, ut1_s=1.2e-3, field=2.0),
    )
    assert np.allclose(two.sigma_m(), 2.0 * one.sigma_m(), rtol=1e-6)
    assert set(one.parts) == {"gm", "field", "ut1", "pole", "stations", "clock"}
    assert np.all(one.sigma_m() >= one.sigma_m(one.formal))


def test_a_wrong_gm_moves_an_orbit_that_is_not_adapted_as_its_integration():
    share = 1e-6
    tracking = Tracking(angle_sigma_rad=0.1)
    found = known(tracking, TIGHT, Considered(gm=share, station_m=0.0, pole_m=0.0, ut1_s=0.0, field=0.0))

    def end(mu: float) -> np.ndarray:
        def slope(_: float, y: np.ndarray) -> np.ndarray:
            return np.concatenate([y[3:], -mu * y[:3] / np.linalg.norm(y[:3]) ** 3])

        return solve_ivp(slope, (0.0, 29940.0), STATE, method="DOP853", rtol=1e-12, atol=1e-6).y[:3, -1]

    moved = np.linalg.norm(end(EARTH_MU_M3_S2 * (1.0 + share)) - end(EARTH_MU_M3_S2))
    assert found.sigma_m(found.parts["gm"])[-1] == pytest.approx(moved, rel=1e-3)


def test_an_error_of_ut1_turns_the_orbit_with_the_earth():
    """The whole network turned by UT1 gives an orbit turned by it, whatever is measured."""
    seconds = 0.01
    found = known(
        Tracking(angle_sigma_rad=1e-6, angle_bias_rad=1e-8, range_sigma_m=0.01, range_bias_m=1e-4, zenith_delay_m=1e-5),
        Before(),
        Considered(ut1_s=seconds, station_m=0.0, pole_m=0.0, gm=0.0, field=0.0),
    )
    expected = 7.292115855e-5 * seconds * np.linalg.norm(found.states[:, :2], axis=1)
    assert np.allclose(found.sigma_m(found.parts["ut1"]), expected, rtol=0.02)


def test_tracking_that_measures_nothing_is_refused():
    with pytest.raises(ValueError, match="are all 0"):
        Tracking()
    with pytest.raises(ValueError, match="no station of north, south, east sees the satellite"):
        known(Tracking(range_sigma_m=1.0, lowest_rad=1.5), Before(), Considered())
