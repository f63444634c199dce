"""Direction of the target from carrier powers at known positions of the beam.

Maximum likelihood on the exact Gaussian beam, without the linearisation of the conscan paper:

    P_i = exp(a + 2 mu u_i.theta / h^2 - mu |u_i|^2 / h^2 + spin terms)

u_i is the beam's offset, theta the target's.  The inverse Hessian is the Cramer-Rao bound.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from rf_pointing.core import MU, Array, BoolArray

MAX_ITERATIONS = 25
LOSS = -0.25 / MU  # -mu u^2 / h^2 from the columns 2 mu u / h
STEP_TOLERANCE2 = 2e-3**2  # square of a step in beamwidths; what is left after it is below 1e-5
FRESH_STEP2 = 1e-2**2  # after a smaller step the information matrix of the step before still serves

SMALLEST_INFORMATION = 1e-13
"""Least eigenvalue of an information matrix, scaled to a diagonal of one, that counts as not zero.

Rounding makes 1e-15 of an exact zero, of either sign and different on every processor.  To invert
first and judge the result afterwards would leave the verdict to it.  At 1e-13 the inverse is good
to 1 %.
"""


@dataclass(frozen=True, slots=True)
class PowerWindow:
    """Samples of one estimate: rows (n, 6) of time, power, sigma, beam position (2), C/N0.

    Time is the middle of the integration; beam offsets are from the scan's origin.
    """

    rows: Array

    @classmethod
    def empty(cls) -> "PowerWindow":
        """Return a window without samples."""
        return cls(np.empty((0, 6)))

    def __len__(self) -> int:
        return len(self.rows)

    @property
    def t_s(self) -> Array:
        """Times (n,)."""
        return self.rows[:, 0]

    @property
    def power_w(self) -> Array:
        """Carrier powers (n,)."""
        return self.rows[:, 1]

    @property
    def sigma_w(self) -> Array:
        """Standard deviations of the powers (n,)."""
        return self.rows[:, 2]

    @property
    def beam_rad(self) -> Array:
        """Beam positions (n, 2), cross-elevation and elevation."""
        return self.rows[:, 3:5]

    @property
    def carrier_to_noise_db_hz(self) -> Array:
        """C/N0 of the samples (n,)."""
        return self.rows[:, 5]

    def with_sample(self, sample: tuple[float, ...], most: int, oldest_s: float) -> "PowerWindow":
        """Return the window with `sample`, at most `most` samples, none before `oldest_s`."""
        keep = self.rows[-(most - 1) :]
        if len(keep) and keep[0, 0] < oldest_s:
            keep = keep[keep[:, 0] >= oldest_s]
        return PowerWindow(np.concatenate([keep, np.array([sample])]))

    def without(self, row: int) -> "PowerWindow":
        """Return the window without one of its samples."""
        return PowerWindow(np.delete(self.rows, row, axis=0))

    def moved(self, cross_elevation_rad: float, elevation_rad: float) -> "PowerWindow":
        """Return the window seen from an origin moved by this much."""
        rows = self.rows.copy()
        rows[:, 3] -= cross_elevation_rad
        rows[:, 4] -= elevation_rad
        return PowerWindow(rows)


def is_singular(information: Array) -> bool:
    """Return whether one of these symmetric matrices (..., k, k) leaves an unknown undetermined."""
    scale = np.sqrt(np.diagonal(information, axis1=-2, axis2=-1))
    if not (np.all(scale > 0.0) and np.all(np.isfinite(scale))):
        return True
    least = np.linalg.eigvalsh(information / (scale[..., :, None] * scale[..., None, :]))[..., 0]
    return not bool(np.all(least > SMALLEST_INFORMATION))


def rank_reason(positions_rad: Array, smallest_spread_rad: float) -> str:
    """Return what beam positions (n, 2) on a line, or on two points, leave undetermined."""
    # Rounded to the smallest spread: encoder noise does not make two points of one.
    centred = positions_rad - positions_rad.mean(axis=0)
    distinct = len(np.unique(np.round(centred / smallest_spread_rad), axis=0))
    if distinct < 3:
        return f"{distinct} distinct beam positions, must be at least 3"
    (xx, xy), (_, yy) = centred.T @ centred
    along = 0.5 * math.atan2(2.0 * xy, xx - yy)
    name = {0: "elevation", 2: "cross-elevation"}.get(round(along / (0.25 * math.pi)) % 4, "one diagonal")
    return f"{name} is not determined: the beam positions lie on a line"


_SINGULAR = "the powers do not determine the direction: one outweighs the others, or the beam moved on a line"
LARGEST_LOGARITHM = 600.0  # of the power: Newton may overshoot, and exp overflows at 709


class BeamDesign(NamedTuple):
    """Regressors of n beam positions, shared by every run of a batch."""

    columns: Array  # (n, k): 1, cross-elevation, elevation, spin terms
    products: Array  # (n, k * k): the outer products of each row, the row itself first
    loss: Array  # (n,): -mu |u|^2 / h^2
    half_power_beamwidth_rad: float


class LikelihoodFit(NamedTuple):
    """Target minus origin (..., 2), covariance (..., 2, 2), reduced chi squared (...)."""

    error_rad: Array
    covariance_rad2: Array
    chi_squared: Array
    converged: BoolArray


def beam_design(beam_rad: Array, half_power_beamwidth_rad: float, spin_columns: Array | None = None) -> BeamDesign:
    """Prepare beam positions (n, 2); `spin_columns` (n, m) enter the logarithm of the power."""
    count, unknowns = len(beam_rad), 3 if spin_columns is None else 3 + spin_columns.shape[1]
    columns = np.empty((count, unknowns))
    columns[:, 0] = 1.0
    np.multiply(beam_rad, 2.0 * MU / half_power_beamwidth_rad, out=columns[:, 1:3])
    if spin_columns is not None:
        columns[:, 3:] = spin_columns
    products = (columns[:, :, None] * columns[:, None, :]).reshape(count, unknowns**2)
    loss = LOSS * (products[:, unknowns + 1] + products[:, 2 * unknowns + 2])
    return BeamDesign(columns, products, loss, half_power_beamwidth_rad)


def least_spread_rad(design: BeamDesign) -> float:
    """Return the rms motion of the beam along the axis on which it moved least.

    Both axes and the power need three distinct positions that do not lie on a line.
    """
    sums, unknowns = np.add.reduce(design.products).tolist(), design.columns.shape[1]
    count, right, up = sums[:3]
    xx, xy, yy = sums[unknowns + 1], sums[unknowns + 2], sums[2 * unknowns + 2]
    xx, xy, yy = xx - right * right / count, xy - right * up / count, yy - up * up / count
    least = 0.5 * (xx + yy) - math.hypot(0.5 * (xx - yy), xy)
    return math.sqrt(max(least, 0.0) / count) * design.half_power_beamwidth_rad / (2.0 * MU)


def columns_independent(design: BeamDesign) -> bool:
    """Return whether equally good samples at these positions determine every unknown."""
    return not is_singular(_square(np.add.reduce(design.products)))


# The unknown power and |theta|^2 are both in a, so the model is log-linear in (a, theta) for any
# theta.  The receiver's variance is alpha_i P_i (CONSCAN B-5: alpha = 2 N0/T).  The score
# sum_i x_i (measured P_i - P_i) / alpha_i = 0 is concave and linear in the measured power; the bias
# -1/2 sum_i x_i w_i q_i that its maximum keeps is removed in closed form (Cordeiro and
# McCullagh 1991).
def fit_beam(design: BeamDesign, power_w: Array, noise_w: Array) -> LikelihoodFit:
    """Return the likeliest direction for powers (..., n) of variance `noise_w` times their mean.

    Leading dimensions are independent runs at the same beam positions.  A run that does not
    converge says so.  Raises LinAlgError, a ValueError, where the powers do not determine every
    unknown.
    """
    columns, products = design.columns, design.products
    unknowns = columns.shape[1]
    weighted = power_w / noise_w
    moments = weighted @ products
    score, bound = moments[..., :unknowns], _inverse(moments)
    # Least squares for the logarithm: biased by the noise, but close.
    solution = _apply(bound, (weighted * (np.log(power_w) - design.loss)) @ columns)
    size2 = math.inf
    for _ in range(MAX_ITERATIONS):
        logarithm = solution @ columns.T + design.loss
        weight = np.exp(np.minimum(np.maximum(logarithm, -LARGEST_LOGARITHM), LARGEST_LOGARITHM)) / noise_w
        moments = weight @ products
        if size2 > FRESH_STEP2:
            bound = _inverse(moments)
        step = _apply(bound, score - moments[..., :unknowns])
        solution = solution + step
        length2 = _dot(step, step)
        size2 = float(length2 if length2.ndim == 0 else length2.max())
        if size2 < STEP_TOLERANCE2:
            break
    leverage = bound.reshape(*weight.shape[:-1], unknowns**2) @ products.T
    bias = _apply(bound, (weight * leverage) @ columns)
    scale = design.half_power_beamwidth_rad
    misfit = weighted - weight
    return LikelihoodFit(
        scale * (solution + 0.5 * bias)[..., 1:3], scale**2 * bound[..., 1:3, 1:3],
        _dot(misfit, misfit / weight) / (len(columns) - unknowns), np.asarray(length2 < STEP_TOLERANCE2),
    )  # fmt: skip


def _apply(matrix: Array, vector: Array) -> Array:
    product: Array = matrix @ vector if vector.ndim == 1 else (matrix @ vector[..., None])[..., 0]
    return product


def _dot(a: Array, b: Array) -> Array:
    product: Array = a @ b if a.ndim == 1 else np.sum(a * b, axis=-1)
    return product


def _inverse(flat: Array) -> Array:
    """Return the inverses of symmetric matrices given as rows (..., k * k).

    Raises LinAlgError for a singular one.  3 x 3 the determinant, the product of the eigenvalues,
    is judged.
    """
    # 3 x 3 alone by cofactors is three times faster, and is what a conscan without nuisances needs.
    if flat.shape != (9,):
        matrix = _square(flat)
        if is_singular(matrix):
            raise np.linalg.LinAlgError(_SINGULAR)
        return np.asarray(np.linalg.inv(matrix))
    a, b, c, _, d, e, _, _, f = flat.tolist()
    ca, cb, cc = d * f - e * e, c * e - b * f, b * e - c * d
    determinant = a * ca + b * cb + c * cc
    if not determinant > SMALLEST_INFORMATION * (a * d * f):
        raise np.linalg.LinAlgError(_SINGULAR)
    ce = b * c - a * e
    adjugate = np.array((ca, cb, cc, cb, a * f - c * c, ce, cc, ce, a * d - b * b))
    return np.asarray(adjugate / determinant).reshape(3, 3)


def _square(flat: Array) -> Array:
    size = math.isqrt(flat.shape[-1])
    return flat.reshape(*flat.shape[:-1], size, size)


# A spin multiplies the power by a slowly varying factor; its logarithm is a cos + b sin of every
# period or harmonic given.  A period too close to the scan's looks like a pointing error.
def spin_columns(t_s: Array, periods_s: tuple[float, ...]) -> Array:
    """Return cosine and sine of every spin period at the times (n,), shape (n, 2 * periods)."""
    phase = 2.0 * math.pi * np.outer(t_s - t_s[0], 1.0 / np.array(periods_s))
    return np.concatenate([np.cos(phase), np.sin(phase)], axis=1)
