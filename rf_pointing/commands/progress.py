"""One line that tells what the antenna is doing, redrawn in place on a terminal, or now and then in a log."""

import math
import sys
import time
from typing import TextIO

from rf_pointing_msgs.action import TrackPass

from rf_pointing.nodes.stamps import seconds_from_stamp

__all__ = ["ProgressLine"]

BAR = 24


class ProgressLine:
    """Draws the feedback of a track_pass goal."""

    def __init__(self, stream: TextIO = sys.stderr) -> None:
        self._stream = stream
        self._live = stream.isatty()
        self._next_s = 0.0

    def show(self, feedback: TrackPass.Feedback) -> None:
        """Draw the line, at most five times a second on a terminal and every ten seconds otherwise."""
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
    return (
        f"[{'#' * done}{'.' * (BAR - done)}] LOS in {to_los_s:4.0f} s  {status.mode:<13}"
        f" az {math.degrees(status.azimuth) % 360.0:6.2f} el {math.degrees(status.elevation):5.2f} deg"
        f"  error {error:6.2f} mdeg  C/N0 {status.carrier_to_noise:4.1f} dB-Hz  lead {status.command_lead:.2f} s"
    )
