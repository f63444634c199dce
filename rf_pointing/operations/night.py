"""A night: the passes of a schedule, one after the other, with recovery and without an operator.

`Night` is stepped by time.  What it knows comes from `take_*` and `respond`; what it wants goes out
by `send`, as the number and the name of a directive with its arguments.  It holds for a station of
nodes and for a simulated one.  Everything that it must know after a restart is in `state`, which is
saved before a directive leaves; a restored night first looks at the station, then goes on.
"""

import dataclasses
import math
from collections.abc import Callable, Mapping, Sequence
from enum import StrEnum
from typing import Any

from rf_pointing.core import LEAST_SHARE, LOSS_OF_SIGNAL, OF_ANTENNA, Pair
from rf_pointing.core.pass_outcome import NOT_OFFERED, SCANNED
from rf_pointing.operations.alarms import Alarm, AlarmBook
from rf_pointing.operations.executor import BlockRun, BlockState, Executor, JournalEntry, block_text
from rf_pointing.operations.expected_state import ExpectedState
from rf_pointing.operations.pass_work import PassRecord, PassWork, record_of
from rf_pointing.operations.procedure import Directive, Procedure
from rf_pointing.operations.recovery import Recovery, RecoveryTable
from rf_pointing.operations.schedule import Entry, PassState, Schedule

Send = Callable[[int, str, dict[str, Any]], None]
"""Sends the directive of this name; its number comes back with the response.  Must not block."""
REPLAN_S = 60.0
RETRY_S = 5.0
"""Wait after an attempt that tracked less than `REJOIN_S`; as much more after each further one."""
EXPLAINED = 0.2
"""An attempt that a fault of the antenna ended counts as so much of one."""
REJOIN_S = 10.0
"""Least time left of a pass in work for another attempt."""
PATIENCE_S = 60.0
"""After the set of a pass until its end must have shown."""
OVERDUE_S = 10.0
"""After the scheduled end of a pass until it is ended; the elements may have moved its set."""
READY_S = (900.0, 300.0, 0.0)
"""Before the rise of a pass, when what it still lacks is reported again."""
SCHEDULED_END = "the schedule ends it here"
BY_OPERATOR = SKIPPED, ABORTED, STOPPED = (
    "skipped by the operator", "the night was aborted", "stop was requested",
)  # fmt: skip
"""Reasons of passes that nobody has lost."""
LATE_S = 5.0
"""How old a view of the station may be to begin something."""
SEARCH_BACK_S = 60.0
REST_RETRY_S = 60.0
_AT_REST = {"park": ("parking", "parked", "stowed", "stowing"), "stow": ("stowing", "stowed")}
"""Modes in which the antenna needs no such request."""


class NightState(StrEnum):
    """State of the executive."""

    IDLE = "idle"
    RUNNING = "running"
    PAUSED = "paused"
    STOPPING = "stopping"
    ENDED = "ended"
    """The executive itself has ended."""


