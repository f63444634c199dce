"""Rates that are not those of the angles beside them would give lags that no residual contradicts."""

from dataclasses import replace

import numpy as np
import pytest

from rf_pointing.calibration import fit_bias_model, require_derivatives, write_observations
from rf_pointing.station.campaign.recorded_input import read_points

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
