"""Executable `plan_passes`: the coming passes of one satellite, or of many for one antenna.

One satellite: every pass with its certificate, printed, drawn, or as JSON.  Many (`--satellites`,
or `--all` of the elements): which passes the antenna tracks, which yield to which, and why; see
`plan_passes_many`.  No graph is needed.
"""

import argparse
import dataclasses
import json
import math
import os
import sys
import time
from pathlib import Path
from typing import Any

from rf_pointing import __version__, planning
from rf_pointing.calibration import BiasModel, read_model
from rf_pointing.commands.options import (
    add_target_options,
    band_of,
    between,
    ending_with_reason,
    lowest_rad,
    say,
    say_if,
    source_of,
    start_of,
    station_of,
)
from rf_pointing.commands.plan_passes_many import plan_many, report
from rf_pointing.core import to_degrees
from rf_pointing.core.dates import DAY_S, utc_text
from rf_pointing.core.parameters import NodeParameters
from rf_pointing.core.whole_file import write_whole
from rf_pointing.ephemeris import ElementUncertainty, oem_text, stale_warning
from rf_pointing.ephemeris.source import load_target, load_track
from rf_pointing.station.antenna.simulated_antenna import SimulationParams
from rf_pointing.station.pointing.certificates import PlannedPass, PlanningRules, plan_passes
from rf_pointing.station.pointing.params import PointingParams


def main(argv: list[str] | None = None) -> None:
    """Entry point of `ros2 run rf_pointing plan_passes`."""
    options = arguments(argv)
    try:
        with ending_with_reason("plan_passes"):
            _main(options)
    except BrokenPipeError:
        # `plan_passes | head` has seen enough; Python must not complain about it at its end either.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _main(options: argparse.Namespace) -> None:
    rules, start_rad = antenna_of(options)
    if options.all or options.satellites:
        if options.oem:
            raise ValueError("--oem is of one satellite: give neither --satellites nor --all")
        report(options, plan_many(options, rules, start_rad), rules)
        return
    for name in ("csv", "ics"):
        if getattr(options, name):
            raise ValueError(f"--{name} is of a plan of many satellites: give --satellites or --all")
    track = load_track(source_of(options))
    planned = plan_passes(track, start_of(options), options.hours * 3600.0, start_rad, rules, lowest_rad(options))
    wanted = [item for item in planned if item.window.peak_elevation_rad >= math.radians(options.min_peak)]
    if options.json:
        values = [{"pass": pass_values(item), **planning.certificate_values(item.certificate)} for item in wanted]
        print(json.dumps(values, indent=1))
    else:
        show(wanted)
    if wanted:
        beamwidth_rad, stale_s = rules.machine.half_power_beamwidth_rad, source_of(options).stale_days * DAY_S
        last_s = wanted[-1].window.tca_t_s
        say_if("plan_passes", stale_warning(track, last_s, stale_s, ElementUncertainty(), beamwidth_rad))
    if options.oem:
        source, start_s = source_of(options), start_of(options)
        wanted_id = getattr(load_target(source), "international_designator", "") or source.satellite
        text = oem_text(
            track.target, wanted_id, start_s, start_s + options.hours * 3600.0,
            originator=f"rf_pointing {__version__}", created_t_s=time.time(),
        )  # fmt: skip
        write_whole(Path(options.oem), text)
        say("plan_passes", options.oem)
    if options.picture:
        from rf_pointing.report.plan_picture import draw_plan

        draw_plan(wanted, rules.limits, rules.mask, Path(options.picture))
        say("plan_passes", options.picture)