class Night:
    """Runs the schedule of one antenna; `step` a few times a second, or when something arrives."""

    def __init__(
        self, schedule: Schedule, procedure: Procedure, table: RecoveryTable, send: Send, *,
        quiet_s: float = 600.0, sensor: str = "auto", band: str = "",
        scan_procedure: Procedure | None = None,
        least_share: float = LEAST_SHARE,
        notify: Callable[[str, Alarm], None] = lambda _event, _alarm: None,
        save: Callable[[], None] = lambda: None,
    ) -> None:  # fmt: skip
        self.schedule, self.procedure, self.table = schedule, procedure, table
        self._scan_procedure = scan_procedure or procedure
        self.sensor, self.band, self.least_share = sensor, band, least_share
        self.expected_state = ExpectedState()
        self.book = AlarmBook(notify, quiet_s)
        self.recovery = Recovery(table, self.expected_state, self.book)
        self.state_name, self.reason = NightState.IDLE, ""
        self.records: list[PassRecord] = []
        self.journal: list[JournalEntry] = []
        """Entries since the journal was last cleared."""
        self.begun_s = self.ended_s = math.nan
        self.taken: set[str] = set()
        """Ids of passes that another antenna tracks."""
        self.shared = False
        """Whether another antenna is there that can take over a pass."""
        self._send, self._save = send, save
        self._work: PassWork | None = None
        self._action: Executor | None = None
        self._numbers: dict[int, tuple[Executor, int]] = {}
        self._number = 0
        self._planned_s = -math.inf
        self._rest, self._rest_s = "", -math.inf
        self._now_s = -math.inf
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
        best, most_s = None, 0.0
        for aos_s, los_s, window in windows if self._work is not None else ():
            item = self.schedule.entries[self.active_id].item
            shared_s = min(los_s, item.los_t_s) - max(aos_s, item.aos_t_s)
            if shared_s > most_s:
                best, most_s = window, shared_s
        self.take("ephemeris", {"target": target, "pass": best, "pass_found": best is not None}, t_s)

    def take_readiness(self, reasons: Sequence[str], now_s: float) -> None:
        """Note what the next pass needs and has not, by the `reasons` of the nodes.

        `next.stage` changes 15 min, 5 min and 0 min before the rise.  What has an alarm that holds
        up the night is not noted.
        """
        entry = self.schedule.active or next(
            (each for each in self.schedule.in_order if each.state == PassState.WAITING
             and each.item.los_t_s > now_s and each.item.id not in self.taken), None,
        )  # fmt: skip
        waits = self.state_name != NightState.RUNNING or self.recovery.effect()[0] != "continue"
        if entry is None or waits:
            self.take("next", {"missing": ""}, now_s)
            return
        missing, in_s = list(reasons), entry.item.aos_t_s - now_s
        if not missing and in_s < 0.0 and self._work is not None and not self._busy:
            missing = self._work.reasons[-1:]
        stage = sum(in_s < limit_s for limit_s in READY_S)
        due = f"rises in {in_s / 60.0:.0f} min" if in_s > 0.0 else "has risen"
        name = entry.item.name or entry.item.target
        values = {"missing": "; ".join(missing), "name": name, "in_s": in_s,
                  "stage": f"{entry.item.id} {stage}", "due": due}  # fmt: skip
        self.take("next", values, now_s)

    def respond(self, number: int, accepted: bool, text: str, now_s: float, name: str = "") -> None:
        """Take the response to a directive, and the `name` of the target that it has selected."""
        if number not in self._numbers:
            self._note(now_s, "", "unexpected response", f"{number}: {text}")
            return
        executor, own = self._numbers[number]
        if name and self._work is not None and executor is self._work.executor:
            self.schedule.name_target(self.schedule.entries[self._work.id].item, name)
        executor.respond(own, accepted, text, now_s)

    def fail(self, number: int, text: str, now_s: float) -> None:
        """Take the report that an accepted directive has failed."""
        if number in self._numbers:
            executor, own = self._numbers[number]
            executor.fail(own, text, now_s)

    # Requests of an operator

    @property
    def active_id(self) -> str:
        """Id of the pass in work, "" between passes."""
        return "" if self._work is None else self._work.id

    @property
    def finished(self) -> bool:
        """Whether nothing of the schedule is left to do."""
        return self.state_name == NightState.IDLE

    def start(self, now_s: float) -> None:
        """Begin, or go on with, the passes of the schedule."""
        if self.state_name not in (NightState.IDLE, NightState.STOPPING):
            raise ValueError(f"the executive is {self.state_name}")
        if self.finished:
            self.begun_s, self.records, self.book.history, self.book.messages = now_s, [], [], 0
        self.ended_s, self._planned_s, self._rest = math.nan, -math.inf, ""
        self._become(NightState.RUNNING, now_s, "started", f"{len(self.schedule.entries)} passes")

    def change(self, now_s: float) -> None:
        """Note that the schedule was changed: it is planned anew."""
        self._planned_s = -math.inf
        self._become(self.state_name, now_s, "schedule changed", f"{len(self.schedule.entries)} passes")

    def pause(self, now_s: float) -> None:
        """Begin nothing more until `resume`; a pass that is tracked goes on."""
        self._require(NightState.RUNNING)
        self._become(NightState.PAUSED, now_s, "paused")

    def resume(self, now_s: float) -> None:
        """Go on after a pause."""
        self._require(NightState.PAUSED)
        self._become(NightState.RUNNING, now_s, "resumed")

    def stop(self, now_s: float) -> None:
        """End the night after the pass in work."""
        self._require(NightState.RUNNING, NightState.PAUSED, NightState.STOPPING)
        self._become(NightState.STOPPING, now_s, STOPPED)

    def abort(self, now_s: float) -> None:
        """End the pass in work and the night now."""
        self.stop(now_s)
        if self._work is not None:
            self._end_early(self._work, ABORTED, now_s)

    def skip(self, name: str, now_s: float) -> str:
        """Leave out a pass, the present one if the name is empty, or a block of the present one."""
        work = self._work
        if work is not None and name in work.executor.runs:
            work.executor.skip(now_s, name)
            return f"block {name} is skipped"
        if not name and work is None:
            raise ValueError("no pass is in work: name the one to skip")
        name = name or self.active_id
        entry = self.schedule.entry(name)
        if work is not None and name == work.id:
            self._end_early(work, SKIPPED, now_s)
        elif entry.state in (PassState.WAITING, PassState.YIELDS):
            self.schedule.end(entry, PassState.SKIPPED, SKIPPED)
        else:
            raise ValueError(f"pass {name} cannot be skipped: its state is {entry.state}")
        self.change(now_s)
        return f"pass {name} is skipped"

    def run(self, procedure: Procedure, now_s: float) -> None:
        """Begin a procedure between two passes; it must end before the next one."""
        if self._work is not None or self._action is not None:
            raise ValueError(f"{procedure.name} must wait: {self.active_id or 'a request'} is in work")
        following, place = self.schedule.next(), self._place(now_s)
        if place is None:
            raise ValueError(f"{procedure.name} must wait: the antenna shows no position")
        free_s = self.schedule.begins_s(following, place) - now_s if following is not None else math.inf
        needed_s = sum(block.timeout_s for block in procedure.blocks.values())
        if free_s < needed_s:
            raise ValueError(f"{procedure.name} may take {needed_s:.0f} s, must be <= {free_s:.0f} s to the next pass")
        self._action = self._executor(procedure, procedure.with_parameters({}), now_s)

    def _require(self, *states: NightState) -> None:
        if self.state_name not in states:
            raise ValueError(f"the executive is {self.state_name}, must be {' or '.join(states)}")

    def _become(self, state: NightState, now_s: float, event: str, detail: str = "") -> None:
        self.state_name = state
        self._note(now_s, "", event, detail)
        self._save()

    # One step

    def step(self, now_s: float) -> None:
        """Do what is due."""
        if now_s < self._now_s:
            self._set_back(self._now_s - now_s, now_s)
        self._now_s = now_s
        work = self._work
        if work is not None:
            work.follow(self.expected_state)
        self.recovery.acts = self.state_name in (NightState.RUNNING, NightState.STOPPING)
        self.recovery.step(now_s)
        effect, cause = self.recovery.effect()
        if self._unproved and not self._has_looked(now_s):
            return
        self._step_action(now_s)
        if self._action is None and (due := self.recovery.due(now_s)):
            name, action = due
            self.recovery.note_try(name, now_s)
            self._note(now_s, "", "recovery", f"{name}: {action}")
            self._begin_action(action, now_s)
        if work is not None:
            self._step_pass(work, now_s, effect, cause)
        if self._work is None and not self.finished:
            self._step_between(now_s, effect, cause)
        progress = self._progress()
        if progress != self._saved:
            self._saved = progress
            self._save()

    def _set_back(self, by_s: float, now_s: float) -> None:
        """Go on with a clock that was set back: every wait stays as long as it was."""
        self._note(now_s, "", "the clock was set back", f"by {by_s:.1f} s")
        self.expected_state.set_back(by_s)
        self.recovery.set_back(by_s)
        self._planned_s, self._rest_s = self._planned_s - by_s, self._rest_s - by_s
        if self._work is not None and self._work.failed_s is not None:
            self._work.failed_s -= by_s
        for executor in (self._action, self._work.executor if self._work is not None else None):
            if executor is not None:
                executor.set_back(by_s)

    def _progress(self) -> tuple[Any, ...]:
        """Return what a restart must know: of the present pass, and what was reported."""
        runs = self._work.executor.runs.items() if self._work else ()
        return (
            self.state_name,
            self.book.messages,
            *((name, run.state, run.answered, len(run.sent_s)) for name, run in runs),
        )

    def _seen(self, now_s: float) -> bool:
        """Return whether antenna and controller were seen just now."""
        return all(self.expected_state.is_fresh(name, now_s, LATE_S) for name in ("antenna.mode", "tracking.mode"))

    def _has_looked(self, now_s: float) -> bool:
        """Return whether the station has been seen since the restart; then go on."""
        if not self._seen(now_s):
            return False
        self._unproved = False
        if self._work is not None:
            self._work.executor.resume(now_s)
        self._note(now_s, "", "goes on after a restart")
        return True

    def _hand_over(self, work: PassWork, entry: Entry, effect: str, now_s: float) -> None:
        """Leave a pass in work to a partner, or take it over from one."""
        theirs = work.id in self.taken
        # A partner that sees the target waits for nobody to be sure of a fault.
        ill = effect != "continue" or any(map(self.expected_state.value, ("antenna.fault", "drive.problem")))
        if entry.state == PassState.ACTIVE and (theirs or (self.shared and ill)):
            entry.state = PassState.STANDBY
        elif entry.state == PassState.STANDBY and not theirs and not ill:
            entry.state = PassState.ACTIVE
        else:
            return
        self._note(now_s, work.id, str(entry.state), "takes over" if entry.state == PassState.ACTIVE else "hands over")
        self._planned_s = -math.inf
        self._save()

    def _step_pass(self, work: PassWork, now_s: float, effect: str, cause: str) -> None:
        entry = self.schedule.entries[work.id]
        self._hand_over(work, entry, effect, now_s)
        if not work.ending:
            if now_s >= self.schedule.ends_s(entry, now_s) and now_s < entry.item.los_t_s:
                self._end_early(work, "it yields to a pass of a higher priority", now_s)
            elif now_s > entry.item.los_t_s + OVERDUE_S and self._busy:
                # The list may end a pass before its set.
                self._end_early(work, SCHEDULED_END, now_s)
            else:
                self._replan_in_time(now_s)
        if work.ending:
            if self._action is None and not self._busy:
                work.count()
                done = work.ending == SCHEDULED_END and not entry.item.scan
                self._close(work, entry, "" if done else work.ending, now_s)
            return
        work.executor.step(now_s)
        if failed := work.failed:
            self._retry(work, entry, failed, effect, cause, now_s)
        elif work.executor.succeeded:
            self._close(work, entry, "", now_s)

    def _retry(self, work: PassWork, entry: Entry, failed: str, effect: str, cause: str, now_s: float) -> None:
        """Try a pass again once what stopped it has gone, as long as enough of it is left."""
        if work.failed_s is None:
            work.failed_s = now_s
            refused = self.expected_state.value("track.refused") or ""
            # A fault with its own alarm says nothing of this pass, nor does a node that starts.
            others = NOT_OFFERED in failed or refused.startswith(OF_ANTENNA)
            explained = effect != "continue" or others or self.expected_state.value("antenna.fault")
            work.fruitless = 0 if work.counted[0] >= REJOIN_S else work.fruitless + (EXPLAINED if explained else 1.0)
            work.reasons.append(failed)
            work.count()
            self._note(now_s, work.id, "attempt failed", failed)
            self.take("pass", {"refused": "" if explained else refused}, now_s)
            self._save()
        too_late = entry.item.los_t_s - now_s < REJOIN_S
        if too_late or self.state_name == NightState.STOPPING:
            self._close(work, entry, cause or failed if too_late else failed, now_s)
            return
        held_up = effect != "continue" or self.state_name != NightState.RUNNING or self._action is not None
        if held_up or not self._seen(now_s) or now_s - work.failed_s < RETRY_S * min(6.0, work.fruitless):
            return
        if self._busy:
            # What is left of the attempt before would refuse the next one.
            self._begin_action("stop_pass", now_s)
            return
        work.number += 1
        work.failed_s, work.following = None, False
        self.take("pass", {"refused": ""}, now_s)
        work.executor = self._pass_executor(entry, now_s)
        self._note(now_s, work.id, "tried again", f"attempt {work.number}")

    def _end_early(self, work: PassWork, why: str, now_s: float) -> None:
        if not work.ending:
            work.ending = why
            self._note(now_s, work.id, "ended early", why)
            if self._busy:
                self._begin_action("stop_pass", now_s)
            self._save()

    def _close(self, work: PassWork, entry: Entry, why: str, now_s: float) -> None:
        """End the pass with its record."""
        if not why:
            work.count()
        work.give_outcome(entry)
        share = entry.tracked_s / entry.item.duration_s
        if not why and not entry.item.scan and share < self.least_share:
            why = f"{100 * share:.0f} % of the pass was held, must be >= {100 * self.least_share:.0f} %"
            why = ": ".join(filter(None, (why, "; ".join(dict.fromkeys(work.reasons)))))
        state = PassState.LOST if why else PassState.TRACKED
        if why in BY_OPERATOR:
            state = PassState.SKIPPED
        elif entry.state == PassState.STANDBY:
            state, why = PassState.YIELDS, f"a partner had it: {why or 'this antenna stood by'}"
        elif why and self.recovery.effect()[0] == "weather":
            state = PassState.WEATHER
        self.schedule.end(entry, state, why or (SCANNED if entry.item.scan else LOSS_OF_SIGNAL))
        self._work, self._planned_s, self._rest = None, -math.inf, ""
        self._end_entry(entry, work, now_s)
        refused = "" if state == PassState.TRACKED else self.expected_state.value("pass.refused") or ""
        self.take("pass", {"refused": refused}, now_s)
        if self.expected_state.value("recorder.state") == "recording":
            self._begin_action("end_record", now_s)
        self._save()

    def _end_entry(self, entry: Entry, work: PassWork | None, now_s: float) -> None:
        """Write the record of a pass that is over."""
        self._record(entry, work)
        self._note(now_s, entry.item.id, str(entry.state), entry.reason)

    def _record(self, entry: Entry, work: PassWork | None) -> None:
        self.records.append(record_of(entry, work, self.book, self.expected_state, self.band))

    def _step_between(self, now_s: float, effect: str, cause: str) -> None:
        """Begin the next pass when it is due, and rest until then."""
        place = self._place(now_s)
        for entry in self.schedule.expire(now_s):
            entry.reason = cause or entry.reason
            entry.state = PassState.WEATHER if effect == "weather" else entry.state
            self._end_entry(entry, None, now_s)
            self._save()
        if self.state_name == NightState.STOPPING or effect == "stop":
            self._finish(cause if effect == "stop" else STOPPED, now_s)
            return
        self._replan_in_time(now_s)
        following = self.schedule.next()
        if following is None and place is not None and not any(e.planned for e in self.schedule.entries.values()):
            self._finish("the schedule is done", now_s)
        elif self.state_name == NightState.PAUSED or self._action is not None or place is None:
            return
        elif effect != "continue":
            self.reason = cause
        elif following is not None and now_s >= self.schedule.begins_s(following, place):
            self._begin_pass(following, now_s)
        else:
            self._settle(now_s, place, following)

    def _settle(self, now_s: float, place: Pair, following: Entry | None) -> None:
        """Hold, park, stow or unwind between two passes."""
        rest, goal = self.schedule.between(now_s, place)
        self.reason = f"{rest} until {following.item.name or following.item.target if following else 'nothing'}"
        mode = self.expected_state.value("antenna.mode")
        if rest == "hold" or mode in _AT_REST.get(rest, ()):
            return
        if rest == self._rest and now_s - self._rest_s < REST_RETRY_S:
            return
        self._rest, self._rest_s = rest, now_s
        # With the brakes set the pass itself releases them in time for the longer slew.
        if goal is None or mode not in ("parked", "stowed", "disabled"):
            self._begin_action(rest, now_s, dict(zip(("azimuth", "elevation"), goal or (), strict=False)))

    def _finish(self, why: str, now_s: float) -> None:
        """End the night: the antenna is stowed."""
        if self._action is not None:
            return
        mode, fault = self.expected_state.value("antenna.mode"), self.expected_state.value("antenna.fault")
        if mode not in (None, "stowed", "stowing") and not fault and self._rest != "last stow":
            self._rest = "last stow"
            self._begin_action("stow", now_s)
            return
        left = PassState.SKIPPED if why in BY_OPERATOR else PassState.MISSED
        for entry in self.schedule.entries.values():
            if entry.state in (PassState.WAITING, PassState.YIELDS) and entry.planned:
                self.schedule.end(entry, left, why)
                self._record(entry, None)
        self.reason, self.ended_s = why, now_s
        self._become(NightState.IDLE, now_s, "ended", why)

    # Procedures

    def _begin_pass(self, entry: Entry, now_s: float) -> None:
        entry.state = PassState.STANDBY if entry.item.id in self.taken else PassState.ACTIVE
        entry.reason = ""
        self._work = PassWork(entry.item.id, self._pass_executor(entry, now_s), now_s)
        self._rest, self.reason = "", self.schedule.gap_text(entry.item)
        self._note(now_s, entry.item.id, "begun", self.reason)
        self._save()

    def _pass_executor(self, entry: Entry, now_s: float) -> Executor:
        item = entry.item
        # A restart may come long after the set of the pass in work.
        left_s = max(0.0, item.los_t_s - now_s)
        known = {
            "id": item.id, "target": item.target, "sensor": item.sensor or self.sensor,
            "band": item.band or self.band, "scan": item.scan,
            "search_from": max(0.0, item.aos_t_s - SEARCH_BACK_S), "patience_s": left_s + PATIENCE_S,
            "aos": item.aos_t_s, "los": item.los_t_s, "name": item.name, "priority": item.priority,
        }  # fmt: skip
        procedure = self._scan_procedure if item.scan else self.procedure
        given = {name: value for name, value in known.items() if name in procedure.parameters}
        # Windows count from the rise, in each attempt.
        return self._executor(procedure, given, item.aos_t_s)

    def _begin_action(self, name: str, now_s: float, parameters: Mapping[str, Any] | None = None) -> None:
        if self._action is None:
            self._action = self._executor(self.table.actions[name], dict(parameters or {}), now_s)

    def _step_action(self, now_s: float) -> None:
        if self._action is not None:
            self._action.step(now_s)
            if self._action.finished or self._action.failed:
                words = [block_text(name, run.state, run.reason) for name, run in self._action.runs.items()]
                self._note(now_s, "", self._action.procedure.name, "; ".join(words))
                self._action = None

    def _executor(self, procedure: Procedure, parameters: dict[str, Any], zero_s: float) -> Executor:
        def send(own: int, directive: Directive, arguments: dict[str, Any]) -> None:
            self._number += 1
            self._numbers[self._number] = executor, own
            # Written before it leaves: a restart must know of every motion that was requested.
            self._save()
            self._send(self._number, directive.name, arguments)

        executor = Executor(procedure, parameters, self.expected_state, send, zero_s)
        executor.journal = self.journal
        return executor

    def _replan_in_time(self, now_s: float) -> None:
        place = self._place(now_s)
        if place is not None and (self._planned_s < 0.0 or now_s - self._planned_s > REPLAN_S):
            self.schedule.replan(now_s, place, self.taken)
            self._planned_s = now_s

    def _place(self, now_s: float) -> Pair | None:
        azimuth, elevation = (self.expected_state.value(f"antenna.{name}") for name in ("azimuth", "elevation"))
        if azimuth is None or elevation is None or not self.expected_state.is_fresh("antenna.azimuth", now_s, LATE_S):
            return None
        return float(azimuth), float(elevation)

    @property
    def _busy(self) -> bool:
        """Whether the controller has a pass, as far as is known."""
        return bool(self.expected_state.value("tracking.target"))

    def _note(self, t_s: float, block: str, event: str, detail: str = "") -> None:
        self.journal.append(JournalEntry(t_s, block, "", event, detail))

    def blocks(self) -> list[tuple[str, BlockRun]]:
        """Return name and run of each block of the present procedures that has begun and lasts."""
        running = [each for each in (self._work and self._work.executor, self._action) if each]
        return [
            (name, run) for executor in running for name, run in executor.runs.items()
            if run.state in (BlockState.EXECUTING, BlockState.PAUSED, BlockState.ANOMALY)
        ]  # fmt: skip

    # State

    def state(self) -> dict[str, Any]:
        """Return where the night is, for a file."""
        return {
            "version": 1, "state": str(self.state_name),
            "begun_s": None if math.isnan(self.begun_s) else self.begun_s,
            "schedule": self.schedule.state(), "attempt": self._work and self._work.state(),
            "alarms": self.book.state(), "tries": self.recovery.state(),
            "records": [dataclasses.asdict(record) for record in self.records],
        }  # fmt: skip

    def restore(self, state: Mapping[str, Any], now_s: float) -> None:
        """Take over a state; nothing is sent before the station has been seen.

        Raises ValueError for a state of another version, or without what a night keeps.
        """
        try:
            if state["version"] != 1:
                raise ValueError(f"version={state['version']} must be 1")
            self.schedule.restore(state["schedule"])
            self.state_name, self.begun_s = NightState(state["state"]), float(state["begun_s"] or now_s)
            self.book.restore(state["alarms"])
            self.recovery.restore(state.get("tries", {}), now_s)
            rows = state["records"]
            self.records = [PassRecord(**row | {"causes": tuple(row["causes"])}) for row in rows]
            if (kept := state["attempt"]) is not None:
                executor = self._pass_executor(self.schedule.entry(kept["id"]), now_s)
                self._work = PassWork(**{**kept, "executor": executor})
                executor.restore(kept["executor"], now_s)
        except (KeyError, TypeError) as error:
            raise ValueError(f"no state of a night: {error}") from error
        self._note(now_s, "", "restored", str(self.state_name))
        self.look_again()

    def look_again(self) -> None:
        """Do nothing before the station has been seen: it was left alone until now."""
        self._unproved = True
