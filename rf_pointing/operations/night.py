"""A night: the passes of a schedule, one after the other, with recovery and without an operator.

`Night` is stepped by time.  What it knows comes from `take_*` and `respond`; what it wants goes out
by `send`, as the number and the name of a directive with its arguments.  It holds for a station of
nodes and for a simulated one.  Everything that it must know after a restart is in `state`, which is
saved before a directive leaves; a restored night first looks at the station, then goes on.
"""

import dataclasses
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any

from rf_pointing.core.pass_outcome import LEAST_SHARE, LOSS_OF_SIGNAL, SIDELOBE_DB
from rf_pointing.operations.alarms import Alarm, AlarmBook
from rf_pointing.operations.executor import BlockState, Executor, JournalEntry
from rf_pointing.operations.expected_state import ExpectedState
from rf_pointing.operations.procedure import Directive, Procedure
from rf_pointing.operations.recovery import Recovery, RecoveryTable
from rf_pointing.operations.schedule import Entry, PassState, Schedule, ScheduledPass

Pair = tuple[float, float]
Send = Callable[[int, str, dict[str, Any]], None]
"""Sends the directive of this name; its number comes back with the response.  Must not block."""
REPLAN_S = 60.0
RETRY_S = 5.0
"""Between two attempts at one pass."""
PATIENCE_S = 60.0
"""After the set of a pass until its end must have shown."""
OVERDUE_S = 10.0
"""After the scheduled end of a pass until it is ended; the elements may have moved its set."""
SCHEDULED_END = "the schedule ends it here"
LATE_S = 5.0
"""How old a view of the station may be to begin something."""
SEARCH_BACK_S = 60.0
REST_RETRY_S = 60.0


class NightState(StrEnum):
    """State of the executive."""

    IDLE = "idle"
    RUNNING = "running"
    PAUSED = "paused"
    STOPPING = "stopping"


