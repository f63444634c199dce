"""Count the Python calls of one controller period of the station without ROS, and time the whole pass.

scripts/run-python benchmarks/period_calls.py [--periods N] [--whole]

A CBERS-2 pass over DSS-13 at X band in monopulse, where the most is done.  Calls are those that
`sys.setprofile` reports: of functions written in Python, and of built-in ones and of numpy.
"""

import argparse
import math
import sys
import time
from collections import Counter
from dataclasses import replace
from types import FrameType

from rf_pointing.core import Sensor
from rf_pointing.ephemeris import Pass, first_pass_above
from rf_pointing.ephemeris.source import SourceParams, load_elements, load_track
from rf_pointing.simulation import StationSetup, simulate_pass
from rf_pointing.station.antenna.receiver import Reception

LEAD_S = 150.0
"""Time before the pass for the slew to its start."""
SETTLED_S = 120.0
"""Time after the start of the pass from which monopulse tracks."""
MOST_CALLS = 2000
"""Functions written in Python that a period may call."""


class CallCounter:
    """Counts the calls between two receptions, one of which comes in every period."""

    def __init__(self, from_s: float, periods: int) -> None:
        self.calls: Counter[str] = Counter()
        self._from_s, self._left = from_s, periods

    def take(self, reception: Reception) -> None:
        """Begin, go on or end."""
        if reception.truth.t_s < self._from_s or self._left < 0:
            return
        sys.setprofile(self._seen if self._left else None)
        self._left -= 1

    def _seen(self, _frame: FrameType, event: str, _of: object) -> None:
        self.calls[event] += 1


def known_pass() -> Pass:
    """Return the first high pass of the recorded elements."""
    source = SourceParams(satellite="28057")
    epoch_t_s = load_elements(source).epoch_t_s
    return first_pass_above(load_track(source), epoch_t_s, math.radians(40.0), math.radians(5.0), 86400.0)


def main() -> None:
    """Fly a part of the pass, or all of it, and print what it took."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--periods", type=int, default=100, help="periods to count over (default: 100)")
    parser.add_argument("--whole", action="store_true", help="also fly the whole pass for its processor time")
    options = parser.parse_args()
    setup, window = StationSetup("dss13", "X"), known_pass()
    start_s = math.floor(window.aos_t_s) - LEAD_S
    counter = CallCounter(window.aos_t_s + SETTLED_S, options.periods)
    ends_s = window.aos_t_s + SETTLED_S + 1.0 + 0.1 * options.periods
    simulate_pass(setup, replace(window, los_t_s=min(ends_s, window.los_t_s)), start_s, Sensor.MONOPULSE, counter.take)
    python, built_in = (counter.calls[event] / options.periods for event in ("call", "c_call"))
    print(f"a period: {python:.0f} calls of Python functions, {built_in:.0f} of built-in ones")
    if options.whole:
        began_s = time.process_time()
        simulate_pass(setup, window, start_s, Sensor.MONOPULSE)
        took_s = time.process_time() - began_s
        print(f"the pass of {window.los_t_s - start_s:.0f} s: {took_s:.1f} s of processor time")
    if python > MOST_CALLS:
        sys.exit(f"{python:.0f} calls of Python functions a period, at most {MOST_CALLS}")


if __name__ == "__main__":
    main()
