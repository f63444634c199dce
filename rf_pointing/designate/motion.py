"""Where a reported target is and will be: a Kalman filter with the manoeuvres of its class.

Each axis follows Singer's model: acceleration that fades with a correlation time tau and is renewed
by white noise, so that its standard deviation stays sigma.  Over a time T, with u = T / tau,

    x' = x + T v + tau^2 (u - 1 + e^-u) a,   v' = v + tau (1 - e^-u) a,   a' = e^-u a
    Q  = 2 sigma^2 / tau  integral_0^T  g(s) g(s)^T ds

g(s) is the response (x, v, a) at s to a unit acceleration; the integral is taken by Gauss-Legendre,
whose 12 points are exact to 1e-12 up to T = 5 tau and have no cancellation for short T.  Source:
Singer, "Estimating optimal tracking filter performance for manned maneuvering targets", IEEE AES-6
(1970).

A target is believed once two reports agree with the speed of its class.  A report farther off than
`GATE` is refused; where several in a row agree with each other, the target is another one, or its
source is, and the track is lost: what was designated must be selected again.
"""

import math
from dataclasses import dataclass

import numpy as np

from rf_pointing.core import Array, Motion
from rf_pointing.designate.report import Report

# Chi-square of three directions that a good report exceeds once in a million.
GATE = 30.66
# Refused reports in a row, consistent with each other, after which the track is given up.
JUMPED = 3
# Reports nearer than this are one: a speed of two would be their noise.
APART_S = 0.05
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(12)


@dataclass(frozen=True, slots=True)
class TargetClass:
    """How a kind of target manoeuvres: deviation and correlation time of its acceleration.

    `fastest_m_s` is the largest speed that is believed, `ahead_s` how far it is predicted.
    """

    acceleration_m_s2: float
    correlation_s: float
    fastest_m_s: float
    ahead_s: float


CLASSES = {
    "balloon": TargetClass(0.3, 20.0, 150.0, 600.0),
    "aircraft": TargetClass(2.0, 15.0, 900.0, 120.0),
    "rocket": TargetClass(40.0, 20.0, 12000.0, 60.0),
    "ship": TargetClass(0.05, 60.0, 40.0, 600.0),
}
"""Targets by the names that a station gives them."""


@dataclass(frozen=True, slots=True)
class ReportedMotion:
    """Motion at `t_s`: mean (9,) and covariance (9, 9), position, velocity, acceleration.

    `report_m2` (3, 3) is the covariance of the newest report.
    """

    t_s: float
    mean: Array
    covariance: Array
    report_m2: Array
    kind: TargetClass

    def ahead(self, t_s: float) -> "ReportedMotion":
        """Return the motion predicted for a later time."""
        step_s = t_s - self.t_s
        transition = np.kron(_transition(step_s, self.kind.correlation_s), np.eye(3))
        noise = np.kron(_process_noise(step_s, self.kind), np.eye(3))
        covariance = transition @ self.covariance @ transition.T + noise
        return ReportedMotion(t_s, transition @ self.mean, covariance, self.report_m2, self.kind)

    def motion_at(self, t_s: float) -> Motion:
        """Return position, velocity and acceleration (3,) at a time, also a little before it."""
        rows = _transition(t_s - self.t_s, self.kind.correlation_s) @ self.mean.reshape(3, 3)
        return Motion(*rows)

    def position_covariance_m2(self, t_s: float) -> Array:
        """Return the covariance (3, 3) of the position at a time.

        The errors of a source do not average out (a barometric height, a late clock): that of its
        newest report is added whole.
        """
        found: Array = self.ahead(max(t_s, self.t_s)).covariance[:3, :3] + self.report_m2
        return found


