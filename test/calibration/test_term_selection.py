import numpy as np
import pytest

from rf_pointing.calibration import (
    EXTENSION_TERMS,
    TERM_NAMES,
    PassPriors,
    fit_bias_model,
    held_at_zero,
    held_out_passes,
    select_terms,
)
from rf_pointing.core import MDEG

EXTENSIONS = tuple(term.name for term in EXTENSION_TERMS if term.unit != "rad/K" and "beyond" not in term.name)


def test_only_planted_terms_are_chosen(campaign, table_1):
    planted = {"azimuth_offset", "mislevel_east", "elevation_offset", "elevation_velocity_lag", "azimuth_second_sine"}
    values = {name: (table_1.coefficients[name] if name in planted else 0.0) for name in TERM_NAMES}
    model = type(table_1)({**values, "azimuth_second_sine": 1e-3})
    found = select_terms(campaign(model, passes=20), (*TERM_NAMES, *EXTENSIONS))
    assert set(found.names) - set(found.kept) == planted


def test_a_perfect_antenna_needs_no_term(campaign, table_1):
    assert select_terms(campaign(table_1.zero(), passes=10), TERM_NAMES).names == ()


@pytest.mark.parametrize(("orbit_m", "kept"), [(3000.0, ("elevation_velocity_lag",)), (1.0, ())])
def test_a_lag_too_small_to_be_seen_is_kept_where_the_other_axis_depends_on_it(campaign, table_1, orbit_m, kept):
    """An orbit error looks as equal lags do: only their difference is known to better than it."""
    model = table_1.zero().replace(azimuth_velocity_lag=0.5)
    names = ("azimuth_offset", "azimuth_velocity_lag", "elevation_offset", "elevation_velocity_lag")
    orbit = PassPriors.of_orbit(orbit_m)
    found = select_terms(campaign(model, passes=8), names, pass_priors=orbit)
    assert set(found.names) == {"azimuth_velocity_lag", *kept}
    assert found.kept == kept


def test_held_out_passes_are_predicted_to_the_noise_by_the_right_terms_only(campaign, table_1):
    data = campaign(table_1, passes=12)
    right = held_out_passes(data, TERM_NAMES)
    wrong = held_out_passes(data, ("azimuth_offset", "elevation_offset"))
    assert right.total_rms_rad < 1.6 * 1e-4
    assert wrong.total_rms_rad > 50.0 * MDEG
    assert right.rms_rad.shape == (12,)
    assert np.all(np.isfinite(right.rms_rad))


def test_what_a_pass_left_out_is_predicted_to_is_the_miss_of_the_fit_of_the_others(campaign, table_1):
    data, terms = campaign(table_1, passes=6), ("azimuth_offset", "elevation_offset", "elevation_velocity_lag")
    found = held_out_passes(data, terms)
    squares = []
    for number in range(6):
        out = data.pass_id == number
        model = fit_bias_model(data.select(~out), terms=terms, held=held_at_zero(terms)).model
        rows = data.select(out)
        azimuth, elevation = model.offset_rad(*rows.motion())
        across = (rows.residual_azimuth_rad - azimuth) * np.cos(rows.true_elevation_rad)
        squares.append(across**2 + (rows.residual_elevation_rad - elevation) ** 2)
    np.testing.assert_allclose(found.rms_rad, [np.sqrt(np.mean(square)) for square in squares], rtol=1e-9)
    assert found.total_rms_rad == pytest.approx(np.sqrt(np.mean(np.concatenate(squares))), rel=1e-9)
    assert found.pass_ids.tolist() == list(range(6))


def test_terms_that_are_held_are_taken_off_before_others_are_chosen(campaign, table_1):
    """What one misses the others would take in."""
    model = table_1.zero().replace(azimuth_offset=2e-3, elevation_offset=-1e-3)
    data = campaign(model, passes=8)
    names = ("collimation", "droop", "mislevel_east")
    held = {name: value for name, value in model.coefficients.items() if name not in names}
    assert select_terms(data, names, held=held).names == ()
    assert {"collimation", "droop"} <= set(select_terms(data, names).names)
    assert held_out_passes(data, names, held=held).total_rms_rad < 1.6e-4
    assert held_out_passes(data, names).total_rms_rad > 2e-4
