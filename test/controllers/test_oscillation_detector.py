"""Oscillations are found and named; wind, steps and ramps are not taken for one."""

import math
import re

import numpy as np
import pytest

from rf_pointing.controllers import OscillationDetector, OscillationDetectorParams

DT_S = 0.02
LIMIT = math.radians(0.02)


def watch(errors: np.ndarray, **changes: float) -> OscillationDetector:
    detector = OscillationDetector(OscillationDetectorParams(**changes))
    for error in errors:
        detector.update(float(error), DT_S)
    return detector


@pytest.mark.parametrize("frequency_hz", [0.2, 0.7, 2.12, 5.0])
def test_a_growing_oscillation_is_found_within_four_periods_of_crossing_the_threshold(frequency_hz: float) -> None:
    time = DT_S * np.arange(round(10.0 / frequency_hz / DT_S))
    errors = 1.5 * LIMIT * np.exp(0.05 * frequency_hz * time) * np.sin(2.0 * math.pi * frequency_hz * time)
    detector = OscillationDetector(OscillationDetectorParams())
    seen = [detector.update(float(error), DT_S) for error in errors]
    assert DT_S * np.argmax(seen) < 4.2 / frequency_hz
    assert detector.oscillating


def test_the_reason_names_frequency_and_size() -> None:
    time = DT_S * np.arange(500)
    detector = watch(2.0 * LIMIT * np.sin(2.0 * math.pi * 2.0 * time))
    assert detector.reason.startswith("oscillation of 39.8 mdeg at 2.00 Hz, at most ")


def test_small_oscillation_below_the_threshold_is_left_alone() -> None:
    time = DT_S * np.arange(3000)
    assert not watch(0.9 * LIMIT * np.sin(2.0 * math.pi * 2.0 * time)).oscillating


def test_a_decaying_ring_after_a_step_is_not_an_oscillation() -> None:
    time = DT_S * np.arange(3000)
    ring = 8.0 * LIMIT * np.exp(-0.35 * time) * np.cos(2.0 * math.pi * 0.21 * time)
    assert not watch(ring).oscillating


def test_slow_tracking_error_is_not_an_oscillation() -> None:
    time = DT_S * np.arange(20_000)
    assert not watch(3.0 * LIMIT * np.sin(2.0 * math.pi * 0.005 * time)).oscillating


def test_irregular_gusts_are_not_an_oscillation() -> None:
    random = np.random.default_rng(6)
    gusts = np.zeros(30_000)
    for k in range(1, len(gusts)):
        gusts[k] = 0.99 * gusts[k - 1] + 0.14 * random.standard_normal()
    assert not watch(0.5 * LIMIT * gusts).oscillating


@pytest.mark.parametrize(
    ("lengths_s", "last_peak", "found"),
    [((0.4, 0.4), 1.5, True), ((0.3, 0.6), 1.5, False), ((0.4, 0.4), 1.05, False)],
    ids=["alike", "of two lengths", "dying away"],
)
def test_swings_are_an_oscillation_when_they_are_alike_and_do_not_die_away(
    lengths_s: tuple[float, float], last_peak: float, found: bool
) -> None:
    """Eight swings from 2.4 times the threshold, below the gross one; 0.5 of the first peak is asked of the last."""
    errors: list[float] = []
    for number, share in enumerate(np.geomspace(2.4, last_peak, 8)):
        steps = round(lengths_s[number % 2] / DT_S)
        errors += (share * LIMIT * (-1) ** number * np.sin(math.pi * np.arange(steps) / steps)).tolist()
    assert watch(np.array(errors), half_cycles=7).oscillating is found


def test_the_verdict_latches_until_reset() -> None:
    time = DT_S * np.arange(500)
    detector = watch(2.0 * LIMIT * np.sin(2.0 * math.pi * 2.0 * time))
    detector.update(0.0, DT_S)
    assert detector.oscillating
    detector.reset()
    assert (detector.oscillating, detector.reason) == (False, "")


