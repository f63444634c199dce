"""Executable `identify_antenna`: shake the antenna axis by axis; leave models and pictures.

Needs an active antenna that is holding (action `identify`, topic manual_rate); with --simulated it
starts one of its own.  Exit code 0: models were made; 1: the experiment ended early or the data do
not carry a model; 2: it could not be started.
"""

import argparse
import math
import sys
import time
from pathlib import Path
from typing import Any

import yaml
from rclpy.action import ActionClient
from rf_pointing_msgs.action import Identify
from rf_pointing_msgs.msg import ManualRate

from rf_pointing.commands.options import (
    add_namespace_option,
    add_station_options,
    band_of,
    between,
    ending_with_reason,
    say,
    seed,
    station_of,
)
from rf_pointing.commands.station_run import GraphRun, run_to_end
from rf_pointing.core import AXES
from rf_pointing.identification import ExcitationParams, Recording, SampleCollector
from rf_pointing.identification.study import study
from rf_pointing.report.identification_report import error_table, save_recordings, write_identification
from rf_pointing.ros import convert_identification as convert
from rf_pointing.ros.managed_graph import ManagedGraph, NotStartedError
from rf_pointing.ros.qos import EXPERIMENT

PROGRAM = "identify_antenna"
BRING_UP_S = 30.0
SIMULATED = ("simulation_clock", "antenna_servo")
# The offset of 0.0023 V that the published antenna had at both inputs: its friction stays
# constant.
IDLE_DEG_S = 1.84e-4
# How long samples may arrive after the result of their experiment.
LATE_SAMPLES_S = 2.0


class EndedEarlyError(Exception):
    """Why the experiment did not run to its end."""


def arguments(argv: list[str] | None = None) -> argparse.Namespace:
    """Return the parsed command line."""
    usual = ExcitationParams()
    parser = argparse.ArgumentParser(prog="identify_antenna", description="Identify the antenna from its own motion.")
    add = parser.add_argument
    add("--axes", nargs="+", choices=AXES, default=list(AXES), help="axes to drive (default: both)")
    add("--sequences", type=int, default=8, help="sequences per axis (default: 8)")
    add("--held-out", type=int, default=4, help="the last of them, kept for the check (default: 4)")
    add("--samples", type=int, default=usual.samples, help="samples per sequence (default: 8192)")
    add("--kind", choices=("white", "multisine"), default=usual.kind, help="(default: white)")
    for name in ("mean", "rms", "peak"):
        value = math.degrees(getattr(usual, f"{name}_rad_s"))
        add(f"--{name}-deg-s", type=float, default=value, help=f"{name} of the rate ({value:.3f})")
    add("--idle-deg-s", type=float, default=IDLE_DEG_S, help=f"rate of the other axis (default: {IDLE_DEG_S})")
    add("--seed", type=seed, default=1, help="seed of the random input (default: 1)")
    add("--tick", type=between(0.001, 0.1), default=usual.sample_s, help="control period in s (default: 0.02)")
    add_namespace_option(parser)
    add_station_options(parser)
    add("--output", metavar="DIR", default="runs/identification", help="folder of the results")
    add("--simulated", action="store_true", help="start a simulated antenna, in wind of 0.3 m/s")
    add("--params-file", action="append", default=[], help="parameter file for it, may be repeated")
    return parser.parse_args(argv)


def excitation(options: argparse.Namespace) -> ExcitationParams:
    """Return the excitation of the options; ValueError in the words of the parameter set."""
    rates = {f"{name}_rad_s": math.radians(getattr(options, f"{name}_deg_s")) for name in ("mean", "rms", "peak")}
    highest_hz = min(ExcitationParams().high_hz, 0.5 / options.tick)
    params = ExcitationParams(
        kind=options.kind,
        samples=options.samples,
        sample_s=options.tick,
        high_hz=highest_hz,
        idle_rate_rad_s=math.radians(options.idle_deg_s),
        **rates,
    )
    if not 1 <= options.held_out < options.sequences:
        raise ValueError(f"held_out={options.held_out} must be >= 1 and < sequences={options.sequences}")
    return params


