import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from rf_pointing.calibration import (
    BiasModel,
    FitOptions,
    Ionosphere,
    PriorKnowledge,
    RawPasses,
    SectorRule,
    TrackedPass,
    fit_bias_model,
    held_at_zero,
    select_observations,
    split_passes,
)
from rf_pointing.calibration.pass_errors import PassErrors, displaced
from rf_pointing.core import MDEG, wrap_rad

IONOSPHERE = Ionosphere(electrons_per_m2=5e17, frequency_hz=2.25e9)
NOISE_RAD = 20.0 * MDEG


def process_pass(raw, reference, number, ionosphere, model):
    known = PriorKnowledge(model=model, form="printed")
    return RawPasses([TrackedPass(raw, reference, ionosphere)], number).process(known)


def scatter(processed, channel):
    """Return the noise of a sample that the smoothing reports."""
    return float(re.search(rf"{channel} ([\d.e-]+)", processed.reports[3].note)[1])


def pulls(processed, model):
    points = processed.points
    offset = model.offset_rad(*points.motion())
    return (
        (points.residual_azimuth_rad - offset[0]) / points.sigma_azimuth_rad,
        (points.residual_elevation_rad - offset[1]) / points.sigma_elevation_rad,
    )


def test_points_are_10_s_apart_and_their_sigma_is_that_of_80_averaged_samples(track, raw_pass, table_1):
    reference = track(5.0)
    processed = process_pass(raw_pass(reference, table_1, None, NOISE_RAD), reference, 0, None, table_1)
    step = np.diff(processed.points.t_s)
    assert np.median(step) == pytest.approx(10.0, abs=1e-6)
    # 3-sigma editing takes 2.7 % of the variance of a normal distribution away.
    expected = NOISE_RAD / np.sqrt(80.0)
    assert np.median(processed.points.sigma_elevation_rad) == pytest.approx(expected, rel=0.05)
    assert scatter(processed, "elevation_rad") == pytest.approx(NOISE_RAD / np.sqrt(8.0), rel=0.05)


def test_every_stage_reports_what_it_dropped_and_why(track, raw_pass, table_1):
    reference = track(5.0)
    raw = raw_pass(reference, table_1, None, NOISE_RAD)
    azimuth, good, times = raw.azimuth_rad.copy(), raw.good.copy(), raw.t_s.copy()
    azimuth[1000] = np.nan
    azimuth[2000:2003] += 0.01
    good[50:60] = False
    times[3000] += 500.0
    times[3500] = times[3499]
    elevation = raw.elevation_rad.copy()
    elevation[4000] = 40.0
    spoiled = replace(raw, azimuth_rad=azimuth, elevation_rad=elevation, good=good, t_s=times)
    processed = process_pass(spoiled, reference, 0, None, table_1)
    validation, outliers = processed.reports[:2]
    assert validation.before - validation.after == sum(validation.dropped.values()) == 14
    assert outliers.dropped["azimuth_rad beyond 3 sigma"] >= 3
    assert [report.stage for report in processed.reports] == [
        "validation", "outliers", "thinning", "smoothing", "corrections",
    ]  # fmt: skip
    assert "time jump" in validation.text()
    assert max(np.max(np.abs(pull)) for pull in pulls(processed, table_1)) < 5.0


def test_what_bends_within_a_point_is_no_bias_once_the_model_is_known(track, raw_pass, table_1):
    reference = track(5.0, miss_m=160e3)
    raw = raw_pass(reference, table_1, None, 1e-9)
    bias = {}
    for name, model in (("blind", BiasModel.zero()), ("known", table_1)):
        points = process_pass(raw, reference, 0, None, model).points
        azimuth = points.residual_azimuth_rad - table_1.offset_rad(*points.motion())[0]
        bias[name] = np.max(np.abs(azimuth * np.cos(points.true_elevation_rad)))
    assert bias["blind"] > 0.1 * MDEG
    assert bias["known"] < 0.01 * MDEG


