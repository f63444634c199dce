"""Balanced reduction against the definition of the singular values and its own error bound."""

import numpy as np
import pytest
import scipy.linalg

from rf_pointing.identification import StateSpace, balanced_reduction, hankel_singular_values

FREQUENCY_HZ = np.geomspace(0.05, 24.0, 200)


@pytest.fixture
def stable() -> StateSpace:
    random = np.random.default_rng(6)
    a = random.standard_normal((7, 7))
    a *= 0.93 / np.max(np.abs(np.linalg.eigvals(a)))
    return StateSpace(a, random.standard_normal((7, 1)), random.standard_normal((1, 7)), np.ones((1, 1)), 0.02)


def test_hankel_singular_values_are_the_roots_of_the_gramian_product(stable: StateSpace) -> None:
    reach = scipy.linalg.solve_discrete_lyapunov(stable.a, stable.b @ stable.b.T)
    show = scipy.linalg.solve_discrete_lyapunov(stable.a.T, stable.c.T @ stable.c)
    expected = np.sort(np.sqrt(np.linalg.eigvals(reach @ show).real))[::-1]
    np.testing.assert_allclose(hankel_singular_values(stable), expected, rtol=1e-5)


@pytest.mark.parametrize("order", [1, 3, 5])
def test_error_stays_within_twice_the_sum_of_the_dropped_singular_values(stable: StateSpace, order: int) -> None:
    reduced = balanced_reduction(stable, order)
    error = np.max(np.abs(reduced.response(FREQUENCY_HZ) - stable.response(FREQUENCY_HZ)))
    assert reduced.order == order
    assert error <= 2.0 * np.sum(hankel_singular_values(stable)[order:]) * (1.0 + 1e-9)


def test_the_integrator_survives_exactly_and_the_strong_mode_stays(planted: StateSpace) -> None:
    reduced = balanced_reduction(planted, 3)
    poles = np.linalg.eigvals(reduced.a)
    assert np.min(np.abs(poles - 1.0)) < 1e-10
    bound = 2.0 * np.sum(hankel_singular_values(planted)[2:])
    error = np.abs(reduced.response(FREQUENCY_HZ) - planted.response(FREQUENCY_HZ))
    assert np.max(error) <= bound * (1.0 + 1e-9)
    assert bound < 0.11 * np.max(np.abs(planted.response(np.array([2.01]))))


def test_full_order_changes_nothing(planted: StateSpace) -> None:
    same = balanced_reduction(planted, planted.order)
    np.testing.assert_allclose(same.response(FREQUENCY_HZ), planted.response(FREQUENCY_HZ), rtol=1e-6)


def test_an_order_beyond_the_states_that_respond_and_show_is_refused(stable: StateSpace) -> None:
    """Two states that the input does not reach: their singular values are rounding."""
    a = np.block([[stable.a, np.ones((7, 2))], [np.zeros((2, 7)), 0.5 * np.eye(2)]])
    b, c = np.vstack([stable.b, np.zeros((2, 1))]), np.hstack([stable.c, np.ones((1, 2))])
    turn, _ = np.linalg.qr(np.random.default_rng(7).standard_normal((9, 9)))
    idle = StateSpace(turn @ a @ turn.T, turn @ b, c @ turn.T, stable.d, stable.sample_s)
    assert balanced_reduction(idle, 7).order == 7
    with pytest.raises(ValueError, match="order=8 must be <= 7"):
        balanced_reduction(idle, 8)


def test_an_unstable_pole_is_refused(stable: StateSpace) -> None:
    unstable = StateSpace(1.2 * stable.a / 0.93, stable.b, stable.c, stable.d, 0.02)
    with pytest.raises(ValueError, match=r"largest pole magnitude 1\.2 must be <= 1"):
        balanced_reduction(unstable, 3)
