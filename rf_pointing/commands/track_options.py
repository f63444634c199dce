"""The command line of `track`, and the pass, parameters and folders that follow from it."""

import argparse
import math
from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import yaml
from ament_index_python.packages import get_package_share_directory

from rf_pointing.commands.options import add_namespace_option, add_target_options, between, seed, source_of, start_of
from rf_pointing.core import MDEG, leaves
from rf_pointing.core.modes import Sensor
from rf_pointing.core.parameters import NodeParameters, read_parameter_files
from rf_pointing.ephemeris import Pass, first_pass_above
from rf_pointing.ephemeris.solar import SolarDirection, SunParams
from rf_pointing.ephemeris.source import load_track
from rf_pointing.planning import Gate, HorizonMask, choose_turns
from rf_pointing.rf import HALF_POWER_BEAMWIDTH_RAD, LinkParams
from rf_pointing.station.antenna.simulated_antenna import SimulationParams
from rf_pointing.station.campaign.model_keeper import commissioning_model
from rf_pointing.station.pointing.params import ControllerParams
from rf_pointing.tracking.conscan_design import ScanDesignParams, scan_for_accuracy
from rf_pointing.tracking.conscan_estimate import ConscanParams
from rf_pointing.tracking.sensors import SENSOR_CHOICES, load_trackers

DEFAULT_MODELS = Path("runs/models")
"""Where `calibrate` leaves accepted models and `track` finds them."""
REAL_TIME_SPEED = 3.0
"""Up to this speed the clock ticks at the servo's 50 Hz, above it at the controller's 10 Hz."""
LONGEST_TURN_S = 32.0
"""Longest period of a chosen scan: over two periods the error must stay the same."""
SCAN_CHOICES = ("radius_deg", "period_s", "window_samples", "fewest_samples", "bandwidth_hz")
SLEW_TIME_S = 150.0
"""Least simulated time before acquisition."""
SETTLE_S = 30.0
"""From the end of a slew to acquisition."""


def arguments(argv: list[str] | None = None) -> argparse.Namespace:
    """Return the parsed command line."""
    load_trackers()
    parser = argparse.ArgumentParser(prog="track", description="Track one satellite pass with the simulated station.")
    add_target_options(parser)
    add = parser.add_argument
    add("--min-peak", type=between(0.0, 90.0), default=40.0, help="least peak elevation in deg (default: 40)")
    add("--band", choices=("S", "X", "Ka"), default="X", help="frequency band (default: X)")
    add("--sensor", choices=tuple(SENSOR_CHOICES), default=str(Sensor.MONOPULSE), help="(default: monopulse)")
    add("--scan-sigma", metavar="MDEG", type=float, help="accuracy of conscan per axis at the pass's weakest "
        "carrier: chooses radius and period (default: the files')")  # fmt: skip
    add("--speed", default="max", help="factor of real time, or max (default)")
    add("--ephemeris-error", metavar="S", type=between(-60.0, 60.0), help="time by which the satellite is ahead of "
        "its elements (default: that of the parameter files, 0.15 s)")  # fmt: skip
    add("--models", metavar="DIR", default=str(DEFAULT_MODELS), help=f"folder of accepted pointing models (default: "
        f"{DEFAULT_MODELS}); empty or none: the commissioning model")  # fmt: skip
    add("--seed", type=seed, default=1, help="seed of every noise source (default: 1)")
    add_namespace_option(parser)
    add("--params-file", action="append", default=[], help="further ROS parameter file, may be repeated")
    add("--record", metavar="DIR", help="bag directory (default: OUTPUT/bag)")
    add("--output", metavar="DIR", help="folder of the report (default: runs/SATELLITE-AOS)")
    parser.set_defaults(keep_observations=False)
    return parser.parse_args(argv)


def choose_pass(options: argparse.Namespace) -> Pass:
    """Return the pass to track; ValueError if satellite, station and time do not give one."""
    above, span_s = _horizon(options).above(math.radians(options.mask)), 2.0 * 86400.0
    track = load_track(source_of(options))
    return first_pass_above(track, start_of(options), math.radians(options.min_peak), above, span_s)


