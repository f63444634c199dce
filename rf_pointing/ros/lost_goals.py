"""Clients whose action server was killed: the next process tells them that their goals are aborted.

A client requests the result of a goal once, and waits; the request has gone to the process that was
killed.  So the heads of these requests are kept in a file of the node's user.  A process that finds
one answers as its predecessor would have, as soon as the client's end is known to it.

    head = GUID of the client's reader (16 bytes) and number of its request (8 bytes)
"""

import ctypes
import json
import sys
import time
from contextlib import suppress
from typing import Any

from action_msgs.msg import GoalStatus
from rclpy.clock import Clock, ClockType

HEAD_BYTES, GUID_BYTES, PREFIX_BYTES = 24, 16, 12
WRITER_KIND = 3
"""Last byte of the GUID of a writer without a key."""
LOOK_S, SETTLED_S, GIVEN_UP_S = 0.1, 0.3, 10.0
"""Time between two looks for a client, from then until it knows this process, and at most."""
MOST_KEPT = 100


class LostGoals:
    """The clients that wait for results of one action; `words` say why a goal was lost."""

    def __init__(self, node: Any, server: Any, kind: Any, name: str, words: str) -> None:
        self._node, self._server, self._kind, self._words = node, server, kind, words
        self._name = f"{name}/_action/get_result"
        self._file = node.lock.path.with_suffix(f".{name}")
        self._heads: list[str] = []
        self._seen_s: dict[str, float] = {}
        self._head: Any = None
        """Head of a request of our own, in whose place those of the others are sent."""
        take = server.take_data
        server.take_data = lambda: self._noted(take())
        with suppress(OSError, ValueError, TypeError):
            self._seen_s = {str(each): 0.0 for each in json.loads(self._file.read_text())}
        if self._seen_s:
            self._begun_s, self._asked = time.monotonic(), None
            self._client = node.create_client(kind.Impl.GetResultService, self._name)
            # Simulated time may stand still.
            clock = Clock(clock_type=ClockType.STEADY_TIME)
            self._timer = node.create_timer(LOOK_S, self._look, clock=clock)

    def forget(self) -> None:
        """Note that the goal has ended: its clients have their result."""
        self._heads.clear()
        self._keep()

    def _keep(self) -> None:
        # Not synchronised: what a killed process has written stays, and a reboot ends clients too.
        with suppress(OSError):
            if kept := [*self._seen_s, *self._heads]:
                self._file.write_text(json.dumps(kept[-MOST_KEPT:]))
            else:
                self._file.unlink(missing_ok=True)

    def _noted(self, taken: dict[str, Any]) -> dict[str, Any]:
        """Note the head of a request for a result on its way to the server."""
        if "result" in taken:
            head, request = taken["result"]
            if not any(request.goal_id.uuid):
                self._head = head
            elif (place := _place(head)) is not None:
                self._heads.append(bytes(place).hex())
                self._keep()
        return taken

    def _look(self) -> None:
        """Answer the clients that are there, and end when all are answered or gone."""
        now_s = time.monotonic()
        if self._node.quiet and self._node.others_goal:
            # Another node of this name may have taken it over.
            self._begun_s = now_s
            return
        if self._asked is None and self._client.service_is_ready():
            self._asked = self._client.call_async(self._kind.Impl.GetResultService.Request())
        # Our own request is answered before its head is used for others.
        if self._asked is not None and self._asked.done() and self._head is not None:
            for head in list(self._seen_s):
                if (writer := self._writer_of(bytes.fromhex(head))) is None:
                    continue
                self._seen_s[head] = self._seen_s[head] or now_s
                if now_s - self._seen_s[head] > SETTLED_S:
                    self._answer(writer + bytes.fromhex(head)[GUID_BYTES:])
                    del self._seen_s[head]
        if not self._seen_s or now_s - self._begun_s > GIVEN_UP_S:
            self._seen_s.clear()
            self._node.destroy_timer(self._timer)
            self._node.destroy_client(self._client)
            self._keep()

    def _writer_of(self, head: bytes) -> bytes | None:
        """Return the GUID of the client's writer, None while it is not seen."""
        # An answer to the reader is dropped by a server that has taken no request of it; one to the
        # writer is sent.  A client makes its writer right after its reader.
        number = int.from_bytes(head[PREFIX_BYTES : GUID_BYTES - 1], "big") + 1
        wanted = head[:PREFIX_BYTES] + number.to_bytes(3, "big") + bytes([WRITER_KIND])
        topic = f"rq{self._node.resolve_service_name(self._name)}Request"
        writers = self._node.get_publishers_info_by_topic(topic, True)
        return wanted if wanted in [bytes(each.endpoint_gid[:GUID_BYTES]) for each in writers] else None

    def _answer(self, head: bytes) -> None:
        place = _place(self._head)
        if place is not None:
            place[:] = head
            answer = self._kind.Impl.GetResultService.Response(
                status=GoalStatus.STATUS_ABORTED, result=self._kind.Result(success=False, message=self._words)
            )
            self._server._handle.send_result_response(self._head, answer)
            self._node.log_once(f"result of {self._name.partition('/')[0]} to a client", self._words)


def _place(head: Any) -> Any:
    """Return the bytes of a head (`rmw_request_id_t`), None where they are laid out otherwise."""
    # rclpy shows only the number; in an object of pybind11 the address of the head follows the
    # fields of every object.  Nobody knows what lies there in an object of another kind.
    if type(type(head)).__name__ != "pybind11_type":
        return None
    address = ctypes.c_void_p.from_address(id(head) + object.__basicsize__).value
    if address is None:
        return None
    place = (ctypes.c_ubyte * HEAD_BYTES).from_address(address)
    number = int.from_bytes(bytes(place[GUID_BYTES:]), sys.byteorder, signed=True)
    return place if number == head.sequence_number else None
