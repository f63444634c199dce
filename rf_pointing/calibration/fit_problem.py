"""The observation equations of one fit (SATCAL eqs. 3-7), and one linear solution of them.

Azimuth and elevation are kept apart: most terms act on one axis only, and two QRs of half the
columns are half the work of the full matrix.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from rf_pointing.calibration.angles import Angles, ArrayAngles
from rf_pointing.calibration.bias_model import BiasModel
from rf_pointing.calibration.fit_result import FitResult, Prior
from rf_pointing.calibration.noise import NoiseScale, noise_scale
from rf_pointing.calibration.normal_equations import (
    NormalEquations,
    PassHeads,
    Solution,
    eliminate,
    pass_equations,
    require_determined,
)
from rf_pointing.calibration.observations import Observations
from rf_pointing.calibration.pass_errors import PassErrors, PassPriors, lags_of, middles_of_passes, pass_partials
from rf_pointing.calibration.terms import Partial, terms_by_name
from rf_pointing.core import wrap_rad
from rf_pointing.core.types import Array

Pair = tuple[Array, Array]
# Lags that count as equal: at orbit errors of 1 km and 1 s they change the shift by < 0.1 mdeg.
_SAME_LAG_S = 0.01
Places = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Block:
    """Partial derivatives of one axis by the unknowns `columns` (m,) that act on it, unweighted.

    `padded` (n, m + 1) has room for the right side in its last column.
    """

    columns: NDArray[np.int64]
    padded: Array

    @classmethod
    def of(cls, angles: Angles, partials: list[Partial | None]) -> "Block":
        """Evaluate the partials of all unknowns, None for those that do not act on this axis."""
        acting = [(column, partial) for column, partial in enumerate(partials) if partial is not None]
        # Column by column in memory: LAPACK wants it so, and each partial is written in one go.
        padded = np.zeros((len(angles.one), len(acting) + 1), order="F")
        for place, (_, partial) in enumerate(acting):
            padded[:, place] = partial(angles)
        return cls(np.array([column for column, _ in acting], dtype=np.int64), padded)

    @property
    def matrix(self) -> Array:
        """Return the partial derivatives (n, m)."""
        return self.padded[:, :-1]

    def rows(self, right: Array, weight: Array) -> Array:
        """Return new rows [matrix | right] (n, m + 1), each times its weight."""
        rows = self.padded * weight[:, np.newaxis]
        rows[:, -1] = right * weight
        return rows


@dataclass(frozen=True, eq=False)
class Round:
    """One linear solution; residuals and pass offsets (2, n) are of all rows."""

    solution: Solution
    heads: PassHeads | None
    used: NDArray[np.bool_]
    weight: Array
    residuals: Array
    pass_offsets: Array


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
        angles, terms = ArrayAngles.of(data.motion(), data.temperature_k), terms_by_name(names)
        self.blocks = (
            Block.of(angles, [term.azimuth for term in terms]),
            Block.of(angles, [term.elevation for term in terms]),
        )
        self.sigmas = np.stack([data.sigma_azimuth_rad, data.sigma_elevation_rad])
        self.measured = np.stack([data.residual_azimuth_rad, data.residual_elevation_rad])
        self._last: Pair | None = None
        self._own_at: tuple[tuple[float, float], Pair] | None = None

    @cached_property
    def passes(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Return the pass numbers, ascending, and for each row (n,) its place among them."""
        numbers, place = np.unique(self.data.pass_id, return_inverse=True)
        return numbers, place

    def start(self) -> Array:
        """Return the values of the first linearisation: those of the priors, else zero."""
        return np.array([self.priors[name].value if name in self.priors else 0.0 for name in self.names])

    def equations(
        self, values: Array, used: NDArray[np.bool_], weight: Array
    ) -> tuple[NormalEquations, PassHeads | None]:
        """Return the triangle of the equations linearised about `values`, and the passes' rows."""
        equations = NormalEquations(self.names)
        right = self._right(values)
        # Pass errors act on both axes, so the blocks can no longer be reduced each by itself.
        if self.pass_priors is not None:
            heads, common = eliminate(*self._pass_equations(used, right, weight), self.pass_priors.sigma)
            equations.add_equations(common, 2 * int(np.sum(used)))
            return equations, heads
        root = np.sqrt(weight)
        equations.add_blocks(
            (block.rows(axis_right, root / sigma)[used], block.columns)
            for block, axis_right, sigma in zip(self.blocks, right, self.sigmas, strict=True)
        )
        return equations, None

    def solve(self, values: Array, used: NDArray[np.bool_], weight: Array) -> Round:
        """Return the solution linearised about `values`, from the `used` rows and `weight`."""
        equations, heads = self.equations(values, used, weight)
        for name, prior in self.priors.items():
            equations.add_prior(name, prior.value, prior.sigma)
        solution = equations.solve()
        # Full rank is not enough: a sigma of degrees has made the linearisation itself wrong.
        require_determined(self.names, solution.covariance, known=self.priors)
        offsets = self._pass_offsets(heads, solution)
        residuals = self.measured - self._modelled(solution.values) - offsets
        residuals[0] = wrap_rad(residuals[0])
        return Round(solution, heads, used, weight, residuals, offsets)

    def pass_errors(self, last: Round) -> tuple[PassErrors, ...]:
        """Return the orbit and clock errors of every pass that took part."""
        if self.pass_priors is None or last.heads is None:
            return ()
        names, heads = self.pass_priors.names, last.heads
        values, sigma = heads.values(last.solution).tolist(), heads.sigma(last.solution).tolist()
        numbers = self.passes[0][heads.passes]
        middles = dict(zip(self.data.pass_id.tolist(), middles_of_passes(self.data).tolist(), strict=True))
        return tuple(
            PassErrors(
                number, dict(zip(names, value, strict=True)), dict(zip(names, spread, strict=True)), middles[number]
            )
            for number, value, spread in zip(numbers.tolist(), values, sigma, strict=True)
        )

    def pass_rows(self, last: Round) -> tuple[Places, Array]:
        """Return the passes and the triangles of their rows at the solution, without any prior."""
        return self._pass_equations(last.used, self._right(last.solution.values), last.weight)

    def factor_with(self, fit: FitResult, more: Array) -> Array:
        """Return the triangle of the equations about `fit`, priors included, with more unknowns.

        `more` (2, n, q) are the partials of azimuth and elevation by them; the columns of the
        triangle are terms, the further ones, and the right side, which is that of residuals.
        """
        weight = np.ones(len(self.data))
        right = self.measured - self._modelled(fit.values)
        right[0] = wrap_rad(right[0])
        rows = self._all_rows(right, weight)
        rows = np.concatenate([rows[:, :-1], np.concatenate(more) * self._scale(weight), rows[:, -1:]], axis=1)
        chosen = np.tile(fit.used, 2)
        if self.pass_priors is not None:
            own = np.concatenate(self._own()[0]) * self._scale(weight)
            rows = np.concatenate([own, rows], axis=1)[chosen]
            _, rows = eliminate(*pass_equations(rows, np.tile(self.passes[1], 2)[chosen]), self.pass_priors.sigma)
        else:
            rows = rows[chosen]
        known = np.zeros((len(self.priors), rows.shape[1]))
        for row, (name, prior) in zip(known, self.priors.items(), strict=True):
            place = self.names.index(name)
            row[place], row[-1] = 1.0 / prior.sigma, (prior.value - fit.values[place]) / prior.sigma
        return np.asarray(np.linalg.qr(np.concatenate([rows, known]), mode="r"))

    def noise(self, last: Round, share: float) -> tuple[NoiseScale, NoiseScale]:
        """Return by what the noise of azimuth and elevation is larger than the stated sigma.

        `share` of its variance is left after the editing, and of the data that hold the fit.
        """
        count, used = len(self.data), last.used
        rows = self._all_rows(last.residuals, last.weight)
        rows[:, -1] /= share
        common = rows[:, :-1]
        influence = [common @ np.linalg.cholesky(last.solution.covariance)]
        if last.heads is not None:
            inverse = np.zeros((len(self.passes[0]), *last.heads.own.shape[1:]))
            across = np.zeros((len(self.passes[0]), *last.heads.common.shape[1:]))
            inverse[last.heads.passes] = np.linalg.inv(last.heads.own)
            across[last.heads.passes] = inverse[last.heads.passes] @ last.heads.common
            own, place = np.concatenate(self._own()[0]) * self._scale(last.weight), np.tile(self.passes[1], 2)
            common = common - np.einsum("ij,ijk->ik", own, across[place])
            influence = [common @ np.linalg.cholesky(last.solution.covariance)]
            influence.append(np.einsum("ij,ijk->ik", own, inverse[place]))
        every = np.concatenate(influence, axis=1)
        order = np.lexsort((self.data.t_s, self.passes[1]))
        order = order[used[order]]
        azimuth, elevation = (
            noise_scale(rows[axis + order, -1], every[axis + order], self.passes[1][order]) for axis in (0, count)
        )
        return azimuth, elevation

    def weighted_passes(self, last: Round) -> list[tuple[int, Array, Array]]:
        """Return number, rows (m, k) and residuals (m,) of every pass, divided by sigma."""
        rows, place = self._all_rows(last.residuals, last.weight), np.tile(self.passes[1], 2)
        used = np.tile(last.used, 2)
        found = []
        for k, number in enumerate(self.passes[0].tolist()):
            chosen = used & (place == k)
            if np.any(chosen):
                found.append((number, rows[chosen, :-1], rows[chosen, -1]))
        return found

    def _modelled(self, values: Array) -> Array:
        # A round begins where the one before it ended.
        if self._last is None or not np.array_equal(self._last[0], values):
            self._last = (values, self._evaluated(values))
        return self._last[1]

    def _evaluated(self, values: Array) -> Array:
        model = BiasModel({**self.held, **dict(zip(self.names, values.tolist(), strict=True))})
        motion, temperature = self.data.motion(), self.data.temperature_k
        # The printed form is linear: its one round would never see the exact rotations.
        if self.linear:
            return np.stack(model.offset_rad(*motion, temperature_k=temperature))
        return np.stack(model.apply(*motion, temperature_k=temperature)) - np.stack(motion[:2])

    def _right(self, values: Array) -> Array:
        # Gauss-Newton: measured minus modelled, plus what the partials make of the values.
        right = self.measured - self._modelled(values)
        right[0] = wrap_rad(right[0])
        return right + np.stack([block.matrix @ values[block.columns] for block in self.blocks])

    def _all_rows(self, right: Array, weight: Array) -> Array:
        """Return rows (2 n, k + 1) of partials and right side, azimuth first, divided by sigma."""
        count = len(self.data)
        rows = np.zeros((2 * count, len(self.names) + 1))
        rows[:count, self.blocks[0].columns] = self.blocks[0].matrix
        rows[count:, self.blocks[1].columns] = self.blocks[1].matrix
        rows[:, -1] = right.ravel()
        return rows * self._scale(weight)

    def _scale(self, weight: Array) -> Array:
        return (np.sqrt(weight) / self.sigmas).reshape(-1, 1)

    def _pass_equations(self, used: NDArray[np.bool_], right: Array, weight: Array) -> tuple[Places, Array]:
        scaled = np.concatenate(self._own()[0]) * self._scale(weight)
        rows = np.concatenate([scaled, self._all_rows(right, weight)], axis=1)
        chosen = np.tile(used, 2)
        return pass_equations(rows[chosen], np.tile(self.passes[1], 2)[chosen])

    def _pass_offsets(self, heads: PassHeads | None, solution: Solution) -> Array:
        if heads is None:
            return np.zeros((2, len(self.data)))
        own, priors = self._own()
        values = np.zeros((len(self.passes[0]), len(priors.names)))
        values[heads.passes] = heads.values(solution)
        of_row = values[self.passes[1]]
        return np.stack([np.einsum("ij,ij->i", partials, of_row) for partials in own])

    def _own(self) -> tuple[Pair, PassPriors]:
        """Return the partials by the passes' errors, seen with the lags of the last solution."""
        if self.pass_priors is None:
            raise ValueError("pass_priors=None: the fit has no pass errors")
        lags = (0.0, 0.0)
        # The printed form is linear: it has no term for a product of lag and orbit error.
        if not self.linear and self._last is not None:
            lags = lags_of({**self.held, **dict(zip(self.names, self._last[0].tolist(), strict=True))})
        known = self._own_at
        if known is None or max(abs(a - b) for a, b in zip(known[0], lags, strict=True)) > _SAME_LAG_S:
            self._own_at = known = (lags, pass_partials(self.data, self.pass_priors.names, lags))
        return known[1], self.pass_priors
