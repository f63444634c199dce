"""Fit without keeping the data: observations are folded in block by block, 10^8 of them in the memory of one block."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from rf_pointing.calibration.angles import ArrayAngles
from rf_pointing.calibration.bias_model import BiasModel
from rf_pointing.calibration.design import Acting, acting_on, weighted_rows
from rf_pointing.calibration.fit import check_names
from rf_pointing.calibration.observations import Observations
from rf_pointing.calibration.terms import TERM_NAMES, terms_by_name
from rf_pointing.calibration.triangle import Solution, Triangle

__all__ = ["StreamingFit"]

Array = NDArray[np.float64]

_BLOCK_ROWS = 8192
"""Rows folded in at once: they and their partials stay in the processor's second-level cache."""


@dataclass(eq=False)
class StreamingFit:
    """State of a fit of the printed form to observations that come in blocks.

    `terms` are fitted, every other one of the 14 is in `held`.  No editing: feed it points that the pipeline has
    edited.  `copy` gives an independent state that continues identically.
    """

    terms: tuple[str, ...]
    held: Mapping[str, float]
    triangle: Triangle = field(init=False)
    _acting: tuple[Acting, Acting] = field(init=False, repr=False)
    _held_model: BiasModel | None = field(init=False, repr=False)

    def __post_init__(self) -> None:
        self.terms = tuple(self.terms)
        check_names(self.terms, self.held, {})
        self.triangle = Triangle(self.terms)
        self._acting = acting_on(terms_by_name(self.terms))
        fixed = any(value != 0.0 for value in self.held.values())
        self._held_model = BiasModel({**dict.fromkeys(TERM_NAMES, 0.0), **self.held}) if fixed else None

    @property
    def observations(self) -> int:
        """Return how many observations (pairs of equations) are folded in."""
        return self.triangle.rows // 2

    def copy(self) -> "StreamingFit":
        """Return an independent copy of the state."""
        other = object.__new__(StreamingFit)
        other.__dict__.update(self.__dict__)
        other.triangle = self.triangle.copy()
        return other

    def add(self, observations: Observations) -> None:
        """Fold in observations, in blocks."""
        data = observations
        columns = (
            *data.motion(),
            data.residual_azimuth_rad,
            data.residual_elevation_rad,
            data.sigma_azimuth_rad,
            data.sigma_elevation_rad,
        )
        for start in range(0, len(data), _BLOCK_ROWS):
            rows = slice(start, start + _BLOCK_ROWS)
            temperature = None if data.temperature_k is None else data.temperature_k[rows]
            self._fold(tuple(column[rows] for column in columns), temperature)

    def solve(self) -> Solution:
        """Return the terms from everything folded in so far; raises ValueError naming inseparable terms."""
        return self.triangle.solve()

    def model(self) -> BiasModel:
        """Return the bias model of the present solution."""
        solution = self.solve()
        return BiasModel({**self.held, **dict(zip(self.terms, solution.values.tolist(), strict=True))})

    def _fold(self, columns: tuple[Array, ...], temperature: Array | None) -> None:
        az, el, az_rate, el_rate, az_acceleration, el_acceleration, *rest = columns
        motion = (az, el, az_rate, el_rate, az_acceleration, el_acceleration)
        residuals, sigmas = (rest[0], rest[1]), (rest[2], rest[3])
        angles = ArrayAngles(az, el, az_rate, el_rate, az_acceleration, el_acceleration, temperature)
        if self._held_model is not None:
            known = self._held_model.offset_rad(*motion, temperature_k=temperature)
            residuals = (residuals[0] - known[0], residuals[1] - known[1])
        self.triangle.add_blocks(
            (weighted_rows(angles, acting, residual, 1.0 / sigma), acting.columns)
            for acting, residual, sigma in zip(self._acting, residuals, sigmas, strict=True)
        )
