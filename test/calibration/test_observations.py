"""Data that cannot be observations are refused by row and name, as are rates that are not those of the angles."""

from dataclasses import replace

import numpy as np
import pytest

from rf_pointing.calibration import Observations, fit_bias_model, require_derivatives
from rf_pointing.calibration.tracking_csv import write_observations
from rf_pointing.station.campaign.recorded_input import read_points


def test_degrees_small_enough_to_pass_the_range_are_refused_by_the_residual(campaign, table_1):
    data = campaign(table_1, passes=1).select([0])
    low = np.array([0.03])
    with pytest.raises(ValueError, match="observed minus true direction"):
        replace(data, true_elevation_rad=low, observed_elevation_rad=np.degrees(low))


def test_mixed_stations_are_refused(campaign, table_1):
    data = campaign(table_1, passes=2)
    with pytest.raises(ValueError, match="station is mixed: gs1, gs2"):
        Observations.concatenate([data, replace(data, station="gs2")])


def test_columns_of_other_length_are_refused_by_name(campaign, table_1):
    data = campaign(table_1, passes=1)
    with pytest.raises(ValueError, match="sigma_azimuth_rad has shape"):
        replace(data, sigma_azimuth_rad=data.sigma_azimuth_rad[:-1])


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


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("true_azimuth_rad", 3.0 * np.pi + 1e-6, "true_azimuth_rad.* must be within 3 pi"),
        ("observed_azimuth_rad", -3.0 * np.pi - 1e-6, "observed_azimuth_rad.* must be within 3 pi"),
        ("true_elevation_rad", -0.5 * np.pi - 1e-6, "true_elevation_rad.* must be within -pi/2"),
        ("observed_elevation_rad", np.pi + 1e-6, "observed_elevation_rad.* must be within -pi/2"),
        ("observed_elevation_rad", np.degrees(0.5), r"observed_elevation_rad\[4\].*degrees given"),
        ("true_azimuth_rad", np.nan, r"true_azimuth_rad\[4\]=nan"),
        ("sigma_azimuth_rad", 0.0, "sigma_azimuth_rad.*must be > 0"),
        ("sigma_elevation_rad", -1e-4, "sigma_elevation_rad.*must be > 0"),
        ("range_m", np.inf, r"range_m\[4\]=inf must be finite"),
    ],
)
def test_each_row_has_its_bounds(campaign, table_1, name, value, words):
    data = campaign(table_1, passes=1)
    column = getattr(data, name).copy()
    column[4] = value
    with pytest.raises(ValueError, match=words):
        replace(data, **{name: column})


def test_pass_numbers_are_whole_numbers_one_for_each_row(campaign, table_1):
    data = campaign(table_1, passes=2)
    for wrong in (data.pass_id + 0.5, data.pass_id[:-1]):
        with pytest.raises(ValueError, match="pass_id has shape .* must be .* integers"):
            replace(data, pass_id=wrong)
    with pytest.raises(ValueError, match="station='' must name the station"):
        replace(data, station="")


def test_parts_without_a_column_do_not_join_those_with_it(campaign, table_1):
    first, second = (campaign(table_1, passes=1) for _ in range(2))
    second = replace(second, pass_id=second.pass_id + 1)
    bare = [replace(one, range_m=None) for one in (first, second)]
    assert Observations.concatenate(bare).range_m is None
    both = Observations.concatenate([first, second])
    assert np.array_equal(both.range_m, np.concatenate([first.range_m, second.range_m]))
    with pytest.raises(ValueError, match="range_m is given for some parts only"):
        Observations.concatenate([first, bare[1]])
    with pytest.raises(ValueError, match="0 parts"):
        Observations.concatenate([])


def test_a_north_is_suspected_where_all_azimuths_are_off_alike_and_only_there(campaign, table_1):
    """By more than a fifth of a radian on the sky; one row that is off is no other north."""
    data = campaign(table_1, passes=2)
    shift = 0.3 / np.min(np.cos(data.true_elevation_rad))
    with pytest.raises(
        ValueError, match=r"must be <= 0\.2: all azimuths are \+.* deg off: an offset, or counted from magnetic north"
    ):
        replace(data, observed_azimuth_rad=data.observed_azimuth_rad + shift)
    one = np.where(np.arange(len(data)) == 4, shift, 0.0)
    with pytest.raises(ValueError, match=r"must be <= 0\.2; swapped columns"):
        replace(data, observed_azimuth_rad=data.observed_azimuth_rad + one)
    scattered = shift + np.radians(3.0) * np.where(np.arange(len(data)) % 2, 1.0, -1.0)
    with pytest.raises(ValueError, match=r"must be <= 0\.2; swapped columns"):
        replace(data, observed_azimuth_rad=data.observed_azimuth_rad + scattered)


@pytest.mark.parametrize("turns", [-1.0, 1.0])
def test_an_azimuth_residual_is_folded_into_half_a_turn_either_way(campaign, table_1, turns):
    data = campaign(table_1, passes=1)
    folded = np.mod(data.true_azimuth_rad + np.pi, 2.0 * np.pi) - np.pi
    seen = data.observed_azimuth_rad - data.true_azimuth_rad + folded
    turned = replace(data, true_azimuth_rad=folded, observed_azimuth_rad=seen + 2.0 * np.pi * turns)
    np.testing.assert_allclose(turned.residual_azimuth_rad, data.residual_azimuth_rad, atol=1e-12)


def test_a_time_that_is_wrong_is_told_with_the_rows_of_its_own_pass(campaign, table_1):
    """Of two passes whose rows alternate."""
    data = campaign(table_1, passes=2)
    count = int(np.min(np.bincount(data.pass_id)))
    rows = np.stack([np.flatnonzero(data.pass_id == number)[:count] for number in (0, 1)], axis=1).ravel()
    data = data.select(rows)
    times = data.t_s.copy()
    times[9] = times[7]
    with pytest.raises(ValueError, match=r"t_s\[9\]=\S+ repeats t_s\[7\]=\S+ of pass 1; times must increase"):
        replace(data, t_s=times)
    times[9] = times[7] - 3.0
    with pytest.raises(ValueError, match=r"t_s\[9\]=\S+ is earlier than t_s\[7\]=\S+ of pass 1;"):
        replace(data, t_s=times)
