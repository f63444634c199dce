"""`plan_passes --satellites` or `--all`: the plan of one antenna for many satellites.

Every pass is listed with what becomes of it: tracked (with its branch), yields (to which pass, and
why), or barred (by travel, Sun, keyhole).  Written as a table, JSON, CSV, a calendar of the tracked
passes (RFC 5545), and a picture.  Passes that are kept for any other reason are named.

A list of satellites is a text file, one satellite a line; `#` begins a comment:

    25544, priority=5, peak=20    # ISS, passes that peak above 20 deg
    CBERS 2
"""

import argparse
import csv
import io
import json
import math
import re
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from rf_pointing.commands.options import elements_of, lowest_rad, say, source_of, station_of
from rf_pointing.core import to_degrees
from rf_pointing.core.dates import DAY_S, parse_utc, utc_text
from rf_pointing.core.whole_file import write_whole
from rf_pointing.ephemeris import Elements, find_elements
from rf_pointing.ephemeris.source import load_catalogue
from rf_pointing.ephemeris.uncertainty import error_text
from rf_pointing.operations.pass_list import read_passes, to_calendar
from rf_pointing.station.pointing.certificates import PlanningRules
from rf_pointing.station.pointing.multi_satellite_plan import DayPass, DayPlan, Fate, Wish, plan_day

PRIORITIES = (-1000, 1000)
MOST_ERRORS = 10
"""Of a list of satellites so many errors are reported at once."""


def plan_many(options: argparse.Namespace, rules: PlanningRules, encoder_rad: tuple[float, float]) -> DayPlan:
    """Return the plan of the satellites that the command line names."""
    wishes = wishes_of(options)
    return plan_day(
        wishes, station_of(options).site, _start_s(options, wishes), options.hours * 3600.0, rules, encoder_rad,
        lowest_rad(options), gap_s=options.gap, max_age_s=source_of(options).max_age_days * DAY_S,
    )  # fmt: skip


def wishes_of(options: argparse.Namespace) -> list[Wish]:
    """Return the satellites of the catalogue to plan for; ValueError names all that are wrong."""
    catalogue = load_catalogue(elements_of(options))
    least = options.min_peak
    if options.all:
        return [Wish(elements=one, min_peak_rad=math.radians(least)) for one in catalogue]
    by_number = {one.catalogue_number: one for one in catalogue}
    by_name: dict[str, list[Elements]] = {}
    for one in catalogue:
        by_name.setdefault(one.name.casefold(), []).append(one)
    found: dict[int, Wish] = {}
    errors: list[str] = []
    for place, text in _entries(options.satellites):
        try:
            name, priority, peak_deg = _entry(text, least)
            same = by_name.get(name.casefold(), [])
            if name.isdecimal() and int(name) in by_number:
                same = [by_number[int(name)]]
            # An unknown name, or one of several objects, is refused there with what is near.
            elements = same[0] if len(same) == 1 else find_elements(catalogue, name)
            if elements.catalogue_number in found:
                raise ValueError(f"satellite={name!r} is named twice")
            wish = Wish(elements=elements, priority=priority, min_peak_rad=math.radians(peak_deg))
            found[elements.catalogue_number] = wish
        except ValueError as error:
            errors.append(f"{place}{error}")
    if errors:
        more = [f"and {len(errors) - MOST_ERRORS} more"] if len(errors) > MOST_ERRORS else []
        raise ValueError("\n".join([*errors[:MOST_ERRORS], *more]))
    if not found:
        raise ValueError(f"satellites={' '.join(options.satellites)} names no satellite")
    return list(found.values())


def _entries(satellites: Sequence[str]) -> Iterator[tuple[str, str]]:
    """Give what the command line and its list files name, with the place of a line of a file."""
    for one in satellites:
        path = Path(one)
        if not path.is_file():
            yield "", one
            continue
        try:
            lines = path.read_text(encoding="utf-8-sig").splitlines()
        except UnicodeDecodeError as error:
            raise ValueError(f"{one} is no list of satellites: {error}") from error
        for number, line in enumerate(lines, start=1):
            # A name may hold a `#` of its own, as FENGYUN #2 does; a comment has blanks around it.
            text = re.sub(r"(^|\s)#\s.*|^#.*", "", line).strip()
            if text:
                yield f"{path.name}, line {number}: ", text


