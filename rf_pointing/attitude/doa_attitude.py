"""Attitude of a satellite from directions of arrival, stepped by time: the filter a node wraps.

Predicts in steps of at most 250 ms with the torques the satellite knows, takes directions with covariance, and says
with every output whether to believe it and, if not, why.  A value that is not finite never enters the state.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rf_pointing.attitude.multiplicative_filter import (
    AttitudeState,
    DirectionObservation,
    GateParams,
    predict,
    start_state,
    update,
)
from rf_pointing.attitude.process_noise import ProcessNoiseParams
from rf_pointing.attitude.quaternion import canonical, quaternion_from_matrix
from rf_pointing.attitude.rigid_body import KnownTorque, SatelliteParams, rigid_inertia
from rf_pointing.attitude.wahba import fit_rotation, unit_directions
from rf_pointing.geometry import Params, as_finite_array, parameter, require_finite

__all__ = ["AttitudeEstimate", "DoaAttitudeFilter", "DoaAttitudeParams", "DoaAttitudeState", "StationDirection"]

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class DoaAttitudeParams(Params):
    """Steps, start and limits of the filter."""

    step_s: float = parameter(0.25, "longest prediction step", low=0.001, high=5.0)
    start_attitude_rad: float = parameter(0.873, "uncertainty of the starting attitude, each axis", low=1e-6, high=3.15)
    start_rate_rad_s: float = parameter(0.00873, "uncertainty of the starting rate, each axis", low=1e-9, high=1.0)
    silence_s: float = parameter(900.0, "longest time without an accepted direction", low=0.1, high=1e6)
    sigma_rad: float = parameter(
        0.035, "largest attitude uncertainty of a valid output, worst axis", low=1e-6, high=3.2
    )
    stations: int = parameter(2, "stations heard before the output is valid", low=1, high=100)


@dataclass(frozen=True, slots=True, kw_only=True)
class StationDirection:
    """Direction to one station: measured in the body (3,), its covariance (3, 3), and expected in the orbital frame."""

    station: str
    measured: Array
    covariance_rad2: Array
    reference: Array


@dataclass(frozen=True, slots=True, kw_only=True)
class AttitudeEstimate:
    """Orientation of the body in the orbital frame (x, y, z, w), inertial body rate and covariance at `t_s`.

    `covariance` (6, 6): rotation about the axes of the orbital frame (rad^2), then rate in the body ((rad/s)^2).
    """

    t_s: float
    quaternion: Array
    rate_rad_s: Array
    covariance: Array
    valid: bool
    reason: str


@dataclass(frozen=True, slots=True, kw_only=True)
class DoaAttitudeState:
    """Everything the next output depends on."""

    t_s: float
    filter: AttitudeState
    heard_s: float | None
    stations: tuple[str, ...]


class DoaAttitudeFilter:
    """Multiplicative filter with its clock, its memory of stations and its verdict."""

    def __init__(
        self,
        satellite: SatelliteParams,
        params: DoaAttitudeParams,
        noise: ProcessNoiseParams,
        gate: GateParams,
        *,
        t_s: float,
        quaternion: Array,
        rate_rad_s: Array,
    ) -> None:
        require_finite("t_s", t_s)
        self._inertia = rigid_inertia(satellite)
        self._params, self._noise, self._gate = params, noise, gate
        start = start_state(
            as_finite_array("quaternion", quaternion, (4,)),
            as_finite_array("rate_rad_s", rate_rad_s, (3,)),
            params.start_attitude_rad,
            params.start_rate_rad_s,
            gate,
        )
        self._state = DoaAttitudeState(t_s=t_s, filter=start, heard_s=None, stations=())

    @property
    def state(self) -> DoaAttitudeState:
        """The state; it is immutable, and `restore` resumes from it."""
        return self._state

    def restore(self, state: DoaAttitudeState) -> None:
        """Continue from `state`."""
        self._state = state

    def predict_to(self, t_s: float, known: KnownTorque, frame_rate: Array) -> None:
        """Advance to `t_s`; `frame_rate` (3,) is the inertial rate of the orbital frame in its own axes.

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
        count = int(np.ceil(elapsed / self._params.step_s - 1e-9))
        moved = self._state.filter
        for _ in range(count):
            moved = predict(self._inertia, self._noise, moved, known, rate, elapsed / count)
        self._accept(t_s, moved, self._state.heard_s, self._state.stations)

    def observe(self, direction: StationDirection) -> bool:
        """Take one direction at the filter's time; return whether it lay inside the gate.

        Raises
        ------
        ValueError
            If a direction is not a unit vector or its covariance is not positive across it; nothing is changed then.
        """
        measured = unit_directions("measured", as_finite_array("measured", direction.measured, (3,)))
        reference = unit_directions("reference", as_finite_array("reference", direction.reference, (3,)))
        covariance = as_finite_array("covariance_rad2", direction.covariance_rad2, (3, 3))
        across = np.linalg.eigvalsh(0.5 * (covariance + covariance.T))
        if across[0] < -1e-9 * across[2] or across[1] <= 0.0:
            raise ValueError(f"covariance_rad2 has eigenvalues {across}, two of them must be > 0 and none negative")
        moved = update(self._state.filter, DirectionObservation(measured, covariance, reference), self._gate)
        inside = bool(moved.refused == 0)
        heard = self._state.t_s if inside else self._state.heard_s
        stations = self._state.stations
        if inside and direction.station not in stations:
            stations = (*stations, direction.station)
        self._accept(self._state.t_s, moved, heard, stations)
        return inside

    def start_from_directions(self, directions: list[StationDirection], rate_rad_s: Array) -> None:
        """Begin again from two or more simultaneous directions (Wahba's problem): no convergence is needed.

        Raises
        ------
        ValueError
            If the directions are collinear or fewer than two (see `wahba.fit_rotation`).
        """
        weights = np.array([1.0 / float(np.trace(each.covariance_rad2)) for each in directions])
        fit = fit_rotation(
            np.stack([each.reference for each in directions]),
            np.stack([each.measured for each in directions]),
            weights,
        )
        start = start_state(
            quaternion_from_matrix(fit.rotation.T),
            as_finite_array("rate_rad_s", rate_rad_s, (3,)),
            self._params.start_attitude_rad,
            self._params.start_rate_rad_s,
            self._gate,
        )
        before = self._state
        self._accept(self._state.t_s, start, None, ())
        try:
            for each in directions:
                self.observe(each)
        except ValueError:
            self._state = before
            raise

    def output(self) -> AttitudeEstimate:
        """Return the estimate at the filter's time, with its verdict."""
        current = self._state.filter
        reason = "; ".join(self._doubts())
        return AttitudeEstimate(
            t_s=self._state.t_s,
            quaternion=canonical(current.quaternion),
            rate_rad_s=current.rate_rad_s.copy(),
            covariance=current.covariance.copy(),
            valid=not reason,
            reason=reason,
        )

    def _doubts(self) -> list[str]:
        state, params = self._state, self._params
        doubts = []
        if state.heard_s is None:
            doubts.append("no direction accepted yet")
        elif state.t_s - state.heard_s > params.silence_s:
            doubts.append(f"no direction for {state.t_s - state.heard_s:.0f} s, must be <= {params.silence_s:.0f} s")
        if state.filter.refused >= self._gate.doubt_after and state.heard_s is not None:
            doubts.append(f"{int(state.filter.refused)} directions in a row outside the gate: attitude in doubt")
        if len(state.stations) < params.stations:
            doubts.append(f"{len(state.stations)} of {params.stations} stations heard")
        sigma = float(np.sqrt(np.linalg.eigvalsh(state.filter.covariance[:3, :3])[-1]))
        if sigma > params.sigma_rad:
            doubts.append(f"attitude sigma {sigma:.3g} rad must be <= {params.sigma_rad:g} rad")
        return doubts

    def _accept(self, t_s: float, moved: AttitudeState, heard_s: float | None, stations: tuple[str, ...]) -> None:
        for name in ("quaternion", "rate_rad_s", "covariance"):
            require_finite(f"filter {name}", getattr(moved, name))
        self._state = DoaAttitudeState(t_s=t_s, filter=moved, heard_s=heard_s, stations=stations)
