"""Executable `calibrate`: a campaign on the live station, from plan to accepted model.

The sky of a simulated station is filled with beacons; a station whose drive is not simulated tracks
the satellites of --elements in real time.  The campaign that fills the 36 sectors in the least time
is planned.  The graph is brought up as `track` does it, the calibrator runs the campaign and fits.
More beacons are tracked with the new model in the shadow of the old one, and it is accepted if it
is better there.  The report shows the observations of the fit. Exit code 0: the better of the two
models is in force; 1: interrupted, stopped by a fault of the antenna, or no model to decide about;
2: not started.
"""

import argparse
import math
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from numpy.typing import NDArray
from rclpy.action import ActionClient
from rf_pointing_msgs.action import FitModel, RunCampaign

from rf_pointing import calibration
from rf_pointing.calibration import Campaign, FitResult, ObservationJournal, Observations, SectorRule
from rf_pointing.commands import track_options
from rf_pointing.commands.options import (
    ELEMENTS_HELP,
    add_namespace_option,
    add_station_options,
    band_of,
    between,
    elements_of,
    ending_with_reason,
    say,
    station_of,
)
from rf_pointing.commands.station_run import StationRun, run_to_end
from rf_pointing.commands.track_options import DEFAULT_MODELS, output_folder
from rf_pointing.core import MDEG, require_between
from rf_pointing.core.dates import parse_utc, utc_text
from rf_pointing.core.modes import Sensor
from rf_pointing.ephemeris import Elements, Pass, tle_lines
from rf_pointing.ephemeris.source import read_source
from rf_pointing.nodes import bias_calibrator
from rf_pointing.ros import convert_planning
from rf_pointing.station.campaign.log import CalibrationLog
from rf_pointing.station.campaign.model_keeper import ModelKeeper
from rf_pointing.station.campaign.plan import ArcRules, beacons, candidate_arcs, window_of
from rf_pointing.tracking.sensors import SENSORS

Counts = NDArray[np.int64]
# Before the passes that `track` chooses by default, for which the model shall be valid.
DEFAULT_START = "2006-06-25T00:00:00"
# Lengths of the pieces of passes that the plan chooses from.
ARCS_S = (60.0, 120.0, 240.0)
SHADOW_ARCS_S = (60.0,)
# Time in which a beacon is found for each pass in the shadow.
SHADOW_SPAN_S = 600.0
# From the end of a pass, or from the start, to the first point of the next one.
LARGEST_SLEW_S = 180.0
SPACING_S = 0.5
SIGMA_RAD = 2.0 * MDEG
# Of valid errors before the first observation: the lags follow changes of rate over 10 s.
SETTLE_S = 25.0
# From the start of a pass until the search is over and the lags of the mount have settled.
ACQUISITION_S = 45.0


def arguments(argv: list[str] | None = None) -> argparse.Namespace:
    """Return the parsed command line, completed by what a run of `track` has by default."""
    parser = argparse.ArgumentParser(
        prog="calibrate", description="Calibrate the pointing model of a station, simulated or real."
    )
    add = parser.add_argument
    add_station_options(parser)
    add("--sensor", choices=[*SENSORS, Sensor.AUTO], help="(default: that of the station's band)")
    add("--elements", metavar="FILE|DIR|URL", default="",
        help=f"satellites that the station receives, for a real drive: {ELEMENTS_HELP}")  # fmt: skip
    add("--start", metavar="UTC", help=f"begin (default: {DEFAULT_START}, of a real drive the present)")
    add("--longest", metavar="S", type=float, help="length of the campaign at most (default: 4800, real: 86400)")
    add("--fewest", type=int, default=25, help="observations in each sector (default: 25)")
    add("--ephemeris-error", metavar="S", type=between(-60.0, 60.0), help="of the beacons (default: 0)")
    add("--orbit-prior", metavar="M", type=float, default=5.0,
        help="error of the beacons' orbits that the fit allows for in each pass (default: 5)")  # fmt: skip
    add("--resume", action="store_true", help="continue an interrupted campaign: only what its observations left thin")
    add("--shadow", metavar="N", type=int, default=3,
        help="passes with the new model in the shadow before it is accepted (default: 3)")  # fmt: skip
    add("--models", metavar="DIR", default=str(DEFAULT_MODELS), help=f"(default: {DEFAULT_MODELS})")
    track_options.add_simulation_options(parser)
    add_namespace_option(parser)
    add("--params-file", action="append", default=[], help="further ROS parameter file")
    add("--output", metavar="DIR", help="folder of bag and report (default: runs/calibration-TIME-NUMBER)")
    given = vars(parser.parse_args(argv)) | {"keep_observations": True}
    return argparse.Namespace(**vars(track_options.arguments([])) | given)


