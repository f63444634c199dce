"""OEM as stations receive it: what is refused, with its line, and which oddities change nothing."""

import math

import numpy as np
import pytest

from rf_pointing.ephemeris import (
    Elements,
    OemTarget,
    read_oem,
)
from test.ephemeris.oem_text import TIMES, teme_states, text_of


def test_a_message_without_interpolation_needs_one(cbers: Elements) -> None:
    text = text_of(teme_states(cbers), INTERPOLATION="", INTERPOLATION_DEGREE="")
    with pytest.raises(ValueError, match="CBERS 2 declares no INTERPOLATION"):
        OemTarget(read_oem(text))
    OemTarget(read_oem(text), interpolation=("LAGRANGE", 7)).motion_at(float(TIMES[3]))


@pytest.mark.parametrize(
    ("meta", "message"),
    [
        ({"CENTER_NAME": "MOON"}, "CENTER_NAME='MOON' must be EARTH"),
        ({"TIME_SYSTEM": "MET"}, "TIME_SYSTEM='MET' must be one of UTC, TAI"),
        ({"REF_FRAME": "TOD"}, "REF_FRAME='TOD' must be one of GCRF"),
        ({"INTERPOLATION": "SPLINE"}, "INTERPOLATION='SPLINE' must be one of HERMITE, LAGRANGE, LINEAR"),
        ({"INTERPOLATION_DEGREE": "many"}, "INTERPOLATION_DEGREE='many' must be a whole number"),
        ({"INTERPOLATION_DEGREE": "6"}, "INTERPOLATION_DEGREE=6 must be odd, 3 or more, for HERMITE"),
        ({"INTERPOLATION": "LAGRANGE", "INTERPOLATION_DEGREE": "15"}, "has 15 states, must have 16 for LAGRANGE"),
        ({"INTERPOLATION_DEGREE": "1"}, r"INTERPOLATION_DEGREE='1' must be a whole number in \[3, 15\] for HERMITE"),
        (
            {"USEABLE_START_TIME": "2006-06-27T05:11:00", "USEABLE_STOP_TIME": "2006-06-27T05:01:00"},
            "USEABLE_START_TIME=2006-06-27T05:11:00 must be before USEABLE_STOP_TIME=2006-06-27T05:01:00",
        ),
        ({"OBJECT_ID": "", "STOP_TIME": ""}, "CBERS 2 lacks OBJECT_ID, STOP_TIME"),
    ],
)
def test_bad_metadata_is_named(meta: dict[str, str], message: str, cbers: Elements) -> None:
    with pytest.raises(ValueError, match=message):
        OemTarget(read_oem(text_of(teme_states(cbers), **meta)))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("CCSDS_OEM_VERS", "CCSDS_OMM_VERS"), "line 1: CCSDS_OMM_VERS must be CCSDS_OEM_VERS"),
        (("META_START", "META_BEGIN"), "line 3: 'META_BEGIN' must read KEYWORD = value"),
        (("2006-06-27T05:00:20.000 ", "2006-06-27T05:00:20.000 7 "), "line 17: a state must have an epoch and 6 or 9"),
        (("2006-06-27T05:00:20.000 ", "2006-06-27T05:00:20.000 x"), "line 17: .* is not a number"),
        (("2006-06-27T05:00:20.000 ", "2006-06-27T04:00:20.000 "), "line 17: 2006-06-27T04:00:20.000 must be later"),
        (
            ("2006-06-27T05:00:20.000 ", "2006-06-27T04:59:60.000 "),
            "line 17: .* has second 60, must be < 60 in that minute",
        ),
        (("TIME_SYSTEM = UTC", "TIME_SYSTEM = UTC\nTIME_SYSTEM = TAI"), "line 9: TIME_SYSTEM is given twice"),
    ],
)
def test_malformed_text_is_refused_with_its_line(change: tuple[str, str], message: str, cbers: Elements) -> None:
    text = text_of(teme_states(cbers))
    assert change[0] in text
    with pytest.raises(ValueError, match=message):
        read_oem(text.replace(*change))


def test_a_message_that_ends_too_early_is_refused_and_one_that_ends_a_step_early_is_not(cbers: Elements) -> None:
    lines = text_of(teme_states(cbers)).splitlines()
    first = next(number for number, line in enumerate(lines) if line.startswith("2006"))
    assert OemTarget(read_oem("\n".join(lines[: first + 14]))).spans_t_s[0][1] == pytest.approx(TIMES[13] - 1.0)
    with pytest.raises(ValueError, match=r"STOP_TIME=.* lies 240 s beyond the states, must be <= 60 s .*whole"):
        read_oem("\n".join(lines[: first + 11]))


@pytest.mark.parametrize(
    ("factors", "message"),
    [
        ((1e3, 1e3), r"line 15: distance 7.*e\+06 km .* must be in \[5740, 3000000\] km"),
        ((1.0, 1e3), r"line 15: speed 74\d\d.* km/s must be <= 3\d\.\d+ km/s there"),
        ((1.0, 60.0), "line 15: speed 44"),
        ((1e-3, 1e-3), r"line 15: distance 7\.1"),
    ],
)
def test_states_in_other_units_than_km_are_refused(factors: tuple[float, float], message: str, cbers: Elements) -> None:
    states = [state * np.repeat(factors, 3) for state in teme_states(cbers)]
    with pytest.raises(ValueError, match=message):
        read_oem(text_of(states))


def test_a_byte_order_mark_and_windows_line_ends_change_nothing(cbers: Elements) -> None:
    text = text_of(teme_states(cbers))
    (plain,), (marked,) = read_oem(text), read_oem("\ufeff" + text.replace("\n", "\r\n"))
    np.testing.assert_array_equal(marked.position_m, plain.position_m)


def test_states_inside_a_leap_second_are_read() -> None:
    """Half a second steps over the end of 2016 are even in TAI."""
    epochs = ("2016-12-31T23:59:59.5", "2016-12-31T23:59:60.0", "2016-12-31T23:59:60.5", "2017-01-01T00:00:00.0")
    meta = {
        "OBJECT_NAME": "X", "OBJECT_ID": "X", "CENTER_NAME": "EARTH", "REF_FRAME": "ITRF", "TIME_SYSTEM": "UTC",
        "START_TIME": epochs[0], "STOP_TIME": epochs[-1], "INTERPOLATION": "LINEAR",
    }  # fmt: skip
    rows = [f"{epoch} {7000.0 + 3.5 * step} 0 0 7.0 0 0" for step, epoch in enumerate(epochs)]
    lines = [
        "CCSDS_OEM_VERS = 2.0",
        "META_START",
        *(f"{key} = {value}" for key, value in meta.items()),
        "META_STOP",
        *rows,
    ]
    (segment,) = read_oem("\n".join(lines))
    np.testing.assert_allclose(np.diff(segment.tai_s), 0.5, atol=1e-6)
    with pytest.raises(ValueError, match="line 13: .* has second 60, must be < 60"):
        read_oem("\n".join(lines).replace("TIME_SYSTEM = UTC", "TIME_SYSTEM = TAI"))


def test_a_message_with_nan_is_refused(cbers: Elements) -> None:
    states = teme_states(cbers)
    states[3] = np.array([math.nan, *states[3][1:]])
    with pytest.raises(ValueError, match="must hold finite numbers"):
        read_oem(text_of(states))
