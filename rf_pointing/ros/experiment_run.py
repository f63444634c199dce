"""An identification as a client of the antenna, which it drives axis by axis."""

import time
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

from rclpy.action import ActionClient
from rf_pointing_msgs.action import Identify
from rf_pointing_msgs.msg import ManualRate

from rf_pointing.identification import ExcitationParams, Recording, SampleCollector
from rf_pointing.ros import convert_identification as convert
from rf_pointing.ros.managed_graph import ManagedGraph, NotStartedError
from rf_pointing.ros.qos import EXPERIMENT
from rf_pointing.ros.station_run import GraphRun, parameter_file

PROGRAM = "identify_antenna"
BRING_UP_S = 30.0
SIMULATED = ("simulation_clock", "antenna_servo")
LATE_SAMPLES_S = 2.0
"""How long samples may arrive after the result of their experiment."""
SAY_EVERY_S = 10.0


class EndedEarlyError(Exception):
    """Why the experiment did not run to its end."""


class ExperimentRun(GraphRun):
    """Sends the goals and collects the samples."""

    def __init__(self, namespace: str, sequences: int, seed: int, params: ExcitationParams) -> None:
        super().__init__(PROGRAM, namespace, patience_s=BRING_UP_S)
        self._sequences, self._seed, self._params = sequences, seed, params
        self._client = ActionClient(self.node, Identify, "identify")
        self.node.create_subscription(ManualRate, "manual_rate", self._on_sample, EXPERIMENT)
        self._collector: SampleCollector | None = None
        self._next_progress_s = 0.0

    def start_antenna(self, servo: Mapping[str, Any], files: tuple[Path, ...], output: Path) -> None:
        """Start a simulated antenna with the parameters `servo`, as fast as the machine can."""
        sections = {"simulation_clock": {"start_s": 1.0e9, "speed": 0.0, "tick_s": 0.1}, "antenna_servo": servo}
        written = parameter_file(output, sections)
        self.graph = ManagedGraph(
            self.node, self.namespace, [written, *files], output / "logs", self.spin, patience_s=BRING_UP_S
        )
        self.graph.start(SIMULATED)
        self.graph.configure(SIMULATED)
        self.graph.activate(SIMULATED[1:])
        self.graph.change(SIMULATED[:1], "activate")

    def find_antenna(self) -> None:
        """Wait for an antenna that offers the action; NotStartedError without one."""
        try:
            self.until(
                lambda: self._client.server_is_ready() and self.node.count_publishers("manual_rate") > 0, "identify"
            )
        except TimeoutError as error:
            raise NotStartedError(f"no antenna offers identify in {self.place}") from error

    def record(self, axis: str) -> Recording:
        """Drive one axis and return its complete sequences."""
        samples, tick_s = self._params.samples, self._params.sample_s
        self._collector = collector = SampleCollector(axis, self._sequences, samples, tick_s)
        goal = convert.excitation_to_goal(axis, self._sequences, self._seed, self._params)
        handle = self.send(self._client, goal, "antenna_servo", lambda m: self._tell(axis, m.feedback.progress))
        result = self.result(handle)
        if not result.success:
            started = result.samples_taken > 0
            raise (EndedEarlyError if started else NotStartedError)(f"{axis}: {result.message}")
        with suppress(TimeoutError):
            self.waiting.until(lambda: collector.received >= result.samples_taken, "late samples", LATE_SAMPLES_S)
        recording, missing = collector.recording()
        if late := collector.late:
            self.say(f"{axis}: {late}; they are left out")
        if missing:
            self.say(f"{axis}: {missing} samples were lost, {len(recording.input_rad_s)} sequences are complete")
        return recording

    def _on_sample(self, message: ManualRate) -> None:
        if self._collector is None:
            return
        try:
            self._collector.take(*convert.manual_rate_from_message(message))
        except ValueError as error:
            self.node.get_logger().warning(f"sample ignored: {error}", throttle_duration_sec=1.0)

    def _tell(self, axis: str, progress: float) -> None:
        if time.monotonic() >= self._next_progress_s:
            self._next_progress_s = time.monotonic() + SAY_EVERY_S
            self.say(f"{axis}: {100.0 * progress:.0f} %")
