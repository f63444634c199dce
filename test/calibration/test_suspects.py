"""Systematic errors that a mount would take in are named with their size; a right campaign has none."""

import re
from dataclasses import replace

import numpy as np
import pytest

from rf_pointing.calibration import (
    BiasModel,
    FitOptions,
    Known,
    PassPriors,
    RawPasses,
    TrackedPass,
    fit_bias_model,
    held_at_zero,
    suspects,
)
from rf_pointing.core import MDEG, azel_from_unit_vector, unit_vector_from_azel, wrap_rad
from rf_pointing.core.refraction import RadioRefraction

TERMS = (
    "azimuth_offset", "non_orthogonality", "collimation", "azimuth_velocity_lag", "azimuth_acceleration_lag",
    "mislevel_east", "mislevel_north", "elevation_offset", "droop", "elevation_velocity_lag", "elevation_acceleration_lag",
)  # fmt: skip
MOUNT = BiasModel.zero().replace(azimuth_offset=60.0 * MDEG, mislevel_east=-30.0 * MDEG, elevation_offset=90.0 * MDEG)
AIR = RadioRefraction.standard(0.0)
ORBIT = PassPriors.of_orbit(30.0)
MISSES = np.linspace(-900e3, 900e3, 10)


@pytest.fixture
def campaign_with(track, raw_pass):
    """Return a maker of ten raw passes, each changed by `spoil(number, raw, reference)`."""

    def make(spoil=lambda _, raw, reference: (raw, reference)):
        passes = []
        for number, miss in enumerate(MISSES):
            reference = track(5.0, miss, 0.7 + 0.6 * number, 1e9 + 6000.0 * number)
            raw = raw_pass(reference, MOUNT, None, 5.0 * MDEG)
            passes.append(TrackedPass(*spoil(number, raw, reference)))
        return passes

    return make


def fitted(passes, orbit=ORBIT):
    points = RawPasses(passes, 0).process(Known(model=MOUNT)).points
    options = FitOptions(form="rotation", scale_covariance=True)
    held = held_at_zero(TERMS)
    return fit_bias_model(points, terms=TERMS, held=held, pass_priors=orbit, options=options), points


def test_a_right_campaign_is_not_suspected(campaign_with):
    passes = campaign_with()
    fit, points = fitted(passes)
    assert suspects.refraction_and_site(fit, points, AIR) is None
    assert suspects.common_clock(fit, dict.fromkeys(TERMS, 0.0)) is None
    assert suspects.clock_by_ranges(passes) is None
    assert suspects.wrong_north(points, 0.0) is None
    assert suspects.north_doubt(fit, 0.0) is None
    assert suspects.late_passes(fit, points) == {}


@pytest.mark.parametrize(("kind", "expected"), [("twice", 1.0), ("removed", -1.0)])
def test_refraction_applied_twice_or_removed_is_measured(campaign_with, kind, expected):
    def bent(number, raw, reference):
        apparent = AIR.apply(raw.elevation_rad) if kind == "twice" else AIR.remove(raw.elevation_rad)
        return replace(raw, elevation_rad=apparent), reference

    found = suspects.refraction_and_site(*fitted(campaign_with(bent)), AIR)
    assert found.kind == "refraction"
    assert found.refuse
    assert found.size == pytest.approx(expected, abs=max(0.05, 4.0 * found.sigma))
    assert found.sigma < 0.2
    assert ("--refraction-removed" in found.text) == (kind == "removed")


def test_an_antenna_200_m_from_its_site_is_found(campaign_with):
    off_m = np.array([120.0, -160.0, 0.0])

    def elsewhere(number, raw, reference):
        position = reference.range_m[:, np.newaxis] * unit_vector_from_azel(
            reference.azimuth_rad, reference.elevation_rad
        )
        azimuth, elevation = azel_from_unit_vector(position + off_m)
        turned = reference.azimuth_rad + wrap_rad(azimuth - reference.azimuth_rad)
        return raw, replace(reference, azimuth_rad=turned, elevation_rad=elevation)

    found = suspects.refraction_and_site(*fitted(campaign_with(elsewhere)), AIR)
    assert found.kind == "site"
    assert found.refuse
    assert found.size == pytest.approx(200.0, abs=4.0 * found.sigma)
    assert found.sigma < 40.0
    east, north = (float(re.search(rf"([+-]\d+) m {axis}", found.text)[1]) for axis in ("east", "north"))
    assert (east, north) == pytest.approx((120.0, -160.0), abs=4.0 * found.sigma)


