"""Earth orientation: published values, both packaged files against each other, and the ends of the tables."""

import math

import numpy as np
import pytest

from rf_pointing.core.dates import DAY_S, from_utc_text
from rf_pointing.ephemeris.earth_orientation import IersEarthOrientation, orientation_table

ARCSEC = math.radians(1.0 / 3600.0)
SOURCE = IersEarthOrientation()


def test_vallados_published_day_is_reproduced() -> None:
    """AIAA 2006-6753 appendix C: 2004-04-06, UT1-UTC -0.439962 s, pole -0.140857, 0.333093 arcsec.

    The series of 2006 refers to an older terrestrial frame: the pole has been moved by 0.5 mas (1.5 cm) since.
    """
    earth = SOURCE.at(from_utc_text("2004-04-06T00:00:00"))
    assert earth.ut1_minus_utc_s == pytest.approx(-0.439962, abs=2e-5)
    assert earth.pole_x_rad == pytest.approx(-0.140857 * ARCSEC, abs=5e-4 * ARCSEC)
    assert earth.pole_y_rad == pytest.approx(0.333093 * ARCSEC, abs=5e-4 * ARCSEC)


def test_array_and_float_agree_across_the_change_of_files() -> None:
    last = orientation_table().span_t_s[1]
    times = np.linspace(last - 500.0 * DAY_S, last - 1.0, 997)
    array = SOURCE.at(times)
    singles = [SOURCE.at(float(t)) for t in times]
    np.testing.assert_allclose(array.ut1_minus_utc_s, [s.ut1_minus_utc_s for s in singles], rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(array.pole_x_rad, [s.pole_x_rad for s in singles], rtol=0.0, atol=1e-18)
    np.testing.assert_allclose(array.pole_y_rad, [s.pole_y_rad for s in singles], rtol=0.0, atol=1e-18)
    assert np.abs(np.diff(array.ut1_minus_utc_s)).max() < 3e-3


def test_the_length_of_day_jumps_by_a_leap_second_in_utc_only() -> None:
    leap = from_utc_text("2017-01-01T00:00:00")
    before, after = SOURCE.at(leap - 1e-3), SOURCE.at(leap)
    assert after.ut1_minus_utc_s - before.ut1_minus_utc_s == pytest.approx(1.0, abs=1e-6)


def test_times_outside_the_tables_are_refused_with_the_last_date() -> None:
    first, last = orientation_table().span_t_s
    for t_s in (first - 1.0, last, 4e9, math.inf):
        with pytest.raises(ValueError, match=r"tabulated to 20.*renew astropy-iers-data"):
            SOURCE.at(t_s)
        with pytest.raises(ValueError, match="tabulated to 20"):
            SOURCE.at(np.array([first, t_s]))


def test_long_predictions_are_announced_and_daily_values_are_not() -> None:
    assert SOURCE.warnings(from_utc_text("2006-06-26T00:00:00")) == ()
    assert SOURCE.warnings(orientation_table().last_measured_t_s + 30.0 * DAY_S) == ()
    assert any("days ahead, good to" in text for text in SOURCE.warnings(orientation_table().span_t_s[1] - 1.0))
