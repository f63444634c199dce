"""The trim filter learns the ephemeris error and keeps it while coasting."""

import copy
import math

import numpy as np
import pytest

from rf_pointing.core import MDEG, SkyUncertainty, random_stream
from rf_pointing.ephemeris import TopocentricTrack, find_elements, site, verification_elements
from rf_pointing.tracking import SkyMotion, TrackPath, TrimFilter, TrimParams, direction_rows, prior_for

PARAMS = TrimParams(jitter_rad=0.1 * MDEG)


def overhead_pass(t_s: float) -> SkyMotion:
    """A straight flight at 500 km height, 100 km beside the zenith: rates along and up, and range."""
    ahead, beside, height, speed = 7500.0 * t_s, 100e3, 500e3, 7500.0
    ground, distance = math.hypot(ahead, beside), math.sqrt(ahead**2 + beside**2 + height**2)
    azimuth_rate = beside * speed / ground**2
    elevation_rate = -height * ahead * speed / (ground * distance**2)
    return SkyMotion(azimuth_rate * ground / distance, elevation_rate, distance)


TRUTH = np.array([0.08, 220.0, 2.0 * MDEG, -1.5 * MDEG])


def fly(filter_: TrimFilter, start_s: float, stop_s: float, sigma: float, name: str = "trim") -> None:
    rng = random_stream(5, name)
    for t_s in np.arange(start_s, stop_s, 1.0):
        sky = overhead_pass(float(t_s))
        measured = direction_rows(sky) @ TRUTH + sigma * rng.standard_normal(2)
        assert filter_.update(float(t_s), measured, np.eye(2) * sigma**2, sky)


def test_planted_ephemeris_error_is_recovered_over_a_pass() -> None:
    trim = TrimFilter(PARAMS)
    fly(trim, -200.0, 200.0, 0.1 * MDEG)
    spread = np.sqrt(np.diag(trim.state.covariance))
    assert np.all(np.abs(trim.state.mean - TRUTH) < 4.0 * spread)
    assert trim.state.used == 400


@pytest.mark.parametrize("coast_s", [5.0, 20.0])
def test_coast_after_learning_is_far_better_than_the_last_offset_held(coast_s: float) -> None:
    trim = TrimFilter(PARAMS)
    fly(trim, -150.0, -20.0, 0.1 * MDEG)
    last = direction_rows(overhead_pass(-21.0)) @ TRUTH
    t_s = -21.0 + coast_s
    truth = direction_rows(overhead_pass(t_s)) @ TRUTH
    coasted = trim.trim(t_s, overhead_pass(t_s))
    error = np.linalg.norm(coasted.offset_rad - truth)
    assert error < 0.25 * np.linalg.norm(last - truth)
    assert error < 4.0 * math.sqrt(np.trace(coasted.covariance_rad2))


def test_target_at_rest_still_learns_the_bias() -> None:
    trim = TrimFilter(PARAMS)
    still = SkyMotion(0.0, 0.0, 4e7)
    for k in range(50):
        trim.update(float(k), np.array([3.0, -2.0]) * MDEG, np.eye(2) * (0.1 * MDEG) ** 2, still)
    assert trim.trim(60.0, still).offset_rad == pytest.approx(np.array([3.0, -2.0]) * MDEG, abs=0.05 * MDEG)


def test_a_target_nearer_than_a_metre_is_refused() -> None:
    assert np.all(np.isfinite(direction_rows(SkyMotion(1e-3, 1e-3, 1.0))))
    with pytest.raises(ValueError, match=r"range_m=0.99 must be >= 1.0"):
        direction_rows(SkyMotion(1e-3, 1e-3, np.array([5.0, 0.99])))


def test_a_metre_across_the_track_is_square_to_the_motion_and_seen_from_its_range() -> None:
    rows = direction_rows(SkyMotion(np.array([3e-3, 1e-3]), np.array([4e-3, -2e-3]), np.array([1e6, 2e6])))
    along, across = rows[..., 0], rows[..., 1]
    np.testing.assert_allclose(np.sum(along * across, axis=-1), 0.0, atol=1e-15)
    np.testing.assert_allclose(np.linalg.norm(across, axis=-1), [1e-6, 0.5e-6])
    # To the left of the motion: it goes to the right and up.
    np.testing.assert_allclose(across[0], [-0.8e-6, 0.6e-6])
    np.testing.assert_array_equal(rows[..., 2:], np.broadcast_to(np.eye(2), (2, 2, 2)))


