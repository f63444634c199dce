import math

import numpy as np
import pytest

from rf_pointing.array_sensors.tripulse.array import TripulseArrayParams
from rf_pointing.array_sensors.tripulse.beams import closed_form_signals, invert_ratios, monopulse_ratios
from rf_pointing.core import random_stream
from rf_pointing.papers.tripulse_theory import (
    LOWEST_SUM_SNR,
    PulseAllocation,
    allocate_pulses,
    equal_pulses,
    integration_time_s,
    polar_angle_variance_rad2,
    projection_variance,
    ratio_variance,
    ratio_variance_unequal,
)

TRIALS = 200_000
CN0_DB_HZ, SIGMA = 37.0, 5.8e-5


def noise(rng: np.random.Generator, variance: float, shape: tuple[int, ...]) -> np.ndarray:
    return np.sqrt(variance / 2.0) * (rng.normal(size=shape) + 1j * rng.normal(size=shape))


@pytest.mark.parametrize(("snr_db", "within"), [(12.0, 0.05), (15.0, 0.03), (20.0, 0.015)])
@pytest.mark.parametrize("gamma", [0.1, 1.0])
def test_corrected_17_follows_monte_carlo_and_the_published_one_falls_short_at_large_gamma(
    snr_db: float, within: float, gamma: float
) -> None:
    rng, snr = random_stream(1, "variance 17"), 10.0 ** (snr_db / 10.0)
    n = noise(rng, 1.0 / snr, (TRIALS, 2))
    found = float(np.var(np.imag((1j * gamma + n[:, 0]) / (1.0 + n[:, 1]))))
    assert ratio_variance(snr, gamma) == pytest.approx(found, rel=within)
    if gamma == 1.0 and snr_db == 12.0:
        assert ratio_variance(snr, gamma, "published") < 0.93 * found


def test_unequal_noise_reduces_to_17_and_follows_monte_carlo() -> None:
    assert ratio_variance_unequal(0.01, 0.01, 0.3) == pytest.approx(ratio_variance(100.0, 0.3), rel=1e-12)
    rng = random_stream(1, "unequal noise")
    n1, n2 = noise(rng, 0.03, (TRIALS,)), noise(rng, 0.004, (TRIALS,))
    found = float(np.var(np.imag((0.4j + n2) / (1.0 + n1))))
    assert ratio_variance_unequal(0.03, 0.004, 0.4) == pytest.approx(found, rel=0.015)


def test_integration_time_is_set_by_the_slower_axis() -> None:
    long_in_x = TripulseArrayParams(n_x=32, n_y=8)
    long_in_y = TripulseArrayParams(n_x=8, n_y=32)
    assert integration_time_s(long_in_x, 37.0, 1e-4) == integration_time_s(long_in_y, 37.0, 1e-4)
    assert integration_time_s(long_in_x, 37.0, 1e-4) == pytest.approx(
        4.0 * integration_time_s(TripulseArrayParams(), 37.0, 1e-4)
    )


@pytest.mark.parametrize("bad", [0.0, -1.0, np.nan, np.inf])
def test_snr_that_is_not_positive_is_refused(bad: float) -> None:
    with pytest.raises(ValueError, match="sum_snr"):
        ratio_variance(bad, 0.1)
    with pytest.raises(ValueError, match="element_snr"):
        projection_variance(TripulseArrayParams(), bad)


def test_published_21_is_refused_at_its_pole() -> None:
    with pytest.raises(ValueError, match="pole"):
        polar_angle_variance_rad2(1e-8, np.pi / 4.0, "published")


def simulated_sigma(params: TripulseArrayParams, pulses: PulseAllocation, error: np.ndarray) -> np.ndarray:
    rng = random_stream(1, "allocation")
    durations = np.array([pulses.sum_s, pulses.delta_x_s, pulses.delta_y_s])
    scale = np.sqrt(0.5 / (durations * 10.0 ** (CN0_DB_HZ / 10.0)))
    noise = scale * (rng.normal(size=(100_000, 3)) + 1j * rng.normal(size=(100_000, 3)))
    return np.asarray(
        np.std(invert_ratios(params, monopulse_ratios(closed_form_signals(params, error) + noise)), axis=0)
    )


