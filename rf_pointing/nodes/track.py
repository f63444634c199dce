"""Executable `track`: bring up a simulated antenna, track one pass, record it and report on it.

Every node runs as a process of its own.  Exit code 0: the pass was tracked; 1: it was not; 2: it could not be started.
"""

import argparse
import math
import signal
import sys
import time
from collections.abc import Callable, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, TypeVar

import rclpy
import yaml
from ament_index_python.packages import get_package_share_directory
from rclpy.action import ActionClient
from rf_pointing_msgs.action import TrackPass
from rf_pointing_msgs.msg import PassCertificate

from rf_pointing.ephemeris import Pass, first_pass_above, utc_text
from rf_pointing.nodes import convert_planning
from rf_pointing.nodes.lifecycle_client import LifecycleClient
from rf_pointing.nodes.managed import make_executor, settle_garbage
from rf_pointing.nodes.processes import SIMULATED_STATION, NodeProcesses
from rf_pointing.nodes.progress import ProgressLine
from rf_pointing.nodes.qos import LATCHED
from rf_pointing.nodes.recorder import Recorder
from rf_pointing.nodes.simulation_clock import HELD_PERIOD_S
from rf_pointing.nodes.utc import parse_utc
from rf_pointing.planning import certificate_lines
from rf_pointing.report.bag_writer import BagResult
from rf_pointing.rf import HALF_POWER_BEAMWIDTH_RAD
from rf_pointing.station.commissioning import commissioning_model
from rf_pointing.station.pointing import SENSOR_CHOICES
from rf_pointing.station.source import SourceParams, first_time_s, load_track

DEFAULT_MODELS = Path("runs/models")
"""Where `calibrate` leaves accepted models and `track` finds them."""
BRING_UP_S = 20.0
CERTIFICATE_S = 10.0
SETTLE_S = 0.2
"""Publishers and subscribers that are known to the graph still take a moment to match each other."""
ACTIVATION_TRIES = 20
LOOK_PERIOD_S = 0.2
"""How often it is looked whether every node still runs."""

REAL_TIME_SPEED = 3.0
"""Up to this speed the clock ticks with the servo; above it only with the controller, five servo ticks at once."""
PUNCTUAL = ("simulation_clock", "antenna_servo")
"""In real time the servo's 50 Hz go first: every 0.1 s all nodes wake at once, and the others can wait their milliseconds."""
SLEW_TIME_S = 150.0
"""Simulated time before acquisition: the largest slew at 1.8 deg/s, with most of a minute to settle."""


class NotStartedError(Exception):
    """Why the graph could not be brought up."""


class InterruptedRunError(Exception):
    """The user asked to stop."""


def arguments(argv: list[str] | None = None) -> argparse.Namespace:
    """Return the parsed command line."""
    parser = argparse.ArgumentParser(prog="track", description="Track one satellite pass with the simulated station.")
    parser.add_argument("--elements", metavar="FILE", default="", help="elements (default: verification set of sgp4)")
    parser.add_argument("--satellite", default="28057", help="catalogue number or name (default: 28057, CBERS-2)")
    parser.add_argument("--station", default="Goldstone DSS-13", help="station name (default: Goldstone DSS-13)")
    parser.add_argument("--start", metavar="UTC", help="look for a pass after this time (default: the elements' epoch)")
    parser.add_argument("--min-peak", type=float, default=40.0, help="least peak elevation in deg (default: 40)")
    parser.add_argument("--mask", type=float, default=5.0, help="elevation of AOS and LOS in deg (default: 5)")
    parser.add_argument("--band", choices=("S", "X", "Ka"), default="X", help="frequency band (default: X)")
    parser.add_argument("--sensor", choices=tuple(SENSOR_CHOICES), default="monopulse", help="(default: monopulse)")
    parser.add_argument("--speed", default="max", help="factor of real time, or max (default)")
    parser.add_argument(
        "--ephemeris-error",
        metavar="S",
        type=float,
        help="the satellite runs this much ahead of its elements (default: what the parameter files say, 0.15 s)",
    )
    parser.add_argument(
        "--models",
        metavar="DIR",
        default=str(DEFAULT_MODELS),
        help=f"folder of accepted pointing models (default: {DEFAULT_MODELS}); empty or none: the commissioning model",
    )
    parser.add_argument("--seed", type=int, default=1, help="seed of every noise source (default: 1)")
    parser.add_argument("--namespace", default="/gs1", help="namespace of the antenna (default: /gs1)")
    parser.add_argument(
        "--params-file", action="append", default=[], help="further ROS parameter file, may be repeated"
    )
    parser.add_argument("--record", metavar="DIR", help="bag directory (default: OUTPUT/bag)")
    parser.add_argument("--output", metavar="DIR", help="folder of the report (default: runs/SATELLITE-AOS)")
    parser.set_defaults(keep_observations=False)
    return parser.parse_args(argv)