def test_a_pass_without_one_sound_sample_is_refused_with_the_reasons(track, raw_pass, table_1):
    reference = track(5.0)
    raw = raw_pass(reference, table_1, None, NOISE_RAD)
    with pytest.raises(
        ValueError, match=r"pass 7 of bird: validation: 6384 -> 0 \(dropped 6384 flagged by the station"
    ):
        process_pass(replace(raw, good=np.zeros(len(raw), dtype=bool)), reference, 7, None, table_1)
    with pytest.raises(ValueError, match="outside the reference orbit"):
        process_pass(replace(raw, t_s=raw.t_s + 1e5), reference, 7, None, table_1)


def on_the_sky(raw, random, correlated_rad=0.0):
    """Return the samples with noise that is as large across as up, with noise correlated over 3 s added."""
    count, decay = len(raw), np.exp(-0.125 / 3.0)
    noise = 5.0 * MDEG * random.standard_normal((2, count))
    drift = lfilter([np.sqrt(1.0 - decay**2)], [1.0, -decay], random.standard_normal((2, count)))
    noise += correlated_rad * drift
    return replace(
        raw,
        azimuth_rad=raw.azimuth_rad + noise[0] / np.cos(raw.elevation_rad),
        elevation_rad=raw.elevation_rad + noise[1],
    )


def test_noise_on_the_sky_gives_high_points_their_larger_azimuth_sigma_and_drops_none(track, raw_pass, table_1, random):
    reference = track(5.0, miss_m=120e3)
    raw = on_the_sky(raw_pass(reference, table_1, None, 1e-9), random)
    processed = process_pass(raw, reference, 0, None, table_1)
    assert processed.reports[3].dropped["not along a line"] <= 16
    points = processed.points
    high = points.true_elevation_rad > np.radians(75.0)
    assert np.sum(high) >= 4
    across = points.sigma_azimuth_rad * np.cos(points.true_elevation_rad)
    assert np.median(across[high]) == pytest.approx(np.median(across[~high]), rel=0.25)
    assert np.median(points.sigma_elevation_rad[high]) == pytest.approx(np.median(across[high]), rel=0.25)
    azimuth, elevation = pulls(processed, table_1)
    assert 0.75 < np.std(azimuth) < 1.25
    assert 0.75 < np.std(elevation) < 1.25


def test_noise_that_hangs_together_is_measured_between_points_and_costs_none(track, raw_pass, table_1, random):
    terms, points = ("azimuth_offset", "elevation_offset"), {}
    held = {name: value for name, value in table_1.coefficients.items() if name not in terms}
    for kind, correlated in (("quiet", 0.0), ("windy", 5.0 * MDEG)):
        tracks = [track(5.0, miss, 0.7, 1e9 + 6000.0 * k) for k, miss in enumerate(np.linspace(350e3, 900e3, 6))]
        raw = [on_the_sky(raw_pass(one, table_1, None, 1e-9), random, correlated) for one in tracks]
        passes = RawPasses([TrackedPass(one, place) for one, place in zip(raw, tracks, strict=True)], 0)
        points[kind] = passes.process(PriorKnowledge(model=table_1, form="printed")).points
    assert len(points["windy"]) > 0.98 * len(points["quiet"])
    options = FitOptions(scale_covariance=True)
    quiet, windy = (
        fit_bias_model(points[kind], terms=terms, held=held, options=options).noise for kind in ("quiet", "windy")
    )
    # Noise of tau = 3 s has the slow density 2 tau sigma^2: 48 times that of white noise at 8 samples/s.  A line through
    # 10 s takes two thirds of it along, so a fifteenth of it would be stated without the factor.
    for one, other in zip(quiet, windy, strict=True):
        assert one.factor == pytest.approx(1.0, abs=4.0 * one.uncertainty)
        assert other.factor > 5.0
    slow = windy[1].factor * np.median(points["windy"].sigma_elevation_rad) ** 2
    expected = (5.0 * MDEG) ** 2 * (0.125 + 2.0 * 3.0) / 10.0
    assert slow == pytest.approx(expected, rel=0.25)


