"""The graph of one antenna: its nodes, their topics, and the topics that time waits for.

`GRAPH` is the one table of nodes and topics.  The launch files, the recorder, the simulation clock,
the picture of the graph and the table of topics in the documentation are made from it.
"""

from collections.abc import Collection
from dataclasses import dataclass, replace
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.qos import QoSProfile
from rf_pointing_msgs import msg as ours
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState, NavSatFix
from std_msgs.msg import String
from trajectory_msgs.msg import JointTrajectory
from visualization_msgs.msg import MarkerArray

from rf_pointing.core import BASE, BEAM, Sensor
from rf_pointing.ros.qos import COMMAND, EXPERIMENT, IN_USE, LATCHED, SAMPLES, STATUS, STREAM
from rf_pointing.tracking.sensors import SENSORS


@dataclass(frozen=True)
class Topic:
    """One topic, relative to the antenna's namespace unless it begins with a slash.

    Simulation time waits for a topic with an `allowed_lag_s`: the newest stamp may lag the next
    tick by so much, a negative one must be ahead of it.
    """

    name: str
    message_type: Any
    qos: QoSProfile
    rate: str
    publisher: str = ""
    meaning: str = ""
    allowed_lag_s: float | None = None
    frame: str = BASE
    """Frame of the header, below the antenna's namespace; "" for a header without one of ours."""

    @property
    def type_name(self) -> str:
        """Package and type, as in `sensor_msgs/JointState`."""
        return f"{self.message_type.__module__.partition('.')[0]}/{self.message_type.__name__}"


@dataclass(frozen=True)
class GraphNode:
    """One executable and its topics; a station replaces the `simulated` ones by its own drivers."""

    name: str
    topics: tuple[Topic, ...]
    simulated: bool = False


# A lag of one period (0.1 s) less a tick lets time reach the next instant of work only when the
# previous instant's work has arrived, so a run gives the same result at any speed.
_ONE_PERIOD_S = 0.19
# The error of monopulse is stamped in the middle of its cluster, 0.04 s before the cluster's end.
_ONE_CLUSTER_S = _ONE_PERIOD_S + 0.04
# The target is published 2 s ahead; one second of that may be used up while time waits.
_AHEAD_S = -1.0

ESSENTIAL = "antenna_status"
"""While this topic is silent, time runs no faster than the wall clock."""

EXECUTIVE = "station_executive"
"""The node of a night without an operator; a station without it is whole."""
ROTCTLD = "rotctld_server"
"""The node through which rotctld's clients steer; a station without it is whole, too."""
ALARMS = "station_alarms"
"""The node that tells of what goes wrong where no executive does."""
DESCRIPTION = "station_description"
"""The node that shows a station to viewers; a station without it is whole."""
OPERATOR_PAGE = "operator_page"
"""The node of the page in a browser; it moves nothing by itself."""
STATION_IN_USE, BAND_IN_USE = "station_in_use", "band_in_use"
COMMANDS, SIGNATURES = "joint_trajectory", "command_signature"
SCHEDULE = "schedule"
EXECUTIVE_STATUS = "executive_status"
ALARM_TOPIC = "alarms"
SATELLITE_ATTITUDE = "satellite_attitude"
WIND, TEMPERATURE, PRESSURE, HUMIDITY = (f"weather/{name}" for name in ("wind", "temperature", "pressure", "humidity"))
"""Topics of a station's own instruments."""
BASE_IMU, BASE_ODOMETRY, BASE_FIX = "base/imu", "base/odometry", "base/fix"
"""Topics of a base that moves: its attitude by either instrument, and its place."""
ERRORS = "pointing_error"
_POINTING_ERROR = Topic(
    ERRORS, ours.PointingError, STREAM, "10 Hz, of a scan once a round", allowed_lag_s=_ONE_CLUSTER_S, frame=BEAM
)
# An array on the dish has nodes of its own.
TRACKERS = dict.fromkeys(traits.node for traits in SENSORS.values() if not traits.own_level)
_RECEIVED = (
    Topic("monopulse", ours.Monopulse, STREAM, "10 Hz, 5 samples each", frame=BEAM),
    Topic("carrier_power", ours.CarrierPower, STREAM, "10 Hz", frame=BEAM),
)
_TRUTH = Topic("sim/pointing_error", ours.PointingError, STREAM, "10 Hz", meaning="truth of the simulation",
               allowed_lag_s=_ONE_PERIOD_S, frame=BEAM)  # fmt: skip