def choose_pass(options: argparse.Namespace) -> Pass:
    """Return the pass to track; ValueError when the satellite, the station or the time does not give one."""
    source = SourceParams(elements_file=options.elements, satellite=options.satellite, station=options.station)
    start_s = parse_utc(options.start) if options.start else first_time_s(source)
    span_s = 2.0 * 86400.0
    return first_pass_above(
        load_track(source), start_s, math.radians(options.min_peak), math.radians(options.mask), span_s
    )


def speed_factor(text: str) -> float:
    """Return the factor, 0 for max."""
    if text == "max":
        return 0.0
    try:
        factor = float(text)
    except ValueError as error:
        raise ValueError(f"speed={text!r} must be a factor or max") from error
    if not 0.1 <= factor <= 1000.0:
        raise ValueError(f"speed={factor} must be between 0.1 and 1000")
    return factor


def in_real_time(speed: str) -> bool:
    """Whether the servo is to tick regularly, rather than to make up ticks as fast as possible."""
    return 0.0 < speed_factor(speed) <= REAL_TIME_SPEED


def overrides(options: argparse.Namespace, window: Pass, output: Path) -> dict[str, Any]:
    """Return what the command line says to the nodes, as parameter sections; files they need are written to `output`."""
    source = {
        "source.satellite": options.satellite,
        "source.station": options.station,
        "source.elements_file": str(Path(options.elements).resolve()) if options.elements else "",
    }
    real = {} if options.ephemeris_error is None else {"source.along_track_offset_s": options.ephemeris_error}
    share = Path(get_package_share_directory("rf_pointing"))
    sections = {
        "simulation_clock": {
            "start_s": math.floor(window.aos_t_s) - SLEW_TIME_S,
            "speed": speed_factor(options.speed),
            "tick_s": 0.02 if in_real_time(options.speed) else 0.1,
        },
        "ephemeris_publisher": {**source, "publisher.mask_deg": options.mask},
        "rf_receiver": {**source, **real, "signal.seed": options.seed},
        "antenna_servo": {"antenna.seed": options.seed, "safety.sun.station": options.station},
        "pointing_controller": {
            "sun.station": options.station,
            "machine.half_power_beamwidth_deg": math.degrees(HALF_POWER_BEAMWIDTH_RAD[options.band]),
        },
        "bias_calibrator": {
            "calibrator.model_file": str(
                commissioning_model(share / "config", options.station, options.band, output).resolve()
            ),
            "calibrator.station": options.station,
            "calibrator.band": options.band,
            "calibrator.folder": str(Path(options.models).resolve()) if options.models else "",
            "calibrator.keep_observations": options.keep_observations,
        },
    }
    return {f"/**/{node}": {"ros__parameters": values} for node, values in sections.items()}


def notes(options: argparse.Namespace) -> dict[str, str]:
    """Return what the bag and the report should say of the run."""
    return {name: str(getattr(options, name)) for name in ("station", "band", "sensor", "speed", "seed")}


