"""The fit of a scan: planted truths come back at the Cramer-Rao bound, and bad data by name."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rf_pointing.radiometry.scan_fit import E1, E2, LEVEL, WIDTH, Samples, ScanFitParams, fit_scan
from rf_pointing.rf.beam import BeamParams
from test.radiometry.scans import BEAM, S_BAND_RAD, SYSTEM_K, scan_of

KNOWN = ScanFitParams(beam=BEAM)
SIGMAS = 5.0


@settings(max_examples=25, deadline=None)
@given(
    st.sampled_from(["cross", "raster", "nine_point", "lissajous", "rosette"]),
    st.tuples(st.floats(-0.5, 0.5), st.floats(-0.5, 0.5)), st.floats(0.9, 1.15),
    st.tuples(st.floats(-0.1, 0.1), st.floats(-0.1, 0.1)), st.sampled_from([0.0, 0.3]), st.integers(0, 2**31),
)  # fmt: skip
def test_planted_beams_come_back_within_their_sigmas(pattern, offset, widened, ellipse, radius, seed) -> None:
    planted = tuple(S_BAND_RAD * each for each in offset)
    taken, clean = (
        scan_of(
            np.random.default_rng(seed), pattern=pattern, offset_rad=planted, widened=widened, ellipse=ellipse,
            radius_rad=radius * S_BAND_RAD, source_k=300.0, drift_k_s=0.01, tilt_k_rad=10.0, bandwidth_hz=bandwidth_hz,
        )
        for bandwidth_hz in (1e6, 1e20)
    )  # fmt: skip
    usual = fit_scan(taken, KNOWN.replace(radius_rad=radius * S_BAND_RAD))
    assert (np.abs(np.subtract(usual.offset_rad, planted)) < SIGMAS * np.array(usual.sigma_rad)).all()
    fit = fit_scan(taken, KNOWN.replace(radius_rad=radius * S_BAND_RAD, shape="ellipse"))
    truth = [*planted, widened * S_BAND_RAD, *ellipse, 300.0]
    sigma = np.sqrt(np.diagonal(fit.covariance))[:6]
    assert (np.abs(fit.values[:6] - truth) < SIGMAS * sigma).all()
    # Nothing is edited but the samples whose planted noise is beyond the limit.
    drawn = np.abs(taken.power - clean.power) / taken.sigma
    assert sum(fit.edited.values()) <= np.count_nonzero(drawn > 0.95 * KNOWN.edit_sigmas)


@pytest.mark.parametrize(("source_k", "shape"), [(2.8, "fixed"), (20.0, "width"), (300.0, "ellipse")])
def test_the_estimate_reaches_the_cramer_rao_bound_within_a_tenth(
    source_k: float, shape: str, random: np.random.Generator
) -> None:
    """Cassiopeia A in S band, a strong source and the Sun in a dish of 3.7 m; 120 scans each."""
    fits = [
        fit_scan(scan_of(random, source_k=source_k, repetitions=1), KNOWN.replace(shape=shape, pattern_error=0.0))
        for _ in range(120)
    ]
    offsets = np.array([fit.offset_rad for fit in fits])
    bound = np.mean([fit.covariance[:2, :2] for fit in fits], axis=0)
    ratio = np.sqrt(np.var(offsets, axis=0) / np.diagonal(bound))
    # 120 scans give a standard deviation to 6.5 %, both axes together to 4.6 %.
    assert math.sqrt(np.mean(ratio**2)) < 1.1, ratio
    assert (ratio < 1.16).all(), ratio
    assert (np.abs(offsets.mean(axis=0) - (0.004, -0.007)) < SIGMAS * np.sqrt(np.diagonal(bound) / 120.0)).all()


def test_a_carrier_has_no_baseline_and_follows_the_strength_of_its_satellite(random: np.random.Generator) -> None:
    taken = scan_of(random, source_k=1.0)
    strength = np.linspace(0.7, 1.4, len(taken.t_s))
    clean = (taken.power - SYSTEM_K) * 0.0 + strength * np.exp(
        -4.0 * math.log(2.0)
        * ((0.004 - taken.cross_elevation_rad) ** 2 + (-0.007 - taken.elevation_rad) ** 2) / S_BAND_RAD**2
    )  # fmt: skip
    sigma = np.sqrt(1e-6 + 1e-4 * clean)
    power = 1e-17 * (clean + sigma * random.standard_normal(len(clean)))
    fit = fit_scan(taken._replace(power=power, sigma=1e-17 * sigma, strength=strength), KNOWN.replace(carrier=True))
    assert np.abs(np.array(fit.offset_rad) - (0.004, -0.007)).max() < SIGMAS * max(fit.sigma_rad)
    assert fit.values[LEVEL] == pytest.approx(1e-17, rel=0.01)


def test_the_shape_is_fitted_only_as_far_as_the_source_shows_it(random: np.random.Generator) -> None:
    shapes = [fit_scan(scan_of(random, source_k=level), KNOWN).shape for level in (0.25, 4.0, 300.0)]
    assert shapes[0] == "fixed"
    assert shapes[1] in ("width", "axes")
    assert shapes[2] == "ellipse"


def test_a_drift_tells_the_offset_along_it_and_says_that_it_knows_none_across(random: np.random.Generator) -> None:
    fit = fit_scan(scan_of(random, pattern="drift", source_k=300.0, repetitions=1), KNOWN)
    assert abs(fit.offset_rad[0] - 0.004) < SIGMAS * fit.sigma_rad[0] < 0.01 * S_BAND_RAD
    assert fit.sigma_rad[1] == pytest.approx(0.5 * S_BAND_RAD, rel=0.05)


# Bad data


def replaced(taken: Samples, rows: np.ndarray, power: np.ndarray | float) -> Samples:
    powers = taken.power.copy()
    powers[rows] = power
    return taken._replace(power=powers)


def distance(taken: Samples, x: float, y: float) -> np.ndarray:
    return np.hypot(taken.cross_elevation_rad - x, taken.elevation_rad - y)


def accurate(fit) -> bool:
    return bool((np.abs(np.array(fit.offset_rad) - (0.004, -0.007)) < SIGMAS * np.array(fit.sigma_rad)).all())


def test_interference_and_dropouts_are_edited_by_name(random: np.random.Generator) -> None:
    taken = scan_of(random)
    bad = replaced(replaced(taken, np.arange(40, 48), random.uniform(350, 500, 8)), np.arange(300, 305), 20.0)
    fit = fit_scan(bad, KNOWN)
    assert fit.edited == {"interference": 8, "dropout": 5}
    assert accurate(fit)


def test_clipped_power_is_edited_and_the_flanks_still_give_the_offset(random: np.random.Generator) -> None:
    taken = scan_of(random, source_k=300.0)
    fit = fit_scan(taken._replace(power=np.minimum(taken.power, SYSTEM_K + 220.0)), KNOWN)
    assert fit.edited["clipped power"] > 20
    assert accurate(fit)


def test_a_second_source_is_edited_with_its_place(random: np.random.Generator) -> None:
    taken = scan_of(random, pattern="raster", repetitions=1)
    place = 1.4 * S_BAND_RAD, 1.2 * S_BAND_RAD
    other = 15.0 * np.exp(-4.0 * math.log(2.0) * (distance(taken, *place) / S_BAND_RAD) ** 2)
    fit = fit_scan(taken._replace(power=taken.power + other), KNOWN)
    assert any(reason.startswith("a second source (+3.") for reason in fit.edited)
    assert np.abs(np.array(fit.offset_rad) - (0.004, -0.007)).max() < 0.03 * S_BAND_RAD


def late(taken: Samples, late_s: float) -> Samples:
    """Return powers whose tags are late: the beam was elsewhere when they were measured."""
    return taken._replace(power=np.interp(taken.t_s - late_s, taken.t_s, taken.power))


@pytest.mark.parametrize(("late_s", "word"), [(1.5, "1.[45]. s late"), (-1.5, "1.[45]. s early")])
def test_wrong_time_tags_are_refused_with_the_time(late_s: float, word: str, random: np.random.Generator) -> None:
    with pytest.raises(ValueError, match=f"time tags of the powers are {word}"):
        fit_scan(late(scan_of(random), late_s), KNOWN)


def test_the_power_of_noise_is_no_carrier(random: np.random.Generator) -> None:
    empty = scan_of(random)
    for _ in range(20):
        power = random.exponential(size=len(empty.t_s))
        with pytest.raises(ValueError, match="no source was seen"):
            fit_scan(empty._replace(power=power, sigma=np.sqrt(1.0 + 2.0 * power)), KNOWN.replace(carrier=True))


def test_rain_is_refused(random: np.random.Generator) -> None:
    taken = scan_of(random)
    cloud = 15.0 * np.exp(-(((taken.t_s - 60.0) / 25.0) ** 2))
    with pytest.raises(ValueError, match=r"off the source the power comes and goes by \d+% of the source's: rain"):
        fit_scan(taken._replace(power=taken.power + cloud), KNOWN)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"source_k": 0.0}, "no source was seen"),
        ({"offset_rad": (3.0 * S_BAND_RAD, 0.0), "source_k": 300.0}, "outside of the scan|no source was seen|wide"),
        ({"widened": 2.0, "source_k": 300.0}, "wide, must be 0.6 to 1.6 times"),
    ],
)
def test_scans_that_show_nothing_are_refused_by_name(changes, words: str, random: np.random.Generator) -> None:
    with pytest.raises(ValueError, match=words):
        fit_scan(scan_of(random, **changes), KNOWN)


def test_a_tapered_aperture_is_fitted_with_its_own_pattern(random: np.random.Generator) -> None:
    beam = BeamParams(half_power_beamwidth_rad=S_BAND_RAD, pattern="tapered")
    fit = fit_scan(scan_of(random, beam=beam, source_k=300.0), ScanFitParams(beam=beam))
    assert fit.chi_squared < 1.2
    assert fit.values[WIDTH] == pytest.approx(S_BAND_RAD, rel=0.01)
    assert np.abs(fit.values[[E1, E2]]).max() < 0.02


def test_the_y_factor_is_that_of_the_beam_on_the_middle_of_the_disc(random: np.random.Generator) -> None:
    """A disc a third of a beam wide fills it to 0.86: the level of the fit is that of a point."""
    radius = 0.33 * S_BAND_RAD
    taken = scan_of(random, source_k=300.0, radius_rad=radius, offset_rad=(0.0, 0.0))
    fit = fit_scan(taken, KNOWN.replace(radius_rad=radius))
    on_axis = float(taken.power[np.argmin(distance(taken, 0.0, 0.0))])
    assert fit.y_factor()[0] == pytest.approx(on_axis / SYSTEM_K, rel=0.01)
    assert fit.values[LEVEL] == pytest.approx(300.0, rel=0.01)
