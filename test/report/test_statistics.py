"""Statistics of a run with planted errors, modes, losses and latencies have their closed-form values.

Axis rates and accelerations beside their limits, and the link.
"""

import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rf_pointing.report.analysis import analyse, timeline, tracked_pass
from rf_pointing.report.definitions import Definitions
from rf_pointing.report.recording import Recording, read_recording
from rf_pointing.report.statistics import AxisMotion, servo, summarize
from rf_pointing.report.summary import ErrorStatistics, Summary, to_json
from rf_pointing.report.topics import TopicData

EXACT = 1e-9
"""Relative: angles pass through radians in 64-bit floats."""
DB_AT_ONE_BEAMWIDTH = 40.0 * math.log10(2.0)
MODES = [(5, "idle"), (10, "slew"), (20, "program_track"), (50, "monopulse"), (52, "coast"), (58, "monopulse")]


def planned_mode(t: float) -> str:
    return next((mode for end, mode in MODES if t < end - 1e-9), "idle")


def planned_error_mdeg(t: float) -> tuple[float, float]:
    """Program track misses by (40, -30), the loop pulls in within 2 s and then leaves (1.5, 0.5) of changing sign."""
    sign = 1.0 if round(50 * t) % 2 else -1.0
    if t < 20.0 - 1e-9:
        return (40.0, -30.0)
    return (20.0, 0.0) if t < 22.0 - 1e-9 else (1.5 * sign, 0.5 * sign)


def planned_offset_mdeg(t: float) -> tuple[float, float]:
    return (0.0, 0.0) if t < 20.0 - 1e-9 else (40.0, -30.0)


UNUSED = {"clock", "joint_states", "sim/boresight", "carrier_power", "antenna_status", "joint_trajectory", "target"}
"""Topics that the statistics of errors do not need; left out where a test plans its own run, for speed."""


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory, synthetic_run: type[Any], types: Definitions) -> Callable[..., Any]:
    def make(**changes: Any) -> Recording:
        path = tmp_path_factory.mktemp("run") / "bag"
        plan = {"mode": planned_mode, "error_mdeg": planned_error_mdeg, "offset_mdeg": planned_offset_mdeg}
        plan["left_out"] = UNUSED
        synthetic_run(**{**plan, **changes}).write(path, types)
        return read_recording(path)

    return make


@pytest.fixture(scope="module")
def recording(run: Callable[..., Recording]) -> Recording:
    dropped = {
        "target": {10, 11, 40}, "pointing_error": {299}, "joint_states": {100, 101, 500},
        "tracking_status": {333},
    }  # fmt: skip
    return run(left_out=set(), dropped=dropped, lateness_s=lambda t: 0.02 if round(10 * t) % 100 == 7 else 0.001)


@pytest.fixture(scope="module")
def summary(recording: Recording) -> Summary:
    return summarize(analyse(recording))


def mode_row(summary: Summary, mode: str) -> Any:
    return next(row for row in summary.modes if row.mode == mode)


def rms(statistics: ErrorStatistics) -> tuple[float | None, float | None, float | None]:
    parts = (statistics.cross_elevation, statistics.elevation, statistics.radial)
    return tuple(part.rms_mdeg for part in parts)  # type: ignore[return-value]


def test_seconds_and_visits_of_every_mode(summary: Summary) -> None:
    expected = {
        "idle": (7.0, 2), "slew": (5.0, 1), "program_track": (10.0, 1), "monopulse": (36.0, 2),
        "coast": (2.0, 1),
    }  # fmt: skip
    assert {row.mode: (pytest.approx(row.seconds), row.entered) for row in summary.modes} == expected
    assert [(item.mode, pytest.approx(item.start_s)) for item in summary.timeline] == [
        ("idle", 0.0), ("slew", 5.0), ("program_track", 10.0), ("monopulse", 20.0), ("coast", 50.0),
        ("monopulse", 52.0), ("idle", 58.0),
    ]  # fmt: skip
    assert summary.timeline[3].reason == "now monopulse"


