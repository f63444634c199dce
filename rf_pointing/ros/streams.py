"""The streams of a node: numbers on what it publishes, and counts of what became of its input.

A gap in the numbers is a loss.  What was lost or refused is counted on /diagnostics.
"""

import math
from collections import Counter, deque
from collections.abc import Callable, Sequence
from functools import cache
from operator import attrgetter
from typing import Any, TypeAlias

from rclpy.duration import Duration
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.publisher import Publisher
from rclpy.serialization import deserialize_message

from rf_pointing.core.checks import LARGEST
from rf_pointing.ros.diagnostics import OK, WARN, Health
from rf_pointing.ros.stamps import BILLION, seconds_from_raw, seconds_from_stamp

KEPT = 100
"""Messages of a fast stream that wait to be used: two seconds at 50 Hz."""
# Patience with readers; it doubles with each renewal, for a dead one stays in the graph 20 s.
UNSERVED_S, LONGEST_UNSERVED_S = 10.0, 3600.0
STAMP_RESOLUTION_S = 1e-6
LEVEL = "carrier_to_noise"
"""The one number that may be -inf: dB-Hz where there is no carrier."""
RMWError = rclpy_implementation.RMWError
SCALARS, STAMP = ("double", "float"), "builtin_interfaces/Time"
"""Kinds of fields that are checked each in its way."""


def _source(message: Any) -> str:
    """Return the sensor that a message is numbered for, "" where it has none."""
    # Several trackers share a topic, and one node can publish for two of them.
    return str(getattr(message, "sensor", ""))


def frame_in(namespace: str, frame: str) -> str:
    """Return the name of an antenna's frame on /tf, which all antennas share."""
    return f"{namespace}/{frame}".strip("/")


class LatchedPublisher:
    """Publishes one message that lasts; readers that do not take it get it from a new writer.

    Damaged packets can leave a writer that no longer serves a reader; nothing in ROS reports it.
    `make` returns a publisher, `readers` the number of them in the graph.
    """

    def __init__(
        self, make: Callable[[], Publisher], destroy: Callable[[Publisher], object],
        readers: Callable[[], int],
    ) -> None:  # fmt: skip
        self._make, self._destroy, self._readers = make, destroy, readers
        self._publisher, self._last = make(), None
        self._served_s, self._patience_s = math.inf, UNSERVED_S
        self.renewed = 0

    def publish(self, message: Any) -> None:
        """Publish a message in place of the last one."""
        self._last = message
        self._publisher.publish(message)

    def look(self, now_s: float) -> bool:
        """Renew a writer that has not served all readers for too long; return whether it was."""
        publisher = self._publisher
        matched = publisher.get_subscription_count() >= self._readers()
        if matched and publisher.wait_for_all_acked(Duration()):
            self._served_s, self._patience_s = now_s, UNSERVED_S
        self._served_s = min(self._served_s, now_s)
        if self._last is None or now_s - self._served_s <= self._patience_s:
            return False
        # Ever more rarely: a reader may also stand still, or request what no writer of ours offers.
        self._served_s, self._patience_s = now_s, min(2.0 * self._patience_s, LONGEST_UNSERVED_S)
        self.close()
        self._publisher = self._make()
        self.publish(self._last)
        self.renewed += 1
        return True

    def close(self) -> None:
        """Destroy the writer."""
        self._destroy(self._publisher)


AnyPublisher: TypeAlias = Publisher | LatchedPublisher


class FramedPublisher:
    """Publishes with the frame of its topic in the header."""

    def __init__(self, publisher: AnyPublisher, frame_id: str) -> None:
        self._publisher, self._frame_id = publisher, frame_id

    def publish(self, message: Any) -> None:
        """Publish a message that has a header; one that is serialized has its frame already."""
        if not isinstance(message, bytes):
            message.header.frame_id = self._frame_id
        self._publisher.publish(message)


class SequencedPublisher:
    """Numbers every message of a stream, for each sensor separately: a recording shows losses."""

    def __init__(self, publisher: AnyPublisher | FramedPublisher) -> None:
        self._publisher = publisher
        self._sequences: Counter[str] = Counter()

    def publish(self, message: Any) -> None:
        """Set the message's sequence number and publish it."""
        source = _source(message)
        self._sequences[source] += 1
        message.sequence = self._sequences[source]
        self._publisher.publish(message)


def require_length(payload: bytes, most_bytes: int) -> None:
    """Raise ValueError for a message that is longer than any of its topic."""
    if len(payload) > most_bytes:
        raise ValueError(f"a message of {len(payload)} bytes, must be <= {most_bytes}")


def checked_message(payload: bytes, message_type: Any) -> Any:
    """Return a decoded message whose numbers and stamps can be ones, or raise ValueError."""
    try:
        message = deserialize_message(payload, message_type)
    except (RMWError, UnicodeDecodeError) as error:
        raise ValueError(f"{len(payload)} bytes are no {message_type.__name__}") from error
    require_plausible(message)
    return message


def require_plausible(message: Any) -> None:
    """Raise ValueError, naming the field, for a number or a stamp that is impossible."""
    if not _plausible(type(message))(message):
        _require_each(message)


@cache
def _plausible(message_type: Any) -> Callable[[Any], bool]:
    """Return a quick test of the messages of a type; what it doubts `_require_each` decides."""
    # A walk through the fields of every message took three times as long as its decoding.
    numbers, arrays, stamps, lists = (_getter(names) for names in _places(message_type()))

    def plausible(message: Any) -> bool:
        # The root of the sum of squares is at least the largest, and not finite unless each is.
        if not math.hypot(*numbers(message)) <= LARGEST:
            return False
        for array in arrays(message):
            if not math.hypot(*array) <= LARGEST:
                return False
        for stamp in stamps(message):
            if stamp.sec < 0 or stamp.nanosec >= BILLION:
                return False
        for elements in lists(message):
            for each in elements:
                if not _plausible(type(each))(each):
                    return False
        return True

    return plausible


