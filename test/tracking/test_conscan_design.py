"""The closed forms of the conscan paper.

Radius and period from C/N0 and the wanted accuracy.
"""

import math

import numpy as np
import pytest

from rf_pointing.core import MDEG, MU, random_stream
from rf_pointing.tracking.beam_fit import beam_design, fit_beam
from rf_pointing.tracking.conscan_design import (
    ScanDesignParams,
    conscan_loss,
    conscan_sigma_eq25_rad,
    conscan_slope,
    design_scan,
    radius_for_loss_rad,
    scan_for_accuracy,
)
from rf_pointing.tracking.conscan_estimate import ConscanParams

H, R = 17.0 * MDEG, 1.55 * MDEG


def test_slope_and_loss_are_the_published_ones() -> None:
    assert conscan_slope(H, R) == pytest.approx(0.5, abs=0.01)
    assert conscan_loss(H, R) == pytest.approx(0.977, abs=0.0005)
    assert -10.0 * math.log10(conscan_loss(H, R)) == pytest.approx(0.1, abs=0.005)


KA = ScanDesignParams(half_power_beamwidth_rad=17.0 * MDEG)


def test_a_tenth_of_a_db_is_the_published_radius() -> None:
    assert radius_for_loss_rad(17.0 * MDEG, 0.1) == pytest.approx(1.55 * MDEG, abs=0.005 * MDEG)
    assert conscan_slope(17.0 * MDEG, radius_for_loss_rad(17.0 * MDEG, 0.1)) == pytest.approx(0.5, abs=0.01)


@pytest.mark.parametrize("level_db_hz", [25.0, 30.0, 38.0, 45.0])
@pytest.mark.parametrize("wanted_mdeg", [0.3, 0.5, 1.0])
def test_design_reaches_the_accuracy_and_one_sample_less_would_not(level_db_hz: float, wanted_mdeg: float) -> None:
    design = design_scan(KA.replace(largest_loss_db=3.0), level_db_hz, wanted_mdeg * MDEG)
    assert design.sigma_rad <= wanted_mdeg * MDEG * (1.0 + 1e-9)
    assert design.sigma_rad == pytest.approx(
        conscan_sigma_eq25_rad(17.0 * MDEG, design.radius_rad, design.samples, level_db_hz), rel=1e-12
    )
    assert 4.0 <= design.period_s <= 64.0
    assert design.loss_db >= 0.1 - 1e-9
    if design.samples > 4:
        shorter = conscan_sigma_eq25_rad(17.0 * MDEG, design.radius_rad, design.samples - 1, level_db_hz)
        assert shorter > wanted_mdeg * MDEG


def test_weak_carrier_widens_the_scan_only_after_the_period_is_used_up() -> None:
    strong, weak = design_scan(KA, 30.0, 0.5 * MDEG), design_scan(KA, 24.0, 0.5 * MDEG)
    assert strong.loss_db == pytest.approx(0.1, abs=1e-9)
    assert strong.period_s < 64.0
    assert weak.period_s == 64.0
    assert weak.loss_db > 0.1
    assert weak.sigma_rad == pytest.approx(0.5 * MDEG, rel=1e-9)


def test_accuracy_out_of_reach_is_refused_with_the_best_there_is() -> None:
    with pytest.raises(
        ValueError, match=r"wanted_sigma_rad=.* must be >= .* at C/N0 10.0 dB-Hz within longest_period_s"
    ):
        design_scan(KA, 10.0, 0.1 * MDEG)


def test_radius_never_exceeds_the_one_of_best_accuracy() -> None:
    design = KA.replace(largest_loss_db=3.0, longest_period_s=16.0)
    best = 17.0 * MDEG / math.sqrt(2.0 * 4.0 * math.log(2.0))
    limit = conscan_sigma_eq25_rad(17.0 * MDEG, best, 16, 25.0)
    assert design_scan(design, 25.0, limit * 1.001).radius_rad <= best
    assert -10.0 * math.log10(conscan_loss(17.0 * MDEG, best)) == pytest.approx(2.17, abs=0.01)
    with pytest.raises(ValueError, match="must be >="):
        design_scan(design, 25.0, limit * 0.999)


def test_empty_ranges_are_refused() -> None:
    with pytest.raises(ValueError, match=r"shortest_period_s=70.0 must be <= longest_period_s=64.0"):
        KA.replace(shortest_period_s=70.0)
    with pytest.raises(ValueError, match=r"preferred_loss_db=1.5 must be <= largest_loss_db=1.0"):
        KA.replace(preferred_loss_db=1.5)


