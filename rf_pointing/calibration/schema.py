"""Reading a nested mapping with errors that name the key: the checks behind the model file."""

from collections.abc import Mapping
from typing import Any

from rf_pointing.core import require_finite
from rf_pointing.core.dates import from_utc_text

__all__ = ["Section"]


class Section:
    """One mapping of a file: every key must be known, every needed key present, every value of its type."""

    def __init__(self, value: Any, path: str, needed: tuple[str, ...], optional: tuple[str, ...] = ()) -> None:
        if not isinstance(value, Mapping):
            raise ValueError(f"{path or 'file'} must be a mapping of keys to values")
        self.path, self.values = path, value
        unknown = [str(key) for key in value if key not in needed + optional]
        if unknown:
            raise ValueError(f"{self.key(unknown[0])} is not a known key; known: {', '.join(needed + optional)}")
        missing = [key for key in needed if key not in value]
        if missing:
            raise ValueError(f"{self.key(missing[0])} is missing")

    def key(self, name: str) -> str:
        """Return the full path of a key."""
        return f"{self.path}.{name}" if self.path else name

    def has(self, name: str) -> bool:
        """Return whether an optional key is given and not null."""
        return self.values.get(name) is not None

    def section(self, name: str, needed: tuple[str, ...], optional: tuple[str, ...] = ()) -> "Section":
        """Return a nested mapping."""
        return Section(self.values[name], self.key(name), needed, optional)

    def text(self, name: str) -> str:
        """Return a non-empty text."""
        value = self.values[name]
        if not isinstance(value, str) or not value:
            raise ValueError(f"{self.key(name)}={value!r} must be a text")
        return value

    def flag(self, name: str) -> bool:
        """Return true or false."""
        value = self.values[name]
        if not isinstance(value, bool):
            raise ValueError(f"{self.key(name)}={value!r} must be true or false")
        return value

    def number(self, name: str) -> float:
        """Return a finite number."""
        value = self.values[name]
        if isinstance(value, bool) or not isinstance(value, (int, float)):
            raise ValueError(f"{self.key(name)}={value!r} must be a number")
        require_finite(self.key(name), value)
        return float(value)

    def whole(self, name: str) -> int:
        """Return a whole number >= 0."""
        value = self.values[name]
        if isinstance(value, bool) or not isinstance(value, int) or value < 0:
            raise ValueError(f"{self.key(name)}={value!r} must be a whole number >= 0")
        return value

    def time(self, name: str) -> float:
        """Return UTC seconds since 1970 of an ISO text ending in Z."""
        text = self.text(name)
        if not text.endswith("Z"):
            raise ValueError(f"{self.key(name)}={text!r} must be a time like 2026-03-21T05:11:02Z")
        try:
            return from_utc_text(text)
        except ValueError as error:
            raise ValueError(f"{self.key(name)}: {error}") from None

    def texts(self, name: str) -> tuple[str, ...]:
        """Return a list of texts."""
        value = self.values[name]
        if not isinstance(value, list) or not all(isinstance(item, str) for item in value):
            raise ValueError(f"{self.key(name)} must be a list of texts")
        return tuple(value)

    def numbers(self, name: str, count: int) -> list[list[float]]:
        """Return a square matrix of finite numbers."""
        value = self.values[name]
        square = isinstance(value, list) and len(value) == count
        if not square or not all(isinstance(row, list) and len(row) == count for row in value):
            raise ValueError(f"{self.key(name)} must be a list of {count} lists of {count} numbers")
        for i, row in enumerate(value):
            for j, item in enumerate(row):
                if isinstance(item, bool) or not isinstance(item, (int, float)):
                    raise ValueError(f"{self.key(name)}[{i}][{j}]={item!r} must be a number")
                require_finite(f"{self.key(name)}[{i}][{j}]", item)
        return [[float(item) for item in row] for row in value]
