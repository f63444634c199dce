"""One axis as a sampled loop: its formula on planted responses, its parts against their definitions."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from rf_pointing.controllers.margins import RadioLoop
from rf_pointing.papers.servo_sampled import loop_quality, published_radio, sampled_axis, station_radio
from rf_pointing.servo import dss13_plant
from rf_pointing.servo.linear_model import linear_model
from rf_pointing.station.antenna.axis_response import Variation, davenport_psd

FREQUENCY_HZ = np.array([0.1, 0.4, 1.1, 3.0])


def test_the_radio_loops_are_those_of_the_paper_and_of_the_station() -> None:
    assert published_radio(0.3) == RadioLoop(0.3, mean_of=1, cluster=1, wait_s=0.1)
    assert station_radio(0.2) == RadioLoop(0.2, mean_of=5, cluster=5, wait_s=0.2)


def test_a_radio_loop_is_an_integrator_of_means_late_by_its_waits() -> None:
    s = 2j * np.pi * FREQUENCY_HZ
    errors = (1.0 + np.exp(-0.1 * s) + np.exp(-0.2 * s)) / 3.0
    samples = (1.0 + np.exp(-0.02 * s)) / 2.0
    # A straight line of 0.1 s instead of a step.
    line = (1.0 - np.exp(-0.1 * s)) / (0.1 * s)
    expected = 2.0 * math.pi * 0.25 / s * np.exp(-0.13 * s) * errors * samples * line
    np.testing.assert_allclose(RadioLoop(0.25, 3, 2, 0.13).response(FREQUENCY_HZ), expected, rtol=1e-12)


@pytest.mark.parametrize("axis", [0, 1])
def test_an_axis_has_the_responses_of_the_linear_model(axis: int) -> None:
    """To the wind in continuous time; to slow rate commands too, apart from the half sample they are held."""
    plant = dss13_plant(ideal=True)
    model, response = linear_model(plant), sampled_axis(plant, axis, Variation())
    slow = response.frequency_hz < 0.3
    s = 2j * np.pi * response.frequency_hz[:, None, None]
    shown = np.vstack([model.encoder[axis], model.beam[axis]])
    solved = np.linalg.solve(s * np.eye(len(model.a)) - model.a, np.hstack([model.b_wind, model.b_command])[None])
    exact = shown @ solved
    # The modes of an axis move the other one a little, which one axis alone does not have.
    np.testing.assert_allclose(response.from_wind, exact[:, :, axis], rtol=1e-6, atol=1e-4)
    held = np.exp(-0.01 * s[slow, 0]) * np.sinc(response.frequency_hz[slow, None] * 0.02)
    np.testing.assert_allclose(response.from_command[slow], exact[slow, :, 2 + axis] * held, rtol=2e-3)


def flat_response(radius: float = 0.9) -> SimpleNamespace:
    """An axis whose responses are the same at all frequencies."""
    shape = np.ones((4, 1))
    return SimpleNamespace(
        frequency_hz=FREQUENCY_HZ,
        from_command=shape * np.array([0.5 + 0.5j, 0.4 - 0.3j]),
        from_wind=shape * np.array([2.0 + 1.0j, 3.0 - 1.0j]),
        closed_radius=lambda matrices: radius if matrices == "law" else math.nan,
    )


LAW = SimpleNamespace(gain=np.full(4, 1.0 + 2.0j), fed=np.full(4, 0.5 - 1.0j), matrices="law")


@pytest.mark.parametrize("radio", [False, True])
def test_error_and_peaks_follow_from_the_loops_around_the_antenna(radio: bool) -> None:
    loop = RadioLoop(0.3, 1, 1, 0.05) if radio else None
    found = loop_quality(flat_response(), LAW, loop, 6.0)
    sensitivity = 1.0 / (1.0 + (0.5 + 0.5j) * (1.0 + 2.0j))
    integrator = loop.response(FREQUENCY_HZ) if loop else np.zeros(4)
    outer = 1.0 / (1.0 + integrator * (0.4 - 0.3j) * (1.5 + 1.0j) * sensitivity)
    error = (3.0 - 1.0j - (0.4 - 0.3j) * (1.0 + 2.0j) * (2.0 + 1.0j) * sensitivity) * outer
    power = np.abs(error) ** 2 * davenport_psd(FREQUENCY_HZ, 6.0, 0.005)
    total = sum(0.5 * (power[k] + power[k + 1]) * (FREQUENCY_HZ[k + 1] - FREQUENCY_HZ[k]) for k in range(3))
    assert found.rms_s2_per_m_s == pytest.approx(math.sqrt(total), rel=1e-12)
    assert found.encoder_peak == pytest.approx(abs(sensitivity), rel=1e-12)
    assert found.radio_peak == pytest.approx(np.max(np.abs(outer)), rel=1e-12)
