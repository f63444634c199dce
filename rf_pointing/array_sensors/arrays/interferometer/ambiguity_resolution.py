"""Two-way ranges from wrapped carrier phases, cycle by cycle.

The phase difference of carriers 2 and 1 is unambiguous over c/f0; each next difference is nu times finer and its lane
is the whole number nearest to (coarse range - fine range)/lane length (PI83 eqs. 7-14 to 7-25, listings ERD, AMBRES).
How far the unrounded lane was from a whole number is kept: near 0.5 the decision was a toss.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rf_pointing.array_sensors.arrays.interferometer.carriers import CarrierPlan
from rf_pointing.array_sensors.arrays.interferometer.variant import CORRECTED, is_published
from rf_pointing.core import wrap_rad

__all__ = ["ResolvedRanges", "carrier_range", "resolve_ranges", "sharpened_ranges"]

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class ResolvedRanges:
    """Two-way ranges (..., n, n), lane numbers and distances to them in lanes, both (..., K - 2, n, n)."""

    ranges_m: Array
    lanes: Array
    lane_residuals: Array

    @property
    def worst_lane_residual(self) -> Array:
        """Largest |unrounded lane - lane| of all steps and paths (...), at most 0.5."""
        return np.asarray(np.max(np.abs(self.lane_residuals), axis=(-3, -2, -1)))


def resolve_ranges(phases_rad: ArrayLike, plan: CarrierPlan, variant: str = CORRECTED) -> ResolvedRanges:
    """Return the ranges of difference-frequency tracking from carrier phases (..., K, n, n), wrapped or not.

    "published": the coarsest phase is taken in [0, 2 pi) and lanes below zero are refused as in the listing, so that
    noise at zero range wraps to c/f0; "corrected": in [-pi/nu, 2 pi - pi/nu), which f0 < f_min leaves free.
    """
    phases = np.asarray(phases_rad, dtype=np.float64)
    published = is_published(variant)
    differences = np.mod(phases[..., 1:, :, :] - phases[..., :1, :, :], 2.0 * np.pi)
    fine = differences * plan.ambiguities_m[:, None, None] / (2.0 * np.pi)
    window = 0.0 if published else plan.ambiguities_m[0] / (2.0 * plan.ratio)
    ranges = np.mod(fine[..., 0, :, :] + window, plan.ambiguities_m[0]) - window
    lanes, residuals = [], []
    for step in range(1, plan.count - 1):
        unrounded = (ranges - fine[..., step, :, :]) / plan.ambiguities_m[step]
        lane = np.maximum(np.rint(unrounded), 0.0) if published else np.rint(unrounded)
        ranges = fine[..., step, :, :] + lane * plan.ambiguities_m[step]
        lanes.append(lane)
        residuals.append(unrounded - lane)
    return ResolvedRanges(ranges_m=ranges, lanes=np.stack(lanes, axis=-3), lane_residuals=np.stack(residuals, axis=-3))


def carrier_range(phases_rad: ArrayLike, ranges_m: ArrayLike, plan: CarrierPlan) -> tuple[Array, Array]:
    """Return two-way ranges (..., n, n) from carrier 1 itself, and the residuals in lanes of the step to it.

    Carrier-frequency tracking, PI83 eqs. (7-8) to (7-13).  Exact only if out and back are equally long: the bias is
    (fF - fR)/(fF + fR) (rho_00 - rho_ij), up to a fifth of the radius at 3 and 2 GHz.
    """
    wavelength = 2.0 * plan.speed_of_light_m_s / (plan.forward_hz + plan.return_hz)
    phase = np.mod(np.asarray(phases_rad, dtype=np.float64)[..., 0, :, :], 2.0 * np.pi)
    fine = phase * wavelength / (2.0 * np.pi)
    unrounded = (np.asarray(ranges_m) - fine) / wavelength
    return fine + np.rint(unrounded) * wavelength, unrounded - np.rint(unrounded)


def sharpened_ranges(phases_rad: ArrayLike, ranges_m: ArrayLike, plan: CarrierPlan) -> tuple[Array, Array]:
    """Return the ranges (..., n, n) with their mutual differences taken from the return carriers, and residuals.

    Between paths of one carrier the way out is common, so phase differences are exactly (2 pi fR/c)(rho_ij - mean):
    the range-difference direction finding that the report recommends as further work.  The mean over the paths stays
    that of `ranges_m`; the residuals (..., K, n, n) are in lanes of the return carrier.
    """
    ranges = np.asarray(ranges_m, dtype=np.float64)
    phases = np.asarray(phases_rad, dtype=np.float64)
    reference = ranges[..., None, :1, :1]
    wave = plan.return_wave_rad_m[:, None, None]
    expected = wave * (ranges[..., None, :, :] - reference)
    off = wrap_rad(phases - phases[..., :1, :1] - expected)
    correction = np.mean(off / wave, axis=-3)
    spread = (off - wave * correction[..., None, :, :]) / (2.0 * np.pi)
    return ranges + correction - np.mean(correction, axis=(-2, -1), keepdims=True), spread
