import dataclasses
import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from rf_pointing.array_sensors.tripulse.array import TripulseArrayParams, element_weights
from rf_pointing.array_sensors.tripulse.beams import beam_signals, closed_form_signals, invert_with_weights
from rf_pointing.array_sensors.tripulse.channels import Channels, channelise
from rf_pointing.array_sensors.tripulse.receiver import (
    TripulseMeasurement,
    TripulseReceiver,
    TripulseReceiverParams,
    _Detected,
)
from rf_pointing.array_sensors.tripulse.robust import posterior_projection_error, signal_matrix
from rf_pointing.array_sensors.tripulse.signal import (
    TripulseFrame,
    TripulseSignalParams,
    segment_beams,
    segment_times_s,
)
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
    signal: TripulseSignalParams,
    frames: int,
    array: TripulseArrayParams = ARRAY,
    failed: np.ndarray | None = None,
    **changes: float,
) -> tuple[list[TripulseMeasurement], np.ndarray]:
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


@pytest.mark.parametrize(
    ("failed", "words"),
    [
        ("3", "must be pairs such as 3:16"),
        ("1:x", "must be pairs such as 3:16"),
        ("0:1", "failed element 0:1 must be from 1:1 to 16:16"),
        ("17:1", "must be from 1:1 to 16:16"),
    ],
)
def test_dead_elements_that_do_not_exist_are_refused(failed: str, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        TripulseArrayParams(failed=failed)


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


def test_tolerance_that_spans_two_periods_is_refused() -> None:
    with pytest.raises(ValueError, match=r"level_tolerance_db=3\.0 must be <= 2\.22"):
        TripulseReceiverParams(level_tolerance_db=3.0)


def test_frames_of_another_length_or_with_nan_are_refused() -> None:
    sender = TripulseSource(ARRAY, SIGNALS["two_tone"], TripulseSourceParams(), seed=1)
    (frame,) = sender.step(0.0, np.eye(3), [LINE])
    receiver = TripulseReceiver(array=ARRAY, signal=SIGNALS["two_tone"])
    with pytest.raises(ValueError, match="shape"):
        receiver.measure(dataclasses.replace(frame, samples=frame.samples[:-1]))
    samples = frame.samples.copy()
    samples[5] = np.nan
    with pytest.raises(ValueError, match="finite"):
        receiver.measure(dataclasses.replace(frame, samples=samples))


def test_the_level_is_that_at_the_error_and_not_at_its_mirror_image() -> None:
    """Coarse phase shifters make the beam lopsided; at the narrowest tolerance the two sides differ."""
    array = TripulseArrayParams(phase_bits=1)
    receiver = TripulseReceiver(
        array=array, signal=SIGNALS["two_tone"], params=TripulseReceiverParams(level_tolerance_db=0.1)
    )
    steering, error = np.array([0.081, -0.086]), np.array([0.6, 0.5]) * array.unambiguous_projection
    weights = element_weights(array, steering)
    here, mirrored = (abs(beam_signals(array, weights, steering + sign * error)[0]) for sign in (1.0, -1.0))
    assert abs(20.0 * math.log10(here / mirrored)) > 3.0
    receiver._require_level(steering, error, here, 80.0)
    receiver._require_level(steering, error, here * 10.0 ** (0.099 / 20.0), 80.0)
    for level, words in ((mirrored, "ambiguous"), (here * 10.0 ** (0.103 / 20.0), "nominal level is wrong")):
        with pytest.raises(ValueError, match=words):
            receiver._require_level(steering, error, level, 80.0)
    # At 20 dB a sigma of the amplitude is 1 / sqrt(2 * 100) of it, 0.614 dB.
    receiver._require_level(steering, error, here * 10.0 ** (-1.9 / 20.0), 20.0)
    with pytest.raises(ValueError, match=r"must be within 1\.94 dB: the station may be in another lobe"):
        receiver._require_level(steering, error, here * 10.0 ** (-2.0 / 20.0), 20.0)


@pytest.mark.parametrize("lopsided", [False, True])
def test_direction_and_covariance_of_ratios_are_those_of_their_inversion(lopsided: bool) -> None:
    """(17) with the noise of each beam, carried to the direction by the change of the inversion with its ratios."""
    array = TripulseArrayParams(n_x=8, n_y=12, phase_bits=2, taper_edge=0.5) if lopsided else TripulseArrayParams()
    receiver = TripulseReceiver(array=array, signal=SIGNALS["two_tone"])
    steering, error = np.array([0.081, -0.046]), np.array([0.4, -0.55]) * array.unambiguous_projection
    weights = element_weights(array, steering)
    beams = 3.0 * np.exp(0.7j) * beam_signals(array, weights, steering + error).conj()
    noises = np.abs(beams[0]) ** 2 * np.array([0.02, 0.03, 0.05])
    found, covariance = receiver._from_ratio(steering, beams, noises)
    np.testing.assert_allclose(found, error, atol=1e-9)
    ratios = -(beams[1:] / beams[0]).imag
    step = 1e-6
    change = np.array(
        [
            invert_with_weights(array, weights, steering, ratios + step * e)
            - invert_with_weights(array, weights, steering, ratios - step * e)
            for e in np.eye(2)
        ]
    ).T / (2.0 * step)
    spread = np.array(
        [
            [(0.02 + 2 * 0.02**2) * ratios[0] ** 2 + 1.02 * 0.03, (0.02 + 2 * 0.02**2) * ratios[0] * ratios[1]],
            [(0.02 + 2 * 0.02**2) * ratios[0] * ratios[1], (0.02 + 2 * 0.02**2) * ratios[1] ** 2 + 1.02 * 0.05],
        ]
    )
    np.testing.assert_allclose(covariance, change @ (0.5 * spread) @ change.T, rtol=1e-6)


def test_amplitude_of_the_sum_beam_in_elements_is_taken_against_the_link_or_the_references() -> None:
    for scheme, signal in SIGNALS.items():
        still = TripulseSource(
            ARRAY, signal,
            TripulseSourceParams(element_carrier_to_noise_db_hz=45.0, reference_carrier_to_noise_db_hz=85.0,
                                 satellite_linewidth_hz=0.0, station_linewidth_hz=0.0),
            seed=3,
        )  # fmt: skip
        straight = StationLine(name="a", direction=DIRECTION, range_rate_m_s=0.0, elevation_rad=0.7)
        (frame,) = still.step(0.0, np.eye(3), [straight])
        # All 256 elements in phase, 8 dB above the link that the receiver knows where only that one counts.
        receiver = TripulseReceiver(array=ARRAY, signal=signal)
        channels = channelise(signal, frame.samples, receiver.params.largest_shift_hz)
        beams, noises = receiver._beam_means(receiver._detect(channels))
        snr_db = 10.0 * math.log10(abs(beams[0]) ** 2 / noises[0])
        over_db = 8.0 if scheme == "interleaved" else 8.0 - 5.0
        found_db = 20.0 * math.log10(receiver._level(channels, complex(beams[0]), snr_db) / 256.0)
        # The noise of a frame is known from few segments, to some tenths of a decibel.
        assert found_db == pytest.approx(over_db, abs=0.6)


def frame_of(scheme: str, seed: int = 1, **link: float) -> tuple[TripulseReceiver, TripulseFrame]:
    """Return a receiver that knows the link, and a frame off its steering by a third of the unambiguous error."""
    sender = TripulseSource(ARRAY, SIGNALS[scheme], TripulseSourceParams(**link), seed=seed)
    tilt = Rotation.from_rotvec([4e-3, 7e-3, 0.0]).as_matrix()
    (frame,) = sender.step(5.0, tilt, [LINE])
    return TripulseReceiver(array=ARRAY, signal=SIGNALS[scheme], params=nominal(**link)), frame


@pytest.mark.parametrize("scheme", ["two_tone", "interleaved"])
def test_a_measurement_tells_its_frame_its_shift_and_the_snr_of_the_sum(scheme: str) -> None:
    receiver, frame = frame_of(scheme, element_carrier_to_noise_db_hz=20.0)
    channels = channelise(receiver.signal, frame.samples, receiver.params.largest_shift_hz)
    found = receiver._detect(channels)
    beams = segment_beams(receiver.signal)
    total = np.mean(found.values[beams == 0])
    noise = channels.noise_density / receiver.signal.segment_s / np.sum(beams == 0)
    snr_db = 10.0 * math.log10(abs(total) ** 2 / noise - 1.0)
    measured = receiver.measure(frame)
    assert measured.valid, measured.reason
    assert (measured.t_s, measured.station, measured.sequence) == (5.0, "usingen", 1)
    assert (measured.shift_hz, measured.reason) == (channels.shift_hz, "")
    assert measured.sum_snr_db == pytest.approx(snr_db)
    # Asked for more than it has, it is refused with all that is known of it.
    for margin, valid in ((-0.01, True), (0.01, False)):
        params = receiver.params.replace(snr_min_db=snr_db + margin)
        strict = dataclasses.replace(receiver, params=params).measure(frame)
        assert strict.valid is valid
    assert strict.reason.startswith("sum SNR ")
    assert (strict.t_s, strict.station, strict.sequence) == (5.0, "usingen", 1)
    assert (strict.shift_hz, strict.estimator) == (channels.shift_hz, "none")
    assert strict.sum_snr_db == pytest.approx(snr_db)
    np.testing.assert_array_equal(strict.projections, frame.steering)
    np.testing.assert_allclose(strict.covariance, receiver.params.prior_sigma**2 * np.eye(2), rtol=1e-12)


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


@pytest.mark.parametrize(
    ("changes", "mask"),
    [({}, True), ({"failed": "3:5, 12:14"}, False), ({"taper_edge": 0.9}, False), ({"phase_bits": 4}, False)],
)
def test_each_departure_from_the_uniform_aperture_is_inverted_with_its_weights(
    changes: dict[str, object], mask: bool
) -> None:
    array = TripulseArrayParams(n_x=12, n_y=14, **changes)  # type: ignore[arg-type]
    failed = np.zeros((12, 14), dtype=bool) if mask else None
    if failed is not None:
        failed[2, 4] = failed[11, 13] = True
    receiver = TripulseReceiver(array=array, signal=SIGNALS["two_tone"], failed=failed)
    steering, error = np.array([0.081, -0.046]), np.array([0.4, -0.55]) * array.unambiguous_projection
    weights = element_weights(array, steering, failed=failed)
    beams = beam_signals(array, weights, steering + error).conj()
    found, _ = receiver._from_ratio(steering, beams, np.full(3, 1e-4))
    np.testing.assert_allclose(found, error, atol=1e-9)
    with pytest.raises(ValueError, match=r"sum SNR is below 12\.0 dB: too low for a non-uniform aperture"):
        receiver._from_posterior(_Detected(values=np.ones(24) + 0j, noise_variance=1.0, lost=""), beams, np.ones(3))


@pytest.mark.parametrize("scheme", ["two_tone", "interleaved"])
def test_the_posterior_is_that_of_the_frame_or_of_each_cycle_in_the_papers_convention(scheme: str) -> None:
    """Two tones leave one phase for the frame; without references every cycle has its own."""
    signal = SIGNALS[scheme]
    receiver, rng = TripulseReceiver(array=ARRAY, signal=signal), random_stream(9, "posterior")
    plan, error = segment_beams(signal), np.array([6e-4, -4e-4])
    clean = closed_form_signals(ARRAY, error).conj()[plan]
    values = clean + 200.0 * rng.normal(size=(len(plan), 2)) @ [1.0, 1j]
    noise = 2.0 * 200.0**2
    found = _Detected(values=values, noise_variance=noise, lost="")
    beams, noises = receiver._beam_means(found)
    np.testing.assert_allclose(beams, [np.mean(values[plan == beam]) for beam in range(3)])
    counts = np.bincount(plan)
    np.testing.assert_allclose(noises, noise / counts)
    if scheme == "two_tone":
        signals, variances = beams[None, :], noises
    else:
        # S x S y, eight times.
        rows = values.reshape(8, 4)
        signals = np.stack([0.5 * (rows[:, 0] + rows[:, 2]), rows[:, 1], rows[:, 3]], axis=1)
        variances = noise * np.array([0.5, 1.0, 1.0])
    prior = np.full(2, receiver.params.prior_sigma)
    expected = posterior_projection_error(
        ARRAY, signal_matrix(signals.conj(), variances), len(signals), variances, prior
    )
    mean, covariance = receiver._from_posterior(found, beams, noises)
    np.testing.assert_allclose(mean, expected.projection_error, rtol=1e-9)
    np.testing.assert_allclose(covariance, expected.covariance, rtol=1e-9)


def test_the_level_is_the_sum_beam_over_the_references_or_the_link() -> None:
    channels = Channels(
        tone=np.ones(3) + 0j,
        lower_reference=np.array([2.0, 2.0j, 50.0]),
        upper_reference=np.array([-8.0, 8.0, 0.1]),
        noise_density=1.0,
        shift_hz=0.0,
    )
    # The references are 4 on average and 43 dB above an element: 12 is 3 of them.
    receiver = TripulseReceiver(array=ARRAY, signal=SIGNALS["two_tone"])
    assert receiver._level(channels, 12.0j, 0.0) == pytest.approx(3.0 * 10.0 ** (43.0 / 20.0))
    # 320 us of sum segments: 30 dB are 64.95 dB Hz, 27.95 dB above an element's 37.
    alone = TripulseReceiver(array=ARRAY, signal=SIGNALS["interleaved"])
    beam_s = alone.signal.beam_time_s(0)
    assert alone._level(channels, 12.0j, 30.0) == pytest.approx(math.sqrt(1e3 / beam_s / 10.0**3.7))


@pytest.mark.parametrize("pattern", ["SxSy", "xSyS"])
def test_segments_are_turned_back_by_the_phase_of_the_sum_segments_alone(pattern: str) -> None:
    """A tone at 300 Hz without noise: real beams stay real, those before the first sum segment nearly so."""
    signal = TripulseSignalParams(scheme="interleaved", pattern=pattern, cycles=40)
    receiver = TripulseReceiver(array=ARRAY, signal=signal)
    plan, times = segment_beams(signal), segment_times_s(signal)
    tone = np.array([5.0, 0.7, -0.4])[plan] * np.exp(1j * (0.4 + 2.0 * np.pi * 300.0 * times))
    found = receiver._track(tone, 1e-4)
    assert (found.lost, found.noise_variance) == ("", 1e-4)
    np.testing.assert_allclose(found.values, np.array([5.0, 0.7, -0.4])[plan], atol=0.2)
    np.testing.assert_allclose(found.values[40:], np.array([5.0, 0.7, -0.4])[plan][40:], atol=0.02)
    # A slip of half a turn ends it; what comes after is not used.
    slipped = tone * np.where(np.arange(len(plan)) < 81, 1.0, -1.0)
    assert "lost lock at" in receiver._track(slipped, 1e-4).lost


@pytest.mark.parametrize(("fraction", "largest_db"), [(0.75, 2.218), (0.5, 4.771), (0.6, 3.680)])
def test_the_tolerance_of_the_level_is_at_most_half_the_step_to_the_next_period(
    fraction: float, largest_db: float
) -> None:
    """u is |u| / (2 - |u|) of the peak one period away: 10 log10((2 - u) / u) dB is half of that step."""
    TripulseReceiverParams(largest_error_fraction=fraction, level_tolerance_db=largest_db - 0.002)
    with pytest.raises(ValueError, match=f"half the step to the next period at largest_error_fraction={fraction}"):
        TripulseReceiverParams(largest_error_fraction=fraction, level_tolerance_db=largest_db + 0.002)
