"""The continuous loop against its block diagram, and what is read off it, on loops known in closed form."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.typing import NDArray

from rf_pointing.controllers import PositionLoopParams
from rf_pointing.papers import servo_linear
from rf_pointing.papers.servo_linear import COMMAND, DEVIATION, WIND, ClosedLoop, closed_loop, stability_limit_hz
from rf_pointing.servo import dss13_plant
from rf_pointing.servo.linear_model import linear_model

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
    return {"encoder": encoder @ command + encoder_wind @ wind, "beam": shown, "offset": radio / s @ (towards - shown)}


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


def test_a_loop_that_is_never_unstable_has_the_limit_of_3_hz(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(servo_linear, "closed_loop", lambda *_: SimpleNamespace(stable=lambda: True))
    assert stability_limit_hz("plant", "loops", 0) == 3.0
