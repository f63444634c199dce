"""Numbers of a command line, refused in the units in which they were typed."""

import argparse
from collections.abc import Callable

__all__ = ["between", "seed"]


def between(low: float, high: float) -> Callable[[str], float]:
    """Return an argparse type: a number from `low` to `high`."""

    def parse(text: str) -> float:
        try:
            value = float(text)
        except ValueError as error:
            raise argparse.ArgumentTypeError(f"{text!r} must be a number") from error
        if not low <= value <= high:
            raise argparse.ArgumentTypeError(f"{text} must be between {low:g} and {high:g}")
        return value

    return parse


def seed(text: str) -> int:
    """Return the seed of a run; an argparse type with the range that the nodes' parameters have."""
    if not text.isdecimal() or int(text) >= 2**31:
        raise argparse.ArgumentTypeError(f"{text} must be a whole number from 0 to {2**31 - 1}")
    return int(text)
