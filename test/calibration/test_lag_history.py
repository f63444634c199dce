"""Lags along a motion: the closed form of a ramp, steady motion, a state to go on from, and the average's transfer function."""

import math

import numpy as np
import pytest
from scipy.signal import lsim

from rf_pointing.calibration import BiasModel, LagHistory, LagState, without_lags

AVERAGING_S = 5.0
VELOCITY_S = np.array([-1.0, -1.9])
TIMES = np.arange(0.0, 120.0, 0.1)


def model(acceleration_s2: float = 0.0) -> BiasModel:
    names = {f"{axis}_velocity_lag": value for axis, value in zip(("azimuth", "elevation"), VELOCITY_S, strict=True)}
    return BiasModel.zero().replace(
        **names, azimuth_acceleration_lag=acceleration_s2, elevation_acceleration_lag=acceleration_s2
    )


def swinging() -> tuple[np.ndarray, np.ndarray]:
    """Rates and accelerations (n, 2) of a motion with a fast turn in its middle."""
    turn = 0.03 / (1.0 + np.exp(-(TIMES - 40.0))) - 0.03 / (1.0 + np.exp(-(TIMES - 70.0)))
    rates = np.column_stack([0.002 + turn, 0.004 * np.cos(0.05 * TIMES)])
    return rates, np.gradient(rates, 0.1, axis=0)


def test_steady_motion_has_the_lags_of_the_model() -> None:
    slope, start = np.array([2e-5, -1e-5]), np.array([0.004, 0.006])
    rates = start + slope * TIMES[:, None]
    lagging = model(4.0)
    ahead, _ = LagHistory(lagging, AVERAGING_S).along(TIMES, rates, np.tile(slope, (len(TIMES), 1)))
    wanted = VELOCITY_S * rates[-1] + 4.0 * slope
    np.testing.assert_allclose(ahead[0][-1], wanted, atol=1e-7)
    np.testing.assert_allclose(ahead[1][-1], VELOCITY_S * slope, atol=1e-7)
    assert without_lags(lagging).coefficients["azimuth_velocity_lag"] == 0.0
    assert not without_lags(lagging).has_lags


def test_it_goes_on_from_a_state_also_after_a_gap() -> None:
    rates, bends = swinging()
    history = LagHistory(model(5.1), AVERAGING_S)
    whole, states = history.along(TIMES, rates, bends)
    for first in (400, 403):
        part, _ = history.along(TIMES[first:], rates[first:], bends[first:], states[400])
        np.testing.assert_allclose(part[0][-1], whole[0][-1], atol=1e-9)
        np.testing.assert_allclose(part[0][0], whole[0][first], atol=1e-6)


def test_an_average_over_no_time_is_refused() -> None:
    with pytest.raises(ValueError, match=r"averaging_s=0\.0 must be > 0"):
        LagHistory(model(), 0.0)
    assert math.isfinite(float(LagHistory(model(), 0.1).along(TIMES[:2], *(np.zeros((2, 2)),) * 2)[0][0].max()))


