"""The filter: honest, continuous on the wire, and never led away by what is wrong."""

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from rf_pointing.designate import CLASSES, DesignatedPath, MotionFilter, Report, ReportedMotion
from rf_pointing.designate.motion import JUMPED, TargetClass
from rf_pointing.designate.path import BLEND_S
from scipy.integrate import quad

T_S = 1.8e9
HERE = np.array([4.2e6, 6e5, 4.7e6])
SIGMA_M = 20.0


def report(
    t_s: float, position: np.ndarray, velocity: np.ndarray | None = None, sigma_m: float = SIGMA_M
) -> Report:
    return Report(
        t_s=T_S + t_s, name="x", position_m=position, covariance_m2=sigma_m**2 * np.eye(3),
        velocity_m_s=velocity,
    )  # fmt: skip


def made(kind: str = "aircraft", time_s: float = 0.0) -> MotionFilter:
    return MotionFilter(CLASSES[kind], velocity_m_s=2.0, time_s=time_s)


def state(kind: TargetClass, t_s: float = T_S) -> ReportedMotion:
    mean = np.concatenate([HERE, [200.0, -50.0, 10.0], [1.0, 0.5, -2.0]])
    return ReportedMotion(t_s, mean, np.diag([100.0] * 3 + [4.0] * 3 + [1.0] * 3), np.eye(3), kind)


@pytest.mark.parametrize("kind", CLASSES.values(), ids=CLASSES)
@given(step_s=st.floats(1e-3, 100.0))
def test_prediction_has_the_closed_form_of_singer(kind: TargetClass, step_s: float) -> None:
    """Position variance of the noise by adaptive quadrature of its response."""
    tau, sigma = kind.correlation_s, kind.acceleration_m_s2
    still = ReportedMotion(T_S, np.zeros(9), np.zeros((9, 9)), np.zeros((3, 3)), kind)
    covariance = still.ahead(T_S + step_s).covariance
    # The time itself is rounded to 0.2 us.
    step_s = (T_S + step_s) - T_S
    place, _ = quad(
        lambda s: (tau**2 * (s / tau + math.expm1(-s / tau))) ** 2, 0.0, step_s, epsabs=0.0
    )
    fading = sigma**2 * -math.expm1(-2.0 * step_s / tau)
    assert covariance[0, 0] == pytest.approx(2.0 * sigma**2 / tau * place, rel=1e-6)
    assert covariance[8, 8] == pytest.approx(fading, rel=1e-3)


@given(first_s=st.floats(0.01, 30.0), second_s=st.floats(0.01, 30.0))
def test_two_steps_predict_what_one_does(first_s: float, second_s: float) -> None:
    begun = state(CLASSES["aircraft"])
    twice, once = (
        begun.ahead(T_S + first_s).ahead(T_S + first_s + second_s),
        begun.ahead(T_S + first_s + second_s),
    )
    np.testing.assert_allclose(twice.mean, once.mean, rtol=1e-6, atol=1e-4)
    np.testing.assert_allclose(twice.covariance, once.covariance, rtol=1e-4, atol=1e-3)


@pytest.mark.parametrize("told", [False, True], ids=["places", "places and velocities"])
def test_errors_are_those_that_the_covariance_states(
    random: np.random.Generator, told: bool
) -> None:
    """300 flights with the manoeuvres of the class: chi-square of 3 within 3 sigma of its mean."""
    kind, step_s, found = CLASSES["aircraft"], 1.0, []
    fade = math.exp(-step_s / kind.correlation_s)
    for _ in range(300):
        position, velocity = HERE.copy(), np.array([200.0, -50.0, 0.0])
        acceleration = random.normal(0.0, kind.acceleration_m_s2, 3)
        subject = made()
        for second in range(40):
            seen = position + random.normal(0.0, SIGMA_M, 3)
            subject.take(
                report(second, seen, velocity + random.normal(0.0, 2.0, 3) if told else None)
            )
            estimate = subject.state
            final = position
            pushed = random.normal(0.0, kind.acceleration_m_s2 * math.sqrt(1.0 - fade**2), 3)
            position = position + step_s * velocity + 0.5 * step_s**2 * acceleration
            velocity, acceleration = velocity + step_s * acceleration, fade * acceleration + pushed
        assert estimate is not None
        off = estimate.mean[:3] - final
        found.append(off @ np.linalg.solve(estimate.covariance[:3, :3], off))
    assert np.mean(found) == pytest.approx(3.0, abs=3.0 * math.sqrt(6.0 / 300))


