"""The bias model of SATCAL eqs. (1)-(2): observed angles = true angles + model(true angles).

Two forms share the coefficients.  `offset_rad` is the printed first-order az/el form: linear, for
fits and reports. `apply` and `remove` (and their moving versions) treat the tilt, skew and
collimation terms as exact rotations (`mount`), add the encoder and flexure terms at the axis angles
and the lags at the axis rates; they stay regular at the zenith and are inverses of each other.
With SATCAL Table 1 the two forms differ by less than 0.25 mdeg on the sky below 80 deg of elevation
and by more than 1 mdeg above 87.7 deg.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rf_pointing.calibration import taylor
from rf_pointing.calibration.angles import Angles, ArrayAngles, SeriesAngles
from rf_pointing.calibration.mount import Skew, axes_from_sky, sky_from_axes
from rf_pointing.calibration.terms import TERM_NAMES, Term, terms_by_name
from rf_pointing.core import require_between

Array = NDArray[np.float64]
TaylorPair = tuple[Array, Array]

# `remove` stops when two iterations agree this well (per axis, rates per second).
INVERSE_TOLERANCE_RAD = 1e-12
# `remove` raises if it has not converged after this many iterations.
INVERSE_ITERATIONS = 60
# Position to jerk, and one more: the acceleration of an acceleration lag is the fourth derivative.
_MOVING_ORDER = 5
_ALL_KINDS = ("rotation", "additive", "lag")


@dataclass(frozen=True)
class BiasModel:
    """Coefficients by term name: radians, seconds, seconds^2 (rad/K for thermal extensions).

    All 14 terms must be given; extensions (`terms.EXTENSION_TERMS`) are present when named.
    """

    coefficients: Mapping[str, float]
    _acting: tuple[tuple[Term, float], ...] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        terms = terms_by_name(self.coefficients)
        missing = [name for name in TERM_NAMES if name not in self.coefficients]
        if missing:
            raise ValueError(f"the bias model needs {', '.join(missing)}")
        # Degrees given for radians are 57 times too large: the limits are what shows them.
        for term in terms:
            require_between(term.name, self.coefficients[term.name], -term.limit, term.limit)
        ordered = {term.name: float(self.coefficients[term.name]) for term in terms}
        object.__setattr__(self, "coefficients", MappingProxyType(ordered))
        # Terms that are zero cost time in every period of the controller and change nothing.
        object.__setattr__(self, "_acting", tuple((t, ordered[t.name]) for t in terms if ordered[t.name] != 0.0))

    # A MappingProxyType cannot be pickled, and the fits of a Monte Carlo run in several processes.
    def __reduce__(self) -> tuple[type[Self], tuple[dict[str, float]]]:
        return type(self), (dict(self.coefficients),)

    @classmethod
    def zero(cls) -> Self:
        """Return the model of a perfect antenna."""
        return cls(dict.fromkeys(TERM_NAMES, 0.0))

    @classmethod
    def from_degrees(cls, coefficients: Mapping[str, float]) -> Self:
        """Build from degrees (angles) and seconds (lags), the units of SATCAL Tables 1 and 3."""
        scale = {term.name: _per_degree(term) for term in terms_by_name(coefficients)}
        return cls({name: value * scale[name] for name, value in coefficients.items()})

    def replace(self, **changes: float) -> Self:
        """Return a model with some coefficients changed; a new name must be a known extension."""
        return type(self)({**self.coefficients, **changes})

    @property
    def terms(self) -> tuple[Term, ...]:
        """Return the terms in the order of the coefficients."""
        return terms_by_name(self.coefficients)

    @property
    def skew(self) -> Skew:
        """Return the four rotations of the mount."""
        value = self.coefficients
        return Skew(value["non_orthogonality"], value["collimation"], value["mislevel_east"], value["mislevel_north"])

    @property
    def has_lags(self) -> bool:
        """Whether any rate or acceleration term is non-zero."""
        return any(term.kind == "lag" for term, _ in self._acting)

    def offset_rad(self, *motion: ArrayLike, temperature_k: ArrayLike | None = None) -> tuple[Array, Array]:
        """Return observed minus true azimuth and elevation (rad), SATCAL eqs. (1)-(2) as printed.

        `motion` are the true azimuth and elevation (rad), their rates (rad/s) and accelerations
        (rad/s^2), broadcast to one shape.  Raises ValueError for other than six of them, and if the
        model has a temperature term and `temperature_k` is None.
        """
        angles = ArrayAngles.of(motion, _optional(temperature_k))
        return self._sum(angles, np.zeros_like(angles.one), _ALL_KINDS)

    def apply(self, *motion: ArrayLike, temperature_k: ArrayLike | None = None) -> tuple[Array, Array]:
        """Return observed azimuth and elevation (rad) of a true `motion`, as in `offset_rad`.

        Exact; `remove` is the inverse.  Raises ValueError for a direction in the exclusion cone of
        the mount (`mount.Skew.cone_rad`).
        """
        azimuth, elevation = self._observed(self._true_series(*motion), _optional(temperature_k))
        return azimuth[0], elevation[0]

    def remove(self, *motion: ArrayLike, temperature_k: ArrayLike | None = None) -> tuple[Array, Array]:
        """Return the true angles (rad) of observed ones; the rates are those of the TRUE motion.

        Raises ValueError if INVERSE_ITERATIONS do not reach INVERSE_TOLERANCE_RAD.
        """
        azimuth, elevation = self._inverse(self._true_series(*motion), 1, _optional(temperature_k))
        return azimuth[0], elevation[0]

    def apply_moving(
        self,
        position_rad: ArrayLike,
        velocity_rad_s: ArrayLike,
        acceleration_rad_s2: ArrayLike,
        *,
        jerk_rad_s3: ArrayLike = 0.0,
        temperature_k: ArrayLike | None = None,
    ) -> tuple[Array, Array, Array]:
        """Return the joint motion (..., 2) that keeps the beam on a moving true target.

        Columns are azimuth, elevation.  Without `jerk_rad_s3` the target's motion is taken to end
        at its acceleration: the position is unaffected, the velocity lacks x7 * jerk and the
        acceleration x6 * jerk.
        """
        true = _series_of(position_rad, velocity_rad_s, acceleration_rad_s2, jerk_rad_s3)
        return _motion(self._observed(true, _optional(temperature_k)))

    def remove_moving(
        self,
        position_rad: ArrayLike,
        velocity_rad_s: ArrayLike,
        acceleration_rad_s2: ArrayLike,
        *,
        jerk_rad_s3: ArrayLike = 0.0,
        temperature_k: ArrayLike | None = None,
    ) -> tuple[Array, Array, Array]:
        """Return the beam's true position, velocity and acceleration (..., 2) of moving joints.

        The inverse of `apply_moving` with the same `jerk_rad_s3` (that of the true motion).
        """
        observed = _series_of(position_rad, velocity_rad_s, acceleration_rad_s2, jerk_rad_s3)
        return _motion(self._inverse(observed, 3, _optional(temperature_k)))

    def _true_series(self, *motion: ArrayLike) -> TaylorPair:
        azimuth, elevation, *rates = motion
        position = np.stack(np.broadcast_arrays(azimuth, elevation), axis=-1)
        velocity = np.stack(np.broadcast_arrays(rates[0], rates[1]), axis=-1)
        acceleration = np.stack(np.broadcast_arrays(rates[2], rates[3]), axis=-1)
        # Without lags no derivative is needed, and shorter series are cheaper.
        length = 3 if self.has_lags else 1
        full = _series_of(position, velocity, acceleration, 0.0)
        return full[0][:length], full[1][:length]

    def _observed(self, true: TaylorPair, temperature_k: Array | None) -> TaylorPair:
        # Encoder, flexure and lag terms act at the axes: the mount's rotations come first.
        axes = axes_from_sky(*true, self.skew)
        shift = self._shift(axes, ("additive", "lag"), temperature_k)
        return axes[0] + shift[0], axes[1] + shift[1]

    def _shift(self, axes: TaylorPair, kinds: tuple[str, ...], temperature_k: Array | None) -> TaylorPair:
        return self._sum(SeriesAngles(*axes, temperature_k), np.zeros_like(axes[0]), kinds)

    def _sum(self, angles: Angles, zero: Array, kinds: tuple[str, ...]) -> tuple[Array, Array]:
        azimuth, elevation = zero, zero.copy()
        for term, value in self._acting:
            if term.kind in kinds and term.azimuth is not None:
                azimuth += value * term.azimuth(angles)
            if term.kind in kinds and term.elevation is not None:
                elevation += value * term.elevation(angles)
        return azimuth, elevation

    def _inverse(self, observed: TaylorPair, kept: int, temperature_k: Array | None) -> TaylorPair:
        """Solve for the first `kept` elements of the true motion; the others are the true ones."""
        true, axes = observed, (observed[0][:kept], observed[1][:kept])
        for _ in range(INVERSE_ITERATIONS):
            lag = self._shift(axes_from_sky(*true, self.skew), ("lag",), None) if self.has_lags else _no_shift(true)
            target = (observed[0][:kept] - lag[0][:kept], observed[1][:kept] - lag[1][:kept])
            axes = self._without_encoders(target, axes, temperature_k)
            found = sky_from_axes(*axes, self.skew)
            change = max(float(np.max(np.abs(f - t[:kept]))) for f, t in zip(found, true, strict=True))
            # The higher derivatives were given as those of the true motion: only the first elements
            # are unknown.
            true = (
                np.concatenate([found[0], observed[0][kept:]]),
                np.concatenate([found[1], observed[1][kept:]]),
            )
            if change <= INVERSE_TOLERANCE_RAD or not self.has_lags:
                return true
        raise ValueError(
            f"remove: change {change:.3e} rad after {INVERSE_ITERATIONS} iterations must be "
            f"<= {INVERSE_TOLERANCE_RAD}; the lags are too long for the azimuth rates this close to the zenith"
        )

    def _without_encoders(self, target: TaylorPair, start: TaylorPair, temperature_k: Array | None) -> TaylorPair:
        axes = start
        for _ in range(INVERSE_ITERATIONS):
            shift = self._shift(axes, ("additive",), temperature_k)
            found = (target[0] - shift[0], target[1] - shift[1])
            change = max(float(np.max(np.abs(f - a))) for f, a in zip(found, axes, strict=True))
            axes = found
            # Tighter than the outer loop, which would otherwise see this loop's rest as its own
            # change.
            if change <= 0.01 * INVERSE_TOLERANCE_RAD:
                return axes
        raise ValueError(f"remove: encoder terms change {change:.3e} rad after {INVERSE_ITERATIONS} iterations")


def _per_degree(term: Term) -> float:
    return math.radians(1.0) if term.unit.startswith("rad") else 1.0


def _optional(temperature_k: ArrayLike | None) -> Array | None:
    return None if temperature_k is None else np.asarray(temperature_k, dtype=np.float64)


def _series_of(position: ArrayLike, velocity: ArrayLike, acceleration: ArrayLike, jerk: ArrayLike) -> TaylorPair:
    parts = np.broadcast_arrays(*(np.asarray(p, dtype=np.float64) for p in (position, velocity, acceleration, jerk)))
    for name, part in zip(("position_rad", "velocity_rad_s", "acceleration_rad_s2", "jerk_rad_s3"), parts, strict=True):
        if part.ndim == 0 or part.shape[-1] != 2:
            raise ValueError(f"{name} has shape {part.shape}, must end in 2 (azimuth, elevation)")
        if not np.all(np.isfinite(part)):
            raise ValueError(f"{name} must be finite")
    series = taylor.from_derivatives(*parts, *([0.0] * (_MOVING_ORDER - len(parts))))
    return series[..., 0], series[..., 1]


def _motion(series: TaylorPair) -> tuple[Array, Array, Array]:
    both = np.stack(series, axis=-1)
    return both[0], both[1], 2.0 * both[2]


def _no_shift(series: TaylorPair) -> TaylorPair:
    return np.zeros_like(series[0]), np.zeros_like(series[1])
