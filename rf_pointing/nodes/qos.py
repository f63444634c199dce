"""Quality of service of every topic, by the role of what it carries."""

from rclpy.duration import Duration
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

# Reliable also for measurements: a lost one is a lost period of the loop.
STREAM = QoSProfile(depth=10, history=HistoryPolicy.KEEP_LAST, reliability=ReliabilityPolicy.RELIABLE)
"""Measurements and status: reliable, depth 10; losses show in the sequence numbers."""

STATUS = QoSProfile(
    depth=10,
    history=HistoryPolicy.KEEP_LAST,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.TRANSIENT_LOCAL,
)
"""Status that others wait for: the first messages are kept for a late subscriber."""

SAMPLES = QoSProfile(
    depth=100,
    history=HistoryPolicy.KEEP_LAST,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.TRANSIENT_LOCAL,
)
"""Samples that are used together, so none may be missing: two seconds, kept for late ones."""

EXPERIMENT = QoSProfile(depth=1000, history=HistoryPolicy.KEEP_LAST, reliability=ReliabilityPolicy.RELIABLE)
"""Samples of an experiment, which fails without any one of them: twenty seconds."""

# Commands offer a deadline and a lifespan, so that a driver may request them.  Our own subscribers
# request neither, so that a plain `ros2 topic pub` reaches them; they check the stamps instead.
COMMAND = QoSProfile(
    depth=1,
    history=HistoryPolicy.KEEP_LAST,
    reliability=ReliabilityPolicy.RELIABLE,
    deadline=Duration(seconds=0.5),
    lifespan=Duration(seconds=1.0),
)
"""What moves an antenna: only the newest counts, and an old one is worse than none."""

COMMAND_INPUT = QoSProfile(depth=10, history=HistoryPolicy.KEEP_LAST, reliability=ReliabilityPolicy.RELIABLE)
"""The same for our driver: commands carry their times, so one that waited is still useful."""

LATCHED = QoSProfile(
    depth=1,
    history=HistoryPolicy.KEEP_LAST,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.TRANSIENT_LOCAL,
)
"""Models, limits and pass lists: a late subscriber gets the last one."""