def arguments(argv: list[str] | None = None) -> argparse.Namespace:
    """Return the parsed command line."""
    what = "Plan the coming passes of a satellite, or of many satellites for one antenna, with certificates."
    parser = argparse.ArgumentParser(prog="plan_passes", description=what)
    add_target_options(parser)
    many = parser.add_mutually_exclusive_group()
    many.add_argument("--satellites", nargs="+", metavar="NAME|NUMBER|FILE", help="plan these satellites together; a "
        "file has one a line, as in '25544, priority=5, peak=20' (start: now, or the newest epoch)")  # fmt: skip
    many.add_argument("--all", action="store_true", help="plan all satellites of the elements together")
    add = parser.add_argument
    add("--hours", type=between(0.01, 744.0), default=24.0, help="how far to look (default: 24)")
    add("--min-peak", type=between(0.0, 90.0), default=0.0, metavar="DEG", help="least peak of a pass (default: 0)")
    add("--gap", type=between(0.0, 3600.0), default=0.0, metavar="S",
        help="between passes of many satellites, besides the slew (default: 0)")  # fmt: skip
    add("--model", metavar="FILE", default="", help="bias model (default: the station's)")
    add("--json", action="store_true", help="print JSON")
    add("--csv", metavar="FILE", help="write all passes of many satellites as a table")
    add("--ics", metavar="FILE", help="write the tracked passes of many satellites as a calendar")
    add("--oem", metavar="FILE", help="write the satellite's motion over these hours as a CCSDS OEM")
    add("--picture", metavar="FILE", help="draw the plan into this PNG")
    return parser.parse_args(argv)


def antenna_of(options: argparse.Namespace) -> tuple[PlanningRules, tuple[float, float]]:
    """Return the antenna that passes are planned for, and where it parks."""
    station, band = station_of(options), band_of(options)
    controller = NodeParameters("pointing_controller", station.parameters("pointing_controller", band))
    servo = NodeParameters("antenna_servo", station.parameters("antenna_servo", band))
    file = Path(options.model) if options.model else station.bias_model_file(band)
    rules = PlanningRules(
        model=read_model(file).model if file else BiasModel.zero(),
        machine=controller.group("machine", planning.MachineParams()),
        limits=controller.group("limits", planning.AxisLimits()),
        mask=controller.group("mask", planning.HorizonMask()),
        gate=controller.group("gate", planning.GateParams()),
        lag_averaging_s=controller.group("pointing", PointingParams()).lag_averaging_s,
    )
    return rules, servo.group("antenna", SimulationParams()).start_rad


def pass_values(item: PlannedPass) -> dict[str, Any]:
    """Return one pass as plain values: UTC, degrees, azimuths continuous from AOS."""
    window, values = item.window, dataclasses.asdict(item.window)
    times = {f"{name}_utc": utc_text(values.pop(f"{name}_t_s")) for name in ("aos", "tca", "los")}
    sky = dict(to_degrees(name, value) for name, value in values.items())
    sun_deg = math.degrees(float(item.profile.sun_angle_rad().min()))
    north, duration_s = window.crosses_north, window.duration_s
    return {**times, "duration_s": duration_s, **sky, "crosses_north": north, "sun_angle_deg": sun_deg}


def show(planned: list[PlannedPass]) -> None:
    """Print every pass with its certificate."""
    for item in planned:
        window, values = item.window, pass_values(item)
        north = " through north" if window.crosses_north else ""
        times = ", ".join(f"{name.upper()} {values[f'{name}_utc']}" for name in ("aos", "tca", "los"))
        print(f"{window.name}: {times}, {window.duration_s:.0f} s\n"
              f"  peak {values['peak_elevation_deg']:.2f} deg, azimuth {values['aos_azimuth_deg']:.1f} to "
              f"{values['los_azimuth_deg']:.1f} deg{north}, rates {values['peak_azimuth_rate_deg_s']:.3g} "
              f"{values['peak_elevation_rate_deg_s']:.3g} deg/s, Sun {values['sun_angle_deg']:.1f} deg away")  # fmt: skip
        print("\n".join(planning.certificate_lines(item.certificate)), end="\n\n")
    if not planned:
        print("no pass")
