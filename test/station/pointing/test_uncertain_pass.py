"""What a pass costs whose target may be early or late: invariants, a Monte Carlo, and flights of the whole station."""

from itertools import pairwise

import numpy as np
import pytest

from rf_pointing.core import MDEG, Mode, random_stream, received_power
from rf_pointing.ephemeris import ElementUncertainty, Pass, TopocentricTrack
from rf_pointing.planning import PassProfile
from rf_pointing.station.pointing.certificates import pass_profile
from rf_pointing.station.pointing.params import ControllerParams
from rf_pointing.station.pointing.scan_patterns import ScanPatterns, Scans
from rf_pointing.station.pointing.uncertain_pass import uncertain_cost
from rf_pointing.tracking import AutotrackParams, SkyMotion, SpiralParams, TrackPath, TrimFilter, TrimParams
from rf_pointing.tracking.sensors import SENSORS

BEAM_RAD = 650.0 * MDEG
SETS = ControllerParams()
SCANS = Scans(SpiralParams(half_power_beamwidth_rad=BEAM_RAD, rate_rad_s=0.02, acceleration_rad_s2=0.02),
              SETS.calibration.scan, None, SETS)  # fmt: skip


@pytest.fixture(scope="module")
def profile(track: TopocentricTrack, window: Pass) -> PassProfile:
    return pass_profile(track, window, law=ElementUncertainty(along_m=30e3))


def prior(along_s: float, cross_m: float = 300.0) -> TrimParams:
    return TrimParams(along_track_s=along_s, cross_track_m=cross_m, bias_rad=0.0)


def cost(profile: PassProfile, along_s: float, sensor: str = ""):  # type: ignore[no-untyped-def]
    latitude_rad, begin_s = 0.615, float(profile.t_s[0])
    return uncertain_cost(
        SENSORS.get(sensor), SCANS, prior(along_s), AutotrackParams(sensor=sensor or "none"),
        profile, latitude_rad, begin_s,
    )  # fmt: skip


def test_a_profile_says_how_uncertain_its_target_is(
    profile: PassProfile, track: TopocentricTrack, window: Pass
) -> None:
    assert profile.along_sigma_s == pytest.approx(30e3 / 7450.0, rel=0.05)
    assert 200.0 < profile.cross_sigma_m < 2500.0
    assert profile.between(window.aos_t_s + 60.0, window.los_t_s).along_sigma_s == profile.along_sigma_s
    assert pass_profile(track, window).along_sigma_s == 0.0


def test_program_track_costs_the_mean_power_over_the_errors_of_the_target(profile: PassProfile) -> None:
    """Against 2000 early and late targets drawn at random, and their path."""
    found = cost(profile, 1.0)
    fine = profile.resampled()
    path = TrackPath(fine.t_s, fine.position_rad, fine.range_m, 0.615)
    times = fine.t_s[::50]
    drawn = random_stream(3, "targets").standard_normal(2000)
    distance = np.array([np.hypot(*path.moved(times, each)[0].T) for each in drawn])
    assert found.power == pytest.approx(float(np.mean(received_power(distance, BEAM_RAD))), rel=0.05)
    held = np.mean(distance <= 0.5 * BEAM_RAD, axis=1)
    assert found.unheld_90_s / fine.duration_s == pytest.approx(1.0 - float(np.quantile(held, 0.1)), abs=0.05)
    assert found.search_rad_s == 0.0


@pytest.mark.parametrize("sensor", ["", "conscan", "monopulse", "steptrack"])
def test_the_less_is_known_of_a_target_the_more_it_costs(sensor: str, profile: PassProfile) -> None:
    rows = [cost(profile, along_s, sensor) for along_s in (0.3, 2.0, 8.0, 25.0)]
    for before, after in pairwise(rows):
        assert after.unheld_90_s >= before.unheld_90_s
        assert after.unheld_s >= before.unheld_s
        assert after.power <= before.power
    assert rows[-1].unheld_90_s > rows[0].unheld_90_s
    for row in rows:
        assert row.power_90 <= row.power + 1e-12
        assert row.unheld_90_s <= profile.duration_s + 1.0


def test_a_search_along_the_pass_comes_by_every_target_within_three_sigmas(profile: PassProfile) -> None:
    """A target so early or late and so far off its track is passed within half a beam before the search repeats."""
    fine = profile.resampled()
    path = TrackPath(fine.t_s, fine.position_rad, fine.range_m, 0.615)
    begin_s, sigma_s = float(fine.t_s[0]) + 3.0, 4.0
    times = begin_s + np.arange(0.0, 120.0, 0.1)
    _, motion = path.moved(times, 0.0)
    sky = SkyMotion(motion[:, 0], motion[:, 1], np.interp(times, fine.t_s, fine.range_m))
    search = ScanPatterns(SCANS)
    search.begin(Mode.SEARCH, begin_s, TrimFilter(prior(sigma_s)), sky, path, uncertain=True)
    beam, rate = search.at(times, sky)
    for ahead_s in np.linspace(-3.0, 3.0, 13) * sigma_s:
        nearest = np.min(np.hypot(*(path.moved(times, ahead_s)[0] - beam).T))
        assert nearest < 0.5 * BEAM_RAD, ahead_s
    steps = np.hypot(*np.gradient(beam, times, axis=0).T)
    assert np.max(steps) < 3.0 * SCANS.spiral.rate_rad_s
    np.testing.assert_allclose(rate[5:-5], np.gradient(beam, times, axis=0)[5:-5], atol=0.25 * SCANS.spiral.rate_rad_s)
    wider = ScanPatterns(SCANS)
    wider.begin(Mode.SEARCH, begin_s, TrimFilter(prior(sigma_s)), sky, path, uncertain=True, wider=2)
    assert np.max(np.hypot(*wider.at(times, sky)[0].T)) > 1.5 * np.max(np.hypot(*beam.T))
