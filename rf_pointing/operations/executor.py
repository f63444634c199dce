"""Execution of a procedure: which block may begin, which directive goes out, what counts as done.

    inactive -> executing -> completed
                   |  ^
                paused  anomaly -> completed (the expected state shows late)
                                -> executing (retry)      any -> skipped (operator)

Directive k + 1 of a block leaves after the response to directive k; blocks run side by side.  A
response says only that a directive was received or rejected.  A block is completed when its
directives' expected states and its postconditions show, in values from after the directives.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from graphlib import TopologicalSorter
from typing import Any

from rf_pointing.operations.expected_state import ExpectedState
from rf_pointing.operations.procedure import Block, Directive, Procedure


class BlockState(StrEnum):
    """State of a block."""

    INACTIVE = "inactive"
    EXECUTING = "executing"
    PAUSED = "paused"
    ANOMALY = "anomaly"
    COMPLETED = "completed"
    SKIPPED = "skipped"


def block_text(name: str, state: str, reason: str) -> str:
    """Return what an operator reads of a block."""
    return f"{name}: {state}" + (f", {reason}" if reason else "")


DONE = (BlockState.COMPLETED, BlockState.SKIPPED)
_RESTARTED = "the executive was restarted here"


@dataclass(frozen=True, slots=True)
class JournalEntry:
    """One line of the report: what happened to which block or directive, and when."""

    t_s: float
    block: str
    directive: str
    event: str
    detail: str = ""


@dataclass(slots=True)
class BlockRun:
    """How far a block has come; `sent_s` are the times at which its directives were sent."""

    state: BlockState = BlockState.INACTIVE
    reason: str = ""
    ready_s: float = math.nan
    settled_s: float = math.nan
    sent_s: list[float] = field(default_factory=list)
    answered: int = 0

    @property
    def awaiting(self) -> bool:
        """Whether a directive waits for its response."""
        return len(self.sent_s) > self.answered


Send = Callable[[int, Directive, dict[str, Any]], None]
"""Sends a directive; its number comes back with the response."""


class Executor:
    """Runs one procedure; call `step` regularly and `respond` for every response.

    `zero_s` is the time from which the windows count; `send` must not block.
    """

    def __init__(
        self, procedure: Procedure, parameters: Mapping[str, Any], expected_state: ExpectedState,
        send: Send, zero_s: float = 0.0,
    ) -> None:  # fmt: skip
        self.parameters = procedure.with_parameters(parameters)
        self.procedure = procedure.with_timeouts(self.parameters)
        self.expected_state, self.zero_s, self._send = expected_state, zero_s, send
        self.runs = {name: BlockRun() for name in procedure.blocks}
        self.journal: list[JournalEntry] = []
        self.paused = False
        self._order = tuple(TopologicalSorter({n: b.after for n, b in procedure.blocks.items()}).static_order())
        self._sent: dict[int, str] = {}
        self._accepted: dict[int, str] = {}
        self._number = 0

    @property
    def succeeded(self) -> bool:
        """Whether every block is completed or skipped, or was optional."""
        return all(self._passed(name) for name in self.runs)

    @property
    def failed(self) -> str:
        """Why the procedure cannot succeed, "" if it can."""
        blocks = self.procedure.blocks
        return next((run.reason for name, run in self.runs.items()
                     if run.state == BlockState.ANOMALY and not blocks[name].optional), "")  # fmt: skip

    @property
    def finished(self) -> bool:
        """Whether nothing more can happen without an operator."""
        if self.succeeded:
            return True
        active = (BlockState.EXECUTING, BlockState.PAUSED)
        return not any(run.state in active or self._may_begin(name) for name, run in self.runs.items())

    def set_back(self, by_s: float) -> None:
        """Go on with a clock that was set back: every wait stays as long as it was."""
        for run in self.runs.values():
            run.ready_s, run.settled_s = run.ready_s - by_s, run.settled_s - by_s
            run.sent_s = [t_s - by_s for t_s in run.sent_s]

    def step(self, now_s: float) -> None:
        """Begin, go on with and complete what can be at `now_s`."""
        # In the order of the network, so that a block begins in the step in which the last one
        # before it is completed.
        for name in self._order:
            block, run = self.procedure.blocks[name], self.runs[name]
            if run.state == BlockState.INACTIVE and not self.paused and self._may_begin(name):
                self._begin(block, run, now_s)
            if run.state == BlockState.EXECUTING:
                self._go_on(block, run, now_s)
            elif run.state == BlockState.ANOMALY:
                self._recover(block, run, now_s)

    def respond(self, number: int, accepted: bool, text: str, now_s: float) -> None:
        """Take the response to the directive of this number; one that is not awaited is noted."""
        name = self._sent.pop(number, "")
        if not name:
            self._note(now_s, "", "", "unexpected response", f"{number}: {text}")
            return
        run = self.runs[name]
        directive = self.procedure.blocks[name].directives[run.answered]
        self._note(now_s, name, directive.name, "accepted" if accepted else "rejected", text)
        if accepted:
            self._accepted[number] = name
            run.answered += 1
            run.settled_s = now_s
        elif run.state not in DONE:
            self._fail(name, f"{directive.name} was rejected: {text}", now_s)

    def fail(self, number: int, text: str, now_s: float) -> None:
        """Take the report that an accepted directive has failed at its device."""
        name = self._accepted.pop(number, "")
        if name and self.runs[name].state == BlockState.EXECUTING:
            self._fail(name, text, now_s)

    # Controls

    def resume(self, now_s: float) -> None:
        """Go on after a restart: what was sent and does not show is sent again."""
        self._note(now_s, "", "", "resume")
        self.paused = False
        for name, run in self.runs.items():
            if run.state == BlockState.PAUSED:
                self._retry(self.procedure.blocks[name], run, now_s)

    def skip(self, now_s: float, name: str) -> None:
        """Leave a block out; ValueError if it may not be."""
        if not self.procedure.blocks[name].skippable:
            raise ValueError(f"{name} must not be skipped: it is not skippable")
        self.runs[name].state = BlockState.SKIPPED
        self._forget(name)
        self._note(now_s, name, "", "skipped")

    # State

    def state(self) -> dict[str, Any]:
        """Return where the procedure is, for a file; `restore` goes on from it."""
        return {
            "procedure": self.procedure.name, "parameters": self.parameters, "zero_s": self.zero_s,
            "blocks": {
                name: {"state": str(run.state), "answered": run.answered, "sent_s": run.sent_s, "reason": run.reason}
                for name, run in self.runs.items()
            },
        }  # fmt: skip

    def restore(self, state: Mapping[str, Any], now_s: float) -> None:
        """Take over a state; what was executing is paused, so that nothing starts by itself.

        Raises ValueError for the state of another procedure.
        """
        if state.get("procedure") != self.procedure.name or set(state.get("blocks", ())) != set(self.runs):
            raise ValueError(f"the state is that of {state.get('procedure')!r}, must be of {self.procedure.name!r}")
        for name, kept in state["blocks"].items():
            run = self.runs[name]
            run.state, run.reason = BlockState(kept["state"]), str(kept["reason"])
            run.answered, run.sent_s = int(kept["answered"]), [float(t_s) for t_s in kept["sent_s"]]
            run.settled_s = now_s
            if run.state == BlockState.EXECUTING:
                run.state, run.reason = BlockState.PAUSED, _RESTARTED
        # Blocks that have not begun wait as well: the operator, or a rule, resumes the whole.
        self.paused = True
        self._note(now_s, "", "", "restored")

    # Steps of a block

    def _passed(self, name: str) -> bool:
        run = self.runs[name]
        return run.state in DONE or (run.state == BlockState.ANOMALY and self.procedure.blocks[name].optional)

    def _may_begin(self, name: str) -> bool:
        waiting = self.runs[name].state == BlockState.INACTIVE
        return waiting and all(self._passed(before) for before in self.procedure.blocks[name].after)

    def _begin(self, block: Block, run: BlockRun, now_s: float) -> None:
        first_s, last_s = block.window_s
        if now_s - self.zero_s < first_s:
            return
        if now_s - self.zero_s > last_s:
            self._fail(block.name, f"{now_s - self.zero_s:.1f} s is past the window, must be <= {last_s:g} s", now_s)
            return
        if math.isnan(run.ready_s):
            run.ready_s = now_s
        reasons = self._unmet(block.before, now_s)
        if not reasons:
            run.state, run.settled_s = BlockState.EXECUTING, now_s
            self._note(now_s, block.name, "", "executing")
        elif now_s - run.ready_s > block.timeout_s:
            self._fail(block.name, f"preconditions: {reasons}", now_s)

    def _go_on(self, block: Block, run: BlockRun, now_s: float) -> None:
        if run.awaiting:
            if now_s - run.sent_s[-1] > block.timeout_s:
                late = block.directives[run.answered].name
                self._fail(block.name, f"{late}: no response for {block.timeout_s:g} s", now_s)
        elif run.answered < len(block.directives):
            self._send_next(block, run, now_s)
        elif not (reasons := self._missing(block, run, now_s)):
            self._complete(block, run, now_s)
        elif block.fails and not self._unmet(block.fails, now_s, max([run.settled_s, *run.sent_s])):
            # What a device says of it, rather than the conditions of the table.
            seen = (self.expected_state.value(each.attribute) for each in block.fails)
            words = "; ".join(each for each in seen if isinstance(each, str) and each)
            words = words or " and ".join(map(self.expected_state.shown, block.fails))
            self._fail(block.name, words, now_s)
        elif now_s - run.settled_s > block.timeout_s:
            self._fail(block.name, f"not shown: {reasons}", now_s)

    def _send_next(self, block: Block, run: BlockRun, now_s: float) -> None:
        directive = block.directives[run.answered]
        if self._unmet(directive.when, now_s):
            self._note(now_s, block.name, directive.name, "left out")
            run.sent_s.append(-math.inf)
            run.answered += 1
            run.settled_s = now_s
            return
        try:
            arguments = directive.filled(self.parameters, self.expected_state)
        except ValueError as error:
            self._fail(block.name, str(error), now_s)
            return
        self._number += 1
        self._sent[self._number] = block.name
        run.sent_s.append(now_s)
        self._note(now_s, block.name, directive.name, "sent", directive.shown(arguments))
        self._send(self._number, directive, arguments)

    def _recover(self, block: Block, run: BlockRun, now_s: float) -> None:
        """Complete a block whose state shows after all, however late."""
        if run.sent_s and run.answered == len(block.directives) and not self._missing(block, run, now_s):
            self._complete(block, run, now_s)

    def _complete(self, block: Block, run: BlockRun, now_s: float) -> None:
        run.state, run.reason = BlockState.COMPLETED, ""
        self._note(now_s, block.name, "", "completed")

    def _retry(self, block: Block, run: BlockRun, now_s: float) -> None:
        """Go on with the first directive without a response, unless its state shows already."""
        self._forget(block.name)
        if run.awaiting:
            pending = block.directives[run.answered]
            shown = pending.expected and not self._unmet(pending.expected, now_s, run.sent_s[run.answered])
            if shown:
                run.answered += 1
            else:
                del run.sent_s[run.answered :]
        run.state, run.reason, run.ready_s, run.settled_s = BlockState.EXECUTING, "", now_s, now_s
        if not run.sent_s:
            # Nothing was sent: the preconditions must hold first.
            run.state = BlockState.INACTIVE

    def _missing(self, block: Block, run: BlockRun, now_s: float) -> str:
        """Return what does not show of a block whose directives are answered."""
        shown = [
            self._unmet(directive.expected, now_s, sent_s)
            for directive, sent_s in zip(block.directives, run.sent_s, strict=True)
            if sent_s > -math.inf
        ]
        last_s = max(run.sent_s, default=-math.inf)
        return "; ".join(filter(None, [*shown, self._unmet(block.then, now_s, last_s)]))

    def _unmet(self, conditions: tuple[Any, ...], now_s: float, since_s: float = -math.inf) -> str:
        return "; ".join(
            filter(None, (self.expected_state.reason_not_met(each, now_s, since_s) for each in conditions))
        )

    def _fail(self, name: str, reason: str, now_s: float) -> None:
        self.runs[name].state, self.runs[name].reason = BlockState.ANOMALY, reason
        self._note(now_s, name, "", "anomaly", reason)

    def _forget(self, name: str) -> None:
        """Await no response of a block any longer."""
        self._sent = {number: other for number, other in self._sent.items() if other != name}

    def _note(self, t_s: float, block: str, directive: str, event: str, detail: str = "") -> None:
        self.journal.append(JournalEntry(t_s, block, directive, event, detail))
