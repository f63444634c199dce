"""Executable `plan_passes`: the coming passes of one satellite, or of many.

One satellite: every pass with its certificate, printed, drawn, or as JSON.  Many (`--satellites`,
or `--all` of the elements): a table of rise, closest approach and set.  No graph is needed.
"""

import argparse
import dataclasses
import json
import math
from pathlib import Path
from typing import Any

from rf_pointing import planning
from rf_pointing.calibration import BiasModel, read_model
from rf_pointing.commands.options import add_target_options, between, ending_with_reason, say, source_of, start_of
from rf_pointing.core import to_degrees
from rf_pointing.core.dates import parse_utc, utc_text
from rf_pointing.core.parameters import NodeParameters, read_parameter_files
from rf_pointing.ephemeris import CataloguePass, CatalogueSearch, find_catalogue_passes, find_elements, site
from rf_pointing.ephemeris.source import load_catalogue, load_track
from rf_pointing.station.antenna.simulated_antenna import SimulationParams
from rf_pointing.station.pointing.certificates import PlannedPass, PlanningRules, plan_passes
from rf_pointing.station.pointing.params import PointingParams


def main(argv: list[str] | None = None) -> None:
    """Entry point of `ros2 run rf_pointing plan_passes`."""
    options = arguments(argv)
    if options.all or options.satellites:
        plan_many(options)
        return
    with ending_with_reason("plan_passes"):
        planned, rules = plan(options)
    if options.json:
        values = [{"pass": pass_values(item), **planning.certificate_values(item.certificate)} for item in planned]
        print(json.dumps(values, indent=1))
    else:
        show(planned)
    if options.picture:
        from rf_pointing.report.plan_picture import draw_plan

        draw_plan(planned, rules.limits, rules.mask, Path(options.picture))
        say("plan_passes", options.picture)


def arguments(argv: list[str] | None = None) -> argparse.Namespace:
    """Return the parsed command line."""
    what = "Plan the coming passes of a satellite, with certificates, or list those of many satellites."
    parser = argparse.ArgumentParser(prog="plan_passes", description=what)
    add_target_options(parser)
    many = parser.add_mutually_exclusive_group()
    many.add_argument("--satellites", nargs="+", metavar="NAME|NUMBER", help="list the passes of these satellites "
                      "instead, above --mask, without certificates (start: their newest epoch)")  # fmt: skip
    many.add_argument("--all", action="store_true", help="list the passes of all satellites of the elements")
    add = parser.add_argument
    add("--hours", type=between(0.01, 744.0), default=24.0, help="how far to look (default: 24)")
    add("--params-file", action="append", default=[], help="parameters of pointing_controller: limits, machine, "
        "mask, gate, pointing; and of antenna_servo: where it stands; may be repeated")  # fmt: skip
    add("--model", metavar="FILE", default="", help="bias model (default: a perfect mount)")
    add("--json", action="store_true", help="print JSON")
    add("--picture", metavar="FILE", help="draw sky, rates and wrap into this PNG or SVG")
    return parser.parse_args(argv)


def plan(options: argparse.Namespace) -> tuple[list[PlannedPass], PlanningRules]:
    """Return the planned passes, and the antenna that they were planned for."""
    nodes = read_parameter_files([Path(name) for name in options.params_file])
    controller, servo = (nodes.get(name, NodeParameters(name, {})) for name in ("pointing_controller", "antenna_servo"))
    rules = PlanningRules(
        model=read_model(Path(options.model)).model if options.model else BiasModel.zero(),
        machine=controller.group("machine", planning.MachineParams()),
        limits=controller.group("limits", planning.AxisLimits()),
        mask=controller.group("mask", planning.HorizonMask()),
        gate=controller.group("gate", planning.GateParams()),
        lag_averaging_s=controller.group("pointing", PointingParams()).lag_averaging_s,
    )
    antenna = servo.group("antenna", SimulationParams())
    planned = plan_passes(
        load_track(source_of(options)), start_of(options), options.hours * 3600.0, antenna.start_rad, rules,
        math.radians(options.mask),
    )  # fmt: skip
    return planned, rules


def plan_many(options: argparse.Namespace) -> None:
    """Print the passes of many satellites as a table or JSON; what was not searched to stderr."""
    with ending_with_reason("plan_passes"):
        found = search(options)
    if options.json:
        unsearched = [{"name": one.name, "reason": reason} for one, reason in found.unsearched]
        print(json.dumps({"passes": [row_values(item) for item in found.passes], "unsearched": unsearched}, indent=1))
        return
    show_table(found)
    for one, reason in found.unsearched:
        say("plan_passes", f"{one.name} was not searched: {reason}")


def search(options: argparse.Namespace) -> CatalogueSearch:
    """Return the passes of the chosen satellites, in order of rise."""
    for name in ("params_file", "model", "picture"):
        if getattr(options, name):
            option = f"--{name.replace('_', '-')}"
            raise ValueError(f"{option} needs the certificate of one satellite: give --satellite")
    catalogue = load_catalogue(options.elements)
    chosen = [find_elements(catalogue, name) for name in options.satellites] if options.satellites else catalogue
    start_s = parse_utc(options.start) if options.start else max(one.epoch_t_s for one in chosen)
    return find_catalogue_passes(
        chosen, site(options.station), start_s, options.hours * 3600.0, math.radians(options.mask)
    )


def row_values(item: CataloguePass) -> dict[str, Any]:
    """Return one pass of a table as names and plain values: times in UTC, angles in degrees."""
    values: dict[str, Any] = {"name": item.elements.name, "catalogue_number": item.elements.catalogue_number}
    values |= {f"{name}_utc": utc_text(getattr(item, f"{name}_t_s")) for name in ("aos", "tca", "los")}
    values["duration_s"] = item.los_t_s - item.aos_t_s
    angles = ("peak_elevation_rad", "aos_azimuth_rad", "tca_azimuth_rad", "los_azimuth_rad")
    values |= dict(to_degrees(name, getattr(item, name)) for name in angles)
    return {**values, "rises_before": item.rises_before, "sets_after": item.sets_after}


def show_table(found: CatalogueSearch) -> None:
    """Print one line for every pass; < and > mark one cut off at an end of the searched time."""
    header = f"{'satellite':<24} {'AOS (UTC)':<24}  {'TCA':<12} {'LOS':<12}  {'s':>6} {'peak':>6} {'azimuth deg':>17}"
    print(header if found.passes else "no pass")
    for item in found.passes:
        row = row_values(item)
        azimuths = " ".join(f"{row[f'{name}_azimuth_deg']:5.1f}" for name in ("aos", "tca", "los"))
        print(
            f"{row['name']:<24.24} {row['aos_utc']}{'<' if item.rises_before else ' '} {row['tca_utc'][11:23]} "
            f"{row['los_utc'][11:23]}{'>' if item.sets_after else ' '} {row['duration_s']:6.0f} "
            f"{row['peak_elevation_deg']:6.2f} {azimuths}"
        )


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
