"""Directions with covariance from one block of snapshots.

Steps: covariance, MUSIC, power, Cramer-Rao bound, verdict.  The covariance of a direction is the
bound at the estimated power: rank two, in the tangent plane, regular at theta = 0.  MUSIC attains
it above its threshold (docs/math/doa.md).  Below the threshold the covariance would not be true, so
the estimate is invalid and carries its reason.  So is an estimate from a channel with more signals
than expected: it may belong to another transmitter.
"""

import math
from dataclasses import dataclass

import numpy as np

from rf_pointing.array_sensors.attitude.rotations import cosine_slopes
from rf_pointing.array_sensors.doa.array import (
    ArrayResponse,
    CircularArrayParams,
    phase_radius_rad,
    steering,
)
from rf_pointing.array_sensors.doa.array_source import SnapshotBlock
from rf_pointing.array_sensors.doa.covariance import Eigen, count_sources, eigen, sample_covariance
from rf_pointing.array_sensors.doa.cramer_rao import direction_bound_rad2
from rf_pointing.array_sensors.doa.music import estimate_directions
from rf_pointing.array_sensors.doa.response_watch import ResponseMisfit, response_misfit
from rf_pointing.array_sensors.doa.several_sources import estimate_several
from rf_pointing.core import Params, parameter
from rf_pointing.core.types import Array, ComplexArray

# 0.04 deg of bias, below what the attitude filter claims after some minutes.
LARGEST_MIXED_PHASE_RAD = 0.01


@dataclass(frozen=True, kw_only=True)
class DoaEstimatorParams(Params):
    """How many sources to look for and when to believe the result."""

    sources: int = parameter(1, "number of simultaneous sources", low=1, high=16)
    # The threshold of MUSIC: outliers set in below kappa = 30 to 50, whatever the number of
    # snapshots.
    effective_snr_min: float = parameter(
        60.0, "smallest kappa = L (M SNR)^2 / (1 + M SNR)", low=0.0, high=1e9
    )
    # The bound in theta grows as 1/cos(theta); near the plane of the array the linear covariance is
    # no longer true.
    boresight_cosine_min: float = parameter(
        0.1, "smallest cos(theta): no accuracy in the array plane", low=1e-3, high=1
    )
    # With a second transmitter in the channel the direction may be that one's, without any other
    # sign of it.
    count_signals: bool = parameter(
        True, "refuse a channel with more signals than sources (white receiver noise)"
    )
    # Averaging does not help against it: the error is a constant of the direction cosines.
    phase_sigma_rad: float = parameter(
        0.0, "uncertainty of the phase of each element, constant in time", low=0.0, high=1.0
    )
    excluded: str = parameter("", "elements that are left out, counted from 0, separated by commas")

    def elements_in_use(self, elements: int) -> list[int]:
        """Return the elements of an array of `elements` that are not excluded.

        ValueError if an excluded one does not exist, or fewer than five are left.
        """
        words = [word.strip() for word in self.excluded.split(",") if word.strip()]
        known = {str(index) for index in range(elements)}
        if not set(words) <= known:
            raise ValueError(
                f"excluded={self.excluded!r} must be numbers from 0 to {elements - 1}, separated by commas"
            )
        used = [index for index in range(elements) if str(index) not in words]
        # As for a whole array: fewer leave an accuracy that depends on azimuth.
        if len(used) < 5:
            raise ValueError(
                f"excluded={self.excluded!r} leaves {len(used)} elements, must be >= 5"
            )
        return used


@dataclass(frozen=True, slots=True, kw_only=True)
class DirectionEstimate:
    """Direction of one source in the array frame at `t_s`.

    `direction` (3,) unit vector; `covariance_rad2` (3, 3) of its noise, rank two, orthogonal to it;
    `bias_rad` (3, 2) its error for one sigma of each of the two constant biases of the direction
    cosines that uncertain phases of the elements make, None where they are known; `snr_db` per
    element; `effective_snr` kappa as a ratio; `misfit` how far the elements are from their known
    response.  An invalid estimate carries its reason and must not
    move a filter.
    """

    t_s: float
    direction: Array
    covariance_rad2: Array
    snr_db: float
    effective_snr: float
    valid: bool
    reason: str
    misfit: ResponseMisfit
    bias_rad: Array | None = None


