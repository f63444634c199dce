"""The data of one fit, prepared once, and one linear solution of it."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from rf_pointing.calibration.bias_model import BiasModel
from rf_pointing.calibration.design import angles_of, design_blocks
from rf_pointing.calibration.elimination import PassHead, eliminate
from rf_pointing.calibration.fit_options import Prior
from rf_pointing.calibration.fit_result import PassErrors
from rf_pointing.calibration.observations import Observations
from rf_pointing.calibration.pass_errors import PassPriors, pass_partials
from rf_pointing.calibration.terms import terms_by_name
from rf_pointing.calibration.triangle import Solution, Triangle
from rf_pointing.geometry import wrap_rad

__all__ = ["FitProblem", "Round"]

Array = NDArray[np.float64]
Pair = tuple[Array, Array]


@dataclass(frozen=True, eq=False)
class Round:
    """One linear solution: residuals and pass offsets (azimuth, elevation) of all rows, used or not."""

    number: int
    solution: Solution
    heads: Mapping[int, PassHead]
    used: NDArray[np.bool_]
    weight: Array
    residuals: Pair
    pass_offsets: Pair


class FitProblem:
    """Observation equations of one fit; `solve` linearises and solves them for given weights."""

    def __init__(
        self,
        data: Observations,
        names: tuple[str, ...],
        held: dict[str, float],
        priors: dict[str, Prior],
        pass_priors: PassPriors | None,
        form: str,
    ) -> None:
        self.data, self.names, self.held, self.priors, self.pass_priors = data, names, held, priors, pass_priors
        self.linear = form == "printed"
        self.blocks = design_blocks(angles_of(data), terms_by_name(names))
        self.sigmas = (data.sigma_azimuth_rad, data.sigma_elevation_rad)
        self.measured = (data.residual_azimuth_rad, data.residual_elevation_rad)
        self.own = None if pass_priors is None else pass_partials(data, pass_priors.names)

    @cached_property
    def rows_of_pass(self) -> dict[int, NDArray[np.int64]]:
        """Return the row numbers of each pass."""
        order = np.argsort(self.data.pass_id, kind="stable")
        numbers, first = np.unique(self.data.pass_id[order], return_index=True)
        return dict(zip(numbers.tolist(), np.split(order, first[1:]), strict=True))

    def start(self) -> Array:
        """Return the values from which the first linearisation starts."""
        return np.array([self.priors[name].value if name in self.priors else 0.0 for name in self.names])

    def triangle(self, values: Array, used: NDArray[np.bool_], weight: Array) -> tuple[Triangle, dict[int, PassHead]]:
        """Return the equations linearised about `values`, reduced to a triangle, and what belongs to single passes."""
        triangle = Triangle(self.names)
        right = self._right(values)
        if self.pass_priors is not None:
            heads, common = self._eliminate(used, right, weight)
            triangle.add_triangle(common, 2 * int(np.sum(used)))
            return triangle, heads
        root = np.sqrt(weight)
        triangle.add_blocks(
            (block.rows(axis_right, root / sigma)[used], block.columns)
            for block, axis_right, sigma in zip(self.blocks, right, self.sigmas, strict=True)
        )
        return triangle, {}

    def solve(self, values: Array, used: NDArray[np.bool_], weight: Array, number: int) -> Round:
        """Return the solution linearised about `values` with the `used` rows, each weighted by `weight`."""
        triangle, heads = self.triangle(values, used, weight)
        for name, prior in self.priors.items():
            triangle.add_prior(name, prior.value, prior.sigma)
        solution = triangle.solve()
        offsets = self._pass_offsets(heads, solution)
        modelled = self._modelled(solution.values)
        residuals = (
            wrap_rad(self.measured[0] - modelled[0] - offsets[0]),
            self.measured[1] - modelled[1] - offsets[1],
        )
        return Round(number, solution, heads, used, weight, residuals, offsets)

    def pass_errors(self, last: Round) -> tuple[PassErrors, ...]:
        """Return the orbit and clock errors of every pass that took part."""
        if self.pass_priors is None:
            return ()
        names = self.pass_priors.names
        return tuple(
            PassErrors(
                pass_id,
                dict(zip(names, head.values(last.solution).tolist(), strict=True)),
                dict(zip(names, head.sigma(last.solution).tolist(), strict=True)),
            )
            for pass_id, head in last.heads.items()
        )

    def weighted_passes(self, last: Round) -> list[tuple[int, Array, Array]]:
        """Return number, rows (m, k) and residuals (m,) of every pass, divided by sigma."""
        rows = self._all_rows(last.residuals, last.weight)
        return [(number, rows[chosen, :-1], rows[chosen, -1]) for number, chosen in self._used_rows(last.used).items()]

    def _modelled(self, values: Array) -> Pair:
        model = BiasModel({**self.held, **dict(zip(self.names, values.tolist(), strict=True))})
        motion, temperature = self.data.motion(), self.data.temperature_k
        if self.linear:
            return model.offset_rad(*motion, temperature_k=temperature)
        azimuth, elevation = model.apply(*motion, temperature_k=temperature)
        return azimuth - motion[0], elevation - motion[1]

    def _right(self, values: Array) -> Pair:
        modelled = self._modelled(values)
        return (
            wrap_rad(self.measured[0] - modelled[0]) + self.blocks[0].matrix @ values[self.blocks[0].columns],
            self.measured[1] - modelled[1] + self.blocks[1].matrix @ values[self.blocks[1].columns],
        )

    def _all_rows(self, right: Pair, weight: Array) -> Array:
        """Return the rows (2 n, k + 1) of common partials and right side, azimuth first, divided by sigma."""
        count = len(self.data)
        rows = np.zeros((2 * count, len(self.names) + 1))
        rows[:count, self.blocks[0].columns] = self.blocks[0].matrix
        rows[count:, self.blocks[1].columns] = self.blocks[1].matrix
        rows[:, -1] = np.concatenate(right)
        return rows * self._scale(weight)[:, np.newaxis]

    def _scale(self, weight: Array) -> Array:
        root = np.sqrt(weight)
        return np.concatenate([root / self.sigmas[0], root / self.sigmas[1]])

    def _eliminate(self, used: NDArray[np.bool_], right: Pair, weight: Array) -> tuple[dict[int, PassHead], Array]:
        own, priors = self._own()
        scaled = np.concatenate(own) * self._scale(weight)[:, np.newaxis]
        rows = np.concatenate([scaled, self._all_rows(right, weight)], axis=1)
        heads, remaining = {}, []
        for pass_id, chosen in self._used_rows(used).items():
            heads[pass_id], rest = eliminate(rows[chosen], priors.sigma)
            remaining.append(rest)
        return heads, np.concatenate(remaining)

    def _used_rows(self, used: NDArray[np.bool_]) -> dict[int, NDArray[np.int64]]:
        """Return the rows of each pass among the stacked azimuth and elevation equations."""
        found = {}
        for pass_id, rows in self.rows_of_pass.items():
            chosen = rows[used[rows]]
            if len(chosen):
                found[pass_id] = np.concatenate([chosen, chosen + len(self.data)])
        return found

    def _pass_offsets(self, heads: Mapping[int, PassHead], solution: Solution) -> Pair:
        offsets = (np.zeros(len(self.data)), np.zeros(len(self.data)))
        for pass_id, head in heads.items():
            rows, values = self.rows_of_pass[pass_id], head.values(solution)
            for offset, own in zip(offsets, self._own()[0], strict=True):
                offset[rows] = own[rows] @ values
        return offsets

    def _own(self) -> tuple[Pair, PassPriors]:
        if self.own is None or self.pass_priors is None:
            raise ValueError("pass_priors=None: the fit has no pass errors")
        return self.own, self.pass_priors
