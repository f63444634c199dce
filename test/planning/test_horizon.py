"""The mask of the horizon: heights between its points, what a recording keeps, where passes begin."""

import math

import numpy as np
import pytest

from rf_pointing.planning import HorizonMask
from rf_pointing.planning.horizon import horizon_from_notes, horizon_to_notes

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


def test_a_recording_keeps_the_hills_and_nothing_of_a_flat_horizon(random: np.random.Generator) -> None:
    azimuth, elevation = np.sort(random.uniform(0.0, 6.2, 50)), random.uniform(-0.1, 1.4, 50)
    mask = HorizonMask(azimuth_rad=tuple(azimuth), elevation_rad=tuple(elevation))
    around = np.linspace(0.0, 7.0, 100)
    back = horizon_from_notes(horizon_to_notes(mask) | {"station": "Dish"})
    assert back is not None
    assert back.lowest_all(around) == pytest.approx(mask.lowest_all(around), abs=1e-3)
    assert horizon_from_notes(horizon_to_notes(HorizonMask())) is None
    assert horizon_to_notes(HorizonMask()) == {}


def test_passes_begin_clear_of_the_horizon_and_above_the_least_elevation(random: np.random.Generator) -> None:
    azimuths = random.uniform(-10.0, 10.0, 500)
    clear = MASK.replace(clearance_rad=0.02).above(0.1)(azimuths)
    np.testing.assert_allclose(clear, np.maximum(MASK.lowest_all(azimuths) + 0.02, 0.1), atol=1e-12)
    with pytest.raises(ValueError, match="clearance_rad"):
        MASK.replace(clearance_rad=0.0)


def test_a_turn_of_the_horizons_points_is_refused_and_a_little_less_is_not() -> None:
    HorizonMask(azimuth_rad=(1.0, 6.0), elevation_rad=(0.0, 0.0))
    for azimuths in ((0.0, 2.0 * math.pi), (1.0, 1.0), (1.0, 0.5)):
        with pytest.raises(ValueError, match="must rise from point to point within one turn"):
            HorizonMask(azimuth_rad=azimuths, elevation_rad=(0.0, 0.0))
    with pytest.raises(ValueError, match="the same number"):
        HorizonMask(azimuth_rad=(1.0, 2.0), elevation_rad=(0.0,))
    with pytest.raises(ValueError, match="has 0 points"):
        HorizonMask(azimuth_rad=(), elevation_rad=())