class DoaEstimator:
    """Stateless estimator for one array; `response` is its calibrated coupling and gain."""

    def __init__(
        self,
        array: CircularArrayParams,
        params: DoaEstimatorParams,
        *,
        response: ArrayResponse | None = None,
    ) -> None:
        used = params.elements_in_use(array.elements)
        if params.sources >= len(used):
            raise ValueError(f"sources={params.sources} must be < elements={len(used)}")
        if response is not None and len(response.gain) != array.elements:
            raise ValueError(
                f"response has {len(response.gain)} gains, must be elements={array.elements}"
            )
        self.array = array
        self.params = params
        self._used = used
        # Least squares of a phase plane over the circle: the phases' errors over the rim's slope.
        self._bias_sigma = (
            params.phase_sigma_rad * math.sqrt(2.0 / len(used)) / phase_radius_rad(array)
        )
        self._matrix: ComplexArray | None = None
        if response is not None or len(used) < array.elements:
            whole = (
                np.eye(array.elements, dtype=np.complex128) if response is None else response.matrix
            )
            # An excluded element is not measured; the others still couple to it.
            self._matrix = whole[used]

    def estimate(self, block: SnapshotBlock) -> list[DirectionEstimate]:
        """Return one estimate per source found, strongest spectrum first.

        An unresolved source is missing from it.

        Raises
        ------
        ValueError
            If the block has no more snapshots than sources (noise and signals cannot be
            separated), or its covariance is refused.
        """
        snapshots = block.snapshots
        if len(snapshots) != self.array.elements:
            raise ValueError(
                f"snapshots of {len(snapshots)} elements, must be {self.array.elements}"
            )
        snapshots = snapshots[self._used]
        silent = [self._used[k] for k in np.flatnonzero(np.max(np.abs(snapshots), axis=-1) == 0.0)]
        if silent:
            raise ValueError(
                f"element {silent[0]} delivers zeros only: exclude it with excluded, or repair it"
            )
        sources, count = self.params.sources, snapshots.shape[-1]
        if count <= sources:
            raise ValueError(
                f"snapshots={count} must be > sources={sources} to separate noise and signals"
            )
        covariance = sample_covariance(snapshots, sources)
        if sources == 1:
            peaks = estimate_directions(self.array, covariance[None], self._matrix)
            directions, flaw = (
                peaks.direction,
                "" if peaks.converged[0] else "peak refinement did not converge",
            )
        else:
            several = estimate_several(self.array, covariance, sources, self._matrix)
            directions, flaw = several.direction, several.reason
        if not len(directions):
            return []
        flaw = "; ".join(
            reason for reason in (flaw, self._crowded(covariance, count), self._mixed()) if reason
        )
        found = eigen(covariance, len(self._used), sources)
        manifold = self._response(directions)
        noise, powers = self._powers(covariance, found, manifold, count)
        misfits = [response_misfit(found, sources, steered, noise, count) for steered in manifold.T]
        return self._judge(block.t_s, directions, powers / noise, count, flaw, misfits)

    def _response(self, directions: Array) -> ComplexArray:
        """Return what the elements in use receive from each of `directions` (k, 3), (n, k)."""
        ideal = steering(self.array, directions).T
        return (
            ideal if self._matrix is None else np.asarray(self._matrix @ ideal, dtype=np.complex128)
        )

    def _mixed(self) -> str:
        """Return why uncertain phases spoil several sources, or "".

        Each source's bias depends on the others then, and is not a constant of the array.
        """
        sigma = self.params.phase_sigma_rad
        if self.params.sources == 1 or sigma <= LARGEST_MIXED_PHASE_RAD:
            return ""
        return (
            f"phase_sigma_rad={sigma:.3g} must be <= {LARGEST_MIXED_PHASE_RAD} with {self.params.sources} stations in "
            "one channel"
        )

    def _crowded(self, covariance: ComplexArray, count: int) -> str:
        """Return why the number of sources is too small, or "".

        Signals cannot be counted with fewer snapshots than elements.
        """
        if not self.params.count_signals or count < len(self._used):
            return ""
        held = int(count_sources(covariance, count))
        return (
            f"{held} signals in the channel, must be <= sources={self.params.sources}"
            if held > self.params.sources
            else ""
        )

    def _powers(
        self, covariance: ComplexArray, found: Eigen, manifold: ComplexArray, count: int
    ) -> tuple[float, ComplexArray]:
        """Return the noise power and the source covariance (k, k): least squares on R - noise I."""
        sources, values = self.params.sources, found.values
        rest = float(np.sum(values[sources:]))
        # The principal eigenvectors take a share of the noise with them; count / (count - sources)
        # restores it.
        noise = rest / (len(self._used) - sources) * count / (count - sources)
        # Identical snapshots or a simulation without noise: every power ratio would be infinite.
        if noise <= 1e-12 * values[0]:
            raise ValueError(
                f"noise power {noise} must be > 0: the covariance has rank {sources}, no noise to judge by"
            )
        inverse = np.linalg.pinv(manifold)
        return noise, inverse @ (covariance - noise * np.eye(len(self._used))) @ inverse.conj().T

    def _judge(
        self,
        t_s: float,
        directions: Array,
        snr: ComplexArray,
        count: int,
        flaw: str,
        misfits: list[ResponseMisfit],
    ) -> list[DirectionEstimate]:
        # Least squares may make a weak source's power negative; the bound needs a positive one and
        # rejects it as weak.
        powers = np.maximum(np.diag(snr).real, 1e-6)
        bound = direction_bound_rad2(
            self.array, directions, np.diag(powers).astype(complex), count, self._matrix
        )
        found = len(directions)
        return [
            self._one(
                t_s, directions[k], bound[k::found, k::found], float(powers[k]), flaw, misfits[k]
            )
            for k in range(found)
        ]

    def _one(
        self,
        t_s: float,
        direction: Array,
        cosines: Array,
        snr: float,
        flaw: str,
        misfit: ResponseMisfit,
    ) -> DirectionEstimate:
        effective = 2.0 / (phase_radius_rad(self.array) ** 2 * float(np.trace(cosines)))
        # z is floored so that a direction in the array plane still has a covariance to be rejected
        # with.
        slopes = cosine_slopes(np.append(direction[:2], max(float(direction[2]), 1e-9)))
        reasons = [flaw] if flaw else []
        if effective < self.params.effective_snr_min:
            reasons.append(
                f"effective_snr={effective:.3g} must be >= {self.params.effective_snr_min:g}"
            )
        if direction[2] < self.params.boresight_cosine_min:
            reasons.append(
                f"cos(theta)={direction[2]:.3g} must be >= {self.params.boresight_cosine_min:g}"
            )
        return DirectionEstimate(
            t_s=t_s,
            direction=direction,
            covariance_rad2=slopes @ cosines @ slopes.T,
            snr_db=10.0 * float(np.log10(snr)),
            effective_snr=effective,
            valid=not reasons,
            reason="; ".join(reasons),
            misfit=misfit,
            bias_rad=self._bias_sigma * slopes if self._bias_sigma else None,
        )
