"""Lines of CCSDS messages in keyword = value notation (KVN)."""

import re

_WITH_UNIT = re.compile(r"(.*?)\s*\[([^\]]*)\]\s*", re.DOTALL)


def without_unit(text: str) -> tuple[str, str]:
    """Return a value and the unit behind it, as in 98.4 [deg]; "" for none."""
    match = _WITH_UNIT.fullmatch(text)
    return (match[1].strip(), match[2].strip()) if match else (text.strip(), "")


def key_and_value(line: str, number: int) -> tuple[str, str] | None:
    """Return the keyword and its value, None for a blank line or a comment; else ValueError."""
    text = line.strip()
    if not text or text == "COMMENT" or text.startswith("COMMENT "):
        return None
    key, separator, value = text.partition("=")
    if not separator or not re.fullmatch(r"[A-Z0-9_]+", key.strip()):
        raise ValueError(f"line {number}: {text[:40]!r} must read KEYWORD = value")
    return key.strip(), value.strip()