def test_constant_error_is_its_own_rms_p95_and_maximum(summary: Summary) -> None:
    error = mode_row(summary, "program_track").error
    assert error.samples == 500
    for part, value in ((error.cross_elevation, 40.0), (error.elevation, 30.0), (error.radial, 50.0)):
        assert (part.rms_mdeg, part.p95_mdeg, part.max_mdeg) == pytest.approx((value, value, value), rel=EXACT)
    assert error.mean_loss_db == pytest.approx(DB_AT_ONE_BEAMWIDTH * (50.0 / 65.0) ** 2, rel=EXACT)
    assert error.inside_half_power_percent == 0.0


def test_rms_of_a_mode_includes_its_pull_in(summary: Summary) -> None:
    error = mode_row(summary, "monopulse").error
    assert error.samples == 1_800
    assert error.cross_elevation.rms_mdeg == pytest.approx(
        math.sqrt((100 * 20.0**2 + 1_700 * 1.5**2) / 1_800), rel=EXACT
    )
    assert error.cross_elevation.max_mdeg == pytest.approx(20.0, rel=EXACT)
    assert error.max_loss_db == pytest.approx(DB_AT_ONE_BEAMWIDTH * (20.0 / 65.0) ** 2, rel=EXACT)


def test_headline_is_over_the_samples_after_acquisition(summary: Summary) -> None:
    headline = summary.headline
    assert (headline.error_source, headline.over) == ("true", "after acquisition")
    assert headline.error is not None
    assert headline.error.samples == 36 * 50
    assert headline.seconds == pytest.approx(36.0)
    assert headline.beamwidth_mdeg == pytest.approx(65.0)
    assert rms(headline.error) == pytest.approx((1.5, 0.5, math.sqrt(2.5)), rel=EXACT)
    loss_db = DB_AT_ONE_BEAMWIDTH * 2.5 / 65.0**2
    assert (headline.error.mean_loss_db, headline.error.max_loss_db) == pytest.approx((loss_db, loss_db), rel=EXACT)
    assert headline.error.inside_half_power_percent == 100.0


def test_program_track_alone_is_the_error_plus_the_offset(summary: Summary) -> None:
    alone = summary.headline.program_track_alone
    assert alone is not None
    assert alone.cross_elevation.rms_mdeg == pytest.approx(math.hypot(40.0, 1.5), rel=EXACT)
    assert alone.elevation.rms_mdeg == pytest.approx(math.hypot(30.0, 0.5), rel=EXACT)
    assert alone.inside_half_power_percent == 0.0
    assert mode_row(summary, "idle").program_track_alone is None

    # No loss where the beam is not meant to be on the target.
    assert mode_row(summary, "slew").error.mean_loss_db is None
    assert mode_row(summary, "coast").error.mean_loss_db is not None


def test_acquisition_is_counted_from_aos_to_the_first_valid_error(
    summary: Summary, run: Callable[..., Recording]
) -> None:
    found, late = summary.acquisition, summarize(analyse(run(sensed=lambda t: t > 23.95))).acquisition
    assert (found.measured_from, found.settled_below_mdeg) == ("acquisition of signal", pytest.approx(6.5))
    assert (found.first_valid_s, found.settled_s) == (pytest.approx(0.0, abs=1e-9), pytest.approx(12.0))
    assert (late.first_valid_s, late.settled_s) == (pytest.approx(14.0), pytest.approx(14.0))


def test_settled_needs_five_small_errors_in_a_row_from_a_sensor_in_the_loop(run: Callable[..., Recording]) -> None:
    def flickering(t: float) -> tuple[float, float]:
        return (7.0, 0.0) if 22.4 - 1e-9 <= t < 22.45 else planned_error_mdeg(t)

    summary = summarize(analyse(run(error_mdeg=flickering)))
    assert summary.acquisition.settled_s == pytest.approx(12.5)


