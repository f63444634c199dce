"""The design of the LQG law in closed form: drive, filters before it, disturbance, gains and margins."""

import json
import math
from pathlib import Path

import control
import numpy as np
import pytest
from numpy.typing import NDArray

from rf_pointing.controllers import LqgDesign, load_lqg_designs
from rf_pointing.controllers.filters import section_matrices
from rf_pointing.controllers.lqg import LqgWeights
from rf_pointing.controllers.lqg_design import as_mapping, design_lqg, drive_of, save_lqg_designs

Array = NDArray[np.float64]
SAMPLE_S, BANDWIDTH, GAIN = 0.02, 15.0, 0.8
WEIGHTS = LqgWeights(
    notch_frequency_hz=2.32, notch_damping=0.29, shaping_zero_hz=3.0, shaping_zero_damping=0.7, shaping_pole_hz=4.0,
    shaping_pole_damping=0.6, control_weight=0.023, disturbance_intensity=0.069, rate_intensity=1e-4,
)  # fmt: skip


def drive() -> tuple[Array, Array, Array, Array]:
    """Return the sampled drive alone, angle' = rate, rate' = 15 (0.8 u - rate), by its exact step."""
    left = math.exp(-BANDWIDTH * SAMPLE_S)
    a = np.array([[1.0, (1.0 - left) / BANDWIDTH], [0.0, left]])
    b = GAIN * np.array([[SAMPLE_S - (1.0 - left) / BANDWIDTH], [1.0 - left]])
    return a, b, np.array([[1.0, 0.0]]), np.zeros((1, 1))


@pytest.fixture(scope="module")
def design() -> LqgDesign:
    return design_lqg(*drive(), SAMPLE_S, WEIGHTS)


def test_bandwidth_and_gain_of_the_drive_are_read_off_its_poles_and_residue() -> None:
    assert drive_of(*drive()[:3], SAMPLE_S) == pytest.approx((BANDWIDTH, GAIN), rel=1e-9)


def test_the_slowest_real_pole_inside_the_circle_is_the_drive() -> None:
    """Faster, negative, oscillating and growing poles are none."""
    turning = 0.95 * np.array([[math.cos(0.3), -math.sin(0.3)], [math.sin(0.3), math.cos(0.3)]])
    a = np.zeros((7, 7))
    a[:2, :2] = turning
    a[range(2, 7), range(2, 7)] = 1.0, 0.7, 0.4, -0.9, 1.2
    bandwidth, gain = drive_of(a, np.ones((7, 1)), np.array([[1.0, 1.0, 0.03, 1.0, 1.0, 1.0, 1.0]]), 0.05)
    assert bandwidth == pytest.approx(-math.log(0.7) / 0.05)
    assert gain == pytest.approx(0.03 / 0.05)


