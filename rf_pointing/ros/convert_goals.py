"""Goals of a pass and of a scan from messages, like `convert.py`."""

from rf_pointing_msgs.action import Scan, TrackPass

from rf_pointing.ros.convert import pair
from rf_pointing.ros.convert_planning import pass_from_message
from rf_pointing.ros.stamps import seconds_from_stamp
from rf_pointing.station.clients.goals import PassGoal
from rf_pointing.tracking.scan_program import ScanProgramParams

_, _goal_from_message = pair(PassGoal, TrackPass.Goal, window=None, scan=None)
scan_to_message, _scan_from_message = pair(ScanProgramParams, Scan.Goal, baseline_s="baseline_time")


def goal_of_scan(message: Scan.Goal) -> PassGoal:
    if not message.satellite:
        raise ValueError("satellite='' must name what is scanned")
    return PassGoal(
        satellite=message.satellite, near_t_s=seconds_from_stamp(message.near),
        minimum_peak_elevation_rad=message.minimum_peak_elevation, scan=_scan_from_message(message),
    )  # fmt: skip


def goal_from_message(message: TrackPass.Goal) -> PassGoal:
    if message.satellite and message.target_pass.target:
        raise ValueError(
            f"satellite={message.satellite!r} and a target_pass of {message.target_pass.target!r}: give one of them"
        )
    return _goal_from_message(message, window=None if message.satellite else pass_from_message(message.target_pass))
