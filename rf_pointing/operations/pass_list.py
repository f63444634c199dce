"""Lists of passes in and out: JSON, CSV, calendars (RFC 5545) and CCSDS simple schedules.

A list of another program needs three columns: target (or catalogue_number, or name), aos_utc
and los_utc.  A calendar needs events with a summary; what `plan_passes` adds as X-properties makes
the way out and back exact.  Jobs of the SatNOGS network are lists as its API gives them.  A simple
schedule (CCSDS 902.1-B) has the target as the user of each package; what is cancelled is left out.
"""

import csv
import io
import json
import math
import re
import warnings
from collections.abc import Iterable, Mapping, Sequence
from datetime import UTC, datetime, timedelta
from typing import Any

from rf_pointing.core import brief, id_of, is_number, parse_json, parse_utc, utc_text
from rf_pointing.operations.schedule import MOST_PASSES, ScheduledPass, require_each_once

_PLANNED = ("", "tracked")
"""Fates of rows of `plan_passes` that a schedule takes, unless all are wanted."""
_PATH = ("aos_azimuth_deg", "azimuth_low_deg", "azimuth_high_deg", "azimuth_end_deg")
_EXACT = "X-RF-POINTING-PASS"
_REPEATED = ("RRULE", "RDATE", "EXRULE", "EXDATE", "RECURRENCE-ID")
_SCHEDULE_SPACE = "urn:ccsds:schema:cssm:1.0.0"
_TRACK = ("beginningOfTrack", "endOfTrack")
_DAY_OF_YEAR = re.compile(r"(\d{4})-(\d{3})(T.*)")
_LARGEST = 1e9
"""Largest number of a row: degrees, hours, priorities."""


def read_passes(text: str, *, every: bool = True) -> list[ScheduledPass]:
    """Return the passes of a text, whatever form it has; ValueError names the row.

    Without `every` only those that `plan_passes` has planned are taken.
    """
    start = text.lstrip("\ufeff \r\n\t")
    rows: list[Any]
    if start.startswith("BEGIN:VCALENDAR"):
        rows = _calendar_rows(start)
    elif start.startswith("<"):
        rows = _simple_schedule_rows(start)
    elif start.startswith(("{", "[")):
        content = parse_json(text)
        given = content.get("passes") if isinstance(content, Mapping) else content
        rows = given if isinstance(given, list) else [None]
        if not all(isinstance(row, Mapping) for row in rows):
            raise ValueError("a schedule in JSON must be a list of passes, or an object with passes")
        rows = [_job_row(row) if "tle1" in row else row for row in rows]
    else:
        try:
            rows = list(csv.DictReader(io.StringIO(start, newline=None)))
        except csv.Error as error:
            raise ValueError(f"not a table: {error}") from error
    if len(rows) > MOST_PASSES:
        raise ValueError(f"a schedule of {len(rows)} passes must have <= {MOST_PASSES}")
    found = [
        _pass_of(number, row) for number, row in enumerate(rows, start=1)
        if every or row.get("fate") in (*_PLANNED, None)
    ]  # fmt: skip
    require_each_once(found)
    return found


def row_of(item: ScheduledPass) -> dict[str, Any]:
    """Return one pass as names and plain values, with the names of `plan_passes`."""
    path = (None,) * 4 if item.azimuth_path_rad is None else item.azimuth_path_rad
    row = {
        "id": item.id, "name": item.name, "target": item.target, "priority": item.priority,
        "aos_utc": utc_text(item.aos_t_s), "los_utc": utc_text(item.los_t_s),
        "peak_elevation_deg": math.degrees(item.peak_rad),
        **{name: None if value is None else math.degrees(value) for name, value in zip(_PATH, path, strict=True)},
        "aos_elevation_deg": math.degrees(item.elevation_rad[0]),
        "los_elevation_deg": math.degrees(item.elevation_rad[1]),
        "antenna": item.antenna, "sensor": item.sensor, "band": item.band,
        "element_age_h": None if math.isnan(item.element_age_s) else item.element_age_s / 3600.0,
        "scan": item.scan, "filler": item.filler,
    }  # fmt: skip
    return {name: round(value, 6) if isinstance(value, float) else value for name, value in row.items()}


def to_json(passes: Iterable[ScheduledPass]) -> str:
    """Return the passes as JSON, one a line."""
    return '{"passes": [\n' + ",\n".join(json.dumps(row_of(item)) for item in passes) + "\n]}\n"


def to_csv(passes: Sequence[ScheduledPass]) -> str:
    """Return the passes as a table."""
    return table_of([row_of(item) for item in passes], "id")