@pytest.mark.parametrize("correlated", [0.0, 5.0 * MDEG], ids=["white", "correlated"])
def test_sigma_covers_the_truth_at_one_sample_a_second(track, raw_pass, random, correlated):
    """The trial of benchmarks/calibration_trials.py in small: 12 campaigns of 6 passes, 5 terms."""
    terms = ("azimuth_offset", "mislevel_east", "mislevel_north", "elevation_offset", "elevation_velocity_lag")
    columns = ("t_s", "azimuth_rad", "elevation_rad", "range_m", "range_rate_m_s", "good")
    tracks = [track(5.0, miss, 1.1 * k, 1e9 + 6000.0 * k) for k, miss in enumerate(np.linspace(250e3, 800e3, 6))]
    pulls = []
    for _ in range(12):
        planted = {name: 2e-3 * random.standard_normal() for name in terms}
        truth = BiasModel.zero().replace(**planted)
        passes = []
        for reference in tracks:
            raw = on_the_sky(raw_pass(reference, truth, None, 1e-9), random, correlated)
            passes.append(TrackedPass(replace(raw, **{name: getattr(raw, name)[::8] for name in columns}), reference))
        known = PriorKnowledge(model=BiasModel.zero(), form="printed")
        for _ in range(3):
            found = RawPasses(passes, 0).process(known)
            # Samples once a second are used as they are.
            assert found.reports[2].before == found.reports[2].after
            points = found.points
            options = FitOptions(scale_covariance=True)
            fit = fit_bias_model(points, terms=terms, held=held_at_zero(terms), options=options)
            scale = tuple(s * np.sqrt(one.factor) for s, one in zip(known.sigma_scale, fit.noise, strict=True))
            known = PriorKnowledge(model=fit.model, form="printed", sigma_scale=scale)
        pulls.append((fit.values - np.array([planted[name] for name in terms])) / fit.sigma)
    # Of 60 squares of a normal distribution; without the factor the correlated ones average 3.
    assert 0.5 < np.mean(np.square(pulls)) < 1.65


def test_passes_over_the_top_give_points_beyond_90_deg_from_which_the_terms_are_fitted(track, raw_pass, table_1):
    """Some are tracked direct, some over the top, and one goes over in its middle; the references know nothing of it."""
    passes = []
    for number, miss_m in enumerate((400e3, -700e3, 250e3, -900e3, 1500e3, -300e3)):
        reference = track(5.0, miss_m=miss_m, heading_rad=1.0 * number, start_t_s=1e9 + 6000.0 * number)
        raw, other = (raw_pass(one, table_1, None, NOISE_RAD) for one in (reference, reference.over_the_top()))
        if number == 5:
            late = raw.t_s > np.median(raw.t_s)
            angles = {
                name: np.where(late, other.channels[name], raw.channels[name])
                for name in ("azimuth_rad", "elevation_rad")
            }
            raw = replace(raw, **angles)
            # One wild angle is no other side.
            raw.elevation_rad[100] = 2.0
        parts = split_passes(other if number % 2 else raw, 1200.0) if number < 5 else split_passes(raw, 1200.0)
        assert len(parts) == (2 if number == 5 else 1)
        passes += [TrackedPass(part, reference) for part in parts]
    points = RawPasses(passes, 0).process(PriorKnowledge(model=table_1, form="printed")).points
    over = points.true_elevation_rad > 0.5 * np.pi
    assert 0.3 < np.mean(over) < 0.6
    assert set(points.pass_id[over].tolist()) == {1, 3, 6}
    terms = tuple(name for name in table_1.coefficients if not name.endswith("acceleration_lag"))
    for chosen in (np.ones(len(points), dtype=bool), over):
        data = points.select(chosen)
        fit = fit_bias_model(data, terms=terms, held=held_at_zero(terms))
        pull = (fit.values - [table_1.coefficients[name] for name in terms]) / fit.sigma
        assert np.max(np.abs(pull)) < 4.0


def test_an_orbit_error_moves_the_axes_of_a_dish_over_the_top_to_the_same_direction(track):
    reference = track(5.0)
    errors = PassErrors(0, {"along_track_m": 800.0, "radial_m": -300.0}, {}, float(np.mean(reference.t_s)))
    direct, over = displaced(reference, errors).over_the_top(), displaced(reference.over_the_top(), errors)
    for one, other in zip(direct.motion(), over.motion(), strict=True):
        np.testing.assert_allclose(one, other, atol=1e-9)


