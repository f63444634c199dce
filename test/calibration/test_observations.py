from dataclasses import replace

import numpy as np
import pytest

from rf_pointing.calibration import Observations


def test_nan_is_refused_with_its_row(campaign, table_1):
    data = campaign(table_1, passes=2)
    bad = data.true_azimuth_rad.copy()
    bad[7] = np.nan
    with pytest.raises(ValueError, match=r"true_azimuth_rad\[7\]=nan"):
        replace(data, true_azimuth_rad=bad)


def test_duplicate_and_backward_times_within_a_pass_are_refused(campaign, table_1):
    data = campaign(table_1, passes=2)
    times = data.t_s.copy()
    times[3] = times[2]
    with pytest.raises(ValueError, match=r"t_s\[3\].* repeats t_s\[2\]"):
        replace(data, t_s=times)
    times[3] = times[2] - 1.0
    with pytest.raises(ValueError, match="is earlier than"):
        replace(data, t_s=times)


def test_degrees_are_refused_by_range(campaign, table_1):
    data = campaign(table_1, passes=2)
    with pytest.raises(ValueError, match=r"elevation_rad\[0\].*degrees given"):
        replace(data, observed_elevation_rad=np.degrees(data.observed_elevation_rad))


def test_degrees_small_enough_to_pass_the_range_are_refused_by_the_residual(campaign, table_1):
    data = campaign(table_1, passes=1).select([0])
    low = np.array([0.03])
    with pytest.raises(ValueError, match="observed minus true direction"):
        replace(data, true_elevation_rad=low, observed_elevation_rad=np.degrees(low))


def test_swapped_columns_are_refused(campaign, table_1):
    data = campaign(table_1, passes=3)
    with pytest.raises(ValueError, match="swapped"):
        replace(
            data, observed_azimuth_rad=data.observed_elevation_rad, observed_elevation_rad=data.observed_azimuth_rad
        )


def test_mixed_stations_are_refused(campaign, table_1):
    data = campaign(table_1, passes=2)
    with pytest.raises(ValueError, match="station is mixed: gs1, gs2"):
        Observations.concatenate([data, replace(data, station="gs2")])


def test_columns_of_other_length_are_refused_by_name(campaign, table_1):
    data = campaign(table_1, passes=1)
    with pytest.raises(ValueError, match="sigma_azimuth_rad has shape"):
        replace(data, sigma_azimuth_rad=data.sigma_azimuth_rad[:-1])


def test_azimuth_residual_is_folded_across_north(campaign, table_1):
    data = campaign(table_1, passes=1).select([0])
    turned = replace(data, observed_azimuth_rad=data.observed_azimuth_rad - 2.0 * np.pi)
    assert turned.residual_azimuth_rad == pytest.approx(data.residual_azimuth_rad, abs=1e-12)


def test_empty_data_are_refused(campaign, table_1):
    with pytest.raises(ValueError, match="0 rows"):
        campaign(table_1, passes=1).select(np.array([], dtype=int))
