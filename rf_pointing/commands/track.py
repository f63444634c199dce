"""Executable `track`: bring up an antenna, track one pass, record it and report on it.

Every node runs as a process of its own.  During the pass one line shows what the antenna does:
redrawn in place on a terminal, or repeated every ten seconds in a log.  A station whose drive is
not simulated is flown in real time, without simulation_clock and rf_receiver: `track` waits for the
pass, and begins early enough for the antenna to be at its start.
Exit code 0: the pass was tracked, as `core/pass_outcome.py` defines it; 1: it was not; 2: it could
not be started.
"""

import argparse
import math
import sys
import time
from pathlib import Path
from typing import Any, TextIO

from rclpy.action import ActionClient
from rf_pointing_msgs.action import TrackPass
from rf_pointing_msgs.msg import PassCertificate

from rf_pointing.commands import track_options
from rf_pointing.commands.options import band_of, ending_with_reason, say, station_of
from rf_pointing.commands.station_run import StationRun, run_to_end
from rf_pointing.core import MDEG
from rf_pointing.core.dates import utc_text
from rf_pointing.ephemeris import Pass
from rf_pointing.nodes import convert_planning
from rf_pointing.nodes.qos import LATCHED
from rf_pointing.nodes.stamps import seconds_from_stamp
from rf_pointing.planning import certificate_lines

CERTIFICATE_S = 40.0
"""How long to wait for the certificate of an accepted goal, or for the word that there is none."""
BAR = 24
"""Characters of the progress bar."""


class ProgressLine:
    """Shows the feedback of a track_pass goal in one line."""

    def __init__(self, stream: TextIO = sys.stderr) -> None:
        self._stream = stream
        self._live = stream.isatty()
        self._next_s = 0.0

    def show(self, feedback: TrackPass.Feedback) -> None:
        """Draw the line, five times a second on a terminal, every ten seconds otherwise."""
        if time.monotonic() < self._next_s:
            return
        self._next_s = time.monotonic() + (0.2 if self._live else 10.0)
        line = describe(feedback)
        self._stream.write(f"\r\x1b[2K{line}" if self._live else f"{line}\n")
        self._stream.flush()

    def end(self) -> None:
        """Leave the line as it is and go on below it."""
        if self._live:
            self._stream.write("\n")


def describe(feedback: TrackPass.Feedback) -> str:
    """Return the line for one feedback."""
    status = feedback.status
    done = round(BAR * feedback.progress)
    to_los_s = max(0.0, seconds_from_stamp(status.los) - seconds_from_stamp(status.header.stamp))
    error = math.degrees(math.hypot(status.cross_elevation_error, status.elevation_error)) * 1e3
    # The command alone would show a motion while the antenna stands still.
    axes = "on source" if status.on_source else f"axes {math.degrees(status.axis_distance):.3f} deg off"
    return (
        f"[{'#' * done}{'.' * (BAR - done)}] LOS in {to_los_s:4.0f} s  {status.mode:<13}"
        f" command az {math.degrees(status.azimuth) % 360.0:6.2f} el {math.degrees(status.elevation):5.2f} deg"
        f"  error {error:6.2f} mdeg  C/N0 {status.carrier_to_noise:4.1f} dB-Hz  {axes}"
        + (f"  {status.alarm}" if status.alarm else "")
    )


def outcome_line(result: TrackPass.Result) -> str:
    """Return the last line of a pass: what it gave, what was predicted, or why it failed."""
    held = f"{result.seconds_tracked:.0f} s held, {result.seconds_lost:.0f} s lost"
    predicted = f", {result.predicted_loss:.2f} dB predicted" if result.predicted_loss >= 0.0 else ""
    loss = f"mean pointing loss {result.mean_loss:.2f} dB{predicted}"
    outcome = "tracked" if result.success else "NOT tracked"
    return f"{outcome}: {result.message}; {held}; {loss}"


class PassRun(StationRun):
    """One pass, with its certificate before anything moves."""

    def __init__(self, options: argparse.Namespace, window: Pass, output: Path) -> None:
        super().__init__("track", options, window, output)
        self._sensor, self._window = track_options.sensor_of(options), window
        self._begin_s = window.aos_t_s - track_options.before_pass_s(options, window)
        self._client = ActionClient(self.node, TrackPass, "track_pass")
        self._certificate: PassCertificate | None = None
        self.node.create_subscription(PassCertificate, "pass_certificate", self._note_certificate, LATCHED)

    def track(self) -> TrackPass.Result:
        """Bring the graph up, track the pass, and return the result."""
        if self.real:
            self.wait_for(self._begin_s, f"{self._window.name} is waited for; the antenna is started")
        self.bring_up(self._client)
        progress = ProgressLine()
        goal = TrackPass.Goal(target_pass=convert_planning.pass_to_message(self._window), sensor=self._sensor)
        handle = self.send(self._client, goal, "pointing_controller", lambda m: progress.show(m.feedback))
        self._show_certificate(handle)
        self.run_time()
        result = self.result(handle)
        progress.end()
        return result

    def _note_certificate(self, message: PassCertificate) -> None:
        self._certificate = message

    def _show_certificate(self, handle: Any) -> None:
        """Print the certificate of the accepted goal; simulated time is still held meanwhile."""
        deadline_s, ended = time.monotonic() + CERTIFICATE_S, handle.get_result_async()
        while self._certificate is None and not ended.done() and time.monotonic() < deadline_s:
            self.graph.check()
            self.spin(0.02)
        if self._certificate is None and not ended.done():
            raise TimeoutError(f"pointing_controller neither certified nor refused the pass in {CERTIFICATE_S:.0f} s")
        if self._certificate is None:
            return
        for line in certificate_lines(convert_planning.certificate_from_message(self._certificate)):
            print(line, file=sys.stderr)


def main(argv: list[str] | None = None) -> None:
    """Entry point of `ros2 run rf_pointing track`."""
    options = track_options.arguments(argv)
    with ending_with_reason("track"):
        track_options.check_time(options)
        sensor = track_options.sensor_of(options)
        track_options.check_files(options)
        window = track_options.choose_pass(options)
        scan = track_options.chosen_scan(options, window)
        output = track_options.output_folder(options, track_options.run_stem(options, window))
    place, peak_deg = f"{station_of(options).name}, {band_of(options)} band", math.degrees(window.peak_elevation_rad)
    say("track", f"{window.name} over {place}, {sensor}: AOS {utc_text(window.aos_t_s)}, {window.duration_s:.0f} s, "
        f"peak {peak_deg:.1f} deg")  # fmt: skip
    if scan is not None:
        say("track", f"scan of {scan.radius_rad / MDEG:.2f} mdeg in {scan.period_s:.1f} s, an estimate over "
            f"{scan.window_samples * scan.sample_s:.1f} s")  # fmt: skip
    sys.exit(execute(options, window, output))


def execute(options: argparse.Namespace, window: Pass, output: Path) -> int:
    """Run the pass and write the report; return the exit code."""
    results: list[TrackPass.Result] = []

    def work(run: PassRun) -> int:
        results.append(run.track())
        return 0 if results[0].success else 1

    code = run_to_end("track", lambda: PassRun(options, window, output), work)
    for result in results:
        # Imported late: the libraries of the report take time that the bring-up has not.
        from rf_pointing.report import write_report

        bag = track_options.bag_folder(options, output)
        write_report(bag, output)
        say("track", f"report {output / 'report.html'}, bag {bag}")
        say("track", outcome_line(result))
    return code
