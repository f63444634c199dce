"""Executable `calibrate`: a calibration campaign on the live simulated station, from the plan to the accepted model.

The sky is filled with beacons, the campaign that fills the 36 sectors in the least time is planned, the graph is brought
up as `track` does, the calibrator runs the campaign, fits and accepts; the report is written from its observations.
Exit code 0: the model is in force; 1: it is not; 2: the campaign could not be started.
"""

import argparse
import math
import sys
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from numpy.typing import NDArray
from rclpy.action import ActionClient
from rf_pointing_msgs.action import FitModel, RunCampaign
from std_srvs.srv import Trigger

from rf_pointing.calibration import (
    BiasModel,
    Campaign,
    ModelStore,
    ObservationJournal,
    PassPriors,
    SectorRule,
    Slew,
    plan_campaign,
)
from rf_pointing.ephemeris import Elements, Pass, site, tle_lines, utc_text
from rf_pointing.geometry import MDEG
from rf_pointing.nodes import convert_planning
from rf_pointing.nodes.bias_calibrator import JOURNAL
from rf_pointing.nodes.station_run import StationRun, run_to_end
from rf_pointing.nodes.track_options import DEFAULT_MODELS, speed_factor
from rf_pointing.nodes.utc import parse_utc
from rf_pointing.station.calibration_log import CalibrationLog
from rf_pointing.station.calibration_plan import ArcRules, beacons, candidate_arcs, window_of
from rf_pointing.station.model_keeper import campaign_folder

Counts = NDArray[np.int64]
DEFAULT_START = "2006-06-25T00:00:00"
"""Before the passes that `track` chooses by default, for which the model shall be valid."""
ARCS_S = (60.0, 120.0, 240.0)
"""Lengths of the pieces of passes that the plan chooses from."""
SPACING_S = 0.5
SETTLE_S = 25.0
"""Of valid errors before the first observation; the simulated lags follow a change of rate like exp(-t / 10 s)."""
ACQUISITION_S = 45.0
"""From the begin of a pass until the search has found the signal and the lags of the mount have died down."""


def arguments(argv: list[str] | None = None) -> argparse.Namespace:
    """Return the parsed command line."""
    parser = argparse.ArgumentParser(prog="calibrate", description="Calibrate the simulated station's pointing model.")
    parser.add_argument("--station", default="Goldstone DSS-13", help="station name (default: Goldstone DSS-13)")
    parser.add_argument("--band", choices=("S", "X", "Ka"), default="X", help="frequency band (default: X)")
    parser.add_argument("--sensor", choices=("monopulse", "conscan"), default="monopulse", help="(default: monopulse)")
    parser.add_argument(
        "--start", metavar="UTC", default=DEFAULT_START, help=f"simulated time (default: {DEFAULT_START})"
    )
    parser.add_argument(
        "--longest", metavar="S", type=float, default=4800.0, help="simulated time at most (default: 4800)"
    )
    parser.add_argument("--fewest", type=int, default=25, help="observations in each sector (default: 25)")
    parser.add_argument("--ephemeris-error", metavar="S", type=float, default=0.0, help="of the beacons (default: 0)")
    parser.add_argument(
        "--orbit-prior",
        metavar="M",
        type=float,
        default=5.0,
        help="error of the beacons' orbits that the fit allows for in each pass (default: 5)",
    )
    parser.add_argument(
        "--resume", action="store_true", help="go on with an interrupted campaign: only what its observations left thin"
    )
    parser.add_argument("--models", metavar="DIR", default=str(DEFAULT_MODELS), help=f"(default: {DEFAULT_MODELS})")
    parser.add_argument("--speed", default="max", help="factor of real time, or max (default)")
    parser.add_argument("--seed", type=int, default=1, help="seed of every noise source (default: 1)")
    parser.add_argument("--namespace", default="/gs1", help="namespace of the antenna (default: /gs1)")
    parser.add_argument("--params-file", action="append", default=[], help="further ROS parameter file")
    parser.add_argument("--output", metavar="DIR", help="folder of bag and report (default: runs/calibration-TIME)")
    options = parser.parse_args(argv)
    options.satellite, options.mask, options.record, options.keep_observations = "90001", 5.0, None, True
    return options


def plan(options: argparse.Namespace) -> tuple[list[Elements], Campaign, list[Pass]]:
    """Return the beacons, the campaign and the passes to track; ValueError when nothing can be tracked."""
    start_s = parse_utc(options.start)
    elements, place = beacons(start_s), site(options.station)
    rules = ArcRules(
        arcs_s=ARCS_S, every_s=60.0, spacing_s=SPACING_S, lowest_rad=math.radians(11.0), acquisition_s=ACQUISITION_S
    )
    slew = Slew(settle_s=ACQUISITION_S + 10.0)
    rule = SectorRule(fewest=options.fewest, most=max(30, options.fewest))
    filled, last_s = progress_so_far(options, rule) if options.resume else (None, start_s)
    candidates, _ = candidate_arcs(elements, place, max(start_s, last_s) + 180.0, options.longest, rules)
    campaign = plan_campaign(candidates, rule, slew, filled)
    if not campaign.passes:
        raise ValueError(f"longest={options.longest} s leaves no beacon to track")
    by_name = {one.name: one for one in elements}
    windows = [window_of(one, by_name[one.name], place, ACQUISITION_S) for one in campaign.passes]
    return elements, campaign, windows


def progress_so_far(options: argparse.Namespace, rule: SectorRule) -> tuple[Counts, float]:
    """Return the points in each sector that an interrupted campaign has taken, and when the last one was."""
    points = journal_of(options).points
    if points is None:
        raise ValueError(
            f"no observations of {options.station} in band {options.band} to resume from in {options.models}"
        )
    return rule.coverage(points.true_azimuth_rad, points.true_elevation_rad).counts, float(np.max(points.t_s))


