"""The linear plant against closed forms and an independent library."""

import math

import control
import numpy as np
import pytest
import scipy.linalg

from rf_pointing.servo import discretise, dss13_plant
from rf_pointing.servo.linear_model import linear_model, matrix_exponential


def modal_frequencies_hz(a: np.ndarray) -> np.ndarray:
    poles = np.linalg.eigvals(a)
    return np.sort(np.abs(poles[poles.imag > 1e-6])) / (2.0 * np.pi)


def test_poles_are_the_published_modes_the_gears_and_the_two_drives() -> None:
    model = linear_model(dss13_plant(bending="identified"))
    gears = (11.0 * math.sqrt(0.85), 11.0)
    published = sorted([1.65, 3.24, 4.24, 2.01, 3.15, 5.22, 5.76, *gears])
    np.testing.assert_allclose(modal_frequencies_hz(model.a), published, rtol=1e-9)
    real = np.sort(np.linalg.eigvals(model.a).real)
    np.testing.assert_allclose(real[:2], (-20.0, -20.0), rtol=1e-6)


def test_cross_coupling_vanishes_at_low_frequency_and_elevation_to_azimuth_is_tenfold_smaller() -> None:
    model = linear_model(dss13_plant())
    peak = []
    for frequency in (1e-3, 3.0):
        s = 2j * np.pi * frequency
        peak.append(np.abs(model.encoder @ np.linalg.solve(s * np.eye(len(model.a)) - model.a, model.b_command)))
    assert peak[0][1, 0] < 1e-6 * peak[0][0, 0]
    assert peak[0][0, 1] < 1e-6 * peak[0][1, 1]
    assert 10.0 * peak[1][0, 1] < peak[1][1, 0] + peak[1][1, 1] / 10.0


@pytest.mark.parametrize(("angle_deg", "factor"), [(0.0, 1.0), (60.0, 0.64), (90.0, 0.28)])
def test_pinion_scales_the_bending_mode_by_floor_plus_cosine(angle_deg: float, factor: float) -> None:
    model = linear_model(dss13_plant(pinion_angle_rad=math.radians(angle_deg)))
    np.testing.assert_allclose(model.mode_excitation[:, 3], (0.1 * factor, factor), rtol=1e-9)


@pytest.mark.parametrize("scale", [1e-3, 1.0, 40.0])
def test_matrix_exponential_agrees_with_scipy(scale: float) -> None:
    matrix = scale * np.random.default_rng(4).standard_normal((9, 9))
    expected = scipy.linalg.expm(matrix)
    np.testing.assert_allclose(matrix_exponential(matrix), expected, atol=1e-11 * np.abs(expected).max())


def test_discretisation_agrees_with_python_control() -> None:
    model = linear_model(dss13_plant())
    b = model.b_command
    ours = discretise(model.a, b, 0.005)
    theirs = control.c2d(control.ss(model.a, b, model.encoder, np.zeros((2, 2))), 0.005)
    np.testing.assert_allclose(ours, np.hstack([theirs.A, theirs.B]), atol=1e-11)


