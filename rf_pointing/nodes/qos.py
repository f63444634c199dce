"""Quality of service of every topic, by the role of what it carries.

A publisher offers a deadline and a lifespan on commands, so that a driver may ask for them; our own subscribers ask for
neither, so that a plain `ros2 topic pub` reaches them, and guard freshness by the stamps and a steady watchdog.
"""

from rclpy.duration import Duration
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

__all__ = ["COMMAND", "COMMAND_INPUT", "EXPERIMENT", "LATCHED", "SAMPLES", "STATUS", "STREAM"]

STREAM = QoSProfile(depth=10, history=HistoryPolicy.KEEP_LAST, reliability=ReliabilityPolicy.RELIABLE)
"""Measurements and status: reliable, depth 10; losses show in the sequence numbers."""

STATUS = QoSProfile(
    depth=10,
    history=HistoryPolicy.KEEP_LAST,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.TRANSIENT_LOCAL,
)
"""What a node that paces others does: its first words are kept for a receiver that is matched after they were said."""

SAMPLES = QoSProfile(
    depth=100,
    history=HistoryPolicy.KEEP_LAST,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.TRANSIENT_LOCAL,
)
"""Samples of which a missing one spoils its neighbours: two seconds of them, kept for a receiver that is matched late."""

EXPERIMENT = QoSProfile(depth=1000, history=HistoryPolicy.KEEP_LAST, reliability=ReliabilityPolicy.RELIABLE)
"""Samples of an experiment that is lost with any one of them: twenty seconds of them."""

COMMAND = QoSProfile(
    depth=1,
    history=HistoryPolicy.KEEP_LAST,
    reliability=ReliabilityPolicy.RELIABLE,
    deadline=Duration(seconds=0.5),
    lifespan=Duration(seconds=1.0),
)
"""What moves an antenna: only the newest counts, and an old one is worse than none."""

COMMAND_INPUT = QoSProfile(depth=10, history=HistoryPolicy.KEEP_LAST, reliability=ReliabilityPolicy.RELIABLE)
"""The same, as our driver subscribes to it: commands carry their times, so one that waited a moment is merged, not lost."""

LATCHED = QoSProfile(
    depth=1,
    history=HistoryPolicy.KEEP_LAST,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.TRANSIENT_LOCAL,
)
"""Models, limits and pass lists: a late joiner gets the last one."""
