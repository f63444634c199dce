"""Only who has the key commands the antenna; every part of a signature is signed."""

import time
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import pytest
from builtin_interfaces.msg import Time
from rf_pointing_msgs.msg import CommandSignature
from rf_pointing_msgs.srv import SignedCall

from rf_pointing.ros.command_key import CommandKey, CommandKeyParams
from rf_pointing.ros.diagnostics import ERROR, OK, WARN

TOPIC, NAME, NOW_S = "/gs1/joint_trajectory", "/gs1/pointing_controller", 1_200_000_000.0


def key_at(path: Path, topic: str = TOPIC) -> CommandKey:
    return CommandKey(CommandKeyParams(command_key_file=str(path)), topic)


def signed(key: CommandKey) -> CommandSignature:
    return key.sign(b"bytes of a command", Time(sec=1_151_384_000), 7, NAME)


def test_the_first_of_both_nodes_makes_the_key_and_the_other_reads_it(tmp_path: Path) -> None:
    path = tmp_path / "gs1" / "command.key"
    sender, receiver = key_at(path), key_at(path)
    assert path.stat().st_mode & 0o777 == 0o600
    assert len(path.read_text()) == 65
    for each in (receiver, key_at(path)):
        each.check(signed(sender))
        assert (each.key_id, len(each.key_id)) == (sender.key_id, 8)


CHANGES: dict[str, Callable[[CommandSignature], object]] = {
    "stamp": lambda m: setattr(m.header.stamp, "sec", m.header.stamp.sec + 1),
    "nanoseconds": lambda m: setattr(m.header.stamp, "nanosec", 1),
    "number": lambda m: setattr(m, "sequence", 8),
    "name": lambda m: setattr(m, "commander", m.commander.replace("gs1", "gs2")),
    "command": lambda m: setattr(m, "digest", m.digest[::-1]),
    "letters between name and command": lambda m: (
        setattr(m, "digest", m.commander[-1] + m.digest), setattr(m, "commander", m.commander[:-1]),
    ),
    "no signature": lambda m: setattr(m, "signature", ""),
    "half a signature": lambda m: setattr(m, "signature", m.signature[:-16]),
    "another alphabet": lambda m: setattr(m, "signature", "\u0661" * 32),
}  # fmt: skip


@pytest.mark.parametrize("change", CHANGES)
def test_a_changed_command_is_a_conflict_for_ten_seconds(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, change: str
) -> None:
    now = [1000.0]
    monkeypatch.setattr(time, "monotonic", lambda: now[0])
    key = key_at(tmp_path / "key")
    message = signed(key)
    CHANGES[change](message)
    with pytest.raises(
        ValueError, match="conflict: a command in the name of /gs[12]/pointing_controlle.* is not signed"
    ):
        key.check(message)
    for seconds, level in ((9.9, ERROR), (0.2, OK)):
        now[0] += seconds
        health = key.health([])
        assert (health.level, health.values["foreign_commands"], health.values["signed"]) == (level, 1, True)


def test_the_key_of_another_antenna_or_topic_is_refused(tmp_path: Path) -> None:
    mine = key_at(tmp_path / "key")
    for other in (key_at(tmp_path / "other"), key_at(tmp_path / "key", "/gs2/joint_trajectory")):
        with pytest.raises(ValueError, match="not signed with the key of this antenna"):
            mine.check(signed(other))


def test_without_a_key_every_name_is_taken_and_a_second_publisher_is_shown() -> None:
    key, nodes = CommandKey(CommandKeyParams(), TOPIC), ["/gs1/pointing_controller", "/gs1/rotctld_server", "/own"]
    key.check(signed(key))
    assert (signed(key).commander, signed(key).signature, signed(key).key_id) == (NAME, "", "")
    parts = [name.rpartition("/") for name in nodes]
    one, server, other = (SimpleNamespace(node_namespace=space, node_name=name) for space, _, name in parts)
    for publishers, level, message in (
        ([], OK, "no commander"), ([one], OK, "one commander"), ([one, server], OK, "one commander"),
        ([one, other], WARN, f"2 publishers of {TOPIC}: /gs1/pointing_controller, /own"),
    ):  # fmt: skip
        health = key.health(publishers)
        assert (health.level, health.message) == (level, message)
    assert key.health([server, one]).values["publishers"] == "/gs1/pointing_controller, /gs1/rotctld_server"


