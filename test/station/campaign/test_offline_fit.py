"""Offline fits find what was planted in points and raw passes, and refuse what would spoil the model."""

import dataclasses
import math
import re
from typing import Any

import numpy as np
import pytest

from rf_pointing.calibration import BiasModel, Ionosphere, ModelVersion, Observations, RawTracking, TrackedPass
from rf_pointing.calibration.pass_errors import pass_partials
from rf_pointing.core import MDEG
from rf_pointing.ephemeris import find_elements, site, verification_elements
from rf_pointing.station.campaign.offline_fit import FitData, FitRequest, Fitted, OfflineFit, remarks, summary
from rf_pointing.station.campaign.recorded_input import reference_of
from rf_pointing.station.campaign.wrong_causes import moved
from test.commands.planted_campaign import PLANTED, STATION, points, raw_passes

PLACE, CBERS = site(STATION), find_elements(verification_elements(), "28057")
OFFSETS = ("azimuth_offset", "elevation_offset")
IONOSPHERE = Ionosphere(electrons_per_m2=5e17, frequency_hz=2.25e9)


def asked(**fields: Any) -> FitRequest:
    return FitRequest(**{"station": STATION, "band": "X", "site": PLACE, "elements": [CBERS], **fields})


def fit(data: Observations | FitData, **fields: Any) -> Fitted:
    return OfflineFit(asked(**fields), data if isinstance(data, FitData) else FitData(data, [])).run()


def passes(late_s: float = 0.0) -> list[TrackedPass]:
    """Return the planted raw passes, with time tags that are late by so much."""
    tagged = [dataclasses.replace(one, t_s=one.t_s + late_s) for one in raw_passes()]
    return [TrackedPass(one, reference_of(one, [CBERS], PLACE, 14.0 * 86400.0), IONOSPHERE) for one in tagged]


def pulls(done: Fitted) -> list[float]:
    """Return (estimate - planted) / sigma of every fitted term."""
    rows = zip(done.result.names, done.result.values.tolist(), done.result.sigma.tolist(), strict=True)
    return [(value - PLANTED.coefficients[name]) / sigma for name, value, sigma in rows]


def displaced(data: Observations, by: np.ndarray, error: str = "along_track_m") -> Observations:
    """Return points of passes that have one of the errors of a pass, by so much each."""
    # Of a circular orbit 1000 km up: what moves it along its track is a time then.
    radius_m, height_m = 6.371e6, 1e6
    down = radius_m * np.sin(data.true_elevation_rad)
    root = np.sqrt(down**2 + 2.0 * radius_m * height_m + height_m**2)
    rate = -radius_m * np.cos(data.true_elevation_rad) * data.elevation_rate_rad_s * (1.0 - down / root)
    data = dataclasses.replace(data, range_m=root - down, range_rate_m_s=rate)
    moved = [partial[:, 0] * by[data.pass_id] for partial in pass_partials(data, (error,))]
    seen = {"observed_azimuth_rad": data.observed_azimuth_rad + moved[0],
            "observed_elevation_rad": data.observed_elevation_rad + moved[1]}  # fmt: skip
    return dataclasses.replace(data, **seen)


def test_points_and_raw_passes_give_the_planted_model_within_its_sigma() -> None:
    assert max(map(abs, pulls(fit(points())))) < 4.0
    assert max(map(abs, pulls(fit(FitData(None, passes()), terms=OFFSETS)))) < 5.0
    # Together: the raw passes are numbered after those of the points.
    both = fit(FitData(displaced(points(), np.zeros(12)), passes()), terms=OFFSETS)
    assert len(both.points.passes) == len(points().passes) + len(passes())
    assert max(map(abs, pulls(both))) < 5.0


