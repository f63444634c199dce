"""Patterns of scans: they go where they should, within their rates, and end on the target."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rf_pointing.tracking.scan_program import CURVES, PATTERNS, POINTS, ScanProgram, ScanProgramParams

WIDTH, RATE, MOVE, ACCELERATION = 0.03, 0.004, 0.02, 0.02
STEP_S = 0.02


def program(pattern: str, **changes: float) -> ScanProgram:
    frame = "right_ascension" if pattern == "drift" else "cross_elevation"
    given_values = {
        "half_width_rad": WIDTH, "rate_rad_s": RATE, "move_rate_rad_s": MOVE, "acceleration_rad_s2": ACCELERATION,
    }  # fmt: skip
    return ScanProgram(ScanProgramParams(pattern=pattern, frame=frame, **(given_values | changes)))


def way(one: ScanProgram) -> np.ndarray:
    return np.array([one.offset(t) for t in np.arange(-STEP_S, one.duration_s + 2 * STEP_S, STEP_S)])


@settings(max_examples=40)
@given(
    st.sampled_from(PATTERNS), st.floats(0.2, 3.0), st.floats(0.3, 4.0), st.integers(1, 3), st.sampled_from([0.0, 2.5])
)
def test_rates_belong_to_the_places_and_both_begin_and_end_at_rest_on_the_target(
    pattern: str, wide: float, fast: float, repetitions: int, baseline: float
) -> None:
    one = program(
        pattern, half_width_rad=wide * WIDTH, rate_rad_s=fast * RATE, repetitions=repetitions, dwell_s=1.0,
        baseline_rad=baseline * wide * WIDTH, baseline_s=2.0,
    )  # fmt: skip
    rows = way(one)
    # A trapezoid's corner lies within one step of a difference quotient.
    assert np.abs(np.diff(rows[:, :2], axis=0) / STEP_S - rows[1:, 2:]).max() <= 2.0 * ACCELERATION * STEP_S
    assert np.abs(rows[[0, -1]]).max() < 1e-9
    assert np.hypot(rows[:, 2], rows[:, 3]).max() <= max(MOVE, math.hypot(0.7 * MOVE, fast * RATE)) * (1.0 + 1e-9)
    assert one.demand[1] <= 1.5 * ACCELERATION


@pytest.mark.parametrize("pattern", ["cross", "raster", "drift"])
def test_lines_are_scanned_at_their_rate_from_edge_to_edge(pattern: str) -> None:
    rows = way(program(pattern))
    inside = np.abs(rows[:, :2]).max(axis=1) <= WIDTH
    speed = np.hypot(rows[:, 2], rows[:, 3])
    measured = inside & (np.abs(speed - RATE) < 1e-12)
    for axis in range(1 if pattern == "drift" else 2):
        assert np.ptp(rows[measured, axis]) == pytest.approx(2.0 * WIDTH, abs=2.0 * RATE * STEP_S)


@pytest.mark.parametrize("pattern", POINTS)
def test_the_beam_rests_at_every_point(pattern: str) -> None:
    one = program(pattern, dwell_s=3.0, repetitions=2)
    rows = way(one)
    for point in POINTS[pattern]:
        at_it = np.hypot(*(rows[:, :2] - WIDTH * np.array(point)).T) < 1e-12
        # The first and the last instant of both rests may belong to them.
        assert at_it.sum() * STEP_S == pytest.approx(6.0, abs=6.0 * STEP_S)


@pytest.mark.parametrize("pattern", CURVES)
def test_curves_reach_their_radius_and_keep_to_their_rate(pattern: str) -> None:
    rows = way(program(pattern, repetitions=1))
    largest = math.sqrt(2.0) if pattern == "lissajous" else 1.0
    assert np.hypot(rows[:, 0], rows[:, 1]).max() == pytest.approx(largest * WIDTH, rel=0.08)
    assert np.hypot(rows[:, 2], rows[:, 3]).max() <= max(RATE, 1.9 * WIDTH / 2.0)


def test_a_baseline_on_the_source_and_a_drift_that_moves_the_antenna_are_refused() -> None:
    with pytest.raises(ValueError, match="baseline_rad=0.01000 must be 0 or >= half_width_rad=0.03"):
        program("cross", baseline_rad=0.01)
    with pytest.raises(ValueError, match="a drift is along right_ascension"):
        ScanProgramParams(pattern="drift")
