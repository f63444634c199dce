"""What attitude sensors say is finite, of unit length and with a covariance; stamps lie not ahead of the clock."""

from typing import Any

import numpy as np
import pytest

from rf_pointing.array_sensors.attitude.attitude_report import (
    LARGEST_LEAD_S,
    AttitudeReport,
    RateReport,
    require_arrived,
    require_covariance,
)

SOUND: dict[str, Any] = {
    "t_s": 1.0, "quaternion": np.array([0.0, 0.0, 0.6, 0.8]),
    "covariance_rad2": np.diag([1.0, 2.0, 3.0]), "valid": True, "reason": "",
}  # fmt: skip


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"t_s": np.inf}, "t_s=inf must be finite"),
        ({"quaternion": np.array([0.0, 0.0, 0.0, 2.0])}, "norm"),
        ({"quaternion": np.array([0.0, 0.0, np.nan, 1.0])}, "quaternion"),
        ({"quaternion": np.zeros(3)}, "shape"),
        ({"covariance_rad2": np.diag([1.0, 2.0, -3.0])}, "eigenvalue"),
        ({"covariance_rad2": np.diag([1.0, 2.0, np.nan])}, "covariance_rad2"),
        ({"covariance_rad2": np.triu(np.ones((3, 3)))}, "symmetric"),
        ({"valid": False}, "must say why"),
    ],
)
def test_unsound_attitude_is_refused(changes: dict[str, Any], words: str) -> None:
    AttitudeReport(**SOUND)
    with pytest.raises(ValueError, match=words):
        AttitudeReport(**{**SOUND, **changes})


def test_unsound_rate_is_refused() -> None:
    with pytest.raises(ValueError, match="rate_rad_s"):
        RateReport(t_s=0.0, rate_rad_s=np.array([0.0, np.nan, 0.0]), covariance_rad2_s2=np.eye(3))
    with pytest.raises(ValueError, match="t_s=nan must be finite"):
        RateReport(t_s=float("nan"), rate_rad_s=np.zeros(3), covariance_rad2_s2=np.eye(3))
    with pytest.raises(ValueError, match="eigenvalue"):
        RateReport(t_s=0.0, rate_rad_s=np.zeros(3), covariance_rad2_s2=-np.eye(3))


def test_stamp_ahead_of_the_clock_is_refused_and_one_from_the_past_is_not() -> None:
    require_arrived(100.0, 100.0 - LARGEST_LEAD_S)
    require_arrived(0.0, 100.0)
    with pytest.raises(ValueError, match="ahead of the clock"):
        require_arrived(100.0, 99.9 - LARGEST_LEAD_S)
    with pytest.raises(ValueError, match="finite"):
        require_arrived(float("nan"), 0.0)


def test_a_covariance_is_symmetric_and_not_negative_to_a_billionth_of_its_largest_element() -> None:
    for scale in (1e-12, 1.0, 1e12):
        sound = scale * np.array([[4.0, 1.0, 0.0], [1.0, 3.0, 0.5], [0.0, 0.5, 2.0]])
        np.testing.assert_array_equal(require_covariance("c", sound, 3), sound)
        for off, refused in ((3e-9, False), (5e-9, True)):
            # Relative to the largest element, 4.
            lopsided = sound + scale * off * np.eye(3, k=1)
            negative = scale * np.diag([4.0, 1.0, -off])
            for matrix, words in ((lopsided, "c is not symmetric"), (negative, "c has eigenvalue")):
                if refused:
                    with pytest.raises(ValueError, match=words):
                        require_covariance("c", matrix, 3)
                else:
                    require_covariance("c", matrix, 3)
    np.testing.assert_array_equal(require_covariance("c", np.zeros((2, 2)), 2), np.zeros((2, 2)))
    with pytest.raises(ValueError, match="c has shape"):
        require_covariance("c", np.eye(3), 2)
