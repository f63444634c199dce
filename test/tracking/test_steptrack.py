"""Step-track with any power meter."""

import copy
import dataclasses
import math

import numpy as np
import pytest

from rf_pointing.core import MDEG, MU, CarrierPower, PointingError, random_stream
from rf_pointing.tracking import StepTrackParams
from rf_pointing.tracking.steptrack import POINTS, StepTracker

H = 65.0 * MDEG


def meter(t_s: float, watts: float, level_db_hz: float = 40.0) -> CarrierPower:
    return CarrierPower(t_s=t_s, integration_s=0.5, power_w=watts, sigma_w=1.0, carrier_to_noise_db_hz=level_db_hz)


def run(
    tracker: StepTracker, x: float, y: float, noise: float, seconds: float = 20.0, start_s: float = 0.0
) -> list[PointingError]:
    rng = random_stream(4, "steptrack")
    errors = []
    for k in range(round(seconds / 0.5)):
        t_s = start_s + 0.5 * (k + 1)
        beam = tracker.offset(t_s - 0.25)
        u, v = beam.cross_elevation_rad, beam.elevation_rad
        watts = 3e-17 * math.exp(-MU * ((x - u) ** 2 + (y - v) ** 2) / H**2) * (1.0 + noise * rng.standard_normal())
        error = tracker.add(meter(t_s, watts), u, v)
        if error is not None:
            errors.append(error)
    return errors


@pytest.mark.parametrize(("x", "y"), [(0.0, 0.0), (12.0, -20.0), (-30.0, 5.0)])
def test_noiseless_round_is_exact_with_samples_taken_close_to_the_points(x: float, y: float) -> None:
    error = run(StepTracker(StepTrackParams()), x * MDEG, y * MDEG, 0.0)[0]
    assert error.valid
    assert error.sensor == "steptrack"
    assert error.cross_elevation_rad == pytest.approx(x * MDEG, abs=1e-4 * MDEG)
    assert error.elevation_rad == pytest.approx(y * MDEG, abs=1e-4 * MDEG)


