"""How much of a time a network sees a target, and how likely the sky is clear where it does.

A station is cloudy with the probability q.  Two stations at the distance d have correlated weather,

    rho = exp(-d^2 / (2 s^2)),  s = 50 km                                      (OPTICAL eq. 1)
    P(both cloudy) = q1 q2 + rho sqrt(q1 (1 - q1) q2 (1 - q2))

and of n stations far apart one at least is clear with w = 1 - q^n (OPTICAL eq. 2).  For more than
two each station depends on the nearest of those before it: exact for two stations, for independent
ones, and for ones that share their sky.

Source: Shaik, Wonica and Wilhelm, Optical subnet concepts for the Deep Space Network, TDA Progress
Report 42-115 (OPTICAL).
"""

import math
from collections.abc import Sequence
from functools import cache

import numpy as np

from rf_pointing.core.types import Array, BoolArray, Pair

# Distance s over which weather is alike.
WEATHER_M = 50e3


def weather_correlation(distance_m: float) -> float:
    """Return the correlation of the weather at two places (OPTICAL eq. 1)."""
    return math.exp(-0.5 * (distance_m / WEATHER_M) ** 2)


def clear_probability(cloudy: Sequence[float], distance_m: Array) -> float:
    """Return the probability that one station at least is clear, 0 without a station.

    Parameters
    ----------
    cloudy : probability of clouds at each station, from 0 to 1.
    distance_m : distances (n, n) between them.
    """
    if not cloudy:
        return 0.0
    all_cloudy = cloudy[0]
    for k in range(1, len(cloudy)):
        nearest = int(np.argmin(distance_m[k, :k]))
        q, other = cloudy[k], cloudy[nearest]
        spread = math.sqrt(q * (1.0 - q) * other * (1.0 - other))
        both = q * other + weather_correlation(float(distance_m[k, nearest])) * spread
        # Unequal stations cannot both be cloudy more often than the clearer one is.
        all_cloudy *= min(both, q, other) / other if other > 0.0 else 0.0
    return 1.0 - all_cloudy


def availability(seen: BoolArray, cloudy: Sequence[float], distance_m: Array) -> Pair:
    """Return the share of the time with a station that sees the target, and with one that is clear.

    `seen` (n, stations) tells at even times which stations see it.
    """

    @cache
    def clear(row: bytes) -> float:
        up = np.flatnonzero(np.frombuffer(row, dtype=np.bool_))
        return clear_probability([cloudy[k] for k in up.tolist()], distance_m[np.ix_(up, up)])

    rows = np.ascontiguousarray(seen, dtype=np.bool_)
    return float(rows.any(axis=1).mean()), float(np.mean([clear(row.tobytes()) for row in rows]))
