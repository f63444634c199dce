"""The command line of `track`, and the pass, parameters and folders that follow from it."""

import argparse
import math
import time
from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from rf_pointing.commands.options import (
    add_namespace_option,
    add_target_options,
    band_of,
    between,
    elements_of,
    lowest_rad,
    say_if,
    seed,
    source_of,
    start_of,
    station_of,
)
from rf_pointing.core import MDEG, Sensor, leaves
from rf_pointing.core.dates import DAY_S, parse_utc
from rf_pointing.core.parameters import NodeParameters, read_parameter_files
from rf_pointing.ephemeris import ElementUncertainty, Pass, first_pass_above, stale_warning
from rf_pointing.ephemeris.element_files import element_files, is_address
from rf_pointing.ephemeris.solar import SolarDirection, SunParams
from rf_pointing.ephemeris.source import load_track
from rf_pointing.planning import Gate, MachineParams, choose_turns
from rf_pointing.rf import LinkParams
from rf_pointing.ros.graph import ARRAY_GRAPH, ARRAY_NODES, DRIVE_NODES, GRAPH, NODES
from rf_pointing.station.antenna.memory import state_files, state_folder
from rf_pointing.station.antenna.simulated_antenna import SimulationParams
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
OF_STATION = tuple(node.name for node in (*GRAPH, *ARRAY_GRAPH) if node.name != "simulation_clock")
"""The nodes that take the station description."""
SLEW_TIME_S = 150.0
"""Least simulated time before acquisition."""
SETTLE_S = 30.0
"""From the end of a slew to acquisition."""


def arguments(argv: list[str] | None = None) -> argparse.Namespace:
    """Return the parsed command line."""
    load_trackers()
    parser = argparse.ArgumentParser(
        prog="track", description="Track one satellite pass with a station, simulated or real."
    )
    add_target_options(parser)
    add = parser.add_argument
    add("--min-peak", type=between(0.0, 90.0), default=40.0, help="least peak elevation in deg (default: 40)")
    add("--sensor", choices=tuple(SENSOR_CHOICES), help="(default: that of the station's band)")
    add("--scan-sigma", metavar="MDEG", type=float, help="accuracy of conscan per axis at the pass's weakest "
        "carrier: chooses radius and period (default: the station's)")  # fmt: skip
    add_simulation_options(parser)
    add("--ephemeris-error", metavar="S", type=between(-60.0, 60.0), help="time by which the satellite is ahead of "
        "its elements (default: the station's, simulation.along_track_offset_s)")  # fmt: skip
    add("--models", metavar="DIR", default=str(DEFAULT_MODELS), help=f"folder of accepted pointing models (default: "
        f"{DEFAULT_MODELS}); empty or none in it: the station's bias model")  # fmt: skip
    add_namespace_option(parser)
    add("--params-file", action="append", default=[], help="further ROS parameter file, may be repeated")
    add("--record", metavar="DIR", help="bag directory (default: OUTPUT/bag)")
    add("--output", metavar="DIR", help="folder of the report (default: runs/SATELLITE-AOS)")
    parser.set_defaults(keep_observations=False)
    return parser.parse_args(argv)


def add_simulation_options(parser: argparse.ArgumentParser) -> None:
    """Add what a simulated antenna alone has, and what a real one alone needs."""
    add = parser.add_argument
    add("--speed", help="of a simulated antenna: factor of real time, or max (default)")
    add("--seed", type=seed, help="of a simulated antenna: seed of every noise source (default: 1)")
    add("--reset-fault", action="store_true", help="of a real antenna: reset the fault that an earlier run has "
        "latched, after you have looked at the antenna")  # fmt: skip


def check_time(options: argparse.Namespace) -> None:
    """Raise ValueError for a speed that is none, and on a real drive for what is not real time."""
    speed_factor(options.speed)
    station = station_of(options)
    if station.simulated:
        return
    real = f"drive.type={station.drive['type']} of {station.name} moves a device, in real time"
    for name in ("speed", "seed", "ephemeris_error"):
        if (value := getattr(options, name)) is not None:
            raise ValueError(f"{name.replace('_', '-')}={value}: {real}; it is for a simulated drive")
    if options.start and (late_s := time.time() - parse_utc(options.start)) > 0.0:
        raise ValueError(f"start={options.start} was {late_s:.0f} s ago: {real}; the present is the default")