def test_losses_are_counted_by_sequence_or_by_gaps(summary: Summary) -> None:
    rows = {row.topic.removeprefix("/gs1/"): row for row in summary.topics}
    lost = {name: row.lost for name, row in rows.items() if row.lost}
    assert lost == {"target": 3, "pointing_error": 1, "joint_states": 3, "tracking_status": 1}
    assert summary.headline.messages_lost == 8
    assert rows["target"].counted_by == "sequence numbers"
    assert rows["joint_states"].counted_by == "stamp gaps"
    assert rows["joint_states"].longest_gap_s == pytest.approx(0.06)
    assert (rows["clock"].rate_hz, rows["target"].rate_hz) == pytest.approx((50.0, 10.0))
    assert rows["clock"].wall_rate_hz == pytest.approx(500.0)
    assert rows["joint_states"].count == 2_997


def test_latencies_are_the_planted_ones(summary: Summary) -> None:
    rows = {(row.cause, row.effect): row for row in summary.latency}
    planted = {
        ("clock", "joint_states"): 0.4, ("joint_states", "sim/boresight"): 0.2,
        ("sim/boresight", "sim/pointing_error"): 0.3, ("sim/boresight", "monopulse"): 1.0,
        ("sim/boresight", "carrier_power"): 1.2, ("monopulse", "pointing_error"): 1.5,
        ("pointing_error", "tracking_status"): 1.0, ("pointing_error", "joint_trajectory"): 1.5,
    }  # fmt: skip
    assert {key: row.median_ms for key, row in rows.items()} == pytest.approx(planted)
    assert rows["monopulse", "pointing_error"].count == 599
    assert rows["sim/boresight", "monopulse"].p99_ms == pytest.approx(1.0)


def test_lateness_leads_speed_and_pass_are_the_planted_ones_without_a_problem(summary: Summary) -> None:
    assert summary.servo.tick_lateness_max_ms == pytest.approx(20.0)
    assert summary.servo.tick_lateness_p99_ms == pytest.approx(1.19)
    assert (summary.commands.lead_min_s, summary.commands.lead_median_s) == pytest.approx((0.8, 0.8))
    assert summary.commands.servo_lead_min_s == pytest.approx(0.7)
    assert (summary.commands.rejected, summary.commands.last_rejection) == (1, "stale stamp")
    assert summary.bag.speed == pytest.approx(10.0, rel=1e-3)
    assert summary.bag.start_utc == "2023-11-14T22:13:20.000Z"
    assert summary.target_pass is not None
    assert summary.target_pass.aos_utc == "2023-11-14T22:13:30.000Z"
    assert summary.target_pass.peak_elevation_deg == pytest.approx(math.degrees(0.9))
    assert summary.problems == []


def test_without_truth_the_sensed_error_is_used_and_said(run: Callable[..., Recording]) -> None:
    summary = summarize(analyse(run(truth=False)))
    assert summary.headline.error_source == "sensed"
    assert summary.headline.error is not None
    assert summary.headline.error.samples == 360
    # Sensed at 10 Hz: the sign changes with every measurement as it does at 50 Hz.
    assert rms(summary.headline.error) == pytest.approx((1.5, 0.5, math.sqrt(2.5)), rel=EXACT)
    assert any("not the true ones" in text for text in summary.problems)


def test_without_status_the_errors_are_told_without_modes(run: Callable[..., Recording]) -> None:
    summary = summarize(analyse(run(left_out={*UNUSED, "tracking_status"})))
    assert summary.modes == []
    assert summary.outcome.tracked is None
    assert any("no tracking_status" in text for text in summary.problems)


def test_every_missing_topic_leaves_a_table(run: Callable[..., Recording]) -> None:
    names = {"joint_states", "antenna_status", "monopulse", "carrier_power", "pointing_error", "passes", "clock"}
    summary = summarize(analyse(run(left_out=names, truth=False, seconds=5.0)))
    assert summary.headline.error_source is None
    assert summary.servo.tick_lateness_p99_ms is None
    assert summary.link.source == "tracking_status"
    assert {text.split(":")[0] for text in summary.problems} >= {"no joint_states", "no antenna_status"}
    json.loads(to_json(summary))


