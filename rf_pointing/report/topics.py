"""What a report reads of each topic of an antenna: message type and columns.

A column is a name and the attribute of the message it comes from; everything else of a message is left alone.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from operator import attrgetter
from typing import Any

from rf_pointing.core import AXES

__all__ = ["TOPICS", "TopicLayout"]

Row = tuple[Any, ...]


@dataclass(frozen=True)
class TopicLayout:
    """Type of one topic and how a message becomes a row of `columns`.

    `period_s` is the interval at which the topic is published, 0 where it is not periodic.
    """

    type_name: str
    columns: tuple[str, ...]
    row: Callable[[Any], Any]
    period_s: float = 0.0


def _own(name: str, *columns: str, period_s: float = 0.1) -> TopicLayout:
    getter = attrgetter(*columns)

    def single_row(message: Any) -> Row:
        return (getter(message),)

    return TopicLayout(f"rf_pointing_msgs/msg/{name}", columns, single_row if len(columns) == 1 else getter, period_s)


def _joint_row(message: Any) -> Row:
    order = [message.name.index(axis) for axis in AXES]
    velocity = [message.velocity[i] for i in order] if len(message.velocity) else [math.nan, math.nan]
    return [message.position[i] for i in order], velocity


def _status_row(message: Any) -> Row:
    return (*_STATUS(message), message.los.sec * 10**9 + message.los.nanosec)


_TARGET_COLUMNS = (
    "target",
    "azimuth",
    "elevation",
    "azimuth_rate",
    "elevation_rate",
    "azimuth_acceleration",
    "elevation_acceleration",
    "range",
    "range_rate",
)
_STATUS_COLUMNS = (
    "mode",
    "target",
    "reason",
    "azimuth",
    "elevation",
    "cross_elevation_error",
    "elevation_error",
    "cross_elevation_offset",
    "elevation_offset",
    "carrier_to_noise",
    "beamwidth",
    "command_lead",
    "commands_sent",
)
_STATUS = attrgetter(*_STATUS_COLUMNS)
_ERROR = _own("PointingError", "sensor", "valid", "reason", "cross_elevation", "elevation", "carrier_to_noise")

TOPICS: dict[str, TopicLayout] = {
    "clock": TopicLayout("rosgraph_msgs/msg/Clock", (), lambda _: (), 0.02),
    "target": _own("Target", *_TARGET_COLUMNS),
    "passes": _own("PassList", "passes", period_s=0.0),
    "pointing_model": _own("PointingModel", "name", period_s=0.0),
    "joint_trajectory": TopicLayout("trajectory_msgs/msg/JointTrajectory", (), lambda _: (), 0.1),
    "tracking_status": TopicLayout(
        "rf_pointing_msgs/msg/TrackingStatus", (*_STATUS_COLUMNS, "los_ns"), _status_row, 0.1
    ),
    "joint_states": TopicLayout("sensor_msgs/msg/JointState", ("position", "velocity"), _joint_row, 0.02),
    "antenna_status": _own(
        "AntennaStatus",
        "mode",
        "fault",
        "rate_command",
        "rate_limit",
        "acceleration_limit",
        "at_limit",
        "command_lead",
        "tick_lateness",
        "commands_accepted",
        "commands_rejected",
        "last_rejection",
    ),
    "sim/boresight": _own("Boresight", "azimuth", "elevation", period_s=0.02),
    "sim/pointing_error": TopicLayout(_ERROR.type_name, _ERROR.columns, _ERROR.row, 0.02),
    "monopulse": _own("Monopulse", "carrier_to_noise"),
    "carrier_power": _own("CarrierPower", "power", "carrier_to_noise"),
    "pointing_error": _ERROR,
}
"""Layout by topic name relative to the antenna's namespace."""
