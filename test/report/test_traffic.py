"""Counting losses and linking messages, on small hand-made topics."""

from pathlib import Path

import numpy as np
import pytest

from rf_pointing.report.bag_writer import TopicLoss
from rf_pointing.report.recording import Recording
from rf_pointing.report.summary import TopicTraffic
from rf_pointing.report.topics import TopicData
from rf_pointing.report.traffic import latencies, topic_traffic

MS = 1_000_000


def topic(
    name: str, stamp_ms: list[int], *, log_ms: list[float] | None = None,
    sequence: list[int] | None = None, sensor: list[str] | None = None,
) -> TopicData:  # fmt: skip
    return TopicData(
        topic=f"/gs1/{name}",
        type_name="a_msgs/msg/B",
        log_time_ns=np.array([round(value * MS) for value in log_ms or stamp_ms], dtype=np.int64),
        stamp_ns=np.array(stamp_ms, dtype=np.int64) * MS,
        sequence=None if sequence is None else np.array(sequence),
        columns={} if sensor is None else {"sensor": np.array(sensor)},
    )


def recording(*not_recorded: TopicLoss, **topics: TopicData) -> Recording:
    return Recording(
        path=Path("bag"), namespace="/gs1",
        topics={name.replace("__", "/"): data for name, data in topics.items()}, passes=(),
        warnings=(), others={}, notes={}, not_recorded=not_recorded, problems=(),
    )  # fmt: skip


def row(**topics: TopicData) -> TopicTraffic:
    return topic_traffic(recording(**topics))[0]


@pytest.mark.parametrize(
    ("sequence", "lost", "restarts"), [([5, 6, 9, 10, 0, 1, 3, 4], 3, 1), ([0, 1, 0, 0, 1, 2], 0, 2)]
)
def test_missing_numbers_are_losses_and_one_that_falls_or_stands_still_is_a_restart(
    sequence: list[int], lost: int, restarts: int
) -> None:
    found = row(target=topic("target", list(range(0, 100 * len(sequence), 100)), sequence=sequence))
    assert (found.lost, found.restarts, found.counted_by) == (lost, restarts, "sequence numbers")


def test_two_sensors_on_one_topic_are_counted_apart() -> None:
    sensors = ["monopulse", "conscan"] * 4
    numbers = [0, 100, 1, 101, 3, 102, 4, 105]
    errors = topic("pointing_error", [0, 3, 100, 103, 200, 203, 300, 303], sequence=numbers, sensor=sensors)
    conscan, monopulse = topic_traffic(recording(pointing_error=errors))
    assert (conscan.sensor, conscan.count, conscan.lost, conscan.restarts) == ("conscan", 4, 2, 0)
    assert (monopulse.sensor, monopulse.count, monopulse.lost, monopulse.restarts) == ("monopulse", 4, 1, 0)
    assert (conscan.rate_hz, monopulse.rate_hz) == pytest.approx((10.0, 10.0))


def test_gaps_between_stamps_are_losses_but_a_long_one_is_a_pause() -> None:
    stamps = [0, 20, 40, 100, 120, 140, 1_140, 1_160]
    found = row(joint_states=topic("joint_states", stamps))
    assert (found.lost, found.counted_by) == (2, "stamp gaps")
    assert found.longest_gap_s == pytest.approx(1.0)
    assert found.rate_hz == pytest.approx(50.0)


def test_a_gap_needs_a_period_and_not_an_order_of_reception() -> None:
    assert row(joint_states=topic("joint_states", [0, 40, 20, 60, 80])).lost == 0
    latched = row(passes=topic("passes", [0, 10_000], sequence=[0, 1]))
    assert (latched.rate_hz, latched.wall_rate_hz, latched.lost) == (None, None, 0)
    single = row(joint_states=topic("joint_states", [0]))
    assert (single.count, single.rate_hz, single.lost, single.longest_gap_s) == (1, None, None, None)


