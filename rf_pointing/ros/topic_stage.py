"""A second stage behind topics, for the driver of a steering mirror, subreflector or hexapod.

Publishes second_stage/command (50 Hz) and takes second_stage/state, both
geometry_msgs/Vector3Stamped: deflection of the beam on the sky in rad, x to the right
(cross-elevation), y up.
"""

import numpy as np
from geometry_msgs.msg import Vector3Stamped

from rf_pointing.core.second_stage import SecondStageParams
from rf_pointing.core.signals import BEAM
from rf_pointing.core.types import Array
from rf_pointing.ros.qos import INSTRUMENT, SET_POINT
from rf_pointing.ros.stamps import seconds_from_stamp, stamp_from_seconds
from rf_pointing.ros.station_node import StationNode
from rf_pointing.ros.streams import frame_in
from rf_pointing.station.antenna.control_unit import ControlUnit
from rf_pointing.station.antenna.second_stage import StageLoop
from rf_pointing.station.antenna.simulated_antenna import AntennaParams

COMMAND, STATE = "second_stage/command", "second_stage/state"
BEYOND = 1.5
"""States so many times beyond the travel are refused: their unit, or the description, is wrong."""


class TopicStage:
    """The topics of one antenna's second stage."""

    def __init__(self, node: StationNode, params: SecondStageParams) -> None:
        self._node, self._params = node, params
        self._deflection, self._t_s = np.zeros(2), -np.inf
        self._commands = node.publisher(Vector3Stamped, COMMAND, SET_POINT)
        node.listen(Vector3Stamped, STATE, self._take, INSTRUMENT)

    @property
    def deflection_rad(self) -> Array:
        """Newest deflection (2,) that was reported."""
        return self._deflection.copy()

    @property
    def problem(self) -> str:
        """Why the stage cannot be relied on, "" if it can."""
        age_s = self._node.now_s() - self._t_s
        if age_s <= self._params.lost_s:
            return ""
        if not np.isfinite(age_s):
            return f"no message on {STATE} yet"
        return f"no message on {STATE} for {age_s:.1f} s, at most {self._params.lost_s:g} s"

    def command(self, deflection_rad: Array) -> None:
        """Send a deflection (2,)."""
        message = Vector3Stamped()
        message.header.stamp = stamp_from_seconds(self._node.now_s())
        message.header.frame_id = frame_in(self._node.get_namespace(), BEAM)
        message.vector.x, message.vector.y = deflection_rad.tolist()
        self._commands.publish(message)

    def _take(self, message: Vector3Stamped) -> None:
        t_s = seconds_from_stamp(message.header.stamp)
        deflection = np.array([message.vector.x, message.vector.y])
        largest, bound = float(np.max(np.abs(deflection))), BEYOND * self._params.travel_rad
        if largest > bound:
            wanted = f"must be <= {bound:.4g} rad, {BEYOND:g} times the travel"
            raise ValueError(f"deflection={largest:.4g} rad {wanted}")
        if (ahead_s := t_s - self._node.now_s()) > self._params.lost_s:
            raise ValueError(f"its stamp is {ahead_s:.1f} s ahead of this computer's clock")
        self._deflection, self._t_s = deflection, t_s


def join_stage(node: StationNode, antenna: ControlUnit, params: AntennaParams) -> None:
    """Put the second stage that a station has before an antenna on a real drive."""
    if params.second_stage.present:
        design = params.stage_design()
        antenna.stage = StageLoop(TopicStage(node, params.second_stage), design)