def test_errors_of_the_orbit_are_measured_and_allowed_for_unless_that_is_forbidden() -> None:
    along_m = np.random.default_rng(4).normal(0.0, 300.0, 24)
    data = displaced(points(24), along_m)
    measured, none = fit(data), fit(data, orbit_prior_m=0.0)
    said, least, clock = remarks(asked(), measured)
    assert re.fullmatch(r"a pass late by less than \d\.\d\d s may not show among the errors of the orbits", least)
    left_open = re.fullmatch(
        r".* right clock: with time tags (.\d\.\d\d) to (.\d\.\d\d) s late in all passes .*", clock
    )
    assert left_open
    assert float(left_open[1]) <= 0.0 <= float(left_open[2])
    size = re.fullmatch(r"sigma allows for orbit errors of (\d+) m along-track, .* as the passes show them", said)
    assert size
    assert float(size[1]) == pytest.approx(300.0, rel=0.35)
    # As correlated noise the orbit errors make sigma right too, and much larger.
    assert max(map(abs, [*pulls(measured), *pulls(none)])) < 4.0
    assert np.median(none.result.sigma / measured.result.sigma) > 2.0


def test_a_late_pass_is_left_out_and_named() -> None:
    late_s = np.random.default_rng(4).normal(0.0, 0.003, 12)
    late_s[7] = 0.5
    done = fit(displaced(points(), late_s, "clock_s"), terms=OFFSETS)
    assert 7 not in done.points.passes
    (note,) = done.notes
    assert note.startswith("pass 7 is ")
    assert max(map(abs, pulls(done))) < 4.0


def test_chosen_terms_are_those_that_were_planted_and_others_keep_what_is_known() -> None:
    done = fit(points(), form="printed", select=True)
    assert done.result.names == OFFSETS
    whole = fit(points(), terms=(*OFFSETS, "droop"))
    version = ModelVersion.from_fit(whole.result, name="known", software="0", created_t_s=2e9)
    # Droop would be chosen to stand for an elevation offset of which the search knew nothing.
    known = dataclasses.replace(
        version, model=BiasModel.zero().replace(elevation_offset=-50.0 * MDEG, droop=0.3 * MDEG)
    )
    offered = ("azimuth_offset", "collimation", "droop")
    found = fit(points(), form="printed", select=True, terms=offered, known=known).result
    assert found.names == ("azimuth_offset",)
    assert found.coefficients["elevation_offset"] == pytest.approx(-50.0 * MDEG)
    assert found.coefficients["droop"] == 0.0


@pytest.mark.parametrize(("recorded", "stated_s"), [(False, None), (True, None), (False, 0.0)])
def test_late_time_tags_are_refused_unless_the_station_recorded_them_or_its_clock_is_known(
    recorded: bool, stated_s: float | None
) -> None:
    data = FitData(None, passes(late_s=0.5), recorded=recorded)
    terms = (*OFFSETS, "azimuth_velocity_lag", "elevation_velocity_lag")
    if not recorded and stated_s is None:
        with pytest.raises(ValueError, match=r"no model is fitted: .*the time tags are 0\.500 s late"):
            fit(data, terms=terms)
        return
    done = fit(data, terms=terms, time_error_s=stated_s)
    assert any("the time tags are 0.500 s late" in doubt for doubt in done.warnings) == (stated_s is None)
    lags = [done.result.coefficients[name] for name in terms[2:]]
    assert lags == pytest.approx([-0.5, -0.5], abs=0.01)


def lagging(raw: RawTracking, lags_s: tuple[float, float]) -> RawTracking:
    """Return the samples of axes that lag besides."""
    at = reference_of(raw, [CBERS], PLACE, 14.0 * 86400.0).at(raw.t_s)
    return dataclasses.replace(
        raw,
        azimuth_rad=raw.azimuth_rad + lags_s[0] * at.azimuth_rate_rad_s,
        elevation_rad=raw.elevation_rad + lags_s[1] * at.elevation_rate_rad_s,
    )


@pytest.mark.parametrize("lags_s", [(-1.0, -1.9), (0.8, 1.4)])
def test_late_time_tags_next_to_unequal_lags_are_refused_with_their_size(lags_s: tuple[float, float]) -> None:
    lags = ("azimuth_velocity_lag", "azimuth_acceleration_lag", "elevation_velocity_lag", "elevation_acceleration_lag")
    for late_s in (0.0, 0.5):
        tagged = [
            dataclasses.replace(one, t_s=one.t_s + late_s) for one in (lagging(raw, lags_s) for raw in raw_passes())
        ]
        data = [TrackedPass(one, reference_of(one, [CBERS], PLACE, 14.0 * 86400.0), IONOSPHERE) for one in tagged]
        if late_s == 0.0:
            assert not [
                doubt for doubt in fit(FitData(None, data), terms=(*OFFSETS, *lags)).warnings if "tags" in doubt
            ]
            continue
        with pytest.raises(ValueError, match="the time tags of all passes are") as refused:
            fit(FitData(None, data), terms=(*OFFSETS, *lags))
        size, sigma = re.findall(r"are ([\d.]+) s late \(\+/- ([\d.]+) s\)", str(refused.value))[0]
        assert float(size) == pytest.approx(0.5, abs=4.0 * float(sigma))
        assert float(sigma) < 0.05


