"""Noise whose density is planted, in reports of any length."""

import numpy as np
import pytest

from rf_pointing.receiver.noise import NoiseDensity

BINS = 100_000


@pytest.mark.parametrize("blocks", [1, 2, 3, 5, 10, 40])
def test_the_density_of_a_report_does_not_depend_on_its_length_and_leaves_lines_out(
    blocks: int, random: np.random.Generator
) -> None:
    power = random.gamma(blocks, 1.0 / blocks, BINS).astype(np.float32)
    power[::1000] += 1000.0
    density = NoiseDensity(1.0)
    found = density.take(power, np.ones(BINS, dtype=bool), blocks)
    assert found == pytest.approx(1.0, abs=5.0 / np.sqrt(BINS * blocks) + 2e-4)


def test_a_report_that_is_cut_short_is_no_step_of_the_gain(random: np.random.Generator) -> None:
    density = NoiseDensity(20.0)
    for blocks in (1, 10, 10, 2, 10, 1, 10):
        density.take(random.gamma(blocks, 1.0 / blocks, 2000).astype(np.float32), np.ones(2000, dtype=bool), blocks)
    assert density.steps == 0
