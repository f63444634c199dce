"""Commands and signatures find each other in any order; nothing without the key is taken, whoever sends it."""

from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from rclpy.serialization import deserialize_message
from rf_pointing_msgs.msg import CommandSignature
from rosbags.typesys import Stores, get_typestore
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from rf_pointing.ros.command_key import CommandKey, CommandKeyParams
from rf_pointing.ros.signed_commands import MOST_WAITING, NAMELESS_S, WAITS_S, CommandPairs, CommandSender

TOPIC, NAME, NOW_S = "/gs1/joint_trajectory", "/gs1/pointing_controller", 1_200_000_000.0
# The parser of interfaces that rclpy imports with its first message.
pytestmark = pytest.mark.filterwarnings("ignore:module 'sre_:DeprecationWarning")
Pair = tuple[CommandSignature, bytes]


class Antenna:
    """Takes what is signed with the key of a file; `taken` are the commands and their commanders."""

    def __init__(self, path: str, *, unsigned: bool = False) -> None:
        self.key = CommandKey(CommandKeyParams(command_key_file=path), TOPIC)
        self.taken: list[tuple[bytes, str]] = []
        self.refused: list[str] = []
        self.pairs = CommandPairs(
            self.key, lambda *command: self.taken.append(command), self.refused.append, unsigned=unsigned
        )

    def hear(self, message: CommandSignature | bytes, now_s: float = NOW_S) -> None:
        if isinstance(message, bytes):
            self.pairs.note_command(message, now_s)
            return
        try:
            self.pairs.note_signature(message, now_s)
        except ValueError as error:
            self.refused.append(str(error))


class Commander:
    """A node that commands through `CommandSender`; `pairs` are what it has sent."""

    def __init__(self, path: str = "", topic: str = TOPIC) -> None:
        self.sent: list[Any] = []
        node: Any = SimpleNamespace(
            get_fully_qualified_name=lambda: NAME, get_namespace=lambda: "/gs1", resolve_topic_name=lambda _: topic
        )
        make = lambda *_: SimpleNamespace(publish=self.sent.append)  # noqa: E731
        self.sender = CommandSender(node, CommandKeyParams(command_key_file=path), make)

    def pair(self, number: int = 0) -> Pair:
        self.sender.send(command(number))
        return self.sent[-2], self.sent[-1]


def command(number: int) -> JointTrajectory:
    point = JointTrajectoryPoint(positions=[1.0 + number, 0.5], velocities=[0.01, 0.0], accelerations=[0.0, 0.0])
    message = JointTrajectory(joint_names=["azimuth", "elevation"], points=[point])
    message.header.stamp.sec = int(NOW_S) + number
    return message


@pytest.fixture
def key(tmp_path: Path) -> str:
    return str(tmp_path / "command.key")


def test_the_command_has_the_frame_of_the_antenna_and_its_signature_goes_before_it(key: str) -> None:
    signature, payload = Commander(key).pair(3)
    sent = deserialize_message(payload, JointTrajectory)
    assert (sent.header.frame_id, sent.header.stamp) == ("gs1/base_link", signature.header.stamp)
    assert (signature.commander, signature.sequence, len(signature.signature)) == (NAME, 1, 32)
    # RTPS would pad another length, and the digest be of other bytes.
    assert len(payload) % 4 == 0
    # A strict reader refuses a byte too many, and what is behind a message is memory of the process.
    get_typestore(Stores.ROS2_JAZZY).deserialize_cdr(payload, "trajectory_msgs/msg/JointTrajectory")


FOREIGN: dict[str, Callable[[Pair, Pair, Pair], list[Any]]] = {
    "unsigned": lambda _mine, other, _guessed: [other[1]],
    "signed with a guessed key": lambda _mine, _other, guessed: [*guessed],
    "beside the signature of another command": lambda mine, other, _guessed: [mine[0], other[1]],
    "its digest in the signature of another command": lambda mine, other, _guessed: [altered(mine[0], other), other[1]],
    "with a signature that is cut": lambda _mine, other, guessed: [cut(guessed[0]), other[1]],
    "a point of a signed command changed": lambda mine, _other, _guessed: [
        mine[0],
        mine[1][:-9] + b"\1" + mine[1][-8:],
    ],
    "the frame of a signed command changed": lambda mine, _o, _g: [mine[0], mine[1].replace(b"gs1", b"gs2")],
}


def altered(signature: CommandSignature, other: Pair) -> CommandSignature:
    return CommandSignature(**{
        name: getattr(signature, name) for name in ("header", "sequence", "commander", "key_id", "signature")
    }, digest=other[0].digest)  # fmt: skip


def cut(signature: CommandSignature) -> CommandSignature:
    signature.signature = signature.signature[:16]
    return signature


