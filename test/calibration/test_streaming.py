import numpy as np
import pytest

from rf_pointing.calibration import TERM_NAMES, FitOptions, StreamingFit, fit_bias_model, held_at_zero


def test_blocks_give_the_solution_of_all_data_at_once(campaign, table_1):
    data = campaign(table_1, passes=20)
    state = StreamingFit(TERM_NAMES, {})
    for number in data.passes:
        state.add(data.select(data.pass_id == number))
    expected = fit_bias_model(data, options=FitOptions(edit_sigma=0.0))
    found = state.solve()
    assert found.values == pytest.approx(expected.values, rel=1e-9, abs=1e-14)
    assert np.allclose(found.covariance, expected.covariance, rtol=1e-8)
    assert state.observations == len(data)


def test_a_copied_state_continues_identically(campaign, table_1):
    data = campaign(table_1, passes=8)
    first, rest = data.select(data.pass_id < 4), data.select(data.pass_id >= 4)
    state = StreamingFit(TERM_NAMES, {})
    state.add(first)
    other = state.copy()
    state.add(rest)
    other.add(rest)
    assert np.array_equal(state.solve().values, other.solve().values)


def test_a_copy_does_not_change_with_the_original(campaign, table_1):
    data = campaign(table_1, passes=8)
    state = StreamingFit(TERM_NAMES, {})
    state.add(data.select(data.pass_id < 4))
    before = state.copy().solve().values
    copy = state.copy()
    state.add(data.select(data.pass_id >= 4))
    assert np.array_equal(copy.solve().values, before)


def test_held_terms_are_taken_off(campaign, table_1):
    terms = ("droop", "azimuth_offset")
    held = {name: table_1.coefficients[name] for name in held_at_zero(terms)}
    state = StreamingFit(terms, held)
    state.add(campaign(table_1, sigma_rad=0.0))
    for name in terms:
        assert state.model().coefficients[name] == pytest.approx(table_1.coefficients[name], abs=1e-12)


def test_a_stream_that_does_not_determine_the_terms_is_refused(campaign, table_1):
    state = StreamingFit(TERM_NAMES, {})
    with pytest.raises(ValueError, match="0 equations do not determine"):
        state.solve()
    state.add(campaign(table_1, passes=1).select([0, 1, 2]))
    with pytest.raises(ValueError, match=r"do not determine|cannot separate"):
        state.solve()
