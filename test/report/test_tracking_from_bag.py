"""A recording becomes raw tracking data: encoder plus sensed error, with the recorded ephemeris as reference."""

import re

import numpy as np
import pytest

from rf_pointing.calibration import TrackedPass
from rf_pointing.report.tracking_from_bag import tracking_from_bag

from .conftest import MDEG, SyntheticRun


def bag(tmp_path, types, notes=None, **changes):
    SyntheticRun(error_mdeg=lambda _: (3.0, -2.0), **changes).write(tmp_path / "bag", types, notes)
    return tmp_path / "bag"


def test_samples_are_the_encoders_where_the_beam_would_be_on_the_target(tmp_path, types):
    ((raw, reference),) = tracking_from_bag(bag(tmp_path, types), "gs1", "X")
    assert len(raw) > 400
    assert np.all(raw.good)
    seen = reference.at(raw.t_s)
    assert np.all(np.isfinite(seen.azimuth_rad))
    assert np.all(np.diff(raw.t_s) > 0.0)


@pytest.mark.parametrize("sensor", ["conscan", "steptrack"])
def test_error_of_a_scan_belongs_to_its_centre_wherever_the_encoders_are(tmp_path, types, sensor):
    path = bag(tmp_path, types, sensor=sensor, mode=lambda _: sensor, circle_mdeg=30.0)
    ((raw, _),) = tracking_from_bag(path, "gs1", "X")
    seconds = raw.t_s - 1_700_000_000.0
    np.testing.assert_allclose(raw.elevation_rad, np.radians(30.0 + 0.1 * seconds) - 2.0 * MDEG, atol=5e-9)
    across = (raw.azimuth_rad - np.radians(100.0 + 0.5 * seconds)) * np.cos(np.radians(30.0 + 0.1 * seconds))
    np.testing.assert_allclose(across, 3.0 * MDEG, atol=5e-9)


@pytest.mark.parametrize("sensor", ["monopulse", "conscan"])
def test_over_the_top_the_sensed_error_counts_upward_on_the_sky_and_downward_on_the_axis(tmp_path, types, sensor):
    path = bag(tmp_path, types, sensor=sensor, mode=lambda _: sensor, over=True)
    ((raw, reference),) = tracking_from_bag(path, "gs1", "X")
    assert np.all(raw.over)
    seconds = raw.t_s - 1_700_000_000.0
    np.testing.assert_allclose(raw.elevation_rad, np.radians(150.0 - 0.1 * seconds) + 2.0 * MDEG, atol=5e-9)
    across = (raw.azimuth_rad - np.radians(280.0 + 0.5 * seconds)) * np.cos(np.radians(30.0 + 0.1 * seconds))
    np.testing.assert_allclose(across, 3.0 * MDEG, atol=5e-9)
    # The recorded targets are those of 2 s before.
    seen = TrackedPass(raw, reference).track
    assert np.max(np.abs(seen.elevation_rad - raw.elevation_rad)) < np.radians(0.3)


@pytest.mark.parametrize(("sensor", "mode"), [("conscan", "monopulse"), ("monopulse", "conscan")])
def test_errors_of_a_sensor_that_does_not_track_are_left_out(tmp_path, types, sensor, mode):
    path = bag(tmp_path, types, sensor=sensor, mode=lambda _: mode)
    with pytest.raises(ValueError, match="holds no tracking by a sensor"):
        tracking_from_bag(path, "gs1", "X")


def test_how_many_samples_are_left_out_is_said_with_the_bound(tmp_path, types):
    path = tmp_path / "bag"
    SyntheticRun(error_mdeg=lambda t: (30.0 if t % 4.0 < 1.0 else 3.0, 0.0)).write(path, types, None)
    ((raw, _),) = tracking_from_bag(path, "gs1", "X", largest_error_rad=4.0 * MDEG)
    (note,) = raw.notes
    count, every = map(int, re.search(r": (\d+) of (\d+) samples are left out", note).groups())
    assert (count, every) == (int(np.sum(~raw.good)), len(raw))
    assert count == pytest.approx(0.25 * every, rel=0.2)
    assert "above 0.004 deg" in note
    ((raw, _),) = tracking_from_bag(path, "gs1", "X", largest_error_rad=40.0 * MDEG)
    assert raw.notes == ()


def test_samples_far_from_the_axis_are_not_good(tmp_path, types):
    with pytest.raises(ValueError, match="holds no tracking by a sensor of 30 samples or more"):
        tracking_from_bag(bag(tmp_path, types), "gs1", "X", largest_error_rad=1.0 * MDEG)


@pytest.mark.parametrize(("name", "wanted"), [("station", ("gs2", "X")), ("band", ("gs1", "Ka"))])
def test_a_recording_of_another_station_or_band_is_refused(tmp_path, types, name, wanted):
    path = bag(tmp_path, types, notes={"station": "gs1", "band": "X"})
    with pytest.raises(ValueError, match=f"was recorded with {name}"):
        tracking_from_bag(path, *wanted)


def test_a_cut_off_recording_is_refused_by_name_unless_its_sound_part_is_asked_for(tmp_path, types):
    path = bag(tmp_path, types)
    (file,) = path.glob("*.mcap")
    file.write_bytes(file.read_bytes()[: int(0.7 * file.stat().st_size)])
    with pytest.raises(ValueError, match=r"bag is damaged: .+"):
        tracking_from_bag(path, "gs1", "X")
    ((raw, _),) = tracking_from_bag(path, "gs1", "X", allow_damage=True)
    assert len(raw) > 100


def test_what_is_no_recording_is_refused_by_its_path(tmp_path):
    (tmp_path / "x.mcap").write_bytes(b"rubbish" * 100)
    with pytest.raises(ValueError, match=r"x\.mcap"):
        tracking_from_bag(tmp_path / "x.mcap", "gs1", "X")


def test_a_missing_topic_is_named(tmp_path, types):
    with pytest.raises(ValueError, match="holds no message of target"):
        tracking_from_bag(bag(tmp_path, types, left_out={"target"}), "gs1", "X")
