"""Messages of the identification action from and to the core's values, as pairs (see `convert`)."""

import numpy as np
from numpy.typing import NDArray
from rf_pointing_msgs import msg as ours
from rf_pointing_msgs.action import Identify

from rf_pointing.core import as_finite_array
from rf_pointing.identification import ExcitationParams
from rf_pointing.nodes.stamps import stamp_from_seconds

Array = NDArray[np.float64]


def manual_rate_to_message(
    t_s: float, axis: str, sample: int, rate_rad_s: Array, position_rad: Array
) -> ours.ManualRate:
    message = ours.ManualRate(axis=axis, sample=sample)
    message.rate, message.position = rate_rad_s, position_rad
    message.header.stamp = stamp_from_seconds(t_s)
    return message


def manual_rate_from_message(message: ours.ManualRate) -> tuple[str, int, Array, Array]:
    """Return axis, number of the sample, rate command (2,) and encoder angles (2,)."""
    rate = as_finite_array("rate", message.rate, (2,))
    return message.axis, int(message.sample), rate, as_finite_array("position", message.position, (2,))


def excitation_to_goal(axis: str, sequences: int, seed: int, params: ExcitationParams) -> Identify.Goal:
    return Identify.Goal(
        axis=axis,
        kind=params.kind,
        sequences=sequences,
        samples=params.samples,
        mean=params.mean_rad_s,
        rms=params.rms_rad_s,
        peak=params.peak_rad_s,
        idle=params.idle_rate_rad_s,
        seed=seed,
    )


def excitation_from_goal(goal: Identify.Goal, sample_s: float) -> ExcitationParams:
    """Return the excitation of a goal, sampled with the control period."""
    return ExcitationParams(
        kind=goal.kind,
        samples=goal.samples,
        sample_s=sample_s,
        mean_rad_s=goal.mean,
        rms_rad_s=goal.rms,
        peak_rad_s=goal.peak,
        idle_rate_rad_s=goal.idle,
        high_hz=min(ExcitationParams().high_hz, 0.5 / sample_s),
    )
