import numpy as np
import pytest

from rf_pointing.calibration.editing import huber_weights, normalised_size, within_limit

ALL = np.ones(200, dtype=bool)


def test_sizes_are_in_stated_sigma_where_the_data_are_as_good_as_stated(random):
    residual = random.standard_normal((2, 200))
    size = normalised_size((residual[0], residual[1]), (np.ones(200), np.ones(200)), ALL)
    assert size == pytest.approx(np.max(np.abs(residual), axis=0), rel=0.25)


def test_data_worse_than_stated_are_measured_by_their_own_spread(random):
    residual = 10.0 * random.standard_normal((2, 200))
    residual[0, 7] = 90.0
    size = normalised_size((residual[0], residual[1]), (np.ones(200), np.ones(200)), ALL)
    assert 6.0 < size[7] < 12.0
    assert np.sum(size > 3.0) < 6


def test_rejected_rows_come_back_only_while_they_may():
    size, used = np.array([1.0, 5.0, 2.0]), np.array([True, True, False])
    assert within_limit(size, 3.0, used, may_return=True).tolist() == [True, False, True]
    assert within_limit(size, 3.0, used, may_return=False).tolist() == [True, False, False]
    assert within_limit(size, 0.0, used, may_return=True) is used


def test_huber_weight_is_the_limit_over_the_size_beyond_the_limit():
    assert huber_weights(np.array([0.0, 1.5, 3.0]), 1.5) == pytest.approx([1.0, 1.0, 0.5])
    assert huber_weights(np.array([9.0]), 0.0) == pytest.approx([1.0])
