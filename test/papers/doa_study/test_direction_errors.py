"""The shortcut: errors from a pool have the law of MUSIC at that direction, outliers and grid included."""

import numpy as np
import pytest

from rf_pointing.array_sensors.arrays.circular_array import CircularArrayParams
from rf_pointing.array_sensors.arrays.polar_direction import direction_from_polar, polar_errors_rad
from rf_pointing.papers.doa_study.direction_errors import DirectionCase, draw_directions, error_pool, measure_directions

ARRAY = CircularArrayParams()


@pytest.fixture
def stream() -> np.random.Generator:
    return np.random.default_rng(200)


@pytest.mark.parametrize(("snr_db", "theta_deg"), [(0.0, 50.0), (0.0, 15.0), (-13.0, 40.0)])
def test_drawn_errors_have_the_law_of_music_at_that_direction(
    snr_db: float, theta_deg: float, stream: np.random.Generator
) -> None:
    case = DirectionCase(snapshots=100, snr_db=snr_db)
    spread = direction_from_polar(np.radians(stream.uniform(5, 61, 8000)), stream.uniform(0, 2 * np.pi, 8000))
    pool = error_pool(ARRAY, case, spread, stream)
    truth = np.tile(direction_from_polar(np.radians(theta_deg), 2.2), (6000, 1))
    drawn = draw_directions(pool, truth[:1], 6000, stream)[0]
    real = measure_directions(ARRAY, case, truth, stream)
    for first, second in zip(polar_errors_rad(drawn, truth), polar_errors_rad(real, truth), strict=True):
        assert np.sqrt(np.mean(first**2)) == pytest.approx(np.sqrt(np.mean(second**2)), rel=0.12)
        assert np.median(np.abs(first)) == pytest.approx(np.median(np.abs(second)), rel=0.12)
