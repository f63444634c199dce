"""Checks of values: the message of every error carries the name, the value and the bound."""

import math
from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray


def require_finite(name: str, value: ArrayLike) -> None:
    """Raise ValueError unless every element of `value` is a finite number."""
    # Loops call this for single numbers thousands of times a second; numpy takes twenty times
    # longer for one.
    finite = math.isfinite(value) if isinstance(value, (float, int)) else _all_finite(np.asarray(value))
    if not finite:
        raise ValueError(f"{name}={np.asarray(value)} must be finite")


def require_between(name: str, value: float, low: float | None, high: float | None) -> None:
    """Raise ValueError unless `value` is finite and low <= value <= high (None: unbounded)."""
    require_finite(name, value)
    if low is not None and value < low:
        raise ValueError(f"{name}={value} must be >= {low}")
    if high is not None and value > high:
        raise ValueError(f"{name}={value} must be <= {high}")


def require_choice(name: str, value: str, choices: Iterable[str]) -> None:
    """Raise ValueError unless `value` is one of `choices`."""
    names = list(choices)
    if value not in names:
        raise ValueError(f"{name}={value!r} must be one of {', '.join(names)}")


def as_finite_array(name: str, value: ArrayLike, shape: tuple[int | None, ...]) -> NDArray[np.float64]:
    """Return `value` as a float array of `shape` (None: any length), or raise ValueError."""
    array = np.asarray(value, dtype=np.float64)
    # The first comparison settles nearly all calls.
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
    if not (math.isfinite(first) and math.isfinite(second)):
        raise ValueError(f"{name}={[first, second]} must be finite")
    return first, second


def _all_finite(array: NDArray[Any]) -> bool:
    # A reduction of numpy costs as much as sixteen plain calls.
    if array.size <= 16 and array.dtype == np.float64:
        return all(map(math.isfinite, array.ravel().tolist()))
    return bool(np.isfinite(array).all())
