"""Who may move the antenna: commands and calls are signed with a key that only its user can read.

    signature of a command = HMAC-SHA256(key, topic, commander, stamp, number, SHA-256 of its bytes)
    signature of a call = HMAC-SHA256(key, service, caller, stamp, request)
    signature of a claim = HMAC-SHA256(key, topic, antenna, process, stamp, rows)

Each is the first 128 bits.  ROS 2 tells a Python node nothing of the publisher of a message, and
anybody can send any name.  The key is a file of controller and control unit, not a message: a peer
of the domain cannot read it.  The signature of a command is a message of its own
(`signed_commands.py`); one that is sent again is refused by its stamps, a call by its signature.
Signatures of calls that are stamped ahead of this computer's clock are kept next to the key: after
a restart they would not be older than it.  Without a file nothing is signed, and any commander with
a name is taken.
Executives that share a schedule have a key of their own (`executive.partners_key_file`).
"""

import os
import re
import socket
import struct
import time
from collections.abc import Iterable
from functools import cached_property
from pathlib import Path
from typing import Any

from builtin_interfaces.msg import Time
from rf_pointing_msgs.msg import CommandSignature
from rf_pointing_msgs.srv import SignedCall

from rf_pointing.core import KeptState, to_utc_text
from rf_pointing.core.secret_files import secret_in
from rf_pointing.ros.diagnostics import ERROR, OK, WARN, Health
from rf_pointing.ros.graph import ROTCTLD
from rf_pointing.ros.stamps import seconds_from_stamp, stamp_from_seconds
from rf_pointing.station.parameters import CommandKeyParams

KEY_BYTES, SHOWN_DIGITS, ID_DIGITS = 32, 32, 8
# How long after a foreign command /diagnostics shows the conflict as an error.
SHOWN_S = 10.0
# Age of a call by the clocks of both computers; a longer one lets clocks differ, and keeps more
# signatures.
CALL_S = 10.0
INSTANCE = f"{to_utc_text(time.time())}@{socket.gethostname()}:{os.getpid()}"
"""This process and its start: of two executives of an antenna the first by this text steers."""