@dataclass(frozen=True, eq=False)
class Schedule:
    """What is tracked: `windows` for the fit (none when the sky is full), then `shadow`."""

    elements: list[Elements]
    campaign: Campaign
    windows: list[Pass]
    shadow: list[Pass]


def plan(options: argparse.Namespace) -> Schedule:
    """Return the beacons and the passes to track; ValueError when nothing can be tracked."""
    real = not station_of(options).simulated
    if options.longest is None:
        options.longest = 86400.0 if real else 4800.0
    if options.ephemeris_error is None and not real:
        options.ephemeris_error = 0.0
    require_between("shadow", options.shadow, 2, 20)
    require_between("longest", options.longest, 60.0, 86400.0)
    require_between("orbit_prior", options.orbit_prior, 0.01, 1e6)
    # Without a folder a kill would lose the campaign, and nothing could be resumed.
    if not options.models:
        raise ValueError("models='' must name a folder: a campaign keeps its observations there")
    if real and not options.elements:
        raise ValueError(
            "elements='' must name satellites: the beacons of a simulated sky are not in that of a real antenna"
        )
    start_s = time.time() if real and not options.start else parse_utc(options.start or DEFAULT_START)
    # The beacons' epoch is the start: SGP4 elements are good for days, not for years.
    elements = read_source(elements_of(options)).elements if options.elements else beacons(start_s)
    rule = SectorRule(fewest=options.fewest, most=max(30, options.fewest))
    filled, last_s = progress_so_far(options, rule) if options.resume else (None, start_s)
    begin_s = max(start_s, last_s) + LARGEST_SLEW_S
    campaign = planned(options, elements, begin_s, options.longest, ARCS_S, rule, filled)
    if not campaign.passes and campaign.coverage.thin:
        raise ValueError(f"longest={options.longest} s leaves no satellite to track")
    windows = windows_of(options, elements, campaign)
    begin_s = (windows[-1].los_t_s if windows else begin_s) + LARGEST_SLEW_S
    # Planned after the campaign's end, on passes that the fit has not seen.
    span_s = options.longest if options.elements else options.shadow * SHADOW_SPAN_S
    rest = planned(options, elements, begin_s, span_s, SHADOW_ARCS_S, rule)
    shadow = windows_of(options, elements, rest)[: options.shadow]
    if len(shadow) < options.shadow:
        raise ValueError(f"shadow={options.shadow}: only {len(shadow)} passes can be tracked after the campaign")
    return Schedule(elements, campaign, windows, shadow)


def planned(
    options: argparse.Namespace,
    elements: list[Elements],
    begin_s: float,
    span_s: float,
    arcs_s: tuple[float, ...],
    rule: SectorRule,
    filled: Counts | None = None,
) -> Campaign:
    """Return the campaign of pieces within `span_s` that fills what `filled` leaves thin."""
    rules = ArcRules(
        arcs_s=arcs_s, every_s=60.0, spacing_s=SPACING_S, lowest_rad=math.radians(11.0), lead_s=ACQUISITION_S
    )
    candidates, _ = candidate_arcs(elements, station_of(options).site, begin_s, span_s, rules)
    azimuth = station_of(options).content.mount.azimuth
    travel = (math.radians(azimuth.travel_deg[0]), math.radians(azimuth.travel_deg[1]))
    slew = calibration.Slew(settle_s=ACQUISITION_S + 10.0, travel_rad=travel)
    return calibration.plan_campaign(candidates, rule, slew, filled)


def windows_of(options: argparse.Namespace, elements: list[Elements], campaign: Campaign) -> list[Pass]:
    """Return the passes to track, each from its acquisition on."""
    by_name, place = {one.name: one for one in elements}, station_of(options).site
    return [window_of(one, by_name[one.name], place, ACQUISITION_S) for one in campaign.passes]


