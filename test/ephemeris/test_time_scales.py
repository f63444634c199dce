"""Time scales: published offsets, SOFA as independent library, leap seconds."""

import erfa
import numpy as np
import pytest

from rf_pointing.core.dates import from_utc_text, utc_text
from rf_pointing.ephemeris.time_scales import (
    TAI_MINUS_GPS_S,
    TT_MINUS_TAI_S,
    leap_seconds,
    tai_from_utc_calendar,
    utc_from_tai_s,
)

NANOSECOND_S = 1e-9


def test_offsets_of_2026_are_37_18_and_69_184_seconds() -> None:
    tai_minus_utc_s = leap_seconds().tai_minus_utc_s(from_utc_text("2026-11-21T00:00:00"))
    assert tai_minus_utc_s == 37.0
    assert tai_minus_utc_s - TAI_MINUS_GPS_S == 18.0
    assert tai_minus_utc_s + TT_MINUS_TAI_S == pytest.approx(69.184, abs=NANOSECOND_S)


@pytest.mark.parametrize("year", [1972, 1980, 1990, 1999, 2006, 2016, 2017, 2026])
def test_leap_seconds_agree_with_sofa(year: int) -> None:
    t_s = from_utc_text(f"{year}-03-15T12:00:00")
    assert leap_seconds().tai_minus_utc_s(t_s) == erfa.dat(year, 3, 15, 0.5)


def test_the_leap_second_of_2016_separates_neighbouring_seconds_by_two() -> None:
    before, after = (from_utc_text(text) for text in ("2016-12-31T23:59:59", "2017-01-01T00:00:00"))
    table = leap_seconds()
    before_tai_s, after_tai_s = (t_s + table.tai_minus_utc_s(t_s) for t_s in (before, after))
    assert after_tai_s - before_tai_s == pytest.approx(2.0, abs=NANOSECOND_S)
    assert utc_from_tai_s(after_tai_s) == after
    assert utc_from_tai_s(before_tai_s) == before


def test_arrays_and_floats_give_the_same_leap_seconds() -> None:
    times = np.array([1e8, 1.15e9, 1.8e9])
    assert leap_seconds().tai_minus_utc_s(times).tolist() == [leap_seconds().tai_minus_utc_s(float(t)) for t in times]


def test_dates_before_1972_are_refused() -> None:
    with pytest.raises(ValueError, match="must be >= 63072000"):
        leap_seconds().tai_minus_utc_s(0.0)


def test_a_leap_second_is_read_where_there_is_one() -> None:
    half = tai_from_utc_calendar("2016-12-31T23:59:60.5")
    assert half - tai_from_utc_calendar("2016-12-31T23:59:59.5") == 1.0
    assert tai_from_utc_calendar("2017-01-01T00:00:00.5") - half == 1.0
    assert tai_from_utc_calendar("2016-366T23:59:60.5") == half
    for text in ("2015-12-31T23:59:60", "2016-12-31T23:58:60", "2016-12-31T23:59:61"):
        with pytest.raises(ValueError, match=r"has second 6., must be < 6. in that minute"):
            tai_from_utc_calendar(text)


def test_a_table_is_certain_up_to_its_expiry() -> None:
    """The list of late 2026 or before expires on the 28th of June or of December."""
    table = leap_seconds()
    assert table.warnings(table.expires_t_s) == ()
    (text,) = table.warnings(table.expires_t_s + 1e-3)
    date = utc_text(table.expires_t_s)
    assert text == f"leap second table expired on {date[:10]}; TAI-UTC is assumed unchanged since"
    assert date[4:] in ("-06-28T00:00:00.000Z", "-12-28T00:00:00.000Z")
