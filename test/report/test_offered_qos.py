"""Profiles as a bag stores them."""

from enum import Enum
from types import SimpleNamespace

from rosbags.interfaces import QosDurability, QosHistory, QosReliability, QosTime

from rf_pointing.report.offered_qos import offered_qos, qos_from_profile


def test_absent_durations_are_infinite_as_ros_writes_them() -> None:
    profile = offered_qos()
    assert profile.deadline == profile.lifespan == QosTime(9223372036, 854775807)


def test_profile_object_is_read_by_its_attributes() -> None:
    names = Enum("names", ["KEEP_LAST", "RELIABLE", "TRANSIENT_LOCAL"])
    profile = SimpleNamespace(
        depth=1,
        history=names.KEEP_LAST,
        reliability=names.RELIABLE,
        durability=names.TRANSIENT_LOCAL,
        deadline=SimpleNamespace(nanoseconds=500_000_000),
        lifespan=SimpleNamespace(nanoseconds=0),
    )
    stored = qos_from_profile(profile)
    assert (stored.history, stored.depth) == (QosHistory.KEEP_LAST, 1)
    assert stored.reliability is QosReliability.RELIABLE
    assert stored.durability is QosDurability.TRANSIENT_LOCAL
    assert stored.deadline == QosTime(0, 500_000_000)
    assert stored.lifespan == QosTime(9223372036, 854775807)