def test_time_that_runs_back_is_refused() -> None:
    trim = TrimFilter(PARAMS)
    fly(trim, -10.0, 0.0, 0.1 * MDEG)
    with pytest.raises(ValueError, match=r"t_s=-5.0 must be >= -1.0"):
        trim.update(-5.0, np.zeros(2), np.eye(2), overhead_pass(-5.0))


def test_copied_state_continues_identically() -> None:
    trim, twin = TrimFilter(PARAMS), TrimFilter(PARAMS)
    fly(trim, -30.0, -10.0, 0.1 * MDEG)
    twin.state = copy.deepcopy(trim.state)
    for each in (trim, twin):
        fly(each, -10.0, 0.0, 0.1 * MDEG, "later")
    assert np.array_equal(trim.state.mean, twin.state.mean)
    assert np.array_equal(trim.state.covariance, twin.state.covariance)


def test_a_filter_that_is_sure_of_something_wrong_gives_in_after_its_patience() -> None:
    """Taught 0.6 s by a false lock, then told the truth: refused three times, learned again, and the coast is right."""
    trim = TrimFilter(PARAMS)
    for t_s in np.arange(-150.0, -100.0, 1.0):
        sky = overhead_pass(float(t_s))
        trim.update(
            float(t_s), direction_rows(sky) @ np.array([0.6, 0.0, 0.0, 0.0]), np.eye(2) * (0.1 * MDEG) ** 2, sky
        )
    taken = []
    rng = random_stream(6, "truth")
    for t_s in np.arange(-100.0, -40.0, 1.0):
        sky = overhead_pass(float(t_s))
        measured = direction_rows(sky) @ TRUTH + 0.1 * MDEG * rng.standard_normal(2)
        taken.append(trim.update(float(t_s), measured, np.eye(2) * (0.1 * MDEG) ** 2, sky))
    assert taken[: PARAMS.gate_patience] == [False] * PARAMS.gate_patience
    assert all(taken[PARAMS.gate_patience :])
    assert np.all(np.abs(trim.state.mean - TRUTH) < 4.0 * np.sqrt(np.diag(trim.state.covariance)))


def test_refusals_that_are_not_in_a_row_leave_the_filter_as_it_is() -> None:
    trim = TrimFilter(PARAMS)
    fly(trim, -100.0, -50.0, 0.1 * MDEG)
    for t_s in (-49.0, -47.0, -45.0, -43.0):
        sky, noise = overhead_pass(t_s), np.eye(2) * (0.1 * MDEG) ** 2
        mean = trim.state.mean
        assert not trim.update(t_s, np.array([300.0, 300.0]) * MDEG, noise, sky)
        assert np.array_equal(trim.state.mean, mean)
        assert trim.update(t_s + 1.0, direction_rows(overhead_pass(t_s + 1.0)) @ TRUTH, noise, overhead_pass(t_s + 1.0))
    assert trim.state.refused == 4


@pytest.mark.parametrize("step_s", [0.25, 1.0, 3.0])
def test_the_filter_is_kalmans_with_walks_and_a_jitter_that_is_the_same_over_its_correlation(step_s: float) -> None:
    """Written out in the plain form, from the prior, at times like those of a clock."""
    p = TrimParams(gate_sigmas=50.0)
    trim, rng = TrimFilter(p), random_stream(9, "plain filter")
    mean = np.zeros(4)
    covariance = np.diag([p.along_track_s, p.cross_track_m, p.bias_rad, p.bias_rad]) ** 2
    walk = np.diag([p.along_track_walk_s, p.cross_track_walk_m, p.bias_walk_rad, p.bias_walk_rad]) ** 2
    for k in range(30):
        # The first one has nothing before it, and counts whole.
        share = 1.0 if k == 0 else max(1.0, p.correlation_s / step_s)
        sky, noise = overhead_pass(step_s * k - 40.0), np.diag([2.0, 3.0]) * (0.1 * MDEG) ** 2
        offset = direction_rows(sky) @ TRUTH + 0.2 * MDEG * rng.standard_normal(2)
        covariance = covariance + (step_s * walk if k else 0.0)
        rows = direction_rows(sky)
        spread = rows @ covariance @ rows.T + noise + share * p.jitter_rad**2 * np.eye(2)
        gain = covariance @ rows.T @ np.linalg.inv(spread)
        mean, covariance = mean + gain @ (offset - rows @ mean), covariance - gain @ rows @ covariance
        assert trim.update(1.7e9 + step_s * k, offset, noise, sky)
        scale = np.sqrt(np.diag(covariance))
        np.testing.assert_allclose(trim.state.mean / scale, mean / scale, atol=1e-5)
        np.testing.assert_allclose(
            trim.state.covariance / np.outer(scale, scale), covariance / np.outer(scale, scale), atol=1e-5
        )
    later = trim.trim(1.7e9 + step_s * 29 + 8.0, sky)
    np.testing.assert_allclose(later.offset_rad, rows @ mean, rtol=1e-4)
    np.testing.assert_allclose(later.covariance_rad2, rows @ (covariance + 8.0 * walk) @ rows.T, rtol=1e-4)


