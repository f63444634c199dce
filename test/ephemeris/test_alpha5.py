"""Alpha-5: the published corner values, closure over the whole range, and refusals instead of zero."""

import pytest

from rf_pointing.ephemeris.alpha5 import alpha5_from_number, number_from_alpha5


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
