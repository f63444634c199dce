import numpy as np
import pytest

from rf_pointing.calibration import EXTENSION_TERMS, TERM_NAMES, PassPriors, held_out_passes, select_terms
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
