"""The monopulse tracker of a station: the calibration scan is learned, kept, read back, and refused when it teaches nothing."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from rf_pointing.core import MDEG, JointReading, MonopulseCluster, random_stream
from rf_pointing.rf import Beam, BeamParams, MonopulseFeed, MonopulseFeedParams, Receiver, ReceiverParams
from rf_pointing.tracking import MonopulseParams, MonopulseScanParams
from rf_pointing.tracking.cluster_tracker import ClusterTracker, read_calibration, write_calibration
from rf_pointing.tracking.monopulse import MonopulseCalibration

BEAM = BeamParams()
H = BEAM.half_power_beamwidth_rad
FEED = MonopulseFeedParams(difference_phase_rad=(0.7, -0.4), cross_talk=(0.1, 0.05), difference_gain_db=(-1.0, 0.5))
NULL_MDEG = 1.0
"""The null is found against the power's peak, and the receiver's noise estimate moves the level by some per cent."""
CENTRE = np.array([1.0, 0.8])
TARGET = np.array([1.0, -0.5]) * MDEG
"""Near the axis: the power of a four-beam sum is not quite Gaussian, which shifts the null by a fifth of this."""


def scan(tracker: ClusterTracker, radius_rad: float, seconds: float = 24.0) -> None:
    """Run the circle as the controller does, with a receiver at 55 dB-Hz."""
    receiver = Receiver(ReceiverParams(), Beam(BEAM), MonopulseFeed(FEED, BEAM), random_stream(3, "receiver"))
    for k in range(-300, 0):  # the noise estimate, and with it the measured level, settles in its 10 s
        receiver.cluster(0.1 * k + 0.02 * np.arange(-4, 1), np.zeros(5), np.zeros(5), 55.0, 0.02)
    for k in range(1, round(seconds * 10.0)):
        t_s = 0.1 * k
        tracker.take_status(t_s, CENTRE, np.zeros(2), "calibrate")
        away = radius_rad * np.array([math.cos(0.3 * t_s), math.sin(0.3 * t_s)])
        joints = CENTRE + away / np.array([math.cos(CENTRE[1] + away[1]), 1.0])
        tracker.take_joints(JointReading(t_s=t_s, position_rad=joints, velocity_rad_s=np.zeros(2)))
        times = t_s + 0.02 * np.arange(-4, 1)
        angle = 0.3 * times
        x, y = TARGET[0] - radius_rad * np.cos(angle), TARGET[1] - radius_rad * np.sin(angle)
        tracker.take_cluster(receiver.cluster(times, x, y, 55.0, 0.02))
    tracker.take_status(seconds, CENTRE, np.zeros(2), "coast")


def errors_mdeg(tracker: ClusterTracker) -> np.ndarray:
    receiver = Receiver(ReceiverParams(), Beam(BEAM), MonopulseFeed(FEED, BEAM), random_stream(4, "receiver"))
    times = 100.0 + 0.02 * np.arange(5)
    found = tracker.take_cluster(receiver.cluster(times, np.full(5, 8 * MDEG), np.full(5, -5 * MDEG), 60.0, 0.02))
    return np.array([found.cross_elevation_rad, found.elevation_rad]) / MDEG


def test_a_scan_teaches_phases_gains_and_cross_talk_and_the_next_run_reads_them(tmp_path: Path) -> None:
    kept = tmp_path / "feed" / "calibration.yaml"
    tracker = ClusterTracker(MonopulseParams(), MonopulseScanParams(), str(kept))
    before = errors_mdeg(tracker)
    scan(tracker, 0.25 * H)
    assert not tracker.outcome.refused, tracker.outcome.message
    np.testing.assert_allclose(errors_mdeg(tracker), [8.0, -5.0], atol=NULL_MDEG)
    assert np.max(np.abs(before - [8.0, -5.0])) > 1.0
    again = ClusterTracker(MonopulseParams(), MonopulseScanParams(), str(kept))
    np.testing.assert_allclose(errors_mdeg(again), [8.0, -5.0], atol=NULL_MDEG)


def test_a_scan_without_motion_is_refused_with_its_reason_and_changes_nothing(tmp_path: Path) -> None:
    kept = tmp_path / "calibration.yaml"
    tracker = ClusterTracker(MonopulseParams(), MonopulseScanParams(), str(kept))
    before = tracker.tracker.calibration
    scan(tracker, 0.0, 3.0)
    assert tracker.outcome.refused
    assert "distinct beam positions" in tracker.outcome.message
    assert tracker.tracker.calibration == before
    assert not kept.exists()


def test_a_file_that_does_not_separate_the_channels_is_refused_by_name(tmp_path: Path) -> None:
    path = tmp_path / "calibration.yaml"
    write_calibration(path, MonopulseCalibration.ideal(H, 1.57))
    assert read_calibration(path) == MonopulseCalibration.ideal(H, 1.57)
    keys = [line.split(":")[0] for line in path.read_text().splitlines() if line[0].isalpha()]
    assert keys == ["format", "response_real", "response_imaginary", "offset_real", "offset_imaginary"]
    same = path.read_text().replace("response_real:", "response_real: [1.0, 1.0, 1.0, 1.0]\nwas:")
    path.write_text(same)
    with pytest.raises(ValueError, match=r"calibration\.yaml: .*does not separate cross-elevation from elevation"):
        read_calibration(path)
    path.write_text("format: other")
    with pytest.raises(ValueError, match="format must be"):
        read_calibration(path)


def test_bad_clusters_are_counted_with_their_reason() -> None:
    tracker = ClusterTracker(MonopulseParams(), MonopulseScanParams(), "")
    good = np.ones(5, dtype=complex)
    cluster = MonopulseCluster(
        t_s=0.02 * np.arange(5), sum=good, difference_cross_elevation=0.1 * good, difference_elevation=0.1 * good,
        carrier_to_noise_db_hz=50.0,
    )  # fmt: skip
    assert not tracker.take_cluster(replace(cluster, sum=0.0 * good)).valid
    assert tracker.last_reason == "sum is zero in every sample"
    assert tracker.take_cluster(cluster).valid
    assert (tracker.last_reason, tracker.counts) == ("", {"valid": 1, "invalid": 1})


def test_parameters_that_are_retuned_keep_a_calibration_that_was_learned_or_read(tmp_path: Path) -> None:
    mixed = MonopulseCalibration.ideal(H, 1.2)
    path = tmp_path / "feed.yaml"
    write_calibration(path, mixed)
    kept = ClusterTracker(MonopulseParams(), MonopulseScanParams(), str(path))
    plain = ClusterTracker(MonopulseParams(), MonopulseScanParams(), "")
    assert (kept.outcome.message, plain.outcome.message) == (f"read from {path}", "ideal feed")
    for tracker in (kept, plain):
        tracker.retune(MonopulseParams(slope=1.4))
    assert kept.tracker.calibration == mixed
    assert plain.tracker.calibration == MonopulseCalibration.ideal(H, 1.4)
    assert kept.tracker.params.slope == plain.tracker.params.slope == 1.4
