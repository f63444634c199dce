"""One axis as a sampled loop: its formula on planted responses, its parts against their definitions."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.typing import NDArray

from rf_pointing.controllers import PositionLoopParams, dss13_loops, load_lqg_designs
from rf_pointing.controllers.filters import section_matrices
from rf_pointing.papers import servo_sampled
from rf_pointing.papers.servo_sampled import (
    AxisResponse,
    LawResponse,
    RadioLoop,
    Variation,
    davenport_psd,
    loop_quality,
    published_radio,
    station_radio,
)
from rf_pointing.servo import dss13_plant
from rf_pointing.servo.linear_model import linear_model

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]
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


def test_the_grid_reaches_from_1_mhz_to_24_hz_and_is_finest_at_the_modes() -> None:
    grid = servo_sampled._grid()
    parts = [np.geomspace(1e-3, 24.0, 700), np.linspace(1.3, 2.7, 300), np.linspace(2.7, 6.0, 160)]
    assert np.all(np.diff(grid) > 0.0)
    assert len(grid) == 700 + 300 + 160 - 1
    np.testing.assert_allclose(grid, np.unique(np.concatenate(parts)), rtol=1e-12)


@pytest.mark.parametrize("enabled", [True, False])
def test_a_law_leads_by_its_matrices_and_feeds_the_rate_through_notch_and_low_pass(enabled: bool) -> None:
    law = PositionLoopParams(notch_frequency_hz=1.7, notch_damping=0.3, notch_enabled=enabled)
    found = LawResponse(law)
    frequency = servo_sampled._grid()
    s, z = 2j * np.pi * frequency, np.exp(2j * np.pi * frequency * 0.02)
    a, b, c, d = section_matrices(law.notch, 0.02)
    notch = (
        np.array([(c @ np.linalg.solve(x * np.eye(2) - a, b) + d).item() for x in z]) if enabled else np.ones_like(z)
    )
    np.testing.assert_allclose(found.fed, notch * s / (1.0 + s / (20.0 * math.pi)), rtol=1e-8, atol=1e-9)
    # k_p + k_i T / (z - 1) behind the notch.
    np.testing.assert_allclose(found.gain, notch * (0.5 + 1.8 * 0.02 / (z - 1.0)), rtol=1e-8, atol=1e-9)


def test_the_notch_of_a_model_based_law_is_that_of_its_weights() -> None:
    design = load_lqg_designs()[1]
    z = np.exp(2j * np.pi * FREQUENCY_HZ * 0.02)
    a, b, c, d = section_matrices(design.weights.notch, 0.02)
    expected = [(c @ np.linalg.solve(x * np.eye(2) - a, b) + d).item() for x in z]
    np.testing.assert_allclose(servo_sampled._notch_response(design, z), expected, rtol=1e-8)


@pytest.mark.parametrize("axis", [0, 1])
def test_an_axis_has_the_responses_of_the_linear_model(axis: int) -> None:
    """To the wind in continuous time; to slow rate commands too, apart from the half sample they are held."""
    plant = dss13_plant(ideal=True)
    model, response = linear_model(plant), AxisResponse(plant, axis, Variation())
    slow = response.frequency_hz < 0.3
    s = 2j * np.pi * response.frequency_hz[:, None, None]
    shown = np.vstack([model.encoder[axis], model.beam[axis]])
    solved = np.linalg.solve(s * np.eye(len(model.a)) - model.a, np.hstack([model.b_wind, model.b_command]))
    exact = shown @ solved
    # The modes of an axis move the other one a little, which one axis alone does not have.
    np.testing.assert_allclose(response.from_wind, exact[:, :, axis], rtol=1e-6, atol=1e-4)
    held = np.exp(-0.01 * s[slow, 0]) * np.sinc(response.frequency_hz[slow, None] * 0.02)
    np.testing.assert_allclose(response.from_command[slow], exact[slow, :, 2 + axis] * held, rtol=2e-3)


def test_a_varied_axis_has_other_modes_and_residues_and_the_other_axis_none() -> None:
    plant = dss13_plant(ideal=True)
    varied = servo_sampled._varied(plant, "elevation", Variation(1.1, 0.7))
    assert varied.azimuth == plant.azimuth
    for name, factor in (("mode_frequency_hz", 1.1), ("mode_encoder_residue", 0.7), ("mode_beam_residue", 0.7)):
        expected = [factor * value for value in getattr(plant.elevation, name)]
        assert list(getattr(varied.elevation, name)) == pytest.approx(expected, rel=1e-12)


def test_the_closed_radius_is_that_of_plant_and_law_stepped_together() -> None:
    response = AxisResponse(dss13_plant(ideal=True), 1, Variation())
    a, b, c, d = law = dss13_loops("tuned")[1].matrices(0.02)
    size = len(response._a)
    step = response._step
    plant, states = np.ones(size), np.zeros(len(a))
    sizes = []
    for _ in range(6000):
        error = -response._outputs[:1] @ plant
        rate = c @ states + d @ error
        states = a @ states + b @ error
        plant = step[:, :size] @ plant + step[:, size] * rate
        sizes.append(np.linalg.norm(np.concatenate([plant, states])))
    # The decay over the last 4000 steps, far behind all faster modes.
    found = (max(sizes[-500:]) / max(sizes[1500:2000])) ** (1.0 / 4000.0)
    assert response.closed_radius(law) == pytest.approx(found, abs=2e-4)
    assert response.closed_radius(law) < 1.0


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


@pytest.mark.parametrize("radius", [0.9, 1.1])
@pytest.mark.parametrize("kept", [True, False])
def test_an_axis_is_stable_if_both_its_loops_are(radius: float, kept: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(servo_sampled, "_encircles_not", lambda _: kept)
    response = flat_response(radius)
    assert loop_quality(response, LAW, None, 8.0).stable is (radius < 1.0)
    assert loop_quality(response, LAW, published_radio(0.1), 8.0).stable is (kept and radius < 1.0)


@pytest.mark.parametrize(
    ("turn", "kept"),
    [(0.5, True), (0.749, True), (0.251, True), (0.751, False), (0.249, False), (-1.5, False), (2.5, False)],
)
def test_minus_one_is_left_alone_by_a_turn_of_a_quarter(turn: float, kept: bool) -> None:
    """1 + L turns from -0.6 half turns by `turn` half turns, over a circle."""
    angle = np.pi * (-0.6 + turn * np.linspace(0.0, 1.0, 200))
    assert servo_sampled._encircles_not(np.exp(1j * angle) - 1.0) is kept


def test_gusts_have_davenports_spectrum_below_and_above_its_knee() -> None:
    for frequency, speed, drag in ((0.002, 6.0, 0.004), (0.3, 11.0, 0.007)):
        x = 1200.0 * frequency / speed
        expected = 4.0 * drag * speed**2 * x**2 / (frequency * (1.0 + x**2) ** (4.0 / 3.0))
        assert davenport_psd(np.array([frequency]), speed, drag) == pytest.approx([expected], rel=1e-12)
