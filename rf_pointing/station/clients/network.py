"""Several antennas on one screen: a line for each, the worst first, and each alarm once.

Lines are made of the boards of the antennas (`board.py`) and are plain values, as there.  Times of
passes count from the present of their antenna, which in a simulation is not that of the computer.
"""

import math
import re
from collections import defaultdict
from collections.abc import Mapping, Sequence
from typing import Any

from rf_pointing.core.dates import parse_utc
from rf_pointing.station.clients.board import RUNNING_S, Board

OK, WARNING, ERROR, FAULT = range(4)
"""Levels of a line: those of /diagnostics, and a latched fault."""
SILENT_S = 5.0
"""An antenna of which nothing has arrived for so long is silent."""
AHEAD_S, BEHIND_S = 0.1, 1.5
"""Largest offsets of a clock; a status may be a second old when it is looked at."""
PLAN_S = -2.0 * 3600.0, 22.0 * 3600.0
"""The day of the plan, from the present of an antenna."""
PLAN_PASSES = 100
"""Passes of an antenna that the plan shows at most."""
OPEN = ("waiting", "active", "standby")
"""States of a pass that is not over."""
TOPIC_TYPE = "rf_pointing_msgs/msg/AntennaStatus"
# Alarms of station_alarms are one text: a name, a colon and a sentence of each.
NEXT_ALARM = re.compile(r"; (?=[a-z][a-z0-9_ ]*: )")

Finding = tuple[int, str]
"""A level, and what an operator reads."""


def clock_finding(ahead_s: Sequence[float], *, simulated: bool) -> list[Finding]:
    """Return what is wrong with a clock whose newest stamps were so far ahead of this computer's.

    A stamp that waited looks too old, so the largest one counts.
    """
    if simulated or not ahead_s or -BEHIND_S <= max(ahead_s) <= AHEAD_S:
        return []
    words = f"{abs(max(ahead_s)):.1f} s {'ahead of' if max(ahead_s) > 0.0 else 'behind'}"
    return [(ERROR, f"its clock is {words} this computer's")]


def findings_of(board: Board, live: Mapping[str, Any]) -> list[Finding]:
    """Return what is wrong with an antenna, as far as it reports it itself."""
    age_s = board.age_s
    if age_s.get("antenna", math.inf) > SILENT_S:
        words = f"silent for {age_s['antenna']:.0f} s" if "antenna" in age_s else "nothing received"
        return [(ERROR, words)]
    found = [(FAULT, f"fault latched: {live['fault']}")] if live.get("fault") else []
    for alarm in alarms_of(board):
        level = min(alarm["level"], WARNING if alarm["acknowledged"] else ERROR)
        found.append((level, f"{alarm['name'].replace('_', ' ')}: {alarm['message']}"))
    if live.get("alarm"):
        found.append((min(live.get("level", WARNING), ERROR), live["alarm"]))
    found += [(WARNING, live[name]) for name in ("warning", "high_wind") if live.get(name)]
    for node in board.nodes:
        if node["silent_s"]:
            found.append((ERROR, f"{node['name']} is silent for {node['silent_s']} s"))
        else:
            checks = (each for each in node["checks"] if each[1] and each[0] != "alarms")
            found += [(min(level, ERROR), f"{node['name']}: {words}") for _, level, words in checks]
    return found


def alarms_of(board: Board) -> list[dict[str, Any]]:
    """Return the lasting alarms: of the executive, or without one of `station_alarms`."""
    if board.age_s.get("executive", math.inf) <= RUNNING_S:
        alarms: list[dict[str, Any]] = board.kept["executive"]["alarms"]
        return alarms
    checks = [
        each for node in board.nodes if node["name"] == "station_alarms" and not node["silent_s"]
        for each in node["checks"] if each[0] == "alarms" and each[2] != "none"
    ]  # fmt: skip
    # The level of the check is the worst one that nobody has acknowledged.
    return [
        {"name": name, "message": message, "level": max(level, WARNING),
         "acknowledged": not level, "raised_utc": ""}
        for _, level, text in checks
        for name, _, message in (part.partition(": ") for part in NEXT_ALARM.split(text))
    ]  # fmt: skip


