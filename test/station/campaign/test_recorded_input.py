"""Raw tracking data of files become points with an apparent reference; what cannot be used is refused by name."""

import math
from dataclasses import replace

import numpy as np
import pytest

from rf_pointing.calibration import BiasModel, PriorKnowledge, RawPasses, RawTracking, TrackedPass
from rf_pointing.core import MDEG, RadioRefraction
from rf_pointing.ephemeris import TopocentricTrack, find_elements, find_passes, site, verification_elements
from rf_pointing.station.campaign.recorded_input import holds_points, read_raw, reference_of
from test.calibration.conftest import write_tracking

STATION = site("Goldstone DSS-13")
ELEMENTS = verification_elements()


@pytest.fixture(scope="module")
def raw() -> RawTracking:
    """Ten minutes of CBERS-2 at 8 samples/s, seen 20 mdeg too far right and 30 mdeg too high."""
    track = TopocentricTrack(find_elements(ELEMENTS, "28057"), STATION)
    start_s = find_elements(ELEMENTS, "28057").epoch_t_s
    window = max(find_passes(track, start_s, 86400.0, math.radians(12.0)), key=lambda w: w.duration_s)
    t_s = np.arange(window.aos_t_s, window.los_t_s, 0.125)
    look = track.sample(t_s)
    noise = np.random.default_rng(1).normal(0.0, 2.0 * MDEG, (2, len(t_s)))
    return RawTracking(
        station="Goldstone DSS-13", band="X", target="28057", t_s=t_s,
        azimuth_rad=look.azimuth_rad + 20.0 * MDEG + noise[0], elevation_rad=look.elevation_rad + 30.0 * MDEG + noise[1],
        range_m=None, range_rate_m_s=None, good=np.ones(len(t_s), dtype=bool),
    )  # fmt: skip


def test_points_show_the_offset_against_the_elements(raw, tmp_path):
    write_tracking(tmp_path / "raw.csv", raw)
    (back,) = read_raw(tmp_path / "raw.csv", "X")
    assert not holds_points(tmp_path / "raw.csv")
    reference = reference_of(back, ELEMENTS, STATION, 14.0 * 86400.0)
    found = RawPasses([TrackedPass(back, reference)], 3).process(PriorKnowledge(model=BiasModel.zero()))
    points = found.points
    assert found.notes == ()
    assert found.reports[0].before == len(raw)
    assert set(points.pass_id.tolist()) == {3}
    assert np.mean(points.residual_azimuth_rad) == pytest.approx(20.0 * MDEG, abs=1.0 * MDEG)
    assert np.mean(points.residual_elevation_rad) == pytest.approx(30.0 * MDEG, abs=1.0 * MDEG)


def test_the_weather_of_the_day_and_angles_free_of_refraction_move_the_reference_by_what_the_air_bends(raw):
    standard, vacuum, hot = (
        reference_of(raw, ELEMENTS, STATION, 14.0 * 86400.0, air)
        for air in ("standard", None, RadioRefraction(pressure_hpa=880.0, temperature_k=303.15, relative_humidity=0.9))
    )
    low = np.argmin(np.abs(vacuum.elevation_rad - math.radians(12.0)))
    assert standard.elevation_rad[low] - vacuum.elevation_rad[low] == pytest.approx(70.0 * MDEG, abs=15.0 * MDEG)
    # A hot and humid day bends a third more: left out it would be taken for droop.
    assert hot.elevation_rad[low] - standard.elevation_rad[low] > 15.0 * MDEG


def test_passes_without_points_are_named_and_none_at_all_is_refused(raw):
    reference = reference_of(raw, ELEMENTS, STATION, 14.0 * 86400.0)
    bad = RawTracking(**{**vars(raw), "good": np.zeros(len(raw), dtype=bool)})
    passes = [TrackedPass(one, reference) for one in (raw, bad)]
    found = RawPasses(passes, 0).process(PriorKnowledge(model=BiasModel.zero()))
    assert set(found.points.pass_id.tolist()) == {0}
    assert "pass 1 of 28057" in found.notes[0]
    with pytest.raises(ValueError, match="no pass gives calibration points"):
        RawPasses(passes[1:], 0)


def test_passes_at_different_rates_are_each_thinned_or_not(raw):
    reference = reference_of(raw, ELEMENTS, STATION, 14.0 * 86400.0)
    columns = ("t_s", "azimuth_rad", "elevation_rad", "good")
    slow = replace(raw, **{name: getattr(raw, name)[::8] for name in columns})
    points = (
        RawPasses([TrackedPass(one, reference) for one in (raw, slow)], 0)
        .process(PriorKnowledge(model=BiasModel.zero()))
        .points
    )
    counts = np.bincount(points.pass_id)
    assert counts[1] == pytest.approx(counts[0], abs=2)
    # Eight samples a second have an eighth of the variance.
    fast, sparse = (np.median(points.sigma_elevation_rad[points.pass_id == k]) for k in (0, 1))
    assert sparse / fast == pytest.approx(np.sqrt(8.0), rel=0.2)


def test_a_day_of_passes_in_one_file_is_cut_at_the_gaps_and_one_wrong_time_cuts_nothing(raw, tmp_path):
    later = replace(raw, t_s=raw.t_s + 6000.0)
    spoiled = raw.t_s.copy()
    spoiled[len(raw) // 2] += 1e7
    columns = ("azimuth_rad", "elevation_rad", "good")
    together = {name: np.concatenate([getattr(raw, name), getattr(later, name)]) for name in columns}
    write_tracking(tmp_path / "day.csv", replace(raw, t_s=np.concatenate([spoiled, later.t_s]), **together))
    parts = read_raw(tmp_path / "day.csv", "X")
    assert [len(part) for part in parts] == [len(raw), len(raw)]
    assert np.array_equal(parts[1].t_s, later.t_s)


def test_a_reference_covers_its_samples_and_a_margin_but_no_wrong_time(raw):
    """A tenth of the pass and 30 s on either side of the middle 96 % of the times, every 2 s."""
    spoiled = raw.t_s.copy()
    spoiled[[5, 100]] = raw.t_s[-1] + 1e6, np.nan
    found = reference_of(replace(raw, t_s=spoiled), ELEMENTS, STATION, 14.0 * 86400.0)
    seconds = raw.t_s[-1] - raw.t_s[0]
    margin = 0.096 * seconds + 30.0
    assert found.t_s[0] == pytest.approx(raw.t_s[0] + 0.02 * seconds - margin, abs=1.0)
    assert found.t_s[-1] == pytest.approx(raw.t_s[-1] - 0.02 * seconds + margin, abs=3.0)
    assert np.diff(found.t_s) == pytest.approx(2.0)
    track = TopocentricTrack(find_elements(ELEMENTS, "28057"), STATION)
    look = track.target_at(float(found.t_s[40]))
    assert found.elevation_rad[40] == pytest.approx(look.elevation_rad, abs=1e-9)
    assert found.range_m[40] == pytest.approx(look.range_m, abs=1e-3)
    with pytest.raises(ValueError, match="tracking data of 28057: no finite time"):
        reference_of(replace(raw, t_s=np.full(len(raw), np.nan)), ELEMENTS, STATION, 14.0 * 86400.0)
