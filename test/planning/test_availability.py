"""Availability of a network: closed forms at both ends of the correlation, and drawn weather between."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rf_pointing.planning.availability import WEATHER_M, availability, clear_probability, weather_correlation

CLOUDY = st.floats(0.0, 1.0)


@given(st.lists(CLOUDY, min_size=1, max_size=6))
def test_far_stations_are_independent(cloudy: list[float]) -> None:
    far = 1e9 * (1.0 - np.eye(len(cloudy)))
    assert clear_probability(cloudy, far) == pytest.approx(1.0 - np.prod(cloudy), abs=1e-12)


@given(CLOUDY, st.integers(1, 6))
def test_stations_at_one_place_share_their_sky(cloudy: float, count: int) -> None:
    assert clear_probability([cloudy] * count, np.zeros((count, count))) == pytest.approx(1.0 - cloudy, abs=1e-12)


@given(st.lists(CLOUDY, min_size=2, max_size=5), st.floats(1e3, 4e5))
def test_one_more_station_never_makes_a_clear_sky_less_likely(cloudy: list[float], apart_m: float) -> None:
    places = apart_m * np.arange(len(cloudy))
    distance = np.abs(places[:, None] - places)
    fewer = clear_probability(cloudy[:-1], distance[:-1, :-1])
    assert fewer - 1e-12 <= clear_probability(cloudy, distance) <= 1.0


def test_two_stations_have_the_correlation_of_drawn_weather(random: np.random.Generator) -> None:
    q, apart_m = 0.34, 40e3
    # With the chance rho the second has the weather of the first, else its own.
    first, own = random.random((2, 400_000)) < q
    second = np.where(random.random(400_000) < weather_correlation(apart_m), first, own)
    assert np.corrcoef(first, second)[0, 1] == pytest.approx(weather_correlation(apart_m), abs=0.01)
    distance = np.array([[0.0, apart_m], [apart_m, 0.0]])
    assert clear_probability([q, q], distance) == pytest.approx(1.0 - np.mean(first & second), abs=0.003)
    assert weather_correlation(WEATHER_M * np.sqrt(2.0 * np.log(100.0))) == pytest.approx(0.01)


def test_shares_count_the_stations_that_see_the_target() -> None:
    seen = np.array([[True, True], [True, False], [False, False], [False, True]])
    shares = availability(seen, [0.5, 0.2], np.array([[0.0, 1e9], [1e9, 0.0]]))
    assert shares == pytest.approx((0.75, (0.9 + 0.5 + 0.0 + 0.8) / 4.0))
