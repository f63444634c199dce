"""The pass in work: how often it was tried, what was counted in each attempt, and its record."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, fields
from typing import Any

from rf_pointing.core import SIDELOBE_DB, utc_text
from rf_pointing.operations.alarms import AlarmBook
from rf_pointing.operations.executor import BlockState, Executor
from rf_pointing.operations.expected_state import ExpectedState
from rf_pointing.operations.schedule import Entry, PassState

VERDICT = "verdict.json"
"""File of the record of a pass, with its recordings."""
_COUNTED = "tracking.seconds_tracked", "tracking.seconds_lost", "tracking.mean_loss"
_PASSING = "executor", "counted"
"""Fields that are not kept: they change all the time, and each change would write the file."""


@dataclass(frozen=True, slots=True)
class PassRecord:
    """One pass of the report; times in UTC s, `causes` are what cost seconds."""

    id: str
    name: str
    aos_t_s: float
    los_t_s: float
    state: str
    reason: str
    tracked_s: float
    lost_s: float
    loss_db: float
    attempts: int
    causes: tuple[str, ...]
    element_age_h: float | None
    recorded: bool
    priority: int = 0
    filler: bool = False
    band: str = ""


@dataclass(slots=True)
class PassWork:
    """One pass from its beginning to its record; `number` is that of the present attempt."""

    id: str
    executor: Executor
    begun_s: float
    number: int = 1
    failed_s: float | None = None
    fruitless: float = 0.0
    """Attempts in a row that have tracked next to nothing."""
    reasons: list[str] = field(default_factory=list)
    received_s: float = 0.0
    """Integral of the received power over the attempts before."""
    tracked_s: float = 0.0
    counted: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Seconds tracked and lost, and the mean loss in dB, as the controller counts them."""
    following: bool = False
    """Whether the controller has had the pass in this attempt."""
    ending: str = ""
    """Why the pass is being ended before its set."""

    @property
    def failed(self) -> str:
        """Why the present attempt cannot succeed, "" if it can."""
        return self.executor.failed

    def follow(self, seen: ExpectedState) -> None:
        """Take what the controller has counted."""
        if self.ending:
            return
        busy = bool(seen.value("tracking.target"))
        tracked_s, lost_s, loss_db = (float(seen.value(name) or 0.0) for name in _COUNTED)
        # A controller that was killed begins at zero: what it had counted stays.
        self.following = self.following or busy
        if self.following and tracked_s + lost_s >= self.counted[0] + self.counted[1]:
            self.counted = tracked_s, lost_s, loss_db

    def count(self) -> None:
        """Add what the controller has counted in this attempt."""
        tracked_s, lost_s, loss_db = self.counted
        self.counted = 0.0, 0.0, 0.0
        self.tracked_s += tracked_s
        self.received_s += (tracked_s + lost_s) * 10.0 ** (-0.1 * loss_db)

    def give_outcome(self, entry: Entry) -> None:
        """Set what was tracked and lost in all attempts."""
        duration_s = entry.item.duration_s
        entry.tracked_s = min(self.tracked_s, duration_s)
        entry.lost_s = max(0.0, duration_s - entry.tracked_s)
        received = max(self.received_s / duration_s, 10.0 ** (-0.1 * SIDELOBE_DB))
        entry.loss_db = max(0.0, -10.0 * math.log10(min(1.0, received)))

    def state(self) -> dict[str, Any]:
        """Return the work as plain values; `PassWork(executor=..., **state)` takes them back."""
        kept = {item.name: getattr(self, item.name) for item in fields(self) if item.name not in _PASSING}
        return kept | {"executor": self.executor.state()}


def record_of(
    entry: Entry, work: PassWork | None, book: AlarmBook, seen: ExpectedState, band: str = ""
) -> PassRecord:  # fmt: skip
    """Return the record of a pass that has ended, in `band` unless it names one.

    `work` is None for a pass that has not begun.
    """
    item, age_h, recorded = entry.item, None, False
    causes = causes_between(book, item.aos_t_s, item.los_t_s)
    if not math.isnan(item.element_age_s):
        age_h = item.element_age_s / 3600.0
    if work is not None:
        causes += work.reasons
        run, age = work.executor.runs.get("record"), seen.actual("elements.age_h")
        recorded = run is not None and run.state == BlockState.COMPLETED
        # As it was published in the pass, else as planned.
        age_h = float(age.value) if age is not None and age.t_s >= work.begun_s else age_h
    return PassRecord(
        id=item.id, name=item.name or item.target, aos_t_s=item.aos_t_s, los_t_s=item.los_t_s, state=str(entry.state),
        reason=entry.reason, tracked_s=entry.tracked_s, lost_s=entry.lost_s, loss_db=entry.loss_db,
        attempts=work.number if work else 0, causes=tuple(dict.fromkeys(causes)), element_age_h=age_h, recorded=recorded,
        filler=item.filler, band=item.band or band,
    )  # fmt: skip


def causes_between(book: AlarmBook, from_s: float, to_s: float) -> list[str]:
    """Return the alarms that lasted between two times, each with its begin and its end."""
    begun: dict[str, tuple[float, str]] = {a.name: (a.raised_t_s, a.message) for a in book.lasting}
    open_, rows = dict[str, tuple[float, str]](), list[tuple[float, float | None, str, str]]()
    for t_s, event, name, _, message in book.history:
        if event == "raised":
            open_[name] = t_s, message
        elif event == "cleared" and name in open_:
            raised_s, _ = open_.pop(name)
            rows.append((raised_s, t_s, name, message))
    # Alarms of before the night are not in its history.
    rows += [(t_s, None, name, message) for name, (t_s, message) in (open_ | begun).items()]
    return [
        f"{name} {clock_text(raised_s)} to {clock_text(end_s)}, {end_s - raised_s:.0f} s: {message}"
        if end_s is not None else f"{name} since {clock_text(raised_s)}: {message}"
        for raised_s, end_s, name, message in sorted(rows, key=lambda row: row[0])
        if raised_s <= to_s and (end_s is None or end_s >= from_s)
    ]  # fmt: skip


def clock_text(t_s: float) -> str:
    """Return the time of day."""
    return utc_text(t_s)[11:19]


def tracked_in_gaps(spans_s: Sequence[float], count: int | None = None) -> str:
    """Return in how many gaps a filler was tracked, of `count`, by its spans (s)."""
    gaps = f"{len(spans_s)} of {count}" if count not in (None, len(spans_s)) else f"{len(spans_s)}"
    return f"tracked in {gaps} gap{'s' * (gaps != '1')}, {sum(spans_s) / 3600.0:.1f} h"


def fillers_of(records: Iterable[PassRecord]) -> dict[str, list[PassRecord]]:
    """Return the records of each target that filled gaps, by its name."""
    found: dict[str, list[PassRecord]] = {}
    for each in records:
        if each.filler:
            found.setdefault(each.name, []).append(each)
    return found


def filler_text(records: Sequence[PassRecord]) -> str:
    """Return in how many gaps one target was tracked, and for how long."""
    spans_s = [each.tracked_s for each in records if each.state == PassState.TRACKED]
    return tracked_in_gaps(spans_s, len(records))
