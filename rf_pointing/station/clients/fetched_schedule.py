"""Schedules of http(s) addresses: jobs of a network, calendars and simple schedules.

An address answers with any list that `read_passes` takes; a CalDAV collection is requested with
REPORT (RFC 4791).  The rules of requests are those of elements (`ephemeris/fetching.py`).  What
becomes of the jobs of the SatNOGS network goes back as metadata of its observations.
"""

import base64
import json
import re
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any
from urllib.parse import urljoin, urlsplit

from rf_pointing.core import DATA_BYTES, DAY_S, KeptState, parse_json, read_whole, utc_text
from rf_pointing.ephemeris.fetching import Contents, Outcome, Question, Record, send
from rf_pointing.operations.pass_list import read_passes
from rf_pointing.operations.schedule import ScheduledPass

RULE_S = 300.0
"""Time between two requests of a schedule where its source has no rule."""
_CALDAV_SPACE = "urn:ietf:params:xml:ns:caldav"
_JOB = re.compile(r"satnogs-(\d+)")
_UNTOUCHED = ("waiting", "yields", "active")
"""States of passes of which nothing can be reported yet."""


def _noted(text: str, requested: Record) -> Record:
    return replace(requested, objects=len(read_passes(text, every=False)))


def _calendars(text: str) -> str:
    """Return an answer as it is, but of an answer of CalDAV the calendars in it."""
    if "multistatus" not in text[:500]:
        return text
    from xml.etree.ElementTree import ParseError

    from rf_pointing.core.xml_text import local_name, parse_xml

    try:
        answer = parse_xml(text, "CalDAV")
    except ParseError as error:
        raise ValueError(f"line {error.position[0]}: CalDAV XML is malformed: {error}") from error
    found = [each.text or "" for each in answer.iter() if local_name(each.tag) == "calendar-data"]
    # No event in the time is a schedule too.
    return "\n".join(each.strip() for each in found) or "BEGIN:VCALENDAR\nVERSION:2.0\nEND:VCALENDAR\n"


SCHEDULES = Contents(
    name="schedule", whole="schedule", command="fetch_schedule", note=_noted, text=_calendars,
    suffix=".schedule", rule_s=RULE_S, shrinks=True,
)  # fmt: skip


def question(address: str, secret: str, *, caldav_days: float = 0.0, now_s: float = 0.0) -> Question:
    """Return how a schedule is requested.

    Parameters
    ----------
    secret : "user:password", or a token; "" for none.
    caldav_days : days from `now_s` (UTC in s) on of which a CalDAV collection gives its events; 0
        for a plain address.
    """
    headers = _authorization(address, secret)
    if not caldav_days:
        return Question(headers=headers)
    begin, end = (re.sub(r"[-:]|\.\d+", "", utc_text(t_s)) for t_s in (now_s - DAY_S, now_s + caldav_days * DAY_S))
    body = (
        f'<?xml version="1.0" encoding="UTF-8"?><c:calendar-query xmlns:d="DAV:" xmlns:c="{_CALDAV_SPACE}">'
        '<d:prop><c:calendar-data/></d:prop><c:filter><c:comp-filter name="VCALENDAR">'
        f'<c:comp-filter name="VEVENT"><c:time-range start="{begin}" end="{end}"/></c:comp-filter>'
        "</c:comp-filter></c:filter></c:calendar-query>"
    )
    return Question(
        method="REPORT", body=body,
        headers={**headers, "Depth": "1", "Content-Type": "application/xml; charset=utf-8"},
    )  # fmt: skip


def passes_to_come(outcome: Outcome, now_s: float) -> list[ScheduledPass]:
    """Return the passes of a kept schedule that have not ended, in order of rise."""
    found = read_passes(read_whole(outcome.file, DATA_BYTES), every=False)
    return sorted((each for each in found if each.los_t_s > now_s), key=lambda each: each.aos_t_s)


def report_results(address: str, night: Path, secret: str, folder: Path, *, timeout_s: float = 60.0) -> list[str]:
    """Tell the SatNOGS network what has become of its jobs, each once; return a line for each.

    Parameters
    ----------
    address : that of the jobs.
    night : `night.json` of a morning report.
    folder : where it is kept what has been reported.

    Raises
    ------
    ValueError
        A file without the passes of a night, and an address without jobs.
    """
    base, found, _ = address.partition("/jobs")
    if not found:
        raise ValueError(f"address {address!r} must be that of jobs, such as https://network.satnogs.org/api/jobs/")
    asked = replace(question(address, secret), method="PUT")
    content = parse_json(read_whole(night, DATA_BYTES))
    rows = content.get("passes") if isinstance(content, Mapping) else None
    if not isinstance(rows, list) or not all(isinstance(row, Mapping) for row in rows):
        raise ValueError(f"{night} must be the night.json of a morning report")
    state = KeptState(str(folder / f".reported-{urlsplit(address).hostname}.json"))
    folder.mkdir(parents=True, exist_ok=True)
    done, lines = dict(state.recover()), list[str]()
    for row in rows:
        job = _JOB.fullmatch(str(row.get("id")))
        if job is None or row.get("state") in _UNTOUCHED or job[1] in done:
            continue
        values = {key: row.get(key) for key in ("state", "reason", "tracked_s", "lost_s", "loss_db", "causes")}
        sent = {"client_version": "rf_pointing", "client_metadata": json.dumps(values)}
        status, said = send(urljoin(f"{base}/", f"observations/{job[1]}/"), sent, asked, timeout_s)
        lines.append(f"observation {job[1]}, {row.get('state')}: {status} {said}")
        # A server in trouble gets it again with the next call; one that refuses does not.
        if 0 < status < 500:
            done[job[1]] = f"{status} {said}"
            state.keep(done)
    return lines


def _authorization(address: str, secret: str) -> dict[str, Any]:
    if not secret:
        return {}
    if ":" in secret:
        return {"Authorization": f"Basic {base64.b64encode(secret.encode()).decode()}"}
    kind = "Token" if "/jobs" in urlsplit(address).path else "Bearer"
    return {"Authorization": f"{kind} {secret}"}
