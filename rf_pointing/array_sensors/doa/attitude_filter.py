"""Attitude from directions of arrival, stepped by time: the filter that a node wraps.

Predicts in steps of at most 250 ms with the torques the satellite knows, accepts directions with
covariance, and states with every output whether it is valid and, if not, why.  A value that is not
finite never enters the state.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from rf_pointing.array_sensors.attitude.multiplicative_filter import (
    AttitudeState,
    DirectionObservation,
    GateParams,
    ProcessNoiseParams,
    predict,
    start_state,
    update,
)
from rf_pointing.array_sensors.attitude.quaternion import canonical, quaternion_from_matrix
from rf_pointing.array_sensors.attitude.rigid_body import KnownTorque, SatelliteParams, rigid_inertia
from rf_pointing.array_sensors.attitude.wahba import fit_rotation, unit_directions
from rf_pointing.array_sensors.doa.attitude_start import StartParams, best_of_bank, start_bank
from rf_pointing.core import Params, as_finite_array, parameter, require_finite

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class DoaAttitudeParams(Params):
    """Step and limits of the filter."""

    step_s: float = parameter(0.25, "longest prediction step", low=0.001, high=5.0)
    # The stations of the DOA scene are passed every 625 s: one of them may be missed.
    silence_s: float = parameter(900.0, "longest time without an accepted direction", low=0.1, high=1e6)
    sigma_rad: float = parameter(
        0.035, "largest attitude uncertainty of a valid output, worst axis", low=1e-6, high=3.2
    )
    stations: int = parameter(2, "stations received before the output is valid", low=1, high=100)


@dataclass(frozen=True, slots=True, kw_only=True)
class StationDirection:
    """Direction to one station: measured in the body (3,), its covariance (3, 3), and expected in
    the orbital frame.
    """

    station: str
    measured: Array
    covariance_rad2: Array
    reference: Array


@dataclass(frozen=True, slots=True, kw_only=True)
class AttitudeEstimate:
    """Orientation of the body in the orbital frame (x, y, z, w), inertial body rate and covariance
    at `t_s`.

    `covariance` (6, 6): rotation about the axes of the orbital frame (rad^2), then rate in the body
    ((rad/s)^2).
    """

    t_s: float
    quaternion: Array
    rate_rad_s: Array
    covariance: Array
    valid: bool
    reason: str


@dataclass(frozen=True, slots=True, kw_only=True)
class DoaAttitudeState:
    """Everything the next output depends on.

    `bank` holds one filter or the hypotheses of the start; before the first direction it is the
    guess (1,). `choose_s` is the time from which one hypothesis is kept.
    """

    t_s: float
    bank: AttitudeState
    heard_s: float | None = None
    choose_s: float | None = None
    stations: tuple[str, ...] = ()


class DoaAttitudeFilter:
    """Multiplicative filter with its start, its clock, its memory of stations and its verdict.

    `quaternion` and `rate_rad_s` are a guess at the time of the first direction; the attitude may
    be anything.
    """

    def __init__(
        self,
        satellite: SatelliteParams,
        params: DoaAttitudeParams,
        start: StartParams,
        noise: ProcessNoiseParams,
        gate: GateParams,
        *,
        t_s: float,
        quaternion: Array,
        rate_rad_s: Array,
    ) -> None:
        require_finite("t_s", t_s)
        self._inertia = rigid_inertia(satellite)
        self._params, self._start, self._noise, self._gate = params, start, noise, gate
        guess = as_finite_array("quaternion", quaternion, (4,))
        rate = as_finite_array("rate_rad_s", rate_rad_s, (3,))
        bank = start_state(guess[None], rate[None], np.pi, start.rate_rad_s, gate)
        self._state = DoaAttitudeState(t_s=t_s, bank=bank)

    @property
    def state(self) -> DoaAttitudeState:
        """The state; it is immutable, and `restore` resumes from it."""
        return self._state

    def restore(self, state: DoaAttitudeState) -> None:
        """Continue from `state`."""
        self._state = state

    @property
    def refused(self) -> int:
        """Directions in a row outside the gate; 0 before the first direction."""
        return 0 if self._state.heard_s is None else int(best_of_bank(self._state.bank).refused[0])

    def predict_to(self, t_s: float, known: KnownTorque, frame_rate: Array) -> None:
        """Advance to `t_s`; `frame_rate` (3,) is the inertial rate of the orbital frame in its own
        axes.

        Raises
        ------
        ValueError
            If time runs backwards or an input is not finite; the state is then as before.
        """
        require_finite("t_s", t_s)
        elapsed = t_s - self._state.t_s
        if elapsed < 0.0:
            raise ValueError(f"t_s={t_s} must be >= the filter's time {self._state.t_s}")
        rate = as_finite_array("frame_rate", frame_rate, (3,))
        for name in ("control_n_m", "wheel_momentum_n_m_s", "wheel_momentum_rate_n_m"):
            as_finite_array(name, getattr(known, name), (3,))
        # Before the first direction there is nothing to carry on: the guess belongs to whatever
        # time that will be.
        if self._state.heard_s is None:
            self._accept(replace(self._state, t_s=t_s))
            return
        # Equal steps; the small subtraction keeps a step of exactly step_s from becoming two by
        # rounding.
        count = int(np.ceil(elapsed / self._params.step_s - 1e-9))
        bank = self._state.bank
        for _ in range(count):
            bank = predict(self._inertia, self._noise, bank, known, rate, elapsed / count)
        self._accept(replace(self._state, t_s=t_s, bank=bank))

    def observe(self, direction: StationDirection) -> bool:
        """Take one direction at the filter's time; return whether it lay inside the gate.

        Raises
        ------
        ValueError
            If a direction is not a unit vector or its covariance is not positive across it;
            nothing is changed then.
        """
        seen = _checked(direction)
        state = self._state
        if state.heard_s is None:
            guess = state.bank
            bank = start_bank(self._start, self._gate, guess.quaternion[0], guess.rate_rad_s[0], seen)
        else:
            bank = state.bank
        bank = update(bank, seen, self._gate)
        inside = bool(best_of_bank(bank).refused[0] == 0)
        # A direction outside the gate does not count as contact, or a lost filter would never look
        # silent.
        heard = state.t_s if inside or state.heard_s is None else state.heard_s
        self._accept(self._heard(replace(state, bank=bank, heard_s=heard), direction.station, inside))
        return inside

    def start_from_directions(self, directions: list[StationDirection], rate_rad_s: Array) -> None:
        """Begin again from two or more simultaneous directions (Wahba's problem).

        There is nothing to converge.

        Raises
        ------
        ValueError
            If the directions are collinear or fewer than two (see `wahba.fit_rotation`);
            nothing is changed then.
        """
        checked = [_checked(each) for each in directions]
        fit = fit_rotation(
            np.stack([each.reference for each in checked]),
            np.stack([each.measured for each in checked]),
            np.array([1.0 / float(np.trace(each.covariance_rad2)) for each in checked]),
        )
        rate = as_finite_array("rate_rad_s", rate_rad_s, (3,))
        attitude = quaternion_from_matrix(fit.rotation.T)
        bank = start_state(attitude[None], rate[None], self._start.attitude_rad, self._start.rate_rad_s, self._gate)
        for each in checked:
            bank = update(bank, each, self._gate)
        names = tuple(dict.fromkeys(each.station for each in directions))
        self._accept(DoaAttitudeState(t_s=self._state.t_s, bank=bank, heard_s=self._state.t_s, stations=names))

    def output(self) -> AttitudeEstimate:
        """Return the estimate at the filter's time, with its verdict."""
        best = best_of_bank(self._state.bank)
        reason = "; ".join(self._doubts(best))
        return AttitudeEstimate(
            t_s=self._state.t_s,
            quaternion=canonical(best.quaternion[0]),
            rate_rad_s=best.rate_rad_s[0].copy(),
            covariance=best.covariance[0].copy(),
            valid=not reason,
            reason=reason,
        )

    def _heard(self, state: DoaAttitudeState, station: str, inside: bool) -> DoaAttitudeState:
        """Return `state` with the station added, reduced to one hypothesis when that is due."""
        if station not in state.stations and (inside or not state.stations):
            state = replace(state, stations=(*state.stations, station))
            # The second station is the first that tells the hypotheses apart: a direction leaves
            # the turn about itself open.
            if len(state.stations) == 2:
                state = replace(state, choose_s=state.t_s + self._start.settle_s)
        if state.choose_s is not None and state.t_s >= state.choose_s:
            return replace(state, bank=best_of_bank(state.bank), choose_s=None)
        return state

    def _doubts(self, best: AttitudeState) -> list[str]:
        state, params = self._state, self._params
        if state.heard_s is None:
            return ["no direction accepted yet"]
        doubts = []
        if state.t_s - state.heard_s > params.silence_s:
            doubts.append(f"no direction for {state.t_s - state.heard_s:.0f} s, must be <= {params.silence_s:.0f} s")
        if best.refused[0] >= self._gate.doubt_after:
            doubts.append(f"{int(best.refused[0])} directions in a row outside the gate: attitude in doubt")
        if len(state.stations) < params.stations:
            doubts.append(f"{len(state.stations)} of {params.stations} stations received")
        if len(state.bank.misfit) > 1:
            doubts.append(f"{len(state.bank.misfit)} hypotheses of the start still open")
        # Worst axis, not the mean: the turn about the line of sight is the one that is unknown.
        sigma = float(np.sqrt(np.linalg.eigvalsh(best.covariance[0, :3, :3])[-1]))
        if sigma > params.sigma_rad:
            doubts.append(f"attitude sigma {sigma:.3g} rad must be <= {params.sigma_rad:g} rad")
        return doubts

    def _accept(self, state: DoaAttitudeState) -> None:
        for name in ("quaternion", "rate_rad_s", "covariance"):
            require_finite(f"filter {name}", getattr(state.bank, name))
        self._state = state


def _checked(direction: StationDirection) -> DirectionObservation:
    measured = unit_directions("measured", as_finite_array("measured", direction.measured, (3,)))
    reference = unit_directions("reference", as_finite_array("reference", direction.reference, (3,)))
    covariance = as_finite_array("covariance_rad2", direction.covariance_rad2, (3, 3))
    across = np.linalg.eigvalsh(0.5 * (covariance + covariance.T))
    # A direction's covariance has rank two.  Along the direction the variance is zero but for
    # rounding; across it rounding is no variance.
    if across[0] < -1e-9 * across[2] or across[1] <= 1e-9 * across[2]:
        raise ValueError(f"covariance_rad2 has eigenvalues {across}, two of them must be > 0 and none negative")
    return DirectionObservation(measured, covariance, reference)
