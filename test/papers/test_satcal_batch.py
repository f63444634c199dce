import math

import numpy as np
import pytest

from rf_pointing.papers.satcal_batch import Arc, fit_orbit, preliminary_orbit, starting_state, times_of
from rf_pointing.papers.satcal_looks import look
from rf_pointing.papers.satcal_motion import Gravity, Site, propagate
from test.orbit.test_motion import ORBIT

EPOCH, GRAVITY = 827385062.07, Gravity()
MAURITIUS = Site(name="Mauritius", latitude_rad=math.radians(-20.34), longitude_rad=math.radians(57.45))
BANGALORE = Site(name="Bangalore", latitude_rad=math.radians(13.03), longitude_rad=math.radians(77.51))
START = ORBIT.state()


@pytest.fixture(scope="module")
def first_pass():
    times = EPOCH + np.arange(-140.0, 21.0, 4.0)
    return look(times, propagate(EPOCH, START, times, GRAVITY).states, MAURITIUS, GRAVITY)


@pytest.fixture(scope="module")
def arcs(first_pass):
    times = EPOCH + np.arange(0.0, 15000.0, 60.0)
    seen = look(times, propagate(EPOCH, START, times, GRAVITY).states, BANGALORE, GRAVITY)
    up = seen.elevation_rad > 0.1
    return (
        Arc(MAURITIUS, "range_m", first_pass.t_s, first_pass.range_m, 10.0),
        Arc(MAURITIUS, "azimuth_rad", first_pass.t_s, first_pass.azimuth_rad, 2e-4),
        Arc(MAURITIUS, "elevation_rad", first_pass.t_s, first_pass.elevation_rad, 2e-4),
        Arc(BANGALORE, "range_m", times[up], seen.range_m[up], 10.0),
        Arc(BANGALORE, "range_rate_m_s", times[up], seen.range_rate_m_s[up], 0.05),
    )


def test_noiseless_arcs_return_the_orbit_from_a_displaced_guess(arcs):
    guess = START + np.array([3e3, -2e3, 1e3, 3.0, 2.0, -4.0])
    found = fit_orbit(EPOCH, guess, arcs, GRAVITY)
    assert np.linalg.norm((found.state - START)[:3]) < 1e-3
    assert max(float(np.max(np.abs(r))) for r in found.residuals[3:]) < 1e-3


def test_an_orbit_that_is_known_already_gives_the_same_fit_and_one_at_other_times_is_refused(arcs):
    guess = START + np.array([30.0, -20.0, 10.0, 0.03, 0.02, -0.04])
    known = propagate(EPOCH, guess, times_of(arcs), GRAVITY, with_partials=True)
    assert np.array_equal(
        fit_orbit(EPOCH, guess, arcs, GRAVITY, orbit=known).state, fit_orbit(EPOCH, guess, arcs, GRAVITY).state
    )
    with pytest.raises(ValueError, match="orbit is given at"):
        fit_orbit(EPOCH, guess, arcs[:3], GRAVITY, orbit=known)


def test_noisy_arcs_return_the_orbit_within_its_covariance(arcs, random):
    noisy = [Arc(a.site, a.kind, a.t_s, a.values + a.sigma * random.standard_normal(len(a.t_s)), a.sigma) for a in arcs]
    found = fit_orbit(EPOCH, START, noisy, GRAVITY)
    miss = found.state - START
    assert miss @ np.linalg.solve(found.covariance, miss) < 22.5


def test_linear_theory_predicts_the_shift_of_a_biased_angle_within_1_percent(arcs):
    biased = [*arcs[:2], Arc(MAURITIUS, "elevation_rad", arcs[2].t_s, arcs[2].values + 1e-3, arcs[2].sigma), *arcs[3:]]
    clean, shifted = fit_orbit(EPOCH, START, arcs, GRAVITY), fit_orbit(EPOCH, START, biased, GRAVITY)
    predicted = clean.shift_from([0.0, 0.0, 1e-3, 0.0, 0.0])
    actual = shifted.state - clean.state
    assert np.linalg.norm((actual - predicted)[:3]) < 0.01 * np.linalg.norm(actual[:3])


