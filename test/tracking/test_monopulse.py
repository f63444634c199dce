"""Monopulse errors: right, honest about their spread, and refused when they must be."""

import dataclasses
import math

import numpy as np
import pytest

from rf_pointing.core import MDEG, MonopulseCluster, random_stream
from rf_pointing.rf import BeamParams, MonopulseFeed, MonopulseFeedParams
from rf_pointing.tracking import MonopulseParams, MonopulseTracker
from rf_pointing.tracking.monopulse import MonopulseCalibration

H = 17.0 * MDEG
SLOPE = 1.57
SAMPLE_S = 0.02


def tracker(**changes: float) -> MonopulseTracker:
    return MonopulseTracker(MonopulseParams(half_power_beamwidth_rad=H, **changes))


def cluster(
    x: float, y: float, level_db_hz: float = 45.0, rng: np.random.Generator | None = None,
    phase: float = 0.0, n: int = 5,
) -> MonopulseCluster:  # fmt: skip
    """A cluster of the textbook feed tanh(k x / h), amplitude 1."""
    snr = 10.0 ** (level_db_hz / 10.0) * SAMPLE_S
    noise = np.zeros((3, n), dtype=complex)
    if rng is not None:
        parts = rng.standard_normal((2, 3, n)) * math.sqrt(0.5 / snr)
        noise = parts[0] + 1j * parts[1]
    right, up = math.tanh(SLOPE * x / H), math.tanh(SLOPE * y / H)
    carrier = np.exp(1j * phase)
    return MonopulseCluster(
        t_s=10.0 + np.arange(n) * SAMPLE_S, sum=carrier + noise[0],
        difference_cross_elevation=right * carrier + noise[1],
        difference_elevation=up * carrier + noise[2], carrier_to_noise_db_hz=level_db_hz,
    )  # fmt: skip


@pytest.mark.parametrize(("x", "y"), [(0.0, 0.0), (3.1, -1.7), (-7.9, 8.2), (12.5, -12.0)])
def test_noiseless_error_is_exact_over_the_valid_range_for_any_carrier_phase(x: float, y: float) -> None:
    for phase in (0.0, 1.3, -2.9):
        error = tracker().measure(cluster(x * MDEG, y * MDEG, 120.0, phase=phase))
        assert error.valid, error.reason
        assert error.cross_elevation_rad == pytest.approx(x * MDEG, abs=1e-7 * MDEG)
        assert error.elevation_rad == pytest.approx(y * MDEG, abs=1e-7 * MDEG)


def test_straight_curve_is_not_bent_and_matches_an_aperture_feed_where_tanh_overshoots() -> None:
    beam = BeamParams(half_power_beamwidth_rad=H, pattern="uniform")
    volts = MonopulseFeed(MonopulseFeedParams(slope=SLOPE), beam).voltages(np.full(5, 0.3 * H), np.zeros(5))
    samples = MonopulseCluster(
        t_s=np.arange(5) * SAMPLE_S, sum=volts.sum, difference_cross_elevation=volts.difference_cross_elevation,
        difference_elevation=volts.difference_elevation, carrier_to_noise_db_hz=90.0,
    )  # fmt: skip
    straight = MonopulseTracker(MonopulseParams(half_power_beamwidth_rad=H, curve="straight")).measure(samples)
    bent = tracker().measure(samples)
    assert straight.cross_elevation_rad == pytest.approx(0.3 * H, rel=0.03)
    assert bent.cross_elevation_rad == pytest.approx(1.11 * 0.3 * H, rel=0.02)


def test_time_of_the_error_is_the_middle_of_the_cluster() -> None:
    assert tracker().measure(cluster(0.0, 0.0)).t_s == pytest.approx(10.04, abs=1e-12)


@pytest.mark.parametrize(("x", "y"), [(0.0, 0.0), (4.0, -2.5)])
def test_spread_on_the_axis_is_the_monopulse_formula_and_the_covariance_says_so(x: float, y: float) -> None:
    rng = random_stream(3, "monopulse")
    errors = [tracker().measure(cluster(x * MDEG, y * MDEG, 40.0, rng)) for _ in range(3000)]
    found = np.array([[e.cross_elevation_rad, e.elevation_rad] for e in errors])
    sample = np.cov(found.T)
    # 3000 runs: a variance is known to 2.6 %, so 8 % is three standard errors.
    assert sample == pytest.approx(np.mean([e.covariance_rad2 for e in errors], axis=0), abs=0.08 * sample.max())
    if x == 0.0:
        snr = 1e4 * SAMPLE_S
        formula = H / SLOPE * math.sqrt((1.0 + 1.0 / snr) / (2.0 * 5.0 * snr))
        assert math.sqrt(sample[0, 0]) == pytest.approx(formula, rel=0.04)


