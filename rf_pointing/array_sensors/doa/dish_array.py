"""Pointing error of a dish from the array of patches on it, and the simulated array.

The simulated array receives a carrier from where the target is off the beam: snapshots of every
patch, `PERIOD_S` long, with its level and the noise of its own receiver.  The tracker knows none of
that: it estimates the direction (MUSIC), turns it into the beam's axes and its covariance with it.

A direction is valid when no other one explains the block nearly as well.  Of two directions whose
steering vectors have the correlation rho, the wrong one is taken with the probability of about
exp(-kappa (1 - rho) / 2) / 2, kappa the effective SNR: with `SEPARATION` below 1e-8.  At a grating
lobe rho is 1, so that no SNR is enough.  The phases must also be those of the direction: the search
of MUSIC may end on a lobe that is nearly as high.

In the beam's frame (`rf.dish_array`) an offset (x, u) on the sky, as `sky_offset_rad` gives it, is
the direction

    d = (x sin(s)/s, u sin(s)/s, cos(s)),   s = hypot(x, u).
"""

import math
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from rf_pointing.array_sensors.doa.array import ArrayResponse, CircularArrayParams, phase_radius_rad, steering
from rf_pointing.array_sensors.doa.array_source import ArraySource, ArraySourceParams, SnapshotBlock
from rf_pointing.array_sensors.doa.covariance import sample_covariance
from rf_pointing.array_sensors.doa.estimator import DirectionEstimate, DoaEstimator, DoaEstimatorParams
from rf_pointing.array_sensors.doa.music import lattice, principal_eigenvectors
from rf_pointing.core import PointingError, Sensor, random_stream
from rf_pointing.core.types import Array
from rf_pointing.rf.dish_array import (
    BETWEEN,
    LATTICE,
    LEAST_EFFECTIVE_SNR,
    MAIN_LOBE,
    PERIOD_S,
    SEPARATION,
    SNAPSHOTS,
    DishArrayParams,
)

# Below this separation its sine is itself to the last digit.
SMALL_RAD = 1e-9
FIT_SIGMAS = 8.0
"""Largest misfit, about chi squared of the patches; a separate lobe exceeds it."""


def circle_of(array: DishArrayParams) -> CircularArrayParams:
    """Return the array as the estimators know it."""
    return CircularArrayParams(elements=array.elements, radius_m=array.radius_m, wavelength_m=array.wavelength_m)


