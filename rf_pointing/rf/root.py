"""One root of one function, without the half second that importing a library for it takes at a node's start."""

from collections.abc import Callable

__all__ = ["bracketed_root"]

_MOST_STEPS = 200


def bracketed_root(function: Callable[[float], float], low: float, high: float, tolerance: float = 1e-14) -> float:
    """Return where `function` changes sign between `low` and `high`, by regula falsi (Illinois), to `tolerance`.

    Raises
    ------
    ValueError
        If the function has the same sign at both ends.
    """
    at_low, at_high = function(low), function(high)
    if at_low * at_high > 0.0:
        raise ValueError(f"no sign change between {low} ({at_low}) and {high} ({at_high})")
    root, side = low, 0
    for _ in range(_MOST_STEPS):
        previous, root = root, (low * at_high - high * at_low) / (at_high - at_low)
        value = function(root)
        if value == 0.0 or abs(root - previous) <= tolerance:
            break
        if value * at_high > 0.0:
            high, at_high = root, value
            at_low *= 0.5 if side == -1 else 1.0
            side = -1
        else:
            low, at_low = root, value
            at_high *= 0.5 if side == 1 else 1.0
            side = 1
    return root
