"""The maximum-likelihood conscan estimator: unbiased and at the Cramér-Rao bound, alone and in batches.

Spin period from a record of carrier power.
"""

import math

import numpy as np
import pytest

from rf_pointing.core import MDEG, MU, CarrierPower, PointingError, random_stream
from rf_pointing.tracking.beam_fit import PowerWindow, beam_design, fit_beam, rank_reason
from rf_pointing.tracking.conscan import ConscanTracker
from rf_pointing.tracking.conscan_estimate import ConscanParams

H, R = 17.0 * MDEG, 1.55 * MDEG

ANGLES = 2.0 * np.pi * np.arange(1, 33) / 32
X, Y = R * np.cos(ANGLES), R * np.sin(ANGLES)
DESIGN = beam_design(np.column_stack([X, Y]), H)


def power_ratio_hz(level_db_hz: float, x: float, y: float) -> np.ndarray:
    return 10.0 ** (level_db_hz / 10.0) * np.exp(-MU * ((x - X) ** 2 + (y - Y) ** 2) / H**2)


def draw(level_db_hz: float, x: float, y: float, runs: int, name: str) -> tuple[np.ndarray, np.ndarray]:
    """Powers (runs, 32) of the in-phase arm over 1 s in units of N0, and their variance over their mean."""
    arm = np.sqrt(power_ratio_hz(level_db_hz, x, y)) + random_stream(8, name).standard_normal((runs, 32)) * math.sqrt(
        0.5
    )
    power = np.maximum(arm**2 - 0.5, 1e-6)
    return power, (2.0 * power + 0.5) / power


def bound(level_db_hz: float, x: float, y: float) -> np.ndarray:
    """Cramér-Rao bound of the exact model: Fisher information sum of P/2N0 x x^T per second."""
    rows = np.stack([np.ones(32), 2.0 * MU * X / H**2, 2.0 * MU * Y / H**2], axis=1)
    return np.linalg.inv(rows.T @ (0.5 * power_ratio_hz(level_db_hz, x, y)[:, None] * rows))[1:, 1:]


@pytest.mark.parametrize(("x", "y"), [(0.0, 0.0), (2.0, 5.0), (8.5, 0.0), (-6.0, 6.0), (12.0, -9.0)])
def test_noiseless_power_gives_the_exact_direction_far_outside_the_linear_range(x: float, y: float) -> None:
    found = fit_beam(DESIGN, power_ratio_hz(60.0, x * MDEG, y * MDEG), np.full(32, 1e-9))
    assert found.converged
    assert found.error_rad == pytest.approx(np.array([x, y]) * MDEG, abs=1e-5 * MDEG)


@pytest.mark.parametrize("level_db_hz", [30.0, 40.0])
@pytest.mark.parametrize(("x", "y"), [(0.0, 0.0), (8.5, 0.0), (-5.0, 6.8)])
def test_bias_is_below_5_microdegrees_and_the_spread_at_the_bound_out_to_half_a_beamwidth(
    level_db_hz: float, x: float, y: float
) -> None:
    runs = 60_000
    power, noise = draw(level_db_hz, x * MDEG, y * MDEG, runs, f"{level_db_hz} {x}")
    error = fit_beam(DESIGN, power, noise).error_rad - np.array([x, y]) * MDEG
    sigma = np.sqrt(np.diag(bound(level_db_hz, x * MDEG, y * MDEG)))
    # 60 000 runs know a mean of 0.55 mdeg spread to 0.0023 mdeg and a spread to 0.3 %.
    assert np.abs(error.mean(axis=0)).max() <= (0.005 + 2.0 * 0.0023) * MDEG
    assert error.std(axis=0) == pytest.approx(sigma, rel=0.012)


def test_what_the_maximum_of_a_few_weak_powers_is_off_by_is_taken_out_of_it() -> None:
    """Twelve powers of 20 % on a circle of 0.35 H: the maximum itself is off by 1.8e-3 H, the result by 0.1e-3 at most."""
    turn = 2.0 * np.pi * np.arange(12) / 12
    beam, target = 0.35 * H * np.column_stack([np.cos(turn), np.sin(turn)]), np.array([0.4, 0.2]) * H
    design = beam_design(beam, H)
    mean = 25.0 * np.exp(-MU * np.sum((target - beam) ** 2 - target**2, axis=1) / H**2)
    power = random_stream(8, "bias").gamma(mean, 1.0, (20_000, 12))
    error = fit_beam(design, power, np.ones_like(power)).error_rad - target
    # Less what is linear in the noise and has no mean: 20 000 runs then know the rest to 0.03e-3 H.
    inverse = np.linalg.inv((design.columns * mean[:, None]).T @ design.columns)
    rest = error - H * ((power - mean) @ design.columns @ inverse)[:, 1:]
    assert np.max(np.abs(rest.mean(axis=0))) < 1e-4 * H


