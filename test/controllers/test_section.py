"""The second-order section against its bilinear transform."""

import math

import numpy as np
import pytest
import scipy.signal

from rf_pointing.controllers.filters import Section, SectionParams

PARAMS = SectionParams(zero_hz=2.04, zero_damping=0.03, pole_hz=4.0, pole_damping=0.6)


def respond(section: Section, values: np.ndarray, dt_s: float) -> np.ndarray:
    out = []
    for value in values:
        out.append(section.output(float(value)))
        section.update(dt_s)
    return np.array(out)


@pytest.mark.parametrize("dt_s", [0.005, 0.02, 0.05])
def test_impulse_response_is_the_bilinear_transform_prewarped_at_the_zeros(dt_s: float) -> None:
    wz, wp = 2.0 * math.pi * 2.04, 2.0 * math.pi * 4.0
    warp = wz / math.tan(0.5 * wz * dt_s)
    b, a = scipy.signal.bilinear([1 / wz**2, 0.06 / wz, 1.0], [1 / wp**2, 1.2 / wp, 1.0], fs=0.5 * warp)
    impulse = np.zeros(60)
    impulse[0] = 1.0
    np.testing.assert_allclose(
        respond(Section(PARAMS, dt_s), impulse, dt_s), scipy.signal.lfilter(b, a, impulse), atol=1e-11
    )


def test_retuning_in_steady_state_makes_no_jump() -> None:
    section = Section(PARAMS)
    section.reset(0.3)
    assert section.output(0.3) == pytest.approx(0.3, abs=1e-15)
    section.update(0.02)
    section.retune(SectionParams(zero_hz=1.5, zero_damping=0.4, pole_hz=3.0, pole_damping=0.9))
    assert section.output(0.3) == pytest.approx(0.3, abs=1e-15)


def test_poles_above_half_the_sampling_rate_are_refused() -> None:
    with pytest.raises(ValueError, match=r"pole_hz=30\.0 must be < 25\.0"):
        Section(PARAMS.replace(pole_hz=30.0))
