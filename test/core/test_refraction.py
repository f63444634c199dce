"""Radio refraction against a traced ray, SOFA's constants, ITU-R P.834, and against itself (closure, derivatives)."""

import contextlib
import itertools
import math

import erfa
import numpy as np
import pytest
from scipy.integrate import quad

from rf_pointing.core import MDEG, RadioRefraction

WEATHER = [
    RadioRefraction(pressure_hpa=pressure, temperature_k=temperature, relative_humidity=humidity)
    for pressure, temperature, humidity in itertools.product((700.0, 890.0, 1030.0), (258.0, 278.0, 293.0), (0.0, 0.6))
]
ELEVATION_RAD = np.radians(np.linspace(-89.0, 269.0, 3581))
CLOSURE_RAD = 2e-15


def traced_bending_rad(weather: RadioRefraction, apparent_rad: float) -> float:
    """Adaptive quadrature of the bending integral, in height above the antenna (square-root singularity removed)."""
    radius_m, dry_m, wet_m = 6.371e6, 29.27 * weather.temperature_k, 2000.0
    dry, wet = 1e-6 * weather.refractivity_dry, 1e-6 * weather.refractivity_wet
    invariant = (1.0 + dry + wet) * radius_m * math.cos(apparent_rad)

    def integrand(x: float) -> float:
        height = x * x
        at_dry, at_wet = dry * math.exp(-height / dry_m), wet * math.exp(-height / wet_m)
        n = 1.0 + at_dry + at_wet
        root = math.sqrt((n * (radius_m + height)) ** 2 - invariant**2)
        return 2.0 * x * invariant * (at_dry / dry_m + at_wet / wet_m) / (n * root)

    return float(quad(integrand, 0.0, math.sqrt(1.2e5), epsabs=1e-13, epsrel=1e-10, limit=400)[0])


@pytest.mark.parametrize("weather", WEATHER[::3])
def test_closed_form_follows_the_traced_ray(weather: RadioRefraction) -> None:
    for elevation_deg, tolerance_mdeg in ((0.2, 0.4), (1.0, 0.1), (3.0, 0.1), (5.0, 0.1), (12.0, 0.1), (45.0, 0.1)):
        apparent = math.radians(elevation_deg)
        bending = apparent - weather.remove(apparent)
        assert abs(bending - traced_bending_rad(weather, apparent)) < tolerance_mdeg * MDEG


@pytest.mark.parametrize("weather", WEATHER)
def test_agrees_with_sofa_above_15_degrees(weather: RadioRefraction) -> None:
    a, b = erfa.refco(weather.pressure_hpa, weather.temperature_k - 273.15, weather.relative_humidity, 1e6)
    zenith = np.radians(np.linspace(5.0, 75.0, 30))
    sofa = a * np.tan(zenith) + b * np.tan(zenith) ** 3
    apparent = 0.5 * np.pi - zenith
    np.testing.assert_allclose(apparent - weather.remove(apparent), sofa, atol=0.25 * MDEG)


def test_agrees_with_itu_r_p834_near_the_horizon() -> None:
    """The recommendation's own exponential numerical fit and atmosphere differ by up to 3 % of the correction."""
    weather = RadioRefraction(pressure_hpa=1013.0, temperature_k=288.0, relative_humidity=0.55)
    assert weather.refractivity_dry + weather.refractivity_wet == pytest.approx(315.0, abs=1.0)
    apparent_deg = np.linspace(1.0, 6.0, 20)
    itu_deg = 1.0 / (1.314 + 0.6437 * apparent_deg + 0.02869 * apparent_deg**2)
    ours_deg = apparent_deg - np.degrees(weather.remove(np.radians(apparent_deg)))
    np.testing.assert_allclose(ours_deg, itu_deg, rtol=0.03)


@pytest.mark.parametrize("weather", WEATHER)
def test_remove_is_the_exact_inverse_of_apply_from_nadir_over_zenith_to_nadir(weather: RadioRefraction) -> None:
    apparent = weather.apply(ELEVATION_RAD)
    np.testing.assert_allclose(weather.remove(apparent), ELEVATION_RAD, rtol=0.0, atol=CLOSURE_RAD)
    assert np.all(np.diff(apparent) > 0.0)


def test_zenith_is_not_moved_and_a_plunged_antenna_sees_the_same_sky() -> None:
    weather = RadioRefraction()
    assert weather.apply(0.5 * math.pi) == pytest.approx(0.5 * math.pi, abs=CLOSURE_RAD)
    below = np.radians(np.linspace(-30.0, 90.0, 200))
    np.testing.assert_allclose(weather.apply(np.pi - below), np.pi - weather.apply(below), rtol=0.0, atol=CLOSURE_RAD)


def test_below_the_horizon_the_correction_is_constant_and_finite() -> None:
    weather = RadioRefraction()
    low = np.radians(np.linspace(-89.0, -2.5, 100))
    correction = weather.apply(low) - low
    np.testing.assert_allclose(correction, correction[0], rtol=0.0, atol=CLOSURE_RAD)
    assert math.radians(1.0) < correction[0] < math.radians(1.4)