def test_one_late_pass_is_named_and_the_others_are_not(campaign_with):
    passes = campaign_with(lambda k, raw, reference: (replace(raw, t_s=raw.t_s + 0.5 * (k == 6)), reference))
    fit, points = fitted(passes, PassPriors.of_orbit(1000.0))
    found = suspects.late_passes(fit, points)
    assert list(found) == [6]
    assert found[6].size == pytest.approx(0.5, rel=0.1)
    assert "late where the others are within" in found[6].text


def test_time_tags_late_in_all_passes_are_equal_lags_or_late_ranges(campaign_with):
    passes = campaign_with(lambda _, raw, reference: (replace(raw, t_s=raw.t_s + 0.5), reference))
    fit, _ = fitted(passes)
    by_lags, by_ranges = suspects.common_clock(fit, dict.fromkeys(TERMS, 0.0)), suspects.clock_by_ranges(passes)
    assert by_lags.size == pytest.approx(0.5, abs=0.02)
    assert by_ranges.size == pytest.approx(0.5, abs=0.01)
    assert by_ranges.refuse
    known = {"azimuth_velocity_lag": -0.5, "elevation_velocity_lag": -0.5}
    assert suspects.common_clock(fit, known) is None


@pytest.mark.parametrize(("apart_s", "equal"), [(0.033, True), (0.041, False)])
def test_lags_are_a_clock_only_when_they_are_equal_within_the_sigma_of_their_difference(campaign_with, apart_s, equal):
    """They are known to 20 and 30 ms, their difference to 10.6 ms: 3 sigma and 1 % of the clock are 36 ms."""
    fit, _ = fitted(campaign_with())
    places = [fit.names.index(name) for name in ("azimuth_velocity_lag", "elevation_velocity_lag")]
    values, covariance = fit.values.copy(), fit.covariance.copy()
    values[places] = -0.5 + 0.5 * apart_s * np.array([1.0, -1.0])
    covariance[np.ix_(places, places)] = 1e-6 * np.array([[400.0, 594.0], [594.0, 900.0]])
    found = suspects.common_clock(replace(fit, values=values, covariance=covariance), dict.fromkeys(TERMS, 0.0))
    assert (found is not None) is equal


def test_another_north_is_told_by_its_turn(campaign_with):
    def turned(number, raw, reference):
        return replace(raw, azimuth_rad=raw.azimuth_rad - np.radians(4.2)), reference

    points = RawPasses(campaign_with(turned), 0).process(Known(model=MOUNT)).points
    found = suspects.wrong_north(points, np.radians(0.4))
    assert found.size == pytest.approx(-4.2 + np.degrees(60.0 * MDEG), abs=0.2)
    assert found.refuse
    assert "declination of +4." in found.text


def test_a_turn_beyond_what_observations_take_names_the_north_too(campaign_with):
    def turned(number, raw, reference):
        return replace(raw, azimuth_rad=raw.azimuth_rad - np.radians(14.0)), reference

    with pytest.raises(ValueError, match=r"all azimuths are -1\d\.\d+ deg off: counted from magnetic north"):
        RawPasses(campaign_with(turned), 0).process(Known(model=MOUNT))


@pytest.mark.parametrize(("factor", "words"), [(180.0 / np.pi, "large: degrees"), (np.pi / 180.0, "small: radians")])
def test_another_unit_is_told_by_its_factor(campaign_with, factor, words):
    def scaled(number, raw, reference):
        return replace(raw, azimuth_rad=factor * raw.azimuth_rad, elevation_rad=factor * raw.elevation_rad), reference

    with pytest.raises(ValueError, match=rf"57\.3 times too {words}"):
        RawPasses(campaign_with(scaled), 0)
