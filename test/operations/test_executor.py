"""Execution of procedures: the behaviour of the operator assistant, with lost and late messages."""

import json
from typing import Any

import numpy as np
import pytest

from rf_pointing.operations import Directive, Executor, ExpectedState, Procedure, read_procedure

DICTIONARY = dict.fromkeys("abcdefg", ("value",)) | {"station/do": ("what", "which")}
DURATIONS_S = {"a": 6.0, "b": 9.0, "c": 8.0, "d": 7.0, "e": 5.0, "f": 4.0, "g": 6.0}
NETWORK = {"a": [], "b": ["a"], "c": ["a"], "d": ["a"], "e": ["b", "c"], "f": ["d"], "g": ["e", "f"]}
TICK_S = 0.1


def seven_blocks() -> Procedure:
    lines = ["version: 1", "name: seven", "blocks:"]
    for name, after in NETWORK.items():
        lines += [
            f"  {name}:", f"    after: {after}", "    timeout_s: 30", "    directives:",
            f"      - {{send: {name}, expect: {{dev.{name}: done}}}}",
        ]  # fmt: skip
    return read_procedure("\n".join(lines), DICTIONARY)


class Station:
    """Devices that answer after a while and show their state from then on, in every report of theirs."""

    def __init__(self, expected_state: ExpectedState, *, lost: float = 0.0, seed: int = 1):
        self.expected_state, self.sent, self._pending = expected_state, [], []
        self._lost, self._random = lost, np.random.default_rng(seed)
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
            self._state[f"dev.{each[2]}"] = "done"
            # An event notice, which may be lost.
            self._publish(f"dev.{each[2]}", now_s)
            self.executor.respond(each[1], True, "", now_s)
        if round(now_s / TICK_S) % 10 == 0:
            for name in self._state:
                self._publish(name, now_s)

    def _publish(self, name: str, now_s: float) -> None:
        if self._random.random() >= self._lost:
            self.expected_state.observe(name, self._state[name], now_s)


def run(procedure: Procedure, until_s: float = 60.0, **station: Any) -> tuple[Executor, Station, float]:
    expected_state = ExpectedState()
    devices = Station(expected_state, **station)
    executor = devices.executor = Executor(procedure, {}, expected_state, devices.send)
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


class Run:
    """An executor of a text of blocks, and the numbers and names of what it has sent."""

    def __init__(self, blocks: str, parameters: str = "{}", **options: float) -> None:
        text = f"version: 1\nname: r\nparameters: {parameters}\nblocks:\n{blocks}"
        self.expected_state = ExpectedState()
        self.sent: list[tuple[int, str]] = []
        self.executor = Executor(
            read_procedure(text, DICTIONARY), {}, self.expected_state,
            lambda n, d, _: self.sent.append((n, d.name)), **options,
        )  # fmt: skip

    def step(self, *times_s: float) -> str:
        for t_s in times_s:
            self.executor.step(t_s)
        return self.state("one")

    def restart(self, t_s: float) -> None:
        self.executor.restore(json.loads(json.dumps(self.executor.state())), t_s)
        self.executor.resume(t_s)

    def state(self, name: str) -> str:
        return str(self.executor.runs[name].state)

    def reason(self, name: str = "one") -> str:
        return self.executor.runs[name].reason

    def events(self) -> list[tuple[float, str, str, str]]:
        rows = [(e.t_s, e.block, e.directive, e.event) for e in self.executor.journal]
        self.executor.journal.clear()
        return rows


TWO_SENDS = "  one: {timeout_s: 10, skippable: true, directives: [{send: a}, {send: b, expect: {x.y: 1}}]}"


@pytest.mark.parametrize(
    ("t_s", "state"), [(1009.75, "inactive"), (1010.0, "executing"), (1020.0, "executing"), (1020.25, "anomaly")]
)
def test_a_window_holds_its_ends(t_s: float, state: str) -> None:
    one = Run("  one: {window_s: [10, 20], directives: [{send: a}]}", zero_s=1000.0)
    assert one.step(t_s) == state
    if state == "anomaly":
        assert one.reason() == "20.2 s is past the window, must be <= 20 s"
    assert one.sent == ([(1, "a")] if state == "executing" else [])