@pytest.mark.parametrize("weather", WEATHER[::4])
def test_rates_and_accelerations_are_derivatives_of_the_apparent_elevation(weather: RadioRefraction) -> None:
    step_s = 1e-3
    for start, rate, acceleration in ((-0.3, 0.01, 1e-3), (-0.012, -0.02, 2e-3), (0.03, 0.02, -1e-3), (1.9, 0.03, 0.0)):
        t = np.array([-step_s, 0.0, step_s])
        path = weather.apply(start + rate * t + 0.5 * acceleration * t**2)
        _, apparent_rate, apparent_acceleration = weather.apply_with_rates(start, rate, acceleration)
        assert apparent_rate == pytest.approx((path[2] - path[0]) / (2 * step_s), abs=1e-8)
        assert apparent_acceleration == pytest.approx((path[2] - 2 * path[1] + path[0]) / step_s**2, abs=1e-8)


def test_scalar_and_array_give_the_same_numbers() -> None:
    weather = RadioRefraction.standard(1070.0)
    array = weather.apply(ELEVATION_RAD[::300])
    np.testing.assert_allclose([weather.apply(float(e)) for e in ELEVATION_RAD[::300]], array, rtol=0.0, atol=1e-14)


def test_air_that_traps_the_ray_is_refused() -> None:
    with pytest.raises(ValueError, match=r"relative_humidity=1\.0 at temperature_k=315\.0 gives .* N/km"):
        RadioRefraction(temperature_k=315.0, relative_humidity=1.0)


def steep_air(rng: np.random.Generator, count: int) -> list[RadioRefraction]:
    """Draw weather at random over the whole allowed ranges, half of it hot: what is accepted of it."""
    accepted: list[RadioRefraction] = []
    while len(accepted) < count:
        pressure_hpa, humidity = rng.uniform(300.0, 1100.0), rng.uniform(0.0, 1.0)
        temperature_k = rng.uniform(295.0 if len(accepted) % 2 else 180.0, 330.0)
        with contextlib.suppress(ValueError):
            accepted.append(
                RadioRefraction(pressure_hpa=pressure_hpa, temperature_k=temperature_k, relative_humidity=humidity)
            )
    return accepted


def test_every_accepted_weather_has_an_apparent_elevation_from_nadir_to_the_plunged_horizon(
    random: np.random.Generator,
) -> None:
    """Also air just short of trapping rays, whose bending grows 16-fold between 1 deg and the horizon."""
    near_trapping = [RadioRefraction(temperature_k=302.0, relative_humidity=h) for h in np.linspace(0.9, 1.0, 6)]
    near_trapping += [RadioRefraction(temperature_k=315.0, relative_humidity=h) for h in np.linspace(0.5, 0.67, 6)]
    grid = np.radians(
        np.concatenate([np.linspace(-90.0, -6.0, 20), np.linspace(-5.0, 3.0, 801), np.linspace(3.5, 270.0, 80)])
    )
    for weather in [*near_trapping, *steep_air(random, 300)]:
        apparent, rate, acceleration = weather.apply_with_rates(grid, 0.01, 0.0)
        np.testing.assert_allclose(weather.remove(apparent), grid, rtol=0.0, atol=1e-13)
        assert np.all(np.diff(apparent) > 0.0)
        assert np.all(rate > 0.0)
        assert np.all(np.isfinite(acceleration))
        for one in random.uniform(math.radians(-6.0), math.radians(1.0), 20).tolist():
            assert weather.remove(weather.apply(one)) == pytest.approx(one, abs=1e-13)


def test_below_the_horizon_steep_air_bends_less_than_three_times_as_much_as_at_it(random: np.random.Generator) -> None:
    for weather in steep_air(random, 300):
        horizon_rad = -weather.remove(0.0)
        assert horizon_rad < -0.5 - weather.remove(-0.5) < 3.0 * horizon_rad


@pytest.mark.parametrize("value", [math.nan, math.inf, np.array([0.1, math.nan])])
def test_an_elevation_that_is_no_number_is_refused(value: object) -> None:
    with pytest.raises(ValueError, match=r"elevation_rad=.* must be finite"):
        RadioRefraction().apply(value)


@pytest.mark.parametrize(
    ("pressure", "temperature", "humidity"), [(1000.0, 300.0, 0.6), (600.0, 250.0, 1.0), (850.0, 280.0, 0.0)]
)
def test_the_refractivity_is_that_of_the_recommendation(pressure: float, temperature: float, humidity: float) -> None:
    """ITU-R P.453-14: N = 77.6 (P - e) / T + 72 e / T + 3.75e5 e / T^2, e by Buck's formula over water."""
    celsius = temperature - 273.15
    e = humidity * 6.1121 * math.exp(17.502 * celsius / (240.97 + celsius))
    weather = RadioRefraction(pressure_hpa=pressure, temperature_k=temperature, relative_humidity=humidity)
    assert weather.refractivity_dry == pytest.approx(77.6 * (pressure - e) / temperature, rel=1e-12)
    assert weather.refractivity_wet == pytest.approx((72.0 + 3.75e5 / temperature) * e / temperature, rel=1e-12)


def test_the_standard_air_of_the_sea_is_that_of_icao_and_half_saturated() -> None:
    sea = RadioRefraction.standard(0.0)
    assert (sea.pressure_hpa, sea.temperature_k, sea.relative_humidity) == (1013.25, 288.15, 0.5)
    # Table of the ICAO standard atmosphere.
    for altitude_m, pressure, temperature in ((1000.0, 898.75, 281.65), (5000.0, 540.20, 255.65)):
        air = RadioRefraction.standard(altitude_m)
        assert air.pressure_hpa == pytest.approx(pressure, rel=1e-4)
        assert air.temperature_k == pytest.approx(temperature)
