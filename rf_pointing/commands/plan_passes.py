"""Executable `plan_passes`: the certificates of the coming passes, printed, drawn, or as JSON; no graph is needed."""

import argparse
import dataclasses
import json
import math
import sys
from pathlib import Path
from typing import Any

from rf_pointing.calibration import BiasModel, read_model
from rf_pointing.commands.options import add_target_options, between, source_of, start_of
from rf_pointing.core import to_degrees
from rf_pointing.core.dates import utc_text
from rf_pointing.core.parameters import NodeParameters, read_parameter_files
from rf_pointing.ephemeris.source import load_track
from rf_pointing.planning import (
    AxisLimits,
    GateParams,
    HorizonMask,
    MachineParams,
    certificate_lines,
    certificate_values,
)
from rf_pointing.station.antenna.simulated_antenna import SimulationParams
from rf_pointing.station.pointing.certificates import PlannedPass, PlanningRules, plan_passes
from rf_pointing.station.pointing.params import PointingParams


def main(argv: list[str] | None = None) -> None:
    """Entry point of `ros2 run rf_pointing plan_passes`."""
    options = arguments(argv)
    try:
        planned, rules = plan(options)
    except (ValueError, OSError) as error:
        print(f"plan_passes: {error}", file=sys.stderr)
        sys.exit(2)
    if options.json:
        print(
            json.dumps(
                [{"pass": pass_values(item), **certificate_values(item.certificate)} for item in planned], indent=1
            )
        )
    else:
        show(planned)
    if options.picture:
        from rf_pointing.report.plan_picture import draw_plan

        draw_plan(planned, rules.limits, rules.mask, Path(options.picture))
        print(f"plan_passes: {options.picture}", file=sys.stderr)


def arguments(argv: list[str] | None = None) -> argparse.Namespace:
    """Return the parsed command line."""
    parser = argparse.ArgumentParser(prog="plan_passes", description="Plan the coming passes of a satellite.")
    add_target_options(parser)
    parser.add_argument("--hours", type=between(0.01, 744.0), default=24.0, help="how far to look (default: 24)")
    parser.add_argument("--params-file", action="append", default=[], help="parameters of pointing_controller: limits, "
                        "machine, mask, gate, pointing; and of antenna_servo: where it stands; may be repeated")  # fmt: skip
    parser.add_argument("--model", metavar="FILE", default="", help="bias model (default: a perfect mount)")
    parser.add_argument("--json", action="store_true", help="print JSON")
    parser.add_argument("--picture", metavar="FILE", help="draw sky, rates and wrap into this PNG or SVG")
    return parser.parse_args(argv)


def plan(options: argparse.Namespace) -> tuple[list[PlannedPass], PlanningRules]:
    """Return the planned passes, and the antenna that they were planned for."""
    nodes = read_parameter_files([Path(name) for name in options.params_file])
    controller, servo = (nodes.get(name, NodeParameters(name, {})) for name in ("pointing_controller", "antenna_servo"))
    rules = PlanningRules(
        model=read_model(Path(options.model)).model if options.model else BiasModel.zero(),
        machine=controller.group("machine", MachineParams()),
        limits=controller.group("limits", AxisLimits()),
        mask=controller.group("mask", HorizonMask()),
        gate=controller.group("gate", GateParams()),
        lag_averaging_s=controller.group("pointing", PointingParams()).lag_averaging_s,
    )
    antenna = servo.group("antenna", SimulationParams())
    planned = plan_passes(
        load_track(source_of(options)), start_of(options), options.hours * 3600.0, antenna.start_rad, rules,
        math.radians(options.mask),
    )  # fmt: skip
    return planned, rules


def pass_values(item: PlannedPass) -> dict[str, Any]:
    """Return one pass as names and plain values: times in UTC, angles in degrees, azimuths continuous from AOS."""
    window, values = item.window, dataclasses.asdict(item.window)
    times = {f"{name}_utc": utc_text(values.pop(f"{name}_t_s")) for name in ("aos", "tca", "los")}
    sky = dict(to_degrees(name, value) for name, value in values.items())
    sun_deg = math.degrees(float(item.profile.sun_angle_rad().min()))
    return {
        **times,
        "duration_s": window.duration_s,
        **sky,
        "crosses_north": window.crosses_north,
        "sun_angle_deg": sun_deg,
    }


def show(planned: list[PlannedPass]) -> None:
    """Print every pass with its certificate."""
    for item in planned:
        window, said = item.window, pass_values(item)
        north = " through north" if window.crosses_north else ""
        print(f"{window.name}: AOS {said['aos_utc']}, TCA {said['tca_utc']}, LOS {said['los_utc']}, {window.duration_s:.0f} s\n"
              f"  peak {said['peak_elevation_deg']:.2f} deg, azimuth {said['aos_azimuth_deg']:.1f} to "
              f"{said['los_azimuth_deg']:.1f} deg{north}, rates {said['peak_azimuth_rate_deg_s']:.3g} "
              f"{said['peak_elevation_rate_deg_s']:.3g} deg/s, Sun {said['sun_angle_deg']:.1f} deg away")  # fmt: skip
        print("\n".join(certificate_lines(item.certificate)), end="\n\n")
    if not planned:
        print("no pass")
