"""Whether rates and accelerations in a file belong to the angles beside them.

Nothing else shows that they do not: a rate in rad/s under a heading of deg/s, with its sign turned or in the other axis' column
gives a fit as good as any, with lags that are wrong by the same factor.  Between two neighbours of a pass

    x(t + h) - x(t) = h (x'(t) + x'(t + h)) / 2 + O(h^3)
"""

import numpy as np
from numpy.typing import NDArray

from rf_pointing.calibration.observations import Observations
from rf_pointing.core import to_degrees, wrap_rad

__all__ = ["require_derivatives"]

Array = NDArray[np.float64]

_NEIGHBOURS_S = 20.0
_FEWEST = 10
_LARGEST_SHARE = 0.5
_MOVES = {"rad": np.radians(0.02), "rad_s": np.radians(0.001), "m": 1000.0}
"""Changes from one row to the next below which nothing is judged: files carry few digits."""
_PAIRS = (
    ("true_azimuth_rad", "azimuth_rate_rad_s", "rad"),
    ("true_elevation_rad", "elevation_rate_rad_s", "rad"),
    ("azimuth_rate_rad_s", "azimuth_acceleration_rad_s2", "rad_s"),
    ("elevation_rate_rad_s", "elevation_acceleration_rad_s2", "rad_s"),
    ("range_m", "range_rate_m_s", "m"),
)


def require_derivatives(points: Observations) -> None:
    """Raise ValueError naming a column that is not the derivative of the one it should be, in most of its rows."""
    rows = np.lexsort((points.t_s, points.pass_id))
    step = np.diff(points.t_s[rows])
    near = (np.diff(points.pass_id[rows]) == 0) & (step <= _NEIGHBOURS_S)
    for name, rate_name, unit in _PAIRS:
        value, rate = getattr(points, name), getattr(points, rate_name)
        if value is None or rate is None:
            continue
        moved = np.diff(value[rows])
        moved = wrap_rad(moved) if name == "true_azimuth_rad" else moved
        told = 0.5 * step * (rate[rows][1:] + rate[rows][:-1])
        larger = np.maximum(np.abs(moved), np.abs(told))
        judged = near & (larger > _MOVES[unit])
        wrong = judged & (np.abs(moved - told) > _LARGEST_SHARE * larger)
        if np.sum(judged) >= _FEWEST and np.sum(wrong) > 0.5 * np.sum(judged):
            raise ValueError(_refusal(name, rate_name, points, rows, int(np.flatnonzero(wrong)[0]), wrong, judged))


def _refusal(
    name: str,
    rate_name: str,
    points: Observations,
    rows: NDArray[np.int64],
    place: int,
    wrong: NDArray[np.bool_],
    judged: NDArray[np.bool_],
) -> str:
    pair = rows[place : place + 2]
    edge, values = to_degrees(name, getattr(points, name)[pair].tolist())
    rate_edge, rates = to_degrees(rate_name, getattr(points, rate_name)[pair].tolist())
    return (
        f"{rate_edge} is not the change of {edge}: rows {pair[0]} and {pair[1]}, {np.diff(points.t_s[pair])[0]:g} s apart, "
        f"have {edge} {values[0]:.6g}, {values[1]:.6g} and {rate_edge} {rates[0]:.6g}, {rates[1]:.6g} "
        f"({int(np.sum(wrong))} of {int(np.sum(judged))} rows); another unit, another sign or swapped columns?"
    )