def _given(options: argparse.Namespace, node: str) -> NodeParameters:
    """Return the parameters of a node in the parameter files of the command line."""
    nodes = read_parameter_files([Path(name) for name in options.params_file])
    return nodes.get(node, NodeParameters(node, {}))


def _horizon(options: argparse.Namespace) -> HorizonMask:
    """Return the controller's horizon mask: passes begin and end above it."""
    return _given(options, "pointing_controller").group("mask", HorizonMask())


def _horizon_of_servo(options: argparse.Namespace) -> dict[str, Any]:
    """Return the controller's mask as that of the servo, unless the servo has its own."""
    # The servo holds the mask against every commander, not only against our controller.
    if any(name.startswith("safety.mask.") for name in _given(options, "antenna_servo").values):
        return {}
    values = _given(options, "pointing_controller").values
    return {f"safety.{name}": value for name, value in values.items() if name.startswith("mask.")}


def chosen_scan(options: argparse.Namespace, window: Pass) -> ConscanParams | None:
    """Return the scan for the requested accuracy at the weakest carrier, None without one."""
    if options.scan_sigma is None:
        return None
    if not 0.0 < options.scan_sigma < math.inf:
        raise ValueError(f"scan-sigma={options.scan_sigma} mdeg must be > 0 and finite")
    node = read_parameter_files(_station_files(options))["pointing_controller"]
    track, ends = load_track(source_of(options)), (window.aos_t_s, window.los_t_s)
    # The link is weakest at the horizon, where the range is longest.
    farthest_m = max(float(track.target_at(t_s).range_m) for t_s in ends)
    level_db_hz = node.group("link", LinkParams()).level_db_hz(farthest_m)
    limits = ScanDesignParams(longest_period_s=LONGEST_TURN_S)
    return scan_for_accuracy(node.group("conscan", ConscanParams()), limits, level_db_hz, options.scan_sigma * MDEG)


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
    """Return whether the servo ticks one by one, rather than five ticks at once."""
    return 0.0 < speed_factor(speed) <= REAL_TIME_SPEED


def before_pass_s(options: argparse.Namespace, window: Pass) -> float:
    """Return the whole simulated seconds before acquisition: the slew from the antenna's start."""
    nodes = read_parameter_files(_station_files(options))
    sets = ControllerParams().sets()
    limits, machine, mask, gate = (
        nodes["pointing_controller"].group(name, sets[name]) for name in ("limits", "machine", "mask", "gate")
    )
    start = nodes["antenna_servo"].group("antenna", SimulationParams()).start_rad
    sun = SolarDirection(SunParams(station=options.station)).at(window.aos_t_s)
    turn, times = 2.0 * math.pi, [SLEW_TIME_S - SETTLE_S]
    # A pass over the top may begin on the other side; only the certificate knows whether it does.
    for over in (False, True) if limits.elevation_max_rad > 0.5 * math.pi else (False,):
        azimuth = window.aos_azimuth_rad + (math.pi if over else 0.0)
        elevation = math.pi - window.aos_elevation_rad if over else window.aos_elevation_rad
        shift = azimuth - window.aos_azimuth_rad
        try:
            turns = choose_turns(limits, window.azimuth_min_rad + shift, window.azimuth_max_rad + shift, start[0])
        except ValueError:
            # A pass that fits no turn is the certificate's to refuse, with its reasons.
            continue
        goal = (azimuth + turns * turn, elevation)
        times.append(Gate(gate, limits, mask, machine.axes).slew(start, goal, sun)[0])
    return float(math.ceil(max(times) + SETTLE_S))