STATION = ConscanParams(
    half_power_beamwidth_rad=17.0 * MDEG, radius_rad=1.55 * MDEG, period_s=4.0, ramp_s=2.0, window_samples=80,
    fewest_samples=40, sample_s=0.1, updates="sample", drift=True, bandwidth_hz=0.1,
)  # fmt: skip


@pytest.mark.parametrize(("level_db_hz", "wanted_mdeg"), [(30.0, 0.5), (34.0, 0.4), (45.0, 0.1)])
def test_the_stations_windows_have_the_accuracy_that_was_wanted(level_db_hz: float, wanted_mdeg: float) -> None:
    """Of the estimator itself, with the drift of the power estimated along; not better by more than a tenth."""
    scan = scan_for_accuracy(STATION, KA, level_db_hz, wanted_mdeg * MDEG)
    times = scan.sample_s * np.arange(scan.window_samples)
    angle = 2.0 * math.pi * times / scan.period_s
    x, y = scan.radius_rad * np.cos(angle), scan.radius_rad * np.sin(angle)
    mean = 10.0 ** (level_db_hz / 10.0) * np.exp(-MU * (scan.radius_rad / scan.half_power_beamwidth_rad) ** 2)
    sigma = math.sqrt(2.0 * mean / scan.sample_s)
    runs = random_stream(3, f"designed {level_db_hz}").standard_normal((4000, len(times)))
    drift = np.linspace(-1.0, 1.0, len(times))[:, None]
    design = beam_design(np.column_stack([x, y]), scan.half_power_beamwidth_rad, drift)
    found = fit_beam(design, mean + sigma * runs, np.full(runs.shape, 2.0 / scan.sample_s)).error_rad
    spread = np.std(found, axis=0) / MDEG
    assert float(np.max(spread)) == pytest.approx(wanted_mdeg, rel=0.1)


def test_the_window_keeps_its_turns_and_the_loop_its_share_of_it() -> None:
    scan = scan_for_accuracy(STATION, KA, 26.0, 0.5 * MDEG)
    assert scan.period_s > 2.0 * STATION.period_s
    assert scan.window_samples * scan.sample_s == pytest.approx(2.0 * scan.period_s)
    assert scan.fewest_samples == pytest.approx(0.5 * scan.window_samples, abs=1.0)
    assert scan.bandwidth_hz * scan.period_s == pytest.approx(STATION.bandwidth_hz * STATION.period_s)
    assert scan.half_power_beamwidth_rad == STATION.half_power_beamwidth_rad


def test_a_strong_carrier_gives_the_shortest_turn_and_the_preferred_loss() -> None:
    scan = scan_for_accuracy(STATION, KA, 60.0, 1.0 * MDEG)
    assert scan.period_s == pytest.approx(KA.shortest_period_s)
    assert scan.radius_rad == pytest.approx(radius_for_loss_rad(17.0 * MDEG, KA.preferred_loss_db))


@pytest.mark.parametrize("turns", [2.0, 3.0, 5.0])
def test_a_drift_that_is_estimated_along_costs_samples_by_its_correlation_with_the_scan(turns: float) -> None:
    """1 - 6 / (pi turns)^2 is the square of the correlation of a line with the sine of so many turns."""
    phase = 2.0 * math.pi * turns * (np.arange(100_000) + 0.5) / 100_000
    lost = float(np.corrcoef(phase, np.sin(phase))[0, 1]) ** 2
    station = STATION.replace(period_s=8.0 / turns, window_samples=80)
    with_drift, without = (
        scan_for_accuracy(station.replace(drift=drift), KA.replace(longest_period_s=900.0 / turns), 30.0, 0.1 * MDEG)
        for drift in (True, False)
    )
    assert with_drift.radius_rad == without.radius_rad
    assert without.window_samples / with_drift.window_samples == pytest.approx(1.0 - lost, rel=1e-3)


def test_a_design_has_the_radius_loss_and_period_that_it_states() -> None:
    design = design_scan(KA.replace(integration_s=0.5), 30.0, 0.4 * MDEG)
    assert design.period_s == design.samples * 0.5
    assert design.loss_db == pytest.approx(0.1, rel=1e-9)
    assert design.radius_rad == radius_for_loss_rad(17.0 * MDEG, 0.1)
    # Eq. 25 with k_s = 2 r mu / h and L = exp(-mu r^2 / h^2), written out.
    relative = math.sqrt(2.0 / (1000.0 * 0.5)) / math.exp(-MU * (design.radius_rad / KA.half_power_beamwidth_rad) ** 2)
    sigma = KA.half_power_beamwidth_rad**2 / (2.0 * MU * design.radius_rad) * relative * math.sqrt(2.0 / design.samples)
    assert design.sigma_rad == pytest.approx(sigma, rel=1e-12)
