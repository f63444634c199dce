"""Goals of a pass from messages, like `convert.py`."""

from rf_pointing_msgs.action import TrackPass

from rf_pointing.ros.convert import pair
from rf_pointing.ros.convert_planning import pass_from_message
from rf_pointing.station.clients.goals import PassGoal

_, _goal_from_message = pair(PassGoal, TrackPass.Goal, window=None)


def goal_from_message(message: TrackPass.Goal) -> PassGoal:
    if message.satellite and message.target_pass.target:
        raise ValueError(
            f"satellite={message.satellite!r} and a target_pass of {message.target_pass.target!r}: give one of them"
        )
    return _goal_from_message(message, window=None if message.satellite else pass_from_message(message.target_pass))
