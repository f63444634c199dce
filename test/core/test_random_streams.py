"""Every noise source has its own stream, given by the seed and its name."""

import itertools

import numpy as np
import pytest

from rf_pointing.core import random_stream

COUNT = 20_000
CORRELATION_LIMIT = 5.0 / COUNT**0.5
"""Five standard deviations of the correlation of independent samples."""


def test_seed_and_name_give_the_same_numbers_again() -> None:
    first, second = (random_stream(7, "wind").standard_normal(100) for _ in range(2))
    np.testing.assert_array_equal(first, second)


def test_other_seeds_and_other_names_are_uncorrelated() -> None:
    streams = [random_stream(seed, name).standard_normal(COUNT) for seed in (0, 1, 2) for name in ("wind", "encoder")]
    for a, b in itertools.combinations(streams, 2):
        assert abs(np.corrcoef(a, b)[0, 1]) < CORRELATION_LIMIT


def test_a_negative_seed_is_refused() -> None:
    with pytest.raises(ValueError, match=r"^seed=-1 must be >= 0$"):
        random_stream(-1, "wind")
