"""Lines of CCSDS keyword-value notation."""

import pytest

from rf_pointing.core.kvn import key_and_value, without_unit


@pytest.mark.parametrize("line", ["", "   ", "COMMENT", "  COMMENT a = b"])
def test_blank_lines_and_comments_hold_nothing(line: str) -> None:
    assert key_and_value(line, 3) is None


def test_a_keyword_ends_at_the_first_equals_sign() -> None:
    assert key_and_value("  OBJECT_NAME =  A = B ", 3) == ("OBJECT_NAME", "A = B")


@pytest.mark.parametrize("line", ["EPOCH 2006-06-26", "EPOCH", "Epoch = 2006", "= 5", "TWO WORDS = 5", "COMMENTS"])
def test_what_is_no_keyword_and_value_is_refused_with_its_line(line: str) -> None:
    with pytest.raises(ValueError, match=rf"^line 3: '{line}' must read KEYWORD = value$"):
        key_and_value(line, 3)


@pytest.mark.parametrize(
    ("text", "wanted"),
    [
        ("98.4 [deg]", ("98.4", "deg")),
        ("  98.4[ km/s ] ", ("98.4", "km/s")),
        ("7000", ("7000", "")),
        (" 7000 ", ("7000", "")),
        ("a [b] c", ("a [b] c", "")),
        ("[deg]", ("", "deg")),
    ],
)
def test_a_unit_stands_in_brackets_behind_the_value(text: str, wanted: tuple[str, str]) -> None:
    assert without_unit(text) == wanted
