"""Earth orientation: published values, both packaged files against each other, and the ends of the tables."""

import math
from pathlib import Path

import numpy as np
import pytest
from astropy_iers_data import IERS_A_FILE

from rf_pointing.core import angular_distance_rad
from rf_pointing.core.dates import DAY_S, from_utc_text
from rf_pointing.ephemeris import (
    TopocentricTrack,
    find_elements,
    orientation_sigma_rad,
    radio_source,
    site,
    verification_elements,
)
from rf_pointing.ephemeris.earth_orientation import (
    PREDICTED_DAYS,
    IersEarthOrientation,
    orientation_table,
    predicted,
    predicted_sigmas,
)
from rf_pointing.ephemeris.time_scales import leap_seconds
from test.ephemeris.conftest import AssumedOrientation

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


def test_the_length_of_day_jumps_by_a_leap_second_in_utc_only() -> None:
    leap = from_utc_text("2017-01-01T00:00:00")
    before, after = SOURCE.at(leap - 1e-3), SOURCE.at(leap)
    assert after.ut1_minus_utc_s - before.ut1_minus_utc_s == pytest.approx(1.0, abs=1e-6)


def test_times_long_after_the_tables_or_before_them_are_refused_with_the_last_date() -> None:
    first, last = orientation_table().span_t_s
    for t_s in (first - 1.0, last + 21.0 * 365.25 * DAY_S, 4e9, math.inf, math.nan):
        with pytest.raises(ValueError, match=r"tabulated to 20.*renew astropy-iers-data"):
            SOURCE.at(t_s)
        with pytest.raises(ValueError, match="tabulated to 20"):
            SOURCE.at(np.array([first, t_s]))


def test_array_and_float_agree_and_neither_jumps_across_files_and_ends_and_later_values_are_held() -> None:
    table = orientation_table()
    last_s, fixed_s = table.span_t_s[1], table.last_measured_t_s + PREDICTED_DAYS * DAY_S
    # Across the change of files half a day apart, half a second around the end, and the whole of the
    # prediction day by day; the pole moves 4 mas a day at most.
    for times, pole_mas in (
        (np.linspace(last_s - 500.0 * DAY_S, last_s - 1.0, 997), 3.0),
        (last_s + np.linspace(-0.25, 0.25, 11), 6.0),
        (np.arange(last_s - 30.0 * DAY_S, fixed_s + 50.0 * DAY_S, DAY_S), 6.0),
    ):
        earth = SOURCE.at(times)
        singles = [SOURCE.at(float(t)) for t in times]
        np.testing.assert_allclose(earth.ut1_minus_utc_s, [s.ut1_minus_utc_s for s in singles], rtol=0.0, atol=1e-12)
        np.testing.assert_allclose(earth.pole_x_rad, [s.pole_x_rad for s in singles], rtol=0.0, atol=1e-17)
        np.testing.assert_allclose(earth.pole_y_rad, [s.pole_y_rad for s in singles], rtol=0.0, atol=1e-17)
        assert np.abs(np.diff(earth.ut1_minus_utc_s)).max() < 3e-3
        assert np.abs(np.diff(earth.pole_x_rad)).max() < 1e-3 * pole_mas * ARCSEC
        assert np.abs(np.diff(earth.pole_y_rad)).max() < 1e-3 * pole_mas * ARCSEC
    held, later = SOURCE.at(fixed_s + 1.0), SOURCE.at(fixed_s + 3000.0 * DAY_S)
    assert later == held
    assert any("is predicted" in text and "beyond the table" in text for text in SOURCE.warnings(last_s + DAY_S))
    assert any(f"is held at {held.ut1_minus_utc_s:.3f} s" in text for text in SOURCE.warnings(fixed_s + DAY_S))


def test_predictions_of_the_past_would_have_missed_by_the_sigmas_that_are_stated(random: np.random.Generator) -> None:
    """From random days since 1978, by what was measured before; the years since are known."""
    table = orientation_table()
    measured = int(np.searchsorted(table.t_s, table.last_measured_t_s)) + 1
    ahead = np.array([1.0, 5.0, 12.0, 30.0, 60.0, 90.0, 180.0, 365.0, 500.0, 730.0, 1000.0])
    misses = []
    for end in random.integers(2200, measured - 1000, 150).tolist():
        past = tuple(values[: end + 1] for values in table.values)
        foretold = predicted(table.t_s[: end + 1], past, ahead)
        misses.append(
            [value - truth[end + ahead.astype(int)] for value, truth in zip(foretold, table.values, strict=True)]
        )
    rms = np.sqrt(np.mean(np.square(misses), axis=0))
    stated = np.array([predicted_sigmas(days) for days in ahead]).T[[0, 1, 1]]
    # 150 overlapping predictions give the rms to about 15 %.
    assert np.all(rms < 1.25 * stated)
    assert np.all(rms > 0.6 * stated)
    assert np.all(np.mean(np.abs(misses) < 3.0 * stated, axis=0) > 0.97)


