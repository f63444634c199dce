"""Plans of many satellites that `plan_passes` prints: of one antenna, and of a network."""

import argparse
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rf_pointing.api.network import NetworkPlan, plan_network
from rf_pointing.api.plan import Plan
from rf_pointing.api.station import Station
from rf_pointing.api.target import Target
from rf_pointing.commands.options import between, say, say_if, written
from rf_pointing.core.whole_file import write_whole
from rf_pointing.operations.pass_list import read_passes, to_simple_schedule

PROGRAM = "plan_passes"


@dataclass(frozen=True, kw_only=True)
class PlanRequest:
    """One `target`, or the `targets` of a plan of many, and the files that are written."""

    station: Station
    target: Target
    targets: list[Target] | None
    span: dict[str, Any]
    """Start, length and mask, as the methods of a station take them."""
    min_peak_deg: float
    gap_s: float
    json: bool
    csv: Path | None
    ics: Path | None
    ccsds: Path | None
    oem: Path | None
    picture: Path | None
    network: dict[str, Any] | None
    """Options of a plan of a network, as `plan_network` takes them."""
    against: Path | None


def plan_many(request: PlanRequest, targets: list[Target]) -> None:
    """Print the plan of many satellites, and write its files."""
    plan = request.station.plan(targets, gap_s=request.gap_s, **request.span)
    print(plan.to_json() if request.json else plan)
    for one, reason in plan.day.unsearched:
        say(PROGRAM, f"{one.name} {reason}")
    say_if(PROGRAM, plan.warning())
    write_files(request, plan)
    written(PROGRAM, request.picture, plan.draw)


def plan_stations(request: PlanRequest, targets: list[Target], network: dict[str, Any]) -> None:
    """Print the plan of a network, and write its files."""
    plan = plan_network(targets=targets, gap_s=request.gap_s, **network, **request.span)
    changes = plan.changes(request.against) if request.against else []
    print(plan.to_json(changes) if request.json else plan)
    for one in {one.name: f"{one.name} {reason}" for each in plan.plans.values()
                for one, reason in each.day.unsearched}.values():  # fmt: skip
        say(PROGRAM, one)
    if not request.json:
        for line in changes:
            print(line)
    for each in plan.plans.values():
        say_if(PROGRAM, each.warning() and f"{each.station.name}: {each.warning()}")
    write_files(request, plan)
    for path in plan.draw(request.picture) if request.picture else ():
        say(PROGRAM, str(path))


def write_files(request: PlanRequest, plan: Plan | NetworkPlan) -> None:
    """Write table, calendar and simple schedule of a plan of many satellites."""

    def write_schedule(path: Path) -> None:
        passes = read_passes(plan.to_csv(), every=False)
        write_whole(path, to_simple_schedule(passes, request.station.name, time.time()))

    written(PROGRAM, request.csv, lambda path: write_whole(path, plan.to_csv()))
    written(PROGRAM, request.ics, lambda path: write_whole(path, plan.to_calendar()))
    written(PROGRAM, request.ccsds, write_schedule)


def add_network_options(parser: argparse.ArgumentParser) -> None:
    """Add the options of a plan of a network."""
    add = parser.add_argument
    add("--stations", nargs="+", metavar="FILE|NAME", help="plan a network of these stations; :BAND after one names "
        "its band")  # fmt: skip
    add("--cloudy", nargs="+", type=_share, metavar="STATION=SHARE", help="share of the time in which clouds end the "
        "contacts of a station of the network")  # fmt: skip
    add("--maintenance", nargs="+", type=_span, metavar="STATION=UTC/UTC", help="a station of the network tracks "
        "nothing in this time")  # fmt: skip
    add("--against", type=Path, metavar="FILE", help="tell what differs from an earlier plan of the network (JSON)")


def _share(text: str) -> tuple[str, float]:
    name, _, value = text.rpartition("=")
    return name, between(0.0, 1.0)(value)


def _span(text: str) -> tuple[str, tuple[str, str]]:
    name, _, times = text.rpartition("=")
    begin, _, end = times.partition("/")
    if not name or not end:
        raise argparse.ArgumentTypeError(f"{text!r} must be STATION=UTC/UTC")
    return name, (begin, end)


def network_of(given: dict[str, Any]) -> dict[str, Any] | None:
    """Return the options of a network for `plan_network`, None for one station alone."""
    own = {name: given.pop(name) for name in ("stations", "cloudy", "maintenance")}
    if own["stations"] is None:
        for name in ("cloudy", "maintenance", "against"):
            if own.get(name) or given.get(name):
                raise ValueError(f"--{name} is of a plan of a network: give --stations")
        return None
    if not given["all"] and not given["satellites"]:
        raise ValueError("--stations plans many satellites: give --satellites or --all")
    closed: dict[str, list[tuple[str, str]]] = {}
    for name, span in own["maintenance"] or ():
        closed.setdefault(name, []).append(span)
    stations = []
    for text in own["stations"]:
        # A path may hold a colon of its own: what exists is a file.
        name, colon, band = (text, "", "") if Path(text).exists() else text.rpartition(":")
        stations.append(Station(name if colon else text, band if colon else None))
    return {"stations": stations, "cloudy": dict(own["cloudy"] or ()), "maintenance": closed}