def test_covariance_is_honest_over_the_batch() -> None:
    power, noise = draw(30.0, 4.0 * MDEG, -3.0 * MDEG, 20_000, "honest")
    found = fit_beam(DESIGN, power, noise)
    error = found.error_rad - np.array([4.0, -3.0]) * MDEG
    normalised = np.einsum("ri,rij,rj->r", error, np.linalg.inv(found.covariance_rad2), error) / 2.0
    # The mean of 20 000 normalised squared errors has a standard error of 0.7 %.
    assert normalised.mean() == pytest.approx(1.0, abs=0.025)
    assert found.chi_squared.mean() == pytest.approx(1.0, abs=0.02)


def test_batch_gives_what_each_run_gives_alone() -> None:
    power, noise = draw(35.0, 3.0 * MDEG, 1.0 * MDEG, 5, "batch")
    together = fit_beam(DESIGN, power, noise)
    for k in range(5):
        alone = fit_beam(DESIGN, power[k], noise[k])
        assert alone.error_rad == pytest.approx(together.error_rad[k], abs=1e-6 * MDEG)
        assert alone.covariance_rad2 == pytest.approx(together.covariance_rad2[k], rel=1e-4)


def run(
    tracker: ConscanTracker, x: float, y: float, count: int, name: str = "run", **modulation: float
) -> list[PointingError]:
    """Feed a tracker with 1-s samples of the exact beam at 40 dB-Hz, the scan as commanded."""
    rng = random_stream(9, name)
    depth, spin_s = modulation.get("depth", 0.0), modulation.get("spin_s", 7.3)
    errors = []
    for k in range(count):
        t_s = k + 0.5
        scan = tracker.params.scan.offset(t_s)
        u, v = scan.cross_elevation_rad, scan.elevation_rad
        mean = (
            1e4
            * math.exp(-MU * ((x - u) ** 2 + (y - v) ** 2) / H**2)
            * (1.0 + depth * math.cos(2.0 * math.pi * t_s / spin_s + 0.4))
        )
        power = mean + math.sqrt(2.0 * mean) * rng.standard_normal()
        sample = CarrierPower(
            t_s=k + 1.0, integration_s=1.0, power_w=power, sigma_w=math.sqrt(2.0 * power), carrier_to_noise_db_hz=40.0
        )
        error = tracker.add(sample, u, v)
        if error is not None:
            errors.append(error)
    return errors


def params(**changes: object) -> ConscanParams:
    return ConscanParams(half_power_beamwidth_rad=H, radius_rad=R).replace(**changes)


def test_separate_windows_and_sliding_window_give_one_estimate_per_window_and_per_sample() -> None:
    x, y = 3.0 * MDEG, -2.0 * MDEG
    separate = run(ConscanTracker(params()), x, y, 96)
    sliding = run(ConscanTracker(params(updates="sample")), x, y, 96)
    assert len(separate) == 3
    assert len(sliding) == 96 - 31
    assert sliding[-1].cross_elevation_rad == separate[-1].cross_elevation_rad
    assert all(math.hypot(e.cross_elevation_rad - x, e.elevation_rad - y) < 0.6 * MDEG for e in sliding)


def test_scan_that_grows_from_zero_is_usable_from_its_first_sample() -> None:
    error = run(ConscanTracker(params(ramp_s=16.0)), 2.0 * MDEG, 2.0 * MDEG, 32)[0]
    assert error.valid, error.reason
    assert error.cross_elevation_rad == pytest.approx(2.0 * MDEG, abs=0.7 * MDEG)


def test_recentred_window_keeps_measuring_the_same_target() -> None:
    tracker = ConscanTracker(params(updates="sample"))
    before = run(tracker, 3.0 * MDEG, 1.0 * MDEG, 40)[-1]
    tracker.recentre(3.0 * MDEG, 1.0 * MDEG)
    window = tracker.state.window
    tracker.state = type(tracker.state)(window=type(window)(window.rows[:-1]))
    last = window.rows[-1]
    sample = CarrierPower(t_s=40.0, integration_s=1.0, power_w=last[1], sigma_w=last[2], carrier_to_noise_db_hz=40.0)
    tracker.params = tracker.params.replace(window_samples=32)
    after = tracker.add(sample, last[3], last[4])
    assert after is not None
    assert after.cross_elevation_rad == pytest.approx(before.cross_elevation_rad - 3.0 * MDEG, abs=1e-4 * MDEG)
    assert after.elevation_rad == pytest.approx(before.elevation_rad - 1.0 * MDEG, abs=1e-4 * MDEG)


