"""Gust filter against Davenport's spectrum and its closed-form variance.

Wind torque by attitude, and the running wind.
"""

import math

import numpy as np
import pytest
from scipy.integrate import trapezoid

from rf_pointing.core import random_stream
from rf_pointing.papers.servo_sampled import davenport_psd
from rf_pointing.servo import GustFilter, Wind, WindParams, wind_torque_n_m


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


def test_simulated_gusts_have_the_filters_one_step_correlation() -> None:
    gust = GustFilter.davenport(8.0, 0.005)
    random = random_stream(3, "gust")
    decay, noise = gust.step_matrices(0.5)
    state = gust.step_matrices(math.inf)[1] @ random.standard_normal(4)
    speeds = []
    for _ in range(40_000):
        state = decay * state + noise @ random.standard_normal(4)
        speeds.append(float(state @ gust.residues))
    root = gust.step_matrices(math.inf)[1]
    expected = gust.residues @ (decay * (root @ root.T @ gust.residues)) / variance_m2_s2(gust)
    measured = np.corrcoef(speeds[:-1], speeds[1:])[0, 1]
    assert measured == pytest.approx(expected, abs=0.01)


def test_calm_air_has_no_davenport_filter() -> None:
    with pytest.raises(ValueError, match=r"mean_speed_m_s=0\.0009 must be >= 0\.001$"):
        GustFilter.davenport(9e-4, 0.005)
    gust = GustFilter.davenport(1e-3, 0.005)
    # Everything goes with the speed: the variance 6 kappa V^2 too.
    assert variance_m2_s2(gust) == pytest.approx(6.0 * 0.005 * 1e-6, rel=0.02)


PARAMS = WindParams(mean_speed_m_s=8.0, from_azimuth_rad=0.7)


def test_torque_grows_with_the_square_of_the_speed() -> None:
    slow = np.array(wind_torque_n_m(PARAMS, 5.0, 0.0, 1.9, 0.6))
    fast = np.array(wind_torque_n_m(PARAMS, 10.0, 0.0, 1.9, 0.6))
    np.testing.assert_allclose(fast, 4.0 * slow, rtol=1e-12)


def test_wind_from_dead_ahead_gives_no_azimuth_torque_and_pushes_a_raised_dish_up_and_over() -> None:
    azimuth, elevation = wind_torque_n_m(PARAMS, 8.0, 0.0, 0.7, 0.6)
    assert azimuth == pytest.approx(0.0, abs=1e-6)
    assert elevation > 0.0


def test_mirrored_attitudes_get_mirrored_azimuth_torque() -> None:
    left = wind_torque_n_m(PARAMS, 8.0, 0.0, 0.7 - 0.9, 0.5)
    right = wind_torque_n_m(PARAMS, 8.0, 0.0, 0.7 + 0.9, 0.5)
    assert left[0] == pytest.approx(-right[0], rel=1e-12)
    assert left[1] == pytest.approx(right[1], rel=1e-12)


def test_torque_is_the_cross_product_of_boresight_and_wind() -> None:
    azimuth, elevation = 2.1, 0.8
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
    assert ours[0] == pytest.approx(-moment[2], rel=1e-12)
    assert ours[1] == pytest.approx(float(moment @ raising), rel=1e-12)


def test_running_wind_has_the_stated_mean_and_turbulence() -> None:
    wind = Wind(PARAMS, random_stream(2, "wind"))
    speeds = []
    for _ in range(20_000):
        wind.step(0.2, 0.0, 0.7)
        speeds.append(wind.speed_m_s)
    along, across = np.array(speeds).T
    sigma = math.sqrt(6.0 * 0.005) * 8.0
    assert np.mean(along) == pytest.approx(8.0, abs=0.1 * sigma)
    assert np.std(along) == pytest.approx(sigma, rel=0.08)
    assert np.std(across) == pytest.approx(0.75 * sigma, rel=0.08)


def test_gusts_do_not_depend_on_how_the_time_is_cut() -> None:
    coarse, fine = Wind(PARAMS, random_stream(2, "wind")), Wind(PARAMS, random_stream(2, "wind"))
    for _ in range(100):
        coarse.step(0.02, 0.3, 0.7)
    for _ in range(400):
        fine.step(0.005, 0.3, 0.7)
    assert coarse.speed_m_s == fine.speed_m_s


def test_copied_state_continues_identically() -> None:
    first = Wind(PARAMS, random_stream(2, "wind"))
    for _ in range(37):
        first.step(0.013, 0.3, 0.7)
    second = Wind(PARAMS, random_stream(5, "other"))
    second.state = first.state
    for _ in range(37):
        np.testing.assert_array_equal(first.step(0.017, 0.3, 0.7), second.step(0.017, 0.3, 0.7))


def test_calm_air_gives_no_torque() -> None:
    wind = Wind(WindParams(), random_stream(2, "wind"))
    np.testing.assert_array_equal(wind.step(0.02, 0.3, 0.7), np.zeros(2))
    assert wind.speed_m_s == (0.0, 0.0)


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
