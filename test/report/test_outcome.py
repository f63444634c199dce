"""The verdict of a recorded pass: as flown, as counted, as predicted; a fault ends it and stands at the head of the page."""

import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rf_pointing.report.analysis import Analysis, ErrorSeries, Timeline, analyse
from rf_pointing.report.definitions import Definitions
from rf_pointing.report.outcome import verdict
from rf_pointing.report.recording import Pass, Recording, read_recording
from rf_pointing.report.statistics import summarize
from rf_pointing.report.summary import Acquisition, Verdict
from rf_pointing.report.topics import TopicData
from rf_pointing.report.write_report import page

LOS_S = 58.0
UNUSED = {"carrier_power", "monopulse", "pointing_error", "target", "clock"}


@pytest.fixture
def run(tmp_path: Path, synthetic_run: type[Any], types: Definitions) -> Callable[..., Recording]:
    """Return a maker of recordings of a pass from 10 to 58 s; 3 s of it 40 mdeg off a beam of 65 mdeg."""

    def make(**changes: Any) -> Recording:
        ended_s = changes.pop("ended_s", LOS_S)
        why = changes.pop("why", "loss of signal")
        settings = {
            "error_mdeg": lambda t: (40.0, 0.0) if 20.0 < t <= 23.0 else (0.0, 0.0),
            "target": lambda t: "28057" if t < ended_s else "",
            "reason": lambda t: "" if t < ended_s else why,
            "mode": lambda t: "monopulse" if t < ended_s else "idle",
            "counted": lambda t: (min(max(t - 10.0, 0.0), ended_s - 10.0) - 2.0, 2.0, 0.25),
            "left_out": UNUSED,
        }
        path = tmp_path / f"bag{len(list(tmp_path.iterdir()))}"
        synthetic_run(**{**settings, **changes}).write(path, types)
        return read_recording(path)

    return make


def outcome(recording: Recording) -> Verdict:
    return summarize(analyse(recording)).outcome


def test_flown_counted_and_predicted_stand_beside_each_other(run: Callable[..., Recording]) -> None:
    found = outcome(run(predicted={"mean_loss": 0.2, "lost": 1.5, "late": 0.5, "acquisition": 1.0}))
    assert (found.tracked, found.reason, found.source, found.faults) == (True, "loss of signal", "true", [])
    assert (found.flown.tracked_s, found.flown.lost_s) == (pytest.approx(45.0), pytest.approx(3.0))
    power = (45.0 + 3.0 * 0.5 ** (4.0 * (40.0 / 65.0) ** 2)) / 48.0
    assert 10.0 ** (-0.1 * found.flown.mean_loss_db) == pytest.approx(power, rel=1e-9)
    assert (found.counted.tracked_s, found.counted.lost_s) == (pytest.approx(46.0, abs=0.1), 2.0)
    assert found.counted.mean_loss_db == pytest.approx(0.25)
    assert (found.predicted.lost_s, found.predicted.mean_loss_db) == (3.0, 0.2)
    assert found.predicted.tracked_s == pytest.approx(45.0), "the certificate was issued before the rise"


def test_the_share_that_the_station_asks_decides(run: Callable[..., Recording]) -> None:
    """The certificate of these recordings asks 75 %; without one it is 80 %."""
    off = {"error_mdeg": lambda t: (40.0, 0.0) if 20.0 < t <= 31.0 else (0.0, 0.0)}
    assert outcome(run(**off, predicted={"mean_loss": 0.2})).tracked
    failed = outcome(run(**off))
    assert not failed.tracked
    assert failed.reason == "77 % of the pass was held, must be >= 80 %"


def test_without_the_truth_the_count_of_the_controller_decides(run: Callable[..., Recording]) -> None:
    found = outcome(run(truth=False))
    assert (found.source, found.tracked, found.flown) == ("counted", True, None)
    old = outcome(run(truth=False, counted=lambda _: (0.0, 0.0, 0.0)))
    assert (old.source, old.tracked, old.counted) == (None, None, None)


