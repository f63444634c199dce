"""Writing TLE: the verification file comes back column by column, and what does not fit is refused."""

import dataclasses
import math
from pathlib import Path

import pytest
import sgp4

from rf_pointing.ephemeris import Elements, read_elements, tle_lines, verification_elements

ODD = {"09998", "11801", "20413"}
"""Written by other hands: a blank ephemeris type, and +0 for the exponent of zero."""


def test_the_verification_file_comes_back_column_by_column() -> None:
    lines = [
        line[:69]
        for line in (Path(sgp4.__file__).parent / "SGP4-VER.TLE").read_text().splitlines()
        if line[0] in "12" and line[2:7] not in ("33333", "33334", "33335")
    ]
    for elements, line1, line2 in zip(verification_elements(), lines[::2], lines[1::2], strict=True):
        first, second = tle_lines(elements)
        assert second == line2
        assert line1[2:7] in ODD or first == line1


def test_numbers_up_to_339999_are_written_in_alpha5(cbers: Elements) -> None:
    large = dataclasses.replace(cbers, catalogue_number=271828)
    assert tle_lines(large)[0][2:7] == "T1828"
    assert read_elements("\n".join(tle_lines(large)))[0].catalogue_number == 271828


def test_angles_that_round_to_a_full_turn_become_zero(cbers: Elements) -> None:
    lines = tle_lines(dataclasses.replace(cbers, ascending_node_rad=2.0 * math.pi - 1e-9, mean_anomaly_rad=-1e-9))
    (back,) = read_elements("\n".join(lines))
    assert (back.ascending_node_rad, back.mean_anomaly_rad) == (0.0, 0.0)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"catalogue_number": 340000}, "catalogue_number=340000 must be in"),
        ({"epoch_t_s": 3.0e9}, "is in 2065, must be in 1957 to 2056"),
        ({"mean_motion_dot_rad_s2": 3e-9}, "mean_motion_dot_rad_s2 is .* must be below 1"),
        ({"drag_per_earth_radius": 2e9}, "drag_per_earth_radius=2000000000.0 must be below 1e9"),
        ({"revolution_number": 123456}, "do not fit the columns"),
    ],
)
def test_what_does_not_fit_is_refused(cbers: Elements, change: dict[str, float], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        tle_lines(dataclasses.replace(cbers, **change))
