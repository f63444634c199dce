"""Execution of procedures: the behaviour of the operator assistant, with lost and late messages."""

import json
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from rf_pointing.operations import BlockState, Directive, Executor, Procedure, Situation, read_procedure

DICTIONARY = dict.fromkeys("abcdefg", ("value",)) | {"station/do": ("what",)}
DURATIONS_S = {"a": 6.0, "b": 9.0, "c": 8.0, "d": 7.0, "e": 5.0, "f": 4.0, "g": 6.0}
NETWORK = {"a": [], "b": ["a"], "c": ["a"], "d": ["a"], "e": ["b", "c"], "f": ["d"], "g": ["e", "f"]}
TICK_S = 0.1


def seven_blocks(**changes: str) -> Procedure:
    lines = ["version: 1", "name: seven", "blocks:"]
    for name, after in NETWORK.items():
        lines += [
            f"  {name}:",
            f"    after: {after}",
            "    timeout_s: 30",
            "    directives:",
            f"      - {{send: {name}, expect: {{dev.{name}: done}}}}",
            *(f"    {key}: {value}" for key, value in changes.items()),
        ]
    return read_procedure("\n".join(lines), DICTIONARY)


class Station:
    """Devices that answer after a while and show their state from then on, in every report of theirs."""

    def __init__(self, situation: Situation, *, lost: float = 0.0, seed: int = 1, shows: Callable[[str], bool] = bool):
        self.situation, self.sent, self._pending = situation, [], []
        self._lost, self._random, self._shows = lost, np.random.default_rng(seed), shows
        self.now_s = 0.0
        self.executor: Executor | None = None
        self._state: dict[str, str] = {}

    def send(self, number: int, directive: Directive, arguments: dict[str, Any]) -> None:
        self.sent.append((self.now_s, directive.name, arguments))
        self._pending.append((self.now_s + DURATIONS_S.get(directive.name, 1.0), number, directive.name))

    def step(self, now_s: float) -> None:
        self.now_s = now_s
        for each in [each for each in self._pending if each[0] <= now_s + 1e-9]:
            self._pending.remove(each)
            if self._shows(each[2]):
                self._state[f"dev.{each[2]}"] = "done"
                # An event notice, which may be lost.
                self._publish(f"dev.{each[2]}", now_s)
            self.executor.respond(each[1], True, "", now_s)
        if round(now_s / TICK_S) % 10 == 0:
            for name in self._state:
                self._publish(name, now_s)

    def _publish(self, name: str, now_s: float) -> None:
        if self._random.random() >= self._lost:
            self.situation.observe(name, self._state[name], now_s)


def run(procedure: Procedure, until_s: float = 60.0, **station: Any) -> tuple[Executor, Station, float]:
    situation = Situation()
    devices = Station(situation, **station)
    executor = devices.executor = Executor(procedure, {}, situation, devices.send)
    for k in range(round(until_s / TICK_S) + 1):
        devices.step(k * TICK_S)
        executor.step(k * TICK_S)
        if executor.finished:
            return executor, devices, k * TICK_S
    return executor, devices, until_s


def test_network_ends_at_its_critical_path_of_26_of_45() -> None:
    executor, devices, end_s = run(seven_blocks())
    assert executor.succeeded
    assert sum(DURATIONS_S.values()) == 45.0
    assert end_s == pytest.approx(26.0, abs=TICK_S)
    began_s = {name: t_s for t_s, name, _ in devices.sent}
    assert [began_s[name] for name in "bcd"] == pytest.approx([6.0] * 3, abs=TICK_S)
    assert began_s["g"] >= 20.0


@pytest.mark.parametrize("seed", range(5))
def test_a_fifth_of_the_messages_lost_changes_only_the_time(seed: int) -> None:
    executor, _, end_s = run(seven_blocks(), lost=0.2, seed=seed)
    assert executor.succeeded
    assert 26.0 - TICK_S <= end_s <= 26.0 + 7 * 3.0