def overrides(options: argparse.Namespace, window: Pass, output: Path) -> dict[str, Any]:
    """Return the nodes' parameters from the command line; their files go to `output`."""
    source = {
        "source.satellite": options.satellite,
        "source.station": options.station,
        "source.elements_file": str(Path(options.elements).resolve()) if options.elements else "",
        "source.interpolation": source_of(options).interpolation,
        "source.interpolation_degree": source_of(options).interpolation_degree,
    }
    mask, scan = _horizon(options), chosen_scan(options, window)
    scanned = {} if scan is None else {f"conscan.{name}": leaves(scan)[name][1] for name in SCAN_CHOICES}
    real = {} if options.ephemeris_error is None else {"source.along_track_offset_s": options.ephemeris_error}
    model = commissioning_model(config_folder(), options.station, options.band, output)
    sections = {
        "simulation_clock": {
            "start_s": math.floor(window.aos_t_s) - before_pass_s(options, window),
            "speed": speed_factor(options.speed),
            # At 10 Hz the servo makes up its ticks at once: 80 % less traffic of the clock.
            "tick_s": 0.02 if in_real_time(options.speed) else 0.1,
        },
        "ephemeris_publisher": {
            **source,
            "publisher.mask_deg": options.mask,
            "mask.azimuth_deg": [math.degrees(angle) for angle in mask.azimuth_rad],
            "mask.elevation_deg": [math.degrees(angle) for angle in mask.elevation_rad],
            "mask.clearance_deg": math.degrees(mask.clearance_rad),
        },
        "rf_receiver": {**source, **real, "signal.seed": options.seed},
        "antenna_servo": {
            "antenna.seed": options.seed,
            "safety.sun.station": options.station,
            **_horizon_of_servo(options),
        },
        "conscan_tracker": scanned,
        "pointing_controller": {
            **scanned,
            "sun.station": options.station,
            "machine.half_power_beamwidth_deg": math.degrees(HALF_POWER_BEAMWIDTH_RAD[options.band]),
            "certificate_folder": str(output.resolve()),
        },
        "bias_calibrator": {
            "calibrator.model_file": str(model.resolve()),
            "calibrator.station": options.station,
            "calibrator.band": options.band,
            "calibrator.folder": str(Path(options.models).resolve()) if options.models else "",
            "calibrator.keep_observations": options.keep_observations,
        },
    }
    return {f"/**/{node}": {"ros__parameters": values} for node, values in sections.items() if values}


def notes(options: argparse.Namespace) -> dict[str, str]:
    """Return the notes on the run for the bag and the report."""
    return {name: str(getattr(options, name)) for name in ("station", "band", "sensor", "speed", "seed")}


def parameter_files(options: argparse.Namespace, sections: Mapping[str, Any], output: Path) -> list[Path]:
    """Return the parameter files of a run; `sections`, in `output`, come last and override."""
    written = output / "run.yaml"
    written.write_text(yaml.safe_dump(sections, sort_keys=False))
    return [*_station_files(options), written]


def _station_files(options: argparse.Namespace) -> list[Path]:
    share = config_folder()
    return [share / "dss13.yaml", share / f"band_{options.band.lower()}.yaml", *map(Path, options.params_file)]


def config_folder() -> Path:
    """Return the folder of the installed parameter files."""
    return Path(get_package_share_directory("rf_pointing")) / "config"


def bag_folder(options: argparse.Namespace, output: Path) -> Path:
    """Return the folder of the bag of a run that writes its report to `output`."""
    return Path(options.record or output / "bag")


def run_stem(options: argparse.Namespace, window: Pass) -> str:
    """Return the name of the folders of runs on this pass, without their number."""
    return f"{options.satellite}-{datetime.fromtimestamp(window.aos_t_s, UTC):%Y%m%dT%H%M%S}"


def output_folder(options: argparse.Namespace, stem: str) -> Path:
    """Return the folder of a run, by default a new one; ValueError if it has a bag."""
    if options.record and Path(options.record).exists():
        raise ValueError(f"record={options.record} exists already")
    if options.output:
        folder = Path(options.output)
        if (folder / "bag").exists() and not options.record:
            raise ValueError(f"output={options.output} holds a bag already")
        folder.mkdir(parents=True, exist_ok=True)
        return folder
    # `mkdir` decides, not a look before it: two runs may start at the same time.
    for number in range(1, 10000):
        folder = Path("runs") / f"{stem}-{number:02d}"
        try:
            folder.mkdir(parents=True)
        except FileExistsError:
            continue
        return folder
    raise ValueError(f"runs/{stem}-* are all taken")