def test_a_key_file_that_others_can_read_or_that_holds_no_key_is_refused(tmp_path: Path) -> None:
    shown, short, link = (tmp_path / name for name in ("shown", "short", "link"))
    key_at(shown)
    shown.chmod(0o640)
    with pytest.raises(ValueError, match="shown can be read by others: chmod 600"):
        key_at(shown)
    short.touch(0o600)
    key_at(short)
    assert len(short.read_text()) == 65, "an empty file gets a key"
    short.write_text(f"  {short.read_text()}\n\n")
    key_at(short)
    for text in ("abc", short.read_text().strip() + "00"):
        short.write_text(text)
        with pytest.raises(ValueError, match="must hold 64 hexadecimal digits"):
            key_at(short)
    link.symlink_to(tmp_path / "elsewhere")
    with pytest.raises(ValueError, match="link cannot be used"):
        key_at(link)
    assert not (tmp_path / "elsewhere").exists()


class Calls:
    """Signed calls, on a clock of the test; the key is from 100 s before."""

    def __init__(self, path: Path, patch: pytest.MonkeyPatch) -> None:
        self.patch = patch
        self.at(-100.0)
        self.key = key_at(path)
        self.at(0.0)

    def at(self, seconds: float) -> None:
        self.patch.setattr(time, "time", lambda: NOW_S + seconds)

    def call(self, body: int = 1) -> SignedCall.Request:
        call = SignedCall.Request(service="/gs1/antenna_servo/park", caller=NAME, request=[0, body])
        self.key.sign_call(call)
        return call


@pytest.fixture
def calls(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Calls:
    return Calls(tmp_path / "key", monkeypatch)


@pytest.mark.parametrize(
    ("age_s", "words"), [(9.9, ""), (10.1, "is 10.1 s old"), (-9.9, ""), (-10.1, "is -10.1 s old")]
)
def test_a_call_is_taken_once_within_ten_seconds_of_its_time(calls: Calls, age_s: float, words: str) -> None:
    calls.at(-age_s)
    call, other = calls.call(), calls.call(2)
    calls.at(0.0)
    if not words:
        calls.key.check_call(call)
        calls.key.check_call(other)
    for _ in range(2):
        with pytest.raises(ValueError, match=f"the call of {NAME} {words or 'was sent before'}"):
            calls.key.check_call(call)


@pytest.mark.parametrize("ahead_s", [0.001, 8.0, -0.001])
def test_a_call_is_not_taken_again_after_a_restart(calls: Calls, tmp_path: Path, ahead_s: float) -> None:
    calls.at(ahead_s)
    call, other, *unused = (calls.call(body) for body in range(4))
    calls.at(0.0)
    for each in (call, other):
        calls.key.check_call(each)
    for after_s in (0.0005, 4.0, 8.5):
        calls.at(after_s)
        again = key_at(tmp_path / "key")
        for each in (call, other):
            with pytest.raises(ValueError, match="was sent before"):
                again.check_call(each)
        # One that was not taken is, while it is newer than the start.
        if after_s < ahead_s:
            again.check_call(unused.pop())
    kept = tmp_path / "key.taken"
    assert kept.is_file() is (ahead_s > 0.0)
    if kept.is_file():
        kept.write_text("[")
        calls.at(20.0)
        with pytest.raises(ValueError, match="key.taken cannot be read"):
            key_at(tmp_path / "key").check_call(calls.call())


def test_a_call_of_before_the_start_is_refused_and_without_a_key_everything_is_taken(
    calls: Calls, tmp_path: Path
) -> None:
    calls.at(-101.0)
    call = calls.call()
    calls.at(-100.0)
    with pytest.raises(ValueError, match="was sent before"):
        calls.key.check_call(call)
    with pytest.raises(ValueError, match=f"a call in the name of {NAME} is not signed with the key"):
        key_at(tmp_path / "other").check_call(call)
    none = CommandKey(CommandKeyParams())
    none.check_call(call)
    assert (calls.key.signed, none.signed) == (True, False)
