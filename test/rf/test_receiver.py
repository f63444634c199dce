"""Receiver samples: their mean, their noise, and what the receiver says of itself."""

import copy
import math

import numpy as np
import pytest

from rf_pointing.core import MDEG, MonopulseCluster, random_stream
from rf_pointing.rf import Beam, BeamParams, MonopulseFeed, MonopulseFeedParams, Receiver, ReceiverParams
from rf_pointing.rf.noise import BOLTZMANN_J_K
from rf_pointing.rf.receiver import ReceiverState, noise_variance

SAMPLE_S = 0.02
BEAM = BeamParams.for_band("Ka")


def make_receiver(name: str = "receiver", **changes: float) -> Receiver:
    feed = MonopulseFeed(MonopulseFeedParams(), BEAM)
    return Receiver(ReceiverParams(**changes), Beam(BEAM), feed, random_stream(7, name))


def take(
    receiver: Receiver, index: int, level_db_hz: float, x: float = 0.0, y: float = 0.0, count: int = 5
) -> MonopulseCluster:
    times = 100.0 + (index * count + np.arange(count)) * SAMPLE_S
    return receiver.cluster(times, np.full(count, x), np.full(count, y), level_db_hz, SAMPLE_S)


@pytest.mark.parametrize("level_db_hz", [35.0, 45.0, 60.0])
def test_receiver_measures_its_own_carrier_to_noise(level_db_hz: float) -> None:
    receiver = make_receiver()
    measured = [take(receiver, k, level_db_hz).carrier_to_noise_db_hz for k in range(400)]
    # 400 clusters: the mean is known to 0.05 dB, the noise average settles within 0.3 dB.
    assert np.mean(measured[100:]) == pytest.approx(level_db_hz, abs=0.3)


class Louder:
    """Noise of ten times the power that the receiver takes it for."""

    def __init__(self) -> None:
        self.random = random_stream(7, "louder")

    def standard_normal(self, size: object = None) -> object:
        return math.sqrt(10.0) * np.asarray(self.random.standard_normal(size))


def test_ten_times_the_noise_lowers_the_measured_carrier_to_noise_by_10_db() -> None:
    receiver = make_receiver(phase_noise_rad=0.0)
    receiver.rng = Louder()  # type: ignore[assignment]
    measured = [take(receiver, k, 55.0).carrier_to_noise_db_hz for k in range(300)]
    assert np.mean(measured[100:]) == pytest.approx(45.0, abs=0.3)


def test_pattern_loss_lowers_the_measured_carrier_to_noise_by_3_db_at_half_the_beamwidth() -> None:
    receiver = make_receiver()
    measured = [take(receiver, k, 55.0, 8.5 * MDEG).carrier_to_noise_db_hz for k in range(300)]
    assert np.mean(measured[100:]) == pytest.approx(52.0, abs=0.3)


def test_without_carrier_the_receiver_reports_next_to_nothing() -> None:
    receiver = make_receiver()
    measured = np.array([take(receiver, k, -math.inf).carrier_to_noise_db_hz for k in range(400)])
    # The power of 5 noise samples exceeds its mean 50 Hz by more than 66 Hz (18.2 dB) in 1 % of clusters.
    assert np.quantile(measured[50:], 0.99) == pytest.approx(18.2, abs=0.7)
    assert measured.min() >= ReceiverParams().floor_db_hz


def test_channel_noise_is_complex_white_and_equal_to_n0_over_sample_time() -> None:
    receiver = make_receiver(phase_noise_rad=0.0, frequency_offset_hz=0.0)
    samples = take(receiver, 0, 40.0, count=10_000)
    # With the beam on the target the differences are noise alone; in units of the sum their power is 1/snr.
    noise, other = (
        channel / np.abs(np.mean(samples.sum))
        for channel in (samples.difference_elevation, samples.difference_cross_elevation)
    )
    expected = 1.0 / (1e4 * SAMPLE_S)
    # 10 000 samples know a power to 1 % and a correlation to 1 %.
    assert np.mean(np.abs(noise) ** 2) == pytest.approx(expected, rel=0.04)
    assert np.mean(noise.real**2) == pytest.approx(np.mean(noise.imag**2), rel=0.06)
    assert abs(np.mean(noise[1:] * np.conj(noise[:-1]))) < 0.04 * expected
    assert abs(np.mean(noise * np.conj(other))) < 0.04 * expected


