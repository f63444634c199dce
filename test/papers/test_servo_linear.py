"""The continuous loop against its block diagram, and what is read off it, on loops known in closed form."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.typing import NDArray

from rf_pointing.controllers import PositionLoopParams
from rf_pointing.papers import servo_linear
from rf_pointing.papers.servo_linear import (
    COMMAND,
    DEVIATION,
    RATE,
    WIND,
    ClosedLoop,
    closed_loop,
    peak_sensitivity,
    respond,
    stability_limit_hz,
)
from rf_pointing.servo import dss13_plant
from rf_pointing.servo.linear_model import linear_model

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]
LOOPS = (
    PositionLoopParams(proportional_gain=0.7, feedforward_gain=0.8, notch_damping=0.15),
    PositionLoopParams(notch_enabled=False, integral_gain=1.1, feedforward_band_hz=6.0),
)


def diagonal(azimuth: complex, elevation: complex) -> ComplexArray:
    return np.diag(np.array([azimuth, elevation], dtype=np.complex128))


def by_hand(frequency_hz: float, bandwidth_hz: tuple[float, float]) -> dict[str, ComplexArray]:
    """Return the responses (2, 8) of encoder, beam and offset, from the transfer functions of the parts."""
    model, s = linear_model(dss13_plant(ideal=True)), 2j * math.pi * frequency_hz
    solved = np.linalg.solve(s * np.eye(len(model.a)) - model.a, np.hstack([model.b_command, model.b_wind]))
    (encoder, encoder_wind), (beam, beam_wind) = (
        (c @ solved[:, :2], c @ solved[:, 2:]) for c in (model.encoder, model.beam)
    )
    gains, feeds = [], []
    for loop in LOOPS:
        w, wb = 2.0 * math.pi * loop.notch_frequency_hz, 2.0 * math.pi * loop.feedforward_band_hz
        notch = (s**2 + w**2) / (s**2 + 2.0 * loop.notch_damping * w * s + w**2) if loop.notch_enabled else 1.0
        gains.append(notch * (loop.proportional_gain + loop.integral_gain / s))
        feeds.append(notch * loop.feedforward_gain * wb / (s + wb))
    law, feed = diagonal(*gains), diagonal(*feeds)
    radio = 2.0 * math.pi * diagonal(*bandwidth_hz)
    # u = law (r + o - encoder) + feed (r' + o'),  o' = s o = radio (r + deviation - beam).
    around = (law / s + feed) @ radio
    inputs = np.hstack([law + around, feed, -(around @ beam_wind + law @ encoder_wind), around])
    command = np.linalg.solve(np.eye(2) + around @ beam + law @ encoder, inputs)
    wind = np.zeros((2, 8))
    wind[:, WIND] = np.eye(2)
    towards = np.zeros((2, 8))
    towards[:, COMMAND] = towards[:, DEVIATION] = np.eye(2)
    shown = beam @ command + beam_wind @ wind
    return {
        "encoder": encoder @ command + encoder_wind @ wind,
        "beam": shown,
        "offset": radio / s @ (towards - shown),
    }


@pytest.mark.parametrize("bandwidth_hz", [(0.03, 0.05), (0.0, 0.2)])
def test_every_response_of_the_loop_is_that_of_its_block_diagram(bandwidth_hz: tuple[float, float]) -> None:
    system = closed_loop(dss13_plant(ideal=True), LOOPS, bandwidth_hz)
    assert system.offset.shape == (2, len(system.a))
    for frequency_hz in (0.004, 0.11, 1.9, 2.12, 7.0):
        expected = by_hand(frequency_hz, bandwidth_hz)
        for name in ("encoder", "beam", "offset"):
            found = system.response(np.array([frequency_hz]), getattr(system, name), slice(0, 8))[0]
            np.testing.assert_allclose(found, expected[name], rtol=1e-6, atol=1e-9)


def test_without_a_bandwidth_no_radio_integrator_moves() -> None:
    system = closed_loop(dss13_plant(ideal=True), LOOPS)
    assert not np.any(system.offset @ system.a)
    assert not np.any(system.offset @ system.b)


@pytest.mark.parametrize(("pole", "stable"), [(-0.1, True), (0.9e-9, True), (1.15e-9, False), (0.2, False)])
def test_a_loop_is_stable_with_its_poles_left_of_the_axis_or_at_zero(pole: float, stable: bool) -> None:
    one = np.array([[pole]])
    assert ClosedLoop(one, np.zeros((1, 8)), one, one, one).stable() is stable


@pytest.mark.parametrize("axis", [0, 1])
def test_the_limit_is_scanned_in_steps_of_2_percent_and_bisected_20_times(
    axis: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    # Between the halves of the twentieth bisection.
    limit_hz = 0.005 * 1.02 ** (50.0 + 700_001.75 / 2**20)
    tried: list[float] = []

    def planted(plant: object, loops: object, bandwidth_hz: tuple[float, float]) -> SimpleNamespace:
        assert (plant, loops) == ("plant", "loops")
        assert bandwidth_hz[1 - axis] == 0.0
        tried.append(bandwidth_hz[axis])
        return SimpleNamespace(stable=lambda: bandwidth_hz[axis] < limit_hz)

    monkeypatch.setattr(servo_linear, "closed_loop", planted)
    found = stability_limit_hz("plant", "loops", axis)
    assert tried[:51] == pytest.approx([0.005 * 1.02**k for k in range(51)])
    assert len(tried) == 52 + 20
    assert found == pytest.approx(0.005 * 1.02 ** (50.0 + 700_001.0 / 2**20), rel=1e-9)


def test_a_loop_that_is_never_unstable_has_the_limit_of_3_hz(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(servo_linear, "closed_loop", lambda *_: SimpleNamespace(stable=lambda: True))
    assert stability_limit_hz("plant", "loops", 0) == 3.0


def test_peak_sensitivity_is_that_of_integrator_and_inner_loop_from_1_mhz_to_20_hz(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The inner loop lags by a first-order filter: |S| in closed form."""
    points: list[Array] = []

    def response(frequency_hz: Array, output: object, inputs: slice) -> ComplexArray:
        assert output == "beam"
        points.append(frequency_hz)
        s = 2j * np.pi * frequency_hz
        # What comes from the command lacks 0.3 s, which comes from its rate.
        own = [np.full(len(s), 0.3 + 0j)] * 2 if inputs == RATE else [1.0 / (1.0 + t * s) - 0.3 * s for t in (2.0, 0.5)]
        return np.array([[[one, 5.0], [7.0, other]] for one, other in zip(*own, strict=True)])

    def planted(plant: object, loops: object) -> SimpleNamespace:
        assert (plant, loops) == ("plant", "loops")
        return SimpleNamespace(response=response, beam="beam")

    monkeypatch.setattr(servo_linear, "closed_loop", planted)
    for axis, lag_s in enumerate((2.0, 0.5)):
        found = peak_sensitivity("plant", "loops", axis, 0.4)
        s = 2j * np.pi * np.geomspace(1e-3, 20.0, 4000)
        rate = 2.0 * math.pi * 0.4
        assert found == pytest.approx(np.max(np.abs(s * (1.0 + lag_s * s) / (s * (1.0 + lag_s * s) + rate))), rel=1e-12)
    for grid in points:
        assert (len(grid), grid[0], grid[-1]) == (4000, pytest.approx(1e-3), pytest.approx(20.0))


def test_a_response_is_exact_for_inputs_that_run_straight_between_their_samples() -> None:
    a, b = np.array([[-2.0]]), np.arange(1.0, 9.0)[None]
    t = 0.1 * np.arange(30)
    inputs = np.zeros((30, 8))
    inputs[:, 3], inputs[:, 6] = 1.0 + 3.0 * t, -t
    found = respond(ClosedLoop(a, b, a, a, a), inputs, 0.1, np.array([[1.0], [-0.5]]), np.array([4.0]))
    # x' = -2 x + 4 (1 + 3 t) - 7 t, from x = 4.
    exact = 0.75 + 2.5 * t + 3.25 * np.exp(-2.0 * t)
    np.testing.assert_allclose(found, np.column_stack([exact, -0.5 * exact]), rtol=1e-10)