def test_acknowledged_directive_without_its_state_is_an_anomaly_and_holds_up_what_follows() -> None:
    executor, devices, _ = run(seven_blocks(timeout_s="12"), shows=lambda name: name != "d", until_s=30.0)
    assert executor.runs["d"].state == BlockState.ANOMALY
    assert "dev.d is unknown" in executor.runs["d"].reason
    assert [executor.runs[name].state for name in "fg"] == [BlockState.INACTIVE] * 2
    assert executor.runs["e"].state == BlockState.COMPLETED
    # The late event notice completes it, and the network goes on.
    devices.situation.observe("dev.d", "done", 30.0)
    executor.step(30.0)
    assert executor.runs["d"].state == BlockState.COMPLETED
    assert executor.runs["f"].state == BlockState.EXECUTING


TWO = """
version: 1
name: two
parameters: {what: null}
blocks:
  one:
    directives:
      - {send: station/do, with: {what: "${what}"}, expect: {x.y: 1}}
      - {send: a, with: {value: "${weather.temperature}"}}
    skippable: true
"""


def two() -> tuple[Executor, list[tuple[int, str, dict[str, Any]]], Situation]:
    sent: list[tuple[int, str, dict[str, Any]]] = []
    situation = Situation()
    procedure = read_procedure(TWO, DICTIONARY)
    return (
        Executor(procedure, {"what": "go"}, situation, lambda n, d, a: sent.append((n, d.name, a))),
        sent,
        situation,
    )


def test_second_directive_waits_for_the_response_to_the_first_and_takes_live_values() -> None:
    executor, sent, situation = two()
    situation.observe("weather.temperature", 12.5, 0.0)
    for t_s in (0.0, 1.0, 2.0):
        executor.step(t_s)
    assert sent == [(1, "station/do", {"what": "go"})]
    executor.respond(1, True, "", 2.5)
    executor.step(3.0)
    assert sent[1:] == [(2, "a", {"value": 12.5})]
    assert executor.progress("one") == 0.5


def test_rejected_directive_stops_its_block_until_it_is_resumed() -> None:
    executor, sent, situation = two()
    situation.observe("weather.temperature", 12.5, 0.0)
    executor.step(0.0)
    executor.respond(1, False, "mode is stowed", 1.0)
    executor.step(2.0)
    assert (executor.runs["one"].state, len(sent)) == (BlockState.ANOMALY, 1)
    assert executor.runs["one"].reason == "station/do was rejected: mode is stowed"
    executor.resume(3.0, "one")
    executor.step(3.0)
    executor.step(3.1)
    assert [name for _, name, _ in sent] == ["station/do", "station/do"]


def test_state_from_before_the_directive_does_not_count() -> None:
    executor, _, situation = two()
    situation.observe("weather.temperature", 12.5, 9.0)
    situation.observe("x.y", 1, 9.0)
    executor.step(10.0)
    executor.respond(1, True, "", 10.5)
    executor.step(11.0)
    executor.respond(2, True, "", 11.5)
    executor.step(12.0)
    assert executor.runs["one"].state == BlockState.EXECUTING
    situation.observe("x.y", 1, 12.5)
    executor.step(13.0)
    assert executor.succeeded


def test_killed_executor_sends_nothing_by_itself_and_knows_where_it_was() -> None:
    executor, _, situation = two()
    situation.observe("weather.temperature", 12.5, 0.0)
    executor.step(0.0)
    kept = json.loads(json.dumps(executor.state()))
    again: list[tuple[int, str, dict[str, Any]]] = []
    restored = Executor(executor.procedure, {"what": "go"}, situation, lambda n, d, a: again.append((n, d.name, a)))
    restored.restore(kept, 5.0)
    for t_s in (5.0, 6.0):
        restored.step(t_s)
    assert not again
    assert (restored.runs["one"].state, restored.runs["one"].reason) == (
        BlockState.PAUSED,
        "the executive was restarted here",
    )
    # What the first directive was to reach has shown meanwhile: it is not sent again.
    situation.observe("x.y", 1, 4.0)
    restored.resume(7.0)
    restored.step(7.0)
    assert [name for _, name, _ in again] == ["a"]
    with pytest.raises(ValueError, match="must be of 'two'"):
        restored.restore({"procedure": "other", "blocks": {}}, 0.0)