def test_noise_in_the_sum_does_not_shrink_the_error() -> None:
    rng = random_stream(4, "monopulse")
    errors = [tracker(lock_db_hz=10.0).measure(cluster(2.0 * MDEG, 0.0, 27.0, rng)) for _ in range(2500)]
    found = np.array([e.cross_elevation_rad for e in errors])
    standard_error = found.std() / math.sqrt(len(found))
    assert found.mean() == pytest.approx(2.0 * MDEG, abs=4.0 * standard_error)
    # Without removing the noise from |sum|^2 the shrinkage would be 1/snr = 10 %, far outside.
    assert 4.0 * standard_error < 0.1 * 2.0 * MDEG


def test_range_beyond_the_straightened_curve_is_refused() -> None:
    with pytest.raises(
        ValueError, match=r"valid_range_beamwidths=0.75 must be <= 0.59, to which the curve of a feed with"
    ):
        MonopulseParams(slope=2.5)
    assert MonopulseParams(slope=2.5, curve="straight").slope == 2.5


def test_difference_out_of_phase_with_the_sum_is_not_valid() -> None:
    good = cluster(4.0 * MDEG, 0.0, 50.0)
    turned = dataclasses.replace(good, difference_cross_elevation=good.difference_cross_elevation * 1j)
    error = tracker().measure(turned)
    assert not error.valid
    assert error.reason.startswith("quadrature: chi squared")


@pytest.mark.parametrize(("change", "reason"), [
    ({"sum": np.array([1.0, 1.0, np.nan, 1.0, 1.0])}, "sum must be finite"),
    ({"difference_elevation": np.ones(4)}, r"difference_elevation has shape \(4,\), must be \(5,\)"),
    ({"t_s": np.array([1.0, 1.1, 1.1, 1.2, 1.3])}, "t_s must increase from sample to sample"),
    ({"t_s": np.array([1.0, np.inf, 3.0, 4.0, 5.0])}, "t_s and carrier_to_noise_db_hz must be finite"),
    ({"sum": np.zeros(5)}, "sum is zero in every sample"),
    ({"carrier_to_noise_db_hz": math.nan}, "t_s and carrier_to_noise_db_hz must be finite"),
    ({"t_s": np.array([]), "sum": np.array([])}, r"t_s has shape \(0,\), must have at least 2 samples"),
])  # fmt: skip
def test_broken_clusters_are_rejected_with_the_reason_and_an_unknown_spread(
    change: dict[str, object], reason: str
) -> None:
    error = tracker().measure(dataclasses.replace(cluster(0.0, 0.0), **change))
    assert not error.valid
    with pytest.raises(AssertionError, match=reason):
        raise AssertionError(error.reason)
    np.testing.assert_allclose(error.covariance_rad2, H**2 * np.eye(2))
    assert (error.cross_elevation_rad, error.elevation_rad) == (0.0, 0.0)
    # Of the last time that is one.
    known = [t_s for t_s in np.ravel(change.get("t_s", 10.0 + SAMPLE_S * np.arange(5))) if np.isfinite(t_s)]
    assert error.t_s == (known[-1] if known else 0.0)
    # Broken samples are no loss of the carrier, if only the receiver says what it hears.
    assert error.carrier_to_noise_db_hz == (0.0 if "carrier_to_noise_db_hz" in change else 45.0)


def test_calibration_survives_its_own_numbers() -> None:
    response = np.array([[900.0 + 100.0j, 20.0 - 5.0j], [-7.0 + 1.0j, 880.0 - 300.0j]])
    calibration = MonopulseCalibration.from_response(response, np.array([0.1 - 0.2j, 0.3j]))
    again = MonopulseCalibration.from_mapping(dataclasses.asdict(calibration))
    assert np.array_equal(again.response_per_rad(), response)
    assert np.array_equal(again.offset(), [0.1 - 0.2j, 0.3j])


def test_calibration_that_does_not_separate_the_axes_is_refused() -> None:
    response = np.array([[900.0, 900.0], [800.0, 801.0]], dtype=complex)
    with pytest.raises(ValueError, match="does not separate cross-elevation from elevation: condition number"):
        MonopulseCalibration.from_response(response, np.zeros(2, dtype=complex))


def written_out(found: MonopulseTracker, samples: MonopulseCluster) -> tuple[np.ndarray, np.ndarray]:
    """Return error and covariance by the least squares of real and imaginary parts."""
    params, known = found.params, found.calibration
    snr = 10.0 ** (samples.carrier_to_noise_db_hz / 10.0) * SAMPLE_S
    power = np.sum(np.abs(samples.sum) ** 2) * snr / (1.0 + snr)
    differences = (samples.difference_cross_elevation, samples.difference_elevation)
    ratio = np.array([np.sum(one * np.conj(samples.sum)) for one in differences]) / power
    response, off = known.response_per_rad(), ratio - known.offset()
    parts = np.vstack([response.real, response.imag])
    linear = np.linalg.lstsq(parts, np.concatenate([off.real, off.imag]), rcond=None)[0]
    scale = params.slope / params.half_power_beamwidth_rad
    error = np.arctanh(scale * linear) / scale
    # Real and imaginary parts of the two ratios and their noise, the sum's in both.
    noise = (1.0 + 1.0 / snr) / (len(samples.sum) * snr) * (np.eye(2) + np.outer(ratio, np.conj(ratio)))
    of_parts = 0.5 * np.block([[noise.real, -noise.imag], [noise.imag, noise.real]])
    jacobian = np.diag(1.0 / (1.0 - (scale * linear) ** 2)) @ np.linalg.pinv(parts)
    return error, jacobian @ of_parts @ jacobian.T


