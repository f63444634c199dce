"""Which measured direction belongs to which station: the assignment with the least total angle."""

import numpy as np
from numpy.typing import NDArray

from rf_pointing.core import as_finite_array, require_between

__all__ = ["match_directions"]


def match_directions(
    measured: NDArray[np.float64], expected: NDArray[np.float64], largest_rad: float
) -> list[tuple[int, int]]:
    """Return pairs (measured index, expected index), each used once, no pair farther apart than `largest_rad`.

    `measured` (n, 3) and `expected` (m, 3) are unit vectors in one frame; unmatched ones do not appear.
    """
    from scipy.optimize import linear_sum_assignment

    require_between("largest_rad", largest_rad, 0.0, np.pi)
    first = as_finite_array("measured", measured, (None, 3))
    second = as_finite_array("expected", expected, (None, 3))
    cross = np.linalg.norm(np.cross(first[:, None, :], second[None, :, :]), axis=-1)
    angle = np.arctan2(cross, first @ second.T)
    # a pair that is out of reach costs more than leaving both alone ever could
    rows, columns = linear_sum_assignment(np.where(angle <= largest_rad, angle, 1e3))
    return [(int(i), int(j)) for i, j in zip(rows, columns, strict=True) if angle[i, j] <= largest_rad]