@pytest.mark.parametrize("error_deg", [0.0, 0.1, 0.4])
@pytest.mark.parametrize("plan", [allocate_pulses, equal_pulses])
def test_planned_pulses_meet_the_specification_in_simulation(plan: object, error_deg: float) -> None:
    params, error = TripulseArrayParams(), np.radians([error_deg, -error_deg])
    pulses = plan(params, CN0_DB_HZ, SIGMA, error)  # type: ignore[operator]
    np.testing.assert_allclose(pulses.sigma, SIGMA, rtol=1e-9)
    np.testing.assert_allclose(simulated_sigma(params, pulses, error), SIGMA, rtol=0.02)


def test_equal_pulses_at_boresight_are_those_of_22() -> None:
    params = TripulseArrayParams()
    # The second-order term of the variance adds 1/SNR to it.
    pulses = equal_pulses(params, CN0_DB_HZ, SIGMA, [0.0, 0.0])
    assert pulses.sum_s == pytest.approx(integration_time_s(params, CN0_DB_HZ, SIGMA), rel=1e-3)


def test_optimal_total_is_least_over_a_scan_of_sum_pulses() -> None:
    params, error = TripulseArrayParams(n_x=12, n_y=20), np.array([2e-3, 5e-4])
    best = allocate_pulses(params, CN0_DB_HZ, SIGMA, error)
    signals = closed_form_signals(params, error)
    gamma = np.abs(signals[1:] / signals[0])
    c = 1.0 / (abs(signals[0]) ** 2 * 10.0 ** (CN0_DB_HZ / 10.0))
    allowed = (SIGMA * params.kd * np.array([12, 20]) / 4.0 * (1.0 + gamma**2)) ** 2
    totals = []
    for sum_s in best.sum_s * np.geomspace(0.3, 3.0, 101):
        a = c / sum_s
        totals.append(sum_s + np.sum(c * (1.0 + a) / (2.0 * allowed - gamma**2 * (a + 2.0 * a * a))))
    assert best.total_s <= min(totals) * (1.0 + 1e-9)
    assert best.total_s == pytest.approx(min(totals), rel=1e-3)


def test_sum_pulse_follows_the_first_order_rule_at_high_snr() -> None:
    params = TripulseArrayParams()
    best = allocate_pulses(params, 60.0, 1e-6, [1e-3, 1e-3])
    gamma = math.tan(1e-3 * params.kd[0] * 16 / 4.0)
    assert best.sum_s / best.delta_x_s == pytest.approx(math.sqrt(2.0) * gamma, rel=0.02)


def test_sum_pulse_is_kept_above_12_db() -> None:
    params = TripulseArrayParams()
    best = allocate_pulses(params, CN0_DB_HZ, 2e-3, [0.0, 0.0])
    snr = best.sum_s * 10.0 ** (CN0_DB_HZ / 10.0) * params.n_total**2
    assert snr >= LOWEST_SUM_SNR * (1.0 - 1e-9)


@pytest.mark.parametrize(
    ("cn0", "sigma", "error", "message"),
    [
        (np.nan, SIGMA, [0.0, 0.0], "element_carrier_to_noise_db_hz"),
        (37.0, 0.0, [0.0, 0.0], "sigma"),
        (37.0, SIGMA, [0.0], "shape"),
    ],
)
def test_impossible_specifications_are_refused(cn0: float, sigma: float, error: list[float], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        allocate_pulses(TripulseArrayParams(), cn0, sigma, error)


@pytest.mark.parametrize("name", ["sum_noise", "delta_noise"])
def test_noise_that_is_not_positive_is_refused(name: str) -> None:
    with pytest.raises(ValueError, match=f"{name}=0.0"):
        ratio_variance_unequal(**({"sum_noise": 0.1, "delta_noise": 0.1, "gamma": 0.0} | {name: 0.0}))


def test_allocation_is_refused_from_the_ambiguity_on_either_side() -> None:
    params = TripulseArrayParams()
    edge = float(np.max(params.unambiguous_projection))
    for sign in (1.0, -1.0):
        allocate_pulses(params, CN0_DB_HZ, SIGMA, [0.0, 0.9 * sign * edge])
        with pytest.raises(ValueError, match="projection_error"):
            allocate_pulses(params, CN0_DB_HZ, SIGMA, [0.0, sign * edge])
