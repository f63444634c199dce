"""Time delay of the conscan chain, recovered from known shifts of the scan."""

import copy
import math

import numpy as np
import pytest

from rf_pointing.core import MDEG, MU, PointingError, random_stream
from rf_pointing.tracking import DelayEstimator, DelayParams, ScanParams, beam_design, circle_offset, fit_beam

H, R, PERIOD_S = 17.0 * MDEG, 1.55 * MDEG, 20.0

SCAN = ScanParams(radius_rad=R, period_s=PERIOD_S, ramp_s=0.0)


def window_error(start_s: float, x: float, y: float, delay_s: float, rng: np.random.Generator) -> PointingError:
    """One conscan estimate whose powers come `delay_s` late, from beam positions at the powers' own times."""
    times = start_s + np.arange(1, 21) - 0.5
    assumed = np.array([circle_offset(SCAN, float(t))[:2] for t in times])
    real = np.array([circle_offset(SCAN, float(t) - delay_s)[:2] for t in times])
    mean = 1e4 * np.exp(-MU * ((x - real[:, 0]) ** 2 + (y - real[:, 1]) ** 2) / H**2)
    power = mean + np.sqrt(2.0 * mean) * rng.standard_normal(20)
    found = fit_beam(beam_design(assumed[:, 0], assumed[:, 1], H), power, np.full(20, 2.0))
    return PointingError(
        t_s=float(times.mean()), sensor="conscan", cross_elevation_rad=float(found.error_rad[0]),
        elevation_rad=float(found.error_rad[1]), covariance_rad2=found.covariance_rad2,
    )  # fmt: skip


@pytest.mark.parametrize("delay_s", [-1.3, 0.0, 0.7, 3.1])
def test_planted_delay_is_recovered_within_its_stated_uncertainty(delay_s: float) -> None:
    rng = random_stream(6, f"delay {delay_s}")
    estimator = DelayEstimator(DelayParams(period_s=PERIOD_S, memory=1.0))
    x, y = 2.0 * MDEG, -1.0 * MDEG
    moved = (0.0, 0.0)
    for k in range(12):
        estimator.add(window_error(100.0 + k * PERIOD_S, x, y, delay_s, rng), *moved)
        moved = ((2.0, 0.5) if k % 2 else (-2.0, -0.5)) * np.array(MDEG)
        x, y = x - moved[0], y - moved[1]
    found = estimator.estimate()
    assert found is not None
    assert found.delay_s == pytest.approx(delay_s, abs=4.0 * found.sigma_s)
    assert found.sigma_s < 0.15
    assert found.gain == pytest.approx(1.0, abs=4.0 * found.sigma_s * 2.0 * math.pi / PERIOD_S)


def error_at(x: float, y: float, valid: bool = True) -> PointingError:
    return PointingError(
        t_s=0.0, sensor="conscan", cross_elevation_rad=x, elevation_rad=y, covariance_rad2=np.eye(2) * 1e-12,
        valid=valid, reason="" if valid else "no lock",
    )  # fmt: skip


def test_origin_that_never_moves_tells_nothing() -> None:
    estimator = DelayEstimator(DelayParams())
    for _ in range(5):
        estimator.add(error_at(1e-5, 2e-5), 0.0, 0.0)
    assert estimator.estimate() is None


def test_invalid_estimate_breaks_the_chain() -> None:
    estimator = DelayEstimator(DelayParams())
    estimator.add(error_at(1e-5, 0.0), 0.0, 0.0)
    estimator.add(error_at(0.0, 0.0, valid=False), 1e-5, 0.0)
    estimator.add(error_at(5e-5, 0.0), 1e-5, 0.0)
    assert estimator.state.sums.weight == 0.0


def test_uncertain_delay_is_not_given() -> None:
    estimator = DelayEstimator(DelayParams(largest_sigma_s=1e-3))
    estimator.add(error_at(0.0, 0.0), 0.0, 0.0)
    estimator.add(error_at(-1e-6, 0.0), 1e-6, 0.0)
    assert estimator.estimate() is None


def test_copied_state_continues_identically() -> None:
    estimator = DelayEstimator(DelayParams(largest_sigma_s=600.0))
    estimator.add(error_at(0.0, 0.0), 0.0, 0.0)
    twin = DelayEstimator(DelayParams(largest_sigma_s=600.0))
    twin.state = copy.deepcopy(estimator.state)
    for each in (estimator, twin):
        each.add(error_at(-1e-5, 3e-6), 1e-5, 0.0)
    assert estimator.estimate() == twin.estimate()


def test_a_target_that_moves_by_itself_makes_the_delay_uncertain() -> None:
    """Estimates that change as much without a shift of the scan as with one say nothing of a delay."""

    def learned(drift_rad: float) -> float:
        estimator, away = DelayEstimator(DelayParams(period_s=4.0, memory=1.0, largest_sigma_s=600.0)), 0j
        for k in range(8):
            moved = complex(1.0, 0.5) * MDEG * (k % 2) if k else 0j
            away += drift_rad * 1j**k - moved
            estimator.add(error_at(away.real, away.imag), moved.real, moved.imag)
        found = estimator.estimate()
        assert found is not None
        return found.sigma_s

    assert learned(3.0 * MDEG) > 5.0 * learned(0.0)