def nodes_of(options: argparse.Namespace) -> tuple[str, ...]:
    """Return the executables of a run, in the order of their start."""
    station = station_of(options)
    array = ARRAY_NODES if Sensor.ARRAY in station.sensors(band_of(options)) else ()
    # A real array has receivers of its own.
    return (*NODES, *array) if station.simulated else (*DRIVE_NODES, *array[1:])


def choose_pass(options: argparse.Namespace) -> Pass:
    """Return the pass to track; ValueError if satellite, station and time do not give one."""
    above, span_s = station_of(options).mask.above(lowest_rad(options)), 2.0 * 86400.0
    track = load_track(source_of(options))
    real = not station_of(options).simulated
    start_s = time.time() if real and not options.start else start_of(options)
    window = first_pass_above(track, start_s, math.radians(options.min_peak), above, span_s)
    machine = NodeParameters("", station_of(options).parameters("pointing_controller", band_of(options)))
    beamwidth_rad = machine.group("machine", MachineParams()).half_power_beamwidth_rad
    stale_s = source_of(options).stale_days * DAY_S
    say_if("track", stale_warning(track, window.tca_t_s, stale_s, ElementUncertainty(), beamwidth_rad))
    return window


def sensor_of(options: argparse.Namespace) -> str:
    """Return the sensor of the pass; ValueError for one that the station's band does not have."""
    station, band = station_of(options), band_of(options)
    return station.chosen_sensor(options.sensor or station.sensor(band), band)


def chosen_scan(options: argparse.Namespace, window: Pass) -> ConscanParams | None:
    """Return the scan for the requested accuracy at the weakest carrier, None without one."""
    if options.scan_sigma is None:
        return None
    if not 0.0 < options.scan_sigma < math.inf:
        raise ValueError(f"scan-sigma={options.scan_sigma} mdeg must be > 0 and finite")
    node = NodeParameters(
        "pointing_controller", station_of(options).parameters("pointing_controller", band_of(options))
    )
    track, ends = load_track(source_of(options)), (window.aos_t_s, window.los_t_s)
    # The link is weakest at the horizon, where the range is longest.
    farthest_m = max(float(track.target_at(t_s).range_m) for t_s in ends)
    level_db_hz = node.group("link", LinkParams()).level_db_hz(farthest_m)
    limits = ScanDesignParams(longest_period_s=LONGEST_TURN_S)
    return scan_for_accuracy(node.group("conscan", ConscanParams()), limits, level_db_hz, options.scan_sigma * MDEG)


def speed_factor(text: str | None) -> float:
    """Return the factor, 0 for max, which is the default."""
    if text in (None, "max"):
        return 0.0
    try:
        factor = float(text)
    except ValueError as error:
        raise ValueError(f"speed={text!r} must be a factor or max") from error
    if not 0.1 <= factor <= 1000.0:
        raise ValueError(f"speed={factor} must be between 0.1 and 1000")
    return factor


def in_real_time(options: argparse.Namespace) -> bool:
    """Return whether the servo ticks one by one, rather than five ticks at once."""
    return not station_of(options).simulated or 0.0 < speed_factor(options.speed) <= REAL_TIME_SPEED


def before_pass_s(options: argparse.Namespace, window: Pass) -> float:
    """Return the whole seconds before acquisition: the slew from where the antenna may be."""
    station, band, sets = station_of(options), band_of(options), ControllerParams().sets()
    controller, servo = (
        NodeParameters(node, station.parameters(node, band)) for node in ("pointing_controller", "antenna_servo")
    )
    limits, machine, mask, gate = (controller.group(name, sets[name]) for name in ("limits", "machine", "mask", "gate"))
    if not station.simulated:
        # A real antenna may be anywhere: the longest slew of the azimuth, or over the top.
        travel_rad = (
            limits.azimuth_max_rad - limits.azimuth_min_rad,
            limits.elevation_max_rad - limits.elevation_min_rad,
        )
        slew_s = max(np.divide(travel_rad, machine.rate_limit_rad_s))
        return float(math.ceil(max(SLEW_TIME_S, slew_s + SETTLE_S)))
    # Where a simulated antenna begins is no number of the station's: a file may say it.
    files = read_parameter_files([Path(name) for name in options.params_file])
    servo.values.update(files.get("antenna_servo", servo).values)
    start = servo.group("antenna", SimulationParams()).start_rad
    sun = SolarDirection(SunParams(site=station.site)).at(window.aos_t_s)
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