def test_the_gain_moves_by_the_time_constant_from_the_first_cluster_on() -> None:
    """From 120 to 100 dB-Hz, clusters of 0.1 s, a gain of 0.5 s: 20 dB too little fade by exp(-0.2) a cluster."""
    receiver = make_receiver(frequency_offset_hz=0.0, phase_noise_rad=0.0)
    # The carrier begins at phase zero: the sum is real.
    before = [float(np.mean(take(receiver, k, 120.0).sum.real)) for k in range(3)]
    assert before == pytest.approx([1.0] * 3, abs=1e-4)
    after = [float(np.mean(take(receiver, 3 + k, 100.0).sum.real)) for k in range(8)]
    expected = [-20.0 * math.exp(-0.2 * k) for k in range(8)]
    assert 20.0 * np.log10(after) == pytest.approx(expected, abs=0.01)


def test_the_carriers_phase_goes_on_from_cluster_to_cluster_over_many_turns() -> None:
    """3 Hz, clusters 0.1 s apart and a gap of 0.55 s: the phase is that of the time since the first sample."""
    receiver = make_receiver(frequency_offset_hz=3.0, phase_noise_rad=0.0)
    for index in (0, 1, 2, 8, 9, 30):
        cluster = take(receiver, index, 100.0)
        expected = np.exp(6j * math.pi * (cluster.t_s - 100.0))
        np.testing.assert_allclose(cluster.sum / np.abs(cluster.sum), expected, atol=1e-3)


def test_the_phase_walks_by_its_sigma_in_a_second_and_by_the_root_of_the_time() -> None:
    receiver = make_receiver(frequency_offset_hz=0.0, phase_noise_rad=0.2)
    phase = np.unwrap(np.angle([np.mean(take(receiver, 5 * k, 110.0, count=3).sum) for k in range(1500)]))
    # Clusters of three samples, 0.3 s from each to the next: less 4/9 of a sample by their mean.
    steps = np.diff(phase) / math.sqrt(0.3 - SAMPLE_S * 4.0 / 9.0)
    assert np.std(steps) == pytest.approx(0.2, rel=0.08)
    # Normal: none of 1500 is beyond 5 sigma.
    assert np.max(np.abs(steps)) < 1.0


def test_noisier_differences_are_noisier_and_do_not_count_for_the_sum() -> None:
    receiver = make_receiver(difference_noise_db=6.0, phase_noise_rad=0.0, frequency_offset_hz=0.0)
    samples = take(receiver, 0, 40.0, count=10_000)
    size = np.abs(np.mean(samples.sum))
    for channel in (samples.difference_cross_elevation, samples.difference_elevation):
        assert np.mean(np.abs(channel / size) ** 2) * 1e4 * SAMPLE_S == pytest.approx(10.0**0.6, rel=0.05)
    assert samples.carrier_to_noise_db_hz == pytest.approx(40.0, abs=0.3)


def test_the_first_clusters_count_alike_in_the_noise() -> None:
    """Noise of 10, 1 and 1 times what it was: 10, 5.5 and 4 on average, in clusters long enough to tell it to 2 %."""
    receiver, seen = make_receiver(noise_time_constant_s=1000.0), []
    for index, louder in enumerate((True, False, False)):
        receiver.rng = Louder() if louder else random_stream(8, "quiet")  # type: ignore[assignment]
        seen.append(take(receiver, index, 60.0, count=2000).carrier_to_noise_db_hz)
    assert seen == pytest.approx([50.0, 60.0 - 10.0 * math.log10(5.5), 60.0 - 10.0 * math.log10(4.0)], abs=0.25)


