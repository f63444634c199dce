"""The LQG law: optimality, agreement of design and run time, margins, files."""

import json
import math
from pathlib import Path

import control
import numpy as np
import pytest

from rf_pointing.controllers import LqgDesign, LqgLoop, LqgLoopParams, load_lqg_designs
from rf_pointing.controllers.lqg import LqgWeights
from rf_pointing.controllers.lqg_design import as_mapping, design_lqg, save_lqg_designs

SAMPLE_S = 0.02
WEIGHTS = LqgWeights(
    notch_frequency_hz=2.32, notch_damping=0.29, shaping_zero_hz=3.0, shaping_zero_damping=0.7,
    shaping_pole_hz=4.0, shaping_pole_damping=0.7, control_weight=0.023, disturbance_intensity=0.069,
    rate_intensity=1e-4,
)  # fmt: skip


def antenna() -> control.StateSpace:
    """Rate command to encoder: drive of 20 rad/s and a bending mode, sampled."""
    omega, damping, residue = 2.0 * math.pi * 2.12, 0.0082, 0.316
    drive = control.tf([20.0], [1.0, 20.0])
    angle = control.tf([1.0], [1.0, 0.0])
    mode = control.tf([-residue, 0.0], [1.0, 2.0 * damping * omega, omega**2])
    return control.ss(control.c2d(control.ss((angle + mode) * drive), SAMPLE_S))


def modal_antenna() -> tuple[np.ndarray, ...]:
    """The same in block-diagonal form with one exact integrator, as an identified model comes."""
    system = antenna()
    poles, _vectors = np.linalg.eig(system.A)
    integrator = int(np.argmin(np.abs(poles - 1.0)))
    assert abs(poles[integrator] - 1.0) < 1e-7
    return system.A, system.B, system.C, system.D


@pytest.fixture(scope="module")
def design() -> LqgDesign:
    return design_lqg(*modal_antenna(), SAMPLE_S, WEIGHTS)


def test_margins_are_those_of_the_loop_on_the_whole_model(design: LqgDesign) -> None:
    law = control.ss(*design.matrices(SAMPLE_S), SAMPLE_S)
    omega = np.geomspace(0.1, 150.0, 20_000)
    sensitivity = 1.0 / np.abs(1.0 + (antenna() * law)(np.exp(1j * omega * SAMPLE_S)))
    assert design.peak_sensitivity == pytest.approx(np.max(sensitivity), rel=0.01)
    assert design.peak_sensitivity < 2.0
    assert design.gain_margin_db > 6.0
    assert design.phase_margin_rad > math.radians(30.0)


def test_the_running_law_is_the_designed_system_and_that_of_its_matrices(design: LqgDesign) -> None:
    errors = 1e-4 * np.random.default_rng(4).standard_normal(200)
    loop, ours = LqgLoop(design, LqgLoopParams(rate_limit_rad_s=10.0)), []
    for error in errors:
        ours.append(loop.output(error, 0.0, 0.0))
        loop.update(SAMPLE_S, ours[-1])
    system = control.ss(*design.matrices(SAMPLE_S), SAMPLE_S)
    np.testing.assert_allclose(ours, control.forced_response(system, inputs=errors).outputs, atol=1e-12)
    with pytest.raises(ValueError, match=r"sample_s=0.03 must be 0.02, the sampling time of the LQG design"):
        design.matrices(0.03)


def test_constant_disturbance_leaves_no_error(design: LqgDesign) -> None:
    system = antenna()
    loop = LqgLoop(design, LqgLoopParams())
    state = np.zeros(system.nstates)
    for _ in range(3000):
        measured = float(system.C[0] @ state)
        rate = loop.output(0.0, 0.0, measured)
        state = system.A @ state + system.B[:, 0] * (rate + 5e-4)
        loop.update(SAMPLE_S, rate)
    assert abs(float(system.C[0] @ state)) < 1e-9