@pytest.mark.parametrize(("samples", "rounds"), [(2, 600), (3, 400), (5, 300), (12, 150)])
@pytest.mark.parametrize("noise", [0.001, 0.05])
def test_errors_are_as_large_as_their_covariance_states_with_few_samples_too(
    samples: int, rounds: int, noise: float, random: np.random.Generator
) -> None:
    """Normalised error squared against 2, the number of axes, at random places of the target."""
    tracker, squares = StepTracker(StepTrackParams(samples_per_point=samples, step_beamwidths=0.25)), []
    for number in range(rounds):
        x, y = random.uniform(-0.3, 0.3, 2) * H
        for k in range(4 * samples):
            u, v = (0.25 * H * a for a in POINTS[k // samples])
            watts = 3e-17 * math.exp(-MU * ((x - u) ** 2 + (y - v) ** 2) / H**2)
            watts *= 1.0 + noise * random.standard_normal()
            error = tracker.add(meter(number * 1000.0 + k, watts), u, v)
        assert error is not None
        assert error.valid
        miss = np.array([error.cross_elevation_rad - x, error.elevation_rad - y])
        squares.append(float(miss @ np.linalg.solve(error.covariance_rad2, miss)))
    # The spread of the squares themselves says how well their mean is known.
    assert np.mean(squares) == pytest.approx(2.0, abs=4.0 * np.std(squares) / math.sqrt(rounds))
    assert np.mean(squares) < 2.6


def test_offset_rests_on_four_points_and_its_rates_are_its_derivative() -> None:
    tracker = StepTracker(StepTrackParams())
    step = 0.2 * H
    for index, (x, y) in enumerate([(1, 0), (0, 1), (-1, 0), (0, -1), (1, 0)]):
        rest = tracker.offset(index * 4.5 + 3.0)
        assert rest == pytest.approx((x * step, y * step, 0.0, 0.0), abs=1e-12)
    for t_s in (0.4, 1.1, 5.0, 5.9, 14.2):
        before, now, after = tracker.offset(t_s - 1e-4), tracker.offset(t_s), tracker.offset(t_s + 1e-4)
        numeric = (np.array(after[:2]) - np.array(before[:2])) / 2e-4
        assert np.array(now[2:]) == pytest.approx(numeric, abs=1e-3 * MDEG)


def test_the_beam_never_jumps_not_even_as_the_second_leg_begins() -> None:
    tracker, tick_s = StepTracker(StepTrackParams()), 0.01
    places = np.array([tracker.offset(tick_s * k) for k in range(2000)])
    fastest = np.abs(places[:, 2:]).max(axis=0)
    assert np.all(np.abs(np.diff(places[:, :2], axis=0)) <= 1.01 * tick_s * fastest)


def test_samples_taken_between_two_points_do_not_count() -> None:
    tracker = StepTracker(StepTrackParams())
    assert tracker.add(meter(1.0, 1.0), 0.1 * H, 0.1 * H) is None
    assert tracker.state.last_rejection == "the beam moves between two points"
    assert tracker.state.rejected == 1


@pytest.mark.parametrize(("sample", "reason"), [
    (meter(1.0, -1.0), "power_w=-1.0 must be > 0"),
    (meter(1.0, math.nan), "power, time and beam offset must be finite"),
    (dataclasses.replace(meter(1.0, 1.0), sigma_w=-1.0), "sigma_w=-1.0 must be >= 0"),
    (meter(1.0, 1.0, 3.0), "no lock: C/N0 3.0 dB-Hz is below 10.0 dB-Hz"),
])  # fmt: skip
def test_bad_sample_is_counted_with_its_reason(sample: CarrierPower, reason: str) -> None:
    tracker = StepTracker(StepTrackParams())
    assert tracker.add(sample, 0.2 * H, 0.0) is None
    assert tracker.state.last_rejection == reason


@pytest.mark.parametrize("factor", [1e30, 1e200])
def test_a_round_with_one_absurd_power_is_named_and_the_next_is_good(factor: float) -> None:
    tracker, found = StepTracker(StepTrackParams()), []
    for k in range(80):
        beam = tracker.offset(0.5 * (k + 1) - 0.25)
        u, v = beam.cross_elevation_rad, beam.elevation_rad
        watts = 3e-17 * math.exp(-MU * ((10.0 * MDEG - u) ** 2 + v**2) / H**2)
        error = tracker.add(meter(0.5 * (k + 1), watts * (factor if k == 7 else 1.0)), u, v)
        found += [error] if error is not None else []
    assert len(found) >= 2
    assert not found[0].valid
    assert "a sample outweighs the others" in found[0].reason
    assert (found[0].cross_elevation_rad, found[0].elevation_rad) == (0.0, 0.0)
    np.testing.assert_allclose(found[0].covariance_rad2, H**2 * np.eye(2))
    assert found[1].valid
    assert found[1].cross_elevation_rad == pytest.approx(10.0 * MDEG, abs=1e-4 * MDEG)


@pytest.mark.parametrize("factor", [1e16, 1e30, 1e200])
def test_the_last_bits_do_not_decide_whether_a_round_is_solved(factor: float) -> None:
    rng = random_stream(5, "last bits")
    for _ in range(20):
        tracker, error = StepTracker(StepTrackParams()), None
        watts = np.where(np.arange(8) == 3, factor, 1.0) * 3e-17 * (1.0 + 1e-15 * rng.standard_normal(8))
        for k in range(8):
            u, v = ((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0))[k // 2]
            error = tracker.add(meter(k + 1.0, float(watts[k])), 0.2 * H * u, 0.2 * H * v)
        assert error is not None
        assert "a sample outweighs the others" in error.reason


def test_a_sample_out_of_order_is_counted() -> None:
    tracker = StepTracker(StepTrackParams())
    assert tracker.add(meter(2.0, 1e-17), 0.2 * H, 0.0) is None
    assert tracker.add(meter(2.0, 1e-17), 0.2 * H, 0.0) is None
    assert tracker.state.counts == (1, 0, 0, 0)
    assert tracker.state.last_rejection == "t_s=2.0 must be later than that of the sample before"


def test_error_far_outside_is_reported_but_not_valid() -> None:
    error = run(StepTracker(StepTrackParams()), 50.0 * MDEG, 0.0, 0.0)[0]
    assert not error.valid
    assert error.reason == "error of 0.77 beamwidths is outside 0.70 beamwidths"


def test_copied_state_continues_identically() -> None:
    tracker, twin = StepTracker(StepTrackParams()), StepTracker(StepTrackParams())
    run(tracker, 5.0 * MDEG, 0.0, 0.05, seconds=9.0)
    twin.state = copy.deepcopy(tracker.state)
    mine, other = (run(t, 5.0 * MDEG, 0.0, 0.05, 12.0, 9.0)[0] for t in (tracker, twin))
    assert mine.cross_elevation_rad == other.cross_elevation_rad
    assert np.array_equal(mine.covariance_rad2, other.covariance_rad2)


def test_an_error_is_about_the_middle_of_its_samples() -> None:
    """Samples of 0.5 s, stamped at their ends."""
    tracker, middles, found = StepTracker(StepTrackParams()), [], None
    for k in range(8):
        u, v = POINTS[k // 2]
        middles.append(100.0 + k - 0.25)
        found = tracker.add(meter(100.0 + k, 3e-17), 0.2 * H * u, 0.2 * H * v)
    assert found is not None
    assert found.t_s == pytest.approx(float(np.mean(middles)), abs=1e-9)


@pytest.mark.parametrize("samples", [2, 3])
def test_the_covariance_is_that_of_the_scatter_times_students_mean_square(samples: int) -> None:
    """Scatter about the beam through n samples with n - 3 degrees of freedom, nu / (nu - 2) of its variance."""
    tracker, rng, error = StepTracker(StepTrackParams(samples_per_point=samples)), random_stream(4, "student"), None
    places, watts = [], []
    for k in range(4 * samples):
        u, v = (0.2 * H * a for a in POINTS[k // samples])
        places.append((u, v))
        watts.append(2e-17 * math.exp(-MU * ((0.1 * H - u) ** 2 + v**2) / H**2) * (1.0 + 1e-3 * rng.standard_normal()))
        error = tracker.add(meter(k + 1.0, watts[-1]), u, v)
    assert error is not None
    # ln P + mu |u|^2 / h^2 = a + 2 mu u.theta / h^2, relative noise alike in all samples.
    beam = np.array(places)
    rows = np.column_stack([np.ones(len(beam)), 2.0 * MU * beam / H**2])
    right = np.log(watts) + MU * np.sum(beam**2, axis=1) / H**2
    solved, misfit, *_ = np.linalg.lstsq(rows, right, rcond=None)
    freedom = 4 * samples - 3
    covariance = np.linalg.inv(rows.T @ rows)[1:, 1:] * misfit[0] / freedom * freedom / (freedom - 2)
    assert [error.cross_elevation_rad, error.elevation_rad] == pytest.approx(solved[1:], abs=2e-3 * H)
    np.testing.assert_allclose(error.covariance_rad2, covariance, rtol=0.1, atol=0.02 * float(np.max(covariance)))
