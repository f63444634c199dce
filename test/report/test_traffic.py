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
    name: str,
    stamp_ms: list[int],
    *,
    log_ms: list[float] | None = None,
    sequence: list[int] | None = None,
    sensor: list[str] | None = None,
) -> TopicData:
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
        path=Path("bag"),
        namespace="/gs1",
        topics={name.replace("__", "/"): data for name, data in topics.items()},
        passes=(),
        warnings=(),
        others={},
        notes={},
        not_recorded=not_recorded,
        problems=(),
    )


def row(**topics: TopicData) -> TopicTraffic:
    return topic_traffic(recording(**topics))[0]


def test_missing_numbers_are_losses_and_a_fall_is_a_restart() -> None:
    stamps = list(range(0, 800, 100))
    found = row(target=topic("target", stamps, sequence=[5, 6, 9, 10, 0, 1, 3, 4]))
    assert (found.lost, found.restarts, found.counted_by) == (3, 1, "sequence numbers")


def test_counter_that_falls_by_one_or_stands_still_is_a_restart() -> None:
    found = row(target=topic("target", list(range(0, 600, 100)), sequence=[0, 1, 0, 0, 1, 2]))
    assert (found.lost, found.restarts) == (0, 2)


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


def test_order_of_reception_does_not_matter_for_gaps() -> None:
    found = row(joint_states=topic("joint_states", [0, 40, 20, 60, 80]))
    assert found.lost == 0


def test_latched_topics_have_no_rate() -> None:
    found = row(passes=topic("passes", [0, 10_000], sequence=[0, 1]))
    assert (found.rate_hz, found.wall_rate_hz, found.lost) == (None, None, 0)


def test_single_message_has_no_rate() -> None:
    found = row(joint_states=topic("joint_states", [0]))
    assert (found.count, found.rate_hz, found.lost, found.longest_gap_s) == (1, None, None, None)


def test_what_the_recorder_lost_is_told_per_topic() -> None:
    data = recording(TopicLoss("/gs1/target", 7, 0), target=topic("target", [0, 100], sequence=[0, 1]))
    assert topic_traffic(data)[0].not_recorded == 7


def test_effect_is_linked_to_the_same_stamp_only() -> None:
    clock = topic("clock", [0, 20, 40, 60], log_ms=[0.0, 2.0, 4.0, 6.0])
    joints = topic("joint_states", [20, 50], log_ms=[2.5, 5.75])
    (found,) = latencies(recording(clock=clock, joint_states=joints))
    assert (found.count, found.max_ms) == (1, pytest.approx(0.5))


def test_where_no_stamps_are_the_same_the_last_received_before_counts() -> None:
    clock = topic("clock", [0, 20, 40, 60], log_ms=[0.0, 2.0, 4.0, 6.0])
    joints = topic("joint_states", [25, 50], log_ms=[2.5, 5.75])
    (found,) = latencies(recording(clock=clock, joint_states=joints))
    assert (found.count, found.median_ms, found.max_ms) == (2, pytest.approx(1.125), pytest.approx(1.75))


def test_error_stamped_at_the_middle_of_its_cluster_is_linked_to_that_cluster() -> None:
    samples = topic("monopulse", [100, 200, 300], log_ms=[10.0, 20.0, 30.0])
    errors = topic("pointing_error", [60, 160, 260], log_ms=[11.0, 21.0, 31.0], sensor=["monopulse"] * 3)
    (found,) = latencies(recording(monopulse=samples, pointing_error=errors))
    assert (found.count, found.median_ms, found.max_ms) == (3, pytest.approx(1.0), pytest.approx(1.0))


def test_effect_without_a_recent_cause_is_not_linked() -> None:
    clock = topic("clock", [0, 20, 40], log_ms=[0.0, 2.0, 4.0])
    joints = topic("joint_states", [45, 100], log_ms=[4.5, 50.0])
    (found,) = latencies(recording(clock=clock, joint_states=joints))
    assert (found.count, found.max_ms) == (1, pytest.approx(0.5))


def test_effect_whose_cause_was_lost_is_not_linked_to_the_one_before() -> None:
    samples = topic("monopulse", [0, 100, 300, 400], log_ms=[0.0, 10.0, 30.0, 40.0])
    errors = topic("pointing_error", [0, 100, 200, 300], log_ms=[1.0, 11.0, 21.0, 31.0], sensor=["monopulse"] * 4)
    (found,) = latencies(recording(monopulse=samples, pointing_error=errors))
    assert (found.count, found.max_ms) == (3, pytest.approx(1.0))


def test_stamps_rounded_to_a_microsecond_are_the_same_stamp() -> None:
    clock = topic("clock", [0, 20, 40], log_ms=[0.0, 2.0, 4.0])
    joints = topic("joint_states", [0, 20, 40], log_ms=[0.5, 2.5, 4.5])
    assert joints.stamp_ns is not None
    joints.stamp_ns[:] -= 900
    (found,) = latencies(recording(clock=clock, joint_states=joints))
    assert (found.count, found.median_ms) == (3, pytest.approx(0.5))


def test_only_the_errors_of_the_monopulse_come_from_its_samples() -> None:
    samples = topic("monopulse", [0, 100, 200], log_ms=[0.0, 10.0, 20.0])
    errors = topic(
        "pointing_error", [0, 100, 150], log_ms=[1.0, 11.0, 99.0], sensor=["monopulse", "monopulse", "conscan"]
    )
    (found,) = latencies(recording(monopulse=samples, pointing_error=errors))
    assert (found.count, found.max_ms) == (2, pytest.approx(1.0))


def test_reaction_is_the_first_message_out_and_pauses_are_left_out() -> None:
    errors = topic("pointing_error", [0, 100, 200, 300], log_ms=[0.0, 10.0, 20.0, 31.0], sensor=["monopulse"] * 4)
    status = topic("tracking_status", [0, 100, 200], log_ms=[1.0, 12.0, 23.0])
    (found,) = latencies(recording(pointing_error=errors, tracking_status=status))
    assert (found.kind, found.count, found.median_ms) == ("reaction", 3, pytest.approx(2.0))


def test_hop_without_links_is_a_row_of_nulls() -> None:
    clock, joints = topic("clock", [1_000]), topic("joint_states", [0])
    (found,) = latencies(recording(clock=clock, joint_states=joints))
    assert (found.count, found.median_ms, found.p99_ms) == (0, None, None)