@pytest.mark.parametrize("late_s", [0.0, 0.9 * WAITS_S])
@pytest.mark.parametrize("first", [0, 1])
@pytest.mark.parametrize("attack", FOREIGN)
def test_a_foreign_command_is_refused_as_a_conflict_and_the_signed_one_is_taken(
    key: str, tmp_path: Path, attack: str, first: int, late_s: float
) -> None:
    antenna, mine = Antenna(key), Commander(key).pair(1)
    other, guessed = Commander().pair(2), Commander(str(tmp_path / "guess")).pair(2)
    # A key that signs for another antenna is none here.
    assert Antenna(key).key.sign(other[1], mine[0].header.stamp, 1, NAME) != Commander(key, "/gs2/x").pair(2)[0]
    sent = FOREIGN[attack](mine, other, guessed)
    for message in sent[::-1] if first else sent:
        antenna.hear(message)
    assert antenna.taken == []
    for message in (mine[first], mine[1 - first]):
        antenna.hear(message, NOW_S + late_s)
    assert antenna.taken == [(mine[1], NAME)]
    antenna.pairs.expire(NOW_S + late_s + WAITS_S + 0.01)
    assert antenna.taken == [(mine[1], NAME)]
    assert antenna.refused, attack
    assert all(each.startswith("conflict: a command") and antenna.key.key_id in each for each in antenna.refused)
    assert antenna.key.health([]).values["foreign_commands"] == len(antenna.refused)


@given(data=st.data())
@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_in_any_order_among_floods_each_signed_command_is_taken_once(key: str, data: st.DataObject) -> None:
    """Of every pair one half may be late by MOST_WAITING others; forged and repeated ones come between."""
    antenna, commander, stranger = Antenna(key), Commander(key), Commander()
    pairs = [commander.pair(number) for number in range(5)]
    forged = st.sampled_from([item for number in range(5, 12) for item in stranger.pair(number)])
    heard = st.sampled_from([signature for signature, _ in pairs])
    for signature, payload in pairs:
        noise = data.draw(st.lists(forged, max_size=MOST_WAITING - 1))
        # A signature that is sent again takes no place of a newer one.
        replays = data.draw(st.lists(heard, max_size=3))
        two: list[Any] = [signature, payload] if data.draw(st.booleans()) else [payload, signature]
        for message in (*replays, two[0], *noise, two[1]):
            antenna.hear(message)
    assert [each for each in antenna.taken if each[0] in {payload for _, payload in pairs}] == antenna.taken
    assert sorted(antenna.taken) == sorted((payload, NAME) for _, payload in pairs)


def test_a_flood_is_bounded_and_does_not_push_out_a_signature_whose_command_is_on_its_way(key: str) -> None:
    antenna, commander, stranger = Antenna(key), Commander(key), Commander()
    old = [commander.pair(number) for number in range(5 * MOST_WAITING)]
    new = commander.pair(10_000)
    antenna.hear(new[0])
    for number, (signature, _) in enumerate(old):
        antenna.hear(signature)
        antenna.hear(stranger.pair(20_000 + number)[1])
    assert len(antenna.refused) == 4 * MOST_WAITING, "the oldest are refused as unsigned: the others wait"
    antenna.hear(new[1])
    assert antenna.taken == [(new[1], NAME)]
    # One command again and again waits no longer than the first.
    again, antenna.refused[:] = stranger.pair()[1], []
    for step in range(int(WAITS_S / 0.1) + 2):
        antenna.hear(again, NOW_S + 0.1 * step)
    assert len(antenna.refused) == MOST_WAITING + 1


@pytest.mark.parametrize(("late_s", "taken"), [(WAITS_S, 1), (WAITS_S + 0.01, 0), (-0.01, 0)])
@pytest.mark.parametrize("first", [0, 1])
def test_one_half_waits_a_second_for_the_other(key: str, first: int, late_s: float, taken: int) -> None:
    antenna, mine = Antenna(key), Commander(key).pair()
    antenna.hear(mine[first])
    antenna.hear(mine[1 - first], NOW_S + late_s)
    assert len(antenna.taken) == taken


@pytest.mark.parametrize("path", ["", "command.key"])
def test_where_unsigned_commands_are_taken_they_wait_for_a_name_and_then_have_none(path: str, tmp_path: Path) -> None:
    """Without a key, or where the station allows it: another stack's commander sends no signature."""
    key = path and str(tmp_path / path)
    antenna, mine, foreign = Antenna(key, unsigned=True), Commander(key).pair(1), Commander().pair(2)[1]
    for message in (foreign, mine[1], mine[0]):
        antenna.hear(message)
    assert antenna.taken == [(mine[1], NAME)]
    antenna.pairs.expire(NOW_S + NAMELESS_S + 0.001)
    assert antenna.taken == [(mine[1], NAME), (foreign, "")]
    assert antenna.refused == []
