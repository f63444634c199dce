import dataclasses
import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from rf_pointing.array_sensors.tripulse.array import TripulseArrayParams
from rf_pointing.array_sensors.tripulse.receiver import TripulseMeasurement, TripulseReceiver, TripulseReceiverParams
from rf_pointing.array_sensors.tripulse.signal import TripulseFrame, TripulseSignalParams
from rf_pointing.array_sensors.tripulse.source import StationLine, TripulseSource, TripulseSourceParams
from rf_pointing.core import random_stream
from rf_pointing.papers.tripulse_noise import random_failures
from rf_pointing.papers.tripulse_theory import projection_variance

ARRAY = TripulseArrayParams()
DIRECTION = np.array([0.05, -0.03, math.sqrt(1.0 - 0.05**2 - 0.03**2)])
LINE = StationLine(name="usingen", direction=DIRECTION, range_rate_m_s=-240.0, elevation_rad=0.7)
SIGNALS = {
    "two_tone": TripulseSignalParams(),
    "interleaved": TripulseSignalParams(scheme="interleaved", pattern="SxSy"),
}


def nominal(**link: float) -> TripulseReceiverParams:
    """Return a receiver that knows the level of the link."""
    level = link.get("element_carrier_to_noise_db_hz", 37.0)
    return TripulseReceiverParams(element_carrier_to_noise_db_hz=level)


def run(
    signal: TripulseSignalParams, frames: int, array: TripulseArrayParams = ARRAY,
    failed: np.ndarray | None = None, **changes: float,
) -> tuple[list[TripulseMeasurement], np.ndarray]:  # fmt: skip
    """Return measurements and true projections for attitudes drawn from the initial sensor's errors."""
    sender = TripulseSource(array, signal, TripulseSourceParams(**changes), seed=1, failed=failed)
    receiver = TripulseReceiver(array=array, signal=signal, params=nominal(**changes), failed=failed)
    rng, found, truth = random_stream(1, "receiver test"), [], []
    for index in range(frames):
        rotation = Rotation.from_rotvec(np.radians(0.1) / 3.0 * rng.normal(size=3)).as_matrix()
        (frame,) = sender.step(float(index), rotation, [LINE])
        found.append(receiver.measure(frame))
        truth.append((rotation @ DIRECTION)[:2])
    return found, np.array(truth)


def scores(found: list[TripulseMeasurement], truth: np.ndarray) -> np.ndarray:
    errors = np.array([m.projections for m in found]) - truth
    return np.array([e @ np.linalg.solve(m.covariance, e) for e, m in zip(errors, found, strict=True)])


@pytest.mark.parametrize("scheme", ["two_tone", "interleaved"])
def test_frames_under_doppler_and_phase_noise_follow_18_with_honest_covariance(scheme: str) -> None:
    signal = SIGNALS[scheme]
    found, truth = run(signal, 300)
    assert all(m.valid and m.estimator == "ratio" for m in found)
    errors = np.array([m.projections for m in found]) - truth
    element_snr = 10.0**3.7 * signal.beam_time_s(1)
    # 300 frames, two axes: 2.9 % of the standard deviation.
    assert np.sqrt(np.mean(errors**2)) == pytest.approx(math.sqrt(projection_variance(ARRAY, element_snr)[0]), rel=0.1)
    assert np.mean(scores(found, truth)) == pytest.approx(2.0, abs=0.4)
    doppler_hz = 240.0 / 299792458.0 * 12e9
    assert found[0].shift_hz == pytest.approx(doppler_hz, abs=600.0)


def test_below_12_db_the_posterior_takes_over_and_stays_honest() -> None:
    found, truth = run(SIGNALS["two_tone"], 200, element_carrier_to_noise_db_hz=3.0)
    kept = [(m, t) for m, t in zip(found, truth, strict=True) if m.valid and m.estimator == "posterior"]
    assert len(kept) > 150
    measurements, truths = [m for m, _ in kept], np.array([t for _, t in kept])
    assert np.mean(scores(measurements, truths)) == pytest.approx(2.0, abs=0.5)
    errors = np.array([m.projections for m in measurements]) - truths
    assert np.sqrt(np.mean(errors**2)) < 1.1 * np.radians(0.1) / 3.0


