"""Messages of the identification action from and to the core's values, as pairs (see `convert`)."""

from rf_pointing_msgs import msg as ours
from rf_pointing_msgs.action import Identify

from rf_pointing.core import Array, as_finite_array
from rf_pointing.identification import ExcitationParams
from rf_pointing.ros.convert import pair
from rf_pointing.ros.stamps import seconds_from_stamp, stamp_from_seconds


def manual_rate_to_message(
    t_s: float, axis: str, sample: int, rate_rad_s: Array, position_rad: Array, age_s: float
) -> ours.ManualRate:
    message = ours.ManualRate(axis=axis, sample=sample, position_age=age_s)
    message.rate, message.position = rate_rad_s, position_rad
    message.header.stamp = stamp_from_seconds(t_s)
    return message


def manual_rate_from_message(message: ours.ManualRate) -> tuple[float, str, int, Array, Array, float]:
    """Return time, axis, number of the sample, rate command and angles (2,), their age."""
    rate = as_finite_array("rate", message.rate, (2,))
    t_s = seconds_from_stamp(message.header.stamp)
    position = as_finite_array("position", message.position, (2,))
    return t_s, message.axis, int(message.sample), rate, position, message.position_age


# The control period is the antenna's own, not the client's to choose.
_goal_of, _excitation_of = pair(
    ExcitationParams, Identify.Goal, idle_rate_rad_s="idle", sample_s=None, low_hz=None, high_hz=None
)


def excitation_to_goal(axis: str, sequences: int, seed: int, params: ExcitationParams) -> Identify.Goal:
    return _goal_of(params, axis=axis, sequences=sequences, seed=seed)


def excitation_from_goal(goal: Identify.Goal, sample_s: float) -> ExcitationParams:
    """Return the excitation of a goal, sampled with the control period."""
    return _excitation_of(goal, sample_s=sample_s, high_hz=min(ExcitationParams().high_hz, 0.5 / sample_s))