def test_pause_holds_the_next_directive_back_and_resume_sends_it_once() -> None:
    executor, sent, situation = two()
    situation.observe("weather.temperature", 12.5, 0.0)
    executor.step(0.0)
    executor.pause(0.5)
    executor.respond(1, True, "", 1.0)
    executor.step(2.0)
    assert len(sent) == 1
    executor.resume(3.0)
    executor.step(3.0)
    executor.step(4.0)
    assert [name for _, name, _ in sent] == ["station/do", "a"]


def test_operator_skips_a_directive_and_a_block_that_may_be_skipped() -> None:
    executor, sent, situation = two()
    situation.observe("weather.temperature", 12.5, 0.0)
    executor.step(0.0)
    executor.skip_directive(1.0, "one")
    executor.step(1.0)
    assert [name for _, name, _ in sent] == ["station/do", "a"]
    executor.skip(2.0, "one")
    assert executor.succeeded
    with pytest.raises(ValueError, match="must not be skipped"):
        Executor(seven_blocks(), {}, situation, lambda *_: None).skip(0.0, "a")


def test_optional_block_that_fails_does_not_hold_the_procedure_up() -> None:
    executor, _, _ = run(seven_blocks(optional="true", timeout_s="12"), shows=lambda name: name != "d")
    assert executor.runs["d"].state == BlockState.ANOMALY
    assert executor.succeeded


def test_block_begins_in_its_window_and_not_after_it() -> None:
    text = "version: 1\nname: w\nblocks:\n  one: {window_s: [10, 20], directives: [{send: a}]}"
    for first_s, state in ((5.0, BlockState.INACTIVE), (15.0, BlockState.EXECUTING), (25.0, BlockState.ANOMALY)):
        executor = Executor(read_procedure(text, DICTIONARY), {}, Situation(), lambda *_: None, zero_s=1000.0)
        executor.step(1000.0 + first_s)
        assert executor.runs["one"].state == state
    assert "must be <= 20 s" in executor.runs["one"].reason


def test_precondition_that_does_not_come_true_in_time_names_value_and_condition() -> None:
    text = (
        "version: 1\nname: p\nblocks:\n  one: {before: {antenna.mode: holding}, timeout_s: 5, directives: [{send: a}]}"
    )
    situation, sent = Situation(), []
    executor = Executor(read_procedure(text, DICTIONARY), {}, situation, lambda *given: sent.append(given))
    for t_s in range(8):
        situation.observe("antenna.mode", "fault", float(t_s))
        executor.step(float(t_s))
    assert not sent
    assert executor.runs["one"].reason == "preconditions: antenna.mode=fault, must be: antenna.mode is holding"
    assert executor.finished
    assert not executor.succeeded


def test_journal_lists_every_directive_with_time_arguments_and_response() -> None:
    executor, _, situation = two()
    situation.observe("weather.temperature", 12.5, 0.0)
    executor.step(0.0)
    executor.respond(1, True, "on its way", 1.0)
    executor.respond(77, True, "", 1.5)
    lines = [(e.t_s, e.block, e.directive, e.event, e.detail) for e in executor.journal]
    assert lines == [
        (0.0, "one", "", "executing", ""),
        (0.0, "one", "station/do", "sent", "what=go"),
        (1.0, "one", "station/do", "accepted", "on its way"),
        (1.5, "", "", "unexpected response", "77: "),
    ]