def test_what_the_recorder_lost_is_told_per_topic() -> None:
    data = recording(TopicLoss("/gs1/target", 7, 0), target=topic("target", [0, 100], sequence=[0, 1]))
    assert topic_traffic(data)[0].not_recorded == 7


ALL_MONOPULSE = ["monopulse"] * 4
LINKS: dict[str, tuple[dict[str, tuple[list[int], list[float]]], list[str], tuple[int, float, float]]] = {
    "only the same stamp": (
        {"clock": ([0, 20, 40, 60], [0.0, 2.0, 4.0, 6.0]), "joint_states": ([20, 50], [2.5, 5.75])},
        [], (1, 0.5, 0.5)),
    "the last received before, where no stamps are the same": (
        {"clock": ([0, 20, 40, 60], [0.0, 2.0, 4.0, 6.0]), "joint_states": ([25, 50], [2.5, 5.75])},
        [], (2, 1.125, 1.75)),
    "not one whose cause is not recent": (
        {"clock": ([0, 20, 40], [0.0, 2.0, 4.0]), "joint_states": ([45, 100], [4.5, 50.0])},
        [], (1, 0.5, 0.5)),
    "its cluster, in whose middle an error is stamped": (
        {"monopulse": ([100, 200, 300], [10.0, 20.0, 30.0]), "pointing_error": ([60, 160, 260], [11.0, 21.0, 31.0])},
        ALL_MONOPULSE[:3], (3, 1.0, 1.0)),
    "not the cause before the one that was lost": (
        {"monopulse": ([0, 100, 300, 400], [0.0, 10.0, 30.0, 40.0]),
         "pointing_error": ([0, 100, 200, 300], [1.0, 11.0, 21.0, 31.0])}, ALL_MONOPULSE, (3, 1.0, 1.0)),
    "not the error of another sensor": (
        {"monopulse": ([0, 100, 200], [0.0, 10.0, 20.0]), "pointing_error": ([0, 100, 150], [1.0, 11.0, 99.0])},
        [*ALL_MONOPULSE[:2], "conscan"], (2, 1.0, 1.0)),
    "the first message out, without pauses": (
        {"pointing_error": ([0, 100, 200, 300], [0.0, 10.0, 20.0, 31.0]),
         "tracking_status": ([0, 100, 200], [1.0, 12.0, 23.0])}, ALL_MONOPULSE, (3, 2.0, 3.0)),
}  # fmt: skip


@pytest.mark.parametrize("case", LINKS)
def test_an_effect_is_linked_to(case: str) -> None:
    topics, sensors, (count, median_ms, longest_ms) = LINKS[case]
    sensor = {"pointing_error": sensors}
    made = {name: topic(name, at, log_ms=logs, sensor=sensor.get(name)) for name, (at, logs) in topics.items()}
    (found,) = latencies(recording(**made))
    assert (found.count, found.median_ms, found.max_ms) == (count, pytest.approx(median_ms), pytest.approx(longest_ms))
    assert found.kind == ("reaction" if "tracking_status" in topics else "transit")


def test_stamps_rounded_to_a_microsecond_are_the_same_stamp() -> None:
    clock = topic("clock", [0, 20, 40], log_ms=[0.0, 2.0, 4.0])
    joints = topic("joint_states", [0, 20, 40], log_ms=[0.5, 2.5, 4.5])
    assert joints.stamp_ns is not None
    joints.stamp_ns[:] -= 900
    (found,) = latencies(recording(clock=clock, joint_states=joints))
    assert (found.count, found.median_ms) == (3, pytest.approx(0.5))


def test_hop_without_links_is_a_row_of_nulls() -> None:
    clock, joints = topic("clock", [1_000]), topic("joint_states", [0])
    (found,) = latencies(recording(clock=clock, joint_states=joints))
    assert (found.count, found.median_ms, found.p99_ms) == (0, None, None)
