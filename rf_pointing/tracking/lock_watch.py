"""Detects within 2 s that monopulse follows the wrong thing: a flipped sign, phases that have turned, a sidelobe.

* Signs and phases: what the beam does and what the error does about it, weighed as evidence (`lock_evidence.py`).
* Steepness: over a sliding window the error is regressed on where the encoders say the beam was, e = e0 - G d; the false
  null of a sidelobe is several times as steep as the main beam's, G = 1.
* Level: on a sidelobe C/N0 is far below the link's while the error is small.
"""

from dataclasses import dataclass, field

import numpy as np

from rf_pointing.core import PointingError
from rf_pointing.tracking.lock_evidence import Evidence, EvidenceState
from rf_pointing.tracking.lock_watch_parameters import LockWatchParams
from rf_pointing.tracking.response import ResponseEstimate, ResponseSums

__all__ = ["LockWatch", "LockWatchState"]


@dataclass(frozen=True, slots=True)
class LockWatchState:
    """Evidence; rows of the window: time, sensed error, beam position (complex), variance per axis; clusters of a low level."""

    evidence: EvidenceState = field(default_factory=EvidenceState)
    rows: tuple[tuple[float, complex, complex, float], ...] = ()
    low_clusters: int = 0


class LockWatch:
    """Collects errors and beam positions; `add` returns the fault, empty if there is none."""

    def __init__(self, params: LockWatchParams) -> None:
        self.params = params
        self._evidence = Evidence(params)
        self.state = LockWatchState()

    def add(
        self,
        error: PointingError,
        beam_cross_elevation_rad: float,
        beam_elevation_rad: float,
        expected_carrier_to_noise_db_hz: float | None = None,
    ) -> str:
        """Take one error and the beam's offset from the predicted direction at its time; return why it is false."""
        if not error.valid:
            return ""
        sensed = complex(error.cross_elevation_rad, error.elevation_rad)
        beam = complex(beam_cross_elevation_rad, beam_elevation_rad)
        noise = 0.5 * float(np.trace(error.covariance_rad2))
        floor = self.params.unmodelled_beamwidths * self.params.half_power_beamwidth_rad
        oldest = error.t_s - self.params.window_s
        level_fault = self._level_fault(error, sensed, expected_carrier_to_noise_db_hz)
        low = self.state.low_clusters + 1 if level_fault else 0
        self.state = LockWatchState(
            evidence=self._evidence.with_measurement(self.state.evidence, error.t_s, sensed, beam, noise),
            rows=(
                *(row for row in self.state.rows if oldest <= row[0] < error.t_s),
                (error.t_s, sensed, beam, noise + floor**2),
            ),
            low_clusters=low,
        )
        # A carrier that comes or goes within a cluster is no sidelobe.
        if low >= self.params.level_clusters:
            return level_fault
        return self._evidence.fault(self.state.evidence) or self._steepness_fault()

    def reset(self) -> None:
        """Forget everything, as after a change of sensor or a new calibration."""
        self.state = LockWatchState()

    def response(self) -> ResponseEstimate | None:
        """Return the response over the window, None while the beam has not moved."""
        rows = self.state.rows
        if len(rows) < 3:
            return None
        weights = [1.0 / row[3] for row in rows]
        total = sum(weights)
        mean_error = sum(w * row[1] for w, row in zip(weights, rows, strict=True)) / total
        mean_beam = sum(w * row[2] for w, row in zip(weights, rows, strict=True)) / total
        sums = ResponseSums()
        for _, sensed, beam, variance in rows:
            sums = sums.with_pair(beam - mean_beam, sensed - mean_error, variance)
        return sums.estimate()

    def _level_fault(self, error: PointingError, sensed: complex, expected_db_hz: float | None) -> str:
        if expected_db_hz is None or abs(sensed) > 0.3 * self.params.half_power_beamwidth_rad:
            return ""
        drop = expected_db_hz - error.carrier_to_noise_db_hz
        if drop > self.params.level_drop_db:
            return f"sidelobe: C/N0 is {drop:.1f} dB below the link's with a small error"
        return ""

    def _steepness_fault(self) -> str:
        found = self.response()
        if found is None or abs(found.value) - self.params.sigmas * found.sigma <= self.params.steepest:
            return ""
        return f"sidelobe: the error changes {abs(found.value):.1f} times as fast as the beam moves"