def test_known_dead_elements_quantiser_and_taper_leave_no_bias() -> None:
    array = TripulseArrayParams(n_x=12, n_y=14, taper_edge=0.6, phase_bits=4)
    failed = random_failures(random_stream(1, "dead"), array, 20, 1)[0]
    found, truth = run(SIGNALS["two_tone"], 100, array, failed)
    assert all(m.valid for m in found)
    assert np.mean(scores(found, truth)) == pytest.approx(2.0, abs=0.6)


def test_dead_elements_named_by_the_array_are_those_of_a_mask() -> None:
    array = TripulseArrayParams(n_x=12, n_y=14, failed="1:1, 2:1,12:14")
    mask = np.zeros((12, 14), dtype=bool)
    mask[0, 0] = mask[1, 0] = mask[11, 13] = True
    named, truth = run(SIGNALS["two_tone"], 20, array)
    masked, _ = run(SIGNALS["two_tone"], 20, TripulseArrayParams(n_x=12, n_y=14), mask)
    for one, two in zip(named, masked, strict=True):
        assert one.valid
        np.testing.assert_array_equal(one.projections, two.projections)
    assert np.mean(scores(named, truth)) == pytest.approx(2.0, abs=1.2)


def test_no_signal_is_invalid_with_the_prior_and_its_reason() -> None:
    (measured,), _ = run(SIGNALS["two_tone"], 1, element_carrier_to_noise_db_hz=-20.0)
    assert not measured.valid
    assert "sum SNR" in measured.reason
    np.testing.assert_allclose(measured.projections, DIRECTION[:2])
    np.testing.assert_allclose(np.diag(measured.covariance), (np.radians(0.1) / 3.0) ** 2)


def test_weak_references_are_reported_before_anything_is_measured() -> None:
    (measured,), _ = run(SIGNALS["two_tone"], 1, reference_carrier_to_noise_db_hz=55.0)
    assert not measured.valid
    assert "reference" in measured.reason


