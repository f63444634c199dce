"""The bias model of SATCAL eqs. (1)-(2): observed angles = true angles + model(true angles).

Two forms share the coefficients.  `offset_rad` is the printed first-order az/el form: linear, for
fits and reports. `apply` and `remove` treat the tilt, skew and collimation terms as exact rotations
(`mount`), add the encoder and flexure terms at the axis angles and the lags at the axis rates; they
stay regular at the zenith and are inverses of each other.  `apply_moving` adds the derivatives.
With SATCAL Table 1 the two forms differ by less than 0.25 mdeg on the sky below 80 deg of elevation
and by more than 1 mdeg above 87.7 deg.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from rf_pointing.calibration import taylor
from rf_pointing.calibration.angles import (
    REFERENCE_TEMPERATURE_K,
    Angles,
    ArrayAngles,
    SeriesAngles,
)
from rf_pointing.calibration.mount import Skew, axes_from_sky, bent, sky_from_axes, straight
from rf_pointing.calibration.terms import Term, mount_of, names_of, numbered, terms_by_name
from rf_pointing.core import LEVEL, UP, Array, Kinematics, angular_distance_rad, require_between
from rf_pointing.core.mount_types import AZIMUTH_ELEVATION

_DEGREE = math.radians(1.0)
# `remove` stops when two iterations agree this well (per axis, rates per second).
INVERSE_TOLERANCE_RAD = 1e-12
# `remove` raises if it has not converged after this many iterations.
INVERSE_ITERATIONS = 60
# Where `departure` looks: the terms bend over tens of degrees.
_AZIMUTHS, _ELEVATIONS = np.meshgrid(
    np.radians(np.arange(0.0, 360.0, 15.0)), np.radians(np.arange(5.0, 81.0, 5.0))
)


@dataclass(frozen=True)
class BiasModel:
    """Coefficients by term name: radians, seconds, seconds^2 (rad/K for thermal extensions).

    All 14 terms of a kind of mount must be given; further ones (`terms.FURTHER_TERMS`) are present
    when named.  Angles are those of the axes, under the names of azimuth and elevation; where the
    vertical is, a mount with `flexure` must say (`on`).
    """

    coefficients: Mapping[str, float]
    mount: Kinematics | None = None
    _acting: tuple[tuple[Term, float], ...] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        kind = self.mount.type if self.mount else mount_of(self.coefficients)
        terms = terms_by_name(self.coefficients, "" if kind == AZIMUTH_ELEVATION else kind)
        missing = [name for name in names_of(kind) if name not in self.coefficients]
        if missing:
            raise ValueError(f"the bias model needs {', '.join(missing)}")
        # Degrees given for radians are 57 times too large: the limits are what shows them.
        for term in terms:
            require_between(term.name, self.coefficients[term.name], -term.limit, term.limit)
        # Only these axes have their vertical where the model has its pole.
        if kind == AZIMUTH_ELEVATION and self.mount is None:
            object.__setattr__(self, "mount", LEVEL)
        ordered = {term.name: float(self.coefficients[term.name]) for term in terms}
        object.__setattr__(self, "coefficients", MappingProxyType(ordered))
        # Terms that are zero cost time in every period of the controller and change nothing.
        object.__setattr__(
            self, "_acting", tuple((t, ordered[t.name]) for t in terms if ordered[t.name] != 0.0)
        )

    # A MappingProxyType cannot be pickled, and the fits of a Monte Carlo run in several processes.
    def __reduce__(self) -> tuple[type[Self], tuple[dict[str, float], Kinematics | None]]:
        return type(self), (dict(self.coefficients), self.mount)

    @classmethod
    def zero(cls, mount: Kinematics | None = None) -> Self:
        """Return the model of a perfect antenna."""
        return cls(dict.fromkeys(names_of(mount.type if mount else AZIMUTH_ELEVATION), 0.0), mount)

    @classmethod
    def from_degrees(cls, coefficients: Mapping[str, float]) -> Self:
        """Build from degrees (angles) and seconds (lags), the units of SATCAL Tables 1 and 3."""
        terms = terms_by_name(coefficients)
        return cls(
            {
                t.name: coefficients[t.name] * (_DEGREE if t.unit.startswith("rad") else 1.0)
                for t in terms
            }
        )

    def replace(self, **changes: float) -> Self:
        """Return a model with some coefficients changed; a new name must be a known extension."""
        return type(self)({**self.coefficients, **changes}, self.mount)

    def on(self, mount: Kinematics) -> Self:
        """Return the model on a mount; ValueError for the terms of a mount of another kind."""
        own, kind = self.mount, mount_of(self.coefficients)
        # No model is sent as one of zeros, whatever the mount.
        if not self._acting:
            return type(self).zero(mount)
        if kind != mount.type or (own and not own.same_axes(mount)):
            of = own or Kinematics(type=kind)
            raise ValueError(
                f"the bias model is of a mount {of.words}, must be of one {mount.words}"
            )
        return type(self)(self.coefficients, mount)

    @property
    def terms(self) -> tuple[Term, ...]:
        """Return the terms in the order of the coefficients."""
        return terms_by_name(self.coefficients)

    @property
    def skew(self) -> Skew:
        """Return the four rotations of the mount."""
        return Skew(*numbered(self.coefficients, 2, 3, 8, 9))

    @property
    def pull(self) -> Array | None:
        """Return the pull (3,) on the beam in the frame of the mount, None without one."""
        size = next((value for term, value in self._acting if term.kind == "flexure"), 0.0)
        if size == 0.0:
            return None
        if self.mount is None:
            raise ValueError(
                "mount=None: a bias model with flexure must be put on its mount (`on`)"
            )
        return np.asarray(size * self.mount.matrix[UP])

    @property
    def has_lags(self) -> bool:
        """Whether any rate or acceleration term is non-zero."""
        return any(term.kind == "lag" for term, _ in self._acting)

    def at_temperature(self, temperature_k: float | None) -> Self:
        """Return the model at one temperature, with its thermal terms made part of the offsets.

        Raises ValueError for a model with thermal terms where the temperature is not known.
        """
        names = [term.name for term, _ in self._acting if term.unit == "rad/K"]
        if not names:
            return self
        if temperature_k is None:
            raise ValueError(
                f"the bias model has {', '.join(names)}, and no temperature has been received"
            )
        changes = dict.fromkeys(names, 0.0)
        for name in names:
            offset = name.replace("temperature", "offset")
            warmer_k = temperature_k - REFERENCE_TEMPERATURE_K
            changes[offset] = self.coefficients[offset] + self.coefficients[name] * warmer_k
        return self.replace(**changes)

    def offset_rad(
        self, *motion: ArrayLike, temperature_k: ArrayLike | None = None
    ) -> tuple[Array, Array]:
        """Return observed minus true azimuth and elevation (rad), SATCAL eqs. (1)-(2) as printed.

        `motion` are the true azimuth and elevation (rad), their rates (rad/s) and accelerations
        (rad/s^2), broadcast to one shape.  Raises ValueError for other than six of them, and if the
        model has a temperature term and `temperature_k` is None.
        """
        angles = ArrayAngles.of(motion, temperature_k, self.mount)
        azimuth, elevation = self._sum(
            angles, (2, *angles.one.shape), ("rotation", "additive", "lag", "flexure")
        )
        return azimuth, elevation

    def departure(self) -> tuple[float, float, float]:
        """Return how far a beam at rest is off the axes, at most, and where (all rad).

        The angle is one on the sky, the azimuth and elevation are those of the beam, which is
        looked at from 5 to 80 deg of elevation.  A thermal term must have its temperature
        (`at_temperature`).
        """
        still = np.zeros_like(_AZIMUTHS)
        axes = self.apply(_AZIMUTHS, _ELEVATIONS, still, still, still, still)
        apart = angular_distance_rad(*axes, _AZIMUTHS, _ELEVATIONS)
        worst = np.unravel_index(int(np.argmax(apart)), apart.shape)
        return float(apart[worst]), float(_AZIMUTHS[worst]), float(_ELEVATIONS[worst])

    def apply(
        self, *motion: ArrayLike, temperature_k: ArrayLike | None = None
    ) -> tuple[Array, Array]:
        """Return observed azimuth and elevation (rad) of a true `motion`, as in `offset_rad`.

        Exact; `remove` is the inverse.  Raises ValueError for a direction in the exclusion cone of
        the mount (`mount.Skew.cone_rad`).
        """
        azimuth, elevation = self._observed(self._true_series(*motion), temperature_k)[:, 0]
        return azimuth, elevation

    def remove(
        self, *motion: ArrayLike, temperature_k: ArrayLike | None = None
    ) -> tuple[Array, Array]:
        """Return the true angles (rad) of observed ones; the rates are those of the TRUE motion.

        Within 0.25 deg of the zenith, with lags of a second, several directions can have the same
        observed angles: one of them is returned, not always the nearest; `beam_at` of axes whose
        rates are known has one only.  Raises ValueError if INVERSE_ITERATIONS do not reach
        INVERSE_TOLERANCE_RAD.
        """
        observed = self._true_series(*motion)
        # The derivatives were given as those of the true motion: only the angles are unknown.
        true, axes, pull = observed.copy(), observed[:, :1], self.pull
        for _ in range(INVERSE_ITERATIONS):
            target = observed[:, :1] - self._lag(true) if self.has_lags else observed[:, :1]
            axes = self._without_encoders(target, axes, temperature_k)
            found = np.array(sky_from_axes(axes[0], axes[1], self.skew))
            if pull is not None:
                found = np.array(straight(found[0], found[1], pull))
            change = float(np.max(np.abs(found - true[:, :1])))
            true[:, :1] = found
            if change <= INVERSE_TOLERANCE_RAD or not self.has_lags:
                return true[0, 0], true[1, 0]
        raise ValueError(
            f"remove: change {change:.3e} rad after {INVERSE_ITERATIONS} iterations must be "
            f"<= {INVERSE_TOLERANCE_RAD}; the lags are too long for the azimuth rates this close to the zenith"
        )

    def beam_at(self, *motion: ArrayLike) -> tuple[Array, Array]:
        """Return the true angles (rad) of the beam of moving axes; the rates are those of the AXES.

        The lags come off at once, and axes at rest point in one direction: at the zenith too it is
        the nearest.  Raises ValueError in the mount's cone of exclusion.
        """
        axes, still = motion[:2], (0.0, 0.0, 0.0, 0.0)
        moving, resting = (
            np.array(self.offset_rad(*axes, *rates)) for rates in (motion[2:], still)
        )
        return self.remove(*(np.array(axes) - moving + resting), *still)

    def apply_moving(
        self, position_rad: ArrayLike, velocity_rad_s: ArrayLike, acceleration_rad_s2: ArrayLike, *,
        temperature_k: ArrayLike | None = None,
    ) -> tuple[Array, Array, Array]:  # fmt: skip
        """Return the joint motion (..., 2) that keeps the beam on a moving true target.

        Columns are azimuth, elevation.  The target's motion is taken to end at its acceleration:
        the position is unaffected, the velocity lacks x7 * jerk and the acceleration x6 * jerk.
        """
        true = _series_of(position_rad, velocity_rad_s, acceleration_rad_s2)
        azimuth, elevation = self._observed(true, temperature_k)
        joint = np.stack([azimuth, elevation], axis=-1)
        return joint[0], joint[1], 2.0 * joint[2]

    def _true_series(self, *motion: ArrayLike) -> Array:
        position, velocity, acceleration = (
            np.stack(np.broadcast_arrays(*motion[k : k + 2]), axis=-1) for k in (0, 2, 4)
        )
        # Without lags no derivative is needed, and shorter series are cheaper.
        return _series_of(position, velocity, acceleration)[:, : 3 if self.has_lags else 1]

    def _observed(self, true: Array, temperature_k: ArrayLike | None) -> Array:
        # Encoder, flexure and lag terms act at the axes: the mount's rotations come first.
        axes = self._rotated(true)
        return axes + self._shift(axes, ("additive", "lag"), temperature_k)

    def _rotated(self, true: Array) -> Array:
        pull = self.pull
        beam = (true[0], true[1]) if pull is None else bent(true[0], true[1], pull)
        return np.array(axes_from_sky(beam[0], beam[1], self.skew))

    def _shift(self, axes: Array, kinds: tuple[str, ...], temperature_k: ArrayLike | None) -> Array:
        return self._sum(SeriesAngles(axes[0], axes[1], temperature_k), axes.shape, kinds)

    def _sum(self, angles: Angles, shape: tuple[int, ...], kinds: tuple[str, ...]) -> Array:
        """Return the sum (2, ...) of the terms of some kinds, azimuth first."""
        total = np.zeros(shape)
        for term, value in self._acting:
            if term.kind in kinds and term.azimuth is not None:
                total[0] += value * term.azimuth(angles)
            if term.kind in kinds and term.elevation is not None:
                total[1] += value * term.elevation(angles)
        return total

    def _lag(self, true: Array) -> Array:
        return self._shift(self._rotated(true), ("lag",), None)[:, :1]

    def _without_encoders(
        self, target: Array, start: Array, temperature_k: ArrayLike | None
    ) -> Array:
        axes = start
        for _ in range(INVERSE_ITERATIONS):
            found = target - self._shift(axes, ("additive",), temperature_k)
            change = float(np.max(np.abs(found - axes)))
            axes = found
            # Tighter than the outer loop, which would else see the rest of this one as its change.
            if change <= 0.01 * INVERSE_TOLERANCE_RAD:
                return axes
        raise ValueError(
            f"remove: encoder terms change {change:.3e} rad after {INVERSE_ITERATIONS} iterations"
        )


def _series_of(position: ArrayLike, velocity: ArrayLike, acceleration: ArrayLike) -> Array:
    """Return the Taylor series (2, 5, ...) of azimuth and elevation."""
    parts = np.broadcast_arrays(
        *(np.asarray(p, dtype=np.float64) for p in (position, velocity, acceleration))
    )
    for name, part in zip(
        ("position_rad", "velocity_rad_s", "acceleration_rad_s2"), parts, strict=True
    ):
        if part.ndim == 0 or part.shape[-1] != 2:
            raise ValueError(f"{name} has shape {part.shape}, must end in 2 (azimuth, elevation)")
        if not np.all(np.isfinite(part)):
            raise ValueError(f"{name} must be finite")
    # Two more than given: the acceleration of an acceleration lag is the fourth derivative.
    return np.moveaxis(taylor.from_derivatives(*parts, 0.0, 0.0), -1, 0)