class Run:
    """One pass on the live graph, from the first process to the last."""

    def __init__(self, options: argparse.Namespace, window: Pass, output: Path) -> None:
        self._options, self._window = options, window
        share = Path(get_package_share_directory("rf_pointing")) / "config"
        written = output / "run.yaml"
        said = overrides(options, window, output)
        said["/**/pointing_controller"]["ros__parameters"]["certificate_folder"] = str(output.resolve())
        written.write_text(yaml.safe_dump(said, sort_keys=False))
        files = [
            share / "dss13.yaml",
            share / f"band_{options.band.lower()}.yaml",
            *map(Path, options.params_file),
            written,
        ]
        on_time = PUNCTUAL if in_real_time(options.speed) else ()
        self._processes = NodeProcesses(options.namespace, files, output / "logs", on_time)
        self._node = rclpy.create_node("track", namespace=options.namespace)
        self._executor = make_executor()
        self._executor.add_node(self._node)
        self._lifecycle = LifecycleClient(self._node, options.namespace, self.spin, self._check_alive)
        self._client = ActionClient(self._node, TrackPass, "track_pass")
        self._certificate: PassCertificate | None = None
        self._node.create_subscription(PassCertificate, "pass_certificate", self._note_certificate, LATCHED)
        self._progress = ProgressLine()
        self._stopping = False
        self.recorder = Recorder(
            self._node, options.namespace, Path(options.record or output / "bag"), notes=notes(options)
        )

    def spin(self, timeout_s: float) -> None:
        """Handle one event, or wait for one."""
        self._executor.spin_once(timeout_sec=timeout_s)

    def interrupt(self, *_: object) -> None:
        """Ask for the end of the run; safe in a signal handler."""
        self._stopping = True

    def track(self) -> TrackPass.Result:
        """Bring the graph up, track the pass, and return the result."""
        began_s = time.monotonic()
        self._processes.start(SIMULATED_STATION)
        self._bring_up()
        say(f"{len(SIMULATED_STATION)} nodes matched and active in {time.monotonic() - began_s:.1f} s")
        handle = self._send_goal()
        result = handle.get_result_async()
        self._show_certificate(result)
        self._change(SIMULATED_STATION[:1], "activate")
        cancelled = False
        look_s = 0.0
        settle_garbage()
        while not result.done():
            self.spin(0.1)
            if time.monotonic() >= look_s:
                self._check_alive()
                look_s = time.monotonic() + LOOK_PERIOD_S
            if self._stopping and not cancelled:
                cancelled = True
                handle.cancel_goal_async()
        self._progress.end()
        return result.result().result

    def _note_certificate(self, message: PassCertificate) -> None:
        self._certificate = message

    def _show_certificate(self, result: Any) -> None:
        """Print the certificate of the accepted goal; time is still held, so nothing has moved."""
        deadline_s = time.monotonic() + CERTIFICATE_S
        while self._certificate is None and not result.done() and time.monotonic() < deadline_s:
            self.spin(0.02)
        if self._certificate is None:
            say("no certificate was issued: the coming passes do not hold this one")
            return
        for line in certificate_lines(convert_planning.certificate_from_message(self._certificate)):
            print(line, file=sys.stderr)

    def close(self) -> None:
        """End every process; the bag is closed by the caller."""
        self._processes.stop()

    def destroy(self) -> None:
        """Give up the own node."""
        self._executor.shutdown()
        self._node.destroy_node()

    def _bring_up(self) -> None:
        clock, others = SIMULATED_STATION[:1], SIMULATED_STATION[1:]
        # The clock first, alone: while the others still start, its held time finds the way to them.
        self._lifecycle.wait_for(clock, BRING_UP_S)
        self._change(clock, "configure")
        self._lifecycle.wait_for(others, BRING_UP_S)
        self._change(others, "configure")
        self._activate(others)
        deadline_s = time.monotonic() + BRING_UP_S
        while not self._client.server_is_ready() or self.recorder.unmatched():
            self._check_alive()
            if time.monotonic() > deadline_s:
                raise NotStartedError(f"topics were not matched within {BRING_UP_S:.0f} s")
            self.spin(0.02)
        self._wait(SETTLE_S)

    def _activate(self, names: Sequence[str]) -> None:
        """Activate; a refusal is tried again for a moment, since the held time reaches the nodes one by one."""
        for _ in range(ACTIVATION_TRIES):
            names = self._lifecycle.change(names, "activate", BRING_UP_S)
            if not names:
                return
            self._wait(HELD_PERIOD_S)
        self._change(names, "activate")

    def _wait(self, duration_s: float) -> None:
        deadline_s = time.monotonic() + duration_s
        while time.monotonic() < deadline_s:
            self.spin(0.02)

    def _change(self, names: Sequence[str], transition: str) -> None:
        refused = self._lifecycle.change(names, transition, BRING_UP_S)
        if refused:
            reasons = "; ".join(f"{name}: {self._processes.complaint(name)}" for name in refused)
            raise NotStartedError(f"could not {transition} {reasons}")

    def _check_alive(self) -> None:
        ended = self._processes.ended()
        if ended:
            raise NotStartedError("; ".join(f"{name} ended: {self._processes.complaint(name)}" for name in ended))
        if self._stopping and not self._client.server_is_ready():
            raise InterruptedRunError

    def _send_goal(self) -> Any:
        goal = TrackPass.Goal(target_pass=convert_planning.pass_to_message(self._window), sensor=self._options.sensor)
        future = self._client.send_goal_async(goal, feedback_callback=lambda m: self._progress.show(m.feedback))
        while not future.done():
            self.spin(0.1)
        if not future.result().accepted:
            raise NotStartedError(f"the pass was refused: {self._processes.complaint('pointing_controller')}")
        return future.result()


