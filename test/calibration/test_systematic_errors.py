"""Systematic errors that a mount would take in are named with their size; a right campaign has none."""

import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from rf_pointing.calibration import (
    BiasModel,
    FitOptions,
    PassPriors,
    PriorKnowledge,
    RawPasses,
    TrackedPass,
    fit_bias_model,
    held_at_zero,
    systematic_errors,
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
TIMED = systematic_errors.timed(ORBIT)
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
    points = RawPasses(passes, 0).process(PriorKnowledge(model=MOUNT)).points
    return fitted_points(points, orbit), points


def fitted_points(points, orbit=ORBIT, **more):
    options = FitOptions(form="rotation", scale_covariance=True)
    held = held_at_zero(TERMS)
    return fit_bias_model(points, terms=TERMS, held=held, pass_priors=orbit, options=options, **more)


def test_a_right_campaign_is_not_suspected(campaign_with):
    passes = campaign_with()
    fit, points = fitted(passes)
    assert systematic_errors.refraction_and_site(fit, points, AIR)[0] is None
    assert systematic_errors.common_clock(fit, dict.fromkeys(TERMS, 0.0)) is None
    assert systematic_errors.clock_by_ranges(passes) is None
    assert systematic_errors.wrong_north(points, 0.0) is None
    assert systematic_errors.north_doubt(fit, 0.0) is None
    assert systematic_errors.late_passes(fitted_points(points, TIMED), points)[:2] == ({}, None)


@pytest.mark.parametrize(("kind", "expected"), [("twice", 1.0), ("removed", -1.0)])
def test_refraction_applied_twice_or_removed_is_measured(campaign_with, kind, expected):
    def bent(number, raw, reference):
        apparent = AIR.apply(raw.elevation_rad) if kind == "twice" else AIR.remove(raw.elevation_rad)
        return replace(raw, elevation_rad=apparent), reference

    found, elsewhere = systematic_errors.refraction_and_site(*fitted(campaign_with(bent)), AIR)
    assert elsewhere["site"] == 0.0
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

    fit, points = fitted(campaign_with(elsewhere))
    air, gains = systematic_errors.refraction_and_site(fit, points, AIR)
    assert air is None
    nuisance = systematic_errors.site_nuisance(points)
    free = fitted_points(points, nuisances=[nuisance])
    assert not systematic_errors.far_site(free)
    found = systematic_errors.wrong_site(free, gains["site"], np.zeros(3))
    assert found.kind == "site"
    assert found.refuse
    assert found.size == pytest.approx(200.0, abs=4.0 * found.sigma)
    assert found.sigma < 40.0
    east, north = (float(re.search(rf"([+-]\d+) m {axis}", found.text)[1]) for axis in ("east", "north"))
    assert (east, north) == pytest.approx((120.0, -160.0), abs=4.0 * found.sigma)


def test_one_late_pass_is_named_and_the_others_are_not(campaign_with):
    passes = campaign_with(lambda k, raw, reference: (replace(raw, t_s=raw.t_s + 0.5 * (k == 6)), reference))
    fit, points = fitted(passes, TIMED)
    found, undecided, least_s = systematic_errors.late_passes(fit, points)
    assert undecided is None
    assert 0.05 < least_s < 0.2
    assert list(found) == [6]
    assert found[6].size == pytest.approx(0.5, rel=0.1)
    assert "late where the others are within" in found[6].text


@pytest.mark.parametrize(("which", "late_s"), [((1, 4, 7), 0.5), ((0, 2, 5, 8), 0.2), ((0, 2, 4, 6, 8), 0.5)])
def test_any_minority_of_late_passes_is_named_and_half_of_them_is_no_minority(campaign_with, which, late_s):
    passes = campaign_with(lambda k, raw, reference: (replace(raw, t_s=raw.t_s + late_s * (k in which)), reference))
    fit, points = fitted(passes, TIMED)
    found, undecided, _ = systematic_errors.late_passes(fit, points)
    # About the times of their groups they scatter as passes do that are not late.
    assert systematic_errors.scatter_of_lateness(fit, {}) < 0.02
    if len(which) < 5:
        assert undecided is None
        assert tuple(found) == which
        assert [one.size for one in found.values()] == pytest.approx([late_s] * len(which), abs=0.06)
    else:
        assert not found
        assert undecided.refuse
        assert abs(undecided.size) == pytest.approx(late_s, abs=0.06)
        assert "no time has most of them: 5 and 5 of 10 differ" in undecided.text


@pytest.mark.parametrize("late_s", [0.5, -0.8])
@pytest.mark.parametrize("lags_s", [(-1.022, -1.907), (0.6, 0.35), (0.4, -0.5)])
@pytest.mark.parametrize(("own_s2", "verdict"), [((0.0, 0.0), True), ((0.3, -0.4), False)])
def test_a_clock_takes_the_acceleration_lags_of_both_axes_away_or_is_not_told(late_s, lags_s, own_s2, verdict):
    """Taylor series of the delay: x6 - tau and x7 - x6 tau + tau^2 / 2."""
    names = ("azimuth_velocity_lag", "elevation_velocity_lag", "azimuth_acceleration_lag", "elevation_acceleration_lag")
    values = np.concatenate([np.subtract(lags_s, late_s), own_s2 - np.multiply(lags_s, late_s) + 0.5 * late_s**2])
    fit = SimpleNamespace(
        model=BiasModel.zero(), names=names, values=values, covariance=np.diag([0.005, 0.005, 0.01, 0.01]) ** 2
    )
    found = systematic_errors.common_clock(fit, {})
    assert found.refuse is verdict
    if verdict:
        assert found.size == pytest.approx(late_s, abs=1e-9)
        assert found.sigma == pytest.approx(0.01 / np.hypot(*lags_s), rel=1e-6)
    else:
        assert "which a clock error does not explain" in found.text
    right = SimpleNamespace(
        model=BiasModel.zero(), names=names, values=np.array([*lags_s, 0.0, 0.0]), covariance=fit.covariance
    )
    assert systematic_errors.common_clock(right, {}) is None


@pytest.mark.parametrize("values", [(0.316, 0.0, -0.265, -0.183), (0.002, 0.054, -0.092, -0.055)])
def test_a_clock_that_a_lag_of_one_axis_cancels_is_not_named(values):
    """Two acceleration lags lie on the curve of one clock by chance; the other axis shows none."""
    names = ("azimuth_velocity_lag", "elevation_velocity_lag", "azimuth_acceleration_lag", "elevation_acceleration_lag")
    covariance = np.diag([0.002, 0.002, 0.02, 0.03]) ** 2
    fit = SimpleNamespace(model=BiasModel.zero(), names=names, values=np.array(values), covariance=covariance)
    found = systematic_errors.common_clock(fit, {})
    assert found is None or not found.refuse
    # The same acceleration lags next to lags of both axes are those of a clock, or of the mount.
    tau = -values[0] + np.sqrt(values[0] ** 2 - 2.0 * values[2])
    other = SimpleNamespace(
        model=BiasModel.zero(), names=names, values=np.array([*values[:3], values[2] - 0.2 * tau]),
        covariance=covariance,
    )  # fmt: skip
    other.values[1] = values[0] + 0.2
    assert systematic_errors.common_clock(other, {}).refuse


def test_a_clock_is_named_with_its_sigma_or_left_open(random):
    """0.5 s next to mounts without acceleration lags, seen as from low latitudes; two times may fit."""
    names = ("azimuth_velocity_lag", "elevation_velocity_lag", "azimuth_acceleration_lag", "elevation_acceleration_lag")
    sigma, silent, held, left_open = np.array([4e-4, 4e-4, 0.034, 0.061]), 0, [], []
    for _ in range(200):
        lags = 0.5 * random.standard_normal(2) * (random.random(2) < 0.5)
        values = np.concatenate([lags - 0.5, 0.125 - 0.5 * lags]) + sigma * random.standard_normal(4)
        fit = SimpleNamespace(model=BiasModel.zero(), names=names, values=values, covariance=np.diag(sigma) ** 2)
        low_s, high_s = systematic_errors.open_clock(fit, {})
        left_open.append(low_s <= 0.5 <= high_s)
        found = systematic_errors.common_clock(fit, {})
        silent += found is None
        if found is not None:
            sizes = re.findall(r"([\d.]+) s (late|early)(?: \(\+/- ([\d.]+) s\))?", found.text)
            signs = {"late": 1.0, "early": -1.0}
            held.append(
                min(abs(signs[word] * float(size) - 0.5) / float(by or found.sigma) for size, word, by in sizes)
            )
    assert silent <= 12
    assert np.mean(np.array(held) < 3.0) > 0.93
    assert np.mean(left_open) > 0.9


def test_air_that_bends_more_than_the_standard_is_a_nuisance_and_not_a_mount(campaign_with):
    def bent(_, raw, reference):
        more = 0.15 * (raw.elevation_rad - AIR.remove(raw.elevation_rad))
        return replace(raw, elevation_rad=raw.elevation_rad + more), reference

    _, points = fitted(campaign_with(bent))
    air = systematic_errors.refraction_nuisance(points, AIR, 0.1)
    pulls = []
    for nuisances in ([], [air]):
        fit = fitted_points(points, nuisances=nuisances)
        truth = np.array([MOUNT.coefficients[name] for name in fit.names])
        pulls.append(float(np.max(np.abs((fit.values - truth) / fit.sigma))))
    assert pulls[1] < 4.0 < pulls[0]
    assert fit.nuisance_values[0] == pytest.approx(0.15, abs=4.0 * np.sqrt(fit.nuisance_covariance[0, 0]))


def test_time_tags_late_in_all_passes_are_equal_lags_or_late_ranges(campaign_with):
    passes = campaign_with(lambda _, raw, reference: (replace(raw, t_s=raw.t_s + 0.5), reference))
    fit, _ = fitted(passes)
    by_lags, by_ranges = (
        systematic_errors.common_clock(fit, dict.fromkeys(TERMS, 0.0)),
        systematic_errors.clock_by_ranges(passes),
    )
    assert by_lags.size == pytest.approx(0.5, abs=0.02)
    assert by_ranges.size == pytest.approx(0.5, abs=0.01)
    assert by_ranges.refuse
    known = {"azimuth_velocity_lag": -0.5, "elevation_velocity_lag": -0.5}
    # A delay tau known as a lag is tau^2 / 2 of acceleration too; without that a clock does not explain what is left.
    rest = systematic_errors.common_clock(fit, known)
    assert "which a clock error does not explain" in rest.text
    assert abs(rest.size) < 0.05
    known |= {"azimuth_acceleration_lag": 0.125, "elevation_acceleration_lag": 0.125}
    assert systematic_errors.common_clock(fit, known) is None


def test_another_north_is_told_by_its_turn(campaign_with):
    def turned(number, raw, reference):
        return replace(raw, azimuth_rad=raw.azimuth_rad - np.radians(4.2)), reference

    points = RawPasses(campaign_with(turned), 0).process(PriorKnowledge(model=MOUNT)).points
    found = systematic_errors.wrong_north(points, np.radians(0.4))
    assert found.size == pytest.approx(-4.2 + np.degrees(60.0 * MDEG), abs=0.2)
    assert found.refuse
    assert "declination of +4." in found.text


def test_a_turn_beyond_what_observations_take_names_the_north_too(campaign_with):
    def turned(number, raw, reference):
        return replace(raw, azimuth_rad=raw.azimuth_rad - np.radians(14.0)), reference

    with pytest.raises(
        ValueError, match=r"all azimuths are -1\d\.\d+ deg off: an offset, or counted from magnetic north"
    ):
        RawPasses(campaign_with(turned), 0).process(PriorKnowledge(model=MOUNT))


def test_an_azimuth_offset_is_doubted_that_is_large_or_the_convergence_of_the_grid(campaign_with):
    fit, _ = fitted(campaign_with())
    place = fit.names.index("azimuth_offset")
    for offset_deg, convergence_deg, sigma_deg, doubted in (
        (1.01, 0.0, 0.01, True),
        (-1.01, 0.0, 0.01, True),
        (0.99, 0.0, 0.01, False),
        (-0.5, 0.5, 0.01, True),
        (-0.5, 0.529, 0.01, True),
        (-0.5, 0.531, 0.01, False),
        (0.5, 0.5, 0.01, False),
        # A convergence that the sigma does not tell from zero explains nothing.
        (-0.2, 0.2, 0.0099, True),
        (-0.2, 0.2, 0.0101, False),
    ):
        values, covariance = fit.values.copy(), fit.covariance.copy()
        values[place], covariance[place, place] = np.radians(offset_deg), np.radians(sigma_deg) ** 2
        found = systematic_errors.north_doubt(
            replace(fit, values=values, covariance=covariance), np.radians(convergence_deg)
        )
        assert (found is not None) is doubted
        if found:
            assert (found.size, found.sigma, found.refuse) == pytest.approx((offset_deg, sigma_deg, False))
            assert f"The convergence of the UTM grid here is {convergence_deg:+.2f} deg" in found.text


def test_a_range_that_is_far_off_among_biased_ones_makes_no_clock(campaign_with):
    """Every station has a bias of its ranges; here of 30 km, and one range of a hundred is 100 km off."""

    def spoilt(_, raw, reference):
        far = np.where(np.arange(len(raw)) % 100 == 50, 1e5 * np.sign(raw.range_rate_m_s), 0.0)
        return replace(raw, range_m=raw.range_m + 30e3 + far), reference

    assert systematic_errors.clock_by_ranges(campaign_with(spoilt)) is None


@pytest.mark.parametrize(
    ("lags_s", "sigma_s", "clock"),
    [
        # The mean is weighted by the squares: (9 x 0.100 + 16 x 0.104) / 25.
        ((0.100, 0.104), (0.004, 0.003), (-0.10256, 0.0024, True)),
        ((-0.100, -0.104), (0.004, 0.003), (0.10256, 0.0024, True)),
        # The lags differ with a sigma of 10.0 ms and less, or more.
        ((0.1, 0.1), (0.0059, 0.0080), (-0.1, 0.0047484, True)),
        ((0.1, 0.1), (0.0061, 0.0080), (-0.1, 0.0048507, False)),
        ((0.051, 0.051), (0.004, 0.003), (-0.051, 0.0024, True)),
        ((0.049, 0.049), (0.004, 0.003), None),
        # Five sigma of the mean are 70.7 ms.
        ((0.072, 0.072), (0.02, 0.02), (-0.072, 0.0141421, False)),
        ((0.069, 0.069), (0.02, 0.02), None),
        ((0.100, -0.100), (0.004, 0.003), None),
    ],
)
def test_a_clock_is_the_weighted_mean_of_both_lags_beyond_those_that_are_known(campaign_with, lags_s, sigma_s, clock):
    fit, _ = fitted(campaign_with()[:6])
    names = ("azimuth_velocity_lag", "elevation_velocity_lag")
    places = [fit.names.index(name) for name in names]
    values, covariance = fit.values.copy(), fit.covariance.copy()
    values[places] = np.add(lags_s, (0.3, -0.2))
    covariance[np.ix_(places, places)] = np.diag(np.square(sigma_s))
    shifted = replace(fit, values=values, covariance=covariance)
    found = systematic_errors.common_clock(shifted, dict(zip(names, (0.3, -0.2), strict=True)))
    assert (found is None) is (clock is None)
    if clock:
        assert (found.size, found.sigma, found.refuse) == pytest.approx(clock, rel=1e-4)
        assert (found.kind, found.unit) == ("clock", "s")


@pytest.mark.parametrize("absent", ["azimuth_velocity_lag", "elevation_velocity_lag"])
def test_one_lag_alone_tells_of_no_clock(absent):
    names = tuple(name for name in TERMS if name != absent)
    assert (
        systematic_errors.common_clock(SimpleNamespace(model=BiasModel.zero(), names=names), dict.fromkeys(TERMS, 0.0))
        is None
    )
