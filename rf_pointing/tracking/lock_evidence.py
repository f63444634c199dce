"""Evidence that the sensor's response is not the right one: flipped in one axis or both, or turned.

A beam that does b beyond expectation changes the error by -b if the sensor is right, by something else in a false lock.
Both are known: the beam from the encoders, the error from the receiver (`innovation.py`).  Every false response is held
against the right one by the logarithm of the likelihood ratio, summed from cluster to cluster and never below zero (E. S.
Page, Continuous Inspection Schemes, Biometrika 41, 1954): as long as the response is right and moves as the model has it, a
sum passes x at most once in e^x clusters on average.

How strong wind and vibration are nobody knows.  Each response keeps its own probabilities of every weather, which changes
now and then; so gusts that look like a flip to a model of calm air do not to one that has learned of the gusts.
"""

import cmath
import itertools
import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rf_pointing.tracking.innovation import InnovationBank, Innovations
from rf_pointing.tracking.lock_watch_parameters import LockWatchParams

__all__ = ["RESPONSES", "Evidence", "EvidenceState"]

Array = NDArray[np.float64]
LONGEST_GAP_S = 1.0
"""Between two errors; after a longer one everything begins again."""
SETTLED_S = 1.0
"""For so long its velocity has changed when a target that wanders is first seen."""
TURN = cmath.exp(2j * math.pi / 3.0)
"""Explains the errors better than the right response does if they are turned by more than half of it."""


class Response(NamedTuple):
    """A motion b of the beam changes the error by -(direct b + mirrored b*); `fault` is what is wrong with that."""

    direct: complex
    mirrored: complex
    fault: str


SIGN_FLIP = "sign flip: the error grows while it is corrected, in {}"
RESPONSES = (
    Response(1.0, 0.0, ""),
    Response(0.0, -1.0, SIGN_FLIP.format("cross-elevation")),
    Response(0.0, 1.0, SIGN_FLIP.format("elevation")),
    Response(-1.0, 0.0, SIGN_FLIP.format("both axes")),
    Response(TURN, 0.0, "phase: the error is turned by more than 60 deg"),
    Response(TURN.conjugate(), 0.0, "phase: the error is turned by more than -60 deg"),
)
"""The right one first; all of unit size, so that one filter serves them all."""
DIRECT = np.array([[response.direct] for response in RESPONSES])
MIRRORED = np.array([[response.mirrored] for response in RESPONSES])


@dataclass(frozen=True, slots=True)
class EvidenceState:
    """Filters; probability of every weather under every response; sum against the right one for every response."""

    bank: InnovationBank | None = None
    weather: tuple[tuple[float, ...], ...] = ()
    sums: tuple[float, ...] = (0.0,) * len(RESPONSES)


class Evidence:
    """Compares the responses; the state is the caller's."""

    def __init__(self, params: LockWatchParams) -> None:
        self.params = params
        weathers = itertools.product(params.gust_rad, params.vibration_rad, params.drift_change_rad_s)
        self._walk, self._shake, self._wander = np.array(list(weathers)).T
        usual = np.where(self._wander == params.drift_change_rad_s[0], 1.0, params.settling_share)
        self._usual = usual / usual.sum()
        self._drift = np.maximum(params.drift_rad_s, self._wander * SETTLED_S)

    def fault(self, state: EvidenceState) -> str:
        """Return what is wrong with the response, empty as long as nothing is certain."""
        most = int(np.argmax(state.sums))
        return RESPONSES[most].fault if state.sums[most] >= self.params.evidence else ""

    def with_measurement(
        self, state: EvidenceState, t_s: float, error_rad: complex, beam_rad: complex, noise_rad2: float
    ) -> EvidenceState:
        """Return the state after one more error and the beam's position at its time (cross-elevation + j elevation)."""
        params = self.params
        noise = noise_rad2 + self._shake**2
        if state.bank is None or not 0.0 < t_s - state.bank.t_s <= LONGEST_GAP_S:
            bank = InnovationBank.begin(t_s, beam_rad, error_rad, noise, self._drift)
            return EvidenceState(bank=bank, weather=(tuple(self._usual.tolist()),) * len(RESPONSES))
        gap_s = t_s - state.bank.t_s
        bank, new = state.bank.step(t_s, beam_rad, error_rad, noise, self._walk, self._wander)
        joint = np.log(state.weather) + _log_likelihoods(new)
        explained = np.logaddexp.reduce(joint, axis=1)
        stays = math.exp(-gap_s / params.weather_s)
        weather = stays * np.exp(joint - explained[:, None]) + (1.0 - stays) * self._usual
        # No single cluster decides.
        says = np.minimum(explained - explained[0], params.evidence / 3.0)
        sums = np.maximum(0.0, math.exp(-gap_s / params.fade_s) * np.array(state.sums) + says)
        return EvidenceState(bank=bank, weather=tuple(map(tuple, weather.tolist())), sums=tuple(sums.tolist()))


def _log_likelihoods(new: Innovations) -> Array:
    """Return the logarithm of the likelihood of one measurement under every response (rows) in every weather (columns)."""
    left = new.error_rad + DIRECT * new.beam_rad + MIRRORED * np.conj(new.beam_rad)
    return np.asarray(-0.5 * np.abs(left) ** 2 / new.variance_rad2 - np.log(new.variance_rad2))
