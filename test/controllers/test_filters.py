"""The second-order section against its bilinear transform.

The sampled notch against BWG eq. 8 and its behaviour while it is retuned.
"""

import math

import numpy as np
import pytest
import scipy.signal

from rf_pointing.controllers.filters import RateFeedforward, Section, SectionParams, before_sections, notch_section

PARAMS = SectionParams(zero_hz=2.04, zero_damping=0.03, pole_hz=4.0, pole_damping=0.6)


def respond(section: Section | RateFeedforward, values: np.ndarray, dt_s: float) -> np.ndarray:
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


def test_a_section_follows_a_change_of_the_sampling_time() -> None:
    changed, made = Section(PARAMS, 0.02), Section(PARAMS, 0.005)
    changed.update(0.005)
    impulse = np.eye(1, 40)[0]
    np.testing.assert_allclose(respond(changed, impulse, 0.005), respond(made, impulse, 0.005), atol=1e-14)


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


PUBLISHED = notch_section(2.12, 0.2)


@pytest.mark.parametrize("dt_s", [0.02, 0.1])
def test_impulse_response_is_the_prewarped_bilinear_transform_of_eq_8(dt_s: float) -> None:
    omega = 2.0 * math.pi * 2.12
    warp = omega / math.tan(0.5 * omega * dt_s)
    b, a = scipy.signal.bilinear([1.0, 0.0, omega**2], [1.0, 0.4 * omega, omega**2], fs=0.5 * warp)
    impulse = np.zeros(80)
    impulse[0] = 1.0
    ours = respond(Section(PUBLISHED, dt_s), impulse, dt_s)
    np.testing.assert_allclose(ours, scipy.signal.lfilter(b, a, impulse), atol=1e-12)


def test_switching_off_and_on_while_steady_makes_no_jump() -> None:
    notch = Section(PUBLISHED)
    notch.reset(0.3)
    for enabled in (False, True, False):
        notch.output(0.3)
        notch.update(0.02)
        notch.retune(notch_section(2.12, 0.2, enabled=enabled))
        assert notch.output(0.3) == pytest.approx(0.3, abs=1e-15)


def test_a_notch_above_half_the_sampling_rate_is_refused_and_the_old_one_stays() -> None:
    notch = Section(PUBLISHED)
    with pytest.raises(ValueError, match=r"zero_hz=30\.0 must be < 25\.0"):
        notch.retune(notch_section(30.0, 0.2))
    assert notch.params == PUBLISHED


def test_the_rate_feedforward_is_a_bilinear_low_pass_at_50_hz_unless_told_otherwise() -> None:
    b, a = scipy.signal.bilinear([1.0], [1.0 / (2.0 * math.pi * 3.0), 1.0], fs=50.0)
    feedforward, impulse = RateFeedforward(3.0), np.eye(1, 40)[0]
    np.testing.assert_allclose(respond(feedforward, impulse, 0.02), scipy.signal.lfilter(b, a, impulse), atol=1e-12)


def test_sections_behind_a_law_filter_its_output_where_they_act() -> None:
    """A law of one state, y = 0.9 y + u, before a section that acts and one that is switched off."""
    law = tuple(np.array([[value]]) for value in (0.9, 1.0, 0.9, 1.0))
    off = PARAMS.replace(enabled=False)
    a, b, c, d = before_sections(law, [off, PARAMS], 0.02)
    impulse, state, out = np.eye(1, 60)[0], np.zeros(3), []
    for value in impulse:
        out.append((c @ state + d @ [value]).item())
        state = a @ state + b @ [value]
    alone = respond(Section(PARAMS, 0.02), scipy.signal.lfilter([1.0], [1.0, -0.9], impulse), 0.02)
    np.testing.assert_allclose(out, alone, atol=1e-12)
    assert all(np.array_equal(*pair) for pair in zip(before_sections(law, [off], 0.02), law, strict=True))


def test_steps_and_bands_that_no_filter_has_are_refused() -> None:
    off = PARAMS.replace(enabled=False)
    for usual_s in (1e-5, 10.0):
        Section(off, usual_s)
    for dt_s in (0.99e-5, 10.1, math.nan):
        with pytest.raises(ValueError, match="dt_s"):
            Section(off, dt_s)
    for usual_hz in (1e-3, 1e4):
        RateFeedforward(usual_hz)
    for band_hz in (0.99e-3, 10_100.0, math.nan):
        with pytest.raises(ValueError, match="band_hz"):
            RateFeedforward(band_hz)
