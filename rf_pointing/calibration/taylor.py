"""Truncated Taylor series in time: a motion and its derivatives pass through a formula together.

A series is an array of shape (m, ...): element k is the k-th time derivative divided by k!.  The
rules are the textbook recurrences (Cauchy product and its inverses), so velocities and
accelerations of the joints are exact, not finite differences.
"""

import math

import numpy as np

from rf_pointing.core.types import Array


def from_derivatives(*derivatives: Array | float) -> Array:
    """Return the series of the given value, first, second ... derivatives (broadcast)."""
    stacked = np.stack(np.broadcast_arrays(*(np.asarray(d, dtype=np.float64) for d in derivatives)))
    # Elements are derivatives over factorials: products are then plain sums of products.
    for k in range(2, len(stacked)):
        stacked[k] /= math.factorial(k)
    return stacked


def derivative(series: Array, times: int = 1) -> Array:
    """Return the series of the time derivative; beyond the known order it is zero."""
    result = np.zeros_like(series)
    for k in range(len(series) - times):
        result[k] = series[k + times] * (math.factorial(k + times) / math.factorial(k))
    return result


def constant(value: float, like: Array) -> Array:
    """Return the series of a constant, in the shape of `like`."""
    series = np.zeros_like(like)
    series[0] = value
    return series


def multiply(a: Array, b: Array) -> Array:
    """Return the series of a * b."""
    product: Array = a[0] * b
    for j in range(1, len(a)):
        product[j:] += a[j] * b[: len(b) - j]
    return product


def divide(a: Array, b: Array) -> Array:
    """Return the series of a / b."""
    quotient = np.array(a)
    for k in range(len(a)):
        for j in range(1, k + 1):
            quotient[k] -= b[j] * quotient[k - j]
        quotient[k] /= b[0]
    return quotient


def square_root(a: Array) -> Array:
    """Return the series of sqrt(a), a > 0."""
    root = np.array(a)
    root[0] = np.sqrt(a[0])
    for k in range(1, len(a)):
        for j in range(1, k):
            root[k] -= root[j] * root[k - j]
        root[k] /= 2.0 * root[0]
    return root


def sine_cosine(a: Array) -> tuple[Array, Array]:
    """Return the series of sin(a) and cos(a)."""
    sine, cosine = np.zeros_like(a), np.zeros_like(a)
    sine[0], cosine[0] = np.sin(a[0]), np.cos(a[0])
    for k in range(1, len(a)):
        for j in range(1, k + 1):
            weight = (j / k) * a[j]
            sine[k] += weight * cosine[k - j]
            cosine[k] -= weight * sine[k - j]
    return sine, cosine


def angle_of(y: Array, x: Array) -> Array:
    """Return the series of atan2(y, x), its value in (-pi, pi]."""
    # (x y' - y x') / (x^2 + y^2) stays finite where y / x does not: due east and due west.
    value: Array = np.expand_dims(np.arctan2(y[0], x[0]), 0)
    if len(y) == 1:
        return value
    turning = multiply(x, derivative(y)) - multiply(y, derivative(x))
    rate = divide(turning, multiply(x, x) + multiply(y, y))[:-1]
    order = np.arange(1.0, len(y)).reshape((-1,) + (1,) * (y.ndim - 1))
    return np.concatenate([value, rate / order])
