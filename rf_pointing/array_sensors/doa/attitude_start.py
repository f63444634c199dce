"""Start of the attitude filter from one direction and an attitude that may be anything.

One direction fixes two axes; the turn about it is known only through the dynamics, and over the
first pass that turn is too uncertain for a linear filter: given its true uncertainty the filter may
lock 180 deg away.  So:

* `aligned_start` turns the guess the shortest way onto the first direction and starts with a small
  uncertainty on purpose.  The turn stays nearly as guessed until the next station, 120 deg away on
  the sky, corrects it at once; this works for turns up to about 60 deg wrong.
* `start_bank` does the same for `hypotheses` turns evenly round the circle; one of them is within
  15 deg of the truth at the start and converges.  `best_of_bank` is the one with the smallest
  misfit, `remaining` those that the data do not rule out.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rf_pointing.array_sensors.attitude.multiplicative_filter import (
    AttitudeState,
    Biases,
    DirectionObservation,
    GateParams,
    attitude_error,
    rotation_between,
    start_state,
)
from rf_pointing.array_sensors.attitude.quaternion import (
    multiply,
    quaternion_from_rotation_vector,
    quaternion_to_matrix,
)
from rf_pointing.core import Params, parameter
from rf_pointing.core.types import Array

AGREEING = 6.0
"""Squared normalised difference of two hypotheses that agree, of six components."""


@dataclass(frozen=True, kw_only=True)
class StartParams(Params):
    """Uncertainty at the first direction, and how many turns about it are tried."""

    attitude_rad: float = parameter(
        0.1, "starting uncertainty of the attitude, each axis", low=1e-6, high=3.15
    )
    rate_rad_s: float = parameter(
        0.0087, "starting uncertainty of the rate, each axis", low=1e-9, high=1.0
    )
    # Twelve turns leave at most 15 deg of error, well inside the 60 deg from which a start
    # converges.
    hypotheses: int = parameter(
        12, "turns about the first line of sight that are tried", low=1, high=360
    )
    # Right after the second station the hypotheses still differ by their transient, not by their
    # fit.
    settle_s: float = parameter(
        30.0, "time from the second station until hypotheses are ruled out", low=0.0, high=1e4
    )
    # A likelihood ratio of exp(15): a wrong start must be rarer than any other fault.
    decisive: float = parameter(
        30.0,
        "excess of the sum of normalised squared innovations that rules a hypothesis out",
        low=1.0,
        high=1e4,
    )


def aligned_start(
    params: StartParams,
    gate: GateParams,
    quaternion: Array,
    rate_rad_s: Array,
    first: DirectionObservation,
) -> AttitudeState:
    """Return the state of the guess (..., 4), (..., 3) turned the shortest way so that `first` is
    where it should be.
    """
    seen = np.einsum("...ij,...j->...i", quaternion_to_matrix(quaternion), first.measured)
    # The shortest turn changes nothing about the line of sight, the axis that one direction cannot
    # show.
    turn = quaternion_from_rotation_vector(rotation_between(seen, first.reference))
    return start_state(
        multiply(turn, quaternion), rate_rad_s, params.attitude_rad, params.rate_rad_s, gate
    )


def start_bank(
    params: StartParams,
    gate: GateParams,
    quaternion: Array,
    rate_rad_s: Array,
    first: DirectionObservation,
) -> AttitudeState:
    """Return banks (..., hypotheses) of states.

    Each aligned guess (..., 4), (..., 3) turned about its first direction.
    """
    count = params.hypotheses
    aligned = aligned_start(params, gate, quaternion, rate_rad_s, first)
    # Evenly round the line of sight: one of twelve is within 15 deg of the truth, where a filter
    # converges.
    turns = (
        2.0 * np.pi / count * np.arange(count)[:, None] * np.asarray(first.reference)[..., None, :]
    )
    turned = multiply(quaternion_from_rotation_vector(turns), aligned.quaternion[..., None, :])
    rates = np.broadcast_to(aligned.rate_rad_s[..., None, :], (*turned.shape[:-1], 3))
    return start_state(turned, rates, params.attitude_rad, params.rate_rad_s, gate)


def best_of_bank(state: AttitudeState) -> AttitudeState:
    """Return the member (..., 1) of each bank (..., hypotheses) with the smallest misfit."""
    best = np.argmin(state.misfit, axis=-1)[..., None]
    axis = best.ndim - 1

    def of(values: NDArray[Any]) -> NDArray[Any]:
        index = best.reshape(*best.shape, *[1] * (values.ndim - best.ndim))
        return np.asarray(np.take_along_axis(values, index, axis=axis))

    return _each(state, of)


def joined(banks: list[AttitudeState]) -> AttitudeState:
    """Return one bank of all members of `banks`, fresh ones: no biases are estimated yet."""
    return AttitudeState(
        np.concatenate([bank.quaternion for bank in banks]),
        np.concatenate([bank.rate_rad_s for bank in banks]),
        np.concatenate([bank.covariance for bank in banks]),
        np.concatenate([bank.refused for bank in banks]),
        np.concatenate([bank.misfit for bank in banks]),
    )


def remaining(params: StartParams, bank: AttitudeState) -> AttitudeState:
    """Return the best member of one bank (hypotheses,) and those that contradict it and are not
    ruled out.

    Members agree when they differ by less than their uncertainty: they have seen the same
    directions, so their errors are common.
    """
    best = best_of_bank(bank)
    apart = attitude_error(best, bank.quaternion, bank.rate_rad_s)
    distance = np.einsum("ni,ni->n", apart, np.linalg.solve(best.covariance[0], apart.T).T)
    kept = (distance > AGREEING) & (bank.misfit <= best.misfit + params.decisive)
    kept[int(np.argmin(bank.misfit))] = True
    return _each(bank, lambda values: np.asarray(values[kept]))


def _each(state: AttitudeState, change: Callable[[NDArray[Any]], NDArray[Any]]) -> AttitudeState:
    """Return the state with `change` of each of its arrays."""
    return AttitudeState(
        change(state.quaternion),
        change(state.rate_rad_s),
        change(state.covariance),
        change(state.refused),
        change(state.misfit),
        None
        if state.biases is None
        else Biases(
            *(
                change(each)
                for each in (
                    state.biases.estimate,
                    state.biases.covariance,
                    state.biases.correlation,
                )
            )
        ),
    )
