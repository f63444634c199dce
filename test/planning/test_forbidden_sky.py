"""The horizon between its surveyed points, on every turn."""

import math

import numpy as np
import pytest

from rf_pointing.planning import HorizonMask
from rf_pointing.planning.forbidden_sky import ForbiddenSky, angle_between

SUN, RADIUS = (1.0, 0.6), 0.05
HILLS = HorizonMask(azimuth_rad=(0.0, 0.9, 1.0, 1.1), elevation_rad=(0.1, 0.1, 0.3, 0.1))


@pytest.mark.parametrize(
    ("low", "high", "sun", "margin", "clear"),
    [
        (0.301, 1.5, None, 0.0, True), (0.299, 1.5, None, 0.0, False), (0.301, 1.58, None, 0.0, False),
        (0.301, 0.549, SUN, 0.0, True), (0.301, 0.551, SUN, 0.0, False), (0.301, 0.541, SUN, 0.01, False),
        (0.301, 0.539, SUN, 0.01, True), (0.651, 1.5, SUN, 0.0, True), (0.649, 1.5, SUN, 0.0, False),
        (0.659, 1.5, SUN, 0.01, False), (0.661, 1.5, SUN, 0.01, True), (0.301, 1.5, SUN, 0.0, False),
    ],
)  # fmt: skip
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