def journal_of(options: argparse.Namespace) -> ObservationJournal:
    """Return the observations that the calibrator keeps for this station and band."""
    folder = campaign_folder(options.models, options.station, options.band)
    return ObservationJournal(folder / JOURNAL, options.station, options.band)


def calibrator_parameters(path: Path, size_m: float) -> Path:
    """Write spacing and what the beacons' orbits may be wrong by, and return the file."""
    values = {f"{name}_m": size_m for name in ("along_track", "cross_track", "radial")}
    sections = {"orbit": values, "calibrator": {"spacing_s": SPACING_S, "settle_s": SETTLE_S}}
    path.write_text(yaml.safe_dump({"/**/bias_calibrator": {"ros__parameters": sections}}))
    return path


class CalibrationRun(StationRun):
    """A campaign, a fit and an acceptance on the live graph."""

    def __init__(self, options: argparse.Namespace, windows: list[Pass], output: Path) -> None:
        super().__init__("calibrate", options, windows[0], output)
        self._options, self._windows, self._shown = options, windows, 0
        self._campaign = ActionClient(self.node, RunCampaign, "bias_calibrator/run_campaign")
        self._fit = ActionClient(self.node, FitModel, "bias_calibrator/fit_model")

    def calibrate(self) -> tuple[RunCampaign.Result, FitModel.Result, str]:
        """Return what the campaign and the fit gave, and why the model was not accepted (empty if it was)."""
        self.bring_up(self._campaign, self._fit)
        passes = [convert_planning.pass_to_message(window) for window in self._windows]
        goal = RunCampaign.Goal(passes=passes, sensor=self._options.sensor, resume=self._options.resume)
        handle = self.send(self._campaign, goal, "bias_calibrator", self._show)
        self.run_time()
        campaign = self.result(handle)
        if sys.stderr.isatty():
            print(file=sys.stderr)
        self.say(campaign.message)
        fit = self.result(self.send(self._fit, FitModel.Goal(), "bias_calibrator"))
        self.say(fit.message)
        if not fit.success:
            return campaign, fit, fit.message
        answer = self._call("bias_calibrator/accept")
        self.say(answer.message)
        return campaign, fit, "" if answer.success else answer.message

    def _call(self, name: str) -> Trigger.Response:
        future = self.node.create_client(Trigger, name).call_async(Trigger.Request())
        self.graph.wait_until(future.done, f"an answer of {name}")
        return future.result()

    def _show(self, message: Any) -> None:
        state = message.feedback
        if not sys.stderr.isatty() and state.pass_number == self._shown:
            return
        self._shown = state.pass_number
        text = (
            f"pass {state.pass_number} of {len(self._windows)}, {state.target}: {state.observations} observations, "
            f"{state.sectors_filled} of 36 sectors"
        )
        print(
            f"\r{text:<78}" if sys.stderr.isatty() else text, end="" if sys.stderr.isatty() else "\n", file=sys.stderr
        )


def report_of(options: argparse.Namespace, name: str, output: Path) -> Path:
    """Write the report of the campaign, from its observations on the disk and the model that it began with."""
    from rf_pointing.report.calibration_report import write_calibration_report

    folder = campaign_folder(options.models, options.station, options.band)
    log = CalibrationLog(options.station, options.band, SPACING_S, 2.0 * MDEG, journal=journal_of(options))
    accepted = ModelStore(folder / "models", options.station, options.band)
    before = [other for other in accepted.accepted() if other != name]
    size = options.orbit_prior
    fit = log.fit(
        accepted.read(before[-1]).model if before else BiasModel.zero(),
        pass_priors=PassPriors(along_track_m=size, cross_track_m=size, radial_m=size),
    )
    return write_calibration_report(output, log.observations(), fit, name=name)


def say(text: str) -> None:
    """Tell the user, beside the data."""
    print(f"calibrate: {text}", file=sys.stderr)


def main(argv: list[str] | None = None) -> None:
    """Entry point of `ros2 run rf_pointing calibrate`."""
    options = arguments(argv)
    try:
        speed_factor(options.speed)
        elements, campaign, windows = plan(options)
        output = Path(options.output or f"runs/calibration-{datetime.now(UTC):%Y%m%dT%H%M%S}")
        output.mkdir(parents=True, exist_ok=True)
        options.elements = str(output / "beacons.tle")
        lines = [line for one in elements for line in (one.name, *tle_lines(one))]
        Path(options.elements).write_text("\n".join(lines) + "\n")
        options.params_file.append(str(calibrator_parameters(output / "calibrator.yaml", options.orbit_prior)))
    except (ValueError, OSError) as error:
        say(str(error))
        sys.exit(2)
    last_s = windows[-1].los_t_s
    filled = campaign.coverage.rule.count - len(campaign.coverage.thin)
    say(f"{len(windows)} beacons from {utc_text(windows[0].aos_t_s)} to {utc_text(last_s)} fill {filled} of "
        f"{campaign.coverage.rule.count} sectors")  # fmt: skip
    sys.exit(execute(options, windows, output))


def execute(options: argparse.Namespace, windows: list[Pass], output: Path) -> int:
    """Run the campaign; return the exit code."""

    def work(run: CalibrationRun) -> int:
        _, fit, refusal = run.calibrate()
        if fit.success:
            say(f"report {report_of(options, fit.model.name, output)}")
        return 1 if refusal else 0

    code, _ = run_to_end(lambda: CalibrationRun(options, windows, output), work)
    return code
