"""The observation equations of SATCAL (3)-(7): one block of rows for azimuth, one for elevation.

A row is divided by its sigma.  The two blocks are kept apart because most terms act on one axis only: their QR is half
the work of the full matrix.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rf_pointing.calibration.angles import ArrayAngles
from rf_pointing.calibration.observations import Observations
from rf_pointing.calibration.terms import Term

__all__ = ["Block", "angles_of", "design_blocks", "term_matrix"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Block:
    """Rows of one axis: `matrix` (n, k) in the columns `columns` (k,) of the full parameter vector."""

    columns: NDArray[np.int64]
    matrix: Array


def angles_of(observations: Observations) -> ArrayAngles:
    """Return the true angles as the carrier on which terms are evaluated."""
    return ArrayAngles.of(*observations.motion(), observations.temperature_k)


def design_blocks(angles: ArrayAngles, terms: Sequence[Term]) -> tuple[Block, Block]:
    """Return the azimuth and the elevation block of the partial derivatives, not yet weighted."""
    blocks = []
    for axis in ("azimuth", "elevation"):
        acting = [(column, getattr(term, axis)) for column, term in enumerate(terms) if getattr(term, axis) is not None]
        matrix = np.empty((len(angles.azimuth_rad), len(acting)), order="F")
        for place, (_, partial) in enumerate(acting):
            matrix[:, place] = partial(angles)
        blocks.append(Block(np.array([column for column, _ in acting], dtype=np.int64), matrix))
    return blocks[0], blocks[1]


def term_matrix(angles: ArrayAngles, terms: Sequence[Term]) -> tuple[Array, Array]:
    """Return the full partial derivatives (n, len(terms)) of azimuth and of elevation offsets."""
    full = []
    for block in design_blocks(angles, terms):
        matrix = np.zeros((len(angles.azimuth_rad), len(terms)))
        matrix[:, block.columns] = block.matrix
        full.append(matrix)
    return full[0], full[1]