def _entry(text: str, least_peak_deg: float) -> tuple[str, int, float]:
    """Return name or number, priority and least peak of NAME, priority=N, peak=DEG."""
    parts = [part.strip() for part in text.split(",")]
    # A name may hold commas; what has an equals sign is none.
    cut = next((k for k, part in enumerate(parts) if "=" in part and k > 0), len(parts))
    priority, peak_deg = 0, least_peak_deg
    for part in parts[cut:]:
        key, _, value = (word.strip() for word in part.partition("="))
        if key == "priority":
            if not re.fullmatch(r"-?\d{1,9}", value) or not PRIORITIES[0] <= int(value) <= PRIORITIES[1]:
                raise ValueError(f"priority={value} must be a whole number from {PRIORITIES[0]} to {PRIORITIES[1]}")
            priority = int(value)
        elif key == "peak":
            if not re.fullmatch(r"\d{1,2}(\.\d*)?", value) or float(value) > 90.0:
                raise ValueError(f"peak={value} must be a number from 0 to 90 deg")
            peak_deg = float(value)
        else:
            raise ValueError(f"{part!r} is unknown: after the satellite come priority=N and peak=DEG")
    return ",".join(parts[:cut]), priority, peak_deg


def _start_s(options: argparse.Namespace, wishes: Sequence[Wish]) -> float:
    """Return the start of the plan: as given; now, while the elements last; else their epoch."""
    if options.start:
        return parse_utc(options.start)
    newest_s, now_s = max(wish.elements.epoch_t_s for wish in wishes), time.time()
    oldest_s = source_of(options).max_age_days * DAY_S - options.hours * 3600.0
    return now_s if abs(now_s - newest_s) <= oldest_s else newest_s


def report(options: argparse.Namespace, plan: DayPlan, rules: PlanningRules) -> None:
    """Print and write the plan in the forms that were chosen."""
    beamwidth_rad = rules.machine.half_power_beamwidth_rad
    rows = [row_values(item, beamwidth_rad) for item in plan.passes] if options.json or options.csv else []
    if options.json:
        print(json_text(plan, rows, station_of(options).name))
    else:
        show_table(plan)
    for one, reason in plan.unsearched:
        say("plan_passes", f"{one.name} was not searched: {reason}")
    warning = stale_text(plan, source_of(options).stale_days * DAY_S, beamwidth_rad)
    if warning:
        say("plan_passes", warning)
    if options.csv:
        write_whole(Path(options.csv), csv_text(rows))
        say("plan_passes", options.csv)
    if options.ics:
        write_whole(Path(options.ics), calendar_text(plan, station_of(options).name, time.time(), beamwidth_rad))
        say("plan_passes", options.ics)
    if options.picture:
        from rf_pointing.report.day_picture import draw_day

        draw_day(plan, station_of(options).name, rules.mask, Path(options.picture))
        say("plan_passes", options.picture)


def row_values(item: DayPass, beamwidth_rad: float) -> dict[str, Any]:
    """Return one pass as names and plain values: times in UTC, angles in degrees."""
    window = item.window
    values: dict[str, Any] = {"name": window.name, "catalogue_number": window.elements.catalogue_number}
    values |= {"priority": item.priority, "fate": str(item.fate), "reason": item.reason}
    values |= {f"{name}_utc": utc_text(getattr(window, f"{name}_t_s")) for name in ("aos", "tca", "los")}
    values["duration_s"] = window.duration_s
    names = ("peak_elevation_rad", "aos_azimuth_rad", "tca_azimuth_rad", "los_azimuth_rad", "tca_azimuth_rate_rad_s")
    values |= dict(to_degrees(name, getattr(window, name)) for name in names)
    # Continuous from the rise on: what a schedule needs to know of the turns between two passes.
    low, high, end = window.azimuth_path_rad[1:]
    names_of_path = {"azimuth_low_rad": low, "azimuth_high_rad": high, "azimuth_end_rad": end}
    names_of_path |= {"aos_elevation_rad": window.aos_elevation_rad, "los_elevation_rad": window.los_elevation_rad}
    values |= dict(to_degrees(name, value) for name, value in names_of_path.items())
    values |= {"tca_range_m": window.tca_range_m, "rises_before": window.rises_before, "sets_after": window.sets_after}
    values["element_age_h"] = item.age_s / 3600.0
    values |= {
        "along_track_sigma_deg": math.degrees(item.along_rad),
        "along_track_sigma_beams": item.along_rad / beamwidth_rad,
    }
    branch = item.certificate.chosen if item.certificate else None
    values |= {"branch": branch.label if branch else None, "keyhole_s": branch.keyhole_s if branch else None}
    values |= {"lost_s": branch.lost_s if branch else None, "slew_s": branch.preposition_s if branch else None}
    sun_deg = math.degrees(float(item.profile.sun_angle_rad().min())) if item.profile else None
    values["sun_angle_deg"] = sun_deg
    # Below a microsecond and a microdegree no digit means anything.
    return {name: round(value, 6) if isinstance(value, float) else value for name, value in values.items()}


