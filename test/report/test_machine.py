"""Axis rates and accelerations beside their limits, and the link."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rf_pointing.report.analysis import analyse
from rf_pointing.report.definitions import Definitions
from rf_pointing.report.machine import axis_motion, servo
from rf_pointing.report.recording import Recording, read_recording
from rf_pointing.report.statistics import summarize

AMPLITUDE_DEG, RATE_RAD_S = 5.0, 0.2


@pytest.fixture(scope="module")
def swinging(tmp_path_factory: pytest.TempPathFactory, synthetic_run: type[Any], types: Definitions) -> Recording:
    """An azimuth axis that swings like a pendulum while the link fades slowly."""
    path = tmp_path_factory.mktemp("swinging") / "bag"
    run = synthetic_run(
        azel_deg=lambda t: (AMPLITUDE_DEG * math.sin(RATE_RAD_S * t), 45.0),
        carrier_to_noise=lambda t: 60.0 - 0.1 * t,
        mode=lambda t: "monopulse" if t < 50.0 - 1e-9 else "idle",
    )
    run.write(path, types)
    return read_recording(path)


def test_peaks_of_a_swinging_axis(swinging: Recording) -> None:
    azimuth, elevation = servo(swinging).axes
    assert azimuth.peak_rate_deg_s == pytest.approx(AMPLITUDE_DEG * RATE_RAD_S, rel=1e-4)
    # The mean over half a second of a sine falls short of its peak by (0.2 * 0.25)^2 / 6 = 4e-4.
    assert azimuth.peak_acceleration_deg_s2 == pytest.approx(AMPLITUDE_DEG * RATE_RAD_S**2, rel=1e-3)
    assert elevation.peak_rate_deg_s == pytest.approx(0.0, abs=1e-9)
    assert azimuth.rate_limit_deg_s == pytest.approx(math.degrees(0.0175))
    assert azimuth.acceleration_limit_deg_s2 == pytest.approx(math.degrees(0.0087))
    assert azimuth.at_limit_s == 0.0


def test_acceleration_is_stamped_at_the_middle_of_its_span(swinging: Recording) -> None:
    motion = axis_motion(swinging)
    assert motion is not None
    t = (motion.acceleration_stamp_ns - motion.stamp_ns[0]) * 1e-9
    expected = -math.radians(AMPLITUDE_DEG) * RATE_RAD_S**2 * np.sin(RATE_RAD_S * t)
    assert np.allclose(motion.acceleration_rad_s2[:, 0], expected, rtol=0.0, atol=2e-6)


def test_link_is_told_after_acquisition_while_tracking(swinging: Recording) -> None:
    link = summarize(analyse(swinging)).link
    assert (link.source, link.over) == ("monopulse", "after acquisition")
    assert link.carrier_to_noise_min_db_hz == pytest.approx(60.0 - 0.1 * 49.9)
    assert link.carrier_to_noise_median_db_hz == pytest.approx(60.0 - 0.1 * (10.0 + 49.9) / 2.0)


def test_even_ticks_do_not_deviate(swinging: Recording) -> None:
    assert servo(swinging).period_deviation_p99_ms == pytest.approx(0.0, abs=1e-9)


def test_lateness_and_uneven_periods_are_told_in_milliseconds(
    tmp_path: Path, types: Definitions, synthetic_run: type[Any]
) -> None:
    synthetic_run(seconds=2.0).write(tmp_path / "bag", types)
    recording = read_recording(tmp_path / "bag")
    antenna, joints = recording.topics["antenna_status"], recording.topics["joint_states"]
    antenna.columns["tick_lateness"] = np.full(len(antenna), 0.001)
    antenna.columns["tick_lateness"][-1] = 0.0042
    # A reading that is late ends a period that is too long and begins one that is too short; an early one the other way.
    period_ns = int(joints.log_time_ns[1] - joints.log_time_ns[0])
    joints.log_time_ns[10] += period_ns // 4
    joints.log_time_ns[20] -= period_ns // 2
    told = servo(recording)
    assert told.tick_lateness_max_ms == pytest.approx(4.2)
    deviation_ms = np.zeros(len(joints) - 1)
    deviation_ms[[9, 10]], deviation_ms[[19, 20]] = period_ns / 4e6, period_ns / 2e6
    assert told.period_deviation_p99_ms == pytest.approx(np.percentile(deviation_ms, 99.0), rel=1e-3)
    assert told.period_deviation_p99_ms > period_ns / 4e6


def test_the_peak_of_an_axis_that_only_turns_back_is_its_speed(
    tmp_path: Path, types: Definitions, synthetic_run: type[Any]
) -> None:
    synthetic_run(seconds=2.0, azel_deg=lambda t: (100.0 - 1.5 * t, 45.0 + 0.2 * t)).write(tmp_path / "bag", types)
    azimuth, elevation = servo(read_recording(tmp_path / "bag")).axes
    assert azimuth.peak_rate_deg_s == pytest.approx(1.5, rel=1e-6)
    assert elevation.peak_rate_deg_s == pytest.approx(0.2, rel=1e-6)


def test_fault_is_listed_once(tmp_path: Path, types: Definitions, synthetic_run: type[Any]) -> None:
    synthetic_run(seconds=2.0).write(tmp_path / "bag", types)
    recording = read_recording(tmp_path / "bag")
    fault = recording.topics["antenna_status"].columns["fault"].astype("<U20")
    fault[5:10] = "commands ran dry"
    recording.topics["antenna_status"].columns["fault"] = fault
    assert servo(recording).faults == ["commands ran dry"]