def table_of(rows: Sequence[Mapping[str, Any]], first: str = "name") -> str:
    """Return rows as CSV, with their names, `first` without a row, in the first line."""
    text = io.StringIO()
    writer = csv.DictWriter(text, list(rows[0]) if rows else [first], lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return text.getvalue()


def to_calendar(
    passes: Iterable[ScheduledPass], station: str, now_s: float, remarks: Mapping[str, str] | None = None
) -> str:
    """Return the passes as a calendar; `remarks` are lines of the descriptions by id."""
    from icalendar import Calendar, Event

    calendar = Calendar()
    calendar.add("prodid", "-//rf_pointing//plan_passes//EN")
    calendar.add("version", "2.0")
    calendar.add("x-wr-calname", f"Passes over {station}")
    for item in passes:
        event, name = Event(), item.name or item.target
        event.add("uid", f"{item.id}@rf_pointing")
        event.add("dtstamp", datetime.fromtimestamp(int(now_s), UTC))
        # Calendars have whole seconds; the event holds all of the pass.
        event.add("dtstart", datetime.fromtimestamp(math.floor(item.aos_t_s), UTC))
        event.add("dtend", datetime.fromtimestamp(math.floor(item.los_t_s), UTC) + timedelta(seconds=1))
        event.add("summary", f"{name}, peak {math.degrees(item.peak_rad):.0f} deg")
        event.add("location", item.antenna or station)
        event.add("description", (remarks or {}).get(item.id, f"{item.target}, priority {item.priority}"))
        event.add(_EXACT, json.dumps(row_of(item)))
        calendar.add_component(event)
    return str(calendar.to_ical().decode("utf-8"))


def to_simple_schedule(passes: Sequence[ScheduledPass], station: str, now_s: float) -> str:
    """Return the passes as a simple schedule in XML, a package for each target.

    Source: CCSDS 902.1-B-1, with the structure in which other programs write it; it was not held
    against the schema of the standard.
    """
    from xml.etree import ElementTree

    root = ElementTree.Element("simpleSchedule", xmlns=_SCHEDULE_SPACE, srvMgtEntityType="SIMPLE_SCHEDULE")
    head = {
        "originatingOrganization": station, "generationTime": utc_text(now_s), "status": "OPERATIONAL",
        "inclusionType": "START_INCLUSION", "version": "1",
        "startTime": utc_text(min((each.aos_t_s for each in passes), default=now_s)),
        "endTime": utc_text(max((each.los_t_s for each in passes), default=now_s)),
    }  # fmt: skip
    ElementTree.SubElement(root, "simpleScheduleHeader", head)
    packages: dict[str, ElementTree.Element] = {}
    for item in passes:
        if item.target not in packages:
            about = {"scheduledPackageId": item.target, "user": item.target, "comment": item.name}
            packages[item.target] = ElementTree.SubElement(root, "scheduledPackage", about)
        activity = {
            "scheduledActivityId": item.id, "activityStatus": "COMMITTED", "siteRef": station,
            "apertureRef": item.antenna or station,
            "beginningOfTrack": utc_text(item.aos_t_s), "endOfTrack": utc_text(item.los_t_s),
        }  # fmt: skip
        ElementTree.SubElement(packages[item.target], "scheduledActivity", activity)
    ElementTree.indent(root)
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{ElementTree.tostring(root, encoding="unicode")}\n'


def _simple_schedule_rows(text: str) -> list[dict[str, Any]]:
    from xml.etree.ElementTree import ParseError

    from rf_pointing.core.xml_text import local_name, parse_xml

    try:
        root = parse_xml(text, "schedule")
    except ParseError as error:
        raise ValueError(f"line {error.position[0]}: schedule XML is malformed: {error}") from error
    if local_name(root.tag) != "simpleSchedule":
        raise ValueError(f"<{local_name(root.tag)}> is not a schedule, must be <simpleSchedule> (CCSDS 902.1-B)")
    rows = list[dict[str, Any]]()
    for package in root:
        if local_name(package.tag) != "scheduledPackage":
            continue
        target = package.get("user") or package.get("scheduledPackageId") or ""
        for activity in package:
            if (
                local_name(activity.tag) != "scheduledActivity"
                or "CANCEL" in activity.get("activityStatus", "").upper()
            ):
                continue
            given = activity.attrib
            name = given.get("scheduledActivityId", f"{len(rows) + 1} of {target}")
            if missing := [each for each in _TRACK if each not in given]:
                raise ValueError(f"scheduledActivity {name}: {missing[0]} is missing")
            aos, los = (_day_of_year(given[each]) for each in _TRACK)
            about = package.get("comment", "")
            row = {"id": id_of(name), "target": target, "name": about}
            rows.append({**row, "aos_utc": aos, "los_utc": los})
    return rows


def _day_of_year(text: str) -> str:
    """Return a CCSDS time, which may have the day of the year, as an ISO time."""
    found = _DAY_OF_YEAR.fullmatch(text.strip())
    if not found:
        return text.strip()
    begin = datetime(int(found[1]), 1, 1, tzinfo=UTC) + timedelta(days=int(found[2]) - 1)
    return f"{begin:%Y-%m-%d}{found[3]}"


def _job_row(job: Mapping[str, Any]) -> dict[str, Any]:
    """Return a job of the SatNOGS network, which brings its elements, as a row."""
    begin, end, number = (_text(job, key) for key in ("start", "end", "id"))
    name = _text(job, "tle0").removeprefix("0 ").strip()
    # Numbers of five signs have zeros before them, or a letter.
    target = _text(job, "tle1")[2:7].strip().lstrip("0") or name
    row = {"id": f"satnogs-{number}", "target": target, "name": name}
    return {**row, "aos_utc": begin, "los_utc": end}


def _calendar_rows(text: str) -> list[dict[str, Any]]:
    from icalendar import Calendar

    try:
        with warnings.catch_warnings():
            # Thunderbird's zones have the name of the program before theirs.
            warnings.simplefilter("ignore")
            calendars = Calendar.from_ical(text, multiple=True)
            sent = [each for each in calendars if str(each.get("method", "")).upper() != "CANCEL"]
            events = [event for each in sent for event in each.walk("VEVENT")]
    except (ValueError, IndexError, KeyError) as error:
        raise ValueError(f"not a calendar: {error}") from error
    if not calendars:
        raise ValueError("not a calendar: it has no END:VCALENDAR")
    rows = []
    for event in events:
        exact = event.get(_EXACT)
        if exact is not None:
            row = parse_json(str(exact))
            if not isinstance(row, dict):
                raise ValueError(f"{_EXACT} of {event.get('summary')} must be an object")
            rows.append(row)
            continue
        if str(event.get("status", "")).upper() == "CANCELLED":
            continue
        said = f"event {event.get('summary')}"
        if repeated := next((key for key in _REPEATED if key in event), ""):
            raise ValueError(f"{said} has {repeated}: repeated events are not read, give every pass its own")
        begin, end, length = (event.decoded(key, None) for key in ("dtstart", "dtend", "duration"))
        if end is None and isinstance(begin, datetime) and isinstance(length, timedelta):
            end = begin + length
        if not isinstance(begin, datetime) or not isinstance(end, datetime):
            raise ValueError(f"{said} must have dtstart, and dtend or duration, with a time of day")
        zones = [event[key].params.get("TZID") for key in ("dtstart", "dtend") if key in event]
        floating = begin.tzinfo is None or end.tzinfo is None
        if floating and (unknown := next(filter(None, zones), "")):
            raise ValueError(f"{said} has a time in a zone that is not known, TZID={unknown}: write Z")
        if floating:
            raise ValueError(f"{said} has a time without a zone, {begin.isoformat()}: write Z or TZID")
        times = {key: utc_text(when.timestamp()) for key, when in (("aos_utc", begin), ("los_utc", end))}
        rows.append({"target": re.split(r",\s*peak", str(event.get("summary") or ""))[0].strip(), **times})
    return rows


def _pass_of(number: int, row: Mapping[str, Any]) -> ScheduledPass:
    try:
        target = next(filter(None, (_text(row, key) for key in ("target", "catalogue_number", "name"))), "")
        aos_t_s, los_t_s = parse_utc(str(row["aos_utc"])), parse_utc(str(row["los_utc"]))
        path = tuple(_number(row, key) for key in _PATH)
        known = all(math.isfinite(value) for value in path)
        return ScheduledPass(
            id=_text(row, "id"), target=target, name=_text(row, "name") or target,
            priority=_whole(row, "priority"), aos_t_s=aos_t_s, los_t_s=los_t_s,
            peak_rad=math.radians(_number(row, "peak_elevation_deg", 0.0)),
            azimuth_path_rad=_radians(path) if known else None,
            elevation_rad=(
                math.radians(_number(row, "aos_elevation_deg", 0.0)),
                math.radians(_number(row, "los_elevation_deg", 0.0)),
            ),
            antenna=_text(row, "antenna"), sensor=_text(row, "sensor"), band=_text(row, "band"),
            element_age_s=3600.0 * _number(row, "element_age_h"), scan=_text(row, "scan"),
            filler=_flag(row, "filler"),
        )  # fmt: skip
    except KeyError as error:
        raise ValueError(f"row {number}: {error.args[0]} is missing") from None
    except (ValueError, TypeError) as error:
        raise ValueError(f"row {number}: {error}") from error


def _radians(path: tuple[float, ...]) -> tuple[float, float, float, float]:
    begin, low, high, end = map(math.radians, path)
    return begin, low, high, end


def _text(row: Mapping[str, Any], key: str) -> str:
    value = row.get(key)
    if value is not None and type(value) not in (str, int):
        raise ValueError(f"{key}={brief(value)} must be a text")
    return str(value or "")


def _number(row: Mapping[str, Any], key: str, missing: float = math.nan) -> float:
    value = row.get(key)
    if value in (None, ""):
        return missing
    try:
        # All that a table holds is text.
        found = float(value) if isinstance(value, str) else value
    except ValueError:
        found = value
    if not is_number(found, -_LARGEST, _LARGEST):
        raise ValueError(f"{key}={brief(value)} must be a number from -{_LARGEST:g} to {_LARGEST:g}")
    return float(found)


def _flag(row: Mapping[str, Any], key: str) -> bool:
    value = row.get(key)
    if value not in (None, "", True, False, "True", "False", "true", "false"):
        raise ValueError(f"{key}={brief(value)} must be true or false")
    return value in (True, "True", "true")


def _whole(row: Mapping[str, Any], key: str) -> int:
    found = _number(row, key, 0.0)
    if found != int(found):
        raise ValueError(f"{key}={brief(row[key])} must be a whole number")
    return int(found)
