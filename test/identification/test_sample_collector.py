"""Samples of an experiment, put together as they come; a sequence with a hole is not used."""

import math

import numpy as np
import pytest

from rf_pointing.identification import SampleCollector


def filled(skip: tuple[int, ...] = ()) -> SampleCollector:
    collector = SampleCollector("elevation", 3, 4, 0.02)
    for sample in range(12):
        if sample not in skip:
            collector.take("elevation", sample, (0.0, 0.1 * sample), (sample, 2.0 * sample))
    return collector


def test_samples_take_their_places_in_any_order() -> None:
    collector = SampleCollector("azimuth", 2, 3, 0.02)
    for sample in (3, 1, 0, 5, 2, 4):
        collector.take("azimuth", sample, (float(sample), 0.0), (10.0 + sample, 20.0 + sample))
    recording, missing = collector.recording()
    assert missing == 0
    np.testing.assert_array_equal(recording.input_rad_s, [[0.0, 1.0, 2.0], [3.0, 4.0, 5.0]])
    np.testing.assert_array_equal(recording.output_rad("elevation"), [[20.0, 21.0, 22.0], [23.0, 24.0, 25.0]])


def test_a_lost_sample_costs_its_sequence_and_no_other() -> None:
    recording, missing = filled(skip=(5, 6)).recording()
    assert missing == 2
    np.testing.assert_allclose(recording.input_rad_s, [[0.0, 0.1, 0.2, 0.3], [0.8, 0.9, 1.0, 1.1]])


def test_without_a_complete_sequence_there_is_no_recording() -> None:
    with pytest.raises(ValueError, match="no sequence is complete: 9 of 12 samples taken"):
        filled(skip=(0, 4, 8)).recording()


@pytest.mark.parametrize(
    ("sample", "words"),
    [
        (("azimuth", 5, (0.0, 0.0), (0.0, 0.0)), "axis='azimuth' must be 'elevation'"),
        (("elevation", 12, (0.0, 0.0), (0.0, 0.0)), "sample=12 must be <= 11"),
        (("elevation", 3, (0.0, 0.0), (0.0, 0.0)), "sample=3 was taken before"),
        (("elevation", 5, (0.0, math.nan), (0.0, 0.0)), "rate_rad_s"),
        (("elevation", 5, (0.0, 0.0), (math.inf, 0.0)), "position_rad"),
    ],
)
def test_a_sample_that_does_not_belong_is_refused_and_not_counted(sample: tuple, words: str) -> None:
    collector = filled(skip=(5,))
    with pytest.raises(ValueError, match=words):
        collector.take(*sample)
    assert collector.heard == 11
