"""Whether a node still receives: one that does not is ended, and its launch starts it again.

Packets with moved sequence numbers make a reader take every later message for one that it has.  The
node then works on and receives nothing for good, and nothing in ROS reports it.  Every node of an
antenna publishes /diagnostics once a second of wall time, so a node is deaf if

    all of two or more neighbours     are in the graph, and from none anything arrived for 25 s, or
    an input that is sent all the time   is silent for 5 s of wall and of node time, although its
                                      publisher has just reported on /diagnostics that it is active,
                                      and not that it is silent and why
    its own periodic work             is not done for as long and two periods
    a neighbour with its input        is silent for 10 s and most of the others receive it; for 15 s
                                      where fewer do, or it is not even in the graph; 10 s more
                                      for what moves the antenna, where each needs the other
    most neighbours                   have not received this node for 10 s: it is mute; or one of
                                      them, whose topics it needs, and which needs none of its own
    a name in the graph               has been damaged for 5 s, and could be read before

A node that was killed leaves the graph after 20 s.  The silence of one neighbour alone proves
nothing: it may work on something long.  So each node says on /diagnostics whom it receives, and
compares it, from its tenth look on: on a busy machine nodes find each other slowly.  Of two of
which one does not receive the other, the one starts again that needs something of the other.
"""

import math
import re
import struct
import time
from collections import Counter
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from typing import Any
from weakref import WeakKeyDictionary

from diagnostic_msgs.msg import DiagnosticArray

from rf_pointing.ros.diagnostics import ERROR, OK, WARN, Health
from rf_pointing.ros.graph import PAUSES, SOURCES
from rf_pointing.ros.qos import STREAM

TOPIC = "/diagnostics"
SILENCE_S = 25.0
"""Silence of a neighbour; more than the lease after which a dead participant leaves the graph."""
INPUT_SILENCE_S = 5.0
RECENT_S = 3.0
RECEIVED_S, PROVED_S, BY_FEW_S = 5.0, 5.0, 10.0
"""A neighbour counts as received for so long after its last message; what most others have received
all the time for longer, and this node has not, is lost here; or one other, for longer still."""
FEWEST = 2
LOOK_S, NEW_LOOKS = 1.0, 10  # A look proves its period only: where it is late, all else may be.
MOVING = "pointing_controller antenna_servo"
SHARED_S = 0.9  # Nodes of a process look at the graph together: among many antennas a look is long.
_shared = WeakKeyDictionary[Any, tuple[float, set[str]]]()
OF_ALL = {TOPIC, "/rosout", "/parameter_events", "/clock"}
"""Topics that say nothing of who needs whom."""
# The message of the status `state`: a string is its length, its bytes and a zero, aligned.
ACTIVE = re.compile(rb": state\x00.{0,3}?\x07\x00\x00\x00active\x00", re.DOTALL)
# The value `received`: names, with a space after each.
RECEIVED = re.compile(rb"\x09\x00\x00\x00received\x00.{7}((?:[ -~]+ )?)\x00", re.DOTALL)


@dataclass
class _Neighbour:
    """When something of a node arrived last (s, steady; `heard_s` begins when it appeared), whether
    it then was active, and whom it receives itself, None where it does not say so.
    """

    heard_s: float
    taken_s: float = -math.inf
    active: bool = False
    received: frozenset[str] | None = None


@dataclass
class _Input:
    """Messages of an input, or steps of work; those at the last look, and for how long none came.

    The silence counts while it is `due`, and `words` say what it means beyond `patience_s`.
    """

    due: Callable[[], bool]
    words: str
    patience_s: float = INPUT_SILENCE_S
    count: int = 0
    seen: int = 0
    wall_s: float = 0.0
    node_s: float = 0.0


