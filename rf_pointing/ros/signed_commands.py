"""Commands and their signatures: who commands sends both, who receives pairs them.

The message of joint_trajectory is the one that every controller of ROS knows; it has no field for a
signature, and its frame_id is a frame.  So a `CommandSignature` goes before each command, on a
topic of its own, with the SHA-256 of the command's bytes.  The two may arrive in either order: the
first waits for the other, for a bounded time and in bounded number.  A command whose signature does
not come is unsigned, and is not even decoded unless the station takes unsigned commands.
"""

from collections.abc import Callable
from typing import Any

from rclpy.node import Node
from rclpy.serialization import serialize_message
from rf_pointing_msgs.msg import CommandSignature
from trajectory_msgs.msg import JointTrajectory

from rf_pointing.core.signals import BASE
from rf_pointing.ros.command_key import CommandKey, CommandKeyParams, digest_of
from rf_pointing.ros.graph import COMMANDS, SIGNATURES
from rf_pointing.ros.qos import COMMAND, STREAM
from rf_pointing.ros.stamps import seconds_from_stamp, stamp_from_seconds
from rf_pointing.ros.streams import frame_in

WAITS_S = 1.0
"""How long one waits for the other: the lifespan of a command; what is lost is sent again in it."""
NAMELESS_S = 0.05
"""How long a command waits for its name where it may have none: half a period of a commander."""
MOST_WAITING = 32


def cdr_bytes(command: JointTrajectory) -> int:
    """Return the length of a serialized command."""
    # rmw_fastrtps returns the estimate that it has reserved: what is behind the message is memory.
    end = 8 + 4 + len(command.header.frame_id.encode()) + 1
    end = -(-end // 4) * 4 + 4
    for name in command.joint_names:
        end = -(-end // 4) * 4 + 4 + len(name.encode()) + 1
    end = -(-end // 4) * 4 + 4
    for point in command.points:
        for part in (point.positions, point.velocities, point.accelerations, point.effort):
            end += 4
            end = -(-end // 8) * 8 + 8 * len(part) if len(part) else end
        end += 8
    return end + 4


class CommandSender:
    """Sends the commands of a node under its name, each after its signature.

    `create` makes the publishers: `publisher` of a managed node, which lasts until cleanup.
    """

    def __init__(self, node: Node, params: CommandKeyParams, create: Callable[..., Any] | None = None) -> None:
        create = create or node.create_publisher
        self.name, self.sent = node.get_fully_qualified_name(), 0
        self.key = CommandKey(params, node.resolve_topic_name(COMMANDS))
        self._frame_id = frame_in(node.get_namespace(), BASE)
        self._signatures = create(CommandSignature, SIGNATURES, STREAM)
        self._commands = create(JointTrajectory, COMMANDS, COMMAND)

    def send(self, command: JointTrajectory) -> None:
        """Send a complete command, which gets its frame."""
        command.header.frame_id = self._frame_id
        # What is signed is what is sent; it ends on a multiple of four, so RTPS pads nothing.
        payload = serialize_message(command)[: cdr_bytes(command)]
        self.sent += 1
        stamp = command.header.stamp
        self._signatures.publish(self.key.sign(payload, stamp, self.sent, self.name))
        self._commands.publish(payload)

    def claim(self, t_s: float) -> None:
        """Say who has the antenna at a time without a command."""
        self._signatures.publish(self.key.sign(b"", stamp_from_seconds(t_s), self.sent, self.name))


class CommandPairs:
    """Commands and signatures that wait for each other.

    `take(payload, commander)` gets each command, `commander` "" for one that is taken without a
    signature; `refuse(reason)` gets why another is not taken.  Without a key every signature only
    names the commander.
    """

    def __init__(
        self, key: CommandKey, take: Callable[[bytes, str], None], refuse: Callable[[str], object], *, unsigned: bool
    ) -> None:
        self._key, self._take, self._refuse = key, take, refuse
        self._unsigned = unsigned or not key.signed
        self._commands = dict[str, tuple[float, bytes]]()
        self._signatures = dict[str, tuple[float, float, str]]()

    def note_command(self, payload: bytes, now_s: float) -> None:
        """Take a command whose signature is there; another waits for it."""
        self.expire(now_s)
        digest = digest_of(payload)
        if (found := self._signatures.pop(digest, None)) is not None:
            self._take(payload, found[-1])
            return
        # One that is sent again and again waits no longer than the first.
        self._commands.setdefault(digest, (now_s, payload))
        if len(self._commands) > MOST_WAITING:
            self._go_alone(next(iter(self._commands)))

    def note_signature(self, message: CommandSignature, now_s: float) -> None:
        """Take the command of a signature, or keep it; ValueError for one of another key."""
        self.expire(now_s)
        self._key.check(message)
        if (found := self._commands.pop(message.digest, None)) is not None:
            self._take(found[1], message.commander)
            return
        stamp_s = seconds_from_stamp(message.header.stamp)
        self._signatures[message.digest] = stamp_s, now_s, message.commander
        if len(self._signatures) > MOST_WAITING:
            # Those that somebody sends again are older than the one whose command is on its way.
            del self._signatures[min(self._signatures, key=lambda each: self._signatures[each][0])]

    def expire(self, now_s: float) -> None:
        """End the waiting of what has waited long enough, also after a step back of the clock."""
        waits_s = NAMELESS_S if self._unsigned else WAITS_S
        for digest, (since_s, _) in [*self._commands.items()]:
            if not 0.0 <= now_s - since_s <= waits_s:
                self._go_alone(digest)
        for digest, (_, since_s, _) in [*self._signatures.items()]:
            if not 0.0 <= now_s - since_s <= WAITS_S:
                del self._signatures[digest]

    def _go_alone(self, digest: str) -> None:
        _, payload = self._commands.pop(digest)
        if self._unsigned:
            self._take(payload, "")
        else:
            words = "a command without a signature is refused; this antenna's key is"
            self._refuse(self._key.conflict(words))