_TARGET_MEANING = "direction, rates, range, Doppler, light time, refraction, covariance"

# The clock waits for the topic that each node publishes last in a period.  What the
# node published before (the command, the samples) has then reached its receivers, and the tick
# cannot overtake it: with a topic published earlier it did, once in some minutes on a busy machine.
_TARGET = (
    Topic("target", ours.Target, STREAM, "10 Hz, 2 s ahead", meaning=_TARGET_MEANING, allowed_lag_s=_AHEAD_S),
    Topic("passes", ours.PassList, LATCHED, "latched"),
    Topic("pass_profiles", ours.PassProfileList, LATCHED, "latched"),
)

GRAPH = (
    GraphNode("simulation_clock", (Topic("clock", Clock, STREAM, "50 Hz (10 Hz above 3×)", frame=""),), simulated=True),
    GraphNode(
        "antenna_servo",
        (
            Topic("joint_states", JointState, STREAM, "50 Hz"),
            Topic("sim/boresight", ours.Boresight, SAMPLES, "50 Hz", meaning="truth of the simulation"),
            Topic("manual_rate", ours.ManualRate, EXPERIMENT, "50 Hz while identifying"),
            Topic(ESSENTIAL, ours.AntennaStatus, STATUS, "10 Hz", allowed_lag_s=_ONE_PERIOD_S),
        ),
        simulated=True,
    ),
    GraphNode("rf_receiver", (*_RECEIVED, _TRUTH), simulated=True),
    *(GraphNode(name, (_POINTING_ERROR,)) for name in TRACKERS),
    GraphNode("bias_calibrator", (Topic("pointing_model", ours.PointingModel, LATCHED, "latched"),)),
    GraphNode("ephemeris_publisher", _TARGET),
    GraphNode(
        "pointing_controller",
        (
            Topic(BAND_IN_USE, ours.StationInUse, LATCHED, "latched", meaning="band of every node"),
            Topic("pass_certificate", ours.PassCertificate, LATCHED, "latched"),
            Topic(SIGNATURES, ours.CommandSignature, STREAM, "10 Hz", meaning="who sends each command, signed"),
            Topic(COMMANDS, JointTrajectory, COMMAND, "10 Hz, 0.1 to 1 s ahead"),
            Topic("tracking_status", ours.TrackingStatus, STREAM, "10 Hz", allowed_lag_s=_ONE_PERIOD_S),
        ),
    ),
)
"""The nodes in the order of their start."""
# The clock first: its held time reaches each of the others while they start.


ARRAY_GRAPH = (GraphNode("array_receiver", (), simulated=True), GraphNode("array_tracker", (_POINTING_ERROR,)))
"""Further nodes of a station with an array on its dish; `array_snapshots` connects them."""
# Not recorded: 60 kB/s, and nothing of the report reads them.


RECEIVER_GRAPH = (GraphNode("signal_source", (_TRUTH,), simulated=True), GraphNode("signal_receiver", _RECEIVED))
"""Nodes in place of rf_receiver where the receiver of a station is not simulated."""
DESIGNATE_GRAPH = (GraphNode("target_designate", _TARGET),)
"""Node of a station that is led by reports of a target, with the ephemeris or in place of it."""
SERVED = ("rtl_tcp", "vita49", "zmq", "sigmf")
"""Receivers whose samples signal_source can make for a simulated antenna."""


