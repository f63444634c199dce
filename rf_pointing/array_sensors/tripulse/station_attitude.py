"""Attitude of a satellite array from the lines of sight that its ground stations measured.

Keeps the newest observation of each station, turns those of one epoch into a weighted Wahba fit
with the covariance (31) of TRIPULSE, and tests the residual: two stations over-determine the
attitude by one, L stations by 2 L - 3.  An observation a lobe away does not fit the known angle
between the stations, and shows there.

Two stations have a closed form too (`bisector_rotation`, TRIPULSE 5.2): A = [A1 A2 A3], A1 the
bisector of the two directions, A2 their normal, A3 = A1 x A2, likewise A' of the reference
directions, R = A A'^T.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from rf_pointing.array_sensors.attitude.quaternion import quaternion_from_matrix
from rf_pointing.array_sensors.attitude.rotations import cosine_slopes, cross_matrix
from rf_pointing.array_sensors.attitude.wahba import (
    SMALLEST_SEPARATION_RAD,
    attitude_covariance,
    fit_rotation,
    separation_rad,
    unit_directions,
)
from rf_pointing.core import Params, as_finite_array, parameter, require_finite
from rf_pointing.core.types import Array

SMALLEST_HEIGHT = 1e-3
SMALLEST_EIGENVALUE = (
    1e-12  # of the largest: rounding leaves 1e-16 of an exact zero, of either sign
)
"""Least T_z: nearer to the plane of the array its error grows beyond every bound."""


def bisector_rotation(
    reference: ArrayLike,
    measured: ArrayLike,
    *,
    smallest_separation_rad: float = SMALLEST_SEPARATION_RAD,
) -> Array:
    """Return R (..., 3, 3) with `measured` = R `reference` in the least-squares sense, unit vectors
    (..., 2, 3).

    Raises
    ------
    ValueError : if a set is not of two unit vectors, or the two stations lie along one line.
    """
    frames = []
    for name, directions in (("reference", reference), ("measured", measured)):
        t = unit_directions(name, directions)
        if t.shape[-2:] != (2, 3):
            raise ValueError(f"{name} has shape {t.shape}, must be (..., 2, 3)")
        found = float(np.min(separation_rad(t)))
        if found < smallest_separation_rad:
            raise ValueError(
                f"{name} directions are collinear: separation {found} rad must be >= {smallest_separation_rad} rad"
            )
        frames.append(_bisector_frame(t[..., 0, :], t[..., 1, :]))
    return np.asarray(frames[1] @ np.swapaxes(frames[0], -1, -2))


def directions_from_projections(projections: ArrayLike) -> Array:
    """Return unit vectors (..., 3) with T_z = sqrt(1 - T_x^2 - T_y^2) from projections (..., 2)."""
    t = np.asarray(projections, dtype=np.float64)
    if t.shape[-1:] != (2,):
        raise ValueError(f"projections has shape {t.shape}, must be (..., 2)")
    require_finite("projections", t)
    height2 = 1.0 - np.sum(t**2, axis=-1)
    if np.any(height2 < SMALLEST_HEIGHT**2):
        raise ValueError(
            f"projections={t} leave T_z below {SMALLEST_HEIGHT}: in or behind the plane of the array"
        )
    return np.concatenate([t, np.sqrt(height2)[..., None]], axis=-1)


def direction_covariances(projections: ArrayLike, covariances: ArrayLike) -> Array:
    """Return the covariances (..., 3, 3) of the directions, to first order in those of the
    projections (..., 2, 2).
    """
    t = directions_from_projections(projections)
    c = np.asarray(covariances, dtype=np.float64)
    if c.shape[-2:] != (2, 2):
        raise ValueError(f"covariances has shape {c.shape}, must be (..., 2, 2)")
    require_finite("covariances", c)
    values = np.linalg.eigvalsh(c)
    if np.any(values[..., 0] <= SMALLEST_EIGENVALUE * values[..., 1]):
        raise ValueError(f"covariances={c} must be positive definite: singular covariance")
    slopes = cosine_slopes(t)
    return np.asarray(slopes @ c @ np.swapaxes(slopes, -1, -2))


def shared_covariance(directions: ArrayLike, sigma: float, weights: ArrayLike) -> Array:
    """Return the covariance (3, 3) of the rotation error from one error of the projections, `sigma`
    on each axis, that all measured `directions` (L, 3) have in common.
    """
    t, w = unit_directions("directions", directions), np.asarray(weights, dtype=np.float64)
    normal = np.einsum("l,lij->ij", w, np.eye(3) - t[:, :, None] * t[:, None, :])
    turned = np.linalg.solve(
        normal, np.einsum("l,lij,ljk->ik", w, cross_matrix(t), cosine_slopes(t))
    )
    return np.asarray(sigma**2 * turned @ turned.T)


def _bisector_frame(first: Array, second: Array) -> Array:
    bisector, normal = first + second, np.cross(first, second)
    a1 = bisector / np.linalg.norm(bisector, axis=-1, keepdims=True)
    a2 = normal / np.linalg.norm(normal, axis=-1, keepdims=True)
    return np.stack([a1, a2, np.cross(a1, a2)], axis=-1)


@dataclass(frozen=True, kw_only=True)
class StationAttitudeParams(Params):
    """When observations make an attitude."""

    # Two periods of the frames: an older observation belongs to another attitude.
    age_max_s: float = parameter(2.0, "oldest observation used", low=1e-3, high=1e4)
    separation_min_rad: float = parameter(
        math.radians(0.5),
        "smallest angle between stations as the satellite sees them",
        low=1e-6,
        high=1.5,
    )
    # Phases of the quadrants off by p rms move a projection by 2 p/(N k d): 6e-4 is 5 deg of 16
    # elements three wavelengths apart; a taper needs more (`beams.shared_projection_sigma`).  No
    # residual shows it: it turns all lines of sight alike.
    shared_sigma: float = parameter(
        6e-4,
        "fixed error of each projection that all stations share (beamformer)",
        low=0.0,
        high=0.1,
    )
    # At one epoch a second this rejects a sound attitude every twelve days.
    false_alarm: float = parameter(
        1e-6, "probability that a sound residual is refused", low=1e-12, high=0.1
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class StationObservation:
    """Projections (2,) of one station on the array axes with covariance (2, 2), and its known
    direction (3,).

    `reference` is the unit vector to the station in the reference frame.  An invalid observation
    carries its reason.
    """

    t_s: float
    station: str
    projections: Array
    covariance: Array
    reference: Array
    valid: bool = True
    reason: str = ""

    def __post_init__(self) -> None:
        require_finite("t_s", self.t_s)
        object.__setattr__(
            self, "projections", as_finite_array("projections", self.projections, (2,))
        )
        object.__setattr__(
            self, "covariance", as_finite_array("covariance", self.covariance, (2, 2))
        )
        object.__setattr__(self, "reference", unit_directions("reference", self.reference))
        # Only to check: a singular covariance is refused with the observation and not at the next
        # estimate.
        direction_covariances(self.projections, self.covariance)


@dataclass(frozen=True, slots=True, kw_only=True)
class StationAttitude:
    """Orientation of the array in the reference frame at `t_s`, the mean time of the observations.

    `quaternion` (x, y, z, w) takes array components to reference components; its sign continues
    that of the last one. `covariance_rad2` (3, 3): of the small rotation between true and estimated
    orientation, about the reference axes; `covariance_array_rad2`: the same about the array axes.
    `residual` is the normalised sum of squared residuals, with 2 L - 3 degrees of freedom.  An
    invalid attitude carries its reason, the last quaternion and a useless covariance.
    """

    t_s: float
    quaternion: Array
    covariance_rad2: Array
    covariance_array_rad2: Array
    residual: float
    degrees_of_freedom: int
    stations: tuple[str, ...]
    valid: bool
    reason: str


@dataclass(frozen=True, slots=True, kw_only=True)
class StationAttitudeState:
    """Newest observation of each station, and the last valid quaternion (4,)."""

    observations: tuple[StationObservation, ...]
    quaternion: Array


class StationAttitudeEstimator:
    """`observe` what the stations report, ask for the attitude with `estimate`."""

    def __init__(self, params: StationAttitudeParams) -> None:
        self.params = params
        self._newest: dict[str, StationObservation] = {}
        self._quaternion = np.array([0.0, 0.0, 0.0, 1.0])

    @property
    def state(self) -> StationAttitudeState:
        """A copy of the state, to stop here and resume with `restore`."""
        return StationAttitudeState(
            observations=tuple(self._newest.values()), quaternion=self._quaternion.copy()
        )

    def restore(self, state: StationAttitudeState) -> None:
        """Continue from `state`."""
        self._newest = {observation.station: observation for observation in state.observations}
        self._quaternion = state.quaternion.copy()

    def observe(self, observation: StationObservation) -> None:
        """Take a station's report; refuse one that is not newer than the last of that station."""
        last = self._newest.get(observation.station)
        if last is not None and observation.t_s <= last.t_s:
            raise ValueError(
                f"t_s={observation.t_s} of station {observation.station} must be > {last.t_s}"
            )
        self._newest[observation.station] = observation

    def estimate(self, t_s: float) -> StationAttitude:
        """Return the attitude from the observations that are recent at `t_s`, or an invalid one
        with its reason.
        """
        require_finite("t_s", t_s)
        used, refused = [], []
        for observation in self._newest.values():
            age_s = t_s - observation.t_s
            if not observation.valid:
                refused.append(f"{observation.station}: {observation.reason}")
            elif not 0.0 <= age_s <= self.params.age_max_s:
                refused.append(
                    f"{observation.station}: age {age_s} s is not within 0 and {self.params.age_max_s} s"
                )
            else:
                used.append(observation)
        if len(used) < 2:
            reason = f"{len(used)} of {len(self._newest)} stations usable, must be at least 2"
            return self._invalid(t_s, used, "; ".join([reason, *refused]))
        return self._fit(t_s, used)

    def _fit(self, t_s: float, used: list[StationObservation]) -> StationAttitude:
        reference = np.stack([observation.reference for observation in used])
        apart = float(separation_rad(reference))
        if apart < self.params.separation_min_rad:
            reason = f"stations are collinear: {apart} rad apart, must be >= {self.params.separation_min_rad} rad"
            return self._invalid(t_s, used, reason)
        projections = np.stack([observation.projections for observation in used])
        measured = directions_from_projections(projections)
        spreads = direction_covariances(
            projections, np.stack([observation.covariance for observation in used])
        )
        # The trace is a direction's variance, but for a factor that all stations share.
        weights = np.reciprocal(np.trace(spreads, axis1=-2, axis2=-1))
        try:
            fit = fit_rotation(reference, measured, weights)
        except ValueError as refused:
            return self._invalid(t_s, used, str(refused))
        residual, freedom = _normalised_residual(projections, used, fit.rotation), 2 * len(used) - 3
        limit = _chi_square_limit(freedom, self.params.false_alarm)
        # Two stations know the angle between them: a station a lobe away misses it by far more than
        # noise.
        if residual > limit:
            return self._invalid(
                t_s,
                used,
                f"residual {residual} with {freedom} degrees of freedom must be <= {limit}: "
                "a station is a lobe away or misidentified",
                residual,
            )
        covariance = attitude_covariance(measured, spreads, weights)
        covariance = covariance + shared_covariance(measured, self.params.shared_sigma, weights)
        return self._valid(used, fit.rotation, covariance, residual)

    def _valid(
        self, used: list[StationObservation], rotation: Array, covariance: Array, residual: float
    ) -> StationAttitude:
        quaternion = quaternion_from_matrix(rotation.T)
        # Consumers interpolate: the sign must not jump between two epochs.
        if float(quaternion @ self._quaternion) < 0.0:
            quaternion = -quaternion
        self._quaternion = quaternion
        return StationAttitude(
            # The observations may differ by their age; their mean time is when the attitude holds.
            t_s=float(np.mean([observation.t_s for observation in used])),
            quaternion=quaternion.copy(),
            covariance_rad2=rotation.T @ covariance @ rotation,
            covariance_array_rad2=covariance,
            residual=residual,
            degrees_of_freedom=2 * len(used) - 3,
            stations=tuple(observation.station for observation in used),
            valid=True,
            reason="",
        )

    def _invalid(
        self, t_s: float, used: list[StationObservation], reason: str, residual: float = 0.0
    ) -> StationAttitude:
        # Half a turn about every axis: says nothing, and is finite for a consumer that inverts it.
        useless = math.pi**2 * np.eye(3)
        return StationAttitude(
            t_s=t_s,
            quaternion=self._quaternion.copy(),
            covariance_rad2=useless,
            covariance_array_rad2=useless.copy(),
            residual=residual,
            degrees_of_freedom=max(2 * len(used) - 3, 0),
            stations=tuple(observation.station for observation in used),
            valid=False,
            reason=reason,
        )


def _normalised_residual(
    projections: Array, used: list[StationObservation], rotation: Array
) -> float:
    """Return sum r^T C^-1 r of the projections' residuals, over all stations."""
    total = 0.0
    for projection, observation in zip(projections, used, strict=True):
        gap = projection - (rotation @ observation.reference)[:2]
        total += float(gap @ np.linalg.solve(observation.covariance, gap))
    return total


def _chi_square_limit(degrees_of_freedom: int, probability: float) -> float:
    from scipy.special import chdtri

    return float(chdtri(degrees_of_freedom, probability))
