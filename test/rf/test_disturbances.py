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


def test_level_is_gone_inside_a_dropout_and_untouched_outside() -> None:
    drops = Dropouts(DropoutParams(count=1), 0.0, 100.0, random_stream(1, "dropouts"))
    inside, outside = 0.5 * (drops.start_s[0] + drops.stop_s[0]), drops.stop_s[0]
    assert drops.level_db_hz([inside, outside], 45.0).tolist() == [-math.inf, 45.0]


def test_no_dropouts_leave_everything_as_it_is() -> None:
    drops = Dropouts(DropoutParams(count=0), 0.0, 100.0, random_stream(1, "dropouts"))
    assert drops.level_db_hz(np.arange(5.0), 45.0).tolist() == [45.0] * 5


def test_more_dropouts_than_time_are_refused() -> None:
    with pytest.raises(ValueError, match=r"count=10 dropouts need .* s more"):
        Dropouts(DropoutParams(), 0.0, 60.0, random_stream(1, "dropouts"))


def test_spin_keeps_the_mean_power_and_has_its_depth() -> None:
    times = np.arange(0.0, 24.0, 0.01)
    gain = 10.0 ** (spin_gain_db(SpinParams(period_s=12.0, depth=0.3, phase_rad=0.7), times) / 10.0)
    assert gain.mean() == pytest.approx(1.0, abs=1e-9)
    assert gain.max() == pytest.approx(1.3, abs=1e-5)
    assert gain.min() == pytest.approx(0.7, abs=1e-5)


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


def test_line_at_a_multiple_of_the_power_integration_is_not_seen_in_the_power() -> None:
    clean, disturbed = (
        receiver(line).carrier_power(1.0, 1.0, 0.0, 0.0, 50.0).power_w
        for line in (None, InterferenceParams(level_db_hz=40.0, frequency_offset_hz=3.0))
    )
    assert disturbed == pytest.approx(clean, rel=1e-9)


def test_line_close_to_the_carrier_moves_the_power() -> None:
    line = InterferenceParams(level_db_hz=40.0, frequency_offset_hz=0.1)
    powers = [receiver(line).carrier_power(t, 1.0, 0.0, 0.0, 50.0).power_w for t in np.arange(1.0, 11.0)]
    assert np.std(powers) / np.mean(powers) > 0.3


def test_one_ratio_for_two_axes_is_refused() -> None:
    with pytest.raises(ValueError, match="must have 2 values"):
        InterferenceParams(difference_ratio=(1.0,))  # type: ignore[arg-type]


def test_beam_offset_does_not_change_the_line() -> None:
    line = InterferenceParams(level_db_hz=80.0)
    times = np.arange(1, 6) * 0.02
    on, off = (receiver(line).cluster(times, np.full(5, x), np.zeros(5), -math.inf, 0.02) for x in (0.0, 5.0 * MDEG))
    assert on.difference_elevation == pytest.approx(off.difference_elevation, rel=1e-9)
