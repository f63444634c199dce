"""Data that cannot be observations are refused by row and name, as are rates that are not those of the angles."""

import re
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


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("true_azimuth_rad", 3.0 * np.pi + 1e-6, "true_azimuth_rad.* must be within 3 pi"),
        ("observed_azimuth_rad", -3.0 * np.pi - 1e-6, "observed_azimuth_rad.* must be within 3 pi"),
        ("true_elevation_rad", -0.5 * np.pi - 1e-6, "true_elevation_rad.* must be within -pi/2"),
        ("observed_elevation_rad", np.pi + 1e-6, "observed_elevation_rad.* must be within -pi/2"),
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


@pytest.mark.parametrize(("miss_rad", "taken"), [(0.199, True), (0.201, False)])
@pytest.mark.parametrize("across", [True, False])
def test_observed_and_true_directions_are_at_most_a_fifth_of_a_radian_apart_on_the_sky(
    campaign, table_1, miss_rad, taken, across
):
    data = campaign(table_1, passes=2)
    azimuth, elevation = data.true_azimuth_rad.copy(), data.true_elevation_rad.copy()
    if across:
        azimuth[7] += miss_rad / np.cos(elevation[7])
    else:
        elevation[7] += miss_rad
    if taken:
        replace(data, observed_azimuth_rad=azimuth, observed_elevation_rad=elevation)
    else:
        with pytest.raises(
            ValueError, match=r"direction\[7\]=0\.201 rad must be <= 0\.2; swapped columns.*\(1 of \d+ rows\)"
        ):
            replace(data, observed_azimuth_rad=azimuth, observed_elevation_rad=elevation)


def test_pass_numbers_are_whole_numbers_one_for_each_row(campaign, table_1):
    data = campaign(table_1, passes=2)
    for wrong in (data.pass_id + 0.5, data.pass_id[:-1]):
        with pytest.raises(ValueError, match="pass_id has shape .* must be .* integers"):
            replace(data, pass_id=wrong)
    with pytest.raises(ValueError, match="station='' must name the station"):
        replace(data, station="")


def test_passes_may_be_interleaved(campaign, table_1):
    data = campaign(table_1, passes=2)
    counts = np.bincount(data.pass_id)
    order = np.argsort(np.concatenate([np.arange(count) for count in counts]), kind="stable")
    mixed = data.select(order)
    assert mixed.pass_id[:4].tolist() == [0, 1, 0, 1]
    assert mixed.passes.tolist() == [0, 1]
    with pytest.raises(ValueError, match="is earlier than"):
        data.select(order[::-1])


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


@pytest.mark.parametrize(
    ("rows", "gap_s", "share", "refused"),
    [
        (11, 10.0, 1.0, True),
        (10, 10.0, 1.0, False),
        (11, 21.0, 1.0, False),
        (11, 20.0, 1.0, True),
        (21, 10.0, 0.45, False),
        (21, 10.0, 0.55, True),
    ],
)
def test_a_rate_is_judged_by_ten_neighbours_of_which_most_must_be_wrong(rows, gap_s, share, refused):
    """Ten changes of eleven rows, at most 20 s apart."""
    t_s = 1e9 + gap_s * np.arange(rows)
    angle = 0.3 + 2e-3 * gap_s * np.arange(rows)
    wrong = np.arange(rows) >= round((1.0 - share) * (rows - 1))
    none, one = np.zeros(rows), np.full(rows, 1e-4)
    data = Observations(
        station="gs1", band="S", t_s=t_s, pass_id=np.zeros(rows, dtype=int), observed_azimuth_rad=none,
        observed_elevation_rad=angle, true_azimuth_rad=none, true_elevation_rad=angle, azimuth_rate_rad_s=none,
        elevation_rate_rad_s=np.where(wrong, -2e-3, 2e-3), azimuth_acceleration_rad_s2=none,
        elevation_acceleration_rad_s2=none, sigma_azimuth_rad=one, sigma_elevation_rad=one,
    )  # fmt: skip
    if refused:
        # The first pair of which one row is wrong is shown.
        first = max(int(np.flatnonzero(wrong)[0]) - 1, 0)
        words = f"elevation_rate_deg_s is not the change of true_elevation_deg: rows {first} and {first + 1}, "
        with pytest.raises(ValueError, match=words):
            require_derivatives(data)
    else:
        require_derivatives(data)


def test_a_north_is_suspected_where_all_azimuths_are_off_alike_and_only_there(campaign, table_1):
    """By more than a fifth of a radian on the sky; one row that is off is no other north."""
    data = campaign(table_1, passes=2)
    shift = 0.3 / np.min(np.cos(data.true_elevation_rad))
    with pytest.raises(
        ValueError, match=r"must be <= 0\.2: all azimuths are \+.* deg off: counted from magnetic north"
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


def test_a_rate_that_is_wrong_is_told_with_its_rows_in_the_units_of_the_file(campaign, table_1):
    data = campaign(table_1, passes=2)
    wrong = replace(data, elevation_rate_rad_s=-data.elevation_rate_rad_s)
    with pytest.raises(ValueError, match="elevation_rate_deg_s is not the change") as refused:
        require_derivatives(wrong)
    row, then, step, angle, later, rate, after = re.search(
        r"rows (\d+) and (\d+), (\S+) s apart, have true_elevation_deg (\S+), (\S+) and elevation_rate_deg_s (\S+), (\S+) \(",
        str(refused.value),
    ).groups()
    places = [int(row), int(then)]
    assert float(step) == pytest.approx(np.diff(data.t_s[places])[0], rel=1e-5)
    assert [float(angle), float(later)] == pytest.approx(np.degrees(data.true_elevation_rad[places]), rel=1e-5)
    assert [float(rate), float(after)] == pytest.approx(np.degrees(wrong.elevation_rate_rad_s[places]), rel=1e-5)


@pytest.mark.parametrize("missing", ["range_m", "range_rate_m_s"])
def test_ranges_without_their_rates_are_not_judged(campaign, table_1, missing):
    data = campaign(table_1, passes=2)
    require_derivatives(replace(data, **{missing: None}))


@pytest.mark.parametrize(
    ("angle_deg", "rate_deg_s", "refused"), [(0.0019, 0.0021, True), (0.0021, 0.0019, True), (0.0019, 0.0019, False)]
)
def test_changes_below_two_hundredths_of_a_degree_are_not_judged(angle_deg, rate_deg_s, refused):
    """In 10 s, by the angles or by the rates, of other sign."""
    rows = 20
    none, one = np.zeros(rows), np.full(rows, 1e-4)
    angle = 0.5 + np.radians(angle_deg) * 10.0 * np.arange(rows)
    data = Observations(
        station="gs1", band="S", t_s=1e9 + 10.0 * np.arange(rows), pass_id=np.zeros(rows, dtype=int),
        observed_azimuth_rad=none, observed_elevation_rad=angle, true_azimuth_rad=none, true_elevation_rad=angle,
        azimuth_rate_rad_s=none, elevation_rate_rad_s=np.full(rows, -np.radians(rate_deg_s)),
        azimuth_acceleration_rad_s2=none, elevation_acceleration_rad_s2=none, sigma_azimuth_rad=one, sigma_elevation_rad=one,
    )  # fmt: skip
    if refused:
        with pytest.raises(ValueError, match="elevation_rate_deg_s is not the change"):
            require_derivatives(data)
    else:
        require_derivatives(data)