class CommandKey:
    """Signs the commands of one topic and calls, or checks them.

    ValueError, which names the parameter, for a file that others can read.  `foreign` counts the
    commands that were refused.
    """

    def __init__(self, params: CommandKeyParams, topic: str = "", parameter: str = "command_key_file") -> None:
        self.path, self._topic = params.command_key_file, topic
        self._key = _key_of(Path(self.path), parameter) if self.path else b""
        self.foreign, self._last, self._last_s = 0, "", 0.0
        self._begun_s, self._taken = time.time(), dict[str, float]()

    @property
    def signed(self) -> bool:
        """Whether there is a key."""
        return bool(self._key)

    @cached_property
    def key_id(self) -> str:
        """Short name of the key, which tells nothing else of it; "" without a key."""
        return digest_of(b"id" + self._key)[:ID_DIGITS] if self._key else ""

    def sign(self, command: bytes, stamp: Time, number: int, commander: str) -> CommandSignature:
        """Return who sends a serialized command, signed where there is a key."""
        message = CommandSignature(
            sequence=number, commander=commander, digest=digest_of(command), key_id=self.key_id
        )  # fmt: skip
        message.header.stamp = stamp
        message.signature = self._signature(message) if self._key else ""
        return message

    def check(self, message: CommandSignature) -> None:
        """Raise ValueError for a signature of anybody without the key."""
        if self._key and not _same(message.signature, self._signature(message)):
            raise ValueError(self.conflict(
                f"a command in the name of {message.commander or 'nobody'} is not signed with the key of this antenna, "
                f"but with {message.key_id or 'none'};"
            ))  # fmt: skip

    def conflict(self, words: str) -> str:
        """Count a foreign command and return the reason, which ends with the key."""
        self.foreign, self._last_s = self.foreign + 1, time.monotonic()
        self._last = f"conflict: {words} {self.key_id} ({self.path})"
        return self._last

    def sign_call(self, call: SignedCall.Request) -> None:
        """Write the time and the signature into a complete call; needs a key."""
        call.stamp = stamp_from_seconds(time.time())
        call.signature = self._call_signature(call)

    def check_call(self, call: SignedCall.Request) -> None:
        """Refuse a call of anybody without the key, and one that is old or sent again."""
        if not self._key:
            return
        if not _same(call.signature, self._call_signature(call)):
            raise ValueError(
                f"a call in the name of {call.caller or 'nobody'} is not signed with the key of this antenna ({self.path})"
            )
        now_s, stamp_s = time.time(), seconds_from_stamp(call.stamp)
        if abs(now_s - stamp_s) > CALL_S:
            raise ValueError(
                f"the call of {call.caller} is {now_s - stamp_s:.1f} s old by this computer's clock, must be within "
                f"{CALL_S:.0f} s; set the clocks of both computers"
            )
        # What was taken before a restart is older than it, or in the file.
        taken = self._taken or self._memory.recover()
        if call.signature in taken or stamp_s < self._begun_s:
            raise ValueError(f"the call of {call.caller} was sent before")
        self._taken = {each: s for each, s in taken.items() if abs(now_s - s) <= CALL_S} | {call.signature: stamp_s}
        ahead = {each: s for each, s in self._taken.items() if s > now_s}
        if call.signature in ahead:
            self._memory.keep(ahead)
            if self._memory.problem:
                raise ValueError(
                    f"the call of {call.caller} is stamped {stamp_s - now_s:.3f} s ahead of this computer's clock, and "
                    f"cannot be remembered: {self._memory.problem}"
                )

    @cached_property
    def _memory(self) -> KeptState:
        # Made with the first call: who only signs keeps nothing.
        return KeptState(f"{self.path}.taken")

    def sign_claim(self, message: Any, topic: str, name: str) -> None:
        """Write who an executive is into its schedule or status, signed if there is a key."""
        message.antenna, message.process = name, INSTANCE
        message.signature = self._claim_signature(message, topic, name) if self._key else ""

    def check_claim(self, message: Any, topic: str, name: str, now_s: float) -> None:
        """Refuse a schedule or status that is not signed by `name`, or is ahead of `now_s`."""
        stamp_s = seconds_from_stamp(message.header.stamp)
        if not self._key or not _same(message.signature, self._claim_signature(message, topic, name)):
            raise ValueError(f"it is not signed by {name} with the key of the partners ({self.path})")
        if stamp_s > now_s + CALL_S:
            raise ValueError(f"the clock of {name} is {stamp_s - now_s:.1f} s ahead, must be <= {CALL_S:.0f} s")

    def health(self, publishers: Iterable[Any]) -> Health:
        """Return the foreign commands as an error, a second publisher of commands as a warning."""
        # One that stands by has the same name.
        names = sorted({f"{each.node_namespace.rstrip('/')}/{each.node_name}" for each in publishers})
        values = {"publishers": ", ".join(names), "foreign_commands": self.foreign, "signed": self.signed}
        if self.foreign and time.monotonic() - self._last_s < SHOWN_S:
            return Health(ERROR, self._last, values)
        # The server of rotctld's clients commands in place of the controller, never with it.
        if len([name for name in names if not name.endswith(f"/{ROTCTLD}")]) > 1:
            # A node that was killed stays in the graph for 20 s.
            return Health(WARN, f"{len(names)} publishers of {self._topic}: {', '.join(names)}", values)
        return Health(OK, "one commander" if names else "no commander", values)

    # Each begins with a word of its own: none is a valid signature of another kind.

    def _signature(self, message: CommandSignature) -> str:
        stamp = message.header.stamp
        head = struct.pack("<4sqIQ", b"sent", stamp.sec, stamp.nanosec, message.sequence)
        words = self._topic, message.commander, message.digest
        return self._digest([head, *map(_counted, words)])

    def _call_signature(self, call: SignedCall.Request) -> str:
        head = struct.pack("<4sqI", b"call", call.stamp.sec, call.stamp.nanosec)
        return self._digest([head, _counted(call.service), _counted(call.caller), bytes(call.request)])

    def _claim_signature(self, message: Any, topic: str, name: str) -> str:
        stamp = message.header.stamp
        head = struct.pack("<4sqI", b"says", stamp.sec, stamp.nanosec)
        words = [topic, name, message.process]
        words += [getattr(message, each, "") for each in ("state", "pass_id", "partner_inhibit")]
        for each in getattr(message, "passes", ()):
            words += [each.id, each.state, f"{each.aos.sec}.{each.aos.nanosec}", f"{each.los.sec}.{each.los.nanosec}"]
        return self._digest([head, *map(_counted, words)])

    def _digest(self, signed: list[bytes]) -> str:
        # Imported here, as below: an antenna without a key needs no OpenSSL, which takes 3.5 MB.
        import hmac

        return hmac.new(self._key, b"".join(signed), "sha256").hexdigest()[:SHOWN_DIGITS]


def _same(one: str, other: str) -> bool:
    import hmac

    return hmac.compare_digest(one.encode(), other.encode())


def digest_of(payload: bytes) -> str:
    """Return the SHA-256 of a serialized message in hexadecimal."""
    import hashlib

    return hashlib.sha256(payload).hexdigest()


def _counted(word: str) -> bytes:
    # The lengths keep two words from trading letters.
    return f"{len(word)}:{word}".encode()


def _key_of(path: Path, parameter: str) -> bytes:
    """Return the key in a file, which is made with one if it is missing."""
    try:
        import secrets

        text = secret_in(path, lambda: secrets.token_hex(KEY_BYTES))
    except ValueError as error:
        raise ValueError(f"{parameter}={error}") from error
    if not re.fullmatch(rf"[0-9a-fA-F]{{{2 * KEY_BYTES}}}", text):
        raise ValueError(f"{parameter}={path} must hold {2 * KEY_BYTES} hexadecimal digits; delete it for a new key")
    return bytes.fromhex(text)
