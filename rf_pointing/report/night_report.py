"""The morning report: one page of a night, `night.html`, the same as `night.json`, and the index.

First what there is to do today; then a line for each pass with its own causes and its report;
alarms; what the station ran on.  `index.html` lists the nights of a folder, and their trend.
"""

import json
import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any
from urllib.parse import quote

from rf_pointing.core import DATA_BYTES, parse_json, read_whole, utc_text, write_whole
from rf_pointing.operations.alarms import AlarmBook
from rf_pointing.operations.pass_work import PassRecord, causes_between, clock_text, filler_text, fillers_of
from rf_pointing.report.error_ledger import shorts
from rf_pointing.report.html import render

STALE_H = 48.0
WIDTH, LANE = 1080.0, 26.0
TRACKED = "tracked"
BY_CHOICE = ("skipped", "yields")
"""States of passes that an operator or the plan has left out: nobody has lost them."""
MOST_NIGHTS = 400


@dataclass(frozen=True)
class NightAlarm:
    """One alarm from its raise to its end; `until_t_s` is None while it lasts."""

    name: str
    level: int
    message: str
    raised_t_s: float
    until_t_s: float | None
    acknowledged: bool


@dataclass(frozen=True, kw_only=True)
class NightReport:
    """Everything on the page."""

    station: str
    begun_t_s: float
    ended_t_s: float
    passes: tuple[PassRecord, ...]
    alarms: tuple[NightAlarm, ...]
    yielded: int
    messages: int
    to_do: tuple[str, ...]
    health: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)

    @property
    def tracked(self) -> int:
        """Passes that count as tracked."""
        return sum(each.state == TRACKED for each in self.chosen)

    @property
    def chosen(self) -> tuple[PassRecord, ...]:
        """Passes that were to be tracked, without those that filled gaps."""
        wanted = (each for each in self.passes if not each.filler)
        return tuple(each for each in wanted if each.state not in BY_CHOICE)

    @property
    def held_share(self) -> float:
        """Share of the time of the passes that were to be tracked in which the target was held."""
        planned_s = sum(each.los_t_s - each.aos_t_s for each in self.chosen)
        return sum(each.tracked_s for each in self.chosen) / planned_s if planned_s else 0.0


def night_of(
    state: Mapping[str, Any], station: str, *, health: Mapping[str, Mapping[str, Any]] | None = None,
    ended_t_s: float | None = None,
) -> NightReport:  # fmt: skip
    """Return the report of the kept state of a night."""
    priorities = {row["pass"]["id"]: row["pass"]["priority"] for row in state["schedule"]}
    rows = sorted(state["records"], key=lambda row: row["aos_t_s"])
    book = AlarmBook(lambda *_: None)
    book.restore(state["alarms"])
    passes = tuple(
        PassRecord(**{**row, "causes": _causes(row, book), "priority": priorities.get(row["id"], 0)}) for row in rows
    )
    history = [tuple(row) for row in state["alarms"]["history"]]
    alarms = _alarms(history)
    last_s = max([each.los_t_s for each in passes] + [row[0] for row in history], default=0.0)
    begun_s = last_s if state["begun_s"] is None else state["begun_s"]
    known = dict(health or {})
    return NightReport(
        station=station, begun_t_s=begun_s, ended_t_s=max(begun_s + 1.0, ended_t_s or last_s), passes=passes,
        alarms=alarms, yielded=sum(row["state"] == "yields" for row in state["schedule"]), messages=book.messages,
        to_do=_to_do(passes, alarms, state["alarms"]["alarms"], known), health=known,
    )  # fmt: skip


def _causes(row: Mapping[str, Any], book: AlarmBook) -> tuple[str, ...]:
    """Return the causes of a pass; an alarm that lasted when the pass ended has its end by now."""
    alarms = tuple(f"{name} " for name in book.alarms)
    own = [each for each in row["causes"] if not each.startswith(alarms)]
    return tuple(dict.fromkeys([*causes_between(book, row["aos_t_s"], row["los_t_s"]), *own]))


