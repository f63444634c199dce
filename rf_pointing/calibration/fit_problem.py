"""The observation equations of one fit (SATCAL eqs. 3-7), and one linear solution of them.

Azimuth and elevation are kept apart: most terms act on one axis only, and two QRs of half the
columns are half the work of the full matrix.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rf_pointing.calibration.angles import Angles, ArrayAngles
from rf_pointing.calibration.bias_model import BiasModel
from rf_pointing.calibration.fit_result import FitResult, Nuisance, Prior
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
from rf_pointing.calibration.pass_errors import (
    PassErrors,
    PassPriors,
    SharedErrors,
    Sharing,
    lags_of,
    middles_of_passes,
    pass_partials,
)
from rf_pointing.calibration.terms import Partial, terms_by_name
from rf_pointing.core import Array, BoolArray, wrap_rad

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
        acting = [
            (column, partial) for column, partial in enumerate(partials) if partial is not None
        ]
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
class Level:
    """Unknowns that were eliminated: of passes, of sets of elements, or of the whole campaign.

    `parents` (g,) says which group of the wider level each belongs to.
    """

    heads: PassHeads
    parents: Places


def _root(covariance: Array) -> Any:
    return np.linalg.cholesky(covariance)


def _joined(levels: tuple[Level, ...], solution: Solution) -> tuple[Array, Array]:
    """Return values (g, m) and root (g, m, r) of the covariance of all that acts on a pass."""
    values, root = solution.values[np.newaxis], _root(solution.covariance)[np.newaxis]
    for one in levels:
        values, root = one.heads.joint(values[one.parents], root[one.parents])
    return values, root


@dataclass(frozen=True, eq=False)
class Round:
    """One linear solution; residuals and pass offsets (2, n) are of all rows.

    `values` (g, m) and the `root` (g, m, r) of their covariance are of all that acts on a pass.
    """

    solution: Solution
    levels: tuple[Level, ...]
    values: Array
    root: Array
    used: BoolArray
    weight: Array
    residuals: Array
    pass_offsets: Array


class FitProblem:
    """Observation equations of one fit; `solve` linearises and solves them for given weights."""

    def __init__(
        self, data: Observations, names: tuple[str, ...], held: dict[str, float],
        priors: dict[str, Prior], pass_priors: PassPriors | None, form: str,
        shared: SharedErrors | None = None, nuisances: Sequence[Nuisance] = (),
    ) -> None:  # fmt: skip
        self.data, self.names, self.held, self.priors, self.pass_priors = (
            data, names, held, priors, pass_priors,
        )  # fmt: skip
        self.nuisances = tuple(nuisances)
        self.shared = shared
        self.sharing = (
            Sharing.of(data, shared) if shared is not None and pass_priors is not None else None
        )
        self.linear = form == "printed"
        angles = ArrayAngles.of(data.motion(), data.temperature_k, data.mount)
        terms = terms_by_name(names)
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
        return np.array(
            [self.priors[name].value if name in self.priors else 0.0 for name in self.names]
        )

    def equations(
        self, values: Array, used: BoolArray, weight: Array
    ) -> tuple[NormalEquations, tuple[Level, ...]]:
        """Return the triangle of the equations about `values`, and what was eliminated."""
        equations = NormalEquations(self.names)
        right = self._right(values)
        # Pass errors act on both axes, so the blocks can no longer be reduced each by itself.
        if self.pass_priors is not None or self.nuisances:
            levels, common = self._eliminated(self._all_rows(right, weight), used, weight)
            equations.add_equations(common, 2 * int(np.sum(used)))
            return equations, levels
        root = np.sqrt(weight)
        equations.add_blocks(
            (block.rows(axis_right, root / sigma)[used], block.columns)
            for block, axis_right, sigma in zip(self.blocks, right, self.sigmas, strict=True)
        )
        return equations, ()

    def solve(self, values: Array, used: BoolArray, weight: Array) -> Round:
        """Return the solution linearised about `values`, from the `used` rows and `weight`."""
        equations, levels = self.equations(values, used, weight)
        for name, prior in self.priors.items():
            equations.add_prior(name, prior.value, prior.sigma)
        solution = equations.solve()
        # Full rank is not enough: a sigma of degrees has made the linearisation itself wrong.
        require_determined(self.names, solution.covariance, known=self.priors)
        joint = _joined(levels, solution)
        offsets = self._offsets(levels, joint[0])
        residuals = self.measured - self._modelled(solution.values) - offsets
        residuals[0] = wrap_rad(residuals[0])
        return Round(solution, levels, *joint, used, weight, residuals, offsets)

    def pass_errors(self, last: Round) -> tuple[PassErrors, ...]:
        """Return the orbit and clock errors of every pass that took part."""
        if self.pass_priors is None:
            return ()
        names, own = self.pass_priors.names, slice(len(self.pass_priors.names))
        values = last.values[:, own].tolist()
        sigma = np.sqrt(np.einsum("gij,gij->gi", last.root[:, own], last.root[:, own])).tolist()
        numbers = self.passes[0][last.levels[-1].heads.passes]
        middles = dict(
            zip(self.data.pass_id.tolist(), middles_of_passes(self.data).tolist(), strict=True)
        )
        return tuple(
            PassErrors(
                number, dict(zip(names, value, strict=True)), dict(zip(names, spread, strict=True)),
                middles[number],
            )
            for number, value, spread in zip(numbers.tolist(), values, sigma, strict=True)
        )  # fmt: skip

    def nuisance_estimates(self, last: Round) -> tuple[Array, Array]:
        """Return the nuisances (q,) that the data show, and their covariance (q, q)."""
        if not self.nuisances:
            return np.zeros(0), np.zeros((0, 0))
        values, root = _joined(last.levels[:1], last.solution)
        own = slice(sum(len(one.sigma) for one in self.nuisances))
        return values[0, own], root[0, own] @ root[0, own].T

    def pass_rows(self, last: Round) -> tuple[Places, Array]:
        """Return the passes and the triangles of their rows at the solution, without any prior."""
        return self._pass_equations(
            self._all_rows(self._right(last.solution.values), last.weight), last.used, last.weight
        )

    def factor_with(self, fit: FitResult, more: Array) -> Array:
        """Return the triangle of the equations about `fit`, priors included, with more unknowns.

        `more` (2, n, q) are the partials of azimuth and elevation by them; the columns of the
        triangle are terms, the further ones, and the right side, which is that of residuals.
        """
        weight = np.ones(len(self.data))
        right = self.measured - self._modelled(fit.values)
        right[0] = wrap_rad(right[0])
        rows = self._all_rows(right, weight)
        rows = np.concatenate(
            [rows[:, :-1], np.concatenate(more) * self._scale(weight), rows[:, -1:]], axis=1
        )
        _, rows = self._eliminated(rows, fit.used, weight)
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
        every = np.einsum(
            "ij,ijk->ik", self._full_rows(rows, last.weight), self._of_rows(last.levels, last.root)
        )
        order = np.lexsort((self.data.t_s, self.passes[1]))
        order = order[used[order]]
        azimuth, elevation = (
            noise_scale(rows[axis + order, -1], every[axis + order], self.passes[1][order])
            for axis in (0, count)
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
        values_by_name = dict(zip(self.names, values.tolist(), strict=True))
        model = BiasModel({**self.held, **values_by_name}, self.data.mount)
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

    def _nuisance_rows(self, weight: Array) -> Array:
        """Return the rows (2 n, q) of the partials by what the whole campaign has in common."""
        every = [np.concatenate(one.partials) for one in self.nuisances]
        return np.concatenate([np.zeros((2 * len(self.data), 0)), *every], axis=1) * self._scale(
            weight
        )

    def _pass_equations(self, rows: Array, used: BoolArray, weight: Array) -> tuple[Places, Array]:
        """Return the triangles of the passes of own partials, nuisances, and `rows`."""
        scaled = np.concatenate(self._own()[0]) * self._scale(weight)
        rows = np.concatenate([scaled, self._nuisance_rows(weight), rows], axis=1)
        chosen = np.tile(used, 2)
        return pass_equations(rows[chosen], np.tile(self.passes[1], 2)[chosen])

    def _eliminated(
        self, rows: Array, used: BoolArray, weight: Array
    ) -> tuple[tuple[Level, ...], Array]:
        """Return `rows` of common terms free of all other unknowns, and these, the widest first."""
        levels = []
        if self.pass_priors is not None:
            numbers, factors = self._pass_equations(rows, used, weight)
            sigma, parents = self.pass_priors.sigma, np.zeros(len(numbers), dtype=np.int64)
            expected = None
            if self.sharing is not None and self.shared is not None:
                own, count = len(sigma), len(self.shared.priors.sigma)
                factors = np.insert(factors, [own] * count, 0.0, axis=2)
                expected = np.zeros((len(numbers), own, factors.shape[2] - own - 1))
                expected[:, :, :count] = self.sharing.turns[numbers]
                sets, parents = np.unique(self.sharing.sets[numbers], return_inverse=True)
            heads, rest = eliminate(numbers, factors, sigma, expected)
            levels.append(Level(heads, parents))
            if self.sharing is not None and self.shared is not None:
                groups = np.repeat(parents, rest.shape[1])
                _, factors = pass_equations(rest.reshape(-1, rest.shape[2]), groups)
                heads, rest = eliminate(sets, factors, self.shared.priors.sigma)
                levels.append(Level(heads, np.zeros(len(sets), dtype=np.int64)))
            rows = rest.reshape(-1, rest.shape[2])
        else:
            rows = np.concatenate([self._nuisance_rows(weight), rows], axis=1)[np.tile(used, 2)]
        if self.nuisances:
            none = np.zeros(1, dtype=np.int64)
            heads, rest = eliminate(
                none, rows[np.newaxis], np.concatenate([one.sigma for one in self.nuisances])
            )
            levels.append(Level(heads, none))
            rows = rest[0]
        return tuple(reversed(levels)), rows

    def _full_rows(self, rows: Array, weight: Array) -> Array:
        """Return the rows (2 n, m) by all unknowns that act on one, those of its pass first."""
        parts = [self._nuisance_rows(weight), rows[:, :-1]]
        if self.pass_priors is not None:
            shared = (
                0 if self.shared is None or self.sharing is None else len(self.shared.priors.names)
            )
            own = np.concatenate(self._own()[0]) * self._scale(weight)
            # An error of the elements acts by those of their passes alone.
            parts = [own, np.zeros((len(rows), shared)), *parts]
        return np.concatenate(parts, axis=1)

    def _of_rows(self, levels: tuple[Level, ...], values: Array) -> Array:
        """Return for each row (2 n, ...) those `values` that belong to its pass."""
        if self.pass_priors is None:
            return np.broadcast_to(values, (2 * len(self.data), *values.shape[1:]))
        every = np.zeros((len(self.passes[0]), *values.shape[1:]))
        every[levels[-1].heads.passes] = values
        return every[np.tile(self.passes[1], 2)]

    def _offsets(self, levels: tuple[Level, ...], values: Array) -> Array:
        """Return by how much (2, n) all but the terms moves the angles."""
        count, one = len(self.data), np.ones(len(self.data))
        if not levels:
            return np.zeros((2, count))
        terms = len(self.names)
        rows = self._full_rows(np.zeros((2 * count, terms + 1)), one) / self._scale(one)
        moved: Array = np.einsum("ij,ij->i", rows, self._of_rows(levels, values)).reshape(2, count)
        return moved

    def _own(self) -> tuple[Pair, PassPriors]:
        """Return the partials by the passes' errors, seen with the lags of the last solution."""
        if self.pass_priors is None:
            raise ValueError("pass_priors=None: the fit has no pass errors")
        lags = (0.0, 0.0)
        # The printed form is linear: it has no term for a product of lag and orbit error.
        if not self.linear and self._last is not None:
            lags = lags_of(
                {**self.held, **dict(zip(self.names, self._last[0].tolist(), strict=True))}
            )
        known = self._own_at
        if (
            known is None
            or max(abs(a - b) for a, b in zip(known[0], lags, strict=True)) > _SAME_LAG_S
        ):
            self._own_at = known = (lags, pass_partials(self.data, self.pass_priors.names, lags))
        return known[1], self.pass_priors
