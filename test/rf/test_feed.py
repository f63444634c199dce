"""Sum and difference voltages of squinted feeds."""

import numpy as np
import pytest

from rf_pointing.core import MDEG
from rf_pointing.rf import BeamParams, MonopulseFeed, MonopulseFeedParams

H = 65.0 * MDEG
PATTERNS = ("gaussian", "uniform", "tapered")


@pytest.mark.parametrize("pattern", PATTERNS)
@pytest.mark.parametrize("slope", [0.9, 1.57])
def test_sum_beamwidth_and_slope_are_the_ones_asked_for(pattern: str, slope: float) -> None:
    feed = MonopulseFeed(MonopulseFeedParams(slope=slope), BeamParams.for_band("X", pattern))
    assert feed.power_gain(0.5 * H, 0.0) == pytest.approx(0.5, abs=1e-9)
    step = 1e-4 * H
    volts = feed.voltages(np.array([-step, step]), np.zeros(2))
    ratio = (volts.difference_cross_elevation / volts.sum).real
    assert (ratio[1] - ratio[0]) / 2e-4 == pytest.approx(slope, rel=1e-6)


def test_gaussian_feed_is_the_hyperbolic_tangent_on_each_axis() -> None:
    feed = MonopulseFeed(MonopulseFeedParams(slope=1.3), BeamParams.for_band("X"))
    x, y = np.meshgrid(np.linspace(-60.0, 60.0, 9) * MDEG, np.linspace(-50.0, 55.0, 7) * MDEG)
    volts = feed.voltages(x, y)
    # Rounding of beams 100 dB down is all that separates the two forms.
    assert volts.difference_cross_elevation / volts.sum == pytest.approx(np.tanh(1.3 * x / H) + 0j, abs=1e-9)
    assert volts.difference_elevation / volts.sum == pytest.approx(np.tanh(1.3 * y / H) + 0j, abs=1e-9)


def test_imbalance_and_cross_talk_mix_the_differences_as_named() -> None:
    clean = MonopulseFeed(MonopulseFeedParams(), BeamParams.for_band("X"))
    params = MonopulseFeedParams(
        difference_gain_db=(2.0, -1.0), difference_phase_rad=(0.4, -0.7), cross_talk=(0.1, 0.05),
        cross_talk_phase_rad=(0.3, 1.1), sum_leakage=(0.02, 0.01),
        sum_leakage_phase_rad=(-0.2, 0.5),
    )  # fmt: skip
    x, y = 7.0 * MDEG, -12.0 * MDEG
    total, right, up = clean.voltages(x, y)
    mixed = MonopulseFeed(params, BeamParams.for_band("X")).voltages(x, y)
    gain_right, gain_up = 10.0**0.1 * np.exp(0.4j), 10.0**-0.05 * np.exp(-0.7j)
    expected = gain_right * (right + 0.1 * np.exp(0.3j) * up) + 0.02 * np.exp(-0.2j) * total
    assert mixed.difference_cross_elevation == pytest.approx(expected, abs=1e-12)
    expected = gain_up * (up + 0.05 * np.exp(1.1j) * right) + 0.01 * np.exp(0.5j) * total
    assert mixed.difference_elevation == pytest.approx(expected, abs=1e-12)
    assert mixed.sum == total


def test_aperture_feed_has_a_sidelobe_with_its_own_false_null() -> None:
    feed = MonopulseFeed(MonopulseFeedParams(), BeamParams.for_band("X", "uniform"))
    angle = np.linspace(70.0, 120.0, 501) * MDEG
    volts = feed.voltages(angle, np.zeros(501))
    ratio = (volts.difference_cross_elevation / volts.sum).real
    crossings = angle[:-1][(ratio[:-1] < 0.0) & (ratio[1:] > 0.0) & (np.abs(np.diff(ratio)) < 0.5)]
    assert len(crossings) == 1
    assert 10.0 * np.log10(feed.power_gain(crossings[0], 0.0)) < -13.0


@pytest.mark.parametrize("pattern", PATTERNS)
@pytest.mark.parametrize("slope", [0.1, 2.5])
def test_extreme_slopes_still_have_a_single_peaked_sum(pattern: str, slope: float) -> None:
    beam = BeamParams(pattern=pattern, edge_taper_db=40.0, taper_exponent=4)
    feed = MonopulseFeed(MonopulseFeedParams(slope=slope), beam)
    angle = np.linspace(0.0, 0.7, 50) * H
    assert np.all(np.diff(feed.power_gain(angle, 0.3 * angle)) < 0.0)
