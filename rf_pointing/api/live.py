"""Runs on the live graph: what a request of `requests.py` starts, records and reports.

`track`, `calibrate` and `identify` bring up the nodes of a station, in some processes, and return
when all of them have ended.  Each result has a `code`: 0 done, 1 not reached, 2 not started.
What is refused raises ValueError, before anything is started.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import Any

import yaml
from rf_pointing_msgs.action import TrackPass

from rf_pointing.api.requests import CalibrateRequest, DesignateRequest, IdentifyRequest, RunRequest, TrackRequest
from rf_pointing.api.scan import ScanRequest
from rf_pointing.api.service import make_desk
from rf_pointing.api.station import Station
from rf_pointing.api.target import Target
from rf_pointing.api.tuning import tune
from rf_pointing.core import MDEG, Sensor, id_of, mount_to_notes, utc_text
from rf_pointing.ephemeris import Pass, tle_lines
from rf_pointing.identification import Recording
from rf_pointing.identification.study import study
from rf_pointing.planning.horizon import horizon_to_notes
from rf_pointing.ros.campaign_run import CalibrationOutcome, CalibrationRun
from rf_pointing.ros.convert_planning import scan_to_message
from rf_pointing.ros.experiment_run import EndedEarlyError, ExperimentRun
from rf_pointing.ros.graph import ARRAY_GRAPH, ARRAY_NODES, DESIGNATE, DRIVE_NODES, GRAPH, NODES, RECEIVER_NODES
from rf_pointing.ros.live_pass import outcome_line, track_designated, track_pass
from rf_pointing.ros.live_scan import LiveScan
from rf_pointing.ros.live_service import LiveService
from rf_pointing.ros.managed_graph import with_receiver, with_trackers
from rf_pointing.ros.stamps import seconds_from_stamp
from rf_pointing.ros.station_client import StationClient
from rf_pointing.ros.station_run import RunSetup, StationRun, parameter_file, run_to_end
from rf_pointing.station.antenna.memory import state_files, state_folder
from rf_pointing.station.campaign.calibrator import journal_of
from rf_pointing.station.campaign.schedule import CalibrationSchedule, fit_of_kept
from rf_pointing.station.clients.scan_samples import ScanSamples
from rf_pointing.station.log_lines import say

OF_STATION = (
    *(node.name for node in (*GRAPH, *ARRAY_GRAPH) if node.name != "simulation_clock"), *RECEIVER_NODES,
    DESIGNATE,
)  # fmt: skip
"""The nodes that take the station description."""
LIGHT_WIND_M_S = 0.3
REAL_TIME_SPEED = 3.0
"""Up to this speed the clock ticks at the servo's 50 Hz, above it at the controller's 10 Hz."""


@dataclass(frozen=True)
class TrackResult:
    """Result of a pass: `outcome` is None where it was not started."""

    code: int
    window: Pass | None
    output: Path
    bag: Path
    outcome: TrackPass.Result | None


@dataclass(frozen=True, kw_only=True)
class Flight:
    """A pass that can be flown: its files are written, nothing is started yet.

    Reports lead to a target without a `window`.
    """

    request: RunRequest
    window: Pass | None
    output: Path
    setup: RunSetup

    def fly(self) -> TrackResult:
        """Fly the pass, record it and report on it."""
        results: list[TrackPass.Result] = []

        def work(run: StationRun) -> int:
            sensor = self.request.sensor
            given = track_designated(run, sensor) if self.window is None else track_pass(run, self.window, sensor)
            results.append(given)
            return 0 if given.success else 1

        code = run_to_end("track", lambda: StationRun(self.setup), work)
        for result in results:
            # Imported late: the libraries of the report take time that the bring-up has not.
            from rf_pointing.report import write_report

            write_report(self.setup.bag, self.output)
            say("track", f"report {self.output / 'report.html'}, bag {self.setup.bag}")
            say("track", outcome_line(result))
        return TrackResult(code, self.window, self.output, self.setup.bag, results[0] if results else None)


def prepare_track(request: TrackRequest) -> Flight:
    """Choose the pass and write the files of its run; ValueError for what cannot be flown."""
    check_files(request)
    window, scan = request.window, request.scan
    if warning := request.stale_warning:
        say("track", warning)
    stem = f"{id_of(request.target.satellite)}-{datetime.fromtimestamp(window.aos_t_s, UTC):%Y%m%dT%H%M%S}"
    output = output_folder(request, stem)
    begin_s = math.floor(window.aos_t_s) - request.before_pass_s(window)
    setup = run_setup("track", request, output, begin_s, window.name)
    say("track", f"{window.name} over {request.station.name}, {request.station.band} band, {request.sensor}: "
        f"AOS {utc_text(window.aos_t_s)}, {window.duration_s:.0f} s, "
        f"peak {math.degrees(window.peak_elevation_rad):.1f} deg")  # fmt: skip
    if (leans_deg := request.station.description.content.mount.train_deg) is not None:
        say("track", f"the tilt axis leans to azimuth {leans_deg:g} deg")
    if scan is not None:
        say("track", f"scan of {scan.radius_rad / MDEG:.2f} mdeg in {scan.period_s:.1f} s, an estimate over "
            f"{scan.window_samples * scan.sample_s:.1f} s")  # fmt: skip
    return Flight(request=request, window=window, output=output, setup=setup)


def prepare_designate(request: DesignateRequest) -> Flight:
    """Write the files of a run that is led by reports; ValueError for what cannot be flown."""
    check_files(request)
    name = request.params.target
    output = output_folder(request, f"{id_of(name)}-{datetime.now(UTC):%Y%m%dT%H%M%S}")
    setup = run_setup("track", request, output, request.begin_s, name)
    place = f"{request.station.name}, {request.station.band} band, {request.sensor}"
    say("track", f"{request.kind} {name} of {request.designate} over {place}")
    return Flight(request=request, window=None, output=output, setup=setup)


def track(request: TrackRequest) -> TrackResult:
    """Track one pass with the whole graph; record it and report on it."""
    return prepare_track(request).fly()


def scan(
    client: StationClient, target: str, *, station: str = "", output: Path | None = None,
    table: Path | None = None, **pattern: Any,
) -> bool:  # fmt: skip
    """Scan with a station that runs, and say what was found; return whether it is complete.

    `station` is its description where that of its nodes is not on this computer; `pattern` are
    fields of `ScanRequest`.  The result is kept in `output`, its offsets in the `table`.
    """
    of_node = partial(client.parameter, "pointing_controller")
    elements = client.parameter("ephemeris_publisher", "source.elements")
    live = LiveScan(client)
    client.until(lambda: live.client.server_is_ready() and live.now_s is not None, "scan")
    mine = Station(station or of_node("station"), of_node("band") or None, model=live.model)
    sought = Target(location=elements or "", satellite=target)
    request = ScanRequest(station=mine, target=sought, **pattern)
    live.samples = ScanSamples(mine.controller.kinematics)
    assert live.now_s is not None
    goal = scan_to_message(request.program(live.now_s), satellite=target)
    ended = live.result(live.begin(goal))
    client.say(ended.message)
    if not ended.success:
        return False
    found = request.result(live.samples)
    found.keep(output, table)
    return True


def serve(client: StationClient, targets: Sequence[str], hours: Sequence[float], *, station: str = "") -> bool:
    """Serve targets with a station that runs, each from its hour of the day on, until stopped.

    `station` is its description where that of its nodes is not on this computer.
    """
    of_node = partial(client.parameter, "pointing_controller")
    elements = client.parameter("ephemeris_publisher", "source.elements") or ""
    mine = Station(station or of_node("station"), of_node("band") or None)
    client.until(lambda: "antenna_status" in client.newest, "antenna_status")
    now_s = seconds_from_stamp(client.newest["antenna_status"].header.stamp)
    names = [Target(location=elements, satellite=name) for name in targets]
    client.select(targets[0])
    desk = make_desk(mine, names, hours, now_s, state_folder() / f"services-{id_of(mine.name)}.json")
    LiveService(client, desk, mine.controller, mine.lowest_rad, client.key()).serve()
    return True


@dataclass(frozen=True)
class CalibrateResult:
    """How a calibration ended, and its report."""

    code: int
    outcome: CalibrationOutcome
    report: Path


@dataclass(frozen=True, kw_only=True)
class Calibration:
    """A campaign that can be run: its files are written, nothing is started yet."""

    request: CalibrateRequest
    schedule: CalibrationSchedule
    output: Path
    setup: RunSetup

    def observe(self) -> CalibrateResult:
        """Run campaign, fit and shadow, and report on them."""
        request, station, outcome = self.request, self.request.station, CalibrationOutcome()

        def make() -> CalibrationRun:
            place = (station.description, station.band, request.models)
            fit = partial(fit_of_kept, *place, request.orbit_prior_m)
            return CalibrationRun(self.setup, self.schedule, request.sensor, fit, resume=request.resume)

        def work(run: CalibrationRun) -> int:
            nonlocal outcome
            outcome = run.calibrate()
            return 0 if outcome.settled else 1

        code = run_to_end("calibrate", make, work)
        from rf_pointing.report.calibration_report import write_calibration_report, write_campaign_report

        journal = journal_of(request.models, station.name, station.band, station.controller.kinematics)
        if not outcome.settled and journal.points is not None:
            say("calibrate", f"the observations are kept in {journal.path}: calibrate --resume continues with them")
        if outcome.fit is not None:
            remarks = [f"In the shadow of the model in force: {outcome.verdict}"] if outcome.verdict else []
            report = write_calibration_report(self.output, *outcome.fit, name=outcome.model, remarks=remarks)
        else:
            report = write_campaign_report(self.output, journal.points, outcome.why)
        say("calibrate", f"report {report}")
        if outcome.fault:
            say("calibrate", f"NOT calibrated: {outcome.fault}")
        return CalibrateResult(code, outcome, report)


def prepare_calibration(request: CalibrateRequest) -> Calibration:
    """Plan the campaign and write the files of its run; ValueError for what cannot be tracked."""
    check_files(request)
    schedule = request.schedule()
    output = output_folder(request, f"calibration-{datetime.now(UTC):%Y%m%dT%H%M%S}")
    elements, calibrator = output / "satellites.tle", output / "calibrator.yaml"
    elements.write_text("\n".join(line for one in schedule.elements for line in (one.name, *tle_lines(one))) + "\n")
    sections = {"/**/bias_calibrator": {"ros__parameters": request.campaign.calibrator_parameters()}}
    calibrator.write_text(yaml.safe_dump(sections))
    own = replace(
        request,
        # Any satellite will do: each pass selects its own at ephemeris_publisher.
        target=Target(location=str(elements), satellite=str(schedule.elements[0].catalogue_number)),
        parameter_files=(*request.parameter_files, calibrator),
    )
    first = [*schedule.windows, *schedule.acceptance_passes][0]
    begin_s = math.floor(first.aos_t_s) - own.before_pass_s(first)
    setup = run_setup("calibrate", own, output, begin_s, "the first pass")
    say("calibrate", str(schedule))
    return Calibration(request=request, schedule=schedule, output=output, setup=setup)


def calibrate(request: CalibrateRequest) -> CalibrateResult:
    """Run a campaign, fit the model, judge it in the shadow, accept it if it is better."""
    return prepare_calibration(request).observe()


@dataclass(frozen=True)
class IdentifyResult:
    """The recordings of the axes, and the table of the errors of their models ("" for none)."""

    code: int
    recordings: Mapping[str, Recording]
    table: str = ""


def identify(request: IdentifyRequest) -> IdentifyResult:
    """Shake the antenna axis by axis; leave models and pictures."""
    from rf_pointing.report.identification_report import error_table, save_recordings, write_identification

    params, output = request.excitation, request.output
    output.mkdir(parents=True, exist_ok=True)
    servo = {"station": str(request.station.description.path.resolve()), "band": request.station.band,
             "wind.mean_speed_m_s": LIGHT_WIND_M_S, "antenna.tick_s": params.sample_s}  # fmt: skip
    recordings: dict[str, Recording] = {}

    def work(run: ExperimentRun) -> int:
        try:
            if request.simulated:
                run.start_antenna(servo, request.parameter_files, output)
            run.find_antenna()
            recordings.update({axis: run.record(axis) for axis in request.axes})
        except (EndedEarlyError, ValueError) as error:
            run.say(str(error))
            return 1
        return 0

    code = run_to_end(
        "identify_antenna", lambda: ExperimentRun(request.namespace, request.sequences, request.seed, params), work
    )
    if code != 0:
        return IdentifyResult(code, {})
    save_recordings(output / "recordings.npz", recordings)
    try:
        studies = study(recordings, request.held_out)
    except ValueError as error:
        say("identify_antenna", f"no model: {error}")
        return IdentifyResult(1, recordings)
    text = f"{params.kind} input, {request.sequences} sequences of {params.samples}"
    write_identification(output, studies, text)
    say("identify_antenna", f"models {output / 'models.json'}, pictures and errors in the same folder")
    try:
        tuning = tune(request.station, models=output / "models.json")
        tuning.write(output)
    except ValueError as error:
        # The models are written all the same.
        return IdentifyResult(0, recordings, f"{error_table(studies)}\n\nno loops: {error}")
    say("identify_antenna", f"loops for the station description in {output / 'loops.yaml'}")
    return IdentifyResult(0, recordings, f"{error_table(studies)}\n\n{tuning}\n\n{tuning.block()}")


# The setup of a run


def nodes_of(request: RunRequest) -> tuple[str, ...]:
    """Return the executables of a run, in the order of their start."""
    array = ARRAY_NODES if Sensor.ARRAY in request.station.sensors else ()
    station = request.station.description
    # A real array has receivers of its own.
    names = (*NODES, *array) if station.simulated else (*DRIVE_NODES, *array[1:])
    if isinstance(request, DesignateRequest):
        names = tuple(DESIGNATE if name == "ephemeris_publisher" else name for name in names)
    if not station.simulated:
        names = with_trackers(names, station.every_sensor, station.receiver)
    return with_receiver(names, station.receiver)


def run_setup(program: str, request: RunRequest, output: Path, begin_s: float, awaited: str) -> RunSetup:
    """Return the setup of a run that begins at `begin_s`; its files are written to `output`."""
    station = request.station
    # 0 is as fast as the machine can.
    factor = 0.0 if request.speed in (None, "max") else float(request.speed)
    # The servo ticks one by one, or five ticks at once.
    ticks = not station.simulated or 0.0 < factor <= REAL_TIME_SPEED
    kind = {"drive": str(station.description.drive["type"])}
    station.description.write(output / "station.yaml", request.changes)
    parameters = _parameters(request, output)
    if station.simulated:
        kind = {"seed": str(request.seed), "speed": f"{factor:g}" if factor else "max"}
        # At 10 Hz the servo makes up its ticks at once: 80 % less traffic of the clock.
        clock = {"start_s": float(begin_s), "speed": factor, "tick_s": 0.02 if ticks else 0.1}
        if station.description.receiver != "simulated":
            clock["errors_in_time"] = False
        parameters = {"simulation_clock": clock} | parameters
    # Next to the bag lies all that the run was flown with: files of the user may change later.
    for node, values in request.said.items():
        parameters[node] = parameters.get(node, {}) | values
    kind |= horizon_to_notes(station.controller.mask) | mount_to_notes(station.controller.kinematics)
    return RunSetup(
        program=program, namespace=request.namespace, nodes=nodes_of(request),
        simulated=station.simulated,
        parameter_files=(parameter_file(output, parameters), *request.parameter_files),
        logs=output / "logs", bag=request.record or output / "bag",
        notes={"station": station.name, "band": station.band, "sensor": request.sensor, **kind},
        punctual=ticks, reset_fault=request.reset_fault, begin_s=begin_s, awaited=awaited,
        processes=request.processes,
    )  # fmt: skip


def check_files(request: RunRequest) -> None:
    """Raise ValueError for what a parameter file and the command line or the station both say.

    What a user writes is in force, or refused.
    """
    if problem := request.target.problem:
        say("elements", problem)
    own = _parameters(request, Path())
    for node, said in request.said.items():
        if node not in (*nodes_of(request), "**"):
            raise ValueError(f"params-file: {node} is not a node; there are {', '.join(nodes_of(request))}")
        given = own.get(node, {}) if node in OF_STATION else {"start_s", "speed", "tick_s"}
        if twice := sorted(said.keys() & given):
            raise ValueError(f"params-file: {node} {', '.join(twice)}: given by the command line, see --help")
        try:
            request.station.description.check_file(node, said, request.station.band)
        except ValueError as error:
            raise ValueError(f"params-file: {error}") from error


def output_folder(request: RunRequest, stem: str) -> Path:
    """Return the folder of a run, by default a new one; ValueError if it has a bag."""
    if request.record and request.record.exists():
        raise ValueError(f"record={request.record} exists already")
    if request.output:
        if (request.output / "bag").exists() and not request.record:
            raise ValueError(f"output={request.output} holds a bag already")
        request.output.mkdir(parents=True, exist_ok=True)
        return request.output
    # `mkdir` decides, not a look before it: two runs may start at the same time.
    for number in range(1, 10000):
        folder = Path("runs") / f"{stem}-{number:02d}"
        try:
            folder.mkdir(parents=True)
        except FileExistsError:
            continue
        return folder
    raise ValueError(f"runs/{stem}-* are all taken")


def _parameters(request: RunRequest, output: Path) -> dict[str, dict[str, Any]]:
    """Return the parameters of every node that takes the station description."""
    source, seed = request.target.parameters, request.seed
    error_s = request.ephemeris_error_s
    truth = {} if error_s is None else {"source.along_track_offset_s": error_s}
    # A real antenna keeps fault and turn over its runs.
    kept = state_files(state_folder(), request.namespace) if not request.station.simulated else {
        "antenna.seed": seed, "command_key_file": str((output / "command.key").resolve())
    }  # fmt: skip
    own: dict[str, dict[str, Any]] = {
        "ephemeris_publisher": source, "rf_receiver": {**source, **truth, "signal.seed": seed},
        "signal_source": {**source, **truth, "signal.seed": seed},
        "array_receiver": {"receiver.seed": seed}, "antenna_servo": kept,
        "pointing_controller": {
            "certificate_folder": str(output.resolve()),
            "command_key_file": kept["command_key_file"],
        },
        "bias_calibrator": {
            "calibrator.folder": str(Path(request.models).resolve()) if request.models else "",
            "calibrator.keep_observations": request.keep_observations,
        },
    }  # fmt: skip
    common = {"station": str((output / "station.yaml").resolve()), "band": request.station.band}
    if isinstance(request, DesignateRequest):
        led = {name: getattr(request.params, name) for name in ("source", "target", "kind", "fused")}
        own[DESIGNATE] = {f"designate.{name}": value for name, value in led.items()}
    return {node: common | own.get(node, {}) for node in OF_STATION if node in nodes_of(request)}