def calibrated(**changes: float) -> MonopulseTracker:
    response = np.array([[1.2 * np.exp(0.5j), 0.15j], [0.1, 0.9 * np.exp(-0.7j)]]) * SLOPE / H
    known = MonopulseCalibration.from_response(response, np.array([0.02 + 0.01j, -0.01j]))
    return MonopulseTracker(MonopulseParams(half_power_beamwidth_rad=H, **changes), known)


def through(found: MonopulseTracker, x: float, y: float, level_db_hz: float) -> MonopulseCluster:
    """A cluster of the calibrated feed."""
    scale = SLOPE / H
    ratio = (
        found.calibration.response_per_rad() @ np.tanh(scale * np.array([x, y])) / scale + found.calibration.offset()
    )
    snr = 10.0 ** (level_db_hz / 10.0) * SAMPLE_S
    one = np.ones(5, dtype=complex)
    # The receiver takes the noise power off that of the sum: it must be there.
    total = np.sqrt((1.0 + snr) / snr) * one
    return MonopulseCluster(
        t_s=10.0 + SAMPLE_S * np.arange(5), sum=total, difference_cross_elevation=ratio[0] / total[0].real * one,
        difference_elevation=ratio[1] / total[0].real * one, carrier_to_noise_db_hz=level_db_hz,
    )  # fmt: skip


@pytest.mark.parametrize("level_db_hz", [32.0, 50.0])
def test_error_and_covariance_are_the_least_squares_of_both_parts_of_both_channels(level_db_hz: float) -> None:
    found = calibrated()
    samples = through(found, 3.0 * MDEG, -5.0 * MDEG, level_db_hz)
    error = found.measure(samples)
    expected, covariance = written_out(found, samples)
    assert error.valid, error.reason
    assert [error.cross_elevation_rad, error.elevation_rad] == pytest.approx([3.0 * MDEG, -5.0 * MDEG], rel=1e-9)
    assert [error.cross_elevation_rad, error.elevation_rad] == pytest.approx(expected, rel=1e-9)
    np.testing.assert_allclose(error.covariance_rad2, covariance, rtol=1e-9, atol=1e-9 * covariance.max())


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"carrier_to_noise_db_hz": 200.0}, ""), ({"carrier_to_noise_db_hz": 200.1}, "must be between -60.0 and 200.0"),
        ({"carrier_to_noise_db_hz": 29.0}, "no lock: C/N0 29.0 dB-Hz is below 30.0 dB-Hz"),
        ({"carrier_to_noise_db_hz": -60.0}, "no lock"), ({"carrier_to_noise_db_hz": -60.1}, "must be between"),
        ({"t_s": np.array([[1.0, 2.0]])}, r"t_s has shape (1, 2), must have at least 2 samples"),
        ({"t_s": np.array([1.0]), "sum": np.ones(1)}, "t_s has shape (1,), must have at least 2 samples"),
        ({"difference_elevation": np.full(5, 999.0)}, "error of"),
        ({"difference_elevation": np.full(5, 1001.0)}, "a difference"),
        ({"difference_elevation": np.full(5, np.inf)}, "difference_elevation must be finite"),
        ({"difference_elevation": np.full(5, 1e200)}, "difference_elevation is too large to be squared"),
        ({"sum": np.full(5, 1e-200)}, "sum is too small to be squared"),
        ({"sum": np.full(5, 1e-140), "difference_elevation": np.ones(5)}, "times the sum must be <= 1000"),
        ({"difference_cross_elevation": np.zeros(5)}, ""),
    ],
)  # fmt: skip
def test_a_cluster_is_judged_at_the_edges_of_what_a_receiver_gives(change: dict[str, object], reason: str) -> None:
    error = tracker().measure(dataclasses.replace(cluster(0.0, 0.0, 120.0), **change))
    assert error.valid is (reason == "")
    assert reason in error.reason


@pytest.mark.parametrize(("beamwidths", "valid"), [(0.74, True), (0.76, False)])
@pytest.mark.parametrize("axis", [0, 1])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_each_axis_is_believed_as_far_as_its_own_range(axis: int, sign: float, beamwidths: float, valid: bool) -> None:
    """The two together may be farther off."""
    place = np.array([0.6, 0.6])
    place[axis] = sign * beamwidths
    error = tracker().measure(cluster(*(place * H), 120.0))
    assert error.valid is valid
    assert valid or error.reason == "error of 0.76 beamwidths is outside 0.75 beamwidths"
