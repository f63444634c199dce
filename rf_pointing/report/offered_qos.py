"""Quality of service as a bag stores it, so that `ros2 bag play` offers what the recorded publisher offered."""

from typing import Any

from rosbags.interfaces import Qos, QosDurability, QosHistory, QosLiveliness, QosReliability, QosTime

__all__ = ["offered_qos", "qos_from_profile"]

_INFINITE = QosTime(9223372036, 854775807)


def offered_qos(
    *,
    depth: int = 10,
    reliability: str = "reliable",
    durability: str = "volatile",
    history: str = "keep_last",
    deadline_ns: int | None = None,
    lifespan_ns: int | None = None,
) -> Qos:
    """Return one offered profile; durations of None are infinite, the names are those of `ros2 topic info -v`."""
    return Qos(
        history=QosHistory[history.upper()],
        depth=depth,
        reliability=QosReliability[reliability.upper()],
        durability=QosDurability[durability.upper()],
        deadline=_duration(deadline_ns),
        lifespan=_duration(lifespan_ns),
        liveliness=QosLiveliness.AUTOMATIC,
        liveliness_lease_duration=_INFINITE,
        avoid_ros_namespace_conventions=False,
    )


def qos_from_profile(profile: Any) -> Qos:
    """Return the offered profile of a QoS profile object with rclpy's attributes (read by name, no ROS needed)."""
    return offered_qos(
        depth=profile.depth,
        reliability=profile.reliability.name,
        durability=profile.durability.name,
        history=profile.history.name,
        deadline_ns=profile.deadline.nanoseconds,
        lifespan_ns=profile.lifespan.nanoseconds,
    )


def _duration(nanoseconds: int | None) -> QosTime:
    # A profile says 0 for "none demanded"; the graph and the recorder of ROS write that as infinite.
    if not nanoseconds or nanoseconds >= _INFINITE.sec * 10**9:
        return _INFINITE
    return QosTime(nanoseconds // 10**9, nanoseconds % 10**9)
