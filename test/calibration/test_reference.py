from dataclasses import replace

import numpy as np
import pytest

from rf_pointing.calibration.reference import COLUMNS


def test_the_track_is_never_extrapolated(track):
    coarse = track(5.0)
    with pytest.raises(ValueError, match="must be within the reference"):
        coarse.at([coarse.t_s[-1] + 0.1])
    assert not bool(coarse.covers(coarse.t_s[0] - 0.1))


def test_every_column_of_the_interpolated_track_is_that_of_the_closed_form(track):
    """Errors of a quintic over 5 s of its sixth derivative, and of a cubic of the range's fourth."""
    coarse, fine = track(5.0), track(0.5)
    found = coarse.at(fine.t_s)
    limits = {
        "t_s": 0.0, "azimuth_rad": 2e-7, "elevation_rad": 2e-7, "azimuth_rate_rad_s": 3e-7, "elevation_rate_rad_s": 3e-7,
        "azimuth_acceleration_rad_s2": 1e-6, "elevation_acceleration_rad_s2": 1e-6, "range_m": 0.1, "range_rate_m_s": 0.1,
    }  # fmt: skip
    for name, limit in limits.items():
        assert np.max(np.abs(getattr(found, name) - getattr(fine, name))) <= limit, name
    assert np.all(coarse.covers(coarse.t_s))
    columns = [
        f"true_{name}" if name[-5:] == "h_rad" or name == "elevation_rad" else name for name in limits if name != "t_s"
    ]
    assert list(coarse.truth()) == columns
    for motion, name in zip(coarse.motion(), list(limits)[1:7], strict=True):
        assert motion is getattr(coarse, name)


def test_over_the_top_is_the_same_direction_on_the_other_side(track):
    direct = track(5.0)
    over = direct.over_the_top()
    assert over.azimuth_rad == pytest.approx(direct.azimuth_rad + np.pi)
    assert over.elevation_rad + direct.elevation_rad == pytest.approx(np.full(len(direct.t_s), np.pi))
    for name in ("elevation_rate_rad_s", "elevation_acceleration_rad_s2"):
        assert np.array_equal(getattr(over, name), -getattr(direct, name))
    for name in ("azimuth_rate_rad_s", "azimuth_acceleration_rad_s2", "range_m", "range_rate_m_s"):
        assert np.array_equal(getattr(over, name), getattr(direct, name))


def test_columns_of_other_length_or_that_are_not_finite_are_refused_by_name(track):
    reference = track(20.0)
    for name in COLUMNS:
        column = getattr(reference, name)
        with pytest.raises(ValueError, match=rf"{name if name != 't_s' else 'azimuth_rad'} has shape"):
            replace(reference, **{name: column[:-1]})
        spoilt = column.copy()
        spoilt[3] = np.nan
        with pytest.raises(ValueError, match=rf"(?s){name}=.* must be finite"):
            replace(reference, **{name: spoilt})
    with pytest.raises(ValueError, match="increase from point to point"):
        replace(reference, t_s=reference.t_s[::-1])
    assert replace(reference, range_m=reference.range_m.tolist()).range_m.dtype == np.float64
