"""Dropouts, spin and interference as the receiver sees them."""

import math

import numpy as np
import pytest

from rf_pointing.core import MDEG, random_stream
from rf_pointing.rf import (
    Beam,
    BeamParams,
    DropoutParams,
    Dropouts,
    InterferenceParams,
    MonopulseFeed,
    MonopulseFeedParams,
    Receiver,
    ReceiverParams,
    SpinParams,
    spin_gain_db,
)
from rf_pointing.rf.disturbances import interference_volts


@pytest.mark.parametrize("seed", range(5))
def test_dropouts_lie_in_the_interval_apart_and_within_their_lengths(seed: int) -> None:
    drops = Dropouts(DropoutParams(), 1000.0, 1600.0, random_stream(seed, "dropouts"))
    lengths = drops.stop_s - drops.start_s
    assert len(lengths) == 10
    assert lengths.min() >= 0.5
    assert lengths.max() <= 20.0
    assert np.all(drops.start_s[1:] - drops.stop_s[:-1] >= 5.0 - 1e-9)
    assert drops.start_s[0] >= 1005.0
    assert drops.stop_s[-1] <= 1595.0 + 1e-9


def test_dropouts_that_just_fit_stand_at_their_gaps() -> None:
    """Three of 2 s and four gaps of 5 s fill 26 s; in a second less they have no room."""
    params = DropoutParams(count=3, shortest_s=2.0, longest_s=2.0, gap_s=5.0)
    drops = Dropouts(params, 100.0, 126.0, random_stream(1, "dropouts"))
    np.testing.assert_allclose(drops.start_s, [105.0, 112.0, 119.0], rtol=1e-14)
    np.testing.assert_allclose(drops.stop_s, [107.0, 114.0, 121.0], rtol=1e-14)
    with pytest.raises(ValueError, match=r"count=3 dropouts need 1\.0 s more"):
        Dropouts(params, 100.0, 125.0, random_stream(1, "dropouts"))


def test_what_is_free_is_shared_evenly_among_the_gaps() -> None:
    """Sorted cuts of 74 s of free time: on average a quarter of it before each of three dropouts."""
    params = DropoutParams(count=3, shortest_s=2.0, longest_s=2.0, gap_s=5.0)
    random = random_stream(1, "dropouts")
    starts = np.mean([Dropouts(params, 0.0, 100.0, random).start_s for _ in range(2000)], axis=0)
    # Each cut varies by 19 s: the mean of 2000 is known to 0.4 s.
    np.testing.assert_allclose(starts, np.array([5.0, 12.0, 19.0]) + 74.0 * np.array([0.25, 0.5, 0.75]), atol=1.5)


def test_the_level_is_gone_from_the_start_of_a_dropout_until_its_stop() -> None:
    drops = Dropouts(DropoutParams(count=2), 0.0, 100.0, random_stream(1, "dropouts"))
    assert drops.level_db_hz(drops.start_s[1], 45.0) == -math.inf
    assert drops.level_db_hz([0.0, drops.stop_s[1]], 45.0).tolist() == [45.0, 45.0]
    none = Dropouts(DropoutParams(count=0), 0.0, 100.0, random_stream(1, "dropouts"))
    assert none.level_db_hz(5.0, 45.0) == 45.0
    assert drops.level_db_hz(np.zeros((2, 3)), 45.0).shape == (2, 3)


def test_spin_keeps_the_mean_power_and_has_its_depth() -> None:
    times = np.arange(0.0, 24.0, 0.01)
    gain = 10.0 ** (spin_gain_db(SpinParams(period_s=12.0, depth=0.3, phase_rad=0.7), times) / 10.0)
    assert gain.mean() == pytest.approx(1.0, abs=1e-9)
    assert gain.max() == pytest.approx(1.3, abs=1e-5)
    assert gain.min() == pytest.approx(0.7, abs=1e-5)
    # 1 + 0.3 cos(0.7) at first, and a quarter turn of 3 s later 1 - 0.3 sin(0.7).
    np.testing.assert_allclose(gain[[0, 300]], [1.0 + 0.3 * math.cos(0.7), 1.0 - 0.3 * math.sin(0.7)], rtol=1e-12)


def receiver(interference: InterferenceParams | None) -> Receiver:
    beam = BeamParams.for_band("Ka")
    params = ReceiverParams(frequency_offset_hz=0.0, phase_noise_rad=0.0)
    return Receiver(
        params, Beam(beam), MonopulseFeed(MonopulseFeedParams(), beam), random_stream(3, "line"), interference
    )


def test_line_stands_in_all_channels_at_its_frequency_weakened_by_the_integration() -> None:
    line = InterferenceParams(level_db_hz=60.0, frequency_offset_hz=8.0, difference_ratio=(0.5, -1.0))
    samples = receiver(line).cluster(np.arange(1, 51) * 0.02, np.zeros(50), np.zeros(50), 70.0, 0.02)
    spectrum = np.abs(np.fft.fft([samples.sum, samples.difference_cross_elevation, samples.difference_elevation])) / 50
    carrier = spectrum[0, 0]
    weakened = np.sinc(8.0 * 0.02) * 10.0 ** ((60.0 - 70.0) / 20.0)
    assert spectrum[0, 8] / carrier == pytest.approx(weakened, rel=0.01)
    assert spectrum[1, 8] / carrier == pytest.approx(0.5 * weakened, rel=0.01)
    assert spectrum[2, 8] / carrier == pytest.approx(weakened, rel=0.01)


def test_a_sample_of_the_line_is_its_mean_over_the_sample() -> None:
    """By quadrature over the `sample_s` that end at the time of each sample."""
    line = InterferenceParams(level_db_hz=46.0, frequency_offset_hz=3.7, difference_ratio=(0.5, -1.2))
    times, sample_s = np.array([0.3, 1.0, 7.77]), 0.16
    node, weight = np.polynomial.legendre.leggauss(20)
    inside = times[:, None] + 0.5 * sample_s * (node - 1.0)
    mean = 0.5 * np.exp(2j * math.pi * 3.7 * inside) @ weight
    expected = 10.0**2.3 * np.array([1.0, 0.5, -1.2])[:, None] * mean
    np.testing.assert_allclose(interference_volts(line, times, sample_s), expected, rtol=1e-12)


def test_the_power_holds_the_line_of_the_sum_in_phase_with_the_carrier() -> None:
    """100 dB-Hz of carrier, 80 of a line at 0.1 Hz: (1e5 + 1e4 sinc(0.1) cos)^2, far above the noise."""
    line = InterferenceParams(level_db_hz=80.0, frequency_offset_hz=0.1)
    for t_s in (1.0, 2.5, 6.0):
        seen = receiver(line).carrier_power(t_s, 1.0, 0.0, 0.0, 100.0).carrier_to_noise_db_hz
        volts = 1e5 + 1e4 * math.sin(0.1 * math.pi) / (0.1 * math.pi) * math.cos(0.2 * math.pi * (t_s - 0.5))
        assert seen == pytest.approx(20.0 * math.log10(volts), abs=1e-3)


def test_beam_offset_does_not_change_the_line() -> None:
    line = InterferenceParams(level_db_hz=80.0)
    times = np.arange(1, 6) * 0.02
    on, off = (receiver(line).cluster(times, np.full(5, x), np.zeros(5), -math.inf, 0.02) for x in (0.0, 5.0 * MDEG))
    assert on.difference_elevation == pytest.approx(off.difference_elevation, rel=1e-9)