def antenna_line(
    namespace: str, board: Board, live: Mapping[str, Any], found: Sequence[Finding]
) -> dict[str, Any]:  # fmt: skip
    """Return the line of an antenna; `found` are findings of others than itself."""
    findings = sorted([*findings_of(board, live), *found], key=lambda each: -each[0])
    level, words = findings[0] if findings else (OK, "")
    silent = board.age_s.get("antenna", math.inf) > SILENT_S
    line = {
        "antenna": namespace, "name": board.kept["station"]["name"], "level": level, "worst": words,
        "more": [text for _, text in findings[1:]], "mode": "", "pointing": "", "target": "",
        "carrier": None, "beamwidths": None, "next": next_pass(board, live),
        "plan": plan_of(board, live),
    }  # fmt: skip
    if silent:
        return line | {"next": {"text": "not known"}}
    line["mode"] = live["antenna"]
    fresh = board.age_s.get("tracking", math.inf) <= SILENT_S
    if not fresh or live["tracking"] in ("", "idle"):
        return line
    off, carrier = live.get("error_beamwidths") or (), live["carrier_to_noise_db_hz"]
    return line | {
        "pointing": live["tracking"], "target": live["target"],
        "beamwidths": round(math.hypot(*off), 4) if off else None,
        "carrier": carrier if carrier > 0.0 else None,
    }  # fmt: skip


def next_pass(board: Board, live: Mapping[str, Any]) -> dict[str, Any]:
    """Return the next pass: `target` and `in_s`, or `text` without one.

    That in progress has `left_s`.
    """
    now_s, rows = live.get("t_s", 0.0), board.kept.get("schedule", [])
    coming = [row for row in rows if row["state"] in OPEN and parse_utc(row["los_utc"]) > now_s]
    if not coming and rows:
        over_h = (now_s - max(parse_utc(row["los_utc"]) for row in rows)) / 3600.0
        words = f"plan is over since {over_h:.1f} h"
        return {"text": words if over_h > 0.0 else "no pass left to track"}
    selected = board.kept.get("passes", {"rows": []})["rows"]
    coming = coming or [row for row in selected if parse_utc(row["los_utc"]) > now_s]
    if not coming:
        return {"text": "no plan"}
    aos_s, los_s = parse_utc(coming[0]["aos_utc"]), parse_utc(coming[0]["los_utc"])
    left = {"left_s": round(los_s - now_s)} if aos_s <= now_s else {"in_s": round(aos_s - now_s)}
    return {"target": coming[0]["target"], **left}


def plan_of(board: Board, live: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Return the passes of the day of an antenna's schedule, in s from its present."""
    now_s, found = live.get("t_s", 0.0), list[dict[str, Any]]()
    for row in board.kept.get("schedule", []):
        begin_s, end_s = parse_utc(row["aos_utc"]) - now_s, parse_utc(row["los_utc"]) - now_s
        if begin_s < PLAN_S[1] and end_s > PLAN_S[0]:
            values = {name: row[name] for name in ("target", "state")}
            found.append({**values, "begin_s": round(begin_s), "end_s": round(end_s)})
    return found[:PLAN_PASSES]


def with_same_names(lines: Sequence[Mapping[str, Any]]) -> list[Mapping[str, Any]]:
    """Return the lines, with a warning on those whose name is that of another antenna as well."""
    found = list[Mapping[str, Any]]()
    for line in lines:
        same = (each for each in lines if each["name"] == line["name"] and each is not line)
        others = sorted(each["antenna"] for each in same)
        if line["name"] and others:
            words = f"the name {line['name']!r} is that of {', '.join(others)}, too"
            if line["level"] >= WARNING:
                line = {**line, "more": [*line["more"], words]}
            else:
                line = {**line, "level": WARNING, "worst": words}
        found.append(line)
    return found


def worst_first(lines: Sequence[Mapping[str, Any]]) -> list[Mapping[str, Any]]:
    """Return the lines by level, then by namespace, numbers in it by their value."""

    def order(line: Mapping[str, Any]) -> tuple[Any, ...]:
        parts = re.split(r"(\d+)", line["antenna"])
        by_value = [int(each) if each.isdecimal() else each for each in parts]
        return -line["level"], by_value, line["antenna"]

    return sorted(lines, key=order)


def merged_alarms(alarms: Mapping[str, Sequence[Mapping[str, Any]]]) -> list[dict[str, Any]]:
    """Return each alarm once, with the antennas that have it.

    `alarms` are those of each namespace.  Those that somebody has to acknowledge come first, then
    the worse ones.  The message is that of the worst antenna, `messages` has all by namespace.
    """
    having = defaultdict[str, dict[str, Mapping[str, Any]]](dict)
    for antenna, its in alarms.items():
        for row in its:
            having[row["name"]][antenna] = row
    found = []
    for name, rows in having.items():
        worst = max(rows.values(), key=lambda row: (not row["acknowledged"], row["level"]))
        found.append({
            "name": name, "level": max(row["level"] for row in rows.values()),
            "message": worst["message"],
            "messages": {antenna: row["message"] for antenna, row in rows.items()},
            "open": [antenna for antenna, row in rows.items() if not row["acknowledged"]],
            "raised_utc": min(row["raised_utc"] for row in rows.values()),
        })  # fmt: skip
    return sorted(found, key=lambda each: (not each["open"], -each["level"], each["name"]))