class SimulatedDishArray:
    """The receivers behind the patches; their phases are known to `phase_sigma_rad` only."""

    def __init__(self, array: DishArrayParams, seed: int) -> None:
        self.array = array
        phases = array.phase_sigma_rad * random_stream(seed, "dish_array_phases").standard_normal(array.elements)
        response = ArrayResponse(gain=np.exp(1j * phases), coupling=np.zeros(array.elements // 2, dtype=np.complex128))
        self._source = ArraySource(
            circle_of(array), ArraySourceParams(snapshots=SNAPSHOTS), seed=seed, name="dish_array", response=response
        )

    def receive(self, truth: PointingError) -> SnapshotBlock:
        """Return the block that ends at the time of the true error.

        `truth` carries the C/N0 that the dish would have on the axis of its beam.  A target behind
        the array is not received: the block is noise.
        """
        direction = self.array.rotation @ direction_from_offset(
            np.array([truth.cross_elevation_rad, truth.elevation_rad])
        )
        if direction[2] <= 0.0:
            return self._source.step(truth.t_s, np.zeros((0, 3)), np.zeros(0))
        # A patch has the pattern cos(theta) of voltage.
        level = truth.carrier_to_noise_db_hz - self.array.element_loss_db + 20.0 * math.log10(direction[2])
        snr_db = level + 10.0 * math.log10(PERIOD_S / SNAPSHOTS)
        return self._source.step(truth.t_s, direction[None], np.array([snr_db]))


class DishArrayTracker:
    """Turns blocks of snapshots into pointing errors of the sensor `array`."""

    def __init__(self, array: DishArrayParams) -> None:
        self.array, self.counts, self.last_reason = array, {"valid": 0, "invalid": 0}, ""
        self._circle, self._rotation = circle_of(array), array.rotation
        self._estimator = DoaEstimator(
            self._circle,
            DoaEstimatorParams(phase_sigma_rad=array.phase_sigma_rad, effective_snr_min=LEAST_EFFECTIVE_SNR),
        )

    def measure(self, block: SnapshotBlock) -> PointingError:
        """Return the pointing error in the middle of a block; an invalid one has its reason.

        ValueError for a block of another array.
        """
        (found,) = self._estimator.estimate(block)
        reason = found.reason or self._ambiguity(found, block)
        noise = found.covariance_rad2
        if found.bias_rad is not None:
            noise = noise + found.bias_rad @ found.bias_rad.T
        turn = self._rotation
        offset, covariance = offset_from_direction(turn.T @ found.direction, turn.T @ noise @ turn)
        level = found.snr_db + 10.0 * math.log10(self.array.elements * block.snapshots.shape[1] / PERIOD_S)
        self.counts["invalid" if reason else "valid"] += 1
        self.last_reason = reason
        return PointingError(
            # In the middle, as the target moves meanwhile; on the wire's whole microseconds.
            t_s=round(block.t_s - 0.5 * PERIOD_S, 6),
            sensor=Sensor.ARRAY,
            cross_elevation_rad=float(offset[0]),
            elevation_rad=float(offset[1]),
            covariance_rad2=0.5 * (covariance + covariance.T),
            # The wire carries finite numbers; 0 dB-Hz is far below what any tracker uses.
            carrier_to_noise_db_hz=max(level, 0.0),
            valid=not reason,
            reason=reason,
        )

    def _ambiguity(self, found: DirectionEstimate, block: SnapshotBlock) -> str:
        """Return why the direction may be another one, or ""."""
        elements, phase = self.array.elements, self.array.phase_sigma_rad
        # Unknown phases hide a difference as noise does, however strong the signal is.
        kappa = 1.0 / (1.0 / found.effective_snr + 2.0 * phase**2 / elements)
        received = principal_eigenvectors(sample_covariance(block.snapshots)[None], elements)[0]
        ideal = steering(self._circle, found.direction[None])[0]
        misfit = kappa * (1.0 - abs(np.vdot(received, ideal)) ** 2 / elements)
        if misfit > elements + FIT_SIGMAS * math.sqrt(elements):
            return f"the phases are those of no one direction: misfit {misfit:.3g} of {elements} patches"
        other, likeness = rival(self._circle, found.direction)
        separation = kappa * (1.0 - likeness)
        if separation >= SEPARATION:
            return ""
        apart = math.degrees(math.acos(min(1.0, float(other @ found.direction))))
        return (
            f"ambiguous: a direction {apart:.1f} deg away has a correlation of {likeness:.3f}; kappa (1 - rho)="
            f"{separation:.3g} must be >= {SEPARATION:g}"
        )


@lru_cache(maxsize=8)
def _sky(circle: CircularArrayParams) -> tuple[Array, NDArray[np.complex128]]:
    """Return a lattice (n, 3) of the front half sphere and its steering vectors (n, M)."""
    points = lattice(LATTICE / phase_radius_rad(circle))
    return points, steering(circle, points)


def rival(circle: CircularArrayParams, direction: Array) -> tuple[Array, float]:
    """Return the direction (3,) outside the main lobe that is most like `direction` (3,), and how
    much at most: |a^H b| / M, 1 at a grating lobe.
    """
    points, manifold = _sky(circle)
    likeness = np.abs(manifold.conj() @ steering(circle, direction[None])[0]) / circle.elements
    near = np.hypot(*(points - direction)[:, :2].T) <= MAIN_LOBE / phase_radius_rad(circle)
    likeness[near] = 0.0
    best = int(np.argmax(likeness))
    return points[best], min(1.0, float(likeness[best]) + BETWEEN)


def direction_from_offset(offset_rad: Array) -> Array:
    """Return the unit vector (3,) in the beam's frame of an offset (2,) on the sky."""
    angle = float(np.hypot(*offset_rad))
    scale = math.sin(angle) / angle if angle > SMALL_RAD else 1.0
    return np.array([scale * offset_rad[0], scale * offset_rad[1], math.cos(angle)])


def offset_from_direction(direction: Array, covariance_rad2: Array) -> tuple[Array, Array]:
    """Return the offset (2,) and its covariance (2, 2) of a unit vector (3,) in the beam's frame.

    `covariance_rad2` (3, 3) is that of the direction, orthogonal to it.  Inverse of
    `direction_from_offset`.
    """
    across = float(np.hypot(*direction[:2]))
    angle = math.atan2(across, float(direction[2]))
    if angle <= SMALL_RAD:
        return direction[:2].copy(), covariance_rad2[:2, :2].copy()
    right, up = direction[:2] / across
    # Away from the beam an angle counts as it is; around it arcs grow by s / sin(s).
    outward = np.array([right * direction[2], up * direction[2], -across])
    around = (angle / across) * np.array([-up, right, 0.0])
    turned = np.stack([outward, around])
    axes = np.array([[right, -up], [up, right]])
    return angle * np.array([right, up]), axes @ (turned @ covariance_rad2 @ turned.T) @ axes.T
