"""A pass as an operator sees it: its certificate, one line while it lasts, its outcome."""

import math
import sys
import time
from collections.abc import Callable
from typing import Any

from rclpy.action import ActionClient
from rf_pointing_msgs.action import TrackPass
from rf_pointing_msgs.msg import PassCertificate, PassList

from rf_pointing.core.pass_outcome import gaussian_loss_db
from rf_pointing.ephemeris import Pass
from rf_pointing.planning import certificate_lines
from rf_pointing.ros import convert_planning
from rf_pointing.ros.qos import LATCHED
from rf_pointing.ros.stamps import seconds_from_stamp
from rf_pointing.ros.station_run import GraphRun, StationRun

LOG_PERIOD_S = 10.0
CERTIFICATE_S = 40.0
"""How long to wait until an accepted goal is certified or refused."""
REPORTS_S = 3600.0
"""How long to wait for a target that is led to by reports."""
LARGE_RAD = math.radians(0.1)
"""An error on the sky is shown in degrees from here on, and from a beamwidth on."""
BAR = 24
"""Characters of the progress bar."""


class LiveLine:
    """One line on stderr: redrawn in place on a terminal, repeated every ten seconds in a log."""

    def __init__(self, period_s: float) -> None:
        self._period_s, self._next_s = period_s if sys.stderr.isatty() else LOG_PERIOD_S, 0.0

    def show(self, text: Callable[[], str]) -> None:
        """Draw the line if it is time."""
        if time.monotonic() < self._next_s:
            return
        self._next_s = time.monotonic() + self._period_s
        sys.stderr.write(f"\r\x1b[2K{text()}" if sys.stderr.isatty() else f"{text()}\n")
        sys.stderr.flush()

    def end(self) -> None:
        """Leave the line as it is and go on below it."""
        if sys.stderr.isatty():
            sys.stderr.write("\n")


def describe(feedback: TrackPass.Feedback) -> str:
    """Return the line for one feedback."""
    status = feedback.status
    done = round(BAR * feedback.progress)
    to_los_s = max(0.0, seconds_from_stamp(status.los) - seconds_from_stamp(status.header.stamp))
    error = math.hypot(status.cross_elevation_error, status.elevation_error)
    carrier = f"  C/N0 {status.carrier_to_noise:4.1f} dB-Hz" if status.carrier_to_noise > 0.0 else ""
    # The command alone would show a motion while the antenna stands still.
    axes = "on source" if status.on_source else f"axes {math.degrees(status.axis_distance):.3f} deg off"
    return (
        f"[{'#' * done}{'.' * (BAR - done)}] LOS in {to_los_s:4.0f} s  {status.mode:<13}"
        f" command az {math.degrees(status.azimuth) % 360.0:6.2f} el {math.degrees(status.elevation):5.2f} deg"
        f"  error {_error_text(error, status.beamwidth)}{carrier}  {axes}"
        + (f"  {status.alarm}" if status.alarm else "")
    )


def _error_text(error_rad: float, beamwidth_rad: float) -> str:
    """Return an error on the sky with what it costs in a Gaussian beam; in a slew it is degrees."""
    if error_rad > max(beamwidth_rad, LARGE_RAD):
        return f"{math.degrees(error_rad):6.2f} deg"
    loss = f" {float(gaussian_loss_db(error_rad, beamwidth_rad)):5.2f} dB" if beamwidth_rad > 0.0 else ""
    return f"{math.degrees(error_rad) * 1e3:6.2f} mdeg{loss}"


def outcome_line(result: TrackPass.Result) -> str:
    """Return the last line of a pass: what it gave, what was predicted, or why it failed."""
    held = f"{result.seconds_tracked:.0f} s held, {result.seconds_lost:.0f} s lost"
    predicted = f", {result.predicted_loss:.2f} dB predicted" if result.predicted_loss >= 0.0 else ""
    loss = f"mean pointing loss {result.mean_loss:.2f} dB{predicted}"
    outcome = "tracked" if result.success else "NOT tracked"
    return f"{outcome}: {result.message}; {held}; {loss}"


class LivePass:
    """One pass of the controller in the namespace of `run`, a goal of the action `NAME`."""

    KIND: Any = TrackPass
    NAME = "track_pass"

    def __init__(self, run: GraphRun) -> None:
        self._run, self._line = run, LiveLine(0.2)
        self.client = ActionClient(run.node, self.KIND, self.NAME)
        self._certificate: PassCertificate | None = None
        run.node.create_subscription(PassCertificate, "pass_certificate", self._note_certificate, LATCHED)

    def begin(self, goal: Any) -> Any:
        """Send the goal, print the certificate, and return the handle of the goal."""
        # A running station has kept the certificate of another pass.
        self._certificate = None
        show = self._line.show
        handle = self._run.send(self.client, goal, "pointing_controller", lambda m: show(lambda: describe(m.feedback)))
        ended = handle.get_result_async()
        # In a run of its own, simulated time is still held meanwhile.
        self._run.waiting.until(
            lambda: self._certificate is not None or ended.done(),
            "pointing_controller neither certified nor refused the pass",
            CERTIFICATE_S,
        )
        if self._certificate is not None:
            found = convert_planning.certificate_from_message(self._certificate, self._run.mount)
            for line in certificate_lines(found):
                print(line, file=sys.stderr)
        return handle

    def result(self, handle: Any) -> Any:
        """Wait for the end of the pass, and return what it gave, a result of the action."""
        found = self._run.result(handle)
        self._line.end()
        return found

    def _note_certificate(self, message: PassCertificate) -> None:
        self._certificate = message


def track_designated(run: StationRun, sensor: str) -> TrackPass.Result:
    """Bring the graph up, wait for the designated target, track it, and return what that gave."""
    live, seen = LivePass(run), []
    run.node.create_subscription(PassList, "passes", lambda message: seen.append(message.target), LATCHED)
    run.bring_up(live.client)
    run.run_time()
    run.say("waits for two reports of the target that agree")
    run.waiting.until(lambda: seen, "the designated target not seen", REPORTS_S)
    return live.result(live.begin(TrackPass.Goal(satellite=seen[-1], sensor=sensor)))


def track_pass(run: StationRun, window: Pass, sensor: str) -> TrackPass.Result:
    """Bring the graph up, track the pass, and return what it gave."""
    live = LivePass(run)
    run.bring_up(live.client)
    handle = live.begin(TrackPass.Goal(target_pass=convert_planning.pass_to_message(window), sensor=sensor))
    run.run_time()
    return live.result(handle)
