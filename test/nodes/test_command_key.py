"""Only who has the key commands the antenna; every part of a command is signed."""

import os
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import pytest
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from rf_pointing.nodes.command_key import CommandKey, CommandKeyParams
from rf_pointing.nodes.diagnostics import ERROR, OK, WARN

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