RunType = TypeVar("RunType", bound=Run)


def say(text: str) -> None:
    """Tell the user, beside the data."""
    print(f"track: {text}", file=sys.stderr)


def output_folder(options: argparse.Namespace, window: Pass) -> Path:
    """Return a new folder for this run; refuses a bag directory that exists."""
    if options.record and Path(options.record).exists():
        raise ValueError(f"record={options.record} exists already")
    if options.output:
        folder = Path(options.output)
        if (folder / "bag").exists() and not options.record:
            raise ValueError(f"output={options.output} holds a bag already")
        folder.mkdir(parents=True, exist_ok=True)
        return folder
    stem = f"{options.satellite}-{datetime.fromtimestamp(window.aos_t_s, UTC):%Y%m%dT%H%M%S}"
    for number in range(1, 10000):
        folder = Path("runs") / f"{stem}-{number:02d}"
        try:
            folder.mkdir(parents=True)
        except FileExistsError:
            continue
        return folder
    raise ValueError(f"runs/{stem}-* are all taken")


def main(argv: list[str] | None = None) -> None:
    """Entry point of `ros2 run rf_pointing track`."""
    options = arguments(argv)
    try:
        speed_factor(options.speed)
        window = choose_pass(options)
        output = output_folder(options, window)
    except (ValueError, OSError) as error:
        say(str(error))
        sys.exit(2)
    say(f"{window.name} over {options.station}: AOS {utc_text(window.aos_t_s)}, {window.duration_s:.0f} s, "
        f"peak {math.degrees(window.peak_elevation_rad):.1f} deg")  # fmt: skip
    sys.exit(execute(options, window, output))


def execute(options: argparse.Namespace, window: Pass, output: Path) -> int:
    """Run the pass and write the report; return the exit code."""
    results: list[TrackPass.Result] = []

    def work(run: Run) -> int:
        results.append(run.track())
        return 0 if results[0].success else 1

    code, recorded = run_to_end(lambda: Run(options, window, output), work)
    if recorded.problem:
        say(
            f"recording stopped: {recorded.problem}; {sum(loss.count for loss in recorded.lost)} messages are not in the bag"
        )
    for result in results:
        say(f"{'tracked' if code == 0 else 'NOT tracked'}: {result.message}, {result.seconds_tracked:.0f} s on target, "
            f"{result.seconds_lost:.0f} s lost")  # fmt: skip
        write(recorded.path, output)
    return code


def run_to_end(make: Callable[[], RunType], work: Callable[[RunType], int]) -> tuple[int, BagResult]:
    """Do `work` with the run that `make` returns and take everything down again, whatever happens.

    Return the exit code and what was recorded.
    """
    rclpy.init(signal_handler_options=rclpy.signals.SignalHandlerOptions.NO)
    run = make()
    for sign in (signal.SIGINT, signal.SIGTERM):
        signal.signal(sign, run.interrupt)
    code = 1
    try:
        code = work(run)
    except (NotStartedError, TimeoutError) as error:
        say(str(error))
        code = 2
    except InterruptedRunError:
        say("interrupted before the graph was up")
    finally:
        run.close()
        recorded = run.recorder.close()
        run.destroy()
        rclpy.try_shutdown()
    return code, recorded


def write(bag: Path, output: Path) -> None:
    """Write the report of a recorded bag and say where it is."""
    from rf_pointing.report import write_report

    write_report(bag, output)
    say(f"report {output / 'report.html'}, bag {bag}")
