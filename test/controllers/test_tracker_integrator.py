"""The integrator of the radio error against H = 2 pi f_m / s."""

import math

import numpy as np
import pytest

from rf_pointing.controllers import TrackerIntegrator, TrackerIntegratorParams

PARAMS = TrackerIntegratorParams(bandwidth_hz=0.05)
GAIN = 2.0 * math.pi * 0.05


def test_constant_error_integrates_to_gain_times_time() -> None:
    tracker = TrackerIntegrator(PARAMS)
    for k in range(100):
        tracker.update(0.1 * k, (2e-5, -1e-5))
    offset, rate = tracker.at(9.95)
    np.testing.assert_allclose(offset, GAIN * 9.95 * np.array([2e-5, -1e-5]), rtol=1e-9)
    np.testing.assert_allclose(rate, GAIN * np.array([2e-5, -1e-5]), rtol=1e-12)


def test_offset_stops_when_the_next_sample_is_late() -> None:
    tracker = TrackerIntegrator(PARAMS)
    tracker.update(0.0, (1e-4, 1e-4))
    offset, rate = tracker.at(3.0)
    np.testing.assert_allclose(offset, GAIN * 0.1 * 1e-4)
    np.testing.assert_array_equal(rate, np.zeros(2))


def test_offset_is_clamped_and_comes_back_at_once() -> None:
    tracker = TrackerIntegrator(PARAMS.replace(offset_limit_rad=1e-5))
    for k in range(50):
        tracker.update(0.1 * k, (1e-3, 0.0))
    assert tracker.at(5.0)[0][0] == 1e-5
    tracker.update(5.0, (-1e-4, 0.0))
    assert tracker.at(5.1)[0][0] == pytest.approx(1e-5 - GAIN * 0.1 * 1e-4)


def test_frozen_integrator_holds_its_offset_and_goes_on_from_it() -> None:
    tracker = TrackerIntegrator(PARAMS)
    tracker.update(0.0, (1e-4, 0.0))
    tracker.freeze(0.05)
    tracker.update(0.1, (5e-4, 5e-4))
    np.testing.assert_allclose(tracker.at(2.0)[0], (GAIN * 0.05 * 1e-4, 0.0))
    assert tracker.frozen
    tracker.reset(2.0, tracker.at(2.0)[0])
    tracker.update(2.0, (1e-4, 0.0))
    assert tracker.at(2.1)[0][0] == pytest.approx(GAIN * 0.15 * 1e-4)


def test_reset_starts_from_the_given_offset_at_rest() -> None:
    tracker = TrackerIntegrator(PARAMS)
    tracker.update(0.0, (1e-4, 0.0))
    tracker.reset(1.0, (3e-5, -2e-5))
    offset, rate = tracker.at(1.5)
    np.testing.assert_array_equal(offset, (3e-5, -2e-5))
    np.testing.assert_array_equal(rate, np.zeros(2))
    tracker.reset(2.0)
    np.testing.assert_array_equal(tracker.at(2.0), np.zeros((2, 2)))


def test_time_running_backwards_is_refused() -> None:
    tracker = TrackerIntegrator(PARAMS)
    tracker.update(1.0, (0.0, 0.0))
    with pytest.raises(ValueError, match=r"t_s=0.5 must be >= 1.0"):
        tracker.update(0.5, (0.0, 0.0))


def test_the_mean_of_the_latest_errors_has_its_null_where_it_says() -> None:
    """Three errors at 10 Hz: nothing of 10/3 Hz gets through, a constant error acts in full."""
    integrator = TrackerIntegrator(TrackerIntegratorParams(bandwidth_hz=0.2, mean_of=3))
    integrator.reset(0.0)
    rates = []
    for k in range(30):
        error = 1e-5 * math.cos(2.0 * math.pi * k / 3.0) + 1e-6
        integrator.update(0.1 * k, (error, 1e-6))
        rates.append(integrator.state.rate_rad_s)
    np.testing.assert_allclose(rates[3:], 2.0 * math.pi * 0.2 * 1e-6, rtol=1e-9)


def test_an_error_to_be_caught_acts_at_once_and_the_mean_again_when_it_is_small() -> None:
    within = 1e-5
    integrator = TrackerIntegrator(TrackerIntegratorParams(bandwidth_hz=0.2, mean_of=5, mean_within_rad=within))
    integrator.reset(0.0)
    for k, error in enumerate((9e-5, 7e-5, 5e-5)):
        integrator.update(0.1 * k, (error, 0.0))
        assert integrator.state.rate_rad_s[0] == pytest.approx(2.0 * math.pi * 0.2 * error, rel=1e-12)
    ringing = [3e-5 * (-1) ** k + 2e-6 for k in range(10)]
    for k, error in enumerate(ringing):
        integrator.update(0.3 + 0.1 * k, (error, 0.0))
    mean = sum(ringing[-5:]) / 5.0
    assert abs(mean) < within < abs(ringing[-1])
    assert integrator.state.rate_rad_s[0] == pytest.approx(2.0 * math.pi * 0.2 * mean, rel=1e-12)


def test_a_reset_after_freezing_forgets_the_errors_before_it() -> None:
    integrator = TrackerIntegrator(TrackerIntegratorParams(mean_of=3))
    integrator.reset(0.0)
    integrator.update(0.1, (1e-3, 0.0))
    integrator.freeze(0.2)
    integrator.reset(0.2, integrator.at(0.2)[0])
    integrator.update(0.3, (1e-6, 0.0))
    assert integrator.state.rate_rad_s[0] == pytest.approx(2.0 * math.pi * 0.04 * 1e-6, rel=1e-12)


def test_the_rate_changes_no_faster_than_the_acceleration_allows() -> None:
    limit, period_s = math.radians(0.4), 0.1
    loop = TrackerIntegrator(TrackerIntegratorParams(bandwidth_hz=0.2, sample_s=period_s, acceleration_rad_s2=limit))
    rates = []
    for k in range(60):
        error = math.radians(0.3) if k < 20 else -math.radians(0.3)
        loop.update(period_s * k, (error, 0.1 * error))
        rates.append(loop.at(period_s * k)[1])
    steps = np.diff(np.array(rates), axis=0)
    assert np.max(np.abs(steps)) == pytest.approx(limit * period_s, rel=1e-9)
    # In the end it is the rate that the error asks for, on both axes.
    np.testing.assert_allclose(rates[-1], -2.0 * math.pi * 0.2 * math.radians(0.3) * np.array([1.0, 0.1]), rtol=1e-12)


def test_times_and_errors_that_are_no_numbers_are_refused() -> None:
    tracker = TrackerIntegrator(PARAMS)
    with pytest.raises(ValueError, match="error_rad"):
        tracker.update(0.0, (math.nan, 0.0))
    for attempt in (tracker.reset, tracker.freeze, lambda t_s: tracker.update(t_s, (0.0, 0.0))):
        with pytest.raises(ValueError, match="t_s=nan"):
            attempt(math.nan)
