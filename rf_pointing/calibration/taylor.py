"""Truncated Taylor series in time: a motion and its derivatives pass through a formula together.

A series is an array of shape (m, ...): element k is the k-th time derivative divided by k!.  The rules are the
textbook recurrences (Cauchy product and its inverses), so velocities and accelerations of the joints are exact, not
finite differences.
"""

import math

import numpy as np
from numpy.typing import NDArray

__all__ = ["angle_of", "derivative", "divide", "from_derivatives", "multiply", "sine_cosine", "square_root", "truncate"]

Array = NDArray[np.float64]


def from_derivatives(*derivatives: Array | float) -> Array:
    """Return the series whose value, first, second ... derivatives are given (broadcast together)."""
    stacked = np.stack(np.broadcast_arrays(*(np.asarray(d, dtype=np.float64) for d in derivatives)))
    for k in range(2, len(stacked)):
        stacked[k] /= math.factorial(k)
    return stacked


def derivative(series: Array, times: int = 1) -> Array:
    """Return the series of the time derivative; what lies beyond the known order is taken as zero."""
    result = np.zeros_like(series)
    for k in range(len(series) - times):
        result[k] = series[k + times] * (math.factorial(k + times) / math.factorial(k))
    return result


def truncate(series: Array, length: int) -> Array:
    """Return the first `length` elements; they do not depend on the dropped ones."""
    return series[:length]


def multiply(a: Array, b: Array) -> Array:
    """Return the series of a * b."""
    return np.stack([sum((a[j] * b[k - j] for j in range(1, k + 1)), start=a[0] * b[k]) for k in range(len(a))])


def divide(a: Array, b: Array) -> Array:
    """Return the series of a / b."""
    quotient: list[Array] = []
    for k in range(len(a)):
        known = sum((b[j] * quotient[k - j] for j in range(1, k + 1)), start=np.zeros_like(a[0]))
        quotient.append((a[k] - known) / b[0])
    return np.stack(quotient)


def square_root(a: Array) -> Array:
    """Return the series of sqrt(a), a > 0."""
    root: list[Array] = [np.sqrt(a[0])]
    for k in range(1, len(a)):
        known = sum((root[j] * root[k - j] for j in range(1, k)), start=np.zeros_like(a[0]))
        root.append((a[k] - known) / (2.0 * root[0]))
    return np.stack(root)


def sine_cosine(a: Array) -> tuple[Array, Array]:
    """Return the series of sin(a) and cos(a)."""
    sine, cosine = [np.sin(a[0])], [np.cos(a[0])]
    for k in range(1, len(a)):
        sine.append(sum((j * a[j] * cosine[k - j] for j in range(2, k + 1)), start=a[1] * cosine[k - 1]) / k)
        cosine.append(-sum((j * a[j] * sine[k - j] for j in range(2, k + 1)), start=a[1] * sine[k - 1]) / k)
    return np.stack(sine), np.stack(cosine)


def angle_of(y: Array, x: Array) -> Array:
    """Return the series of atan2(y, x), its value in (-pi, pi]."""
    value = np.arctan2(y[0], x[0])[np.newaxis]
    if len(y) == 1:
        return value
    turning = multiply(x, derivative(y)) - multiply(y, derivative(x))
    rate = divide(turning, multiply(x, x) + multiply(y, y))[:-1]
    order = np.arange(1.0, len(y)).reshape(-1, *([1] * (y.ndim - 1)))
    return np.concatenate([value, rate / order])
