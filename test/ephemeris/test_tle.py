"""TLE: the verification file of AIAA 2006-6753, field by field against the sgp4 reader, and malformed text.

Alpha-5: the published corner values, closure over the whole range, and refusals instead of zero.

Writing TLE: the verification file comes back column by column, and what does not fit is refused.
"""

import dataclasses
import math
from pathlib import Path

import numpy as np
import pytest
import sgp4
from sgp4.api import Satrec

from rf_pointing.core.dates import from_utc_text
from rf_pointing.ephemeris import Elements, read_elements, tle_lines, verification_elements
from rf_pointing.ephemeris.tle import alpha5_from_number, checksum, number_from_alpha5

LINE1 = "1 28057U 03049A   06177.78615833  .00000060  00000-0  35940-4 0  1836"
LINE2 = "2 28057  98.4283 247.6961 0000884  88.1964 271.9322 14.35478080140550"
POSITION_KM = 1e-5


def file_pairs() -> list[tuple[str, str]]:
    lines = [
        line
        for line in (Path(sgp4.__file__).parent / "SGP4-VER.TLE").read_text().splitlines()
        if line[0] in "12" and line[2:7] not in ("33333", "33334", "33335")
    ]
    return [(first[:69], second[:69]) for first, second in zip(lines[::2], lines[1::2], strict=True)]


def test_every_verification_object_propagates_as_in_the_sgp4_reader() -> None:
    """Epochs are kept as seconds: 0.2 microseconds, 2 mm along a low orbit, 4 mm for the object that moves fastest."""
    for elements, (line1, line2) in zip(verification_elements(), file_pairs(), strict=True):
        ours, theirs = elements.satrec(), Satrec.twoline2rv(line1, line2)
        assert elements.catalogue_number == theirs.satnum
        for minutes in (0.0, 17.0, 360.0, 1440.0):
            (code, position, _), (wanted_code, wanted, _) = ours.sgp4_tsince(minutes), theirs.sgp4_tsince(minutes)
            assert code == wanted_code
            np.testing.assert_allclose(position, wanted, rtol=0.0, atol=POSITION_KM)