def _alarms(history: Sequence[tuple[Any, ...]]) -> tuple[NightAlarm, ...]:
    """Return each alarm with its end, from what happened to all of them in order."""
    found: list[NightAlarm] = []
    open_: dict[str, int] = {}
    for t_s, event, name, level, message in history:
        if event == "raised":
            open_[name] = len(found)
            found.append(NightAlarm(name, level, message, t_s, None, False))
        elif name in open_:
            changes = {"cleared": {"until_t_s": t_s}, "acknowledged": {"acknowledged": True}, "worse": {"level": level}}
            found[open_[name]] = replace(found[open_[name]], **changes.get(event, {}))
    return tuple(found)


def _to_do(
    passes: Sequence[PassRecord], alarms: Sequence[NightAlarm], kept: Sequence[Mapping[str, Any]],
    health: Mapping[str, Mapping[str, Any]],
) -> tuple[str, ...]:  # fmt: skip
    """Return what an operator should do today, the most urgent first."""
    asks = {each["name"]: each["ask"] for each in kept}
    lasting = [each for each in alarms if each.until_t_s is None]
    lasting.sort(key=lambda each: -each.level)
    rows = [f"{each.message}: {asks.get(each.name) or 'look into it'}" for each in lasting]
    old = sorted({each.name for each in passes if (each.element_age_h or 0.0) > STALE_H})
    if old and not any(each.name == "stale_elements" for each in lasting):
        rows.append(f"fetch newer elements of {_listed(old)}: older than {STALE_H:.0f} h")
    again = sorted(Counter(each.name for each in alarms).items())
    rows += [f"{name} came {n} times in the night: find out why" for name, n in again if n >= 3]
    blameless = TRACKED, "weather", *BY_CHOICE
    lost = [each for each in passes if each.state not in blameless and not each.filler]
    if lost:
        names = _listed([each.name for each in lost])
        rows.append(f"{len(lost)} passes were lost ({names}): plan them again if needed")
    bare = [each for each in passes if each.state == TRACKED and not each.recorded]
    if bare:
        rows.append(f"{len(bare)} tracked passes were not recorded: free space on the disk")
    model = health.get("model", {})
    if model.get("level"):
        rows.append(f"pointing model: {model.get('health')}")
    if health.get("inputs", {}).get("lost"):
        rows.append(f"{health['inputs']['lost']} messages were lost on the way to the executive: look at the network")
    return tuple(rows)


def _listed(names: Sequence[str], most: int = 5) -> str:
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return ", ".join(names[:most]) + more


def write_night(report: NightReport, folder: Path) -> None:
    """Write night.html and night.json into `folder`."""
    causes = shorts(folder.parent / "passes", [each.id for each in report.passes if each.recorded])
    counted = {"tracked": report.tracked, "held_share": report.held_share, "ledgers": causes}
    values = asdict(report) | counted
    write_whole(folder / "night.json", json.dumps(values, indent=1) + "\n")
    write_whole(folder / "night.html", page(report, causes))
    write_whole(folder.parent / "index.html", index_page(folder.parent))


def index_page(folder: Path) -> str:
    """Return the HTML text of the nights of a folder, the newest first, with their trend."""
    rows = []
    for file in sorted(folder.glob("report-*/night.json"), reverse=True)[:MOST_NIGHTS]:
        href = f"{file.parent.name}/night.html"
        try:
            night = parse_json(read_whole(file, DATA_BYTES))
            passes = [each for each in night["passes"] if not each.get("filler")]
            rows.append({
                "href": href, "begun": _minute(night["begun_t_s"]), "station": night["station"],
                "tracked": int(night["tracked"]),
                "wanted": sum(each["state"] not in BY_CHOICE for each in passes),
                "held": 100.0 * float(night["held_share"]), "alarms": len(night["alarms"]),
                "messages": int(night["messages"]), "to_do": len(night["to_do"]),
            })  # fmt: skip
        except (OSError, ValueError, KeyError, TypeError):
            # A report that was cut short has its page all the same.
            rows.append({"href": href, "begun": file.parent.name, "station": ""})
    return render("nights.html", title="Nights", nights=rows)


