"""Angles, times and durations are taken in the unit that their name says, once."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as some

from rf_pointing.api.keywords import angle_rad, span_s, time_s
from rf_pointing.core.dates import DAY_S, utc_text

ANGLES = some.floats(-1e3, 1e3)


@given(value=ANGLES)
def test_degrees_and_radians_name_the_same_angle(value: float) -> None:
    assert angle_rad("peak", math.degrees(value), None) == pytest.approx(value, abs=1e-12)
    assert angle_rad("peak", None, value) == value
    assert angle_rad("peak", None, None, value) == value


@given(a=ANGLES, b=ANGLES)
def test_an_angle_is_given_once_and_is_finite(a: float, b: float) -> None:
    with pytest.raises(ValueError, match="peak_deg=.* and peak_rad=.*: give one of them"):
        angle_rad("peak", a, b, 0.0)
    with pytest.raises(ValueError, match="peak: give peak_deg or peak_rad"):
        angle_rad("peak", None, None)
    with pytest.raises(ValueError, match="peak_rad"):
        angle_rad("peak", math.nan, None)


@given(t_s=some.integers(0, 4_000_000_000_000))
def test_text_and_seconds_name_the_same_time(t_s: int) -> None:
    seconds = t_s / 1e3
    assert time_s("start", utc_text(seconds), None) == pytest.approx(seconds, abs=1e-6)
    assert time_s("start", None, seconds) == seconds
    with pytest.raises(ValueError, match="give one of them"):
        time_s("start", utc_text(seconds), seconds)
    assert time_s("start", None, None) is None


@given(days=some.floats(1e-6, 1e3))
def test_hours_and_days_are_one_duration(days: float) -> None:
    assert span_s(None, days) == pytest.approx(span_s(24.0 * days, None))
    assert span_s(None, None) == DAY_S
    with pytest.raises(ValueError, match="give one of them"):
        span_s(1.0, days)
    for none in (0.0, -days):
        with pytest.raises(ValueError, match="must be > 0"):
            span_s(none, None)