def test_spin_modulation_biases_the_plain_estimate_and_not_the_one_that_knows_the_period() -> None:
    spin = {"depth": 0.2, "spin_s": 29.0}
    plain = run(ConscanTracker(params(misfit_limit=1e6)), 0.0, 0.0, 320, **spin)
    rejecting = run(ConscanTracker(params(spin_periods_s=(29.0, 14.5), window_samples=96)), 0.0, 0.0, 960, **spin)
    assert math.hypot(plain[0].cross_elevation_rad, plain[0].elevation_rad) > 2.0 * MDEG
    assert all(e.valid for e in rejecting)
    worst = max(math.hypot(e.cross_elevation_rad, e.elevation_rad) for e in rejecting)
    assert worst < 4.5 * math.sqrt(max(e.covariance_rad2[0, 0] for e in rejecting))
    assert worst < 0.6 * MDEG


def test_spin_with_the_period_of_the_scan_is_named_not_fitted() -> None:
    error = run(ConscanTracker(params(spin_periods_s=(32.5,))), 0.0, 0.0, 32, depth=0.1)[0]
    assert not error.valid
    assert error.reason.startswith("the spin cannot be separated from the scan")


def test_fit_that_runs_out_of_steps_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("rf_pointing.tracking.beam_fit.MAX_ITERATIONS", 1)
    power = np.where(np.arange(32) % 2, 1e4, 1e-3)
    assert not fit_beam(DESIGN, power, np.full(32, 2.0)).converged
    tracker = ConscanTracker(params())
    for k in range(32):
        sample = CarrierPower(
            t_s=k + 1.0, integration_s=1.0, power_w=power[k], sigma_w=math.sqrt(2.0 * power[k]),
            carrier_to_noise_db_hz=30.0,
        )  # fmt: skip
        error = tracker.add(sample, X[k], Y[k])
    assert error is not None
    assert error.reason == "the likelihood did not converge"


@pytest.mark.parametrize(
    ("angle_deg", "blind"),
    [(0.0, "elevation"), (10.0, "elevation"), (180.0, "elevation"), (90.0, "cross-elevation"), (100.0, "cross-elevation"),
     (45.0, "one diagonal"), (-45.0, "one diagonal"), (60.0, "one diagonal")],
)  # fmt: skip
def test_positions_on_a_line_name_the_axis_across_it(angle_deg: float, blind: str) -> None:
    along = np.array([math.cos(math.radians(angle_deg)), math.sin(math.radians(angle_deg))])
    positions = np.linspace(-1.0, 2.0, 12)[:, None] * R * along
    assert rank_reason(positions, 1e-3 * R) == f"{blind} is not determined: the beam positions lie on a line"
    assert rank_reason(positions[:2], 1e-3 * R) == "2 distinct beam positions, must be at least 3"


def test_flat_positions_are_a_singular_fit() -> None:
    with pytest.raises(np.linalg.LinAlgError):
        fit_beam(beam_design(np.column_stack([X, np.zeros(32)]), H), np.ones(32), np.full(32, 2.0))


def test_a_window_holds_its_newest_samples_that_are_not_too_old() -> None:
    window = PowerWindow.empty()
    for k in range(6):
        window = window.with_sample((float(k), 1.0 + k, 0.1, 0.01 * k, -0.02 * k, 40.0 + k), 4, k - 2.5)
        assert window.t_s.tolist() == [float(t) for t in range(max(0, k - 2), k + 1)]
    full = PowerWindow.empty()
    for k in range(6):
        full = full.with_sample((float(k), 1.0, 0.1, 0.0, 0.0, 40.0), 4, -math.inf)
    assert full.t_s.tolist() == [2.0, 3.0, 4.0, 5.0]
    assert window.power_w.tolist() == [4.0, 5.0, 6.0]
    assert window.sigma_w.tolist() == [0.1] * 3
    assert window.carrier_to_noise_db_hz.tolist() == [43.0, 44.0, 45.0]
    moved = window.moved(0.5, -0.25)
    np.testing.assert_allclose(
        moved.beam_rad, [[0.03 - 0.5, -0.06 + 0.25], [0.04 - 0.5, -0.08 + 0.25], [0.05 - 0.5, -0.1 + 0.25]]
    )
    assert window.beam_rad[0].tolist() == [0.03, -0.06]
    assert window.without(1).t_s.tolist() == [3.0, 5.0]
