"""Record every topic of an antenna into a bag, as it was received; nothing is decoded.

Where time is simulated, the log time of a message is the newest time of `clock`, so that players
and plots show true rates at any speed; its publish time is the wall time of arrival.
"""

import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path

from ament_index_python.packages import get_package_share_directory
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.subscription import Subscription

from rf_pointing.report.bag_writer import BagResult, BagWriter
from rf_pointing.report.definitions import definitions, qos_from_profile
from rf_pointing.ros.graph import EXECUTIVE, TOPICS, Topic
from rf_pointing.ros.stamps import seconds_from_raw

QUEUE = 2000
"""Depth of the recorder's queues: enough for a pause of its process at any speed."""


class Recorder:
    """Subscribes to all `topics` of `namespace` and writes their messages with the wall time.

    A topic without a publisher in its row is recorded where there is one, and not waited for.
    Nothing is written before `simulated` time has come.
    """

    def __init__(
        self, node: Node, namespace: str, path: Path, topics: Sequence[Topic] = TOPICS,
        notes: Mapping[str, str] | None = None, simulated: bool = False,
    ) -> None:  # fmt: skip
        self._node, self._topics, self._closed = node, topics, False
        self._clock = f"{namespace}/clock" if simulated else ""
        self._clock_ns, self._held = 0, list[tuple[str, bytes, int]]()
        self._writer = BagWriter(path, definitions(Path(get_package_share_directory("rf_pointing_msgs"))), notes=notes)
        self._subscriptions = [self._subscribe(topic, namespace) for topic in topics]

    @property
    def problem(self) -> str:
        """Why the recording has stopped, "" while it goes on."""
        return self._writer.problem

    def unmatched(self) -> list[str]:
        """Return the topics, by full name, that no publisher of the run is connected to yet."""
        rows = zip(self._topics, self._subscriptions, strict=True)
        # A station without an executive is whole.
        waited = [item for topic, item in rows if topic.publisher not in ("", EXECUTIVE)]
        return [item.topic_name for item in waited if item.get_publisher_count() == 0]

    def close(self) -> BagResult:
        """End the recording; the result lists what is missing from the bag."""
        self._closed = True
        for subscription in self._subscriptions:
            self._node.destroy_subscription(subscription)
        return self._writer.close()

    def _subscribe(self, topic: Topic, namespace: str) -> Subscription:
        name = topic.name if topic.name.startswith("/") else f"{namespace}/{topic.name}"
        package = topic.message_type.__module__.partition(".")[0]
        self._writer.register(name, f"{package}/msg/{topic.message_type.__name__}", [qos_from_profile(topic.qos)])
        # The publisher's reliability and durability, but neither its deadline nor its lifespan: a
        # message that arrives late belongs in the bag, too.
        deep = QoSProfile(depth=QUEUE, reliability=topic.qos.reliability, durability=topic.qos.durability)

        def take(data: bytes) -> None:
            # A message can be on its way when its subscription is destroyed.
            if self._closed:
                return
            # The wall clock of arrival: latencies between topics are measured with it.
            self._held.append((name, data, time.time_ns()))
            if name == self._clock:
                with suppress(ValueError):
                    # Stamps are on whole microseconds.
                    self._clock_ns = round(seconds_from_raw(data) * 1e6) * 1000
            # Nodes report on /diagnostics before the clock does: one bag has one time.
            if self._clock_ns or not self._clock:
                for topic_name, raw, wall_ns in self._held:
                    self._writer.write(topic_name, self._clock_ns or wall_ns, raw, wall_ns)
                self._held.clear()

        return self._node.create_subscription(topic.message_type, name, take, deep, raw=True)
