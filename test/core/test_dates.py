import pytest

from rf_pointing.core.dates import from_utc_text, parse_utc, require_day_of_year, to_utc_text, utc_text


def test_text_and_seconds_are_inverses_to_the_microsecond():
    for t_s in (0.0, 827385062.07, 1.7e9 + 0.999999):
        assert from_utc_text(to_utc_text(t_s)) == pytest.approx(t_s, abs=6e-7)


def test_ordinal_and_calendar_texts_of_one_instant_agree():
    assert from_utc_text("1996-081T05:11:02.07Z") == from_utc_text("1996-03-21T05:11:02.070")
    assert from_utc_text("1970-01-02T00:00:00") == 86400.0


@pytest.mark.parametrize(
    "text",
    ["1996-03-21", "1996-13-01T00:00:00", "1995-366T00:00:00", "21/03/1996T00:00:00", "", "nan", "06-06-26T00:00:00",
     "2006-06-26T25:00:00", "2006-06-26T00:00:75", "2006-000T00:00:00", "2006-06-26T00:00:00+01:00"],
)  # fmt: skip
def test_other_texts_are_refused(text):
    with pytest.raises(ValueError, match="date="):
        from_utc_text(text)


def test_times_for_people_are_rounded_to_the_millisecond() -> None:
    assert utc_text(1_700_000_000.1234) == "2023-11-14T22:13:20.123Z"
    assert utc_text(1_700_000_000.9996) == "2023-11-14T22:13:21.000Z"


@pytest.mark.parametrize("second", ["60", "60.5", "61"])
def test_a_leap_second_has_no_posix_time(second: str) -> None:
    with pytest.raises(ValueError, match="must be < 60"):
        from_utc_text(f"2016-12-31T23:59:{second}Z")
    assert from_utc_text("2016-12-31T23:59:59.75Z") == 1483228799.75


@pytest.mark.parametrize(
    ("year", "day", "fits"),
    [
        (2023, 1.0, True),
        (2023, 0.99, False),
        (2023, 365.99, True),
        (2023, 366.0, False),
        (2024, 366.5, True),
        (2024, 367.0, False),
    ],
)
def test_a_year_has_365_days_or_366_and_parts_of_them(year: int, day: float, fits: bool) -> None:
    if fits:
        require_day_of_year("then", year, day)
        return
    with pytest.raises(ValueError, match=rf"^date='then' has day .* of {year}, must be >= 1 and < 36[67]$"):
        require_day_of_year("then", year, day)


@pytest.mark.parametrize(
    ("text", "t_s"),
    [
        ("1970-01-01T00:00:10", 10.0),
        ("1970-01-01T02:00:10+02:00", 10.0),
        ("1970-01-01T00:00:10Z", 10.0),
        ("1970-01-02", 86400.0),
    ],
)
def test_an_iso_time_without_a_zone_is_utc(text: str, t_s: float) -> None:
    assert parse_utc(text) == t_s
    with pytest.raises(ValueError, match="start='soon' must be an ISO time"):
        parse_utc("soon")