def test_a_dish_that_goes_over_the_top_turns_the_bias_and_not_the_ephemeris() -> None:
    trim = TrimFilter(PARAMS)
    fly(trim, -50.0, -20.0, 0.1 * MDEG)
    mean, covariance = trim.state.mean, trim.state.covariance
    trim.turn(np.array([-1.0, -1.0]))
    np.testing.assert_array_equal(trim.state.mean, mean * [1.0, 1.0, -1.0, -1.0])
    signs = np.array([1.0, 1.0, -1.0, -1.0])
    np.testing.assert_array_equal(trim.state.covariance, covariance * np.outer(signs, signs))


@pytest.mark.parametrize("ahead_s", [-7.0, -0.5, 4.0, 14.0])
def test_a_path_knows_where_a_target_seconds_ahead_is_to_a_millidegree(ahead_s: float) -> None:
    """Against the propagated orbit, through a pass to 75 deg of elevation; a straight line is 60 to 2000 off."""
    track = TopocentricTrack(find_elements(verification_elements(), "28057"), site("Goldstone DSS-13"))
    times = 1151384680.3 + np.arange(-300.0, 300.1, 0.1)
    seen, there = track.sample(times), track.with_offsets(along_track_offset_s=ahead_s).sample(times)
    place = np.column_stack([seen.azimuth_rad, seen.elevation_rad])
    path = TrackPath(times, place, seen.range_m, track.site.latitude_rad)
    offset, rate = path.moved(times, ahead_s)
    turned = np.remainder(there.azimuth_rad - seen.azimuth_rad + math.pi, 2.0 * math.pi) - math.pi
    true = np.column_stack([turned * np.cos(seen.elevation_rad), there.elevation_rad - seen.elevation_rad])
    inside = slice(150, -150)
    assert np.max(np.abs(offset - true)[inside]) < 1.0 * MDEG
    ahead, before = path.moved(times, ahead_s + 0.2)[0], path.moved(times, ahead_s - 0.2)[0]
    np.testing.assert_allclose(rate[inside], ((ahead - before) / 0.4)[inside], atol=5e-6)
    np.testing.assert_allclose(path.moved(times, 0.0)[0], 0.0, atol=1e-12)


@pytest.mark.parametrize("sigma_s", [0.02, 0.4, 0.6, 4.0, 500.0])
def test_the_prior_is_what_is_known_of_the_target_where_that_is_less_than_configured(sigma_s: float) -> None:
    sky, cross_m = SkyMotion(3e-3, -4e-3, 1.2e6), 700.0 if sigma_s > 0.45 else 100.0
    rows = direction_rows(sky)[:, :2]
    covariance = rows @ np.diag([sigma_s**2, cross_m**2]) @ rows.T
    for along_s in (0.0, sigma_s):
        found = prior_for(PARAMS, SkyUncertainty(covariance_rad2=covariance, along_track_s=along_s), sky)
        if sigma_s < 0.45:
            assert found is PARAMS
            continue
        assert (found.along_track_s, found.cross_track_m) == pytest.approx((min(sigma_s, 60.0), cross_m))
    at_rest = prior_for(PARAMS, SkyUncertainty(covariance_rad2=np.diag([1e-4, 4e-4])), SkyMotion(0.0, 0.0, 4e7))
    assert at_rest.bias_rad == pytest.approx(0.02)
