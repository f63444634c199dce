"""Pointing models as messages and back; one that cannot be used is refused in words."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from rf_pointing.calibration import TERMS, read_model
from rf_pointing.ros import convert_calibration
from rf_pointing.station.description import STATIONS

MODEL = STATIONS / "bias_model_dss13_x.yaml"


def test_a_model_file_becomes_the_model_with_its_covariance() -> None:
    file = read_model(MODEL)
    message = convert_calibration.model_to_message(file)
    assert dict(convert_calibration.model_from_message(message).coefficients) == dict(file.model.coefficients)
    assert (message.name, message.station) == ("dss13-commissioning", "Goldstone DSS-13")
    covariance = np.array(message.covariance).reshape(len(TERMS), len(TERMS))
    at = message.terms.index("droop")
    assert covariance[at, at] == pytest.approx(math.radians(0.004) ** 2)
    unfitted = message.terms.index("collimation")
    assert not np.any(covariance[unfitted])


@pytest.mark.parametrize(
    ("spoil", "complaint"),
    [
        (lambda m: m.values.pop(), "values has 13 numbers, must have one for each of 14 terms"),
        (lambda m: m.terms.__setitem__(0, "twist"), "twist"),
        (lambda m: m.values.__setitem__(3, math.nan), "azimuth_encoder_sine=nan must be finite"),
        (lambda m: m.values.__setitem__(3, 9.0), "azimuth_encoder_sine=9.0 must be <="),
        (lambda m: (m.terms.pop(), m.values.pop()), "the bias model needs elevation_acceleration_lag"),
    ],
)
def test_a_model_that_cannot_be_used_is_refused(spoil: Callable[[Any], Any], complaint: str) -> None:
    message = convert_calibration.model_to_message(read_model(MODEL))
    message.terms, message.values = list(message.terms), list(message.values)
    spoil(message)
    with pytest.raises(ValueError, match=complaint):
        convert_calibration.model_from_message(message)