def swung(rates: list[np.ndarray], step_s: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the average of the beam and its slope after these axis rates, in steps of 5 ms from rest."""
    mean, slope = np.zeros(2), np.zeros(2)
    for rate in rates:
        for _ in range(round(step_s / 0.005)):
            pull = (rate - VELOCITY_S * slope - mean) / AVERAGING_S**2 - slope / AVERAGING_S
            slope = slope + 0.005 * pull
            mean = mean + 0.005 * slope
    return mean, slope


@pytest.mark.parametrize("away_s", [0.3, 1.7, 40.0])
def test_axes_that_stopped_unseen_went_on_as_far_as_they_moved(away_s: float) -> None:
    """One axis went on for 1.2 s (or all of the time), the other one has moved back, so it had stopped at once."""
    history, rate = LagHistory(model(), AVERAGING_S), np.array([0.02, -0.01])
    before = history.dragged(0.0, rate, None)
    for t_s in np.arange(0.1, 4.05, 0.1):
        before = history.dragged(float(t_s), rate, before)
    found = history.stopped(before.t_s + away_s, np.zeros(2), np.array([0.024, 0.003]), before)
    steps = [rate] * 40 + [np.array([0.02 if (k + 0.5) * 0.1 < 1.2 else 0.0, 0.0]) for k in range(round(away_s / 0.1))]
    mean, slope = swung(steps, 0.1)
    size = np.max(np.abs(swung(steps[:40], 0.1)[0]))
    np.testing.assert_allclose(found.mean, mean, atol=0.08 * size)
    np.testing.assert_allclose(found.slope, slope, atol=0.08 * size)
    assert found.t_s == before.t_s + away_s


@pytest.mark.parametrize("acceleration_s2", [0.0, 5.1])
def test_lead_and_its_derivatives_are_those_of_the_transfer_function(acceleration_s2: float) -> None:
    """Further derivatives of the average follow from T^2 m" + T m' + m = r."""
    rates, bends = swinging()
    history = LagHistory(model(acceleration_s2), AVERAGING_S)
    (position, velocity, acceleration), states = history.along(TIMES, rates, bends)
    for one, other in zip(history.lead(TIMES, rates, bends), (position, velocity, acceleration), strict=True):
        np.testing.assert_array_equal(one, other)
    for axis, x in enumerate(VELOCITY_S):
        d = acceleration_s2 + AVERAGING_S * x if acceleration_s2 else 0.0
        below = [AVERAGING_S**2, AVERAGING_S, 1.0]
        mean, slope, bend = (
            lsim((above, below), rates[:, axis], TIMES)[1] for above in ([1.0], [1.0, 0.0], [1.0, 0.0, 0.0])
        )
        jerk = (bends[:, axis] - slope) / AVERAGING_S**2 - bend / AVERAGING_S
        np.testing.assert_allclose(position[:, axis], x * mean + d * slope, atol=1e-12)
        np.testing.assert_allclose(velocity[:, axis], x * slope + d * bend, atol=1e-12)
        np.testing.assert_allclose(acceleration[:, axis], x * bend + d * jerk, atol=1e-12)
        np.testing.assert_allclose([state.mean[axis] for state in states], mean, atol=1e-12)
        np.testing.assert_allclose([state.slope[axis] for state in states], slope, atol=1e-12)
        assert [state.rate[axis] for state in states] == rates[:, axis].tolist()
    assert [state.t_s for state in states] == TIMES.tolist()


def test_the_average_does_not_depend_on_how_a_motion_is_sampled() -> None:
    """Steps of three lengths in turn; of a rate along a straight line nothing is lost."""
    times = np.concatenate([[0.0], np.cumsum(np.tile([0.1, 0.3, 0.1, 0.2, 0.3], 40))])
    ramp = np.column_stack([0.02 - 1e-4 * times, 0.01 + 3e-4 * times])
    slope = np.tile([-1e-4, 3e-4], (len(times), 1))
    history = LagHistory(model(5.1), AVERAGING_S)
    _, states = history.along(times, ramp, slope)
    ends = [0, len(times) - 1]
    _, (_, last) = history.along(times[ends], ramp[ends], slope[ends])
    np.testing.assert_allclose(states[-1].mean, last.mean, rtol=1e-9)
    np.testing.assert_allclose(states[-1].slope, last.slope, rtol=1e-7)


def test_the_beam_of_dragged_axes_lags_by_the_change_of_the_average() -> None:
    history = LagHistory(model(), AVERAGING_S)
    rate = np.array([0.02, -0.01])
    assert history.dragged(3.0, rate, None) == LagState(3.0, (0.02, -0.01))
    before = LagState(3.0, (0.01, 0.03), (0.004, 0.005), (0.001, -0.002))
    found = history.dragged(3.7, rate, before)
    beam = rate - VELOCITY_S * [0.001, -0.002]
    assert (found.t_s, found.rate) == (3.7, pytest.approx(tuple(beam)))
    _, (expected,) = history.along(np.array([3.7]), beam[np.newaxis], np.zeros((1, 2)), before)
    assert (found.mean, found.slope) == (expected.mean, expected.slope)