def test_a_pass_that_was_cancelled_or_cut_short_is_not_tracked(run: Callable[..., Recording]) -> None:
    cancelled = outcome(run(ended_s=50.0, why="the goal was cancelled"))
    assert (cancelled.tracked, cancelled.reason) == (False, "the goal was cancelled")
    assert cancelled.flown.tracked_s + cancelled.flown.lost_s == pytest.approx(40.0, abs=0.1)
    cut = outcome(run(seconds=40.0, ended_s=100.0))
    assert (cut.tracked, cut.reason) == (False, "the recording ends before the loss of signal")


def test_time_without_samples_is_lost(run: Callable[..., Recording]) -> None:
    gone = {"sim/pointing_error": set(range(30 * 50, 40 * 50))}
    assert outcome(run(dropped=gone)).flown.lost_s == pytest.approx(13.0, abs=0.1)


def test_a_latched_fault_ends_the_pass_and_is_red_at_the_head(run: Callable[..., Recording]) -> None:
    text = "drives cut: oscillation of azimuth"
    recording = run(
        ended_s=50.0, why=f"antenna fault: {text}", fault=lambda t: "" if t < 50.0 else text,
        alarm=lambda t: (0, "") if t < 50.0 else (2, f"antenna fault: {text}"),
    )  # fmt: skip
    summary = summarize(analyse(recording))
    assert (summary.outcome.tracked, summary.outcome.faults) == (False, [text])
    assert summary.outcome.reason == f"antenna fault: {text}"
    html = page(summary, {})
    head = html[: html.index('class="tiles"')]
    assert f'<div class="notice fault"><b>Fault</b><ul><li>{text}</li></ul></div>' in head


def test_a_silent_antenna_is_a_fault_though_it_cannot_tell_it(run: Callable[..., Recording]) -> None:
    text = "joint_states has been silent for 15.1 s"
    found = outcome(run(ended_s=50.0, why=text, alarm=lambda t: (0, "") if t < 50.0 else (2, text)))
    assert (found.tracked, found.reason, found.faults) == (False, text, [text])


def test_an_alarm_that_passes_is_no_fault(run: Callable[..., Recording]) -> None:
    found = outcome(run(alarm=lambda t: (2, "joint_states has been silent for 1.2 s") if 30.0 < t < 32.0 else (0, "")))
    assert (found.tracked, found.faults) == (True, [])


# Analyses by hand: times in s, a beam of 1 mrad, a pass from 10 to 58 s

S = 10**9
BEAM_RAD = 1e-3
Row = tuple[float, str, str, float, float, float]
"""Of the status: stamp, target, reason, seconds tracked and lost, mean loss in dB."""
ROWS: list[Row] = [
    (0.0, "", "", 0.0, 0.0, 0.0), (9.0, "x", "", 0.0, 0.0, 0.0), (57.0, "x", "", 46.0, 0.5, 0.20),
    (58.0, "", "loss of signal", 46.5, 1.5, 0.25), (59.0, "", "idle", 90.0, 9.0, 9.0),
]  # fmt: skip


def topic(stamps_s: Sequence[float], **columns: Any) -> TopicData:
    stamp_ns = np.round(np.array(stamps_s) * S).astype(np.int64)
    return TopicData("", "", stamp_ns, stamp_ns, None, {name: np.array(values) for name, values in columns.items()})


def certificate(*rows: dict[str, Any]) -> TopicData:
    """Return certificates of the pass, issued at 1 s, but for what the rows change."""
    usual = {"stamp": 1.0, "target": "x", "aos": 10.0, "los": 58.0, "accepted": True, "lost": 0.0, "late": 0.0,
             "acquisition": 0.0, "mean_loss": 0.1, "least_share": 0.75}  # fmt: skip
    columns = {name: [{**usual, **row}[name] for row in rows] for name in usual}
    for name in ("aos", "los"):
        columns[name] = [round(value * S) for value in columns[name]]
    return topic(columns.pop("stamp"), **columns)