class MotionFilter:
    """Follows one target by its reports."""

    def __init__(self, kind: TargetClass, velocity_m_s: float, time_s: float) -> None:
        self.kind = kind
        self._velocity_m2_s2, self._time_s = velocity_m_s**2, time_s
        self.state: ReportedMotion | None = None
        """The motion, None until two reports agree and after the reports have jumped."""
        self.lost = ""
        self._first: Report | None = None
        self._refused: list[Report] = []

    def take(self, report: Report) -> str:
        """Use a report; return "" or why it is refused."""
        newest = self.state or self._first
        if newest is not None and report.t_s <= newest.t_s + APART_S:
            return "report that is not newer than the one before"
        if self.state is None:
            return self._begin(report)
        if report.t_s - self.state.t_s > self.kind.ahead_s:
            self._lose(f"no report for {report.t_s - self.state.t_s:.0f} s", report)
            return ""
        ahead = self.state.ahead(report.t_s)
        off = report.position_m - ahead.mean[:3]
        noise_m2 = self._noise_m2(report, ahead.mean[3:6])
        distance2 = float(off @ np.linalg.solve(ahead.covariance[:3, :3] + noise_m2, off))
        if not distance2 <= GATE:
            return self._refuse(report, float(np.linalg.norm(off)))
        self._refused.clear()
        mean, covariance = _update(
            ahead.mean, ahead.covariance, slice(0, 3), report.position_m, noise_m2
        )
        if report.velocity_m_s is not None:
            given = report.velocity_m_s, self._velocity_m2_s2 * np.eye(3)
            rate2 = covariance[3:6, 3:6] + given[1]
            faster = given[0] - mean[3:6]
            # A wrong velocity next to a good place is left out.
            if float(faster @ np.linalg.solve(rate2, faster)) <= GATE:
                mean, covariance = _update(mean, covariance, slice(3, 6), *given)
        self.state = ReportedMotion(report.t_s, mean, covariance, noise_m2, self.kind)
        return ""

    def _noise_m2(self, report: Report, velocity_m_s: Array) -> Array:
        """Return the covariance of a report; a wrong time moves it along its velocity."""
        late: Array = self._time_s * velocity_m_s
        return np.asarray(report.covariance_m2 + np.outer(late, late))

    def _consistent(self, first: Report, second: Report) -> bool:
        """Return whether a target of the class can have come from one report to the other."""
        step_s = second.t_s - first.t_s
        # Noise and late clocks make a target seem faster than it is.
        spread_m = 4.0 * math.sqrt(float(np.trace(first.covariance_m2 + second.covariance_m2)))
        reach_m = self.kind.fastest_m_s * (step_s + self._time_s) + spread_m
        apart_m = float(np.linalg.norm(second.position_m - first.position_m))
        return step_s <= self.kind.ahead_s and apart_m <= reach_m

    def _begin(self, report: Report) -> str:
        first, self._first = self._first, report
        if first is None:
            return ""
        if not self._consistent(first, report):
            return "report that does not agree with the one before"
        # Two places give a speed with the noise of both, and what it may have changed between them.
        step_s = report.t_s - first.t_s
        between = (report.position_m - first.position_m) / step_s
        velocity = between if report.velocity_m_s is None else report.velocity_m_s
        noise_m2 = self._noise_m2(report, velocity)
        rate2 = self._velocity_m2_s2 * np.eye(3)
        if report.velocity_m_s is None:
            drift = (0.5 * self.kind.acceleration_m_s2 * step_s) ** 2 * np.eye(3)
            rate2 = (noise_m2 + first.covariance_m2) / step_s**2 + drift
        covariance = np.zeros((9, 9))
        covariance[:3, :3], covariance[3:6, 3:6] = noise_m2, rate2
        covariance[6:, 6:] = self.kind.acceleration_m_s2**2 * np.eye(3)
        mean = np.concatenate([report.position_m, velocity, np.zeros(3)])
        self.state, self.lost = (
            ReportedMotion(report.t_s, mean, covariance, noise_m2, self.kind),
            "",
        )
        return ""

    def _refuse(self, report: Report, off_m: float) -> str:
        # One wild report after another is noise; a jump is one that goes on from where it came.
        if self._refused and not self._consistent(self._refused[-1], report):
            self._refused.clear()
        self._refused.append(report)
        if len(self._refused) >= JUMPED:
            self._lose(f"its reports have jumped by {1e-3 * off_m:.1f} km", report)
        return "report far from the prediction"

    def _lose(self, why: str, report: Report) -> None:
        self.state, self.lost, self._first = None, why, report
        self._refused.clear()


def _transition(step_s: float, correlation_s: float) -> Array:
    """Return the transition (3, 3) of position, velocity and acceleration of one axis."""
    u = step_s / correlation_s
    fade = math.exp(-u)
    # expm1 keeps the small differences of a short step.
    moved = correlation_s**2 * (u + math.expm1(-u))
    return np.array(
        [[1.0, step_s, moved], [0.0, 1.0, -correlation_s * math.expm1(-u)], [0.0, 0.0, fade]]
    )


def _process_noise(step_s: float, kind: TargetClass) -> Array:
    """Return the covariance (3, 3) that the manoeuvres of one axis add in a step."""
    responses = np.array(
        [_transition(0.5 * step_s * (1.0 + node), kind.correlation_s)[:, 2] for node in _NODES]
    )
    strength = kind.acceleration_m_s2**2 / kind.correlation_s * step_s
    found: Array = strength * (responses.T * _WEIGHTS) @ responses
    return found


def _update(
    mean: Array, covariance: Array, part: slice, measured: Array, noise: Array
) -> tuple[Array, Array]:
    """Return mean and covariance after a measurement of a part of the state, in Joseph's form."""
    gain = np.linalg.solve(covariance[part, part] + noise, covariance[part]).T
    left = np.eye(len(mean))
    left[:, part] -= gain
    return mean + gain @ (measured - mean[part]), left @ covariance @ left.T + gain @ noise @ gain.T
