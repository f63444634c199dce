"""Recordings and reports: write a bag, read any, and make tables and pictures of one pass."""

from rf_pointing.report.bag_writer import BagResult, BagWriter, TopicLoss
from rf_pointing.report.definitions import Definitions, definitions, offered_qos, qos_from_profile
from rf_pointing.report.recording import Recording, antennas, read_recording
from rf_pointing.report.summary import Summary
from rf_pointing.report.write_report import write_report

__all__ = [
    "BagResult",
    "BagWriter",
    "Definitions",
    "Recording",
    "Summary",
    "TopicLoss",
    "antennas",
    "definitions",
    "offered_qos",
    "qos_from_profile",
    "read_recording",
    "write_report",
]