def progress_so_far(options: argparse.Namespace, rule: SectorRule) -> tuple[Counts, float]:
    """Return the points per sector of an interrupted campaign, and when the last was taken."""
    points = journal_of(options).points
    if points is None:
        raise ValueError(
            f"no observations of {station_of(options).name} in band {band_of(options)} to resume from in {options.models}"
        )
    return rule.coverage(points.true_azimuth_rad, points.true_elevation_rad).counts, float(np.max(points.t_s))


def journal_of(options: argparse.Namespace) -> ObservationJournal:
    """Return the observations that the calibrator keeps for this station and band."""
    return bias_calibrator.journal_of(options.models, station_of(options).name, band_of(options))


def calibrator_parameters(path: Path, options: argparse.Namespace) -> Path:
    """Write the calibrator's parameters for this campaign and return the file."""
    sections = {
        "orbit": {f"{name}_m": options.orbit_prior for name in ("along_track", "cross_track", "radial")},
        "calibrator": {"spacing_s": SPACING_S, "settle_s": SETTLE_S},
        "shadow": {"fewest_passes": options.shadow, "accept": "better"},
    }
    path.write_text(yaml.safe_dump({"/**/bias_calibrator": {"ros__parameters": sections}}))
    return path


def fit_of(options: argparse.Namespace) -> tuple[Observations, FitResult]:
    """Return the observations on the disk and the fit that the calibrator makes of them."""
    station, band = station_of(options), band_of(options)
    log = CalibrationLog(station.name, band, SPACING_S, SIGMA_RAD, journal=journal_of(options))
    points, file = log.observations(), station.bias_model_file(band)
    start = calibration.read_model(file) if file else None
    keeper = ModelKeeper(station.name, band, options.models, start, calibration.AcceptanceRules())
    keeper.begin(float(np.max(points.t_s)))
    return points, log.fit(keeper.model, pass_priors=calibration.PassPriors.of_orbit(options.orbit_prior))


@dataclass(frozen=True)
class Outcome:
    """How a calibration ended: the fitted model (empty: none), and the verdict of the shadow.

    `fit` is made of the observations before the shadow added its own.  `settled` is True when the
    shadow decided, also against the new model: the better of the two is in force.  `fault` is what
    stopped the campaign.  `why` are the reasons of a campaign without a fit.
    """

    model: str = ""
    fit: tuple[Observations, FitResult] | None = None
    settled: bool = False
    shadow: str = ""
    fault: str = ""
    why: tuple[str, ...] = ()


class CalibrationRun(StationRun):
    """One calibration on the live graph: campaign, fit, passes in the shadow, acceptance.

    Simulated time stands still while nothing is tracked, so that the plan of the passes holds
    however long a fit takes.
    """

    def __init__(self, options: argparse.Namespace, schedule: Schedule, output: Path) -> None:
        first = [*schedule.windows, *schedule.shadow][0]
        super().__init__("calibrate", options, first, output)
        self._begin_s = first.aos_t_s - track_options.before_pass_s(options, first)
        self._options, self._schedule, self._output = options, schedule, output
        self._shown, self._count, self._told = 0, 0, list[str]()
        self._campaign = ActionClient(self.node, RunCampaign, "bias_calibrator/run_campaign")
        self._fit = ActionClient(self.node, FitModel, "bias_calibrator/fit_model")

    def calibrate(self) -> Outcome:
        """Bring the graph up, run campaign, fit and shadow; accept the model if it is better."""
        if self.real:
            self.wait_for(self._begin_s, "the first pass is waited for; the antenna is started")
        self.bring_up(self._campaign, self._fit)
        if self._schedule.windows:
            campaign = self._observe(self._schedule.windows, resume=self._options.resume)
            if self.stopping:
                self.say(f"interrupted with {campaign.observations} observations")
                return Outcome(why=("it was interrupted", *self._told))
            if campaign.fault:
                return Outcome(fault=campaign.fault, why=(campaign.message,))
        fit = self.result(self.send(self._fit, FitModel.Goal(), "bias_calibrator"))
        self.say(fit.message)
        if not fit.success:
            return Outcome(why=(fit.message, *self._told))
        # Before the shadow adds observations: the report is that of the fit.
        made = fit_of(self._options)
        shadow = self._observe(self._schedule.shadow, resume=True)
        if self.stopping:
            self.say(f"interrupted; {fit.model.name} is not in force")
            return Outcome(fit.model.name, made)
        if shadow.fault:
            return Outcome(fit.model.name, made, fault=shadow.fault)
        if shadow.verdict != "better":
            self.say(f"{self.call('bias_calibrator/reject').message}: the old model stays in force")
            enough = shadow.verdict == "undecided" and shadow.passes_observed >= len(self._schedule.shadow)
            return Outcome(fit.model.name, made, enough, shadow.message)
        answer = self.call("bias_calibrator/accept")
        self.say(answer.message)
        return Outcome(fit.model.name, made, answer.success, shadow.message)

    def _observe(self, windows: Sequence[Pass], *, resume: bool) -> RunCampaign.Result:
        """Run a campaign of these passes; time runs only meanwhile."""
        self._shown, self._count = 0, len(windows)
        passes = [convert_planning.pass_to_message(window) for window in windows]
        sensor = track_options.sensor_of(self._options)
        goal = RunCampaign.Goal(passes=passes, sensor=sensor, resume=resume)
        handle = self.send(self._campaign, goal, "bias_calibrator", self._show)
        self.run_time()
        result = self.result(handle)
        self.hold_time()
        if sys.stderr.isatty():
            print(file=sys.stderr)
        self.say(result.message)
        self._told.append(result.message)
        return result

    def _show(self, message: Any) -> None:
        state = message.feedback
        text = (
            f"pass {state.pass_number} of {self._count}, {state.target}: so far {state.observations} observations, "
            f"{state.sectors_filled} of 36 sectors"
        )
        if sys.stderr.isatty():
            print(f"\r{text:<78}", end="", file=sys.stderr)
        elif state.pass_number != self._shown:
            print(text, file=sys.stderr)
        self._shown = state.pass_number


