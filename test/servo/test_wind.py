"""Gust filter against Davenport's spectrum and its closed-form variance.

Wind torque by attitude, and the running wind.
"""

import math

import numpy as np
import pytest
from scipy.integrate import trapezoid

from rf_pointing.core import random_stream
from rf_pointing.servo import GustFilter, Wind, WindParams, wind_torque_n_m
from rf_pointing.station.antenna.axis_response import davenport_psd


def variance_m2_s2(gust: GustFilter) -> float:
    root = gust.step_matrices(math.inf)[1]
    return float(gust.residues @ root @ root.T @ gust.residues)


@pytest.mark.parametrize("speed_m_s", [3.0, 8.0, 20.0])
def test_filter_spectrum_is_davenports_within_three_tenths_of_a_decibel(speed_m_s: float) -> None:
    frequency = np.geomspace(0.3, 1000.0, 200) * speed_m_s / 1200.0
    gust = GustFilter.davenport(speed_m_s, 0.005)
    response = (gust.residues / (2j * np.pi * frequency[:, None] + gust.poles_rad_s)).sum(axis=-1)
    ratio = 2.0 * np.abs(response) ** 2 / davenport_psd(frequency, speed_m_s, 0.005)
    assert np.max(np.abs(10.0 * np.log10(ratio))) < 0.3


def test_davenport_spectrum_integrates_to_six_kappa_speed_squared() -> None:
    frequency = np.geomspace(1e-6, 1e4, 200_001)
    variance = trapezoid(davenport_psd(frequency, 8.0, 0.005), frequency)
    assert variance == pytest.approx(6.0 * 0.005 * 64.0, rel=1e-3)
    assert variance_m2_s2(GustFilter.davenport(8.0, 0.005)) == pytest.approx(variance, rel=0.02)


def test_sampled_gusts_keep_the_stationary_covariance_at_any_step() -> None:
    gust = GustFilter.davenport(8.0, 0.005)
    root = gust.step_matrices(math.inf)[1]
    stationary = root @ root.T
    for dt_s in (0.02, 0.1, 1.0):
        decay, noise = gust.step_matrices(dt_s)
        stepped = np.outer(decay, decay) * stationary + noise @ noise.T
        np.testing.assert_allclose(stepped, stationary, rtol=1e-9)


def test_calm_air_has_no_davenport_filter() -> None:
    with pytest.raises(ValueError, match=r"mean_speed_m_s=0\.0009 must be >= 0\.001$"):
        GustFilter.davenport(9e-4, 0.005)
    gust = GustFilter.davenport(1e-3, 0.005)
    # Everything goes with the speed: the variance 6 kappa V^2 too.
    assert variance_m2_s2(gust) == pytest.approx(6.0 * 0.005 * 1e-6, rel=0.02)


PARAMS = WindParams(mean_speed_m_s=8.0, from_azimuth_rad=0.7)


@pytest.mark.parametrize(("azimuth", "elevation"), [(2.1, 0.8), (0.7, 0.6), (-0.2, 1.5), (4.0, 0.0)])
def test_torque_is_the_cross_product_of_boresight_and_wind(azimuth: float, elevation: float) -> None:
    blows_to = PARAMS.from_azimuth_rad + math.pi
    boresight = np.array(
        [math.cos(elevation) * math.sin(azimuth), math.cos(elevation) * math.cos(azimuth), math.sin(elevation)]
    )
    wind = np.array([math.sin(blows_to), math.cos(blows_to), 0.0])
    area, pressure = math.pi * 17.0**2, 0.5 * 1.225 * 64.0
    coefficient = PARAMS.moment_base - PARAMS.moment_incidence * float(boresight @ wind)
    moment = pressure * area * 34.0 * coefficient * np.cross(boresight, wind)
    raising = np.array([math.cos(azimuth), -math.sin(azimuth), 0.0])
    ours = wind_torque_n_m(PARAMS, 8.0, 0.0, azimuth, elevation)
    assert ours == pytest.approx((-moment[2], float(moment @ raising)), rel=1e-12, abs=1e-6)