def test_held_values_miss_by_the_sigmas_that_are_stated(random: np.random.Generator) -> None:
    """UT1-UTC with the leap seconds that were inserted meanwhile, as the clocks of a station have them."""
    table = orientation_table()
    measured = int(np.searchsorted(table.t_s, table.last_measured_t_s)) + 1
    ut1_misses, pole_misses = [], []
    for end in random.integers(2200, measured - 3000, 150).tolist():
        past = tuple(values[: end + 1] for values in table.values)
        ut1, x, y = predicted(table.t_s[: end + 1], past, np.array([float(PREDICTED_DAYS)]))
        held_s, later = table.t_s[end + PREDICTED_DAYS], end + int(random.integers(PREDICTED_DAYS + 300, 3000))
        truth = SOURCE.at(float(table.t_s[later]))
        ut1_misses.append(ut1[0] + leap_seconds().tai_minus_utc_s(float(held_s)) - truth.ut1_minus_utc_s)
        pole_misses += [x[0] - truth.pole_x_rad, y[0] - truth.pole_y_rad]
    ut1_sigma_s, pole_sigma_rad = predicted_sigmas(PREDICTED_DAYS + 1.0)
    assert 0.6 * ut1_sigma_s < math.sqrt(np.mean(np.square(ut1_misses))) < 1.2 * ut1_sigma_s
    assert 0.6 * pole_sigma_rad < math.sqrt(np.mean(np.square(pole_misses))) < 1.2 * pole_sigma_rad


@pytest.mark.parametrize("number", ["28057", "8195", "24208", "Cygnus A"])
def test_the_pointing_error_of_an_uncertain_orientation_is_what_it_moves_the_target_by(
    number: str, random: np.random.Generator
) -> None:
    ut1_s, pole_rad = 0.2, 0.1 * ARCSEC

    def track(**earth: object) -> TopocentricTrack:
        orientation = AssumedOrientation(**earth)
        target = (
            radio_source(number, orientation) if number[0] == "C" else find_elements(verification_elements(), number)
        )
        return TopocentricTrack(target, site("Canberra DSS-43"), refraction=None, orientation=orientation)

    known = track(sigmas=(ut1_s, pole_rad))
    moved = track(ut1_minus_utc_s=ut1_s), track(pole_x_rad=pole_rad), track(pole_y_rad=pole_rad)
    for t_s in (1.151e9 + random.uniform(0.0, 2.0 * DAY_S, 10)).tolist():
        there = known.target_at(t_s)
        apart = [one.target_at(t_s) for one in moved]
        squares = [
            angular_distance_rad(there.azimuth_rad, there.elevation_rad, one.azimuth_rad, one.elevation_rad) ** 2
            for one in apart
        ]
        assert orientation_sigma_rad(known, t_s) == pytest.approx(math.sqrt(sum(squares)), rel=1e-3)
    assert orientation_sigma_rad(track(), 1.151e9) == 0.0


def test_long_predictions_are_announced_and_daily_values_are_not() -> None:
    assert SOURCE.warnings(from_utc_text("2006-06-26T00:00:00")) == ()
    assert SOURCE.warnings(orientation_table().last_measured_t_s + 30.0 * DAY_S) == ()
    assert any("days ahead, good to" in text for text in SOURCE.warnings(orientation_table().span_t_s[1] - 1.0))


def test_the_uncertainty_of_a_prediction_begins_at_zero_and_grows_until_it_is_that_of_a_held_value() -> None:
    assert predicted_sigmas(-3.0) == predicted_sigmas(0.0) == (0.0, 0.0)
    days = np.array([0.0, 1.0, 5.0, 40.0, 300.0, float(PREDICTED_DAYS)])
    found = np.array([predicted_sigmas(one) for one in days])
    assert np.all(np.diff(found, axis=0) > 0.0)
    assert np.all(found[-1] < predicted_sigmas(PREDICTED_DAYS + 1e-3))


def test_the_last_measured_day_is_the_last_that_the_rapid_service_does_not_call_predicted() -> None:
    """Column 58 of finals2000A: I for measured, P for predicted UT1."""
    lines = [line for line in Path(IERS_A_FILE).read_text().splitlines() if line[57:58] in ("I", "P")]
    measured = [float(line[7:15]) for line in lines if line[57] == "I"]
    table = orientation_table()
    assert table.last_measured_t_s == (measured[-1] - 40587.0) * DAY_S
    assert table.span_t_s[1] == (float(lines[-1][7:15]) - 40587.0) * DAY_S
    # The day itself, as the file gives it: arcseconds and seconds.
    line = next(one for one in lines if float(one[7:15]) == float(lines[-1][7:15]) - 3.0)
    earth = SOURCE.at(table.span_t_s[1] - 3.0 * DAY_S)
    assert earth.ut1_minus_utc_s == pytest.approx(float(line[58:68]), abs=1e-7)
    assert earth.pole_x_rad == pytest.approx(float(line[18:27]) * ARCSEC, abs=1e-12)
    assert earth.pole_y_rad == pytest.approx(float(line[37:46]) * ARCSEC, abs=1e-12)
