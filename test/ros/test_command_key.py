"""Only who has the key commands the antenna; every part of a command is signed."""

import fcntl
import os
import time
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import pytest
from rf_pointing_msgs.srv import SignedCall
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from rf_pointing.ros.command_key import CommandKey, CommandKeyParams
from rf_pointing.ros.diagnostics import ERROR, OK, WARN

TOPIC, NAME = "/gs1/joint_trajectory", "/gs1/pointing_controller"


def key_at(path: Path, topic: str = TOPIC) -> CommandKey:
    return CommandKey(CommandKeyParams(command_key_file=str(path)), topic)


def command() -> JointTrajectory:
    point = JointTrajectoryPoint(positions=[1.0, 0.5], velocities=[0.01, 0.0], accelerations=[0.0, 0.0])
    message = JointTrajectory(joint_names=["azimuth", "elevation"], points=[point])
    message.header.stamp.sec, message.points[0].time_from_start.nanosec = 1_151_384_000, 100_000_000
    return message


def test_the_first_of_both_nodes_makes_the_key_and_the_other_reads_it(tmp_path: Path) -> None:
    path = tmp_path / "gs1" / "command.key"
    sender, receiver = key_at(path), key_at(path)
    assert path.stat().st_mode & 0o777 == 0o600
    assert len(path.read_text()) == 65
    message = command()
    sender.sign(message, NAME)
    assert receiver.check(message) == NAME
    assert key_at(path).check(message) == NAME, "after a restart"


CHANGES: dict[str, Callable[[JointTrajectory], object]] = {
    "stamp": lambda m: setattr(m.header.stamp, "sec", m.header.stamp.sec + 1),
    "nanoseconds": lambda m: setattr(m.header.stamp, "nanosec", 1),
    "name": lambda m: setattr(m.header, "frame_id", m.header.frame_id.replace("gs1", "gs2")),
    "joints": lambda m: setattr(m, "joint_names", ["elevation", "azimuth"]),
    "position": lambda m: setattr(m.points[0], "positions", [1.0, 0.5000001]),
    "velocity": lambda m: setattr(m.points[0], "velocities", [0.0, 0.01]),
    "acceleration": lambda m: setattr(m.points[0], "accelerations", [0.0, 1e-9]),
    "effort": lambda m: setattr(m.points[0], "effort", [0.0]),
    "time": lambda m: setattr(m.points[0].time_from_start, "sec", 1),
    "one more point": lambda m: m.points.append(m.points[0]),
    "no points": lambda m: m.points.clear(),
    "no signature": lambda m: setattr(m.header, "frame_id", NAME),
    "half a signature": lambda m: setattr(m.header, "frame_id", m.header.frame_id[:-16]),
    "another alphabet": lambda m: setattr(m.header, "frame_id", NAME + " \u0661" * 32),
}


@pytest.mark.parametrize("change", CHANGES)
def test_a_changed_command_is_a_conflict(tmp_path: Path, change: str) -> None:
    key, message = key_at(tmp_path / "key"), command()
    key.sign(message, NAME)
    CHANGES[change](message)
    with pytest.raises(
        ValueError, match="conflict: a command in the name of /gs[12]/pointing_controller is not signed"
    ):
        key.check(message)
    assert key.foreign == 1
    assert key.health([]).level == ERROR


def test_the_key_of_another_antenna_or_topic_is_none(tmp_path: Path) -> None:
    mine, message = key_at(tmp_path / "key"), command()
    for other in (key_at(tmp_path / "other"), key_at(tmp_path / "key", "/gs2/joint_trajectory")):
        other.sign(message, NAME)
        with pytest.raises(ValueError, match="not signed with the key of this antenna"):
            mine.check(message)


def test_without_a_key_every_name_is_taken_and_a_second_publisher_is_shown() -> None:
    key, message = CommandKey(CommandKeyParams(), TOPIC), command()
    key.sign(message, NAME)
    assert key.check(message) == message.header.frame_id == NAME
    one, two = (SimpleNamespace(node_namespace=space, node_name="pointing_controller") for space in ("/gs1", "/"))
    assert (key.health([]).level, key.health([one]).level) == (OK, OK)
    health = key.health([one, two])
    assert health.level == WARN
    assert health.message == f"2 publishers of {TOPIC}: /gs1/pointing_controller, /pointing_controller"


def test_a_key_that_others_can_read_or_that_is_none_is_refused(tmp_path: Path) -> None:
    shown, short, link = (tmp_path / name for name in ("shown", "short", "link"))
    key_at(shown)
    shown.chmod(0o640)
    with pytest.raises(ValueError, match="shown can be read by others; chmod 600"):
        key_at(shown)
    short.write_text("abc")
    short.chmod(0o600)
    with pytest.raises(ValueError, match="must hold 64 hexadecimal digits"):
        key_at(short)
    link.symlink_to(tmp_path / "elsewhere")
    with pytest.raises(ValueError, match="link cannot be used"):
        key_at(link)
    assert not os.path.exists(tmp_path / "elsewhere")


