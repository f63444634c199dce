"""Executable `plan_passes`: the coming passes of one satellite, or of many for one antenna.

One satellite: every pass with its certificate, printed, drawn, or as JSON.  Many (`--satellites`,
or `--all` of the elements): which passes the antenna tracks, which yield to which, and why.  With
`--stations` a network tracks them, each by one station at a time.  No graph is needed.
"""

import argparse
import json
import time
from dataclasses import fields
from functools import partial
from pathlib import Path
from typing import Any

from rf_pointing.api.passes import draw_certificates
from rf_pointing.api.satellite_list import satellites
from rf_pointing.api.target import every_satellite
from rf_pointing.commands.options import (
    add_options,
    between,
    command,
    ending_with_reason,
    requested,
    say,
    say_if,
    say_of_elements,
    written,
)
from rf_pointing.commands.plans_of_many import (
    PROGRAM,
    PlanRequest,
    add_network_options,
    network_of,
    plan_many,
    plan_stations,
)
from rf_pointing.core.whole_file import write_whole


def main(argv: list[str] | None = None) -> None:
    """Entry point of `ros2 run rf_pointing plan_passes`."""
    with ending_with_reason(PROGRAM):
        request = request_from(argv)
        if request.targets is None:
            plan_one(request)
        elif request.network is not None:
            plan_stations(request, request.targets, request.network)
        else:
            plan_many(request, request.targets)


def plan_one(request: PlanRequest) -> None:
    """Print the passes of one satellite with their certificates, and write its files."""
    station, target = request.station, request.target
    start_t_s = target.first_t_s if request.span["start_t_s"] is None else request.span["start_t_s"]
    span = request.span | {"start_t_s": start_t_s}
    found = station.certificates(station.passes(target, **span))
    wanted = [each for each in found if each.one.peak_elevation_deg >= request.min_peak_deg]
    if request.json:
        print(json.dumps([each.values() for each in wanted], indent=1))
    else:
        print("".join(f"{each}\n\n" for each in wanted) or "no pass\n", end="")
    if part := station.part_searched(target, start_t_s=start_t_s, hours=request.span["hours"]):
        say(PROGRAM, f"{target.name} {part}")
    if wanted:
        say_if(PROGRAM, wanted[-1].one.warning)
    if request.oem:
        duration_s = request.span["hours"] * 3600.0
        text = target.to_oem(start_t_s=start_t_s, duration_s=duration_s, created_t_s=time.time())
        written(PROGRAM, request.oem, lambda path: write_whole(path, text))
    written(PROGRAM, request.picture, partial(draw_certificates, wanted, station))


def arguments() -> argparse.ArgumentParser:
    """Return the parser of the command line."""
    what = "Plan the coming passes of a satellite, or of many satellites for one antenna, with certificates."
    parser = command(PROGRAM, what)
    add_options(parser, "elements interpolation satellite station band start mask")
    many = parser.add_mutually_exclusive_group()
    many.add_argument("--satellites", nargs="+", metavar="NAME|NUMBER|FILE", help="plan these satellites together; a "
        "file has one a line, as in '25544, priority=5, peak=20' (start: now, or the newest epoch)")  # fmt: skip
    many.add_argument("--all", action="store_true", help="plan all satellites of the elements together")
    add = parser.add_argument
    add_network_options(parser)
    add("--hours", type=between(0.01, 744.0), default=24.0, help="how far to look (default: 24)")
    add_options(
        parser, "min-peak", min_peak={"metavar": "DEG", "default": 0.0, "help": "least peak of a pass (default: 0)"}
    )
    add("--gap", dest="gap_s", type=between(0.0, 3600.0), default=0.0, metavar="S",
        help="between passes of many satellites, besides the slew (default: 0)")  # fmt: skip
    add("--model", dest="bias_model", type=Path, metavar="FILE", help="bias model (default: the station's)")
    add("--json", action="store_true", help="print JSON")
    add("--csv", type=Path, metavar="FILE", help="write all passes of many satellites as a table")
    add("--ics", type=Path, metavar="FILE", help="write the tracked passes of many satellites as a calendar")
    add("--ccsds", type=Path, metavar="FILE", help="write them as a simple schedule (CCSDS 902.1-B, XML)")
    add("--oem", type=Path, metavar="FILE", help="write the satellite's motion over these hours as a CCSDS OEM")
    add("--picture", type=Path, metavar="FILE", help="draw the plan into this PNG")
    return parser


def request_with(**given: Any) -> PlanRequest:
    """Return the request of the options; ValueError for those that contradict each other."""
    station, target, named, everything = (given[name] for name in ("station", "target", "satellites", "all"))
    # A model that cannot be read is reported before the elements are.
    _ = station.rules
    network = network_of(given)
    together = everything or bool(named)
    if together and given["oem"]:
        raise ValueError("--oem is of one satellite: give neither --satellites nor --all")
    for name in ("csv", "ics", "ccsds"):
        if not together and given[name]:
            raise ValueError(f"--{name} is of a plan of many satellites: give --satellites or --all")
    say_of_elements(target)
    targets = None
    if everything:
        targets = every_satellite(target.location, given["min_peak_deg"])
    elif named:
        targets = satellites(target.location, named, min_peak_deg=given["min_peak_deg"])
    span = {"start_t_s": given["start_s"], "hours": given["hours"], "mask_deg": given["mask_deg"]}
    own = {item.name: given[item.name] for item in fields(PlanRequest) if item.name in given}
    return PlanRequest(targets=targets, span=span, network=network, **own)


request_from = partial(requested, arguments, request_with)
"""Returns the request of a command line; ValueError for one that contradicts itself."""