def judged(
    rows: Sequence[Row] = ROWS, errors_s: Sequence[float] | None = None, *, error_rad: float = 0.0,
    beam_rad: float = BEAM_RAD, source: str = "true", **topics: TopicData,
) -> Verdict:  # fmt: skip
    """Return the verdict of a pass whose error is known at `errors_s`."""
    names = ("target", "reason", "seconds_tracked", "seconds_lost", "mean_loss")
    columns = {name: [row[k] for row in rows] for k, name in enumerate(names, start=1)}
    status = topic([row[0] for row in rows], **columns, level=[0] * len(rows), alarm=[""] * len(rows))
    recording = Recording(Path("bag"), "", {"tracking_status": status, **topics}, (), (), {}, {}, (), ())
    modes = Timeline(np.array([0]), {"beamwidth": np.array([beam_rad])})
    errors = None
    if errors_s is not None:
        n, stamp_ns = len(errors_s), np.round(np.array(errors_s) * S).astype(np.int64)
        error = np.stack([np.full(n, error_rad), np.zeros(n)], axis=-1)
        errors = ErrorSeries(source, stamp_ns, error, error, np.full(n, ""), np.full(n, beam_rad), 0)
    target = Pass("x", 10 * S, 34 * S, 58 * S, 0.9)
    return verdict(Analysis(recording, modes, errors, target, None, Acquisition(measured_from="")))


EVERY_S = np.arange(0.0, 62.0, 1.0)


@pytest.mark.parametrize(
    ("begin_s", "end_s", "tracked_s"), [(0.0, 59.0, 48.0), (9.0, 58.0, 48.0), (15.0, 50.0, 35.0), (15.0, 60.0, 43.0)]
)
def test_the_flight_counts_from_the_rise_or_the_target_to_the_set_or_the_end(
    begin_s: float, end_s: float, tracked_s: float
) -> None:
    rows: list[Row] = [(-1.0, "", "", 0.0, 0.0, 0.0), (begin_s, "x", "", 0.0, 0.0, 0.0), (end_s - 1.0, "x", "", 0.0, 0.0, 0.0),
                       (end_s, "", "loss of signal", 0.0, 0.0, 0.0), (61.0, "", "idle", 0.0, 0.0, 0.0)]  # fmt: skip
    found = judged(rows, EVERY_S)
    assert (found.flown.tracked_s, found.flown.lost_s, found.source) == (tracked_s, 0.0, "true")
    assert found.flown.held_percent == 100.0
    off = judged(rows, EVERY_S, error_rad=BEAM_RAD)
    assert (off.flown.tracked_s, off.flown.lost_s) == (0.0, tracked_s)
    assert off.flown.mean_loss_db == pytest.approx(40.0 * math.log10(2.0), abs=1e-6)


def test_without_a_pass_only_the_faults_are_known() -> None:
    fault = topic([1.0, 2.0, 3.0], fault=["", "drives cut", "drives cut"])
    recording = Recording(Path("bag"), "", {"antenna_status": fault}, (), (), {}, {}, (), ())
    target = Pass("x", 10 * S, 34 * S, 58 * S, 0.9)
    for found in (None, target):
        analysis = Analysis(recording, None, None, found, None, Acquisition(measured_from=""))
        assert verdict(analysis) == Verdict(faults=["drives cut"])
    # One that did not end the pass is no reason against it.
    reset = judged(antenna_status=fault)
    assert (reset.faults, reset.tracked) == (["drives cut"], True)


# The certificate


def predicted(*rows: dict[str, Any]) -> Any:
    return judged(pass_certificate=certificate(*rows)).predicted


def test_a_certificate_predicts_what_is_left_of_the_pass_when_it_is_issued() -> None:
    whole = predicted({"lost": 1.0, "late": 2.0, "acquisition": 1.8})
    assert (whole.tracked_s, whole.lost_s) == (pytest.approx(43.2), pytest.approx(4.8))
    assert (whole.held_percent, whole.mean_loss_db) == (pytest.approx(90.0), 0.1)
    late = predicted({"stamp": 18.0, "lost": 10.0})
    assert (late.tracked_s, late.lost_s, late.held_percent) == (pytest.approx(30.0), 10.0, pytest.approx(75.0))
    none = predicted({"stamp": 18.0, "lost": 90.0})
    assert (none.tracked_s, none.lost_s, none.held_percent) == (0.0, pytest.approx(40.0), 0.0)
