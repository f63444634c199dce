"""Sites: SOFA as independent library, the station catalogue, and unknown stations."""

import erfa
import numpy as np
import pytest

from rf_pointing.ephemeris.sites import SITES, Site, site


@pytest.mark.parametrize("name", SITES)
def test_position_agrees_with_sofa(name: str) -> None:
    place = site(name)
    sofa = erfa.gd2gc(1, place.longitude_rad, place.latitude_rad, place.altitude_m)
    np.testing.assert_allclose(place.position_m, sofa, rtol=0.0, atol=1e-6)


def test_goldstone_is_where_dsn_810_005_puts_it() -> None:
    """Module 301 Cartesian coordinates; the catalogue keeps geodetic ones to 1e-7 deg, 1 cm."""
    np.testing.assert_allclose(site("Goldstone DSS-13").position_m, (-2351112.6, -4655530.7, 3660912.7), atol=1.0)
    np.testing.assert_allclose(site("Goldstone DSS-14").position_m, (-2353621.4, -4641341.5, 3677052.3), atol=1.0)


def test_axes_are_right_handed_and_up_leaves_the_ellipsoid() -> None:
    place = Site.from_degrees(-20.34, 57.45, 400.0)
    rotation = np.array(place.axes)
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-15)
    assert np.linalg.det(rotation) == pytest.approx(1.0)
    higher = place.replace(altitude_m=1400.0)
    moved = np.subtract(higher.position_m, place.position_m)
    np.testing.assert_allclose(rotation @ moved, (0.0, 0.0, 1000.0), atol=1e-6)


def test_an_unknown_station_and_an_impossible_latitude_are_refused() -> None:
    with pytest.raises(ValueError, match="site='Arecibo' must be one of Goldstone DSS-13, "):
        site("Arecibo")
    with pytest.raises(ValueError, match="latitude_rad"):
        Site.from_degrees(91.0, 0.0, 0.0)