def test_known_errors_of_a_pass_move_the_true_motion_and_not_the_whole_error_that_is_left_to_find(
    track, raw_pass, table_1
):
    """Observed minus true of each point is the same to second order: 800 m at 1000 km are 45 mdeg."""
    reference = track(5.0, miss_m=500e3)
    errors = PassErrors(0, {"along_track_m": 800.0, "radial_m": -300.0}, {}, float(np.mean(reference.t_s)))
    raw = raw_pass(displaced(reference, errors), table_1, None, 1.0 * MDEG)
    left = {}
    for name, known in (("blind", {}), ("known", {0: errors})):
        given = PriorKnowledge(model=table_1, errors=known, sigma_scale=(2.0, 3.0) if known else (1.0, 1.0))
        left[name] = RawPasses([TrackedPass(raw, reference, None)], 0).process(given).points
    shared = np.intersect1d(left["blind"].t_s, left["known"].t_s)
    assert len(shared) > 20
    blind, known = (left[name].select(np.isin(left[name].t_s, shared)) for name in ("blind", "known"))
    np.testing.assert_allclose(known.sigma_azimuth_rad, 2.0 * blind.sigma_azimuth_rad, rtol=0.05)
    np.testing.assert_allclose(known.sigma_elevation_rad, 3.0 * blind.sigma_elevation_rad, rtol=0.05)
    apart = known.residual_elevation_rad - blind.residual_elevation_rad
    assert np.max(np.abs(apart)) < 1.0 * MDEG


def test_a_pass_of_a_single_point_is_refused(track, raw_pass, table_1):
    reference = track(5.0)
    raw = raw_pass(reference, table_1, None, NOISE_RAD)
    start = int(np.argmin(np.abs(raw.t_s - 30.0 * np.ceil(np.median(raw.t_s) / 30.0))))
    short = {name: getattr(raw, name)[start : start + 80] for name in ("t_s", "good", *raw.channels)}
    with pytest.raises(ValueError, match="no pass gives two calibration points"):
        process_pass(replace(raw, **short), reference, 0, None, table_1)


def shortened(raw, rows):
    """Return the pass with only these samples good."""
    good = np.zeros(len(raw), dtype=bool)
    good[rows] = True
    return replace(raw, good=good)


def test_passes_keep_their_numbers_and_those_that_give_nothing_are_told(track, raw_pass, table_1):
    references = [track(5.0, start_t_s=1e9 + 6000.0 * number) for number in range(4)]
    raw = [raw_pass(reference, table_1, None, NOISE_RAD) for reference in references]
    raw[1], raw[2] = shortened(raw[1], [3000]), shortened(raw[2], [3000, 3001])
    passes = [TrackedPass(one, reference) for one, reference in zip(raw, references, strict=True)]
    found = RawPasses(passes, 5).process(PriorKnowledge(model=table_1, form="printed"))
    assert found.points.passes.tolist() == [5, 8]
    assert found.notes == (
        "pass 6 of bird: validation: 6384 -> 1 (dropped 6383 flagged by the station)",
        "pass 7: too few samples",
    )
    for number, reference in ((5, references[0]), (8, references[3])):
        assert np.all(reference.covers(found.points.t_s[found.points.pass_id == number]))
    outliers, thinning, smoothing, corrections = found.reports[1:]
    assert outliers.before == 2 * 6384 + 2
    assert outliers.before - outliers.after == sum(outliers.dropped.values()) > 0
    assert (thinning.before, smoothing.before) == (outliers.after, thinning.after)
    assert corrections.before == corrections.after == len(found.points) == smoothing.after


