"""The horizon between its surveyed points, on every turn."""

import math

import numpy as np
import pytest

from rf_pointing.planning import HorizonMask

MASK = HorizonMask(azimuth_rad=(0.5, 2.0, 5.0), elevation_rad=(0.1, 0.3, 0.05))


@pytest.mark.parametrize("turns", [-2, 0, 1])
@pytest.mark.parametrize(
    ("azimuth", "height"),
    [(0.5, 0.1), (1.25, 0.2), (3.5, 0.175), (5.0, 0.05), (5.0 + 0.5 * (2 * math.pi - 4.5), 0.075)],
)
def test_heights_lie_on_straight_lines_closed_over_north(azimuth: float, height: float, turns: int) -> None:
    assert MASK.lowest_rad(azimuth + 2.0 * math.pi * turns) == pytest.approx(height)


def test_one_azimuth_and_many_agree(random: np.random.Generator) -> None:
    azimuths = random.uniform(-10.0, 10.0, 500)
    np.testing.assert_allclose(MASK.lowest_all(azimuths), [MASK.lowest_rad(a) for a in azimuths.tolist()], atol=1e-12)


def test_a_horizon_that_turns_back_is_refused() -> None:
    with pytest.raises(ValueError, match="must rise"):
        HorizonMask(azimuth_rad=(1.0, 0.5), elevation_rad=(0.0, 0.0))
    with pytest.raises(ValueError, match="the same number"):
        HorizonMask(azimuth_rad=(1.0, 2.0), elevation_rad=(0.0,))


def test_passes_begin_clear_of_the_horizon_and_above_the_least_elevation(random: np.random.Generator) -> None:
    azimuths = random.uniform(-10.0, 10.0, 500)
    clear = MASK.replace(clearance_rad=0.02).above(0.1)(azimuths)
    np.testing.assert_allclose(clear, np.maximum(MASK.lowest_all(azimuths) + 0.02, 0.1), atol=1e-12)
    with pytest.raises(ValueError, match="clearance_rad"):
        MASK.replace(clearance_rad=0.0)
