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
from rf_pointing.calibration.term import Partial, Term

__all__ = ["Acting", "Block", "acting_on", "angles_of", "design_blocks", "weighted_rows"]

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Acting:
    """The unknowns `columns` (m,) that act on one axis, and their partial derivatives."""

    columns: NDArray[np.int64]
    partials: tuple[Partial, ...]


@dataclass(frozen=True, eq=False)
class Block:
    """Rows of one axis for the unknowns `columns` (m,); `padded` (n, m + 1) has room for the right side."""

    columns: NDArray[np.int64]
    padded: Array

    @property
    def matrix(self) -> Array:
        """Return the partial derivatives (n, m)."""
        return self.padded[:, :-1]

    def rows(self, right: Array, weight: Array) -> Array:
        """Return new rows [matrix | right] (n, m + 1), each times its weight."""
        rows = self.padded * weight[:, np.newaxis]
        rows[:, -1] = right * weight
        return rows


def angles_of(observations: Observations) -> ArrayAngles:
    """Return the true angles as the carrier on which terms are evaluated."""
    return ArrayAngles(*observations.motion(), temperature_k=observations.temperature_k)


def acting_on(terms: Sequence[Term]) -> tuple[Acting, Acting]:
    """Return, for azimuth and for elevation, which columns act on it and by which partial derivatives."""
    return _acting([term.azimuth for term in terms]), _acting([term.elevation for term in terms])


def weighted_rows(angles: ArrayAngles, acting: Acting, right: Array, weight: Array) -> Array:
    """Return the rows [matrix | right] (n, m + 1) of one axis, each times its weight."""
    # Column by column in memory: that is how LAPACK wants it, and each partial is written in one go.
    rows = np.empty((len(right), len(acting.partials) + 1), order="F")
    for place, partial in enumerate(acting.partials):
        np.multiply(partial(angles), weight, out=rows[:, place])
    np.multiply(right, weight, out=rows[:, -1])
    return rows


def design_blocks(angles: ArrayAngles, terms: Sequence[Term]) -> tuple[Block, Block]:
    """Return the azimuth and the elevation block of the partial derivatives, not yet weighted."""
    azimuth, elevation = acting_on(terms)
    one, nothing = angles.one, np.zeros_like(angles.one)
    return (
        Block(azimuth.columns, weighted_rows(angles, azimuth, nothing, one)),
        Block(elevation.columns, weighted_rows(angles, elevation, nothing, one)),
    )


def _acting(partials: Sequence[Partial | None]) -> Acting:
    found = [(column, partial) for column, partial in enumerate(partials) if partial is not None]
    return Acting(np.array([column for column, _ in found], dtype=np.int64), tuple(partial for _, partial in found))