@pytest.mark.parametrize("scheme", ["two_tone", "interleaved"])
def test_lock_lost_between_pulses_is_reported(scheme: str) -> None:
    signal = SIGNALS[scheme]
    sender = TripulseSource(ARRAY, signal, TripulseSourceParams(), seed=1)
    (frame,) = sender.step(0.0, np.eye(3), [LINE])
    samples = frame.samples.copy()
    samples[signal.samples // 2 :] *= np.exp(1.5j if scheme == "two_tone" else 2.5j)
    broken = TripulseReceiver(array=ARRAY, signal=signal).measure(dataclasses.replace(frame, samples=samples))
    assert not broken.valid
    assert "lost lock" in broken.reason


def test_error_near_the_first_null_is_not_believed() -> None:
    tilt = Rotation.from_rotvec([0.0, 0.9 * ARRAY.unambiguous_projection[0], 0.0]).as_matrix()
    straight = StationLine(name="a", direction=np.array([0.0, 0.0, 1.0]), range_rate_m_s=0.0, elevation_rad=1.0)
    sender = TripulseSource(ARRAY, SIGNALS["two_tone"], TripulseSourceParams(), seed=1)
    (frame,) = sender.step(0.0, tilt, [straight])
    measured = TripulseReceiver(array=ARRAY, signal=SIGNALS["two_tone"]).measure(frame)
    assert not measured.valid
    assert "lobe away" in measured.reason


@pytest.mark.parametrize("scheme", ["two_tone", "interleaved"])
@pytest.mark.parametrize("towards", [0.0, 1.0, 2.5, 4.0])
def test_station_in_another_lobe_is_called_ambiguous(scheme: str, towards: float) -> None:
    sender = TripulseSource(ARRAY, SIGNALS[scheme], TripulseSourceParams(), seed=2)
    receiver = TripulseReceiver(array=ARRAY, signal=SIGNALS[scheme])
    straight = StationLine(name="a", direction=np.array([0.0, 0.0, 1.0]), range_rate_m_s=0.0, elevation_rad=1.0)
    for k, tilt_deg in enumerate(np.linspace(1.3, 5.0, 12)):
        turn = np.radians(tilt_deg) * np.array([math.cos(towards), math.sin(towards), 0.0])
        (frame,) = sender.step(float(k), Rotation.from_rotvec(turn).as_matrix(), [straight])
        measured = receiver.measure(frame)
        assert not measured.valid
    (frame,) = sender.step(20.0, np.eye(3), [straight])
    assert receiver.measure(frame).valid


def test_rain_on_all_tones_does_not_make_a_lobe_of_the_level() -> None:
    changes = {"element_carrier_to_noise_db_hz": 31.0, "reference_carrier_to_noise_db_hz": 74.0}
    sender = TripulseSource(ARRAY, SIGNALS["two_tone"], TripulseSourceParams(**changes), seed=2)
    (frame,) = sender.step(0.0, np.eye(3), [LINE])
    assert TripulseReceiver(array=ARRAY, signal=SIGNALS["two_tone"]).measure(frame).valid


@pytest.mark.parametrize(("gain_db", "words"), [(-3.0, "another lobe"), (3.0, "nominal level is wrong")])
def test_level_off_its_nominal_is_refused_either_way(gain_db: float, words: str) -> None:
    changes = {"element_carrier_to_noise_db_hz": 37.0 + gain_db}
    sender = TripulseSource(ARRAY, SIGNALS["two_tone"], TripulseSourceParams(**changes), seed=2)
    (frame,) = sender.step(0.0, np.eye(3), [LINE])
    measured = TripulseReceiver(array=ARRAY, signal=SIGNALS["two_tone"]).measure(frame)
    assert not measured.valid
    assert words in measured.reason


def frame_of(scheme: str, seed: int = 1, **link: float) -> tuple[TripulseReceiver, TripulseFrame]:
    """Return a receiver that knows the link, and a frame off its steering by a third of the unambiguous error."""
    sender = TripulseSource(ARRAY, SIGNALS[scheme], TripulseSourceParams(**link), seed=seed)
    tilt = Rotation.from_rotvec([4e-3, 7e-3, 0.0]).as_matrix()
    (frame,) = sender.step(5.0, tilt, [LINE])
    return TripulseReceiver(array=ARRAY, signal=SIGNALS[scheme], params=nominal(**link)), frame


def test_less_power_than_that_of_the_noise_counts_as_60_db_below_it() -> None:
    found = [frame_of("two_tone", seed, element_carrier_to_noise_db_hz=-20.0) for seed in range(8)]
    levels = [receiver.measure(frame).sum_snr_db for receiver, frame in found]
    assert min(levels) == pytest.approx(-60.0)
    assert max(levels) > -20.0


def test_the_ratio_is_used_from_its_snr_on_and_errors_up_to_the_fraction_believed() -> None:
    receiver, frame = frame_of("two_tone", element_carrier_to_noise_db_hz=30.0)
    plain = receiver.measure(frame)
    assert plain.estimator == "ratio"
    fraction = np.max(np.abs(plain.projections - frame.steering) / ARRAY.unambiguous_projection)
    assert 0.2 < fraction < 0.5
    for margin, estimator in ((-0.01, "ratio"), (0.01, "posterior")):
        params = receiver.params.replace(ratio_snr_min_db=plain.sum_snr_db + margin)
        assert dataclasses.replace(receiver, params=params).measure(frame).estimator == estimator
    for share, valid in ((1.001, True), (0.999, False)):
        params = receiver.params.replace(largest_error_fraction=share * fraction)
        again = dataclasses.replace(receiver, params=params).measure(frame)
        assert again.valid is valid
        assert ("of the unambiguous lambda/(N d), must be <= " in again.reason) is not valid


@pytest.mark.parametrize(
    ("steering", "valid"),
    [([0.8, 0.602], False), ([0.602, 0.8], False), ([-0.81, -0.602], False), ([0.8, 0.55], True), ([0.0, 0.97], True)],
)
def test_projections_as_long_as_one_are_no_direction(steering: list[float], valid: bool) -> None:
    receiver, frame = frame_of("two_tone")
    measured = receiver.measure(dataclasses.replace(frame, steering=np.array(steering)))
    assert measured.valid is valid
    assert ("longer than one: not a direction" in measured.reason) is not valid


@pytest.mark.parametrize(("fraction", "largest_db"), [(0.75, 2.218), (0.5, 4.771), (0.6, 3.680)])
def test_the_tolerance_of_the_level_is_at_most_half_the_step_to_the_next_period(
    fraction: float, largest_db: float
) -> None:
    """u is |u| / (2 - |u|) of the peak one period away: 10 log10((2 - u) / u) dB is half of that step."""
    TripulseReceiverParams(largest_error_fraction=fraction, level_tolerance_db=largest_db - 0.002)
    with pytest.raises(ValueError, match=f"half the step to the next period at largest_error_fraction={fraction}"):
        TripulseReceiverParams(largest_error_fraction=fraction, level_tolerance_db=largest_db + 0.002)