def call_at(key: CommandKey, stamp_s: float, monkeypatch: pytest.MonkeyPatch, body: int = 1) -> SignedCall.Request:
    call = SignedCall.Request(service="/gs1/antenna_servo/park", caller=NAME, request=[0, body])
    with monkeypatch.context() as then:
        then.setattr(time, "time", lambda: stamp_s)
        key.sign_call(call)
    assert call.stamp.sec == int(stamp_s)
    return call


@pytest.mark.parametrize(
    ("age_s", "words"), [(9.9, ""), (10.1, "is 10.1 s old"), (-9.9, ""), (-10.1, "is -10.1 s old")]
)
def test_a_call_is_taken_within_ten_seconds_of_its_time(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, age_s: float, words: str
) -> None:
    now_s = 1_200_000_000.0
    monkeypatch.setattr(time, "time", lambda: now_s - 100.0)
    key = key_at(tmp_path / "key")
    call = call_at(key, now_s - age_s, monkeypatch)
    monkeypatch.setattr(time, "time", lambda: now_s)
    if words:
        with pytest.raises(ValueError, match=f"the call of {NAME} {words}"):
            key.check_call(call)
    else:
        key.check_call(call)
        with pytest.raises(ValueError, match=f"the call of {NAME} was sent before"):
            key.check_call(call)


def test_calls_are_remembered_as_long_as_they_could_be_sent_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    now_s = 1_200_000_000.0
    monkeypatch.setattr(time, "time", lambda: now_s - 100.0)
    key = key_at(tmp_path / "key")
    monkeypatch.setattr(time, "time", lambda: now_s)
    first, second = (call_at(key, now_s, monkeypatch, body) for body in (1, 2))
    key.check_call(first)
    monkeypatch.setattr(time, "time", lambda: now_s + 9.0)
    key.check_call(second)
    for call in (first, second):
        with pytest.raises(ValueError, match="was sent before"):
            key.check_call(call)
    assert len(key._taken) == 2
    monkeypatch.setattr(time, "time", lambda: now_s + 10.5)
    key.check_call(call_at(key, now_s + 10.0, monkeypatch))
    assert len(key._taken) == 1


def test_a_call_of_before_the_start_is_refused_and_without_a_key_everything_is_taken(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    now_s = 1_200_000_000.0
    monkeypatch.setattr(time, "time", lambda: now_s)
    key = key_at(tmp_path / "key")
    with pytest.raises(ValueError, match="was sent before"):
        key.check_call(call_at(key, now_s - 1.0, monkeypatch))
    call = call_at(key_at(tmp_path / "other"), now_s, monkeypatch)
    with pytest.raises(ValueError, match=f"a call in the name of {NAME} is not signed with the key"):
        key.check_call(call)
    assert key.signed
    none = CommandKey(CommandKeyParams())
    none.check_call(call)
    assert not none.signed


def test_a_conflict_is_an_error_for_ten_seconds(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    now = [1000.0]
    monkeypatch.setattr(time, "monotonic", lambda: now[0])
    key = key_at(tmp_path / "key")
    assert key.health([]).level == OK
    for _ in range(2):
        with pytest.raises(ValueError, match="conflict"):
            key.check(command())
    now[0] += 9.9
    health = key.health([])
    assert (health.level, health.values["foreign_commands"], health.values["signed"]) == (ERROR, 2, True)
    now[0] += 0.2
    assert key.health([]).level == OK


def test_one_commander_and_the_server_of_rotctld_are_no_conflict() -> None:
    key = CommandKey(CommandKeyParams(), TOPIC)
    one, server, other = (
        SimpleNamespace(node_namespace="/gs1", node_name=name)
        for name in ("pointing_controller", "rotctld_server", "own")
    )
    assert key.health([]).message == "no commander"
    assert key.health([one, server]).message == "one commander"
    assert key.health([one, server]).values["publishers"] == "/gs1/pointing_controller, /gs1/rotctld_server"
    assert key.health([one, server, other]).level == WARN


def test_the_longest_key_file_that_is_read_holds_a_key_and_white_space(tmp_path: Path) -> None:
    path = tmp_path / "key"
    key_at(path)
    path.write_text(f"  {path.read_text()}\n\n")
    key_at(path)
    path.write_text(path.read_text().strip() + "00")
    with pytest.raises(ValueError, match="must hold 64 hexadecimal digits"):
        key_at(path)
    path.write_text("")
    key_at(path)
    assert len(path.read_text()) == 65, "an empty file gets a key"


def test_of_two_nodes_that_start_at_once_the_second_waits_for_the_first_ones_key(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path, first = tmp_path / "state" / "gs1" / "command.key", "ab" * 32
    locks: list[int] = []

    def waited(_file: object, how: int) -> None:
        locks.append(how)
        path.write_text(first)

    monkeypatch.setattr(fcntl, "flock", waited)
    second = key_at(path)
    assert locks == [fcntl.LOCK_EX]
    assert path.read_text() == first
    message = command()
    second.sign(message, NAME)
    assert key_at(path).check(message) == NAME
