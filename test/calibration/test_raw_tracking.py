"""Which samples are sound, each reason at its bound; where a file of passes is cut; another unit."""

import re
from dataclasses import replace

import numpy as np
import pytest

from rf_pointing.calibration import RawTracking, split_passes
from rf_pointing.calibration.raw_tracking import require_unit, validate

PI = np.pi


def raw_of(reference, count=60, step_s=1.0, start_s=20.0, **changes):
    """Return samples of a reference seen without any error."""
    t_s = reference.t_s[0] + start_s + step_s * np.arange(count)
    seen = reference.at(t_s)
    found = RawTracking(
        station="gs1", band="S", target="bird", t_s=t_s, azimuth_rad=seen.azimuth_rad, elevation_rad=seen.elevation_rad,
        range_m=seen.range_m, range_rate_m_s=seen.range_rate_m_s, good=np.ones(count, dtype=bool),
    )  # fmt: skip
    for name, (row, value) in changes.items():
        column = getattr(found, name).copy()
        column[row] = value
        found = replace(found, **{name: column})
    return found


@pytest.mark.parametrize(
    ("name", "value", "reason"),
    [
        ("azimuth_rad", 3.0 * PI + 1e-9, "angle out of range"),
        ("azimuth_rad", -3.0 * PI - 1e-9, "angle out of range"), ("azimuth_rad", 3.0 * PI - 1e-9, None),
        ("elevation_rad", -0.5 * PI - 1e-9, "angle out of range"), ("elevation_rad", -0.5 * PI + 1e-9, None),
        ("elevation_rad", PI + 1e-9, "angle out of range"), ("elevation_rad", PI - 1e-9, None),
        ("range_m", 0.0, "angle out of range"), ("range_m", -5.0, "angle out of range"),
        ("range_m", 1e-3, None), ("range_rate_m_s", np.inf, "not finite"), ("t_s", np.nan, "not finite"),
        ("good", False, "flagged by the station"),
    ],
)  # fmt: skip
def test_each_sample_that_is_not_sound_has_its_reason(track, name, value, reason):
    raw = raw_of(track(5.0), **{name: (17, value)})
    keep, report = validate(raw, track(5.0))
    assert {why: count for why, count in report.dropped.items() if count} == ({reason: 1} if reason else {})
    assert np.flatnonzero(~keep).tolist() == ([17] if reason else [])
    assert (report.before, report.after) == (60, 59 if reason else 60)


@pytest.mark.parametrize(("row", "most_s"), [(0, 4.5), (1, 3.5), (30, 3.5), (58, 3.5), (59, 1.5)])
def test_a_time_tag_more_than_two_and_a_half_steps_from_the_median_of_five_is_a_jump(track, row, most_s):
    """A late one is passed by its neighbours: the median is a step or two later than it should be."""
    raw = raw_of(track(5.0))
    for late_s, jumps in ((most_s - 0.1, 0), (most_s + 0.1, 1), (100.0, 1)):
        times = raw.t_s.copy()
        times[row] += late_s
        keep, report = validate(replace(raw, t_s=times), track(5.0))
        assert report.dropped["time jump"] == jumps
        assert not (jumps and keep[row])


def test_times_that_repeat_or_go_back_are_left_out_once(track):
    raw = raw_of(track(5.0))
    times = raw.t_s.copy()
    times[10] = times[9]
    times[[20, 21]] = times[[21, 20]]
    keep, report = validate(replace(raw, t_s=times), track(5.0))
    assert (report.dropped["repeated time"], report.dropped["time not increasing"]) == (1, 1)
    assert np.flatnonzero(~keep).tolist() == [10, 21]


def test_samples_outside_the_orbit_are_left_out(track):
    reference = track(5.0)
    raw = raw_of(reference)
    for shift_s, lost in ((-40.5, 21), (reference.t_s[-1] - raw.t_s[-1] + 3.5, 4)):
        _, report = validate(replace(raw, t_s=raw.t_s + shift_s), reference)
        assert report.dropped["outside the reference orbit"] == lost


def test_azimuths_beyond_half_a_radian_in_10_s_are_left_out(track):
    reference = track(1.0, miss_m=60e3)
    raw = raw_of(reference, count=700)
    keep, report = validate(raw, reference)
    fast = np.abs(reference.at(raw.t_s).azimuth_rate_rad_s) > 0.05
    assert report.dropped["azimuth turns too fast"] == np.sum(fast) > 10
    assert np.array_equal(keep, ~fast)


def test_a_handful_of_samples_is_judged_too(track):
    for count in (2, 4, 5):
        assert np.all(validate(raw_of(track(5.0), count=count), track(5.0))[0])
    fast = track(1.0, miss_m=20e3)
    overhead = raw_of(fast, count=2, start_s=400.0)
    assert not np.any(validate(overhead, fast)[0])
    # A single sample is no pass: its rate is not judged.
    assert np.all(validate(replace(overhead, good=np.array([True, False])), fast)[0] == [True, False])