def test_a_site_that_is_kilometres_off_is_named_with_its_size_and_nothing_else() -> None:
    given = moved(PLACE, np.array([3e3, 4e3, 0.0]))
    data = [TrackedPass(one, reference_of(one, [CBERS], given, 14.0 * 86400.0), IONOSPHERE) for one in raw_passes()]
    with pytest.raises(ValueError, match="no model is fitted: the antenna is") as refused:
        fit(FitData(None, data), site=given)
    assert re.search(r"\b(late|early|edited)\b", str(refused.value)) is None
    found = re.findall(r"is (\d+) \+/- (\d+) m away .*: ([+-]\d+) m east, ([+-]\d+) m north", str(refused.value))[0]
    size, sigma, *away = map(float, found)
    assert size == pytest.approx(5000.0, abs=4.0 * sigma + 30.0)
    assert away == pytest.approx([-3000.0, -4000.0], abs=4.0 * sigma + 30.0)
    assert sigma < 200.0


def test_orbit_errors_beyond_those_of_young_elements_are_doubtful() -> None:
    rows = points()
    begins_s = CBERS.epoch_t_s + 1000.0
    late = dataclasses.replace(rows, t_s=rows.t_s - rows.t_s[0] + begins_s)
    far = displaced(late, np.random.default_rng(4).normal(0.0, 9000.0, 12))
    done = fit(FitData(far, passes()), terms=OFFSETS)
    assert any(
        re.search(r"along_track_m of the passes is \d+, .* times that of elements", one) for one in done.warnings
    )


def test_the_number_of_satellites_is_said_where_it_makes_sigma_less_than_normal() -> None:
    for satellites, beyond in ((1, "carries the fit"), (2, "2 satellites: 1 % of the lags are more than 28.3 sigma")):
        named = [
            dataclasses.replace(one, raw=dataclasses.replace(one.raw, target=f"SAT {number % satellites}"))
            for number, one in enumerate(passes())
        ]  # fmt: skip
        assert any(beyond in one for one in fit(FitData(None, named), terms=OFFSETS, elements=[]).warnings)


def test_data_of_another_station_or_band_are_refused_and_so_are_empty_sectors() -> None:
    for name, other in (("station", "gs2"), ("band", "Ka")):
        with pytest.raises(ValueError, match=f"the data are of {name} .*, must be of '{other}'"):
            fit(points(), **{name: other})
    assert fit(points(), terms=OFFSETS, sectors=True).stages
    with pytest.raises(ValueError, match="sectors have < 25"):
        fit(points(), terms=OFFSETS, require_full=True)


def test_grid_north_is_off_by_the_convergence_of_the_zone() -> None:
    # Zone 11 has its middle at 117 deg west: atan(tan(0.20554 deg) sin(35.24716 deg)).
    assert math.degrees(asked().convergence_rad) == pytest.approx(0.118619, abs=1e-5)


def test_the_outcome_is_a_line_of_numbers_that_the_fit_confirms() -> None:
    done = fit(points(), terms=OFFSETS, held_out=True)
    text, used = summary(done.points, done.result), int(np.sum(done.result.used))
    assert text.startswith(f"{used} observations of 12 passes, {len(points()) - used} edited out; residual rms ")
    *_, said = remarks(asked(terms=OFFSETS, held_out=True), done)
    # Noise of 1 mdeg in both axes is what a held-out pass is predicted to.
    predicted = re.search(r"predicted to ([\d.]+) mdeg rms with these terms", said)
    assert predicted
    assert 1.1 < float(predicted[1]) < 1.5