def test_a_beam_that_slips_out_once_is_seen_in_the_share(run: Callable[..., Recording]) -> None:
    def slipping(t: float) -> tuple[float, float]:
        return (33.0, 0.0) if 40.0 <= t < 40.01 else planned_error_mdeg(t)

    summary = summarize(analyse(run(error_mdeg=slipping)))
    assert summary.headline.error is not None
    assert summary.headline.error.inside_half_power_percent == pytest.approx(100.0 * 1_799 / 1_800)


def test_errors_that_are_not_numbers_survive_reading_and_are_left_out_of_sums(run: Callable[..., Recording]) -> None:
    def broken(t: float) -> tuple[float, float]:
        return (math.nan, 0.0) if 30.0 <= t < 30.1 - 1e-9 else planned_error_mdeg(t)

    recording = run(error_mdeg=broken)
    assert sum(math.isnan(value) for value in recording.topics["sim/pointing_error"]["cross_elevation"]) == 5
    summary = summarize(analyse(recording))
    assert "5 errors are not finite numbers and were left out" in summary.problems
    assert summary.headline.error is not None
    assert rms(summary.headline.error) == pytest.approx((1.5, 0.5, math.sqrt(2.5)), rel=EXACT)
    assert "NaN" not in to_json(summary)


def test_pass_that_overlaps_the_tracking_is_chosen(recording: Recording) -> None:
    found = tracked_pass(recording, timeline(recording))
    assert found == recording.passes[0]
    assert tracked_pass(recording, None) is None


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


@pytest.mark.parametrize(("period_s", "span"), [(0.02, 25), (0.026, 19), (0.1, 5), (0.34, 1), (3.0, 1)])
def test_acceleration_is_the_change_of_rate_over_the_whole_periods_nearest_to_half_a_second(
    period_s: float, span: int
) -> None:
    stamps = 7 * 10**9 + np.arange(100) * round(period_s * 1e9)
    rate = np.where(np.arange(100)[:, None] >= 60, [0.3, -0.1], [0.1, 0.1])
    motion = AxisMotion(TopicData("/gs1/joint_states", "", stamps, stamps, None, {"velocity": rate}))
    assert len(motion.acceleration_rad_s2) == 100 - span
    expected = np.zeros((100 - span, 2))
    expected[60 - span : 60] = np.array([0.2, -0.2]) / (span * period_s)
    np.testing.assert_allclose(motion.acceleration_rad_s2, expected, rtol=1e-12)
    np.testing.assert_array_equal(motion.acceleration_stamp_ns, (stamps[span:] + stamps[:-span]) // 2)


def test_link_is_told_after_acquisition_while_tracking(swinging: Recording) -> None:
    link = summarize(analyse(swinging)).link
    assert (link.source, link.over) == ("monopulse", "after acquisition")
    assert link.carrier_to_noise_min_db_hz == pytest.approx(60.0 - 0.1 * 49.9)
    assert link.carrier_to_noise_median_db_hz == pytest.approx(60.0 - 0.1 * (10.0 + 49.9) / 2.0)


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


def test_relays_are_counted_over_the_pass_without_the_park_after_it_and_a_fault_once(
    tmp_path: Path, types: Definitions, synthetic_run: type[Any]
) -> None:
    synthetic_run(seconds=4.0).write(tmp_path / "bag", types)
    recording = read_recording(tmp_path / "bag")
    columns = recording.topics["antenna_status"].columns
    count = len(columns["fault"])
    columns["fault"] = np.where(np.arange(count) // 5 == 1, "commands ran dry", "")
    assert count >= 6
    sent = np.arange(count)
    # The last two rows are those of a park, which counts anew.
    sent[-2:] = [0, 1]
    columns["set_points"] = sent * 10
    columns["starts"] = np.column_stack([sent * 4, sent * 3])
    columns["reversals"] = np.column_stack([sent * 0 + 1, sent * 0 + 2])
    counts, last = servo(recording), count - 3
    assert (counts.set_points, counts.starts, counts.reversals) == (10 * last, [4 * last, 3 * last], [1, 2])
    assert counts.faults == ["commands ran dry"], "each once"
