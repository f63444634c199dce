"""Rigid body: conservation laws, an independent integrator, and the derivatives the filters use."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from rf_pointing.array_sensors.attitude.quaternion import (
    multiply,
    quaternion_from_rotation_vector,
    quaternion_to_matrix,
    rotation_angle_between_rad,
)
from rf_pointing.array_sensors.attitude.rigid_body import (
    KnownTorque,
    SatelliteParams,
    gravity_gradient_n_m,
    gravity_jacobian,
    propagate,
    rate_jacobian,
    rate_slope_rad_s2,
    rigid_inertia,
)

INERTIA = rigid_inertia(SatelliteParams())
FREE = KnownTorque(control_n_m=np.zeros(3), wheel_momentum_n_m_s=np.zeros(3), wheel_momentum_rate_n_m=np.zeros(3))
START = np.array([0.1, -0.3, 0.2, np.sqrt(1 - 0.14)])


@pytest.fixture
def stream() -> np.random.Generator:
    return np.random.default_rng(23)


def test_inertia_is_equation_25() -> None:
    expected = [[6.6199, 0.01636, 0.2363], [0.01636, 8.95, 0.2247], [0.2363, 0.2247, 9.4968]]
    assert pytest.approx(np.array(expected)) == INERTIA.matrix


def test_motion_with_wheels_torque_and_gravity_agrees_with_an_independent_integrator() -> None:
    frame_rate = np.array([1e-5, -1.038e-3, 2e-6])
    known = KnownTorque(
        control_n_m=np.array([1e-4, -2e-4, 3e-4]),
        wheel_momentum_n_m_s=np.array([0.3, -0.2, 0.1]),
        wheel_momentum_rate_n_m=np.array([2e-4, 1e-4, -3e-4]),
    )
    steps, dt_s = 400, 0.25

    def slope(_: float, y: np.ndarray) -> np.ndarray:
        q, w = y[:4] / np.linalg.norm(y[:4]), y[4:]
        c = quaternion_to_matrix(q)
        torque = known.control_n_m - known.wheel_momentum_rate_n_m + gravity_gradient_n_m(INERTIA, c, frame_rate)
        relative = w - c.T @ frame_rate
        rate = INERTIA.inverse @ (torque - np.cross(w, INERTIA.matrix @ w + known.wheel_momentum_n_m_s))
        return np.concatenate([0.5 * (q[3] * relative + np.cross(q[:3], relative)), [-0.5 * q[:3] @ relative], rate])

    y = solve_ivp(slope, (0, steps * dt_s), [*START, 0.02, -0.01, 0.03], rtol=1e-11, atol=1e-13).y[:, -1]
    quaternion, rate = START, np.array([0.02, -0.01, 0.03])
    for _ in range(steps):
        quaternion, rate = propagate(INERTIA, quaternion, rate, known, frame_rate, dt_s)
    assert rate == pytest.approx(y[4:], abs=3e-7)  # gravity is held over each step
    assert float(rotation_angle_between_rad(quaternion, y[:4] / np.linalg.norm(y[:4]))) < 1e-5


def test_batch_moves_as_its_members_do(stream: np.random.Generator) -> None:
    quaternion = stream.standard_normal((5, 4))
    quaternion /= np.linalg.norm(quaternion, axis=1, keepdims=True)
    rate = 0.02 * stream.standard_normal((5, 3))
    together = propagate(INERTIA, quaternion, rate, FREE, np.array([0, -1e-3, 0]), 0.25)
    for k in range(5):
        alone = propagate(INERTIA, quaternion[k], rate[k], FREE, np.array([0, -1e-3, 0]), 0.25)
        assert together[0][k] == pytest.approx(alone[0], abs=1e-14)
        assert together[1][k] == pytest.approx(alone[1], abs=1e-16)


def test_rate_jacobian_is_the_derivative_of_equation_23(stream: np.random.Generator) -> None:
    rate, momentum = 0.1 * stream.standard_normal(3), stream.standard_normal(3)
    h = 1e-6
    columns = [
        (
            rate_slope_rad_s2(INERTIA, rate + h * e, np.zeros(3), momentum)
            - rate_slope_rad_s2(INERTIA, rate - h * e, np.zeros(3), momentum)
        )
        / (2 * h)
        for e in np.eye(3)
    ]
    assert rate_jacobian(INERTIA, rate, momentum) == pytest.approx(np.array(columns).T, rel=1e-6, abs=1e-9)


def test_gravity_jacobian_is_the_derivative_by_a_body_rotation(stream: np.random.Generator) -> None:
    frame_rate = np.array([0.0, -1.04e-3, 0.0])
    q = stream.standard_normal(4)
    q /= np.linalg.norm(q)
    h = 1e-6

    def torque(e: np.ndarray) -> np.ndarray:
        turned = multiply(q, quaternion_from_rotation_vector(e))
        return gravity_gradient_n_m(INERTIA, quaternion_to_matrix(turned), frame_rate)

    columns = [(torque(h * e) - torque(-h * e)) / (2 * h) for e in np.eye(3)]
    found = gravity_jacobian(INERTIA, quaternion_to_matrix(q), frame_rate)
    assert found == pytest.approx(np.array(columns).T, rel=1e-6, abs=1e-12)


def test_gravity_gradient_alone_is_unstable_with_the_printed_inertia() -> None:
    """Pitch stiffness needs ixx > izz; (25) has it the other way round, so a pitch error grows."""
    quaternion, rate = quaternion_from_rotation_vector([0.0, 0.001, 0.0]), np.array([0.0, -1.038e-3, 0.0])
    for _ in range(1500):
        quaternion, rate = propagate(INERTIA, quaternion, rate, FREE, np.array([0.0, -1.038e-3, 0.0]), 3.0)
    assert float(rotation_angle_between_rad(quaternion, [0, 0, 0, 1])) > 0.02


def test_a_flat_body_is_accepted_whatever_its_last_bits(stream: np.random.Generator) -> None:
    """Its two small moments sum up to the third; turned axes leave no eigenvalue exact."""
    for _ in range(20):
        axes, _ = np.linalg.qr(stream.normal(size=(3, 3)))
        i = axes @ np.diag([1.0, 2.0, 3.0]) @ axes.T
        SatelliteParams(
            ixx_kg_m2=i[0, 0], iyy_kg_m2=i[1, 1], izz_kg_m2=i[2, 2],
            ixy_kg_m2=i[0, 1], ixz_kg_m2=i[0, 2], iyz_kg_m2=i[1, 2],
        )  # fmt: skip


@pytest.mark.parametrize("dt_s", [0.5, -0.5])
def test_a_step_is_of_fourth_order_in_its_length(dt_s: float, stream: np.random.Generator) -> None:
    """One step against sixteen: the error of a step of half the length is a thirtieth."""
    quaternion, rate, momentum = START, np.array([0.3, -0.2, 0.4]), np.array([0.5, -0.3, 0.2])
    known = KnownTorque(
        control_n_m=np.array([0.2, -0.1, 0.3]), wheel_momentum_n_m_s=momentum, wheel_momentum_rate_n_m=np.zeros(3)
    )

    def after(length_s: float, steps: int) -> np.ndarray:
        q, w = quaternion, rate
        for _ in range(steps):
            q, w = propagate(INERTIA, q, w, known, np.zeros(3), length_s / steps)
        return np.concatenate([q, w])

    errors = [np.abs(after(length, 1) - after(length, 32)).max() for length in (dt_s, 0.5 * dt_s)]
    assert errors[0] < 1e-4
    assert 16.0 < errors[0] / errors[1] < 64.0


def test_moments_of_inertia_come_from_their_own_fields() -> None:
    body = SatelliteParams(ixx_kg_m2=5.0, iyy_kg_m2=6.0, izz_kg_m2=7.0, ixy_kg_m2=0.1, ixz_kg_m2=-0.2, iyz_kg_m2=0.3)
    expected = np.array([[5.0, 0.1, -0.2], [0.1, 6.0, 0.3], [-0.2, 0.3, 7.0]])
    np.testing.assert_array_equal(rigid_inertia(body).matrix, expected)
    np.testing.assert_allclose(rigid_inertia(body).inverse @ expected, np.eye(3), atol=1e-12)


def test_a_rod_without_thickness_and_a_body_fuller_than_flat_are_refused() -> None:
    flat = {"ixx_kg_m2": 1.0, "iyy_kg_m2": 2.0, "ixy_kg_m2": 0.0, "ixz_kg_m2": 0.0, "iyz_kg_m2": 0.0}
    SatelliteParams(izz_kg_m2=3.0, **flat)
    for izz in (3.00001, 3.5):
        with pytest.raises(ValueError, match="principal moments"):
            SatelliteParams(izz_kg_m2=izz, **flat)
    # A rod along (1, 1, 0): its least moment is zero.
    rod = {"ixx_kg_m2": 1.0, "iyy_kg_m2": 1.0, "izz_kg_m2": 2.0, "ixz_kg_m2": 0.0, "iyz_kg_m2": 0.0}
    with pytest.raises(ValueError, match="principal moments"):
        SatelliteParams(ixy_kg_m2=-1.0, **rod)
    SatelliteParams(ixy_kg_m2=-0.99, **rod)
