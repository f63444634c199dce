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
from pathlib import Path

from rf_pointing_msgs.action import TrackPass

from rf_pointing.commands import track_options
from rf_pointing.commands.live_pass import LivePass, outcome_line
from rf_pointing.commands.options import band_of, ending_with_reason, say, station_of
from rf_pointing.commands.station_run import StationRun, run_to_end
from rf_pointing.core import MDEG
from rf_pointing.core.dates import utc_text
from rf_pointing.ephemeris import Pass
from rf_pointing.ros import convert_planning


class PassRun(StationRun):
    """One pass, with its certificate before anything moves."""

    def __init__(self, options: argparse.Namespace, window: Pass, output: Path) -> None:
        super().__init__("track", options, window, output)
        self._sensor, self._window = track_options.sensor_of(options), window
        self._begin_s = window.aos_t_s - track_options.before_pass_s(options, window)
        self._live = LivePass(self)

    def track(self) -> TrackPass.Result:
        """Bring the graph up, track the pass, and return the result."""
        if self.real:
            self.wait_for(self._begin_s, f"{self._window.name} is waited for; the antenna is started")
        self.bring_up(self._live.client)
        goal = TrackPass.Goal(target_pass=convert_planning.pass_to_message(self._window), sensor=self._sensor)
        handle = self._live.begin(goal)
        self.run_time()
        return self._live.result(handle)


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
