import dataclasses

import numpy as np
import pytest

from rf_pointing.array_sensors.arrays.interferometer.measurement import InterferometerMeasurement


def measurement(**changes) -> InterferometerMeasurement:
    fields = {
        "t_s": 1.0,
        "phase_rad": np.zeros((9, 3, 3)),
        "phase_rate_rad_s": np.zeros((9, 3, 3)),
        "amplitudes": np.eye(2),
        "amplitude_sigma": 0.01,
        "snr_forward": np.full(9, 100.0),
        "snr_return": np.full((9, 3, 3), 100.0),
        "locked": np.ones((9, 3, 3), dtype=bool),
    }
    return InterferometerMeasurement(**{**fields, **changes})


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"t_s": float("nan")}, "t_s=nan must be finite"),
        ({"phase_rad": np.full((9, 3, 3), np.nan)}, r"(?s)phase_rad=.* must be finite"),
        ({"phase_rate_rad_s": np.zeros((8, 3, 3))}, "phase_rate_rad_s has shape"),
        ({"amplitudes": np.array([[np.inf, 0.0], [0.0, 1.0]])}, r"(?s)amplitudes=.* must be finite"),
        ({"amplitude_sigma": 0.0}, r"amplitude_sigma=0.0 must be > 0"),
        ({"snr_return": np.zeros((9, 4, 4))}, "snr_return has shape"),
        ({"locked": np.ones((9, 3, 3))}, "locked has shape .* must be .* of bool"),
    ],
)
def test_incomplete_or_undefined_measurements_are_refused(changes, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        measurement(**changes)


def test_a_complete_measurement_is_frozen() -> None:
    with pytest.raises(dataclasses.FrozenInstanceError):
        measurement().t_s = 2.0