def parameters(options: argparse.Namespace, window: Pass, output: Path) -> dict[str, dict[str, Any]]:
    """Return the parameters by node that follow from the command line; files go to `output`."""
    station = {"station": str(flown_station(options, window, output).resolve()), "band": band_of(options)}
    own = _own_parameters(options, output)
    nodes = {node: station | own.get(node, {}) for node in OF_STATION if node in nodes_of(options)}
    if not station_of(options).simulated:
        return nodes
    clock = {
        "start_s": float(math.floor(window.aos_t_s) - before_pass_s(options, window)),
        "speed": speed_factor(options.speed),
        # At 10 Hz the servo makes up its ticks at once: 80 % less traffic of the clock.
        "tick_s": 0.02 if in_real_time(options) else 0.1,
    }
    return {"simulation_clock": clock} | nodes


def _own_parameters(options: argparse.Namespace, output: Path) -> dict[str, dict[str, Any]]:
    """Return what the options say to each node."""
    source = {
        "source.satellite": options.satellite,
        "source.elements": _for_nodes(options),
        "source.interpolation": source_of(options).interpolation,
        "source.interpolation_degree": source_of(options).interpolation_degree,
    }
    real = {} if options.ephemeris_error is None else {"source.along_track_offset_s": options.ephemeris_error}
    number = 1 if options.seed is None else options.seed
    # A real antenna remembers its fault and the turn of its cables from run to run.
    kept = state_files(state_folder(), options.namespace)
    if station_of(options).simulated:
        kept = {"antenna.seed": number, "command_key_file": str((output / "command.key").resolve())}
    return {
        "ephemeris_publisher": source,
        "rf_receiver": {**source, **real, "signal.seed": number},
        "array_receiver": {"receiver.seed": number},
        "antenna_servo": kept,
        "pointing_controller": {
            "certificate_folder": str(output.resolve()),
            "command_key_file": kept["command_key_file"],
        },
        "bias_calibrator": {
            "calibrator.folder": str(Path(options.models).resolve()) if options.models else "",
            "calibrator.keep_observations": options.keep_observations,
        },
    }


def flown_station(options: argparse.Namespace, window: Pass, output: Path) -> Path:
    """Write the station of a run, with what the command line changes of it, into its folder."""
    station, scan = station_of(options), chosen_scan(options, window)
    tuning = f"bands.{band_of(options)}.tuning"
    changes = {} if scan is None else {f"{tuning}.conscan.{name}": leaves(scan)[name][1] for name in SCAN_CHOICES}
    if options.mask is not None:
        changes["mount.pass_elevation_deg"] = options.mask
    written = output / "station.yaml"
    station.write(written, changes)
    return written


def _for_nodes(options: argparse.Namespace) -> str:
    """Return where the nodes, which run in another folder, find the elements of the plan."""
    location = elements_of(options)
    # The kept file and not its address: a run has the elements that it was planned with.
    return str((element_files(location)[0] if is_address(location) else Path(location)).resolve()) if location else ""


def notes(options: argparse.Namespace) -> dict[str, str]:
    """Return the notes on the run for the bag and the report."""
    simulated = {"speed": str(options.speed or "max"), "seed": str(1 if options.seed is None else options.seed)}
    of_run = simulated if station_of(options).simulated else {"drive": str(station_of(options).drive["type"])}
    return {"station": station_of(options).name, "band": band_of(options), "sensor": sensor_of(options), **of_run}


def check_files(options: argparse.Namespace) -> None:
    """Raise ValueError for what a parameter file and the command line or the station both say.

    What a user writes is in force, or refused.
    """
    own = _own_parameters(options, Path())
    for node, said in read_parameter_files([Path(name) for name in options.params_file]).items():
        if node not in (*nodes_of(options), "**"):
            raise ValueError(f"params-file: {node} is no node; there are {', '.join(nodes_of(options))}")
        given = {"station", "band", *own.get(node, {})} if node in OF_STATION else {"start_s", "speed", "tick_s"}
        if twice := sorted(said.values.keys() & given):
            raise ValueError(f"params-file: {node} {', '.join(twice)}: given by the command line, see --help")
        try:
            station_of(options).check_file(node, said.values, band_of(options))
        except ValueError as error:
            raise ValueError(f"params-file: {error}") from error


def parameter_files(options: argparse.Namespace, given: Mapping[str, Mapping[str, Any]], output: Path) -> list[Path]:
    """Return the files of a run: `given` by node, written to `output`; then those of the user."""
    written = output / "run.yaml"
    sections = {f"/**/{node}": {"ros__parameters": dict(values)} for node, values in given.items()}
    written.write_text(yaml.safe_dump(sections, sort_keys=False))
    return [written, *map(Path, options.params_file)]


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
