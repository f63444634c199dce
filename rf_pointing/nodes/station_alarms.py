"""Executable `station_alarms`: tells of what goes wrong at a station, with or without an executive.

Subscribes: antenna_status, joint_states, tracking_status, /diagnostics of the nodes of its
namespace.
Publishes: alarms (each message, diagnostic_msgs/DiagnosticArray; also from the executive).
Service: ~/test_alarms (std_srvs/Trigger): a message by every way out of the station.
Parameters: alarms.* (thresholds) and hooks.* (command, webhook, e-mail), which the station
description may give to it and to the executive; folder, recovery_file.

It raises the alarms of the table of recovery and tries nothing.  While an executive that has a way
out of the station is received, that one sends them; when it falls silent, this node does.
"""

import time
from pathlib import Path

from rf_pointing.operations import ExpectedState
from rf_pointing.operations.alarms import AlarmBook
from rf_pointing.operations.dictionary import read_tables
from rf_pointing.operations.recovery import Recovery
from rf_pointing.ros.night_messages import AlarmTopic, hear_station, serve_alarms
from rf_pointing.ros.station_node import StationNode
from rf_pointing.station.clients.station_alarms import StationAlarms
from rf_pointing.station.parameters import controller_params

STEP_S = 0.5


class AlarmNode(StationNode):
    """Steps the alarms of a station on what its nodes publish."""

    def __init__(self) -> None:
        super().__init__("station_alarms")

    def configure(self) -> None:
        assert self.station is not None
        thresholds, hooks, files = map(self.parameters.value, ("alarms", "hooks", ""))
        folder, topic = Path(files.folder).expanduser().resolve(), AlarmTopic(self)
        folder.mkdir(parents=True, exist_ok=True)
        table = read_tables(thresholds, recovery=files.recovery_file).recovery
        book = AlarmBook(lambda *_: None, thresholds.quiet_s)
        recovery = Recovery(table, ExpectedState(), book, acts=False)
        name, controller = self.station.name, controller_params(self.station, self.band)
        self.alarms = StationAlarms(
            recovery, thresholds, hooks, name, controller, folder, topic.publish
        )  # fmt: skip
        hear_station(self, self.alarms)
        serve_alarms(self, self.alarms)
        self._at_cleanup.callback(self.alarms.hooks.close)

    def activate(self) -> None:
        self.every(STEP_S, lambda t_s: self.alarms.step(t_s, time.monotonic()))


main = AlarmNode.main