def test_a_file_is_cut_at_its_gaps_and_not_at_one_wrong_time(track):
    reference = track(5.0)
    times = reference.t_s[0] + np.concatenate([np.arange(30.0), 200.0 + np.arange(25.0), 330.0 + np.arange(20.0)])
    seen = reference.at(times)
    good = np.arange(75) % 7 > 0
    whole = RawTracking(
        station="gs1", band="S", target="bird", t_s=times, azimuth_rad=seen.azimuth_rad,
        elevation_rad=seen.elevation_rad, range_m=seen.range_m, range_rate_m_s=None, good=good,
    )  # fmt: skip
    for gap_s, lengths in ((100.0, [30, 25, 20]), (150.0, [30, 45]), (180.0, [75])):
        parts = split_passes(whole, gap_s)
        assert [len(part) for part in parts] == lengths
        for name in ("t_s", "azimuth_rad", "range_m", "good"):
            assert np.array_equal(np.concatenate([getattr(part, name) for part in parts]), getattr(whole, name))
    times = whole.t_s.copy()
    times[12], times[40] = times[12] + 5000.0, np.nan
    assert [len(part) for part in split_passes(replace(whole, t_s=times), 100.0)] == [30, 25, 20]
    assert len(split_passes(raw_of(reference, count=4, step_s=100.0), 50.0)) == 1
    assert len(split_passes(raw_of(reference, count=5, step_s=100.0), 50.0)) > 1


def test_a_pass_is_cut_where_the_dish_goes_over_the_top(track):
    raw = raw_of(track(5.0), count=60)
    elevation = np.where(np.arange(60) < 35, raw.elevation_rad, PI - raw.elevation_rad)
    elevation[10] = 2.0
    assert [len(part) for part in split_passes(replace(raw, elevation_rad=elevation), 100.0)] == [35, 25]


@pytest.mark.parametrize(("factor", "words"), [(180.0 / PI, "large: degrees"), (PI / 180.0, "small: radians")])
def test_angles_in_another_unit_are_refused_with_the_distance_that_the_factor_leaves(track, factor, words):
    reference = track(5.0)
    raw = raw_of(reference, count=101, step_s=5.0, start_s=150.0)
    # A mount that is off by 2 deg in elevation is off by 2 deg in any unit.
    off = replace(
        raw, elevation_rad=factor * (raw.elevation_rad + np.radians(2.0)), azimuth_rad=factor * raw.azimuth_rad
    )
    with pytest.raises(ValueError, match=rf"57\.3 times too {words}") as refused:
        require_unit(off, reference)
    assert float(re.search(r"they are ([\d.]+) deg from", str(refused.value))[1]) == pytest.approx(2.0, abs=0.01)
    require_unit(replace(raw, elevation_rad=raw.elevation_rad + np.radians(2.0)), reference)
    require_unit(raw.__class__(**{**vars(raw), "t_s": np.full(len(raw), np.nan)}), reference)


def test_columns_of_other_length_and_empty_names_are_refused(track):
    raw = raw_of(track(5.0))
    with pytest.raises(ValueError, match=r"azimuth_rad has shape \(59,\), must be \(60,\)"):
        replace(raw, azimuth_rad=raw.azimuth_rad[:-1])
    with pytest.raises(ValueError, match=r"t_s has shape \(60, 1\), must be \(n,\)"):
        replace(raw, t_s=raw.t_s[:, np.newaxis])
    with pytest.raises(ValueError, match=r"good has shape \(2,\), must be \(60,\)"):
        replace(raw, good=np.ones(2, dtype=bool))
    with pytest.raises(ValueError, match="target='' must not be empty"):
        replace(raw, target="")


def test_a_report_names_reasons_that_occurred_only(track):
    _, report = validate(raw_of(track(5.0), azimuth_rad=(3, np.nan)), track(5.0))
    assert report.text() == "validation: 60 -> 59 (dropped 1 not finite)"
    assert replace(report, note="one", dropped={}).text() == "validation: 60 -> 59; one"


def test_samples_that_are_not_finite_outside_the_orbit_or_repeated_say_nothing_of_the_unit(track):
    """Most of these are wrong by far, and none of those that count."""
    reference = track(5.0)
    raw = raw_of(reference, count=9, start_s=300.0)
    times, azimuth, elevation = raw.t_s.copy(), raw.azimuth_rad.copy(), raw.elevation_rad.copy()
    azimuth[3:], elevation[3:] = np.degrees(azimuth[3:]), np.degrees(elevation[3:])
    times[3:5], azimuth[5], elevation[6] = (np.inf, -np.inf), np.nan, np.nan
    times[7], times[8] = reference.t_s[-1] + 100.0, times[2]
    require_unit(replace(raw, t_s=times, azimuth_rad=azimuth, elevation_rad=elevation), reference)


def test_azimuths_in_another_unit_are_compared_across_the_sky(track):
    """An azimuth that is off by 30 deg near the zenith is not far off; one turn is none."""
    reference = track(1.0, miss_m=60e3)
    high = reference.elevation_rad > np.radians(83.0)
    rows = reference.at(reference.t_s[high])
    raw = RawTracking(
        station="gs1", band="S", target="bird", t_s=rows.t_s, azimuth_rad=rows.azimuth_rad + 0.5 + 2.0 * PI,
        elevation_rad=rows.elevation_rad, range_m=None, range_rate_m_s=None, good=np.ones(len(rows.t_s), dtype=bool),
    )  # fmt: skip
    require_unit(raw, reference)


def test_a_turn_of_the_cable_is_no_other_unit_of_a_low_pass_in_the_north(track):
    """Read as degrees, 360 deg and 6 deg are close to north and the horizon too."""
    whole = track(5.0)
    shape = np.ones(len(whole.t_s))
    low = replace(whole, azimuth_rad=0.02 * shape, elevation_rad=0.1 * shape, azimuth_rate_rad_s=0.0 * shape,
                  elevation_rate_rad_s=0.0 * shape, azimuth_acceleration_rad_s2=0.0 * shape,
                  elevation_acceleration_rad_s2=0.0 * shape)  # fmt: skip
    raw = raw_of(low)
    require_unit(replace(raw, azimuth_rad=raw.azimuth_rad + 2.0 * PI), low)