def main(argv: list[str] | None = None) -> None:
    """Entry point of `ros2 run rf_pointing calibrate`."""
    options = arguments(argv)
    with ending_with_reason("calibrate"):
        track_options.check_time(options)
        track_options.check_files(options)
        schedule = plan(options)
        output = output_folder(options, f"calibration-{datetime.now(UTC):%Y%m%dT%H%M%S}")
        options.elements = str(output / "satellites.tle")
        # Any will do: each pass selects its own at ephemeris_publisher.
        options.satellite = str(schedule.elements[0].catalogue_number)
        lines = [line for one in schedule.elements for line in (one.name, *tle_lines(one))]
        Path(options.elements).write_text("\n".join(lines) + "\n")
        options.params_file.append(str(calibrator_parameters(output / "calibrator.yaml", options)))
    say("calibrate", plan_text(schedule))
    sys.exit(execute(options, schedule, output))


def plan_text(schedule: Schedule) -> str:
    """Return the plan in a line."""
    coverage, windows = schedule.campaign.coverage, schedule.windows
    filled = f"{coverage.rule.count - len(coverage.thin)} of {coverage.rule.count} sectors"
    last = f"{len(schedule.shadow)} more in the shadow until {utc_text(schedule.shadow[-1].los_t_s)}"
    if not windows:
        return f"{filled} are full already; {last}"
    first, end = utc_text(windows[0].aos_t_s), utc_text(windows[-1].los_t_s)
    return f"{len(windows)} passes from {first} to {end} fill {filled}; {last}"


def execute(options: argparse.Namespace, schedule: Schedule, output: Path) -> int:
    """Run the campaign and write the report; return the exit code."""
    from rf_pointing.report.calibration_report import write_calibration_report, write_campaign_report

    outcome = Outcome()

    def work(run: CalibrationRun) -> int:
        nonlocal outcome
        outcome = run.calibrate()
        return 0 if outcome.settled else 1

    code = run_to_end("calibrate", lambda: CalibrationRun(options, schedule, output), work)
    journal = journal_of(options)
    if not outcome.settled and journal.points is not None:
        say("calibrate", f"the observations are kept in {journal.path}: calibrate --resume continues with them")
    if outcome.fit is not None:
        remarks = [f"In the shadow of the model in force: {outcome.shadow}"] if outcome.shadow else []
        page = write_calibration_report(output, *outcome.fit, name=outcome.model, remarks=remarks)
    else:
        page = write_campaign_report(output, journal.points, outcome.why)
    say("calibrate", f"report {page}")
    if outcome.fault:
        say("calibrate", f"NOT calibrated: {outcome.fault}")
    return code
