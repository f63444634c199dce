"""The graphs of the array sensors: nodes, and type and quality of service of each topic.

Recorders read these lists.
"""

from dataclasses import dataclass

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import (
    PoseWithCovarianceStamped,
    QuaternionStamped,
    TwistWithCovarianceStamped,
    Vector3Stamped,
)
from rf_pointing_msgs import msg as ours
from rosgraph_msgs.msg import Clock

from rf_pointing.nodes.qos import STREAM
from rf_pointing.nodes.topics import Topic

__all__ = ["ARRAY_SYSTEMS", "CLOCK", "ArraySystem"]

CLOCK = "simulation_clock"
"""Gives the time of a simulated graph where nothing else does."""

_PERIOD = "once a period"
_COMMON = (
    Topic("clock", Clock, STREAM, "every tick", "simulation_clock"),
    Topic("/diagnostics", DiagnosticArray, STREAM, "1 Hz", "every node"),
)


@dataclass(frozen=True)
class ArraySystem:
    """One graph: its name is its usual namespace and that of its parameter file.

    a node of a station is `station/node`.  Simulation time waits for the stream `paced`, whose
    newest stamp may lag it by `lag_s`: two of its periods.
    """

    name: str
    nodes: tuple[str, ...]
    topics: tuple[Topic, ...]
    paced: str
    lag_s: float


def _tripulse(*stations: str) -> ArraySystem:
    receivers = [f"{station}/tripulse_receiver" for station in stations]
    frames = [
        Topic(f"{station}/tripulse_frame", ours.TripulseFrame, STREAM, _PERIOD, "tripulse_source")
        for station in stations
    ]
    lines = [
        Topic(f"{station}/tripulse_measurement", ours.TripulseMeasurement, STREAM, _PERIOD, receiver)
        for station, receiver in zip(stations, receivers, strict=True)
    ]
    attitude = Topic("attitude", ours.Attitude, STREAM, _PERIOD, "tripulse_attitude")
    truth = Topic("sim/attitude", QuaternionStamped, STREAM, _PERIOD, "tripulse_source")
    return ArraySystem(
        name="tripulse",
        nodes=("tripulse_source", *receivers, "tripulse_attitude"),
        topics=(*frames, *lines, attitude, truth, *_COMMON),
        paced="attitude",
        lag_s=2.5,
    )


_DOA = ArraySystem(
    name="doa",
    nodes=("doa_source", "doa_attitude"),
    topics=(
        Topic("array_snapshots", ours.ArraySnapshots, STREAM, "once a period while a station is heard", "doa_source"),
        Topic("known_torque", ours.KnownTorque, STREAM, _PERIOD, "doa_source"),
        Topic("attitude", ours.Attitude, STREAM, "once a block", "doa_attitude"),
        Topic("attitude_rate", TwistWithCovarianceStamped, STREAM, "once a valid attitude", "doa_attitude"),
        Topic("sim/attitude", QuaternionStamped, STREAM, _PERIOD, "doa_source"),
        Topic("sim/attitude_rate", Vector3Stamped, STREAM, _PERIOD, "doa_source"),
        *_COMMON,
    ),
    paced="attitude",
    lag_s=1.5,
)

_INTERFEROMETER = ArraySystem(
    name="interferometer",
    nodes=("interferometer_source", "interferometer_tracker"),
    topics=(
        Topic("interferometer_measurement", ours.InterferometerMeasurement, STREAM, _PERIOD, "interferometer_source"),
        Topic("relative_pose", PoseWithCovarianceStamped, STREAM, "while there is a pose", "interferometer_tracker"),
        Topic("relative_twist", TwistWithCovarianceStamped, STREAM, "while there is a pose", "interferometer_tracker"),
        Topic("relative_pose_status", ours.RelativePoseStatus, STREAM, _PERIOD, "interferometer_tracker"),
        Topic("sim/relative_pose", PoseWithCovarianceStamped, STREAM, _PERIOD, "interferometer_source"),
        Topic("sim/relative_twist", TwistWithCovarianceStamped, STREAM, _PERIOD, "interferometer_source"),
        *_COMMON,
    ),
    paced="relative_pose_status",
    lag_s=4.5,
)

ARRAY_SYSTEMS = {system.name: system for system in (_tripulse("usingen", "hartebeesthoek"), _DOA, _INTERFEROMETER)}
"""The graphs that config/, launch/ and the example know, by name."""
