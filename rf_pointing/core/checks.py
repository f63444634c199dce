"""Checks of values: the message of every error carries the name, the value and the bound."""

import math
import re
import sys
from collections.abc import Collection, Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rf_pointing.core.types import Array

LONGEST_NAME = 100
"""Longest name of a pass, a satellite, a band or a station, in characters."""
LARGEST = 1e18
"""Largest number of a list, a table or a message; metres to the nearest star are 4e16."""
_MAX = sys.float_info.max
_ID = re.compile(r"[A-Za-z0-9][A-Za-z0-9 ._+()-]*")


def require_id(name: str, text: Any) -> None:
    """Raise ValueError for a text that must not become the name of a file or a folder."""
    if not isinstance(text, str) or len(text) > LONGEST_NAME or not _ID.fullmatch(text):
        raise ValueError(
            f"{name}={brief(text)} must be <= {LONGEST_NAME} letters (A-Z), digits, blanks and ._+()-, a letter or "
            "digit first"
        )


def id_of(text: str) -> str:
    """Return the beginning of a text as `require_id` allows it, with _ for every other sign."""
    return (
        re.sub(r"[^A-Za-z0-9.+()-]", "_", text[: LONGEST_NAME - 20]).lstrip("._+()-") or "unnamed"
    )


def require_name(name: str, text: Any) -> None:
    """Raise ValueError for a name that is not one short line of printable signs."""
    if not isinstance(text, str) or len(text) > LONGEST_NAME or not text.isprintable():
        raise ValueError(
            f"{name}={brief(text)} must be one line of <= {LONGEST_NAME} printable signs"
        )


def name_of(text: str) -> str:
    """Return the beginning of a text as `require_name` allows it, with ? for every other sign."""
    if len(text) <= LONGEST_NAME and text.isprintable():
        return text
    return "".join(each if each.isprintable() else "?" for each in text[:LONGEST_NAME])


def brief(value: Any) -> str:
    """Return a value as a message shows it, whatever its length."""
    text = repr(value)
    return text if len(text) <= LONGEST_NAME else f"{text[:LONGEST_NAME]}..."


def is_number(value: Any, low: float = -LARGEST, high: float = LARGEST) -> bool:
    """Return whether a value of a list or a table is a number within bounds, not NaN or True."""
    # Compared as it is: float() raises for a whole number of 400 digits.
    return isinstance(value, (int, float)) and not isinstance(value, bool) and low <= value <= high


def names_in(name: str, value: Any) -> tuple[str, ...]:
    """Return the names of a list, nothing for None; ValueError for whatever else it holds."""
    given = () if value is None else value
    if not isinstance(given, (list, tuple)) or not all(type(each) in (str, int) for each in given):
        raise ValueError(f"{name}={brief(value)} must be a list of names")
    return tuple(map(str, given))


def require_finite(name: str, value: ArrayLike) -> None:
    """Raise ValueError unless every element of `value` is a finite number."""
    # Loops call this for single numbers thousands of times a second; numpy takes twenty times
    # longer for one.
    if isinstance(value, float):
        finite = math.isfinite(value)
    elif isinstance(value, int):
        # A whole number of 400 digits is larger than any float: `isfinite` raises for it.
        finite = -_MAX <= value <= _MAX
    else:
        finite = _all_finite(np.asarray(value))
    if not finite:
        raise ValueError(f"{name}={np.asarray(value)} must be finite")


def all_finite(*values: float) -> bool:
    """Return whether the sum of some floats is finite: if it is, so are they all.

    Finite numbers may have another sum too: a caller then looks at each.
    """
    try:
        return math.isfinite(sum(values))
    except OverflowError:
        return False


def require_between(name: str, value: float, low: float | None, high: float | None) -> None:
    """Raise ValueError unless `value` is finite and low <= value <= high (None: unbounded)."""
    # Without a call for what is within; infinity less itself is NaN.
    if (low is None or value >= low) and (high is None or value <= high) and value - value == 0.0:
        return
    require_finite(name, value)
    if low is not None and value < low:
        raise ValueError(f"{name}={value} must be >= {low}")
    if high is not None and value > high:
        raise ValueError(f"{name}={value} must be <= {high}")


def near_names(name: str, known: Iterable[str], cutoff: float = 0.7) -> list[str]:
    """Return the known names that `name` may be meant for, the nearest first; case is ignored."""
    # Imported late: a node that starts has no wrong name.
    import difflib

    plain = {each.casefold(): each for each in known}
    return [
        plain[each] for each in difflib.get_close_matches(name.casefold(), plain, cutoff=cutoff)
    ]


def one_of(value: str, choices: Iterable[str]) -> str:
    """Return "one of A, B, C" for a refused value, and which of them may be meant."""
    names = list(choices)
    near = near_names(value, names)[:1]
    return f"one of {', '.join(names) or 'none'}" + "".join(
        f"; did you mean {each}?" for each in near
    )


def require_choice(name: str, value: str, choices: Collection[str]) -> None:
    """Raise ValueError unless `value` is one of `choices`."""
    if not isinstance(value, str) or value not in choices:
        raise ValueError(
            f"{name}={brief(value)} must be {one_of(str(value), filter(None, choices))}"
        )


def as_finite_array(name: str, value: ArrayLike, shape: tuple[int | None, ...]) -> Array:
    """Return `value` as a float array of `shape` (None: any length), or raise ValueError."""
    array = np.asarray(value, dtype=np.float64)
    # The first comparisons settle nearly all calls.
    if array.shape == shape and _all_finite(array):
        return array
    fits = array.shape == shape or (
        array.ndim == len(shape)
        and all(want is None or want == have for want, have in zip(shape, array.shape, strict=True))
    )
    if not fits:
        wanted = tuple("n" if want is None else want for want in shape)
        raise ValueError(f"{name} has shape {array.shape}, must be {wanted}")
    require_finite(name, array)
    return array


def as_finite_pair(name: str, value: ArrayLike) -> tuple[float, float]:
    """Return `value` (2,) as two plain floats, or raise ValueError; fast, for control loops."""
    if isinstance(value, np.ndarray) and value.shape == (2,):
        first, second = value.tolist()
    elif isinstance(value, (tuple, list)) and len(value) == 2:
        first, second = float(value[0]), float(value[1])
    else:
        first, second = as_finite_array(name, value, (2,)).tolist()
    # The sum of both first: one call for two.
    if not (math.isfinite(first + second) or (math.isfinite(first) and math.isfinite(second))):
        raise ValueError(f"{name}={[first, second]} must be finite")
    return first, second


def _all_finite(array: NDArray[Any]) -> bool:
    # One call of BLAS, which warns of nothing; where squares overflow each number is looked at.  Of
    # long arrays it would wake its threads, which wait for a busy processor.
    if array.dtype == np.float64 and array.size <= 4096 and math.isfinite(np.vdot(array, array)):
        return True
    return bool(np.isfinite(array).all())


@dataclass(frozen=True, slots=True)
class Line:
    """One property of a device: whether it has it, and what was measured and what is stated."""

    name: str
    passed: bool
    text: str

    def __str__(self) -> str:
        return f"{'pass' if self.passed else 'FAIL'}  {self.name:<22} {self.text}"
