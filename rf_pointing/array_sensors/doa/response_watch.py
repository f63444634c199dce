"""Test of the array itself: do its elements answer as they are known to?

The steering vector a of the direction found lies in the signal subspace, but for noise.  Its part
outside, r = (I - V V^H) a, has per real dimension the variance of MUSIC's null spectrum,

    n = a^H U a / (2 L),    U = sum_i noise lambda_i / (lambda_i - noise)^2 v_i v_i^H,

and 2 (M - K) - 2 dimensions: two are lost to the direction.  Of one source only the part in
quadrature with a counts, the phases, M - 3 dimensions: gains of the elements do not bend its
direction.  Errors of the response, such as an unknown coupling, add to r as much as they add to the
direction, so the mean of |r|^2 over many blocks shows what no single block and no innovation does.
"""

import math
from dataclasses import dataclass, field

import numpy as np

from rf_pointing.array_sensors.doa.covariance import Eigen
from rf_pointing.array_sensors.doa.innovation_watch import FEWEST, WatchParams, chi_square_limit
from rf_pointing.core.types import Array, ComplexArray

MODEL_SHARE = 0.15
"""The null spectrum is of first order in 1 / (L SNR): 8 % too small at kappa = 60."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ResponseMisfit:
    """How far one steering vector lies outside the signal subspace.

    `squared` is the sum over `freedom` dimensions, rad^2 of an element's phase, and `noise_rad2`
    what the receiver's noise gives each of them.
    """

    squared: float
    noise_rad2: float
    freedom: int

    def by_chance(self, phase_sigma_rad: float, false_alarm: float) -> float:
        """Return what noise and unknown phases exceed in `false_alarm` of the blocks."""
        dimensions = float(chi_square_limit(np.array(float(self.freedom)), false_alarm))
        return dimensions * ((1.0 + MODEL_SHARE) * self.noise_rad2 + phase_sigma_rad**2)


def response_misfit(
    found: Eigen, sources: int, steered: ComplexArray, noise: float, snapshots: int
) -> ResponseMisfit:
    """Return the misfit of `steered` (M,), the response to one of the `sources` directions, to the
    eigenvectors of a covariance of `snapshots` and noise power `noise`.
    """
    elements = len(steered)
    steered = steered * math.sqrt(elements) / np.linalg.norm(steered)
    signal, values = found.vectors[:, :sources], np.maximum(found.values[:sources], 1.001 * noise)
    along = signal.conj().T @ steered
    outside = steered - signal @ along
    variance = float(np.sum(np.abs(along) ** 2 * noise * values / (values - noise) ** 2)) / (
        2.0 * snapshots
    )
    if sources > 1:
        return ResponseMisfit(
            squared=float(np.sum(np.abs(outside) ** 2)),
            noise_rad2=variance,
            freedom=2 * (elements - sources) - 2,
        )
    phases = np.imag(outside * steered.conj() / np.abs(steered))
    return ResponseMisfit(
        squared=float(np.sum(phases**2)), noise_rad2=variance, freedom=elements - 3
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class ResponseWatch:
    """Weighted sums over the directions so far, one of each for every memory of the watch."""

    squared: Array = field(default_factory=lambda: np.zeros(1))
    noise: Array = field(default_factory=lambda: np.zeros(1))
    variance: Array = field(default_factory=lambda: np.zeros(1))
    freedom: Array = field(default_factory=lambda: np.zeros(1))

    def with_direction(self, params: WatchParams, misfit: ResponseMisfit) -> "ResponseWatch":
        """Return the sums with one direction more."""
        keep = 1.0 - 1.0 / np.array(params.directions)
        due = misfit.freedom * misfit.noise_rad2
        return ResponseWatch(
            squared=keep * self.squared + misfit.squared,
            noise=keep * self.noise + due,
            variance=keep**2 * self.variance + 2.0 * due * misfit.noise_rad2,
            freedom=keep * self.freedom + misfit.freedom,
        )

    def doubt(self, params: WatchParams, phase_sigma_rad: float, freedom: int) -> str:
        """Return how far the elements are from what is known of them, or "".

        `phase_sigma_rad` is what is known to be unknown of each phase, in `freedom` dimensions.
        """
        if np.max(self.freedom) < FEWEST * freedom:
            return ""
        degrees = 2.0 * self.noise**2 / self.variance
        limit = chi_square_limit(degrees, params.false_alarm) / degrees
        # Phases that do not change are one draw, however many blocks show them.
        known = (
            phase_sigma_rad**2
            * float(chi_square_limit(np.array(float(freedom)), params.false_alarm))
            / freedom
        )
        largest = limit * ((1.0 + MODEL_SHARE) * self.noise + known * self.freedom)
        worst = int(np.argmax(self.squared / largest))
        if self.squared[worst] <= largest[worst]:
            return ""
        excess = math.sqrt((self.squared[worst] - self.noise[worst]) / self.freedom[worst])
        return (
            f"the elements are at least {math.degrees(excess):.2g} deg off their known response, phase_sigma_rad="
            f"{phase_sigma_rad:.3g}: calibrate response.*, or leave an element out with excluded"
        )