@dataclass(slots=True)
class Attempt:
    """The pass in work."""

    id: str
    executor: Executor
    begun_s: float
    number: int = 1
    failed_s: float | None = None
    reasons: list[str] = field(default_factory=list)
    received_s: float = 0.0
    """Integral of the received power over the attempts before."""
    tracked_s: float = 0.0
    held_s: float | None = None
    """When the target was held last."""
    counted: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Seconds tracked and lost, and the mean loss in dB, as the controller counts them."""
    following: bool = False
    """Whether the controller has had the pass in this attempt."""
    ending: str = ""
    """Why the pass is being ended before its set."""


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


class Night:
    """Runs the schedule of one antenna; `step` a few times a second, or when something arrives."""

    def __init__(
        self,
        schedule: Schedule,
        procedure: Procedure,
        table: RecoveryTable,
        send: Send,
        *,
        quiet_s: float = 600.0,
        sensor: str = "auto",
        least_share: float = LEAST_SHARE,
        notify: Callable[[str, Alarm], None] = lambda _event, _alarm: None,
        save: Callable[[], None] = lambda: None,
    ) -> None:
        self.schedule, self.procedure, self.table = schedule, procedure, table
        self.expected_state = ExpectedState()
        self.book = AlarmBook(notify, quiet_s)
        self.recovery = Recovery(table, self.expected_state, self.book)
        self.state_name, self.reason = NightState.IDLE, ""
        self.records: list[PassRecord] = []
        self.journal: list[JournalEntry] = []
        """Entries since the journal was last taken out."""
        self.begun_s = self.ended_s = math.nan
        self.taken: set[str] = set()
        """Ids of passes that another antenna tracks."""
        self._send, self._save, self._sensor, self._least_share = send, save, sensor, least_share
        self._attempt: Attempt | None = None
        self._action: tuple[str, Executor] | None = None
        self._numbers: dict[int, tuple[Executor, int]] = {}
        self._number = 0
        self._planned_s, self._place_planned = -math.inf, None
        self._rest, self._rest_s = "", -math.inf
        self._saved: tuple[Any, ...] = ()
        self._unproved = False
        """Whether the station has not been seen since a restart."""

    # What is known

    def take(self, device: str, values: Mapping[str, Any], t_s: float) -> None:
        """Note attributes of a device as they were at `t_s`."""
        for name, value in values.items():
            self.expected_state.observe(f"{device}.{name}", value, t_s)

    def take_passes(self, target: str, windows: Sequence[tuple[float, float, Any]], t_s: float) -> None:
        """Note the passes of the selected target: rise, set, and what stands for each of them."""
        item = None if self._attempt is None else self.schedule.entries[self._attempt.id].item
        best, most_s = None, 0.0
        for aos_s, los_s, window in windows:
            shared_s = 0.0 if item is None else min(los_s, item.los_t_s) - max(aos_s, item.aos_t_s)
            if shared_s > most_s:
                best, most_s = window, shared_s
        self.take("ephemeris", {"target": target, "pass": best, "pass_found": best is not None}, t_s)

    def respond(self, number: int, accepted: bool, text: str, now_s: float) -> None:
        """Take the response to a directive."""
        if number not in self._numbers:
            self._note(now_s, "", "", "unexpected response", f"{number}: {text}")
            return
        executor, own = self._numbers[number]
        executor.respond(own, accepted, text, now_s)
        self._drain(executor)

    def fail(self, number: int, text: str, now_s: float) -> None:
        """Take the report that an accepted directive has failed."""
        if number in self._numbers:
            executor, own = self._numbers[number]
            executor.fail(own, text, now_s)
            self._drain(executor)

    # Requests of an operator

    @property
    def active_id(self) -> str:
        """Id of the pass in work, "" between passes."""
        return "" if self._attempt is None else self._attempt.id

    @property
    def finished(self) -> bool:
        """Whether nothing of the schedule is left to do."""
        return self.state_name == NightState.IDLE

    def start(self, now_s: float) -> None:
        """Begin, or go on with, the passes of the schedule."""
        if self.state_name not in (NightState.IDLE, NightState.STOPPING):
            raise ValueError(f"the executive is {self.state_name}")
        if self.state_name == NightState.IDLE:
            self.begun_s, self.records, self.book.history = now_s, [], []
        self.state_name, self.ended_s, self._planned_s, self._rest = NightState.RUNNING, math.nan, -math.inf, ""
        self._note(now_s, "", "", "started", f"{len(self.schedule.entries)} passes")
        self._save()

    def change(self, now_s: float) -> None:
        """Note that the schedule was changed: it is planned anew."""
        self._planned_s = -math.inf
        self._note(now_s, "", "", "schedule changed", f"{len(self.schedule.entries)} passes")
        self._save()

    def pause(self, now_s: float) -> None:
        """Begin nothing more until `resume`; a pass that is tracked goes on."""
        self._require(NightState.RUNNING)
        self.state_name = NightState.PAUSED
        self._note(now_s, "", "", "paused")
        self._save()

    def resume(self, now_s: float) -> None:
        """Go on after a pause."""
        self._require(NightState.PAUSED)
        self.state_name = NightState.RUNNING
        self._note(now_s, "", "", "resumed")
        self._save()

    def stop(self, now_s: float) -> None:
        """End the night after the pass in work."""
        self._require(NightState.RUNNING, NightState.PAUSED, NightState.STOPPING)
        self.state_name = NightState.STOPPING
        self._note(now_s, "", "", "stop was requested")
        self._save()

    def abort(self, now_s: float) -> None:
        """End the pass in work and the night now."""
        self.stop(now_s)
        if self._attempt is not None:
            self._end_early("the night was aborted", now_s)

    def skip(self, name: str, now_s: float) -> str:
        """Leave out a pass, the present one if the name is empty, or a block of the present one."""
        attempt = self._attempt
        if attempt is not None and name in attempt.executor.runs:
            attempt.executor.skip(now_s, name)
            self._drain(attempt.executor)
            return f"block {name} is skipped"
        if not name and attempt is None:
            raise ValueError("no pass is in work: name the one to skip")
        name = name or self.active_id
        entry = self.schedule.entry(name)
        if name == self.active_id:
            self._end_early("skipped by the operator", now_s)
        elif entry.state in (PassState.WAITING, PassState.YIELDS):
            self.schedule.end(entry, PassState.SKIPPED, "skipped by the operator")
        else:
            raise ValueError(f"pass {name} is {entry.state}")
        self.change(now_s)
        return f"pass {name} is skipped"

    def _require(self, *states: NightState) -> None:
        if self.state_name not in states:
            raise ValueError(f"the executive is {self.state_name}, must be {' or '.join(states)}")

    # One step

    def step(self, now_s: float) -> None:
        """Do what is due."""
        self._derive(now_s)
        self.recovery.step(now_s)
        effect, cause = self.recovery.effect()
        if self._unproved and not self._look_again(now_s):
            return
        self._step_action(now_s)
        moving_allowed = self.state_name in (NightState.RUNNING, NightState.STOPPING)
        if self._action is None and moving_allowed and (due := self.recovery.due(now_s)):
            name, action = due
            self.recovery.note_try(name, now_s)
            self._note(now_s, "", "", "recovery", f"{name}: {action}")
            self._begin_action(action, now_s)
        if self._attempt is not None:
            self._step_pass(now_s, effect, cause)
        if self._attempt is None and self.state_name != NightState.IDLE:
            self._step_between(now_s, effect, cause)
        progress = self._progress()
        if progress != self._saved:
            self._saved = progress
            self._save()

    def _progress(self) -> tuple[Any, ...]:
        """Return what a restart must know of the present pass."""
        if self._attempt is None:
            return (self.state_name,)
        rows = self._attempt.executor.runs.items()
        return self.state_name, *((name, run.state, run.answered, len(run.sent_s)) for name, run in rows)

    def _derive(self, now_s: float) -> None:
        """Note what follows from what is known: how long the target was not held."""
        attempt = self._attempt
        unheld_s = 0.0
        if attempt is not None and not attempt.ending:
            item = self.schedule.entries[attempt.id].item
            held = self.expected_state.actual("tracking.held")
            if held is not None and held.value and self._busy:
                attempt.held_s = held.t_s
            names = "seconds_tracked", "seconds_lost", "mean_loss"
            tracked_s, lost_s, loss_db = (float(self._value(f"tracking.{name}") or 0.0) for name in names)
            # A controller that was killed begins at zero: what it had counted stays.
            attempt.following = attempt.following or self._busy
            if attempt.following and tracked_s + lost_s >= attempt.counted[0] + attempt.counted[1]:
                attempt.counted = tracked_s, lost_s, loss_db
            begun_s = max(attempt.begun_s, item.aos_t_s)
            if self._busy and item.aos_t_s <= now_s <= item.los_t_s:
                last_s = begun_s if attempt.held_s is None else max(begun_s, attempt.held_s)
                unheld_s = max(0.0, now_s - last_s)
        self.expected_state.observe("pass.unheld_s", unheld_s, now_s)

    def _look_again(self, now_s: float) -> bool:
        """Return whether the station has been seen since the restart; then go on."""
        for name in ("antenna.mode", "tracking.mode"):
            seen = self.expected_state.actual(name)
            if seen is None or now_s - seen.t_s > LATE_S:
                return False
        self._unproved = False
        if self._attempt is not None:
            self._attempt.executor.resume(now_s)
            self._drain(self._attempt.executor)
        self._note(now_s, "", "", "goes on after a restart")
        return True

    def _step_pass(self, now_s: float, effect: str, cause: str) -> None:
        attempt = self._attempt
        assert attempt is not None
        entry, executor = self.schedule.entries[attempt.id], attempt.executor
        if not attempt.ending:
            if now_s >= self.schedule.ends_s(entry, now_s) and now_s < entry.item.los_t_s:
                self._end_early("it yields to a pass of a higher priority", now_s)
            elif now_s > entry.item.los_t_s + OVERDUE_S and self._busy:
                # The list may end a pass before its set.
                self._end_early(SCHEDULED_END, now_s)
            elif self._planned_s < 0.0 or now_s - self._planned_s > REPLAN_S:
                self._replan(now_s)
        if attempt.ending:
            self._finish_early(attempt, entry, now_s)
            return
        executor.step(now_s)
        self._drain(executor)
        failed = next(
            (run.reason for name, run in executor.runs.items()
             if run.state == BlockState.ANOMALY and not executor.procedure.blocks[name].optional), "",
        )  # fmt: skip
        if failed:
            self._retry(attempt, entry, failed, effect, cause, now_s)
        elif executor.succeeded:
            self._close(attempt, entry, "", now_s)

    def _retry(self, attempt: Attempt, entry: Entry, failed: str, effect: str, cause: str, now_s: float) -> None:
        """Try a pass again once what stopped it has gone, as long as enough of it is left."""
        if attempt.failed_s is None:
            attempt.failed_s = now_s
            attempt.reasons.append(failed)
            self._count(attempt)
            self._note(now_s, attempt.id, "", "attempt failed", failed)
            refused = self._value("track.refused")
            self.expected_state.observe("pass.refused", refused or "", now_s)
            self._save()
        left_s = entry.item.los_t_s - now_s
        if left_s < min(self.schedule.params.least_s, 0.5 * entry.item.duration_s):
            self._close(attempt, entry, cause or failed, now_s)
            return
        if self.state_name == NightState.STOPPING:
            self._close(attempt, entry, failed, now_s)
            return
        held_up = effect != "continue" or self.state_name != NightState.RUNNING or self._action is not None
        fresh = self._fresh("antenna.mode", now_s) and self._fresh("tracking.mode", now_s)
        wait_s = RETRY_S * min(6, attempt.number)
        if held_up or not fresh or now_s - attempt.failed_s < wait_s:
            return
        if self._busy:
            # What is left of the attempt before would refuse the next one.
            self._begin_action("stop_pass", now_s)
            return
        attempt.number += 1
        attempt.failed_s, attempt.following = None, False
        attempt.executor = self._executor(entry, now_s)
        self._note(now_s, attempt.id, "", "tried again", f"attempt {attempt.number}")

    def _end_early(self, why: str, now_s: float) -> None:
        attempt = self._attempt
        assert attempt is not None
        if not attempt.ending:
            attempt.ending = why
            self._note(now_s, attempt.id, "", "ended early", why)
            if self._busy:
                self._begin_action("stop_pass", now_s)
            self._save()

    def _finish_early(self, attempt: Attempt, entry: Entry, now_s: float) -> None:
        if self._action is None and not self._busy:
            self._count(attempt)
            self._close(attempt, entry, "" if attempt.ending == SCHEDULED_END else attempt.ending, now_s)

    def _count(self, attempt: Attempt) -> None:
        """Add what the controller has counted in this attempt."""
        tracked_s, lost_s, loss_db = attempt.counted
        attempt.counted = 0.0, 0.0, 0.0
        attempt.tracked_s += tracked_s
        attempt.received_s += (tracked_s + lost_s) * 10.0 ** (-0.1 * loss_db)

    def _close(self, attempt: Attempt, entry: Entry, why: str, now_s: float) -> None:
        """End the pass with its record."""
        item = entry.item
        if not why:
            self._count(attempt)
        duration_s = item.duration_s
        entry.tracked_s = min(attempt.tracked_s, duration_s)
        entry.lost_s = max(0.0, duration_s - entry.tracked_s)
        received = max(attempt.received_s / duration_s, 10.0 ** (-0.1 * SIDELOBE_DB))
        entry.loss_db = max(0.0, -10.0 * math.log10(min(1.0, received)))
        share = entry.tracked_s / duration_s
        if not why and share < self._least_share:
            reasons = "; ".join(attempt.reasons)
            why = f"{100 * share:.0f} % of the pass was held, must be >= {100 * self._least_share:.0f} %"
            why += f": {reasons}" if reasons else ""
        skipped = why.startswith("skipped")
        weather = bool(why) and self.recovery.effect()[0] == "weather"
        state = (
            PassState.SKIPPED
            if skipped
            else PassState.WEATHER
            if weather
            else PassState.LOST
            if why
            else PassState.TRACKED
        )
        self.schedule.end(entry, state, why or LOSS_OF_SIGNAL)
        self.records.append(self._record(entry, attempt))
        self._note(now_s, item.id, "", str(state), entry.reason)
        self._attempt, self._planned_s, self._rest = None, -math.inf, ""
        self.expected_state.observe(
            "pass.refused", "" if state == PassState.TRACKED else self._value("pass.refused") or "", now_s
        )
        if self._value("recorder.state") == "recording":
            self._begin_action("end_record", now_s)
        self._save()

    def _record(self, entry: Entry, attempt: Attempt | None) -> PassRecord:
        item = entry.item
        causes = [
            f"{name}: {message}" for t_s, event, name, _, message in self.book.history
            if event in ("raised", "worse") and item.aos_t_s - 600.0 <= t_s <= item.los_t_s
        ]  # fmt: skip
        lasting = [f"{a.name}: {a.message}" for a in self.book.lasting if a.raised_t_s < item.aos_t_s - 600.0]
        reasons = attempt.reasons if attempt else []
        recorded = attempt is not None and attempt.executor.runs.get("record", None) is not None and (
            attempt.executor.runs["record"].state == BlockState.COMPLETED
        )  # fmt: skip
        return PassRecord(
            id=item.id, name=item.name or item.target, aos_t_s=item.aos_t_s, los_t_s=item.los_t_s,
            state=str(entry.state), reason=entry.reason, tracked_s=entry.tracked_s, lost_s=entry.lost_s,
            loss_db=entry.loss_db, attempts=attempt.number if attempt else 0,
            causes=tuple(dict.fromkeys([*causes, *lasting, *reasons])),
            element_age_h=self._age_h(item, attempt),
            recorded=recorded,
        )  # fmt: skip

    def _age_h(self, item: ScheduledPass, attempt: Attempt | None) -> float | None:
        """Return the age of the elements: that which was published in the pass, else as planned."""
        seen = self.expected_state.actual("elements.age_h")
        if attempt is not None and seen is not None and seen.t_s >= attempt.begun_s:
            return float(seen.value)
        return None if math.isnan(item.element_age_s) else item.element_age_s / 3600.0

    def _step_between(self, now_s: float, effect: str, cause: str) -> None:
        """Begin the next pass when it is due, and rest until then."""
        place = self._place(now_s)
        for entry in self.schedule.expire(now_s):
            weather = effect == "weather"
            entry.reason = cause or entry.reason
            entry.state = PassState.WEATHER if weather else entry.state
            self.records.append(self._record(entry, None))
            self._note(now_s, entry.item.id, "", str(entry.state), entry.reason)
            self._save()
        if self.state_name == NightState.STOPPING or effect == "stop":
            self._finish("stop was requested" if effect != "stop" else cause, now_s)
            return
        if place is not None and (self._planned_s < 0.0 or now_s - self._planned_s > REPLAN_S):
            self._replan(now_s)
        following = self.schedule.next()
        if following is None and place is not None and not any(
            each.planned for each in self.schedule.entries.values()
        ):  # fmt: skip
            self._finish("the schedule is done", now_s)
            return
        if self.state_name == NightState.PAUSED or self._action is not None or place is None:
            return
        if effect != "continue":
            self.reason = cause
            return
        if following is not None and now_s >= self.schedule.begins_s(following, place):
            self._begin_pass(following, now_s)
            return
        self._settle(now_s, place, following)

    def _settle(self, now_s: float, place: Pair, following: Entry | None) -> None:
        """Hold, park, stow or unwind between two passes."""
        rest, goal = self.schedule.between(now_s, place)
        name = following.item.name or following.item.target if following else "nothing"
        self.reason = f"{rest} until {name}"
        mode = self._value("antenna.mode")
        there = {"park": ("parking", "parked", "stowed", "stowing"), "stow": ("stowing", "stowed")}.get(rest, (mode,))
        if rest == "hold" or (rest != "unwind" and mode in there):
            return
        if rest == self._rest and now_s - self._rest_s < REST_RETRY_S:
            return
        self._rest, self._rest_s = rest, now_s
        if rest == "unwind":
            assert goal is not None
            if mode in ("parked", "stowed", "disabled"):
                # The brakes are set: the pass itself releases them in time for the longer slew.
                return
            self._begin_action("unwind", now_s, {"azimuth": goal[0], "elevation": goal[1]})
        else:
            self._begin_action(rest, now_s)

    def _finish(self, why: str, now_s: float) -> None:
        """End the night: the antenna is stowed."""
        mode = self._value("antenna.mode")
        if self._action is not None:
            return
        stowing = mode in ("stowed", "stowing") or self._value("antenna.fault") or self._rest == "last stow"
        if not stowing and mode is not None:
            self._rest = "last stow"
            self._begin_action("stow", now_s)
            return
        for entry in self.schedule.entries.values():
            if entry.state in (PassState.WAITING, PassState.YIELDS) and entry.planned:
                self.schedule.end(entry, PassState.MISSED, why)
                self.records.append(self._record(entry, None))
        self.state_name, self.reason, self.ended_s = NightState.IDLE, why, now_s
        self._note(now_s, "", "", "ended", why)
        self._save()

    def _begin_pass(self, entry: Entry, now_s: float) -> None:
        entry.state, entry.reason = PassState.ACTIVE, ""
        executor = self._executor(entry, now_s)
        self._attempt = Attempt(entry.item.id, executor, now_s)
        self._rest, self.reason = "", ""
        self._note(now_s, entry.item.id, "", "begun")
        self._save()

    def _executor(self, entry: Entry, now_s: float) -> Executor:
        item = entry.item
        known = {
            "id": item.id, "target": item.target, "sensor": item.sensor or self._sensor,
            "search_from": max(0.0, item.aos_t_s - SEARCH_BACK_S), "patience_s": item.los_t_s - now_s + PATIENCE_S,
            "aos": item.aos_t_s, "los": item.los_t_s, "name": item.name, "priority": item.priority,
        }  # fmt: skip
        given = {name: value for name, value in known.items() if name in self.procedure.parameters}
        return self._new(self.procedure, given, now_s)

    def _begin_action(self, name: str, now_s: float, parameters: Mapping[str, Any] | None = None) -> None:
        if self._action is None:
            self._action = name, self._new(self.table.actions[name], dict(parameters or {}), now_s)

    def _step_action(self, now_s: float) -> None:
        if self._action is None:
            return
        _, executor = self._action
        executor.step(now_s)
        self._drain(executor)
        if executor.finished or any(run.state == BlockState.ANOMALY for run in executor.runs.values()):
            self._action = None

    def _new(self, procedure: Procedure, parameters: dict[str, Any], now_s: float) -> Executor:
        holder: list[Executor] = []

        def send(own: int, directive: Directive, arguments: dict[str, Any]) -> None:
            self._number += 1
            self._numbers[self._number] = holder[0], own
            # The numbers of long ago are of no use: no response takes hours.
            self._numbers.pop(self._number - 1000, None)
            # Written before it leaves: a restart must know of every motion that was requested.
            self._save()
            self._send(self._number, directive.name, arguments)

        holder.append(Executor(procedure, parameters, self.expected_state, send, now_s))
        return holder[0]

    def _replan(self, now_s: float) -> None:
        place = self._place(now_s)
        if place is not None:
            self.schedule.replan(now_s, place, self.taken)
            self._planned_s = now_s

    def _place(self, now_s: float) -> Pair | None:
        azimuth, elevation = (self.expected_state.actual(f"antenna.{name}") for name in ("azimuth", "elevation"))
        if azimuth is None or elevation is None or now_s - azimuth.t_s > LATE_S:
            return None
        return float(azimuth.value), float(elevation.value)

    @property
    def _busy(self) -> bool:
        """Whether the controller has a pass, as far as is known."""
        return bool(self._value("tracking.target"))

    def _fresh(self, attribute: str, now_s: float) -> bool:
        seen = self.expected_state.actual(attribute)
        return seen is not None and now_s - seen.t_s <= LATE_S

    def _value(self, attribute: str) -> Any:
        seen = self.expected_state.actual(attribute)
        return None if seen is None else seen.value

    def _note(self, t_s: float, block: str, directive: str, event: str, detail: str = "") -> None:
        self.journal.append(JournalEntry(t_s, block, directive, event, detail))

    def _drain(self, executor: Executor) -> None:
        self.journal += executor.journal
        executor.journal.clear()

    def blocks(self) -> list[str]:
        """Return the blocks of the present procedure that are neither over nor inactive."""
        running = [
            each for each in (self._attempt and self._attempt.executor, self._action and self._action[1]) if each
        ]
        return [
            f"{name}: {run.state}" + (f", {run.reason}" if run.reason else "")
            for executor in running for name, run in executor.runs.items()
            if run.state in (BlockState.EXECUTING, BlockState.PAUSED, BlockState.ANOMALY)
        ]  # fmt: skip

    # State

    def state(self) -> dict[str, Any]:
        """Return where the night is, for a file."""
        attempt = self._attempt
        kept = attempt and {
            **{
                item.name: getattr(attempt, item.name)
                for item in dataclasses.fields(Attempt)
                # What changes all the time would be written all the time.
                if item.name not in ("executor", "held_s", "counted")
            },
            "executor": attempt.executor.state(),
        }
        return {
            "version": 1,
            "state": str(self.state_name),
            "begun_s": None if math.isnan(self.begun_s) else self.begun_s,
            "schedule": self.schedule.state(),
            "attempt": kept,
            "alarms": self.book.state(),
            "records": [dataclasses.asdict(record) for record in self.records],
        }

    def restore(self, state: Mapping[str, Any], now_s: float) -> None:
        """Take over a state; nothing is sent before the station has been seen.

        Raises ValueError for an unknown state.
        """
        try:
            if state["version"] != 1:
                raise ValueError(f"version={state['version']} must be 1")
            self.schedule.restore(state["schedule"])
            self.state_name, self.begun_s = NightState(state["state"]), float(state["begun_s"] or now_s)
            self.book.restore(state["alarms"])
            self.records = [PassRecord(**row | {"causes": tuple(row["causes"])}) for row in state["records"]]
            if (kept := state["attempt"]) is not None:
                values = dict(kept)
                before = values.pop("executor")
                entry = self.schedule.entry(values["id"])
                executor = self._executor(entry, now_s)
                self._attempt = Attempt(executor=executor, **values)
                executor.restore(before, now_s)
                self._drain(executor)
        except (KeyError, TypeError) as error:
            raise ValueError(f"no state of a night: {error}") from error
        self._unproved = True
        self._note(now_s, "", "", "restored", str(self.state_name))
