"""Modes, beamwidths and offsets at any time.

The statistics of single sets of errors.
"""

import math
from pathlib import Path

import numpy as np
import pytest

from rf_pointing.core import MDEG
from rf_pointing.report.analysis import Timeline, statistics_of, timeline
from rf_pointing.report.recording import Recording
from rf_pointing.report.topics import TopicData

S = 10**9


def made(stamps_s: list[float], modes: list[str], offsets: list[float] | None = None) -> Timeline:
    n = len(stamps_s)
    columns = {
        "mode": np.array(modes), "reason": np.array([f"because {mode}" for mode in modes]),
        "beamwidth": np.array([0.0, *[1e-3] * (n - 1)]),
        "cross_elevation_offset": np.array(offsets or [0.0] * n), "elevation_offset": np.zeros(n),
    }  # fmt: skip
    stamp_ns = 1_700_000_000 * S + np.round(np.array(stamps_s) * S).astype(np.int64)
    data = TopicData("/gs1/tracking_status", "", stamp_ns, stamp_ns, None, columns)
    recording = Recording(Path("bag"), "/gs1", {"tracking_status": data}, (), (), {}, {}, (), ())
    found = timeline(recording)
    assert found is not None
    return found


def at(*seconds: float) -> np.ndarray:
    return 1_700_000_000 * S + np.round(np.array(seconds) * S).astype(np.int64)


def test_mode_holds_from_its_stamp_to_the_next() -> None:
    modes = made([0.0, 1.0, 2.0], ["idle", "slew", "monopulse"])
    assert list(modes.mode_at(at(-0.1, 0.0, 0.999, 1.0, 5.0))) == ["", "idle", "idle", "slew", "monopulse"]
    assert list(modes.is_tracking_at(at(1.5, 2.5))) == [False, True]


def test_statuses_are_sorted_and_doubles_left_out() -> None:
    modes = made([2.0, 0.0, 1.0, 1.0], ["c", "a", "b", "other"])
    assert list(modes.columns["mode"]) == ["a", "b", "c"]


def test_offset_is_interpolated_to_the_nanosecond() -> None:
    modes = made([0.0, 0.1, 0.2], ["monopulse"] * 3, [0.0, 1.0, 3.0])
    assert modes.offset_rad_at(at(0.05, 0.15))[:, 0] == pytest.approx([0.5, 2.0], rel=1e-12)


def test_unknown_beamwidth_is_no_number() -> None:
    width = made([0.0, 1.0], ["idle", "monopulse"]).beamwidth_rad_at(at(0.5, 1.5))
    assert np.isnan(width[0])
    assert width[1] == 1e-3


def test_intervals_fill_the_recording() -> None:
    spans = made([0.0, 1.0, 2.0, 3.0, 4.0], ["a", "a", "b", "a", "a"]).intervals()
    assert [(span.mode, span.seconds) for span in spans] == [("a", 2.0), ("b", 1.0), ("a", 2.0)]
    assert spans[1].reason == "because b"


def test_recording_without_status_has_no_timeline() -> None:
    assert timeline(Recording(Path("bag"), "", {}, (), (), {}, {}, (), ())) is None


def test_statistics_of_a_known_set() -> None:
    error = np.array([[3.0, 4.0], [-3.0, 4.0], [0.0, 0.0], [6.0, -8.0]]) * MDEG
    found = statistics_of(error, np.full(4, 10.0) * MDEG)
    assert found.cross_elevation.rms_mdeg == pytest.approx(math.sqrt(54.0 / 4.0))
    assert found.elevation.max_mdeg == pytest.approx(8.0)
    assert found.radial.p95_mdeg == pytest.approx(np.percentile([5.0, 5.0, 0.0, 10.0], 95.0))
    # Half a beamwidth off receives half the power, a whole one a sixteenth: the mean of power, not of decibels.
    assert found.mean_loss_db == pytest.approx(-10.0 * math.log10((0.5 + 0.5 + 1.0 + 0.0625) / 4.0))
    assert found.max_loss_db == pytest.approx(40.0 * math.log10(2.0))
    assert found.inside_half_power_percent == pytest.approx(75.0)


def test_no_samples_give_nulls() -> None:
    found = statistics_of(np.zeros((0, 2)), np.zeros(0))
    assert found.samples == 0
    assert (found.radial.rms_mdeg, found.mean_loss_db, found.inside_half_power_percent) == (None, None, None)


def test_unknown_beam_gives_errors_but_no_loss() -> None:
    found = statistics_of(np.ones((3, 2)) * MDEG, np.full(3, np.nan))
    assert found.radial.rms_mdeg == pytest.approx(math.sqrt(2.0))
    assert (found.mean_loss_db, found.inside_half_power_percent) == (None, None)


def test_a_single_status_is_an_interval_without_length() -> None:
    (span,) = made([0.0], ["a"]).intervals()
    assert (span.mode, span.seconds) == ("a", 0.0)


def test_the_offset_of_a_single_status_holds_at_any_time() -> None:
    modes = made([0.0], ["monopulse"], [1.5])
    np.testing.assert_array_equal(modes.offset_rad_at(at(-1.0, 0.0, 7.0)), [[1.5, 0.0]] * 3)
