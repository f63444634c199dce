"""The topics of one antenna: type and quality of service of each; recorders and the README's table read this list."""

from dataclasses import dataclass
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.qos import QoSProfile
from rf_pointing_msgs import msg as ours
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory

from rf_pointing.nodes.qos import COMMAND, EXPERIMENT, LATCHED, SAMPLES, STATUS, STREAM

__all__ = ["TOPICS", "Topic"]


@dataclass(frozen=True)
class Topic:
    """One topic, relative to the antenna's namespace unless it begins with a slash."""

    name: str
    message_type: Any
    qos: QoSProfile
    rate: str
    publisher: str


TOPICS = (
    Topic("target", ours.Target, STREAM, "10 Hz, 2 s ahead", "ephemeris_publisher"),
    Topic("passes", ours.PassList, LATCHED, "latched", "ephemeris_publisher"),
    Topic("pass_profiles", ours.PassProfileList, LATCHED, "latched", "ephemeris_publisher"),
    Topic("pass_certificate", ours.PassCertificate, LATCHED, "latched", "pointing_controller"),
    Topic("pointing_model", ours.PointingModel, LATCHED, "latched", "bias_calibrator"),
    Topic("joint_trajectory", JointTrajectory, COMMAND, "10 Hz, 0.1 to 1 s ahead", "pointing_controller"),
    Topic("tracking_status", ours.TrackingStatus, STREAM, "10 Hz", "pointing_controller"),
    Topic("joint_states", JointState, STREAM, "50 Hz", "antenna_servo"),
    Topic("antenna_status", ours.AntennaStatus, STATUS, "10 Hz", "antenna_servo"),
    Topic("manual_rate", ours.ManualRate, EXPERIMENT, "50 Hz while identifying", "antenna_servo"),
    Topic("monopulse", ours.Monopulse, STREAM, "10 Hz, 5 samples each", "rf_receiver"),
    Topic("carrier_power", ours.CarrierPower, STREAM, "10 Hz", "rf_receiver"),
    Topic(
        "pointing_error", ours.PointingError, STREAM, "10 Hz, conscan once a scan", "monopulse_tracker, conscan_tracker"
    ),
    Topic("sim/boresight", ours.Boresight, SAMPLES, "50 Hz", "antenna_servo"),
    Topic("sim/pointing_error", ours.PointingError, STREAM, "10 Hz", "rf_receiver"),
    Topic("clock", Clock, STREAM, "50 Hz", "simulation_clock"),
    Topic("/diagnostics", DiagnosticArray, STREAM, "1 Hz", "every node"),
)
