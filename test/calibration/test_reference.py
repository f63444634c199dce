import numpy as np
import pytest


def test_interpolated_track_agrees_with_the_closed_form_between_samples(track):
    coarse, fine = track(5.0), track(0.5)
    found = coarse.at(fine.t_s)
    assert np.max(np.abs(found.azimuth_rad - fine.azimuth_rad)) < 2e-7
    assert np.max(np.abs(found.elevation_rad - fine.elevation_rad)) < 2e-7
    assert np.max(np.abs(found.azimuth_rate_rad_s - fine.azimuth_rate_rad_s)) < 3e-7
    assert np.max(np.abs(found.elevation_acceleration_rad_s2 - fine.elevation_acceleration_rad_s2)) < 1e-6
    assert np.max(np.abs(found.range_m - fine.range_m)) < 0.1


def test_samples_themselves_are_returned_unchanged(track):
    coarse = track(5.0)
    found = coarse.at(coarse.t_s)
    for name in ("azimuth_rad", "elevation_rate_rad_s", "range_m"):
        assert getattr(found, name) == pytest.approx(getattr(coarse, name), rel=1e-12, abs=1e-15)


def test_the_track_is_never_extrapolated(track):
    coarse = track(5.0)
    with pytest.raises(ValueError, match="must be within the reference"):
        coarse.at([coarse.t_s[-1] + 0.1])
    assert not bool(coarse.covers(coarse.t_s[0] - 0.1))


def test_times_that_do_not_increase_are_refused(track):
    from dataclasses import replace

    coarse = track(5.0)
    with pytest.raises(ValueError, match="increase from point to point"):
        replace(coarse, t_s=coarse.t_s[::-1])
