"""Quality of service of every topic, by the role of what it carries."""

from typing import Any

from rclpy.duration import Duration
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

_KEPT = {"durability": DurabilityPolicy.TRANSIENT_LOCAL}
"""The last messages are kept for a late subscriber."""


def _reliable(depth: int, **policies: Any) -> QoSProfile:
    # Reliable also for measurements: a lost one is a lost period of the loop.
    return QoSProfile(depth=depth, history=HistoryPolicy.KEEP_LAST, reliability=ReliabilityPolicy.RELIABLE, **policies)


STREAM = _reliable(10)
"""Measurements and status: reliable, depth 10; losses show in the sequence numbers."""
INSTRUMENT = QoSProfile(depth=10, history=HistoryPolicy.KEEP_LAST, reliability=ReliabilityPolicy.BEST_EFFORT)
"""Topics of devices: most drivers publish best effort, which a reliable subscriber does not
receive; this one receives both."""
WATCHED = _reliable(2000)
"""The same streams for a node that only watches: it may be busy for a while and loses none."""
STATUS = _reliable(10, **_KEPT)
"""Status that others wait for: the first messages are kept for a late subscriber."""
SAMPLES = _reliable(100, **_KEPT)
"""Samples that are used together, so none may be missing: two seconds, kept for late ones."""
EXPERIMENT = _reliable(1000)
"""Samples of an experiment, which fails without any one of them: twenty seconds."""
# Commands offer a deadline and a lifespan, so that a driver may request them.  Our own subscribers
# request neither, so that a plain `ros2 topic pub` reaches them; they check the stamps instead.
COMMAND = _reliable(1, deadline=Duration(seconds=0.5), lifespan=Duration(seconds=1.0))
"""Commands that move an antenna: only the newest counts, and an old one is worse than none."""
COMMAND_INPUT = _reliable(10)
"""The same for our driver: commands carry their times, so one that waited is still useful."""
SET_POINT = _reliable(1)
"""Set points of a device: only the newest counts, and none waits behind one that was lost."""
SERVICE = _reliable(1000)
"""Requests: of a hundred at once ten are kept by default, and the others never answered."""
LATCHED = _reliable(1, **_KEPT)
"""Models, limits and pass lists: a late subscriber gets the last one."""
IN_USE = _reliable(32, **_KEPT)
"""Declaration of every node of an antenna, made once: a late subscriber gets that of each."""