@pytest.mark.parametrize(
    ("poles", "message"),
    [
        ((1.0 + 1.15e-6, 0.7), "pole nearest to the integrator"),
        ((1.0, 1.3), "no real pole"),
        ((1.0, -0.4), "no real pole"),
    ],
)
def test_a_model_without_integrator_or_drive_is_refused(poles: tuple[float, float], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        drive_of(np.diag(poles), np.ones((2, 1)), np.ones((1, 2)), SAMPLE_S)
    near = np.diag([1.0 + 0.9e-6, 0.7])
    assert drive_of(near, np.ones((2, 1)), np.ones((1, 2)), SAMPLE_S)[0] == pytest.approx(-math.log(0.7) / SAMPLE_S)


def response(a: Array, b: Array, c: Array, d: Array | float, z: complex) -> complex:
    return complex((c @ np.linalg.solve(z * np.eye(len(a)) - a, b) + d).item())


def test_the_regulator_weighs_the_angle_and_cancels_the_disturbance(design: LqgDesign) -> None:
    a, b = design.a[:6, :6], design.b[:6]
    price = np.diag([1.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    cost = control.dare(a, b, price, np.array([[0.023]]))[0]
    gain = np.linalg.solve(0.023 + b.T @ cost @ b, b.T @ cost @ a)
    np.testing.assert_allclose(design.state_gain[:, :6], gain, rtol=1e-7)
    # In the steady state under a constant disturbance v all filters pass -v, which they hold in their low-pass states.
    x = np.zeros(7)
    x[6] = 1.0
    for _ in range(5000):
        x = (design.a - design.b @ design.state_gain) @ x
    np.testing.assert_allclose(x[:2], 0.0, atol=1e-9)
    assert (design.state_gain @ x).item() == pytest.approx(1.0, abs=1e-9)


def test_the_estimator_is_the_kalman_predictor_of_its_noise(design: LqgDesign) -> None:
    """Held against the covariance recursion from no knowledge to its end, and python-control."""
    for one in (design, *load_lqg_designs()):
        a, c = one.a, one.c
        noise = np.diag([0.0, one.weights.rate_intensity, 0, 0, 0, 0, one.weights.disturbance_intensity])
        variance = 1e3 * np.eye(7)
        for _ in range(3000):
            seen = c @ variance @ c.T + 1.0
            variance = a @ (variance - variance @ c.T @ c @ variance / seen) @ a.T + noise
        gain = a @ variance @ c.T / (c @ variance @ c.T + 1.0)
        np.testing.assert_allclose(one.observer_gain, gain, rtol=1e-6, atol=1e-9)
        library = control.dlqe(a, np.eye(7), c, noise, np.eye(1))[0]
        np.testing.assert_allclose(one.observer_gain, library, rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize("axis", [0, 1])
def test_the_packaged_designs_are_made_from_their_models_and_weights(axis: int) -> None:
    packaged = load_lqg_designs()[axis]
    model = packaged.model_a, packaged.model_b, packaged.model_c, packaged.model_d
    found = design_lqg(*model, packaged.sample_s, packaged.weights)
    for name in ("a", "b", "c", "state_gain", "observer_gain"):
        np.testing.assert_allclose(getattr(found, name), getattr(packaged, name), rtol=1e-6, atol=1e-9)
    for name in ("peak_sensitivity", "gain_margin_db", "phase_margin_rad", "drive_bandwidth_rad_s", "drive_gain"):
        assert getattr(found, name) == pytest.approx(getattr(packaged, name), rel=1e-6)


def loop_at(design: LqgDesign, omega: Array) -> Array:
    law = design.a - design.b @ design.state_gain - design.observer_gain @ design.c
    loops = []
    for z in np.exp(1j * omega * SAMPLE_S):
        filters = [response(*section_matrices(part, SAMPLE_S), z) for part in (WEIGHTS.notch, WEIGHTS.shaping)]
        loops.append(
            response(law, design.observer_gain, design.state_gain, 0.0, z)
            * filters[0]
            * filters[1]
            * response(*drive(), z)
        )
    return np.array(loops)


def test_the_law_runs_behind_its_filters(design: LqgDesign) -> None:
    system = control.ss(*design.matrices(SAMPLE_S), SAMPLE_S)
    omega = np.array([0.5, 3.0, 20.0, 90.0])
    plant = np.array([response(*drive(), z) for z in np.exp(1j * omega * SAMPLE_S)])
    np.testing.assert_allclose(system(np.exp(1j * omega * SAMPLE_S)) * plant, loop_at(design, omega), rtol=1e-7)


def test_margins_are_read_off_the_response_of_the_loop(design: LqgDesign) -> None:
    omega = np.geomspace(0.05, math.pi / SAMPLE_S * 0.999, 4000)
    loop = loop_at(design, omega)
    assert design.peak_sensitivity == pytest.approx(np.max(1.0 / np.abs(1.0 + loop)), rel=1e-6)
    phase_deg = np.degrees(np.unwrap(np.angle(loop)))
    gain, phase, *_ = control.stability_margins((np.abs(loop), phase_deg, omega))
    assert design.gain_margin_db == pytest.approx(20.0 * math.log10(gain), abs=0.01)
    assert math.degrees(design.phase_margin_rad) == pytest.approx(phase, abs=0.05)


def test_a_design_keeps_its_model_its_drive_and_its_weights(design: LqgDesign, tmp_path: Path) -> None:
    for found, given in zip((design.model_a, design.model_b, design.model_c, design.model_d), drive(), strict=True):
        np.testing.assert_array_equal(found, given)
    assert (design.drive_bandwidth_rad_s, design.drive_gain) == pytest.approx((BANDWIDTH, GAIN))
    assert (design.sample_s, design.weights) == (SAMPLE_S, WEIGHTS)
    save_lqg_designs(tmp_path / "designs.json", design, design)
    text = (tmp_path / "designs.json").read_text()
    assert text.endswith("}\n")
    assert text.splitlines()[1].startswith(' "format"')
    content = json.loads(text)
    assert content["azimuth"] == content["elevation"] == json.loads(json.dumps(as_mapping(design)))
    assert content["azimuth"]["weights"]["control_weight"] == 0.023


def test_a_loop_that_is_unstable_on_the_model_is_refused_with_its_radius() -> None:
    """The law is made for the drive; the model has a mode as well that the law turns over."""
    a, b, c, d = drive()
    turning = 0.9999 * np.array([[math.cos(0.26), -math.sin(0.26)], [math.sin(0.26), math.cos(0.26)]])
    whole = np.block([[a, np.zeros((2, 2))], [np.zeros((2, 2)), turning]])
    entry = np.vstack([b, [[0.02], [0.0]]])
    with pytest.raises(ValueError, match=r"spectral radius 1\.\d+ of the loop on the identified model must be < 1"):
        design_lqg(whole, entry, np.hstack([c, [[-3.0, 0.0]]]), d, SAMPLE_S, WEIGHTS)
