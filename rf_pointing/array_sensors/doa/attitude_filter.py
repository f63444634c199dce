"""Attitude from directions of arrival, stepped by time: the filter that a node wraps.

Predicts in steps of at most 250 ms with the torques the satellite knows, accepts directions with
covariance, and states with every output whether it is valid and, if not, why.  A value that is not
finite never enters the state.
"""

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from rf_pointing.array_sensors.attitude.multiplicative_filter import (
    AttitudeState,
    DirectionObservation,
    GateParams,
    ProcessNoiseParams,
    carried_back,
    innovation,
    predict,
    squared_innovation,
    start_state,
    update,
)
from rf_pointing.array_sensors.attitude.quaternion import canonical
from rf_pointing.array_sensors.attitude.rigid_body import (
    KnownTorque,
    SatelliteParams,
    rigid_inertia,
)
from rf_pointing.array_sensors.attitude.wahba import unit_directions
from rf_pointing.array_sensors.doa.attitude_start import (
    StartParams,
    best_of_bank,
    joined,
    remaining,
    start_bank,
)
from rf_pointing.array_sensors.doa.innovation_watch import InnovationWatch, WatchParams
from rf_pointing.core import Params, as_finite_array, parameter, require_finite
from rf_pointing.core.types import Array

LONGEST_START = 2000
"""Directions and passages of a start that is gone through again: 17 min of a direction a second."""
EVERY_STATION = ""
"""Key of the watch over the directions of all stations."""


@dataclass(frozen=True, kw_only=True)
class DoaAttitudeParams(Params):
    """Step and limits of the filter."""

    step_s: float = parameter(0.25, "longest prediction step", low=0.001, high=5.0)
    # The stations of the DOA scene are passed every 625 s: one of them may be missed.
    silence_s: float = parameter(
        900.0, "longest time without an accepted direction", low=0.1, high=1e6
    )
    sigma_rad: float = parameter(
        0.035, "largest attitude uncertainty of a valid output, worst axis", low=1e-6, high=3.2
    )
    stations: int = parameter(2, "stations received before the output is valid", low=1, high=100)


