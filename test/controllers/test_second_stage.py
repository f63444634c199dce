"""The law of a second stage: bounded, exact within its travel, and handed back where the mount is too far off."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rf_pointing.controllers.second_stage import SecondStage
from rf_pointing.core.second_stage import SecondStageParams, axes_from_sky, sky_from_axes

TRAVEL, RATE, TICK_S = 1e-3, 0.02, 0.02
PARAMS = SecondStageParams(travel_rad=TRAVEL, rate_rad_s=RATE, hand_back_s=0.2)
angles = st.floats(-5.0 * TRAVEL, 5.0 * TRAVEL)
pairs = st.tuples(angles, angles)


@given(
    st.lists(st.tuples(pairs, st.booleans()), min_size=2, max_size=60),
    st.lists(st.floats(-4.0, 4.0), min_size=3, max_size=3),
)
def test_no_residual_drives_it_beyond_its_travel_or_its_rate(steps: list, taps: list[float]) -> None:
    law, before = SecondStage(PARAMS, np.column_stack([taps, taps])), np.zeros(2)
    for residual, follow in steps:
        command = law.step(residual, TICK_S, follow=follow)
        assert np.all(np.abs(command) <= TRAVEL * (1.0 + 1e-12))
        assert np.all(np.abs(command - before) <= RATE * TICK_S * (1.0 + 1e-9))
        before = command


@given(
    st.lists(
        st.tuples(st.floats(-0.9 * TRAVEL, 0.9 * TRAVEL), st.floats(-0.9 * TRAVEL, 0.9 * TRAVEL)),
        min_size=1,
        max_size=30,
    )
)
def test_both_stages_together_are_the_command(residuals: list[tuple[float, float]]) -> None:
    law = SecondStage(PARAMS.replace(rate_rad_s=10.0), np.array([[1.0, 1.0], [0.0, 0.0]]))
    command = np.array([0.4, 0.7])
    for residual in residuals:
        mount = command - residual
        np.testing.assert_allclose(mount + law.step(residual, TICK_S, follow=True), command, rtol=0.0, atol=1e-15)


def test_a_mount_too_far_off_is_left_alone_until_it_is_near_again() -> None:
    law = SecondStage(PARAMS.replace(rate_rad_s=10.0), np.array([[1.0, 1.0]]))

    def after(ticks: int, residual: float) -> float:
        return [law.step((residual, 0.0), TICK_S, follow=True)[0] for _ in range(ticks)][-1]

    assert after(9, 2.0 * TRAVEL) == TRAVEL
    assert not law.state.handed_back
    assert after(1, 2.0 * TRAVEL) == 0.0
    assert law.state.handed_back
    assert after(50, 0.6 * TRAVEL) == 0.0, "nearer than the travel, and still not near"
    assert after(9, 0.4 * TRAVEL) == 0.0
    assert after(1, 0.4 * TRAVEL) == pytest.approx(0.4 * TRAVEL)


@given(st.lists(pairs, min_size=4, max_size=30), st.integers(1, 3))
def test_a_copied_state_goes_on_identically(residuals: list, at: int) -> None:
    taps = np.array([[1.2, 0.7], [-0.3, 0.2], [0.1, 0.0]])
    law, copied = SecondStage(PARAMS, taps), SecondStage(PARAMS, taps)
    for residual in residuals[:at]:
        law.step(residual, TICK_S, follow=True)
    copied.state = law.state
    for residual in residuals[at:]:
        first, second = (each.step(residual, TICK_S, follow=True) for each in (law, copied))
        assert first.tolist() == second.tolist()


@pytest.mark.parametrize("residual", [(np.nan, 0.0), (0.0, np.inf)])
def test_what_is_not_a_number_is_refused_by_its_name(residual: tuple[float, float]) -> None:
    with pytest.raises(ValueError, match="residual_rad"):
        SecondStage(PARAMS, np.ones((1, 2))).step(residual, TICK_S, follow=True)


@given(pairs, st.floats(-3.0, 3.0))
def test_axis_angles_and_the_deflection_on_the_sky_are_inverses(
    angles_rad: tuple[float, float], upper_rad: float
) -> None:
    back = axes_from_sky(sky_from_axes(np.array(angles_rad), upper_rad), upper_rad)
    near_zenith = abs(np.cos(upper_rad)) < 0.01
    np.testing.assert_allclose(back, (0.0 if near_zenith else angles_rad[0], angles_rad[1]), rtol=1e-12, atol=1e-300)