def test_saturation_does_not_wind_up(design: LqgDesign) -> None:
    system = antenna()
    loop = LqgLoop(design, LqgLoopParams(rate_limit_rad_s=0.01))
    state, track = np.zeros(system.nstates), []
    for _ in range(1500):
        measured = float(system.C[0] @ state)
        track.append(measured)
        rate = loop.output(0.1, 0.0, measured)
        state = system.A @ state + system.B[:, 0] * rate
        loop.update(SAMPLE_S, rate)
    assert max(track) < 0.1 + 0.005
    assert track[-1] == pytest.approx(0.1, abs=1e-6)


def test_reset_makes_the_next_output_the_given_command(design: LqgDesign) -> None:
    loop = LqgLoop(design, LqgLoopParams())
    loop.reset(0.3, 4e-3, 0.2999, 6.5e-3)
    assert loop.output(0.3, 4e-3, 0.2999) == pytest.approx(6.5e-3, abs=1e-15)


def test_another_sampling_time_is_refused(design: LqgDesign) -> None:
    loop = LqgLoop(design, LqgLoopParams())
    with pytest.raises(ValueError, match=r"dt_s=0\.01 must be 0\.02"):
        loop.update(0.01, 0.0)


def test_design_survives_a_file(design: LqgDesign, tmp_path: Path) -> None:
    save_lqg_designs(tmp_path / "designs.json", design, design)
    back, _ = load_lqg_designs(tmp_path / "designs.json")
    np.testing.assert_array_equal(back.observer_gain, design.observer_gain)
    assert back.weights == design.weights
    spoiled = as_mapping(design) | {"extra": 1.0}
    spoiled.pop("b")
    with pytest.raises(ValueError, match=r"unknown keys \['extra'\] and lacks \['b'\]"):
        LqgDesign.from_mapping(spoiled)


def test_weights_that_destabilise_the_full_model_are_refused() -> None:
    with pytest.raises(ValueError, match="spectral radius"):
        design_lqg(*modal_antenna(), SAMPLE_S, WEIGHTS.replace(notch_frequency_hz=1.2, control_weight=1e-5))


def test_a_model_without_integrator_is_refused() -> None:
    a, b, c, d = modal_antenna()
    with pytest.raises(ValueError, match="must be 1"):
        design_lqg(0.9 * a, b, c, d, SAMPLE_S, WEIGHTS)


@pytest.mark.parametrize("changes", [{"feedforward_gain": 0.4}, {"feedforward_gain": 0.7, "feedforward_band_hz": 2.0}])
def test_retuning_in_steady_motion_makes_no_jump_now_or_later(design: LqgDesign, changes: dict[str, float]) -> None:
    """On its command, at a constant rate against a constant disturbance: the estimate takes what is fed no longer."""
    loop, place, outputs = LqgLoop(design, LqgLoopParams(feedforward_gain=0.9)), 0.3, []
    loop.reset(place, 4e-3, place, 6.5e-3)
    for k in range(200):
        if k == 50:
            loop.retune(loop.params.replace(**changes))
        outputs.append(loop.output(place, 4e-3, place))
        loop.update(SAMPLE_S, outputs[-1])
        place += 4e-3 * SAMPLE_S
    np.testing.assert_allclose(outputs, 6.5e-3, rtol=1e-9)


def test_files_that_hold_no_designs_are_refused_with_what_is_wrong(design: LqgDesign, tmp_path: Path) -> None:
    file, one = tmp_path / "designs.json", as_mapping(design)
    whole = {"format": "rf_pointing LQG designs 1", "azimuth": one, "elevation": one}
    less = {key: value for key, value in one.items() if key != "b"}
    for content, words in (
        ([whole], "format must be"),
        (whole | {"format": "rf_pointing LQG designs 2"}, "format must be"),
        (whole | {"third": one}, r"unknown keys \['third'\], lacks \[\]"),
        ({"format": whole["format"], "azimuth": one}, r"unknown keys \[\], lacks \['elevation'\]"),
        (whole | {"elevation": one | {"more": 1.0}}, r"unknown keys \['more'\] and lacks \[\]"),
        (whole | {"elevation": less}, r"unknown keys \[\] and lacks \['b'\]"),
    ):
        file.write_text(json.dumps(content))
        with pytest.raises(ValueError, match=words):
            load_lqg_designs(file)
    file.write_text(json.dumps(whole))
    assert load_lqg_designs(file)[1].weights == design.weights