def test_every_response_of_both_axes_is_the_residue_form() -> None:
    """From command, friction, wind and gear torque of either axis to encoder and beam of both, mode by mode."""
    params = dss13_plant(pinion_angle_rad=0.5)
    params = params.replace(
        azimuth=params.azimuth.replace(amplifier_gain=40.0, gear_damping=0.2, mode_damping=(0.03, 0.04, 0.05)),
        azimuth_modes_in_elevation=(0.11, 0.12, 0.13), elevation_modes_in_azimuth=(0.21, 0.22, 0.23),
        azimuth_to_bending=0.4, cross_mode_damping=0.06, cross_mode_residue=0.31,
    )  # fmt: skip
    model = linear_model(params)
    s = 2j * np.pi * 2.7
    axes = (params.azimuth, params.elevation)

    def lag(frequency_hz: float, damping: float) -> complex:
        omega = 2.0 * np.pi * frequency_hz
        return 1.0 / (s**2 + 2.0 * damping * omega * s + omega**2)

    # v = (w_d u + f + w) / (s + w_d); what is pushed is v' = s v.
    rate = np.zeros((2, 8), dtype=complex)
    for axis, each in enumerate(axes):
        rate[axis, [axis, 2 + axis, 4 + axis]] = np.array([each.drive_bandwidth_rad_s, 1.0, 1.0]) / (
            s + each.drive_bandwidth_rad_s
        )
    for shown, residues in (
        (model.encoder, [each.mode_encoder_residue for each in axes]),
        (model.beam, [each.mode_beam_residue for each in axes]),
    ):
        expected = rate / s
        pinion = params.pinion_floor + (1.0 - params.pinion_floor) * math.cos(0.5)
        for axis, cross in ((0, params.azimuth_modes_in_elevation), (1, params.elevation_modes_in_azimuth)):
            for index in range(3):
                pushed = np.eye(2)[axis] if (axis, index) != (1, 0) else pinion * np.array([0.4, 1.0])
                seen = np.zeros(2)
                seen[axis], seen[1 - axis] = residues[axis][index], cross[index]
                swing = lag(axes[axis].mode_frequency_hz[index], axes[axis].mode_damping[index])
                expected = expected - np.outer(seen, pushed @ rate) * s * swing
            # The motors twist the gear, by v' less what the wind gives; the gear's own torque adds to it.
            swing = lag(axes[axis].gear_frequency_rad_s / 2.0 / np.pi, axes[axis].gear_damping)
            motor = s * rate[axis] - np.eye(8)[4 + axis]
            expected[axis] = expected[axis] + swing * (np.eye(8)[6 + axis] - motor)
        expected = expected - np.outer((0.0, 0.31), rate[0]) * s * lag(params.cross_mode_frequency_hz, 0.06)
        found = shown @ np.linalg.solve(s * np.eye(len(model.a)) - model.a, model.b)
        np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-12)


def test_states_are_named_in_their_order() -> None:
    names = linear_model(dss13_plant()).state_names
    assert names[:4] == ("angle_azimuth", "angle_elevation", "rate_azimuth", "rate_elevation")
    modes = [f"{axis}_mode{number}" for axis in ("azimuth", "elevation") for number in (1, 2, 3)]
    modes += ["cross", "azimuth_gear", "elevation_gear"]
    assert list(names[4:]) == modes + [f"{mode}_rate" for mode in modes]


def test_the_gears_of_both_axes_are_found_among_the_modes() -> None:
    model = linear_model(dss13_plant())
    assert [model.state_names[4 + index] for index in model.gear_index] == ["azimuth_gear", "elevation_gear"]
    for axis, index in enumerate(model.gear_index):
        np.testing.assert_array_equal(model.encoder[:, 4 + index], np.eye(2)[axis])
        np.testing.assert_array_equal(model.mode_excitation[:, index], np.eye(2)[axis])


@pytest.mark.parametrize("norm", [0.0, 0.49, 0.5, 0.51, 0.99, 2.0, 3.9, 300.0])
def test_matrix_exponential_is_exact_at_every_size(norm: float) -> None:
    """A nilpotent matrix and a rotation: their exponentials are closed forms."""
    turning = norm * np.array([[0.0, -1.0], [1.0, 0.0]])
    expected = np.array([[math.cos(norm), -math.sin(norm)], [math.sin(norm), math.cos(norm)]])
    # 1e-15 for each of the squarings, of which a norm of 300 takes ten.
    np.testing.assert_allclose(matrix_exponential(turning), expected, rtol=0.0, atol=1e-15 * max(4.0, norm))
    shear = np.array([[0.0, norm], [0.0, 0.0]])
    np.testing.assert_allclose(matrix_exponential(shear), np.eye(2) + shear, rtol=1e-12)


def test_a_step_of_no_time_is_refused() -> None:
    with pytest.raises(ValueError, match="dt_s=9e-10 must be >= 1e-09$"):
        discretise(np.eye(2), np.ones((2, 1)), 9e-10)
    assert discretise(np.eye(2), np.ones((2, 1)), 1e-9)[0, 2] == pytest.approx(1e-9)
