import numpy as np
import pytest

from rf_pointing.papers.interferometer_transponder import (
    mixed_snr,
)

SAMPLES, F1, F2 = 4096, 300, 170


def db(ratio: float) -> float:
    return float(10.0 * np.log10(ratio))


def test_equal_inputs_at_minus_10_db() -> None:
    assert mixed_snr(0.1, 0.1, "published") == pytest.approx(0.0090909, abs=1e-7)
    assert db(mixed_snr(0.1, 0.1, "published")) == pytest.approx(-20.414, abs=1e-3)
    assert db(mixed_snr(0.1, 0.1)) == pytest.approx(-20.792, abs=1e-3)


def test_high_input_ratio_costs_nothing_as_published_and_3_db_in_truth() -> None:
    assert db(mixed_snr(100.0, 100.0, "published")) == pytest.approx(19.957, abs=1e-3)
    assert db(mixed_snr(100.0, 100.0)) == pytest.approx(16.968, abs=1e-3)