def test_range_rate_of_one_instant_does_not_determine_an_orbit():
    arc = Arc(MAURITIUS, "range_m", EPOCH + np.zeros(8), np.full(8, 2.2e6), 10.0)
    with pytest.raises(ValueError, match="do not determine x rate, y rate, z rate"):
        fit_orbit(EPOCH, START, [arc], GRAVITY)


def test_preliminary_orbit_of_noiseless_angles_and_ranges_is_exact(first_pass):
    seen = first_pass
    found = preliminary_orbit(
        MAURITIUS, seen.t_s, seen.range_m, seen.azimuth_rad, seen.elevation_rad, sigma_range_m=10.0,
        sigma_angle_rad=2e-4, gravity=GRAVITY,
    )  # fmt: skip
    expected = propagate(EPOCH, START, [found.epoch_t_s], GRAVITY).states[0]
    assert np.linalg.norm((found.state - expected)[:3]) < 0.01


def test_starting_state_of_noiseless_data_is_within_100_m(first_pass):
    seen = first_pass
    epoch, state = starting_state(MAURITIUS, seen.t_s, seen.range_m, seen.azimuth_rad, seen.elevation_rad, GRAVITY)
    expected = propagate(EPOCH, START, [epoch], GRAVITY).states[0]
    assert np.linalg.norm((state - expected)[:3]) < 100.0
    assert np.linalg.norm((state - expected)[3:]) < 1.0


def test_five_measurements_are_too_few_and_what_they_cannot_separate_is_named(arcs):
    ranges, azimuths, elevations = arcs[:3]
    few = [Arc(arc.site, arc.kind, arc.t_s[:count], arc.values[:count], arc.sigma[:count])
           for arc, count in ((ranges, 2), (azimuths, 2), (elevations, 1))]  # fmt: skip
    with pytest.raises(ValueError, match="5 measurements do not determine x, y, z, x rate, y rate, z rate"):
        fit_orbit(EPOCH, START, few, GRAVITY)
    twice = [Arc(arc.site, arc.kind, np.repeat(arc.t_s[:1], 4), np.repeat(arc.values[:1], 4), np.repeat(arc.sigma[:1], 4))
             for arc in (ranges, azimuths, elevations)]  # fmt: skip
    with pytest.raises(ValueError, match="cannot separate"):
        fit_orbit(EPOCH, START, twice, GRAVITY)


def test_ten_samples_are_enough_nine_are_not_and_an_arc_needs_a_positive_sigma(first_pass):
    seen = first_pass
    samples = (seen.t_s, seen.range_m, seen.azimuth_rad, seen.elevation_rad)
    epoch, _ = starting_state(MAURITIUS, *(each[:10] for each in samples), GRAVITY)
    assert epoch == pytest.approx(seen.t_s[0] + 18.0)
    with pytest.raises(ValueError, match="samples=9 must be >= 10"):
        starting_state(MAURITIUS, *(each[:9] for each in samples), GRAVITY)
    with pytest.raises(ValueError, match=r"sigma of range_m at Mauritius=0.0 must be > 0"):
        Arc(MAURITIUS, "range_m", seen.t_s, seen.range_m, 0.0)


def test_covariance_is_that_of_the_gain_and_residuals_are_measured_minus_computed(arcs):
    found = fit_orbit(EPOCH, START, arcs, GRAVITY)
    sigma = np.concatenate([arc.sigma for arc in arcs])
    gain = np.concatenate(found.gain, axis=1)
    assert gain * sigma @ (gain * sigma).T == pytest.approx(found.covariance, rel=1e-6)
    shifted = [Arc(MAURITIUS, "range_m", arcs[0].t_s, arcs[0].values + 1.0, 1e6), *arcs[1:]]
    again = fit_orbit(EPOCH, START, shifted, GRAVITY)
    assert again.residuals[0] == pytest.approx(np.ones(len(arcs[0].t_s)), abs=1e-3)
    assert again.iterations >= 1
