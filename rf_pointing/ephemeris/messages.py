"""Reading elements from text of any supported form: the form is recognised from the text itself."""

from rf_pointing.ephemeris.elements import Elements
from rf_pointing.ephemeris.tle import read_tle

__all__ = ["read_elements"]


def read_elements(text: str) -> list[Elements]:
    """Return all elements in `text`; nothing recognisable, or nothing at all, is refused."""
    found = read_tle(text)
    if not found:
        raise ValueError("text holds no elements")
    return found