def test_a_gust_across_turns_the_wind_to_the_right_and_adds_to_its_speed() -> None:
    """Along and across together are a wind of their length from a direction turned to the right of where it blows."""
    torque = wind_torque_n_m(PARAMS, 6.0, 2.5, 1.9, 0.6)
    # It blows to the right of its direction, so it comes from the left of where it came from: azimuths grow to the right.
    turned = PARAMS.replace(from_azimuth_rad=PARAMS.from_azimuth_rad + math.atan2(2.5, 6.0))
    assert torque == pytest.approx(wind_torque_n_m(turned, 6.5, 0.0, 1.9, 0.6), rel=1e-12)


def test_gusts_are_renewed_every_20_ms_and_not_before() -> None:
    wind = Wind(PARAMS, random_stream(2, "wind"))
    speeds = []
    for _ in range(13):
        wind.step(0.005, 0.0, 0.5)
        speeds.append(wind.speed_m_s[0])
    assert [len(set(speeds[k : k + 4])) for k in (3, 7)] == [1, 1]
    assert len(set(speeds)) == 4
    wind.step(0.1, 0.0, 0.5)
    other = Wind(PARAMS, random_stream(2, "wind"))
    other.step(0.165, 0.0, 0.5)
    assert wind.speed_m_s == other.speed_m_s
    np.testing.assert_allclose(wind.step(0.001, 0.2, 0.5), wind_torque_n_m(PARAMS, *wind.speed_m_s, 0.2, 0.5))


@pytest.mark.parametrize(("dt_s", "words"), [(0.0, "dt_s=0.0 must be >= 1e-06"), (11.0, "dt_s=11.0 must be <= 10.0")])
def test_wind_of_no_time_or_of_too_long_a_time_is_refused(dt_s: float, words: str) -> None:
    for params in (PARAMS, WindParams()):
        with pytest.raises(ValueError, match=words):
            Wind(params, random_stream(2, "wind")).step(dt_s, 0.0, 0.5)


def test_wind_of_a_millimetre_a_second_is_calm_and_one_of_two_blows() -> None:
    for speed_m_s, blows in ((1e-3, False), (2e-3, True)):
        wind = Wind(WindParams(mean_speed_m_s=speed_m_s), random_stream(2, "wind"))
        assert (wind.speed_m_s != (0.0, 0.0)) is blows
        assert bool(np.any(wind.step(0.02, 0.3, 0.7))) is blows


def test_the_speed_is_the_mean_and_what_the_filters_hold() -> None:
    wind = Wind(PARAMS, random_stream(2, "wind"))
    wind.step(0.02, 0.0, 0.5)
    along, across = wind.state.filters @ GustFilter.davenport(8.0, 0.005).residues
    assert wind.speed_m_s == pytest.approx((8.0 + along, 0.75 * across))


def test_noise_that_sets_in_drives_the_gust_its_own_way() -> None:
    """Above all poles the filter is an integrator of the noise with a positive gain, at zero it lets nothing through."""
    gust = GustFilter.davenport(8.0, 0.005)
    assert np.sum(gust.residues) > 0.0
    assert np.sum(gust.residues / gust.poles_rad_s) == pytest.approx(0.0, abs=1e-9 * np.max(gust.residues))


def test_a_step_of_the_gusts_is_what_decays_and_what_the_generator_adds() -> None:
    wind = Wind(PARAMS, random_stream(2, "wind"))
    before = wind.state
    generator = random_stream(5, "other")
    generator.bit_generator.state = before.random
    decay, noise = GustFilter.davenport(8.0, 0.005).step_matrices(0.02)
    wind.step(0.02, 0.0, 0.5)
    np.testing.assert_allclose(
        wind.state.filters, before.filters * decay + generator.standard_normal((2, 4)) @ noise.T, rtol=1e-12
    )


def test_the_filter_of_the_gusts_answers_at_once() -> None:
    """Of all filters of its spectrum the one whose zeros are at zero and to the left: no gust begins the wrong way."""
    gust = GustFilter.davenport(8.0, 0.005)
    numerator = sum(
        residue * np.poly(-np.delete(gust.poles_rad_s, k)) for k, residue in enumerate(gust.residues.tolist())
    )
    zeros = np.sort(np.roots(numerator).real)
    assert zeros[-1] == pytest.approx(0.0, abs=1e-6)
    assert np.all(zeros[:-1] < -0.1)