def test_a_classification_is_read_and_without_one_an_object_is_unclassified() -> None:
    """C is classified and S secret, by Space-Track; none of them counts in the checksum."""
    for column, wanted in (("C", "C"), ("S", "S"), (" ", "U")):
        (found,) = read_elements(f"{LINE1[:7]}{column}{LINE1[8:]}\n{LINE2}")
        assert found.classification == wanted


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (LINE1.replace("03049A", "03049B")[:-1] + "5\n" + LINE2, "line 1: checksum of object 28057 is 6, .* states 5"),
        (f"{LINE1}\n{LINE2[:-1]}9", "line 2: checksum of object 28057 is 0, the line states 9"),
        (f"{LINE1}\n{LINE2[:60]}", "line 2: TLE line has 60 columns, must have 69"),
        (
            f"{LINE1}\n2 28129  54.7298 324.8098 0048506 266.2640  93.1663  2.00562768 18443",
            "of object 28129, line 1 of",
        ),
        (LINE2, "line 1: line 2 of a TLE without line 1"),
        (LINE1, "line 1: the text has no line 2 after '1 28057U"),
        (f"{LINE1}\n{LINE1}", "line 1: the text has no line 2 .*; line 2: the text has no line 2"),
        (f"{LINE1}0\n{LINE2}", "line 1: TLE line has 70 columns, must have 69"),
        (f"{LINE1[:-1]}\n{LINE2}", "line 1: TLE line has 68 columns, must have 69"),
        (f"{LINE1[:-1]}\n{LINE2[:-2]}", "line 1: TLE line has 68 columns, must have 69"),
        (f"{LINE1[:62]}4{LINE1[63:-1]}0\n{LINE2}", "line 1: ephemeris type 4 is SGP4-XP"),
        ("", "no elements"),
        ("# only a comment", "no elements"),
    ],
)
def test_malformed_text_is_refused_with_its_line(text: str, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        read_elements(text)


@pytest.mark.parametrize(
    ("line", "columns", "text", "message"),
    [
        (1, slice(20, 32), "3b7.78615833", "epoch day"),
        (1, slice(20, 32), "366.00000000", "has day 366 of 2006, must be >= 1 and < 366"),
        (1, slice(20, 32), "999.78615833", r"has day 999.786 of 2006, must be >= 1 and < 366"),
        (1, slice(53, 61), " 3594x-4", "B\\*"),
        (1, slice(2, 7), "I8057", "neither digits nor Alpha-5"),
        (2, slice(8, 16), " 98,4283", "inclination"),
        (2, slice(8, 16), "198.4283", r"inclination 198.4283 must be in \[0, 180\]"),
        (2, slice(26, 33), "0-00884", "eccentricity"),
        (2, slice(52, 63), "00.00000000", r"mean motion 00.00000000 must be in \[0.001, 20\]"),
    ],
)
def test_a_bad_field_is_named_even_when_the_checksum_is_right(
    line: int, columns: slice, text: str, message: str
) -> None:
    lines = [LINE1, LINE2]
    for index in (0, 1) if columns == slice(2, 7) else (line - 1,):
        changed = list(lines[index][:68])
        changed[columns] = text
        digit = sum(int(c) if c.isdigit() else c == "-" for c in changed) % 10
        lines[index] = "".join(changed) + str(digit)
    with pytest.raises(ValueError, match=message):
        read_elements("\n".join(lines))


@pytest.mark.parametrize(
    ("text", "number"), [("00005", 5), ("99999", 99999), ("A0000", 100000), ("H9999", 179999), ("J0000", 180000),
                         ("N9999", 229999), ("P0000", 230000), ("T0002", 270002), ("Z9999", 339999)]
)  # fmt: skip
def test_space_tracks_examples(text: str, number: int) -> None:
    assert number_from_alpha5(text) == number
    assert alpha5_from_number(number) == text


def test_every_step_of_the_range_closes() -> None:
    for number in range(0, 340000, 313):
        assert number_from_alpha5(alpha5_from_number(number)) == number


@pytest.mark.parametrize("text", ["I0000", "O1234", "a0000", "0A000", "A 000", "", "AAAAA", "123456", "٣٤٥٦٧"])
def test_what_it_cannot_represent_is_refused_never_zero(text: str) -> None:
    with pytest.raises(ValueError, match="neither digits nor Alpha-5"):
        number_from_alpha5(text)


@pytest.mark.parametrize("number", [-1, 340000, 799500000])
def test_numbers_that_do_not_fit_are_refused(number: int) -> None:
    with pytest.raises(ValueError, match=f"catalogue_number={number} must be in .*use OMM"):
        alpha5_from_number(number)


ODD = {"09998", "11801", "20413"}
"""Written by other hands: a blank ephemeris type, and +0 for the exponent of zero."""


def test_the_verification_file_comes_back_column_by_column() -> None:
    for elements, (line1, line2) in zip(verification_elements(), file_pairs(), strict=True):
        first, second = tle_lines(elements)
        assert second == line2
        assert line1[2:7] in ODD or first == line1


def test_angles_that_round_to_a_full_turn_become_zero(cbers: Elements) -> None:
    lines = tle_lines(dataclasses.replace(cbers, ascending_node_rad=2.0 * math.pi - 1e-9, mean_anomaly_rad=-1e-9))
    (back,) = read_elements("\n".join(lines))
    assert (back.ascending_node_rad, back.mean_anomaly_rad) == (0.0, 0.0)


@pytest.mark.parametrize("year", [1960, 1971, 1999, 2000, 2023, 2055])
def test_an_epoch_that_rounds_into_the_next_year_is_its_first_day(
    cbers: Elements, random: np.random.Generator, year: int
) -> None:
    new_year_s = from_utc_text(f"{year + 1}-01-01T00:00:00")
    for before_s in [0.0, 1e-6, 4.31e-4, 4.33e-4, *random.uniform(0.0, 2e-3, 50).tolist()]:
        written = dataclasses.replace(cbers, epoch_t_s=new_year_s - before_s)
        (back,) = read_elements("\n".join(tle_lines(written)))
        # 1e-8 days.
        assert back.epoch_t_s == pytest.approx(written.epoch_t_s, abs=0.44e-3)


def test_an_epoch_that_rounds_beyond_2056_is_refused(cbers: Elements) -> None:
    with pytest.raises(ValueError, match="is in 2057, must be in 1957 to 2056"):
        tle_lines(dataclasses.replace(cbers, epoch_t_s=from_utc_text("2057-01-01T00:00:00") - 1e-4))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"mean_motion_dot_rad_s2": 3e-9}, "mean_motion_dot_rad_s2 is .* must be below 1"),
        ({"drag_per_earth_radius": 2e9}, "drag_per_earth_radius=2000000000.0 must be below 1e9"),
        ({"revolution_number": 123456}, "do not fit the columns"),
    ],
)
def test_what_does_not_fit_is_refused(cbers: Elements, change: dict[str, float], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        tle_lines(dataclasses.replace(cbers, **change))


def test_drag_below_the_smallest_exponent_of_a_tle_is_written_as_none(cbers: Elements) -> None:
    for drag, columns in ((5.4e-10, " 54000-9"), (1.0e-10, " 10000-9"), (9.9e-11, " 00000-0"), (-3e-14, " 00000-0"),
                          (-0.25, "-25000-0"), (4.0, " 40000+1")):  # fmt: skip
        first, _ = tle_lines(dataclasses.replace(cbers, drag_per_earth_radius=drag))
        assert first[53:61] == columns
        (back,) = read_elements("\n".join(tle_lines(dataclasses.replace(cbers, drag_per_earth_radius=drag))))
        assert back.drag_per_earth_radius == pytest.approx(drag, abs=1e-10)


def with_columns(line: str, begin: int, text: str) -> str:
    changed = line[:begin] + text + line[begin + len(text) :]
    return changed[:68] + str(checksum(changed))


def test_every_column_of_a_number_is_read() -> None:
    """All of them filled with digits of their own."""
    line1 = with_columns(LINE1, 33, "-.12345678")
    line1 = with_columns(line1, 44, "-98765-4")
    line1 = with_columns(line1, 53, "-13579-2")
    line1 = with_columns(line1, 64, "9876")
    line2 = with_columns(LINE2, 8, "123.4567")
    for begin, text in (
        (17, "234.5678"), (26, "1234567"), (34, "345.6789"), (43, "156.7891"), (52, "12.34567891"),
        (63, "98765"),
    ):  # fmt: skip
        line2 = with_columns(line2, begin, text)
    (found,) = read_elements(f"{line1}\n{line2}")
    day_s, turn = 86400.0, 2.0 * math.pi
    assert found.mean_motion_dot_rad_s2 == pytest.approx(-2.0 * 0.12345678 * turn / day_s**2, rel=1e-12)
    assert found.mean_motion_ddot_rad_s3 == pytest.approx(-6.0 * 0.98765e-4 * turn / day_s**3, rel=1e-12)
    assert found.drag_per_earth_radius == pytest.approx(-0.13579e-2, rel=1e-12)
    assert (found.element_set_number, found.revolution_number) == (9876, 98765)
    degrees = (found.inclination_rad, found.ascending_node_rad, found.argument_of_perigee_rad, found.mean_anomaly_rad)
    assert np.degrees(degrees) == pytest.approx([123.4567, 234.5678, 345.6789, 156.7891], rel=1e-12)
    assert found.eccentricity == pytest.approx(0.1234567, rel=1e-12)
    assert found.mean_motion_rad_s == pytest.approx(12.34567891 * turn / day_s, rel=1e-12)
    assert tle_lines(found) == (line1, line2)


@pytest.mark.parametrize(("columns", "year"), [("57", 1957), ("99", 1999), ("00", 2000), ("56", 2056)])
def test_two_digits_of_a_year_are_of_1957_to_2056(columns: str, year: int) -> None:
    line1 = with_columns(with_columns(LINE1, 9, f"{columns}001ABC"), 18, f"{columns}001.00000000")
    (found,) = read_elements(f"{line1}\n{LINE2}")
    assert found.epoch_t_s == from_utc_text(f"{year}-01-01T00:00:00")
    assert found.international_designator == f"{year}-001ABC"
    assert tle_lines(found)[0] == line1


def test_a_blank_drag_is_none() -> None:
    (found,) = read_elements(with_columns(LINE1, 53, " " * 8) + f"\n{LINE2}")
    assert found.drag_per_earth_radius == 0.0