def test_preconditions_are_waited_for_from_when_the_block_might_have_begun() -> None:
    one = Run("  one: {window_s: [10, 90], before: {x.y: 1}, timeout_s: 5, directives: [{send: a}]}")
    assert one.step(0.0, 9.0, 10.0, 15.0) == "inactive"
    assert one.step(15.25) == "anomaly"
    assert one.reason() == "preconditions: x y is unknown, must be 1"
    assert one.executor.finished
    assert not one.executor.succeeded
    one = Run("  one: {window_s: [10, 90], before: {x.y: 1}, timeout_s: 5, directives: [{send: a}]}")
    assert one.step(10.0) == "inactive"
    one.expected_state.observe("x.y", 1, 14.0)
    assert one.step(14.0) == "executing"
    assert one.sent == [(1, "a")]
    assert one.events()[0] == (14.0, "one", "", "executing")


def test_a_response_is_waited_for_from_its_directive_on() -> None:
    one = Run(TWO_SENDS)
    one.step(0.0, 7.0)
    assert one.sent == [(1, "a")]
    one.executor.respond(1, True, "", 8.0)
    one.step(9.0)
    assert one.sent == [(1, "a"), (2, "b")]
    assert one.step(19.0) == "executing"
    assert one.step(19.25) == "anomaly"
    assert one.reason() == "b: no response for 10 s"


def test_a_state_is_waited_for_from_the_last_response_on() -> None:
    one = Run(TWO_SENDS)
    one.step(0.0)
    one.executor.respond(1, True, "", 1.0)
    one.step(1.0)
    one.executor.respond(2, True, "", 8.0)
    assert one.step(18.0) == "executing"
    assert one.step(18.25) == "anomaly"
    assert one.reason() == "not shown: x y is unknown, must be 1"


def test_what_is_left_to_show_is_named_of_every_directive_and_of_the_block() -> None:
    one = Run("  one: {timeout_s: 1, then: {p.q: 3}, directives: [{send: a, expect: {x.y: 1, x.z: 2}}]}")
    one.step(0.0)
    one.executor.respond(1, True, "", 1.0)
    assert one.step(5.0) == "anomaly"
    assert one.reason() == (
        "not shown: x y is unknown, must be 1; x z is unknown, must be 2; p q is unknown, must be 3"
    )


def test_postconditions_show_after_the_last_directive() -> None:
    one = Run("  one: {then: {p.q: 3}, directives: [{send: a, expect: {x.y: 1}}, {send: b}]}")
    one.step(0.0)
    one.executor.respond(1, True, "", 1.0)
    one.step(2.0)
    one.executor.respond(2, True, "", 3.0)
    # Between the two directives: enough for the first one's state, too early for the block's.
    one.expected_state.observe("x.y", 1, 1.5)
    one.expected_state.observe("p.q", 3, 1.5)
    assert one.step(4.0) == "executing"
    one.expected_state.observe("p.q", 3, 2.0)
    assert one.step(5.0) == "completed"
    assert one.events()[-1] == (5.0, "one", "", "completed")


def test_what_shows_a_failure_ends_a_block_at_once_if_it_is_from_after_the_response() -> None:
    one = Run("  one: {fails: {x.y: 9, x.z: 8}, then: {p.q: 3}, directives: [{send: a}]}")
    one.step(0.0)
    for name, value in (("x.y", 9), ("x.z", 8)):
        one.expected_state.observe(name, value, 0.5)
    one.executor.respond(1, True, "", 1.0)
    assert one.step(1.5) == "executing", "from before the response"
    one.expected_state.observe("x.y", 9, 2.0)
    assert one.step(2.0) == "executing", "one of two"
    one.expected_state.observe("x.z", 8, 2.0)
    assert one.step(2.5) == "anomaly"
    assert one.reason() == "x y is 9 and x z is 8"


def test_a_directive_whose_condition_does_not_hold_is_left_out_and_needs_nothing_to_show() -> None:
    one = Run("  one: {timeout_s: 5, directives: [{send: a, when: {m.n: 1}, expect: {x.y: 1}}, {send: b}]}")
    one.expected_state.observe("m.n", 2, 3.0)
    assert one.step(3.0) == "executing"
    assert one.sent == []
    one.step(4.0)
    assert one.sent == [(1, "b")]
    one.executor.respond(1, True, "", 4.0)
    assert one.step(4.0) == "completed"
    assert (3.0, "one", "a", "left out") in one.events()


def test_after_a_directive_that_is_left_out_the_block_has_its_whole_time() -> None:
    one = Run("  one: {timeout_s: 5, then: {x.y: 1}, directives: [{send: a, when: {m.n: 1}}]}")
    one.expected_state.observe("m.n", 2, 0.0)
    one.expected_state.observe("m.n", 2, 8.0)
    assert one.step(8.0, 13.0) == "executing"
    assert one.step(13.25) == "anomaly"


