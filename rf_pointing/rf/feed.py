"""Monopulse feed: complex sum and difference voltages from four squinted beams.

The four beams look at (+-s, +-s); sum = all four, difference = right minus left and upper minus
lower, so a target to the right or above gives a positive real difference.  For Gaussian beams
difference/sum = tanh(k x / h).  The squint s and the width of the four beams follow from the two
numbers a user knows: the half-power beamwidth h of the sum and the slope k = h d(difference/sum)/dx
on the axis.
"""

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from rf_pointing.core import Array, ComplexArray, Pair, Params, bracketed_root, parameter
from rf_pointing.rf.beam import BeamParams, normalised_voltage

# Squint and width are in beamwidths, the same for every beam: one stands for all in the cache.
ANY_BEAMWIDTH_RAD = 1e-3
# Squint over the width of the four beams.  Beyond 0.6 the sum splits into four peaks; there the
# slope is above 3 for every pattern.
SQUINT_BETWEEN = 1e-6, 0.6
# Half of the sum's beamwidth over that of the four.
HALF_WIDTH_BETWEEN = 0.2, 1.6
# From the axis to where the slope there is taken.
STEP = 1e-5


class FeedVoltages(NamedTuple):
    """Complex voltages relative to the sum on the axis, all of the shape of the offsets."""

    sum: ComplexArray
    difference_cross_elevation: ComplexArray
    difference_elevation: ComplexArray


@dataclass(frozen=True, kw_only=True)
class MonopulseFeedParams(Params):
    """Gains and errors of the feed and its comparator; pairs are cross-elevation, elevation."""

    slope: float = parameter(
        1.57, "h d(difference/sum)/dx on the axis, per half-power beamwidth", 0.1, 2.5
    )
    difference_gain_db: Pair = parameter(
        (0.0, 0.0), "gain of each difference channel relative to the sum channel", -20.0, 20.0
    )
    difference_phase_rad: Pair = parameter(
        (0.0, 0.0), "phase of each difference channel relative to the sum channel", -math.pi,
        math.pi,
    )  # fmt: skip
    cross_talk: Pair = parameter(
        (0.0, 0.0), "voltage ratio of elevation in the cross-elevation channel and the reverse",
        0.0, 1.0,
    )  # fmt: skip
    cross_talk_phase_rad: Pair = parameter(
        (0.0, 0.0), "phase of each cross-talk", -math.pi, math.pi
    )
    sum_leakage: Pair = parameter(
        (0.0, 0.0), "voltage ratio of the sum in each difference: shifts the null", 0.0, 1.0
    )
    sum_leakage_phase_rad: Pair = parameter(
        (0.0, 0.0), "phase of each sum leakage", -math.pi, math.pi
    )


class MonopulseFeed:
    """Sum and differences of `params`, with the beam of `beam` as the sum beam."""

    def __init__(self, params: MonopulseFeedParams, beam: BeamParams) -> None:
        self.params = params
        self.beam = beam
        self._squint, self._width = _squint_and_width(
            beam.replace(half_power_beamwidth_rad=ANY_BEAMWIDTH_RAD), params.slope
        )
        self._mixing = _mixing_matrix(params)
        self._leakage = np.array(
            [_phasor(params.sum_leakage[i], params.sum_leakage_phase_rad[i]) for i in (0, 1)]
        )

    def voltages(self, cross_elevation_rad: ArrayLike, elevation_rad: ArrayLike) -> FeedVoltages:
        """Return the three channels for a target at this offset (target minus beam)."""
        beamwidth = self.beam.half_power_beamwidth_rad
        x, y = np.broadcast_arrays(
            np.asarray(cross_elevation_rad, dtype=np.float64) / beamwidth,
            np.asarray(elevation_rad, dtype=np.float64) / beamwidth,
        )
        total, right, up = _comparator(self.beam, self._squint, self._width, x, y)
        gain = self._mixing
        return FeedVoltages(
            total.astype(np.complex128),
            gain[0, 0] * right + gain[0, 1] * up + self._leakage[0] * total,
            gain[1, 0] * right + gain[1, 1] * up + self._leakage[1] * total,
        )

    def power_gain(self, cross_elevation_rad: ArrayLike, elevation_rad: ArrayLike) -> Array:
        """Return the power of the sum channel relative to the target on the axis."""
        return np.abs(self.voltages(cross_elevation_rad, elevation_rad).sum) ** 2


def _phasor(amplitude: float, phase_rad: float) -> complex:
    return complex(amplitude * math.cos(phase_rad), amplitude * math.sin(phase_rad))


def _mixing_matrix(params: MonopulseFeedParams) -> ComplexArray:
    talk = [_phasor(params.cross_talk[i], params.cross_talk_phase_rad[i]) for i in (0, 1)]
    gain = [
        _phasor(10.0 ** (params.difference_gain_db[i] / 20.0), params.difference_phase_rad[i])
        for i in (0, 1)
    ]
    return np.array([[gain[0], gain[0] * talk[0]], [gain[1] * talk[1], gain[1]]])


def _comparator(
    beam: BeamParams, squint: float, width: float, x: Array, y: Array
) -> tuple[Array, Array, Array]:
    """Return sum, right minus left, upper minus lower of four beams at +-squint, over the sum."""

    def beam_at(sign_x: float, sign_y: float) -> Array:
        angle = np.hypot(x - sign_x * squint, y - sign_y * squint) / width
        return normalised_voltage(beam, angle)

    upper_right, upper_left, lower_right, lower_left = (
        beam_at(1, 1), beam_at(-1, 1), beam_at(1, -1), beam_at(-1, -1),
    )  # fmt: skip
    # Relative to the sum on the axis, so that the C/N0 is that of a beam on the target.
    on_axis = 4.0 * float(normalised_voltage(beam, np.asarray(math.sqrt(2.0) * squint / width)))
    right, left = upper_right + lower_right, upper_left + lower_left
    up, down = upper_right + upper_left, lower_right + lower_left
    return (right + left) / on_axis, (right - left) / on_axis, (up - down) / on_axis


@lru_cache(maxsize=64)
def _squint_and_width(beam: BeamParams, slope: float) -> Pair:
    """Return squint and beamwidth of the four beams, both in half-power beamwidths of the sum."""
    ratio = bracketed_root(
        lambda ratio: _sum_beamwidth(beam, ratio) * _slope_per_width(beam, ratio) - slope,
        *SQUINT_BETWEEN,
    )
    width = 1.0 / _sum_beamwidth(beam, ratio)
    return ratio * width, width


def _slope_per_width(beam: BeamParams, ratio: float) -> float:
    # On the axis, where the sum is 1 and the difference 0.
    _, right, _ = _comparator(beam, ratio, 1.0, np.asarray(STEP), np.asarray(0.0))
    return float(right) / STEP


def _sum_beamwidth(beam: BeamParams, ratio: float) -> float:
    """Half-power beamwidth of the sum of four beams of width 1 squinted by `ratio`."""
    half = bracketed_root(
        lambda half: (
            float(_comparator(beam, ratio, 1.0, np.asarray(half), np.asarray(0.0))[0]) ** 2 - 0.5
        ),
        *HALF_WIDTH_BETWEEN,
    )
    return 2.0 * half
