"""Time scales: published offsets, SOFA as independent library, and mix-ups that must be impossible."""

import erfa
import numpy as np
import pytest

from rf_pointing.core.dates import utc_text
from rf_pointing.ephemeris.time_scales import (
    Gps,
    Tai,
    Tt,
    Utc,
    leap_seconds,
    posix_from_calendar,
    tai_from_utc_calendar,
)

T_2006_S = 1151347924.0
NANOSECOND_S = 1e-9


def test_offsets_of_2026_are_37_18_and_69_184_seconds() -> None:
    utc = Utc.from_posix(posix_from_calendar("2026-11-21T00:00:00"))
    tai = utc.to_tai()
    assert tai.seconds_since(Tai(utc.whole, utc.fraction)) == pytest.approx(37.0, abs=NANOSECOND_S)
    assert tai.to_gps().seconds_since(Gps(utc.whole, utc.fraction)) == pytest.approx(18.0, abs=NANOSECOND_S)
    assert tai.to_tt().seconds_since(Tt(utc.whole, utc.fraction)) == pytest.approx(69.184, abs=NANOSECOND_S)


def test_dates_of_different_scales_do_not_subtract() -> None:
    utc = Utc.from_posix(T_2006_S)
    with pytest.raises(ValueError, match="Utc date cannot be subtracted from a Tt date"):
        utc.to_tai().to_tt().seconds_since(utc)  # type: ignore[arg-type]


@pytest.mark.parametrize("year", [1972, 1980, 1990, 1999, 2006, 2016, 2017, 2026])
def test_leap_seconds_agree_with_sofa(year: int) -> None:
    t_s = posix_from_calendar(f"{year}-03-15T12:00:00")
    assert leap_seconds().tai_minus_utc_s(t_s) == erfa.dat(year, 3, 15, 0.5)


def test_every_scale_returns_to_where_it_came_from() -> None:
    utc = Utc.from_posix(T_2006_S + 0.123456)
    assert utc.posix_s() == pytest.approx(T_2006_S + 0.123456, abs=1e-6)
    assert utc.to_tai().to_utc().seconds_since(utc) == pytest.approx(0.0, abs=NANOSECOND_S)
    assert utc.to_tai().to_tt().to_tai().to_utc().seconds_since(utc) == pytest.approx(0.0, abs=NANOSECOND_S)
    assert utc.to_tai().to_gps().to_tai().to_utc().seconds_since(utc) == pytest.approx(0.0, abs=NANOSECOND_S)
    assert utc.to_ut1(0.2).to_utc(0.2).seconds_since(utc) == pytest.approx(0.0, abs=NANOSECOND_S)


def test_the_leap_second_of_2016_separates_neighbouring_seconds_by_two() -> None:
    before = Utc.from_posix(posix_from_calendar("2016-12-31T23:59:59")).to_tai()
    after = Utc.from_posix(posix_from_calendar("2017-01-01T00:00:00")).to_tai()
    assert after.seconds_since(before) == pytest.approx(2.0, abs=NANOSECOND_S)
    assert after.to_utc().posix_s() == posix_from_calendar("2017-01-01T00:00:00")


def test_arrays_and_floats_give_the_same_leap_seconds() -> None:
    times = np.array([1e8, 1.15e9, 1.8e9])
    assert leap_seconds().tai_minus_utc_s(times).tolist() == [leap_seconds().tai_minus_utc_s(float(t)) for t in times]


def test_dates_before_1972_are_refused() -> None:
    with pytest.raises(ValueError, match="must be >= 63072000"):
        leap_seconds().tai_minus_utc_s(0.0)


def test_an_expired_leap_second_table_says_so() -> None:
    table = leap_seconds()
    assert table.warnings(table.expires_t_s - 1.0) == ()
    assert "expired" in table.warnings(table.expires_t_s + 1.0)[0]


def test_a_leap_second_is_read_where_there_is_one() -> None:
    half = tai_from_utc_calendar("2016-12-31T23:59:60.5")
    assert half - tai_from_utc_calendar("2016-12-31T23:59:59.5") == 1.0
    assert tai_from_utc_calendar("2017-01-01T00:00:00.5") - half == 1.0
    assert tai_from_utc_calendar("2016-366T23:59:60.5") == half
    for text in ("2015-12-31T23:59:60", "2016-12-31T23:58:60", "2016-12-31T23:59:61"):
        with pytest.raises(ValueError, match=r"has second 6., must be < 6. in that minute"):
            tai_from_utc_calendar(text)


def test_calendar_and_ordinal_dates_are_read() -> None:
    assert posix_from_calendar("2006-06-26T18:52:04.08Z") == pytest.approx(1151347924.08, abs=1e-6)
    assert posix_from_calendar("2006-177T18:52:04.08") == pytest.approx(1151347924.08, abs=1e-6)
    assert utc_text(1151347924.08) == "2006-06-26T18:52:04.080Z"


@pytest.mark.parametrize(
    "text",
    [
        "2006-13-01T00:00:00",
        "2006-06-26",
        "2006-06-26T25:00:00",
        "nan",
        "2006-06-26T00:00:75",
        "2016-12-31T23:59:60",
        "06-06-26T00:00:00",
        "2006-000T00:00:00",
        "2006-366T00:00:00",
        "2006-06-26T00:00:00+01:00",
    ],
)
def test_malformed_dates_are_refused(text: str) -> None:
    with pytest.raises(ValueError, match="date="):
        posix_from_calendar(text)