def test_what_is_sent_and_accepted_is_noted_and_only_what_shows_later_counts() -> None:
    given = "{what: '${w}', which: '${x.pass}'}"
    one = Run(f"  one: {{directives: [{{send: station/do, with: {given}, expect: {{x.y: 1}}}}]}}", "{w: 5}")
    one.expected_state.observe("x.y", 1, 1.0)
    # A whole message takes 900 characters of a line.
    one.expected_state.observe("x.pass", object(), 1.0)
    one.step(2.0)
    one.executor.respond(1, True, "on its way", 3.0)
    noted = [(e.event, e.detail) for e in one.executor.journal]
    assert noted == [("executing", ""), ("sent", "what=5, which from x.pass"), ("accepted", "on its way")]
    assert one.step(3.0) == "executing", "what was seen before the directive does not count"
    one.expected_state.observe("x.y", 1, 3.5)
    one.step(4.0)
    assert one.executor.succeeded


def test_a_live_value_that_is_not_known_is_an_anomaly_and_nothing_leaves() -> None:
    one = Run("  one: {directives: [{send: station/do, with: {what: '${p.q}'}}]}")
    assert one.step(0.0) == "anomaly"
    assert (one.reason(), one.sent) == ("station/do: what: p.q is not known yet", [])
    assert one.step(1.0) == "anomaly"


def test_a_late_response_to_a_directive_that_failed_completes_nothing_by_itself() -> None:
    one = Run(TWO_SENDS)
    one.step(0.0, 10.25)
    assert one.state("one") == "anomaly"
    one.executor.respond(1, True, "late", 11.0)
    # Its second directive was never sent.
    one.expected_state.observe("x.y", 1, 11.0)
    assert one.step(11.5) == "anomaly"
    assert one.sent == [(1, "a")]


def test_an_anomaly_whose_state_shows_late_is_completed_and_its_reason_is_gone() -> None:
    one = Run("  one: {timeout_s: 2, directives: [{send: a, expect: {x.y: 1}}]}\n  two: {after: [one]}")
    one.step(0.0)
    one.executor.respond(1, True, "", 0.5)
    assert one.step(3.0) == "anomaly"
    assert one.state("two") == "inactive"
    one.expected_state.observe("x.y", 1, 4.0)
    assert one.step(4.0) == "completed"
    assert one.reason() == ""
    assert one.state("two") == "completed", "in the same step"


def test_a_block_without_directives_that_failed_does_not_complete_by_itself() -> None:
    one = Run("  one: {timeout_s: 2, before: {x.y: 1}}")
    assert one.step(0.0, 2.5) == "anomaly"
    one.expected_state.observe("x.y", 1, 3.0)
    assert one.step(3.0) == "anomaly"


def test_a_block_before_that_fails_holds_up_what_follows_unless_it_is_optional() -> None:
    for optional, state in (("false", "inactive"), ("true", "completed")):
        one = Run(f"  one: {{optional: {optional}, directives: [{{send: a}}]}}\n  two: {{after: [one]}}")
        one.step(0.0)
        assert not one.executor.finished
        one.executor.respond(1, False, "no", 1.0)
        one.step(1.0)
        assert one.state("two") == state
        assert one.executor.finished
        assert one.executor.succeeded is (optional == "true")


def test_a_report_of_failure_counts_once_for_an_accepted_directive_of_a_block_at_work() -> None:
    one = Run(TWO_SENDS)
    one.step(0.0)
    one.executor.fail(1, "broke", 0.5)
    assert one.state("one") == "executing", "it was not accepted yet"
    one.executor.respond(1, True, "", 1.0)
    one.executor.fail(1, "broke", 1.5)
    assert (one.state("one"), one.reason()) == ("anomaly", "broke")
    one.executor.fail(1, "broke again", 2.5)
    assert one.reason() == "broke"
    assert (1.5, "one", "", "anomaly") in one.events()


def test_a_failure_of_a_block_that_is_done_changes_nothing() -> None:
    one = Run("  one: {directives: [{send: a}]}")
    one.step(0.0)
    one.executor.respond(1, True, "", 1.0)
    assert one.step(1.0) == "completed"
    one.executor.fail(1, "late", 2.0)
    assert (one.state("one"), one.reason()) == ("completed", "")