def json_text(plan: DayPlan, rows: Sequence[dict[str, Any]], station: str) -> str:
    """Return a plan with its passes, as `row_values`, a pass a line."""
    head = {
        "station": station,
        "start_utc": utc_text(plan.start_t_s),
        "end_utc": utc_text(plan.start_t_s + plan.duration_s),
        "unsearched": [{"name": one.name, "reason": reason} for one, reason in plan.unsearched],
    }
    # Indented, a day of 10 000 satellites takes ten times as long to write.
    lines = ",\n".join(json.dumps(row) for row in rows)
    return f'{json.dumps(head)[:-1]}, "passes": [\n{lines}\n]}}'


def csv_text(rows: Sequence[dict[str, Any]]) -> str:
    """Return one line for every pass, with the names of `row_values` in the first one."""
    text = io.StringIO()
    writer = csv.DictWriter(text, list(rows[0]) if rows else ["name"], lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return text.getvalue()


def calendar_text(plan: DayPlan, station: str, now_s: float, beamwidth_rad: float) -> str:
    """Return the tracked passes as a calendar (RFC 5545)."""
    tracked = [item for item in plan.passes if item.fate is Fate.TRACKED]
    passes = read_passes(json.dumps([row_values(item, beamwidth_rad) for item in tracked]))
    remarks = {one.id: _remark(item) for one, item in zip(passes, tracked, strict=True)}
    return to_calendar(passes, station, now_s, remarks)


def _remark(item: DayPass) -> str:
    window, chosen = item.window, item.certificate.chosen if item.certificate else None
    branch, peak_deg = chosen.label if chosen else "", math.degrees(window.peak_elevation_rad)
    return (
        f"Catalogue number {window.elements.catalogue_number}, priority {item.priority}, branch {branch}\n"
        f"Closest approach {utc_text(window.tca_t_s)}, {peak_deg:.2f} deg"
    )


def stale_text(plan: DayPlan, stale_s: float, beamwidth_rad: float) -> str:
    """Return "" or the number of satellites with stale elements, and the worst one's error."""
    stale = [item for item in plan.passes if item.age_s > stale_s and item.fate is Fate.TRACKED]
    if not stale:
        return ""
    worst = max(stale, key=lambda item: item.along_rad)
    names = {item.window.elements.catalogue_number for item in stale}
    return (
        f"stale elements of {len(names)} tracked satellites, older than {stale_s / DAY_S:g} days; the worst, "
        f"{worst.window.name}: {worst.age_s / DAY_S:.1f} days, {error_text(worst.along_rad, beamwidth_rad)}"
    )


def show_table(plan: DayPlan) -> None:
    """Print one line for every pass; < and > mark one cut off at an end of the searched time."""
    header = (
        f"{'satellite':<24} {'prio':>4} {'AOS (UTC)':<24}  {'TCA':<12} {'LOS':<12}  {'s':>6} {'peak':>6} "
        f"{'azimuth deg':>17}  plan"
    )
    print(header if plan.passes else "no pass")
    for item in plan.passes:
        window, branch = item.window, item.certificate.chosen if item.certificate else None
        azimuths = " ".join(
            f"{math.degrees(getattr(window, f'{name}_azimuth_rad')):5.1f}" for name in ("aos", "tca", "los")
        )
        aos, tca, los = (utc_text(getattr(window, f"{name}_t_s")) for name in ("aos", "tca", "los"))
        fate = f"{branch.label}, {branch.lost_s:.1f} s lost" if branch else item.reason
        print(
            f"{window.name:<24.24} {item.priority:>4} {aos}{'<' if window.rises_before else ' '} {tca[11:23]} "
            f"{los[11:23]}{'>' if window.sets_after else ' '} {window.duration_s:6.0f} "
            f"{math.degrees(window.peak_elevation_rad):6.2f} {azimuths}  {item.fate}: {fate}"
        )
    counts = {fate: sum(item.fate is fate for item in plan.passes) for fate in Fate}
    print(f"{len(plan.passes)} passes: " + ", ".join(f"{count} {fate}" for fate, count in counts.items()))