def page(report: NightReport, causes: Mapping[str, str] | None = None) -> str:
    """Return the HTML text of a night; `causes` are those that cost a pass most, by its id."""
    ages = [each.element_age_h for each in report.passes if each.element_age_h is not None]
    return render(
        "night.html", title=f"Night of {report.station}", night=report,
        begun=_minute(report.begun_t_s), ended=_minute(report.ended_t_s),
        timeline=_timeline(report), oldest_h=max(ages, default=None),
        passes=[_row(each, causes) for each in report.passes if not each.filler],
        fillers=[
            {"name": name, "text": filler_text(each), "pieces": list(map(_row, each))}
            for name, each in fillers_of(report.passes).items()
        ],
        alarms=[
            {"clock": clock_text(each.raised_t_s), "name": each.name.replace("_", " "),
             "message": each.message, "level": ("", "warning", "error")[each.level],
             "span": _lasted(each)}
            for each in report.alarms
        ],
        health=[(device, name, str(value)) for device, values in sorted(report.health.items())
                for name, value in values.items()],
    )  # fmt: skip


def _row(one: PassRecord, causes: Mapping[str, str] | None = None) -> dict[str, Any]:
    return {
        "cause": (causes or {}).get(one.id, ""),
        "clock": clock_text(one.aos_t_s)[:5], "name": f"{one.name}, {one.band} band".removesuffix(",  band"),
        "state": one.state, "why": _why(one),
        "lost_s": round(one.lost_s), "loss_db": one.loss_db,
        "held": 100.0 * one.tracked_s / max(1.0, one.los_t_s - one.aos_t_s),
        "report": f"../passes/{quote(one.id)}/report.html" if one.recorded else "",
    }  # fmt: skip


def _lasted(one: NightAlarm) -> str:
    lasted_s = math.inf if one.until_t_s is None else one.until_t_s - one.raised_t_s
    span = f"{lasted_s:.0f} s" if lasted_s < 120.0 else f"{lasted_s / 60.0:.0f} min"
    return f"{'lasts' if one.until_t_s is None else span}{', acknowledged' if one.acknowledged else ''}"


def _why(one: PassRecord) -> list[str]:
    """Return the lines under a pass: its reason, its causes, and what was unusual."""
    reasons = [] if one.state == TRACKED else [one.reason]
    more = (
        (one.attempts > 1, f"joined {one.attempts - 1} times"),
        (one.state == TRACKED and not one.recorded, "not recorded"),
        ((one.element_age_h or 0.0) > STALE_H, f"elements {one.element_age_h or 0.0:.0f} h old"),
    )
    parts = (each.partition(" ") for each in one.causes)
    causes = [f"{name.replace('_', ' ')} {rest}".strip() for name, _, rest in parts]
    return list(dict.fromkeys([*reasons, *causes, *(text for said, text in more if said)]))


def _timeline(report: NightReport) -> dict[str, Any]:
    """Return the bars of the picture: lanes of passes and of alarms against time."""
    span_s = report.ended_t_s - report.begun_t_s

    def x(t_s: float) -> float:
        return round(WIDTH * min(max((t_s - report.begun_t_s) / span_s, 0.0), 1.0), 1)

    passes = [
        {"x": x(each.aos_t_s), "width": max(2.0, x(each.los_t_s) - x(each.aos_t_s)), "state": each.state,
         "lost": each.lost_s / max(1.0, each.los_t_s - each.aos_t_s),
         "text": f"{each.name}, {clock_text(each.aos_t_s)}: {each.state}, {each.lost_s:.0f} s lost"}
        for each in report.passes
    ]  # fmt: skip
    names = list(dict.fromkeys(each.name for each in report.alarms))
    alarms = [
        {"x": x(each.raised_t_s), "lane": names.index(each.name), "level": each.level,
         "width": max(3.0, x(each.until_t_s or report.ended_t_s) - x(each.raised_t_s)),
         "text": f"{each.name}, {clock_text(each.raised_t_s)}: {each.message}"}
        for each in report.alarms
    ]  # fmt: skip
    step_s = next(step for step in (900.0, 1800.0, 3600.0, 7200.0, 14400.0, 86400.0, math.inf) if span_s / step <= 12.0)
    first = math.ceil(report.begun_t_s / step_s)
    hours = [] if math.isinf(step_s) else [
        {"x": x(k * step_s), "text": clock_text(k * step_s)[:5]} for k in range(first, int(report.ended_t_s / step_s) + 1)
    ]  # fmt: skip
    return {"passes": passes, "alarms": alarms, "names": names, "hours": hours, "width": WIDTH, "lane": LANE,
            "height": 70.0 + LANE * len(names) + 24.0}  # fmt: skip


def _minute(t_s: float) -> str:
    return utc_text(t_s)[:16].replace("T", " ")