def test_a_rejection_after_a_block_was_skipped_changes_nothing() -> None:
    one = Run(TWO_SENDS)
    one.step(0.0)
    one.executor.skip(0.5, "one")
    one.executor.respond(1, False, "no", 1.0)
    assert (one.state("one"), one.executor.succeeded) == ("skipped", True)
    with pytest.raises(ValueError, match="must not be skipped"):
        Run("  one: {directives: [{send: a}]}").executor.skip(0.0, "one")
    assert one.events()[-2:] == [(0.5, "one", "", "skipped"), (1.0, "", "", "unexpected response")]


def test_restarted_at_its_second_directive_only_that_is_sent_again() -> None:
    one = Run(TWO_SENDS)
    one.step(0.0)
    one.executor.respond(1, True, "", 1.0)
    one.step(1.0, 2.0)
    one.restart(20.0)
    assert one.step(20.0) == "executing"
    assert one.sent == [(1, "a"), (2, "b"), (3, "b")]
    # The first answer to it comes too late to be that of the second attempt.
    one.executor.respond(2, True, "", 21.0)
    one.expected_state.observe("x.y", 1, 21.0)
    assert one.step(21.0) == "executing"
    one.executor.respond(3, True, "", 22.0)
    assert one.step(22.0) == "completed"


@pytest.mark.parametrize(("seen_s", "sends"), [(0.5, 2), (1.0, 1)])
def test_restarted_a_directive_whose_state_shows_since_it_was_sent_is_not_sent_again(seen_s: float, sends: int) -> None:
    one = Run("  one: {timeout_s: 5, directives: [{send: a, expect: {x.y: 1}}]}")
    one.step(1.0, 2.0)
    one.expected_state.observe("x.y", 1, seen_s)
    one.restart(8.0)
    one.step(8.0)
    assert len(one.sent) == sends
    assert one.state("one") == ("completed" if sends == 1 else "executing")


def test_the_state_holds_where_every_block_is_and_a_restored_one_goes_on_there() -> None:
    text = TWO_SENDS + "\n  two: {directives: [{send: c}]}\n  three: {after: [two], directives: [{send: d}]}"
    one = Run(text, "{w: 5}", zero_s=100.0)
    one.step(100.0)
    one.executor.respond(1, True, "", 101.0)
    one.step(101.0)
    one.executor.respond(2, False, "no", 102.0)
    assert one.executor.state() == {
        "procedure": "r", "parameters": {"w": 5}, "zero_s": 100.0, "blocks": {
            "one": {"state": "executing", "answered": 1, "sent_s": [100.0, 101.0], "reason": ""},
            "two": {"state": "anomaly", "answered": 0, "sent_s": [100.0], "reason": "c was rejected: no"},
            "three": {"state": "inactive", "answered": 0, "sent_s": [], "reason": ""},
        },
    }  # fmt: skip
    again = Run(text, "{w: 5}")
    again.executor.restore(json.loads(json.dumps(one.executor.state())), 200.0)
    assert again.executor.paused
    assert [again.state(name) for name in ("one", "two", "three")] == ["paused", "anomaly", "inactive"]
    assert again.reason("two") == "c was rejected: no"
    assert again.events() == [(200.0, "", "", "restored")]
    again.executor.resume(201.0)
    again.step(201.0)
    assert (again.sent, again.state("two")) == ([(1, "b")], "anomaly")
    again.executor.respond(1, True, "", 202.0)
    # From the restart on the block has its whole time.
    again.executor.fail(1, "x", 203.0)
    assert again.state("one") == "anomaly"
    other = dict(one.executor.state(), blocks={"one": {}})
    with pytest.raises(ValueError, match="the state is that of 'r', must be of 'r'"):
        again.executor.restore(other, 0.0)


def test_a_restored_block_whose_directives_are_answered_waits_from_the_restart_for_its_state() -> None:
    text = "  one: {timeout_s: 10, directives: [{send: a, expect: {x.y: 1}}]}"
    one = Run(text)
    one.step(0.0)
    one.executor.respond(1, True, "", 1.0)
    for resumed in (True, False):
        again = Run(text)
        again.executor.restore(one.executor.state(), 500.0)
        if resumed:
            again.executor.resume(500.0)
            assert again.step(510.0) == "executing"
            assert again.step(510.25) == "anomaly"
            assert again.sent == []
        else:
            assert again.step(600.0) == "paused"
