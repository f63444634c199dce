"""Process noise: the paper's Q per step and ours per second are the same random walk."""

import pytest

from rf_pointing.array_sensors.attitude.process_noise import TABLE_Q, ProcessNoiseParams, process_noise_from_q


def test_table_value_is_the_default() -> None:
    assert process_noise_from_q(TABLE_Q) == ProcessNoiseParams()


def test_q_on_the_vector_part_is_four_q_on_the_rotation() -> None:
    noise = process_noise_from_q(3e-10, dt_s=0.5)
    assert noise.attitude_rad2_s * 0.5 == pytest.approx(4 * 3e-10)
    assert noise.rate_rad2_s3 * 0.5 == pytest.approx(3e-10)


def test_negative_noise_is_refused() -> None:
    with pytest.raises(ValueError, match=r"q=-1e-12 must be >= 0.0"):
        process_noise_from_q(-1e-12)
