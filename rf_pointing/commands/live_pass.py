"""A pass as an operator sees it: its certificate, one line while it lasts, its outcome.

The line is redrawn in place on a terminal, or repeated every ten seconds in a log.
"""

import math
import sys
import time
from typing import Any, TextIO

from rclpy.action import ActionClient
from rf_pointing_msgs.action import TrackPass
from rf_pointing_msgs.msg import PassCertificate

from rf_pointing.commands.station_run import EVENT_S, GraphRun
from rf_pointing.planning import certificate_lines
from rf_pointing.ros import convert_planning
from rf_pointing.ros.qos import LATCHED
from rf_pointing.ros.stamps import seconds_from_stamp

CERTIFICATE_S = 40.0
"""How long to wait for the certificate of an accepted goal, or for the word that there is none."""
BAR = 24
"""Characters of the progress bar."""


class ProgressLine:
    """Shows the feedback of a track_pass goal in one line."""

    def __init__(self, stream: TextIO) -> None:
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


class LivePass:
    """One pass of the controller in the namespace of `run`."""

    def __init__(self, run: GraphRun) -> None:
        self._run, self._progress = run, ProgressLine(sys.stderr)
        self.client = ActionClient(run.node, TrackPass, "track_pass")
        self._certificate: PassCertificate | None = None
        run.node.create_subscription(PassCertificate, "pass_certificate", self._note_certificate, LATCHED)

    def begin(self, goal: TrackPass.Goal) -> Any:
        """Send the goal, print the certificate, and return the handle of the goal."""
        # A running station has kept the certificate of another pass.
        self._certificate = None
        handle = self._run.send(self.client, goal, "pointing_controller", lambda m: self._progress.show(m.feedback))
        self._show_certificate(handle)
        return handle

    def result(self, handle: Any) -> TrackPass.Result:
        """Wait for the end of the pass, and return what it gave."""
        found: TrackPass.Result = self._run.result(handle)
        self._progress.end()
        return found

    def _note_certificate(self, message: PassCertificate) -> None:
        self._certificate = message

    def _show_certificate(self, handle: Any) -> None:
        """Print the certificate of the accepted goal; simulated time is still held meanwhile."""
        deadline_s, ended = time.monotonic() + CERTIFICATE_S, handle.get_result_async()
        while self._certificate is None and not ended.done() and time.monotonic() < deadline_s:
            self._run.check()
            self._run.spin(EVENT_S)
        if self._certificate is None and not ended.done():
            raise TimeoutError(f"pointing_controller neither certified nor refused the pass in {CERTIFICATE_S:.0f} s")
        if self._certificate is None:
            return
        for line in certificate_lines(convert_planning.certificate_from_message(self._certificate)):
            print(line, file=sys.stderr)