def _topics() -> tuple[Topic, ...]:
    """Return each topic of the graph once, with the names of all nodes that publish it."""
    found: dict[str, Topic] = {}
    for node in (*GRAPH, *ARRAY_GRAPH, *RECEIVER_GRAPH, *DESIGNATE_GRAPH):
        for topic in node.topics:
            others = f"{found[topic.name].publisher}, " if topic.name in found else ""
            found[topic.name] = replace(topic, publisher=others + node.name)
    every = "every node"
    executive = (
        Topic(SCHEDULE, ours.Schedule, LATCHED, "latched", EXECUTIVE, "passes of the antenna and what becomes of them"),
        Topic(EXECUTIVE_STATUS, ours.ExecutiveStatus, STATUS, "1 to 2.5 Hz", EXECUTIVE, "what it does, and the alarms"),
        # Without an executive, of station_alarms.
        Topic(
            ALARM_TOPIC, DiagnosticArray, STATUS, "as they come", EXECUTIVE, "messages of alarms, what to do", frame=""
        ),
    )
    in_use = Topic(STATION_IN_USE, ours.StationInUse, IN_USE, "latched", every, "station description and band")
    health = Topic("/diagnostics", DiagnosticArray, STREAM, "1 Hz", every, frame="")
    return (*found.values(), *executive, in_use, health)


def topics_of(names: Collection[str]) -> tuple[Topic, ...]:
    """Return what is recorded of a graph of these nodes: without the truth of a simulation.

    The topics of a receiver that is not among them name no publisher.
    """
    ours_too = (topic for topic in TOPICS if not topic.name.startswith("sim/") and topic.name != "clock")
    return tuple(
        topic if {"every node", *names} & set(topic.publisher.split(", ")) else replace(topic, publisher="")
        for topic in ours_too
    )


TOPICS = _topics()
FOREIGN = (
    WIND, TEMPERATURE, PRESSURE, HUMIDITY, BASE_IMU, BASE_ODOMETRY, BASE_FIX, SATELLITE_ATTITUDE,
    "carrier_power", Sensor.MONOPULSE, "array_snapshots", "tripulse_frame",
    "interferometer_measurement",
)  # fmt: skip
"""Topics that devices of the station may publish, subscribed as `INSTRUMENT`."""
SOURCES = {topic.name: topic.publisher for topic in TOPICS} | dict.fromkeys(
    ("carrier_power", Sensor.MONOPULSE), "rf_receiver, or a receiver of your own"
)
"""Who sends a topic, for a node that waits for it."""
PAUSES = ("target", "array_snapshots")
"""Topics that are silent while the target, or the transmitter, is down."""
STEADY = ("joint_states", ESSENTIAL)
"""Topics that are sent all the time while their publisher is active."""
VIEWS = (
    Topic("robot_description", String, LATCHED, "latched", DESCRIPTION, "the URDF", frame=""),
    # Each marker has a frame of its own.
    Topic("beam_markers", MarkerArray, STREAM, "5 Hz", DESCRIPTION, "beam, target and Sun", frame=""),
    Topic("sky_markers", MarkerArray, LATCHED, "latched", DESCRIPTION, "horizon mask and pass", frame=""),
    Topic("site", NavSatFix, LATCHED, "latched", DESCRIPTION, "where the axes intersect, WGS 84"),
)
"""Topics for viewers; all of it follows from `TOPICS`, so it is not recorded."""
RADIO = "radio_control"
"""The node that tunes a radio and lets it send or not."""
INHIBIT = Topic(
    "radio/inhibit", String, STATUS, "10 Hz", RADIO, "why the transmitter may not send; empty: it may", frame=""
)
FRAMES = {topic.name: topic.frame for topic in TOPICS if topic.frame}
"""Frame in the header of each topic."""
NODES = tuple(node.name for node in GRAPH)
"""Executables of a simulated antenna."""
STATION_NODES = tuple(node.name for node in GRAPH if not node.simulated)
"""Executables that a station with an antenna and a receiver of its own keeps."""
ARRAY_NODES = tuple(node.name for node in ARRAY_GRAPH)
DRIVE_NODES = ("antenna_servo", *STATION_NODES)
"""Executables of a station whose drive is a device; its receiver is its own."""
RECEIVER_NODES = tuple(node.name for node in RECEIVER_GRAPH)
DESIGNATE = DESIGNATE_GRAPH[0].name
MOVES = ("simulation_clock", "antenna_servo", "rf_receiver", "array_receiver")
"""Nodes that move the antenna and receive meanwhile: the first of two processes."""
APART = (ALARMS, EXECUTIVE, ROTCTLD, RADIO, OPERATOR_PAGE, *RECEIVER_NODES)
"""Nodes that serve others, or work long: they hold up none of the station's."""
PROCESSES = (1, 2, 8)
"""Numbers of processes of a station that may be chosen; 8 is one for each node."""