def test_the_error_of_a_source_does_not_average_out() -> None:
    """A hundred reports with one bias: the stated sigma still has that of one report."""
    subject = made("ship")
    for second in range(100):
        subject.take(report(second, HERE))
    assert subject.state is not None
    stated = subject.state.position_covariance_m2(subject.state.t_s)
    assert np.sqrt(stated[0, 0]) >= SIGMA_M
    assert np.sqrt(subject.state.covariance[0, 0]) < 0.5 * SIGMA_M


def test_one_report_is_not_believed_and_two_that_disagree_are_not() -> None:
    subject = made()
    assert subject.take(report(0.0, HERE)) == ""
    assert subject.state is None
    assert "does not agree" in subject.take(report(1.0, np.add(HERE, (0.0, 0.0, 5e4))))
    assert subject.state is None
    assert subject.take(report(2.0, np.add(HERE, (0.0, 200.0, 5e4)))) == ""
    assert subject.state is not None


@given(
    outliers=st.lists(st.integers(5, 55), max_size=20, unique=True),
    direction=st.tuples(*[st.floats(-1.0, 1.0)] * 3).filter(
        lambda each: np.linalg.norm(each) > 0.1
    ),
)
def test_outliers_move_nothing(outliers: list[int], direction: tuple[float, float, float]) -> None:
    """Each in another place: the track stays within some sigma of the truth."""
    subject, velocity = made(), np.array([150.0, 100.0, 0.0])
    for second in range(60):
        truth = HERE + second * velocity
        wild = (
            truth + (1e4 + 4e3 * second**2) * np.array(direction) if second in outliers else truth
        )
        assert bool(subject.take(report(second, wild))) == (second in outliers)
        if subject.state is not None:
            apart = np.linalg.norm(subject.state.ahead(T_S + second + 1e-3).mean[:3] - truth)
            assert apart < 200.0


def test_reports_that_have_jumped_end_the_track_and_lead_nowhere() -> None:
    subject, velocity = made(), np.array([150.0, 100.0, 0.0])
    for second in range(20):
        subject.take(report(second, HERE + second * velocity))
    for second in range(20, 20 + JUMPED):
        assert "far from the prediction" in subject.take(
            report(second, HERE + [3e4, 0.0, 0.0] + second * velocity)
        )
    assert subject.state is None
    assert "jumped by 30.0 km" in subject.lost


@pytest.mark.parametrize("step_s", [0.0, -5.0, 1e-3])
def test_a_report_that_is_not_newer_is_refused(step_s: float) -> None:
    subject = made()
    for second in range(3):
        subject.take(report(second, HERE))
    assert "not newer" in subject.take(report(2.0 + step_s, HERE))


def test_a_wrong_velocity_beside_a_good_place_is_left_out() -> None:
    subject = made()
    for second in range(20):
        subject.take(report(second, HERE, np.array([0.0, 0.0, 0.0 if second < 15 else 300.0])))
    assert subject.state is not None
    assert np.linalg.norm(subject.state.mean[3:6]) < 10.0


@given(jump=st.tuples(*[st.floats(-500.0, 500.0)] * 3), after_s=st.floats(0.0, 3.0))
def test_the_path_is_smooth_over_every_correction(
    jump: tuple[float, float, float], after_s: float
) -> None:
    """Position, rate and acceleration have no step; after the blend the path is the prediction."""
    begun = state(CLASSES["aircraft"])
    path = DesignatedPath("x", begun)
    moved = dataclasses.replace(
        begun.ahead(T_S + 0.5), mean=begun.ahead(T_S + 0.5).mean + np.kron([1.0, 0.1, 0.01], jump)
    )
    at_s = T_S + 1.0 + after_s
    path.renew(at_s, moved)
    for t_s in (at_s, at_s + BLEND_S):
        before, beyond = path.motion_at(t_s - 1e-5), path.motion_at(t_s + 1e-5)
        for name, most in (("position", 0.05), ("velocity", 0.3), ("acceleration", 0.3)):
            step = np.subtract(getattr(beyond, name), getattr(before, name))
            assert np.max(np.abs(step)) <= most + 1e-4 * np.linalg.norm(jump), name
    np.testing.assert_allclose(
        path.motion_at(at_s + 5.0).position, moved.motion_at(at_s + 5.0).position
    )
    np.testing.assert_allclose(
        path.motion_at(at_s - 0.5).position, begun.motion_at(at_s - 0.5).position
    )
