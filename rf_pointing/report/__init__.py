"""Recordings and reports: write a bag, read any, and make tables and pictures of one pass."""

from rf_pointing.report.export import export_recording, topic_table
from rf_pointing.report.recording import antennas, read_recording
from rf_pointing.report.write_report import write_report

__all__ = ["antennas", "export_recording", "read_recording", "topic_table", "write_report"]
