"""Data that cannot be observations are refused by row and name, as are rates that are not those of the angles."""

from dataclasses import replace

import numpy as np
import pytest

from rf_pointing.calibration import Observations, fit_bias_model, require_derivatives
from rf_pointing.calibration.tracking_csv import write_observations
from rf_pointing.station.campaign.recorded_input import read_points


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


WRONG = {
    "rad/s for deg/s": (lambda d: {"azimuth_rate_rad_s": np.radians(d.azimuth_rate_rad_s)}, "azimuth_rate_deg_s"),
    "a turned sign": (lambda d: {"elevation_rate_rad_s": -d.elevation_rate_rad_s}, "elevation_rate_deg_s"),
    "swapped columns": (
        lambda d: {"azimuth_rate_rad_s": d.elevation_rate_rad_s, "elevation_rate_rad_s": d.azimuth_rate_rad_s},
        "azimuth_rate_deg_s",
    ),
    "deg/min^2": (
        lambda d: {"azimuth_acceleration_rad_s2": 3600.0 * d.azimuth_acceleration_rad_s2},
        "azimuth_acceleration_deg_s2",
    ),
    "km": (lambda d: {"range_m": d.range_m / 1e3}, "range_rate_m_s"),
}


@pytest.mark.parametrize("kind", list(WRONG))
def test_a_column_that_is_not_the_derivative_is_refused_by_its_name(campaign, table_1, tmp_path, kind):
    change, name = WRONG[kind]
    data = campaign(table_1, passes=4)
    wrong = replace(data, **change(data))
    # Nothing else would notice: the fit takes them.
    fit_bias_model(
        wrong, terms=("azimuth_offset",), held={n: 0.0 for n in table_1.coefficients if n != "azimuth_offset"}
    )
    write_observations(tmp_path / "p.csv", wrong)
    with pytest.raises(
        ValueError, match=rf"p.csv: {name} is not the change of .* another unit, another sign or swapped"
    ):
        read_points([tmp_path / "p.csv"])


def test_true_rates_pass_at_any_spacing_and_in_any_order(campaign, table_1, random):
    data = campaign(table_1, passes=8)
    require_derivatives(data)
    require_derivatives(data.select(np.sort(random.choice(len(data), len(data) // 2, replace=False))))
    order = np.argsort(data.t_s % 7.0, kind="stable")
    by_pass = np.concatenate([np.sort(order[data.pass_id[order] == k]) for k in data.passes[::-1]])
    require_derivatives(data.select(by_pass))


def test_azimuths_that_cross_north_are_no_jump(campaign, table_1):
    data = campaign(table_1, passes=6)
    folded = np.mod(data.true_azimuth_rad, 2.0 * np.pi)
    moved = folded - data.true_azimuth_rad
    require_derivatives(replace(data, true_azimuth_rad=folded, observed_azimuth_rad=data.observed_azimuth_rad + moved))
