"""Arrays and series of angles say the same, also of a dish over the top."""

import numpy as np
import pytest

from rf_pointing.calibration.angles import REFERENCE_TEMPERATURE_K, ArrayAngles, SeriesAngles


@pytest.fixture
def both(random):
    """Return angles of both kinds of one motion (n = 9), a third of it over the top, and its parts."""
    azimuth, temperature = random.uniform(-3.0, 7.0, 9), REFERENCE_TEMPERATURE_K + random.uniform(-30.0, 30.0, 9)
    elevation = np.concatenate([random.uniform(0.1, 1.4, 6), random.uniform(1.7, 3.0, 3)])
    rates, accelerations = random.normal(size=(2, 9)) * 1e-2, random.normal(size=(2, 9)) * 1e-4
    arrays = ArrayAngles.of((azimuth, elevation, *rates, *accelerations), temperature)
    # Series: value, first derivative, half of the second one.
    series = SeriesAngles(
        np.stack([azimuth, rates[0], 0.5 * accelerations[0]]), np.stack([elevation, rates[1], 0.5 * accelerations[1]]),
        temperature,
    )  # fmt: skip
    return arrays, series, azimuth, elevation, rates, accelerations, temperature


def value(found):
    return found[0] if np.ndim(found) == 2 else found


def test_values_are_those_of_the_functions_and_alike_in_both_forms(both):
    arrays, series, azimuth, elevation, rates, accelerations, temperature = both
    wanted = {
        "one": np.ones(9), "tan_elevation": np.tan(elevation), "sec_elevation": 1.0 / np.cos(elevation),
        "azimuth_rate": rates[0], "elevation_rate": rates[1], "azimuth_acceleration": accelerations[0],
        "elevation_acceleration": accelerations[1], "beyond_zenith": (elevation > 0.5 * np.pi) * 1.0,
        "temperature_difference": temperature - REFERENCE_TEMPERATURE_K,
    }  # fmt: skip
    for name, expected in wanted.items():
        np.testing.assert_allclose(getattr(arrays, name), expected, rtol=1e-12)
        np.testing.assert_allclose(value(getattr(series, name)), expected, rtol=1e-9, atol=1e-18)
    for multiple in (1, 2, 3):
        for found in (arrays, series):
            for angle, axis in ((azimuth, "azimuth"), (elevation, "elevation")):
                np.testing.assert_allclose(value(getattr(found, f"sin_{axis}")(multiple)), np.sin(multiple * angle))
                np.testing.assert_allclose(value(getattr(found, f"cos_{axis}")(multiple)), np.cos(multiple * angle))


def test_series_carry_the_derivatives_of_their_functions(both):
    _, series, _, elevation, rates, accelerations, _ = both
    rate, acceleration = rates[1], accelerations[1]
    tangent, sine, cosine = np.tan(elevation), np.sin(elevation), np.cos(elevation)
    np.testing.assert_allclose(series.tan_elevation[1], rate / cosine**2, rtol=1e-9)
    np.testing.assert_allclose(
        2.0 * series.tan_elevation[2], (acceleration + 2.0 * tangent * rate**2) / cosine**2, rtol=1e-9
    )
    np.testing.assert_allclose(series.sec_elevation[1], rate * sine / cosine**2, rtol=1e-9)
    np.testing.assert_allclose(series.sin_elevation(2)[1], 2.0 * np.cos(2.0 * elevation) * rate, rtol=1e-9)
    assert np.all(series.one[1:] == 0.0)


def test_a_thermal_term_without_a_temperature_and_a_motion_without_accelerations_are_refused(both):
    arrays = both[0]
    with pytest.raises(ValueError, match="temperature_k=None must be given"):
        _ = ArrayAngles.of((1.0, 0.5, 0.0, 0.0, 0.0, 0.0), None).temperature_difference
    with pytest.raises(ValueError, match="motion has 4 parts, must have 6"):
        ArrayAngles.of((arrays.azimuth, arrays.elevation, 0.0, 0.0), None)