def test_the_noise_follows_within_its_time_constant() -> None:
    """Once the noise is ten times as large: 1 + 9 (1 - exp(-t / 10 s)), clusters of 4 s."""
    receiver = make_receiver()
    for index in range(10):
        take(receiver, index, 60.0, count=200)
    receiver.rng = Louder()  # type: ignore[assignment]
    seen = np.array([take(receiver, index, 60.0, count=200).carrier_to_noise_db_hz for index in range(10, 15)])
    average = 1.0 + 9.0 * (1.0 - np.exp(-0.4 * np.arange(1, 6)))
    np.testing.assert_allclose(seen, 60.0 - 10.0 * np.log10(average), atol=0.4)


class Swinging:
    """A feed whose ratio of difference to sum is a cubic of time within a cluster."""

    def voltages(self, x: np.ndarray, _y: np.ndarray) -> tuple[np.ndarray, ...]:
        part = np.linspace(-1.0, 1.0, len(x))
        ratio = 0.01 * (part**3 - 0.3 * part**2 + 0.2)
        return np.ones(len(x), dtype=complex), ratio.astype(complex), (-0.5j * ratio)


@pytest.mark.parametrize(("count", "clusters"), [(5, 1500), (6, 1000), (9, 300)])
def test_a_beam_that_swings_as_a_cubic_in_every_cluster_is_no_noise_at_all(count: int, clusters: int) -> None:
    """The straight line leaves a hundred thousand times the noise: what counts is the quartile of the cubic's rest."""
    receiver = make_receiver(phase_noise_rad=0.0)
    receiver.feed = Swinging()  # type: ignore[assignment]
    measured = [take(receiver, k, 100.0, count=count).carrier_to_noise_db_hz for k in range(clusters)]
    assert np.mean(measured[20:]) == pytest.approx(100.0, abs=0.3)
    # Before the twentieth cluster there is only the average, which takes the swing for noise.
    assert max(measured[:19]) < 80.0
    assert measured[19] > 95.0


def test_the_noise_of_the_sum_counts_as_much_as_it_is_in_a_difference() -> None:
    """Ratios of 0.7 - 0.4j and -1.1j under a strong carrier: noise of both channels is left, and it is counted once."""
    parts = random_stream(5, "ratio").standard_normal((2, 3, 4000))
    noise = math.sqrt(1.5) * (parts[0] + 1j * parts[1])
    channels = 300.0 * np.array([1.0, 0.7 - 0.4j, -1.1j])[:, None] + noise
    assert noise_variance(channels, 1) == pytest.approx(3.0, rel=0.04)


def test_carrier_phase_rotates_all_channels_together() -> None:
    receiver = make_receiver(frequency_offset_hz=0.5, phase_noise_rad=0.0)
    first, later = take(receiver, 0, 90.0, 4.0 * MDEG), take(receiver, 5, 90.0, 4.0 * MDEG)
    turned = np.angle(np.mean(later.sum) / np.mean(first.sum))
    # 25 samples of 20 ms at 0.5 Hz: a quarter turn.
    assert turned == pytest.approx(0.5 * math.pi, abs=1e-3)
    ratio = later.difference_cross_elevation / later.sum
    assert ratio == pytest.approx(np.full(5, np.tanh(1.57 * 4.0 / 17.0) + 0j), abs=1e-3)


def test_carrier_power_has_the_block_v_mean_and_variance() -> None:
    receiver = make_receiver(noise_bandwidth_hz=1e9)
    noise_w_hz = BOLTZMANN_J_K * ReceiverParams().system_noise_k
    x = 3.0 * MDEG
    got = [receiver.carrier_power(k + 1.0, 1.0, x, 0.0, 30.0) for k in range(8000)]
    power = np.array([p.power_w for p in got]) / noise_w_hz
    expected = 1000.0 * math.exp(-4.0 * math.log(2.0) * (3.0 / 17.0) ** 2)
    assert power.mean() == pytest.approx(expected, rel=0.002)
    # B-3: variance 2 Pc/N0 for 1 s; 8000 samples know it to 1.6 %.
    assert power.var() == pytest.approx(2.0 * expected, rel=0.06)
    assert np.mean([p.sigma_w for p in got]) / noise_w_hz == pytest.approx(math.sqrt(2.0 * expected), rel=0.01)


