"""The horizon between its surveyed points, on every turn."""

import math

import numpy as np
import pytest

from rf_pointing.planning import HorizonMask
from rf_pointing.planning.forbidden_sky import ForbiddenSky, angle_between
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


SUN, RADIUS = (1.0, 0.6), 0.05
HILLS = HorizonMask(azimuth_rad=(0.0, 0.9, 1.0, 1.1), elevation_rad=(0.1, 0.1, 0.3, 0.1))


@pytest.mark.parametrize(
    ("low", "high", "sun", "margin", "clear"),
    [
        (0.301, 1.5, None, 0.0, True),
        (0.299, 1.5, None, 0.0, False),
        (0.301, 1.58, None, 0.0, False),
        (0.301, 0.549, SUN, 0.0, True),
        (0.301, 0.551, SUN, 0.0, False),
        (0.301, 0.541, SUN, 0.01, False),
        (0.301, 0.539, SUN, 0.01, True),
        (0.651, 1.5, SUN, 0.0, True),
        (0.649, 1.5, SUN, 0.0, False),
        (0.659, 1.5, SUN, 0.01, False),
        (0.661, 1.5, SUN, 0.01, True),
        (0.301, 1.5, SUN, 0.0, False),
    ],
)
def test_elevations_above_all_hills_and_beside_the_sun_are_clear_at_every_azimuth(
    low: float, high: float, sun: tuple[float, float] | None, margin: float, clear: bool
) -> None:
    assert ForbiddenSky(HILLS, RADIUS).clear(low, high, sun, margin) is clear


@pytest.mark.parametrize(
    ("place", "present", "tolerance", "words"),
    [
        ((1.0, 0.31), None, 0.0, ""),
        ((1.0, 0.29), None, 0.0, "0.573 deg below the horizon mask"),
        ((1.0, 0.29), None, 0.011, ""),
        ((1.0, 0.29), None, 0.009, "below the horizon"),
        ((1.0, 0.29), (1.0, 0.28), 0.0, ""),
        ((1.0, 0.29), (1.0, 0.295), 0.0, "below the horizon"),
        ((1.0, 0.29), (1.0, 0.29 + 5e-10), 0.0, ""),
        ((1.0, 0.649), None, 0.0, "2.807 deg from the Sun, must be >= 2.865 deg"),
        ((1.0, 0.651), None, 0.0, ""),
        ((1.0, 0.645), None, 0.006, ""),
        ((1.0, 0.645), None, 0.004, "from the Sun"),
        ((1.0, 0.645), (1.0, 0.64), 0.0, ""),
        ((1.0, 0.645), (1.0, 0.648), 0.0, "from the Sun"),
        ((1.0, 0.645), (1.0, 0.645 + 5e-10), 0.0, ""),
        ((1.0, 0.549), None, 0.0, ""),
        ((1.07, 0.6), None, 0.0, ""),
        # Over the top it is the same direction.
        ((1.0 + math.pi, math.pi - 0.649), None, 0.0, "from the Sun"),
        ((1.0 + math.pi, math.pi - 0.29), None, 0.0, "below the horizon"),
        ((1.0 + math.pi, math.pi - 0.66), None, 0.0, ""),
    ],
)
def test_a_direction_is_forbidden_unless_it_leads_out_of_where_it_is_forbidden(
    place: tuple[float, float], present: tuple[float, float] | None, tolerance: float, words: str
) -> None:
    found = ForbiddenSky(HILLS, RADIUS).reason(*place, present, SUN, tolerance)
    assert words in found
    assert bool(words) == bool(found)


def along(*places: tuple[float, float]) -> np.ndarray:
    return np.array([places])


@pytest.mark.parametrize(
    ("lines", "margin", "arrives", "words"),
    [
        # Past the Sun at 0.07 rad: nearest in the middle of one chord.
        (along((0.8, 0.53), (1.2, 0.53)), 0.0, True, ""),
        (along((0.8, 0.53), (1.2, 0.53)), 0.03, True, "from the Sun"),
        (along((0.8, 0.555), (1.2, 0.555)), 0.0, True, "from the Sun"),
        # Its goal may be nearer than the margin, not than the zone.
        (along((1.0, 0.8), (1.0, 0.66)), 0.03, True, ""),
        (along((1.0, 0.8), (1.0, 0.66)), 0.03, False, "from the Sun"),
        (along((1.0, 0.8), (1.0, 0.64)), 0.03, True, "2.292 deg from the Sun"),
        # From within margin or zone it may leave, on the way out all the time.
        (along((1.0, 0.66), (1.0, 0.8)), 0.03, False, ""),
        (along((1.0, 0.63), (1.0, 0.8)), 0.03, False, ""),
        (along((1.0, 0.63), (1.0, 0.62), (1.0, 0.8)), 0.0, False, "1.146 deg from the Sun"),
        (along((1.0, 0.63), (1.0, 0.64), (1.0, 0.63), (1.0, 0.8)), 0.0, False, "from the Sun"),
        # The horizon: through the peak between two points, out of it, and deeper into it.
        (along((0.8, 0.25), (1.2, 0.25)), 0.0, True, "elevation 14.324 deg at azimuth 57.3 deg is 2.865 deg below"),
        (along((0.8, 0.301), (1.2, 0.301)), 0.0, True, ""),
        (along((1.0, 0.2), (1.0, 0.4)), 0.0, True, ""),
        (along((1.0, 0.2), (1.0, 0.19), (1.0, 0.4)), 0.0, True, "6.303 deg below"),
        (along((1.0, 0.2), (1.0, 0.25), (1.0, 0.22), (1.0, 0.4)), 0.0, True, "4.584 deg below"),
        (along((4.1, math.pi - 0.25), (4.2, math.pi - 0.25)), 0.0, True, "2.865 deg below"),
    ],
)
def test_a_path_keeps_its_margin_and_leaves_a_zone_only_outwards(
    lines: np.ndarray, margin: float, arrives: bool, words: str
) -> None:
    found = ForbiddenSky(HILLS, RADIUS).reason_of_path(lines, SUN, margin, arrives=arrives)
    assert words in found
    assert bool(words) == bool(found)
    # Where the axes would come by when stopped counts as well, at every instant.
    still = np.repeat(along((0.8, 0.9)), lines.shape[1], axis=1)
    beside = ForbiddenSky(HILLS, RADIUS).reason_of_path(np.concatenate([still, lines]), SUN, margin, arrives=False)
    outside = float(np.min(angle_between(lines[0, [0, -1]], np.array(SUN)))) >= RADIUS + margin
    if outside and lines[0, 0, 1] != 0.2:
        assert bool(beside) == bool(words)


def test_a_turn_of_the_horizons_points_is_refused_and_a_little_less_is_not() -> None:
    HorizonMask(azimuth_rad=(1.0, 6.0), elevation_rad=(0.0, 0.0))
    for azimuths in ((0.0, 2.0 * math.pi), (1.0, 1.0), (1.0, 0.5)):
        with pytest.raises(ValueError, match="must rise from point to point within one turn"):
            HorizonMask(azimuth_rad=azimuths, elevation_rad=(0.0, 0.0))
    with pytest.raises(ValueError, match="the same number"):
        HorizonMask(azimuth_rad=(1.0, 2.0), elevation_rad=(0.0,))
    with pytest.raises(ValueError, match="has 0 points"):
        HorizonMask(azimuth_rad=(), elevation_rad=())