@dataclass(frozen=True, slots=True, kw_only=True)
class StationDirection:
    """Direction to one station: measured in the body (3,), covariance of its noise (3, 3), and
    expected in the orbital frame.

    `bias_rad` (3, 2): its error for one sigma of each constant bias of the sensor, if it has any.
    `reference_bias_rad` (3, k): the same for the constants of orbit and stations.
    """

    station: str
    measured: Array
    covariance_rad2: Array
    reference: Array
    bias_rad: Array | None = None
    reference_bias_rad: Array | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class SharedDirections:
    """Directions of one channel in which several stations send: which is whose is not known.

    `measured` (n, 3) in the body with covariances (n, 3, 3) and biases (n, 3, 2) as those of a
    `StationDirection`; `stations` (m,), m >= n, and their expected directions `reference` (m, 3) in
    the orbital frame with `reference_bias_rad` (m, 3, k).
    """

    measured: Array
    covariance_rad2: Array
    stations: tuple[str, ...]
    reference: Array
    bias_rad: Array | None = None
    reference_bias_rad: Array | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Passage:
    """Time without a direction: known torques and inertial rate of the orbital frame (3,)."""

    seconds: float
    known: KnownTorque
    frame_rate: Array


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
    guess (1,). `choose_s` is the time from which hypotheses are ruled out.  `watches` are the tests
    of the innovations of each station, and of all of them under `EVERY_STATION`.  `start` is what
    came since the first direction, as long as hypotheses are open.
    """

    t_s: float
    bank: AttitudeState
    heard_s: float | None = None
    choose_s: float | None = None
    stations: tuple[str, ...] = ()
    watches: dict[str, InnovationWatch] = field(
        default_factory=lambda: {EVERY_STATION: InnovationWatch()}
    )
    start: tuple[Passage | StationDirection | SharedDirections, ...] = ()


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
        watch: WatchParams,
        *,
        t_s: float,
        quaternion: Array,
        rate_rad_s: Array,
    ) -> None:
        require_finite("t_s", t_s)
        self._inertia = rigid_inertia(satellite)
        self._params, self._start, self._noise, self._gate, self._watch = (
            params,
            start,
            noise,
            gate,
            watch,
        )
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
        passage = Passage(seconds=elapsed, known=known, frame_rate=rate)
        bank = self._passed(self._state.bank, passage)
        self._accept(replace(self._state, t_s=t_s, bank=bank, start=self._noted(passage)))

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
        bank = state.bank if state.heard_s is not None else self._bank(seen)
        watches = self._watched(state.watches, bank, seen, direction.station)
        bank = update(bank, seen, self._gate)
        inside = bool(best_of_bank(bank).refused[0] == 0)
        self._accept(
            self._heard(
                direction,
                bank,
                watches,
                (direction.station,) if inside or not state.stations else (),
                inside,
            )
        )
        return inside

    def observe_shared(self, directions: SharedDirections) -> tuple[int, ...]:
        """Take the directions of one channel; return the indices of the stations whose direction
        lay inside the gate.

        Every hypothesis pairs directions and stations by its own attitude, so a pairing is as open
        as the attitude.  The hypotheses of a start include each station as the origin of the first
        direction.

        Raises
        ------
        ValueError
            As `observe`; nothing is changed then.
        """
        stations = range(len(directions.stations))
        seen = [
            [_checked(_paired(directions, k, station)) for station in stations]
            for k in range(len(directions.measured))
        ]
        if not seen:
            return ()
        state = self._state
        bank = (
            state.bank
            if state.heard_s is not None
            else joined([self._bank(each) for each in seen[0]])
        )
        squared = np.stack([[squared_innovation(bank, each) for each in row] for row in seen])
        # Capped like the misfit: far outside the gate the size of a miss says nothing.
        paired = _pairings(np.minimum(np.moveaxis(squared, -1, 0), self._gate.largest))
        best = int(np.argmin(bank.misfit))
        inside, watches = [], state.watches
        for index, row in enumerate(seen):
            chosen = _of_each(row, paired[:, index])
            station = int(paired[best, index])
            watches = self._watched(watches, bank, row[station], directions.stations[station])
            # Never in doubt: who accepts every direction accepts the wrong station's.
            bank = update(bank, chosen, self._gate, in_doubt=False)
            if bank.refused[best] == 0:
                inside.append(station)
        self._accept(
            self._heard(
                directions,
                bank,
                watches,
                tuple(directions.stations[each] for each in inside),
                bool(inside),
            )
        )
        return tuple(inside)

    def output(self) -> AttitudeEstimate:
        """Return the estimate at the filter's time, with its verdict."""
        best = best_of_bank(self._state.bank)
        reason = "; ".join(self._doubts(best))
        covariance = best.covariance[0].copy()
        # The rate's error goes with the attitude's as the filter's own covariance has it.
        along = np.linalg.solve(covariance[:3, :3], covariance[:3]).T
        covariance += along @ self._state.watches[EVERY_STATION].bias_covariance() @ along.T
        return AttitudeEstimate(
            t_s=self._state.t_s,
            quaternion=canonical(best.quaternion[0]),
            rate_rad_s=best.rate_rad_s[0].copy(),
            covariance=covariance,
            valid=not reason,
            reason=reason,
        )

    def _bank(self, first: DirectionObservation) -> AttitudeState:
        guess = self._state.bank
        return start_bank(self._start, self._gate, guess.quaternion[0], guess.rate_rad_s[0], first)

    def _watched(
        self,
        watches: dict[str, InnovationWatch],
        bank: AttitudeState,
        seen: DirectionObservation,
        station: str,
    ) -> dict[str, InnovationWatch]:
        """Return the watches with one direction; hypotheses of a start are wrong on purpose."""
        if len(bank.misfit) > 1:
            return watches
        z, spread, rows = innovation(bank, seen)
        # The errors of two stations may cancel in the mean of all: one of them is not where it
        # should be.
        return watches | {
            name: watches.get(name, InnovationWatch()).with_direction(
                self._watch, z[0], spread[0], rows, self._gate.largest
            )
            for name in (EVERY_STATION, station)
        }

    def _passed(self, bank: AttitudeState, passage: Passage) -> AttitudeState:
        count, step_s = self._steps(passage)
        for _ in range(count):
            bank = predict(
                self._inertia, self._noise, bank, passage.known, passage.frame_rate, step_s
            )
        return bank

    def _steps(self, passage: Passage) -> tuple[int, float]:
        """Return number and length of equal steps."""
        # The small subtraction keeps a step of exactly step_s from becoming two by rounding.
        count = int(np.ceil(passage.seconds / self._params.step_s - 1e-9))
        return count, passage.seconds / max(count, 1)

    def _heard(
        self,
        heard: StationDirection | SharedDirections,
        bank: AttitudeState,
        watches: dict[str, InnovationWatch],
        stations: tuple[str, ...],
        inside: bool,
    ) -> DoaAttitudeState:
        """Return the state with `bank` and new stations; rule hypotheses out when that is due."""
        state = self._state
        # A direction outside the gate does not count as contact, or a lost filter would never look
        # silent.
        heard_s = state.t_s if inside or state.heard_s is None else state.heard_s
        received = tuple(dict.fromkeys((*state.stations, *stations)))
        choose_s = state.choose_s
        # The second station is the first that tells the hypotheses apart: a direction leaves the
        # turn about itself open.
        if len(received) >= 2 > len(state.stations):
            choose_s = state.t_s + self._start.settle_s
        if choose_s is not None and state.t_s >= choose_s:
            bank = remaining(self._start, bank)
            choose_s = None if len(bank.misfit) == 1 else choose_s
        start = (*state.start, heard) if state.heard_s is None else self._noted(heard)
        found = replace(
            state,
            bank=bank,
            watches=watches,
            heard_s=heard_s,
            stations=received,
            choose_s=choose_s,
            start=start,
        )
        return found if len(bank.misfit) > 1 or not start else self._started_again(found)

    def _noted(
        self, came: Passage | StationDirection | SharedDirections
    ) -> tuple[Passage | StationDirection | SharedDirections, ...]:
        """Return the start with what came, nothing where none is open or it lasts too long."""
        state = self._state
        return (*state.start, came) if 0 < len(state.start) < LONGEST_START else ()

    def _started_again(self, chosen: DoaAttitudeState) -> DoaAttitudeState:
        """Return the state that the start leads to from the attitude it ended with.

        A hypothesis begins up to 15 deg and one in one channel 60 deg off; what is linear there,
        above all the correlation with the biases, is wrong by as much and stays in the filter.
        """
        bank, seconds = chosen.bank, 0.0
        for came in reversed(chosen.start):
            if isinstance(came, Passage):
                count, step_s = self._steps(came)
                seconds += came.seconds
                for _ in range(count):
                    bank = carried_back(
                        self._inertia, self._noise, bank, came.known, came.frame_rate, step_s
                    )
        begun_s = chosen.t_s - seconds
        first = start_state(
            bank.quaternion,
            bank.rate_rad_s,
            self._start.attitude_rad,
            self._start.rate_rad_s,
            self._gate,
        )
        self._state = DoaAttitudeState(t_s=begun_s, bank=first, heard_s=begun_s)
        for came in chosen.start:
            if isinstance(came, Passage):
                self.predict_to(self._state.t_s + came.seconds, came.known, came.frame_rate)
            elif isinstance(came, StationDirection):
                self.observe(came)
            else:
                self.observe_shared(came)
        again, self._state = self._state, chosen
        if again.bank.misfit[0] > chosen.bank.misfit[0]:
            again = chosen
        return replace(again, t_s=chosen.t_s, choose_s=None, start=())

    def _doubts(self, best: AttitudeState) -> list[str]:
        state, params = self._state, self._params
        if state.heard_s is None:
            return ["no direction accepted yet"]
        reasons = []
        if state.t_s - state.heard_s > params.silence_s:
            reasons.append(
                f"no direction for {state.t_s - state.heard_s:.0f} s, must be <= {params.silence_s:.0f} s"
            )
        if best.refused[0] >= self._gate.doubt_after:
            reasons.append(
                f"{int(best.refused[0])} directions in a row outside the gate: attitude in doubt"
            )
        reasons += [
            f"{name}: {doubt}" if name else doubt
            for name, watch in state.watches.items()
            for doubt in watch.reasons(self._watch)
        ]
        if len(state.stations) < params.stations:
            reasons.append(f"{len(state.stations)} of {params.stations} stations received")
        if len(state.bank.misfit) > 1:
            reasons.append(f"{len(state.bank.misfit)} hypotheses of the start still open")
        # Worst axis, not the mean: the turn about the line of sight is the one that is unknown.
        sigma = float(np.sqrt(np.linalg.eigvalsh(best.covariance[0, :3, :3])[-1]))
        if sigma > params.sigma_rad:
            reasons.append(f"attitude sigma {sigma:.3g} rad must be <= {params.sigma_rad:g} rad")
        return reasons

    def _accept(self, state: DoaAttitudeState) -> None:
        for name in ("quaternion", "rate_rad_s", "covariance"):
            require_finite(f"filter {name}", getattr(state.bank, name))
        self._state = state


