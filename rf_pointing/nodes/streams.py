"""What a node's streams have in common: numbers on what is sent, counts of what was lost or refused, the newest only."""

import math
from collections import Counter, deque
from collections.abc import Callable
from typing import Any

from rclpy.publisher import Publisher
from rclpy.serialization import deserialize_message

from rf_pointing.nodes.diagnostics import OK, WARN, Health
from rf_pointing.nodes.stamps import seconds_from_raw

__all__ = ["InputCounter", "Latest", "SequencedPublisher"]

KEPT = 100
STAMP_RESOLUTION_S = 1e-6


def _source(message: Any) -> str:
    """Return whose count a message belongs to: sensors share a topic, and a node may speak for two of them."""
    return str(getattr(message, "sensor", ""))


class SequencedPublisher:
    """Numbers every message of a stream, those of each sensor on their own, so that a recording shows what was lost."""

    def __init__(self, publisher: Publisher) -> None:
        self._publisher = publisher
        self._sequences: Counter[str] = Counter()

    def publish(self, message: Any) -> None:
        """Set the message's sequence number and publish it."""
        source = _source(message)
        self._sequences[source] += 1
        message.sequence = self._sequences[source]
        self._publisher.publish(message)


class InputCounter:
    """Counts what was lost, by gaps in the sequence numbers, and what was refused of the streams a node listens to."""

    def __init__(self) -> None:
        self._newest: dict[tuple[str, str], int] = {}
        self.lost: dict[str, int] = {}
        self.refused: dict[str, int] = {}
        self.last_refusal = ""

    def watching(self, topic: str, callback: Callable[[Any], None]) -> Callable[[Any], None]:
        """Return `callback` with the count in front of it; a publisher that starts again at 1 is not a loss."""
        self.lost[topic] = 0

        def counted(message: Any) -> None:
            source = (topic, _source(message))
            newest = self._newest.get(source)
            if newest is not None and message.sequence > newest + 1:
                self.lost[topic] += message.sequence - newest - 1
            self._newest[source] = message.sequence
            callback(message)

        return counted

    def note_refusal(self, topic: str, reason: str) -> None:
        """Count a message that could not be used."""
        self.refused[topic] = self.refused.get(topic, 0) + 1
        self.last_refusal = f"{topic}: {reason}"

    def health(self) -> Health:
        """Return the counts, as a warning when anything was lost or refused."""
        lost, refused = sum(self.lost.values()), sum(self.refused.values())
        words = [f"{lost} messages lost"] * bool(lost) + [f"{refused} messages refused"] * bool(refused)
        values: dict[str, object] = {f"lost {topic}": count for topic, count in self.lost.items()}
        values |= {f"refused {topic}": count for topic, count in self.refused.items()}
        return Health(
            WARN if words else OK, ", ".join(words) or "complete", values | {"last_refusal": self.last_refusal}
        )


class Latest:
    """Keeps the newest messages of a fast stream undecoded; `take` decodes the one that is wanted."""

    def __init__(self, message_type: Any, convert: Callable[[Any], Any]) -> None:
        self._type, self._convert = message_type, convert
        self._raw: deque[bytes] = deque(maxlen=KEPT)

    def note(self, raw: bytes) -> None:
        """Keep `raw`."""
        self._raw.append(raw)

    def take(self, until_s: float = math.inf) -> Any | None:
        """Return what the newest message up to the stamp `until_s` says; ValueError if it cannot be used.

        None if there is no such message since the last call; later ones are kept.
        """
        raw = None
        while self._raw and seconds_from_raw(self._raw[0]) <= until_s + STAMP_RESOLUTION_S:
            raw = self._raw.popleft()
        return None if raw is None else self._convert(deserialize_message(raw, self._type))