def test_channels_that_some_passes_do_not_have_judge_none_of_them(track, raw_pass, table_1):
    references = [track(5.0, start_t_s=1e9 + 6000.0 * number) for number in range(2)]
    full, bare = (raw_pass(reference, table_1, None, NOISE_RAD) for reference in references)
    bare = replace(bare, range_m=None)
    passes = [TrackedPass(one, reference) for one, reference in zip((full, bare), references, strict=True)]
    for given in (passes, passes[::-1]):
        found = RawPasses(given, 0).process(PriorKnowledge(model=table_1, form="printed"))
        assert list(found.reports[1].dropped) == [
            f"{name} beyond 3 sigma" for name in ("azimuth_rad", "elevation_rad", "range_rate_m_s")
        ]
        assert "range_m" not in found.reports[2].note
        assert found.reports[2].note.startswith("scatter azimuth_rad ")
        assert len(found.points) > 100


@pytest.mark.parametrize("over", [False, True], ids=["direct", "over the top"])
def test_bending_and_delay_of_the_ionosphere_are_taken_off_also_over_the_top(track, raw_pass, over):
    """Seen upward on the sky, which is downward on the axis of a dish over the top."""
    reference = track(5.0)
    raw = raw_pass(reference, BiasModel.zero(), IONOSPHERE, 0.0)
    seen = reference.at(raw.t_s)
    raw = replace(raw, range_m=seen.range_m + IONOSPHERE.delay_m(seen.elevation_rad))
    if over:
        raw = replace(raw, azimuth_rad=raw.azimuth_rad + np.pi, elevation_rad=np.pi - raw.elevation_rad)
    for given in (reference, reference.over_the_top()) if over else (reference,):
        one = TrackedPass(raw, given, IONOSPHERE)
        np.testing.assert_allclose(wrap_rad(one.residuals["azimuth_rad"]), 0.0, atol=1e-9)
        np.testing.assert_allclose(one.residuals["elevation_rad"], 0.0, atol=1e-9)
        np.testing.assert_allclose(one.residuals["range_m"], 0.0, atol=1e-6)
    bare = TrackedPass(replace(raw, range_m=None), reference, IONOSPHERE)
    assert "range_m" not in bare.residuals
    np.testing.assert_allclose(bare.residuals["elevation_rad"], 0.0, atol=1e-9)
    # Some mdeg that are there without the correction.
    plain = TrackedPass(raw, reference).residuals["elevation_rad"]
    assert np.max(np.abs(plain)) > 0.3 * MDEG
    for ionosphere, note in ((None, "none"), (IONOSPHERE, "ionosphere")):
        report = process_pass(raw, reference, 0, ionosphere, BiasModel.zero()).reports[4]
        assert (report.note, report.dropped) == (note, {})


def test_thin_sectors_are_refused_where_they_must_be_full(track, raw_pass, table_1):
    reference = track(5.0)
    points = process_pass(raw_pass(reference, table_1, None, NOISE_RAD), reference, 0, None, table_1).points
    with pytest.raises(ValueError, match="of 36 sectors have < 25"):
        select_observations([points], SectorRule(), require_full=True)
    rule = SectorRule(azimuth_sectors=1, elevation_edges_rad=(0.2, 1.2), fewest=5, most=8)
    chosen, coverage, report = select_observations([points], rule, require_full=True)
    assert (coverage.thin, coverage.counts.tolist()) == ((), [8])
    assert (report.stage, report.before, report.after, len(chosen)) == ("selection", len(points), 8, 8)
    assert report.note == "1 of 1 sectors have at least 5"


def test_a_reference_of_the_axes_over_the_top_stays_also_close_to_the_zenith(track, raw_pass):
    """From 92 to 105 deg on the axis."""
    whole = track(1.0, miss_m=100e3)
    high = whole.at(whole.t_s[whole.elevation_rad > np.radians(75.0)])
    over = high.over_the_top()
    raw = raw_pass(over, BiasModel.zero(), None, 0.0)
    assert TrackedPass(raw, over).reference is over
    found = TrackedPass(raw, high)
    np.testing.assert_array_equal(found.reference.elevation_rad, over.elevation_rad)
    np.testing.assert_allclose(found.residuals["elevation_rad"], 0.0, atol=1e-12)
    direct = raw_pass(high, BiasModel.zero(), None, 0.0)
    assert TrackedPass(direct, high).reference is high
