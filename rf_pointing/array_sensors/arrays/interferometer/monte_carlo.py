"""Monte-Carlo trials of the whole sensor at one relative pose: root-mean-square errors and wrong lanes.

Errors of PI83 section 8.3 (program FHR-321C): distance, chords |xi - xi_true| and |eta - eta_true|, roll.  A trial
with a two-way range off by more than half the fine lane is tallied and discarded (the listing's 0.72 m lets pass a
wrong lane of 0.736 m with 16 mm of noise the other way).  All trials run as one stack.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rf_pointing.array_sensors.arrays.interferometer.ambiguity_resolution import resolve_ranges, sharpened_ranges
from rf_pointing.array_sensors.arrays.interferometer.array_geometry import ArrayParams, two_way_ranges
from rf_pointing.array_sensors.arrays.interferometer.carriers import CarrierPlan
from rf_pointing.array_sensors.arrays.interferometer.coupling import coupling_amplitudes
from rf_pointing.array_sensors.arrays.interferometer.initializer import geometry_from_pose
from rf_pointing.array_sensors.arrays.interferometer.link import LinkParams
from rf_pointing.array_sensors.arrays.interferometer.relative_pose import RelativePose
from rf_pointing.array_sensors.arrays.interferometer.rf_simulation import (
    RadioParams,
    amplitude_sigma,
    simulate_amplitudes,
    simulate_phases,
)
from rf_pointing.array_sensors.arrays.interferometer.tracking_filter import SequenceParams, track
from rf_pointing.array_sensors.arrays.interferometer.variant import CORRECTED, PUBLISHED
from rf_pointing.core import require_between, wrap_rad

__all__ = ["LISTING", "TrialErrors", "run_trials"]

Array = NDArray[np.float64]
_WRONG_LANE_FRACTION = 0.5
LISTING = SequenceParams(range_estimator=PUBLISHED, reverse_attitude=PUBLISHED)
"""The estimator as the report's simulation runs it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TrialErrors:
    """Errors of each good trial (n,), and how many trials had a wrong lane."""

    range_m: Array
    forward_rad: Array
    reverse_rad: Array
    roll_rad: Array
    wrong_lanes: int

    def rms(self) -> tuple[float, float, float, float]:
        """Return root-mean-square errors of range, forward chord, reverse chord and roll."""
        errors = (self.range_m, self.forward_rad, self.reverse_rad, self.roll_rad)
        return tuple(float(np.sqrt(np.mean(error**2))) for error in errors)  # type: ignore[return-value]


def run_trials(
    pose: RelativePose,
    trials: int,
    rng: np.random.Generator,
    arrays: ArrayParams,
    radio: RadioParams,
    plan: CarrierPlan,
    link: LinkParams,
    sequence: SequenceParams,
    amplitude_noise: str = CORRECTED,
    sharpen: bool = False,
) -> TrialErrors:
    """Return the errors of `trials` independent measurements of `pose`, the estimator starting at the truth.

    `sharpen` takes the differences between paths from the return carriers, the report's further work.  Raises
    ValueError if every trial has a wrong lane.
    """
    require_between("trials", trials, 1, None)
    phases = simulate_phases(pose.position_m, pose.attitude, arrays, radio, plan, link, rng, trials)
    sigma = amplitude_sigma(pose.range_m, radio, plan, link, amplitude_noise)
    amplitudes = simulate_amplitudes(coupling_amplitudes(pose.direction, pose.attitude), float(sigma), rng, trials)
    ranges = resolve_ranges(phases, plan).ranges_m
    ranges = sharpened_ranges(phases, ranges, plan)[0] if sharpen else ranges
    off = np.abs(ranges - two_way_ranges(pose.position_m, pose.attitude, arrays))
    good = np.all(off <= _WRONG_LANE_FRACTION * plan.ambiguities_m[-1], axis=(-2, -1))
    if not np.any(good):
        raise ValueError(f"all {trials} trials resolved a wrong lane, must be fewer")
    truth = geometry_from_pose(*(np.array([value] * int(np.sum(good))) for value in (pose.position_m, pose.attitude)))
    found = track(truth, ranges[good], amplitudes[good], arrays, sequence).geometry
    return TrialErrors(
        range_m=found.range_m - truth.range_m,
        forward_rad=np.linalg.norm(found.forward - truth.forward, axis=-1),
        reverse_rad=np.linalg.norm(found.reverse - truth.reverse, axis=-1),
        roll_rad=wrap_rad(found.roll_rad - truth.roll_rad),
        wrong_lanes=trials - int(np.sum(good)),
    )