def _places(message: Any, place: str = "") -> tuple[list[str], list[str], list[str], list[str]]:
    """Return where numbers, arrays of numbers, stamps and lists of messages are in a message."""
    found: tuple[list[str], list[str], list[str], list[str]] = [], [], [], []
    for field, kind in _numeric_fields(type(message)):
        if "/" in kind and kind[-1] not in ">]" and kind != STAMP:
            for names, further in zip(found, _places(getattr(message, field), f"{place}{field}."), strict=True):
                names += further
        else:
            which = 0 if kind in SCALARS else 1 if "/" not in kind else 2 if kind == STAMP else 3
            found[which].append(f"{place}{field}")
    return found


def _getter(names: Sequence[str]) -> Callable[[Any], tuple[Any, ...]]:
    """Return what reads attributes, also of attributes, in one call."""
    if not names:
        return lambda _message: ()
    get = attrgetter(*names)
    return get if len(names) > 1 else lambda message: (get(message),)


def _require_each(message: Any, place: str = "") -> None:
    for field, kind in _numeric_fields(type(message)):
        value, sound = getattr(message, field), True
        if kind in SCALARS:
            # Squares of such numbers are still finite, and nothing in the field is larger.
            sound = -LARGEST <= value <= LARGEST or (field == LEVEL and value == -math.inf)
        elif "/" not in kind:
            sound = all(-LARGEST <= each <= LARGEST for each in value)
        elif kind == STAMP:
            seconds_from_stamp(value)
        elif kind[-1] in ">]":
            for index, element in enumerate(value):
                _require_each(element, f"{place}{field}[{index}].")
        else:
            _require_each(value, f"{place}{field}.")
        if not sound:
            raise ValueError(f"{place}{field} must be finite and at most {LARGEST:g}")


@cache
def _numeric_fields(message_type: Any) -> list[tuple[str, str]]:
    kinds = message_type.get_fields_and_field_types().items()
    return [(field, kind) for field, kind in kinds if "/" in kind or "double" in kind or "float" in kind]


class InputCounter:
    """Counts lost messages of a node's inputs, by gaps in their numbers, and refused ones."""

    def __init__(self) -> None:
        self._newest: dict[tuple[str, str], int] = {}
        self.lost: dict[str, int] = {}
        self.refused: dict[str, int] = {}
        self.last_refusal = ""
        self.errors = 0
        self.last_error = ""

    def watching(self, topic: str, callback: Callable[[Any], None]) -> Callable[[Any], None]:
        """Return `callback` with the count before it; a publisher that restarts loses nothing."""
        self.lost[topic] = 0

        def counted(message: Any) -> None:
            source = (topic, _source(message))
            newest = self._newest.get(source)
            # A number that falls is a restart of the publisher.
            if newest is not None and message.sequence > newest + 1:
                self.lost[topic] += message.sequence - newest - 1
            self._newest[source] = message.sequence
            callback(message)

        return counted

    def note_refusal(self, topic: str, reason: str) -> None:
        """Count a message that could not be used."""
        self.refused[topic] = self.refused.get(topic, 0) + 1
        self.last_refusal = f"{topic}: {reason}"

    def note_error(self, where: str, error: BaseException) -> None:
        """Count an error that was not foreseen."""
        self.errors += 1
        self.last_error = f"{where}: {type(error).__name__}: {error}"

    def health(self) -> Health:
        """Return the counts, as a warning when anything was lost or refused or has raised."""
        lost, refused = sum(self.lost.values()), sum(self.refused.values())
        words = [f"{lost} messages lost"] * bool(lost) + [f"{refused} messages refused"] * bool(refused)
        words += [f"{self.errors} errors survived"] * bool(self.errors)
        values: dict[str, object] = {f"lost {topic}": count for topic, count in self.lost.items()}
        values |= {f"refused {topic}": count for topic, count in self.refused.items()}
        values |= {"last_refusal": self.last_refusal, "errors": self.errors, "last_error": self.last_error}
        return Health(WARN if words else OK, ", ".join(words) or "complete", values)


class Latest:
    """Keeps the newest messages of a fast stream undecoded; `take` decodes one of them.

    `refused` takes the reason why a message cannot be used.
    """

    def __init__(self, message_type: Any, convert: Callable[[Any], Any], refused: Callable[[str], object]) -> None:
        self._type, self._convert, self._refused = message_type, convert, refused
        self._raw = deque[bytes](maxlen=KEPT)

    def note(self, raw: bytes) -> None:
        """Keep `raw`; ValueError without a stamp."""
        seconds_from_raw(raw)
        self._raw.append(raw)

    def take(self, until_s: float = math.inf) -> Any | None:
        """Return the converted newest message up to the stamp `until_s`, None without a new one.

        Later messages are kept.  Of those that cannot be used the one before is taken.
        """
        # Only the stamps are read here: at 50 Hz decoding every message costs more than using one.
        # A stamp far ahead keeps nothing behind it from being used.
        due, later = list[bytes](), deque[bytes](maxlen=KEPT)
        for raw in self._raw:
            (due if seconds_from_raw(raw) <= until_s + STAMP_RESOLUTION_S else later).append(raw)
        self._raw = later
        # Periodic work, which cannot be left out, calls this: nothing that has arrived may raise.
        for raw in reversed(due):
            try:
                return self._convert(checked_message(raw, self._type))
            except ValueError as error:
                self._refused(str(error))
        return None