def test_noise_power_uncertainty_adds_as_in_b_2() -> None:
    receiver = make_receiver(noise_bandwidth_hz=1e4)
    got = [receiver.carrier_power(k + 1.0, 1.0, 0.0, 0.0, 50.0) for k in range(8000)]
    power = np.array([p.power_w for p in got])
    # (B-2) at 50 dB-Hz: noise power 1e-4 dominates the 2e-5 of the carrier.
    assert power.var() / power.mean() ** 2 == pytest.approx(1.2e-4, rel=0.06)
    assert np.mean([p.sigma_w for p in got]) / power.mean() == pytest.approx(math.sqrt(1.2e-4), rel=0.02)


def test_carrier_power_of_no_carrier_is_small_and_never_negative() -> None:
    receiver = make_receiver()
    got = [receiver.carrier_power(k + 1.0, 1.0, 0.0, 0.0, -math.inf) for k in range(1000)]
    assert min(p.power_w for p in got) >= 0.0
    assert max(p.carrier_to_noise_db_hz for p in got) < 10.0
    assert min(p.sigma_w for p in got) > 0.0


def test_noise_alone_reads_zero_as_often_as_a_normal_number_is_within_its_sigma() -> None:
    """P(|z| < 1) = 0.6827; there the sigma is that of a product of two independent numbers (Goodman 1960)."""
    integration_s, bandwidth_hz = 0.05, 100.0
    receiver = make_receiver("noise alone", noise_bandwidth_hz=bandwidth_hz)
    got = [receiver.carrier_power(k + 1.0, integration_s, 0.0, 0.0, -math.inf) for k in range(8000)]
    zero = np.array([p.power_w == 0.0 for p in got])
    assert np.mean(zero) == pytest.approx(0.6827, abs=0.02)
    noise_w_hz = BOLTZMANN_J_K * ReceiverParams().system_noise_k
    variance = np.mean(np.square([p.sigma_w for p in got])[zero]) / noise_w_hz**2
    # The measured noise density has the relative variance 1 / (B T), once in itself and once beside the mean.
    wanted = 0.5 / integration_s**2 * (1.0 + 2.0 / (bandwidth_hz * integration_s))
    assert variance == pytest.approx(wanted, rel=0.03)


def test_the_noise_of_channels_without_a_carrier_is_counted_whole() -> None:
    """Complex noise of variance 3 in clusters of 5: two values of order 1 are fitted, and three are left."""
    parts = random_stream(3, "channels").standard_normal((2, 4000, 3, 5))
    channels = math.sqrt(1.5) * (parts[0] + 1j * parts[1])
    assert np.mean([noise_variance(each, 1) for each in channels]) == pytest.approx(3.0, rel=0.03)


@pytest.mark.parametrize("count", [3, 4])
def test_few_samples_leave_one_for_the_noise_whatever_the_order(count: int) -> None:
    parts = random_stream(4, "few").standard_normal((2, 4000, 3, count))
    channels = math.sqrt(1.5) * (parts[0] + 1j * parts[1])
    channels[:, 0] += 1000.0
    assert np.mean([noise_variance(each, 3) for each in channels]) == pytest.approx(3.0, rel=0.06)


@pytest.mark.parametrize("seconds", [0.0, -1.0, math.nan])
def test_an_integration_that_takes_no_time_is_refused(seconds: float) -> None:
    times = np.array([100.0, 100.1, 100.2])
    with pytest.raises(ValueError, match="sample_s="):
        make_receiver().cluster(times, np.zeros(3), np.zeros(3), 45.0, seconds)
    with pytest.raises(ValueError, match="integration_s="):
        make_receiver().carrier_power(100.0, seconds, 0.0, 0.0, 45.0)


def test_copied_state_and_generator_continue_identically() -> None:
    receiver = make_receiver()
    for k in range(3):
        take(receiver, k, 45.0)
    twin = make_receiver()
    twin.state, twin.rng = copy.deepcopy(receiver.state), copy.deepcopy(receiver.rng)
    mine, other = take(receiver, 3, 45.0, MDEG), take(twin, 3, 45.0, MDEG)
    assert np.array_equal(mine.sum, other.sum)
    assert np.array_equal(mine.difference_elevation, other.difference_elevation)
    assert receiver.state == twin.state
    assert receiver.state != ReceiverState()