def _pairings(cost: Array) -> NDArray[np.int64]:
    """Return the column of each row (members, n) with the least total of `cost` (members, n, k)."""
    from scipy.optimize import linear_sum_assignment

    return np.array([linear_sum_assignment(each)[1] for each in cost])


def _paired(directions: SharedDirections, measured: int, station: int) -> StationDirection:
    """Return one of the directions as that of one of the stations."""
    biases, of_references = directions.bias_rad, directions.reference_bias_rad
    return StationDirection(
        station=directions.stations[station],
        measured=directions.measured[measured],
        covariance_rad2=directions.covariance_rad2[measured],
        reference=directions.reference[station],
        bias_rad=None if biases is None else biases[measured],
        reference_bias_rad=None if of_references is None else of_references[station],
    )


def _of_each(row: list[DirectionObservation], station: NDArray[np.int64]) -> DirectionObservation:
    """Return a direction with the reference of the `station` (members,) that each member chose."""
    biases = [each.reference_bias_rad for each in row if each.reference_bias_rad is not None]
    return replace(
        row[0],
        reference=np.stack([each.reference for each in row])[station],
        reference_bias_rad=np.stack(biases)[station] if biases else None,
    )


def _checked(direction: StationDirection) -> DirectionObservation:
    measured = unit_directions("measured", as_finite_array("measured", direction.measured, (3,)))
    reference = unit_directions(
        "reference", as_finite_array("reference", direction.reference, (3,))
    )
    covariance = as_finite_array("covariance_rad2", direction.covariance_rad2, (3, 3))
    across = np.linalg.eigvalsh(0.5 * (covariance + covariance.T))
    # A direction's covariance has rank two.  Along the direction the variance is zero but for
    # rounding; across it rounding is not variance.
    if across[0] < -1e-9 * across[2] or across[1] <= 1e-9 * across[2]:
        raise ValueError(
            f"covariance_rad2 has eigenvalues {across}, two of them must be > 0 and none negative"
        )
    bias = (
        None
        if direction.bias_rad is None
        else as_finite_array("bias_rad", direction.bias_rad, (3, 2))
    )
    of_reference = direction.reference_bias_rad
    if of_reference is not None:
        of_reference = as_finite_array("reference_bias_rad", of_reference, (3, None))
    return DirectionObservation(measured, covariance, reference, bias, of_reference)