def test_non_finite_errors_are_refused() -> None:
    with pytest.raises(ValueError, match="error_rad=nan must be finite"):
        OscillationDetector(OscillationDetectorParams()).update(math.nan, DT_S)


def test_large_swings_count_however_their_periods_change() -> None:
    """A saturated drive: every swing lasts and reaches half as much again as the one before."""
    detector = OscillationDetector(OscillationDetectorParams())
    peak, length, sign = math.radians(0.05), 0.3, 1.0
    seen = []
    for _ in range(6):
        steps = round(length / 0.02)
        for step in range(steps):
            detector.update(sign * peak * math.sin(math.pi * step / steps), 0.02)
        seen.append(detector.oscillating)
        peak, length, sign = 1.5 * peak, 1.5 * length, -sign
    assert seen.index(True) in (3, 4), "three swings beyond the gross threshold of 0.05 deg, the first one clipped"


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"gross_threshold_rad": 1e-4}, "gross_threshold_rad=0.0001 must be >= threshold_rad="),
        ({"high_pass_hz": 2.0, "highest_hz": 1.0}, "high_pass_hz=2.0 must be < highest_hz=1.0"),
        ({"gross_half_cycles": 7}, "gross_half_cycles=7 must be <= half_cycles=6"),
    ],
)
def test_thresholds_of_the_wrong_order_are_refused(changes: dict, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        OscillationDetectorParams(**changes)


def test_the_frequency_of_large_swings_is_that_of_those_that_decided() -> None:
    """One small swing of 0.2 s, then large ones of 0.3, 0.46 and 0.6 s: 1.10 Hz."""
    detector, sign = OscillationDetector(OscillationDetectorParams()), 1.0
    for length, peak_deg in [(0.2, 0.03), (0.3, 0.2), (0.46, 0.2), (0.6, 0.2), (0.6, 0.2)]:
        steps = round(length / DT_S)
        for step in range(steps):
            detector.update(sign * math.radians(peak_deg) * math.sin(math.pi * step / steps), DT_S)
            if detector.oscillating:
                assert float(re.search(r"at (\d\.\d\d) Hz", detector.reason)[1]) == pytest.approx(1.1, rel=0.1)
                return
        sign = -sign
    raise AssertionError("four large swings are no oscillation")


@pytest.mark.parametrize("speed_deg_s", [0.2, 1.0, -3.0])
def test_a_swing_beyond_the_largest_is_not_waited_out(speed_deg_s: float) -> None:
    """A loop whose drive saturates may swing ever more slowly; half a degree is enough."""
    detector = OscillationDetector(OscillationDetectorParams())
    time = DT_S * np.arange(1000)
    corner = 2.0 * math.pi * detector.params.high_pass_hz
    high_passed = abs(speed_deg_s) / corner * (1.0 - np.exp(-corner * time))
    crossing = int(np.argmax(high_passed >= 0.5))
    found = [detector.update(error, DT_S) for error in np.radians(speed_deg_s * time).tolist()]
    assert found.index(True) == pytest.approx(crossing, abs=2)
    assert re.fullmatch(
        r"oscillation of 5\d\d\.\d mdeg, at most \d+\.\d mdeg, cut before its period was known", detector.reason
    )


def test_error_that_grows_more_slowly_than_the_band_is_not_cut() -> None:
    """At 0.1 deg/s the high-passed ramp ends at 0.32 deg, however far off the axis comes."""
    assert not watch(np.radians(0.1 * DT_S * np.arange(3000))).oscillating


@pytest.mark.parametrize("dt_s", [0.99e-5, 1.01, math.nan])
def test_steps_that_no_loop_has_are_refused(dt_s: float) -> None:
    detector = OscillationDetector(OscillationDetectorParams())
    for usual_s in (1e-5, 1.0):
        detector.update(0.0, usual_s)
    with pytest.raises(ValueError, match="dt_s"):
        detector.update(0.0, dt_s)