def test_time_that_does_not_advance_is_refused() -> None:
    receiver = make_receiver()
    take(receiver, 1, 45.0)
    with pytest.raises(ValueError, match="t_s must increase"):
        take(receiver, 0, 45.0)


@pytest.mark.parametrize("times", [(100.0, 100.0, 100.1), (100.0, 100.1, 100.1)])
def test_two_samples_of_one_time_are_refused(times: tuple[float, ...]) -> None:
    with pytest.raises(ValueError, match="t_s must increase"):
        make_receiver().cluster(times, np.zeros(3), np.zeros(3), 45.0, SAMPLE_S)


def test_two_samples_are_refused() -> None:
    with pytest.raises(ValueError, match="t_s has 2 samples, must have at least 3"):
        take(make_receiver(), 0, 45.0, count=2)


def test_carrier_level_that_is_no_number_is_refused() -> None:
    with pytest.raises(ValueError, match="carrier_to_noise_db_hz=nan must be"):
        take(make_receiver(), 0, math.nan)
    with pytest.raises(ValueError, match=r"carrier_to_noise_db_hz=201\.0 must be <= 200"):
        take(make_receiver(), 0, 201.0)


def test_a_level_below_0_db_hz_is_reported_where_the_floor_is_lower() -> None:
    """Half a hertz over 1000 s: known to 6 %."""
    seen = make_receiver(floor_db_hz=-20.0).carrier_power(2000.0, 1000.0, 0.0, 0.0, -3.0103).carrier_to_noise_db_hz
    assert seen == pytest.approx(-3.0, abs=1.0)
    assert make_receiver().carrier_power(2000.0, 1000.0, 0.0, 0.0, -3.0103).carrier_to_noise_db_hz == 0.0


@pytest.mark.parametrize("level_db_hz", [60.0, 75.0, 90.0, 105.0, 120.0])
def test_vibration_of_the_beam_is_no_noise_of_a_strong_carrier(level_db_hz: float) -> None:
    """A beam that vibrates by 0.3 mdeg at 1.7 Hz, seen from 60 to 120 dB-Hz."""
    receiver, measured = make_receiver("vibration"), []
    for index in range(150):
        times = 100.0 + (index * 5 + np.arange(5)) * SAMPLE_S
        x = 0.3 * MDEG * np.sin(2.0 * np.pi * 1.7 * times)
        cluster = receiver.cluster(times, x, 0.5 * x, level_db_hz, SAMPLE_S)
        measured.append(cluster.carrier_to_noise_db_hz)
    # Up to 3 dB of vibration stay in the precise average.
    assert np.mean(measured[-50:]) == pytest.approx(level_db_hz, abs=3.2)


def test_a_sweep_across_the_nulls_does_not_raise_the_noise_of_a_strong_carrier() -> None:
    """Two seconds of a search at 150 mdeg/s over an aperture with nulls, then on the target: 20 dB too low before."""
    beam = BeamParams.for_band("X", "uniform")
    feed = MonopulseFeed(MonopulseFeedParams(), beam)
    receiver = Receiver(ReceiverParams(), feed, feed, random_stream(7, "sweep"))
    for index in range(60):
        times = 100.0 + (index * 5 + np.arange(5)) * SAMPLE_S
        swept = (times - 104.0) * 150.0 * MDEG if index >= 40 else np.full(5, 0.2 * MDEG)
        level = receiver.cluster(times, swept, 0.7 * swept, 85.0, SAMPLE_S).carrier_to_noise_db_hz
    times = 106.0 + np.arange(5) * SAMPLE_S
    level = receiver.cluster(times, np.zeros(5), np.zeros(5), 85.0, SAMPLE_S).carrier_to_noise_db_hz
    assert level == pytest.approx(85.0, abs=3.5)


def test_the_noise_of_the_last_hundred_clusters_is_kept() -> None:
    receiver, kept = make_receiver(), []
    for index in range(130):
        take(receiver, index, 60.0)
        kept.append(receiver.state.still_densities[-1])
        assert receiver.state.still_densities == tuple(kept[-100:])
    assert receiver.state.clusters == 130
