"""Alpha-5: how catalogue numbers above 99999 are squeezed into the five columns of a TLE.

The first character stands for the leading two digits: A = 10 ... Z = 33, without I and O, so 339999 (Z9999) is the
largest.  Anything else is refused; a wrong decoding would quietly track another object.
"""

__all__ = ["alpha5_from_number", "number_from_alpha5"]

_LETTERS = "ABCDEFGHJKLMNPQRSTUVWXYZ"
LARGEST = 339999


def number_from_alpha5(text: str) -> int:
    """Return the catalogue number of the five columns; the inverse is `alpha5_from_number`."""
    digits = text.strip()
    if digits.isascii() and digits.isdigit() and len(digits) <= 5:
        return int(digits)
    if len(digits) == 5 and digits[0] in _LETTERS and digits[1:].isascii() and digits[1:].isdigit():
        return (10 + _LETTERS.index(digits[0])) * 10000 + int(digits[1:])
    raise ValueError(f"catalogue number {text!r} is neither digits nor Alpha-5 (a letter except I and O, four digits)")


def alpha5_from_number(number: int) -> str:
    """Return the five columns of a catalogue number."""
    if not 0 <= number <= LARGEST:
        raise ValueError(f"catalogue_number={number} must be in [0, {LARGEST}] to fit a TLE; use OMM")
    if number < 100000:
        return f"{number:05d}"
    return f"{_LETTERS[number // 10000 - 10]}{number % 10000:04d}"