def _sender(payload: bytes) -> str:
    """Return the hardware_id of the first status, "" where it cannot be read.

    Others may name that node too: the antenna says who commands it.
    """
    body, at, found = payload[4:], 8, b""
    with suppress(struct.error, UnicodeDecodeError):
        # Behind the stamp: frame_id, then count and level, name, message and hardware_id.
        for between in (0, 5, 0, 0):
            at = -(-(at + between) // 4) * 4
            end = at + 4 + struct.unpack_from("<I", body, at)[0]
            found, at = body[at + 4 : end], -(-end // 4) * 4
        return found[:-1].decode()
    return ""


class InputWatchdog:
    """Receives from the neighbours of `node`; `deaf` is why it must start again, "" for nothing."""

    def __init__(self, node: Any, steady_s: Callable[[], float] = lambda: time.monotonic()) -> None:
        self._node, self._steady_s = node, steady_s
        self._own = node.get_fully_qualified_name()
        self._neighbours: dict[str, _Neighbour] = {}
        self._inputs, self._required = list[_Input](), dict[str, float]()
        self._looked: tuple[float, float] | None = None
        self._looks, self._readable, self._unreadable_s = 0, False, 0.0
        self._lost_s, self._mute_s = dict[str, float](), dict[str, float]()
        self.deaf = ""
        node.create_subscription(DiagnosticArray, TOPIC, self.note, STREAM, raw=True)
        node.diagnostics.add("hearing", self.look)

    def watch(self, topic: str) -> tuple[Callable[[], None], Callable[[], None]]:
        """Return what to call for each message of an input that is always sent, and at its end."""
        words = f"{topic} has been silent for {{:.0f}} s although its publisher is active"
        return self._watch(_Input(lambda: self._sent(topic), words))

    def watch_work(self, period_s: float) -> tuple[Callable[[], None], Callable[[], None]]:
        """Return what is to be called for each step of work, and when it is no longer due."""
        words = f"the work of every {period_s:g} s has not been done for {{:.0f}} s"
        return self._watch(_Input(lambda: self._node.active, words, INPUT_SILENCE_S + 2.0 * period_s))

    def require(self, topic: str, take: Callable[[Any], None]) -> Callable[[Any], None]:
        """Return `take` of an input without which the node has nothing to work on."""
        self._required[topic] = -math.inf

        def noted(message: Any) -> None:
            take(message)
            self._required[topic] = self._steady_s()

        return noted

    def require_no_longer(self, topic: str) -> None:
        """Forget an input that ends."""
        del self._required[topic]

    def missing(self) -> str:
        """Return the required inputs that do not arrive, each with who sends it, "" without any.

        One is missing until its first message, and when nobody is left to send it.  A topic that
        pauses between passes arrives while somebody may send it.
        """
        late_s, words = self._steady_s() - SILENCE_S, list[str]()
        space = f"{self._node.get_namespace().rstrip('/')}/"
        for topic, heard_s in self._required.items():
            if heard_s > late_s or (self._publishers(topic) and (heard_s > -math.inf or topic in PAUSES)):
                continue
            name = self._node.resolve_topic_name(topic).removeprefix(space)
            words.append(f"{name} ({SOURCES[topic]})" if topic in SOURCES else name)
        return ", ".join(words)

    def _watch(self, watched: _Input) -> tuple[Callable[[], None], Callable[[], None]]:
        self._inputs.append(watched)

        def count() -> None:
            watched.count += 1

        return count, lambda: self._inputs.remove(watched)

    def note(self, payload: bytes) -> None:
        """Take the diagnostics of any node, undecoded: each second every node gets all of them."""
        if neighbour := self._neighbours.get(_sender(payload)):
            neighbour.heard_s = neighbour.taken_s = self._steady_s()
            neighbour.active = ACTIVE.search(payload) is not None
            found = RECEIVED.search(payload)
            neighbour.received = found and frozenset(found[1].decode().split())

    def look(self) -> Health:
        """Compare what arrived with who is in the graph; called once a second."""
        now_s, node_s = self._steady_s(), self._node.now_s()
        space = f"{self._node.get_namespace().rstrip('/')}/"
        whose = getattr(self._node, "context", self._node)
        if not 0.0 <= now_s - _shared.get(whose, (-math.inf, set()))[0] < SHARED_S:
            _shared[whose] = now_s, self._publishers(TOPIC)
        present = {name for name in _shared[whose][1] if name.startswith(space)} - {self._own}
        before_s, node_before_s = self._looked or (now_s, node_s)
        # Simulated time that begins has jumped, and not passed.
        passed_s, node_passed_s = now_s - before_s, node_s - (node_before_s or node_s)
        self._looked, self._looks = (now_s, node_s), self._looks + 1
        # While this node itself did not look, it proves nothing that nothing was taken.
        unseen_s = max(0.0, passed_s - RECENT_S)
        for one in self._neighbours.values():
            one.heard_s = min(one.heard_s + unseen_s, now_s)
        # One that has just appeared gets its time.
        self._neighbours = {name: self._neighbours.get(name, _Neighbour(now_s)) for name in sorted(present)}
        since_s = {name: now_s - one.heard_s for name, one in self._neighbours.items()}
        silent = {name: each_s for name, each_s in since_s.items() if each_s > SILENCE_S}
        if len(silent) >= FEWEST and len(silent) == len(self._neighbours):
            self._end(f"nothing has been received from {', '.join(silent)} for {min(silent.values()):.0f} s")
        if unseen_s:  # Others have not received it meanwhile, which proves nothing either.
            self._lost_s, self._mute_s = {}, {}
        self._compare(now_s, min(passed_s, LOOK_S))
        for watched in self._inputs:
            self._look_at(watched, passed_s - unseen_s, max(node_passed_s, 0.0))
        if self.deaf:
            return Health(ERROR, f"{self.deaf}: the node starts again")
        words = "; ".join(f"{name} has been silent for {since_s:.0f} s" for name, since_s in silent.items())
        since_s = {name: now_s - one.taken_s for name, one in self._neighbours.items()}
        received = [f"{name} " for name, silence_s in since_s.items() if silence_s < RECEIVED_S]
        values = {"received": "".join(received)} if self._looks > NEW_LOOKS else {}
        return Health(WARN if words else OK, words or f"{len(self._neighbours)} neighbours", values)

    def _compare(self, now_s: float, passed_s: float) -> None:
        """Compare with whom the neighbours receive, and note how long the graph cannot be read."""
        # A stranger may have a name that never could be read: a new start would not help.
        damaged = TOPIC in self._node.damaged_topics
        self._readable |= not damaged
        self._unreadable_s = self._unreadable_s + passed_s if damaged and self._readable else 0.0
        if self._unreadable_s > INPUT_SILENCE_S:
            long_s = self._unreadable_s
            self._end(f"the names of the senders of {TOPIC} have been damaged for {long_s:.0f} s")
        if self._looks <= NEW_LOOKS:
            return
        recent = [one for one in self._neighbours.values() if now_s - one.heard_s < RECENT_S]
        others = [one.received for one in recent if one.received is not None]
        before_s, known = now_s - RECEIVED_S, self._neighbours
        silent = {name for name, one in known.items() if one.taken_s < before_s}
        # What others receive may be missing even in the graph that this node sees.
        space = f"{self._node.get_namespace().rstrip('/')}/"
        of_others = frozenset().union(*others) - {self._own, *known}
        silent |= {name for name in of_others if name.startswith(space)}
        takers = Counter(name for names in others for name in names if name in silent)
        # Counted while others receive it: one that was killed is found again by each in its time.
        self._lost_s = {name: self._lost_s.get(name, 0.0) + passed_s for name in takers}
        for name, long_s in self._lost_s.items():
            proved_s = PROVED_S if name in known and 2 * takers[name] > len(others) else BY_FEW_S
            nearer = MOVING.find(self._own.rpartition("/")[2]) > MOVING.find(name.rpartition("/")[2])
            # The other one needs this node as well, and stops nothing where it starts again.
            proved_s += BY_FEW_S * (nearer and self._passes(self._own, name))
            if long_s > proved_s and (name not in known or self._passes(name, self._own)):
                words = f"{name} for {long_s + RECEIVED_S:.0f} s, which others receive"
                self._end(f"nothing has been received from {words}")
        # A node looks only at those below its own namespace: others never name this one.
        silent_to = {
            name for name, one in self._neighbours.items()
            if one in recent and one.received is not None and self._own not in one.received
            and self._own.startswith(f"{name.rpartition('/')[0]}/")
        }  # fmt: skip
        self._mute_s = {name: self._mute_s.get(name, 0.0) + passed_s for name in silent_to}
        mute = sorted(name for name, long_s in self._mute_s.items() if long_s > PROVED_S)
        passes = self._passes
        in_vain = [name for name in mute if passes(name, self._own) and not passes(self._own, name)]
        if len(others) >= FEWEST and (2 * len(mute) > len(others) or in_vain):
            self._end(f"{', '.join(mute)} has not received this node for {RECEIVED_S + PROVED_S:.0f} s")

    def _passes(self, sender: str, taker: str) -> bool:
        """Return whether one of two nodes takes another topic of the other than those of all."""
        node, topics = self._node, list[set[str]]()
        for full, look in (
            (sender, node.get_publisher_names_and_types_by_node),
            (taker, node.get_subscriber_names_and_types_by_node),
        ):
            space, _, name = full.rpartition("/")
            # A node may have gone meanwhile, and names may be damaged.
            with suppress(RuntimeError, UnicodeDecodeError):
                topics.append({topic for topic, _ in look(name, space or "/")} - OF_ALL)
        return len(topics) == 2 and not topics[0].isdisjoint(topics[1])

    def _end(self, why: str) -> None:
        """Have the node start again; the first reason is kept."""
        self.deaf = self.deaf or why

    def _look_at(self, watched: _Input, wall_s: float, node_s: float) -> None:
        if watched.count != watched.seen:
            watched.seen, watched.wall_s, watched.node_s = watched.count, 0.0, 0.0
            return
        if watched.due():
            watched.wall_s, watched.node_s = watched.wall_s + wall_s, watched.node_s + node_s
        if min(watched.wall_s, watched.node_s) > watched.patience_s:
            self._end(watched.words.format(watched.wall_s))

    def _sent(self, topic: str) -> bool:
        """Return whether it is proved that somebody sends: active, and received just now."""
        senders = [self._neighbours[name] for name in self._publishers(topic) if name in self._neighbours]
        return any(one.active and self._steady_s() - one.heard_s < RECENT_S for one in senders)

    def _publishers(self, topic: str) -> set[str]:
        found = self._node.get_publishers_info_by_topic(topic)
        return {f"{each.node_namespace.rstrip('/')}/{each.node_name}" for each in found}