class Experimenter(GraphRun):
    """Sends the goals and collects the samples; brings a simulated antenna up where wanted."""

    def __init__(self, options: argparse.Namespace, params: ExcitationParams, output: Path) -> None:
        super().__init__(PROGRAM, options.namespace)
        self._options, self._params, self._output = options, params, output
        self._client = ActionClient(self.node, Identify, "identify")
        self.node.create_subscription(ManualRate, "manual_rate", self._on_sample, EXPERIMENT)
        self._collector: SampleCollector | None = None
        self._next_progress_s = 0.0

    def start(self) -> None:
        """Have an antenna that offers the action."""
        if self._options.simulated:
            self._bring_up()
        self._until(
            lambda: self._client.server_is_ready() and self.node.count_publishers("manual_rate") > 0,
            f"no antenna offers identify in {self._options.namespace}",
        )

    def record(self, axis: str) -> Recording:
        """Drive one axis and return its complete sequences."""
        options = self._options
        self._collector = SampleCollector(axis, options.sequences, options.samples, options.tick)
        goal = convert.excitation_to_goal(axis, options.sequences, options.seed, self._params)
        sent = self._client.send_goal_async(goal, feedback_callback=lambda m: self._tell(axis, m.feedback.progress))
        self._until(sent.done, "the antenna does not answer the goal")
        if not sent.result().accepted:
            raise NotStartedError(f"{axis}: the goal was rejected, another experiment runs")
        result = self.result(sent.result())
        if not result.success:
            started = result.samples_taken > 0
            raise (EndedEarlyError if started else NotStartedError)(f"{axis}: {result.message}")
        deadline_s = time.monotonic() + LATE_SAMPLES_S
        while self._collector.received < result.samples_taken and time.monotonic() < deadline_s:
            self.spin(0.05)
        recording, missing = self._collector.recording()
        if missing:
            self.say(f"{axis}: {missing} samples were lost, {len(recording.input_rad_s)} sequences are complete")
        return recording

    def _bring_up(self) -> None:
        written = self._output / "run.yaml"
        sections = {
            "simulation_clock": {"start_s": 1.0e9, "speed": 0.0, "tick_s": 0.1},
            "antenna_servo": {
                "station": str(station_of(self._options).path.resolve()),
                "band": band_of(self._options),
                "wind.mean_speed_m_s": 0.3,
                "antenna.tick_s": self._options.tick,
            },
        }
        written.write_text(yaml.safe_dump({f"/**/{k}": {"ros__parameters": v} for k, v in sections.items()}))
        files = [written, *map(Path, self._options.params_file)]
        namespace, logs = self._options.namespace, self._output / "logs"
        self.graph = ManagedGraph(self.node, namespace, files, logs, self.spin, patience_s=BRING_UP_S)
        self.graph.start(SIMULATED)
        self.graph.configure(SIMULATED)
        self.graph.activate(SIMULATED[1:])
        self.graph.change(SIMULATED[:1], "activate")

    def _until(self, condition: Any, complaint: str) -> None:
        deadline_s = time.monotonic() + BRING_UP_S
        while not condition():
            if self.graph is not None:
                self.graph.check()
            if self.stopping or time.monotonic() > deadline_s:
                raise NotStartedError(complaint)
            self.spin(0.05)

    def _on_sample(self, message: ManualRate) -> None:
        if self._collector is None:
            return
        try:
            self._collector.take(*convert.manual_rate_from_message(message))
        except ValueError as error:
            self.node.get_logger().warning(f"sample ignored: {error}", throttle_duration_sec=1.0)

    def _tell(self, axis: str, progress: float) -> None:
        if time.monotonic() >= self._next_progress_s:
            self._next_progress_s = time.monotonic() + 10.0
            self.say(f"{axis}: {100.0 * progress:.0f} %")


def main(argv: list[str] | None = None) -> None:
    """Entry point of `ros2 run rf_pointing identify_antenna`."""
    options = arguments(argv)
    with ending_with_reason(PROGRAM):
        params = excitation(options)
        output = Path(options.output)
        output.mkdir(parents=True, exist_ok=True)
    sys.exit(execute(options, params, output))


def execute(options: argparse.Namespace, params: ExcitationParams, output: Path) -> int:
    """Run the experiments, make the models, and return the exit code."""
    recordings: dict[str, Recording] = {}

    def work(run: Experimenter) -> int:
        try:
            run.start()
            recordings.update({axis: run.record(axis) for axis in options.axes})
        except (EndedEarlyError, ValueError) as error:
            run.say(str(error))
            return 1
        return 0

    code = run_to_end(PROGRAM, lambda: Experimenter(options, params, output), work)
    if code != 0:
        return code
    save_recordings(output / "recordings.npz", recordings)
    try:
        studies = study(recordings, options.held_out)
    except ValueError as error:
        say(PROGRAM, f"no model: {error}")
        return 1
    write_identification(output, studies, f"{params.kind} input, {options.sequences} sequences of {options.samples}")
    print(error_table(studies))
    say(PROGRAM, f"models {output / 'models.json'}, pictures and errors in the same folder")
    return 0
