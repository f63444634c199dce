"""Detects within 2 s that monopulse follows the wrong thing: a flipped sign, a sidelobe, phases that have turned.

Over a sliding window the sensed error is regressed on where the encoders say the beam was, relative to the predicted
direction: e = e0 - G d.  G is 1 on the main beam; -1 where the error grows while it is being corrected; several in a
sidelobe, whose false null is steep.  A sidelobe also shows as a C/N0 far below the link's while the error is small.

A loop that follows the wind moves the beam towards an error that comes back: over 2 s that too can look like G < 0.  So a
turned response counts only with an error that the wind does not leave: a false one grows e-fold in 1 / (2 pi f_m) until it is.
"""

import math
from dataclasses import dataclass

import numpy as np

from rf_pointing.geometry import MDEG, Params, PointingError, parameter
from rf_pointing.tracking.response import ResponseEstimate, ResponseSums

__all__ = ["LockWatch", "LockWatchParams", "LockWatchState"]

SIGN_FLIP_RAD = math.radians(105.0)


@dataclass(frozen=True, kw_only=True)
class LockWatchParams(Params):
    """Window and limits of the watch."""

    half_power_beamwidth_rad: float = parameter(65.0 * MDEG, "half-power beamwidth", low=1e-6, high=0.5)
    window_s: float = parameter(2.0, "time over which the response is measured", low=0.1, high=60.0)
    sigmas: float = parameter(4.0, "certainty of a verdict in standard deviations", low=1.0, high=10.0)
    largest_sigma: float = parameter(0.5, "uncertainty of the response above which it is unknown", low=0.01, high=1.0)
    unmodelled_beamwidths: float = parameter(0.03, "motion of the beam that the encoders do not see", low=0.0, high=0.5)
    grown: float = parameter(
        2.5, "mean error, over the unmodelled motion, from which a turned response is believed", low=0.0, high=100.0
    )
    steepest: float = parameter(2.0, "response above which it is a sidelobe", low=1.1, high=10.0)
    largest_turn_rad: float = parameter(math.radians(60.0), "turn of the response that is a fault", low=0.1, high=1.5)
    level_clusters: int = parameter(3, "clusters in a row for which it must be", low=1, high=100)
    level_drop_db: float = parameter(10.0, "C/N0 below the link's that is a sidelobe", low=3.0, high=30.0)


@dataclass(frozen=True, slots=True)
class LockWatchState:
    """Rows of the window: time, sensed error, beam position (complex), variance per axis; clusters of too low a level."""

    rows: tuple[tuple[float, complex, complex, float], ...] = ()
    low_clusters: int = 0


class LockWatch:
    """Collects errors and beam positions; `add` returns the fault, empty if there is none."""

    def __init__(self, params: LockWatchParams) -> None:
        self.params = params
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
        floor = self.params.unmodelled_beamwidths * self.params.half_power_beamwidth_rad
        variance = 0.5 * float(np.trace(error.covariance_rad2)) + floor**2
        row = (error.t_s, sensed, complex(beam_cross_elevation_rad, beam_elevation_rad), variance)
        oldest = error.t_s - self.params.window_s
        level_fault = self._level_fault(error, sensed, expected_carrier_to_noise_db_hz)
        low = self.state.low_clusters + 1 if level_fault else 0
        self.state = LockWatchState((*(r for r in self.state.rows if oldest <= r[0] < error.t_s), row), low)
        # A carrier that comes or goes within a cluster is no sidelobe.
        return level_fault if low >= self.params.level_clusters else self._response_fault()

    def reset(self) -> None:
        """Forget the window, as after a change of sensor or a new calibration."""
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

    def _grown(self) -> bool:
        """Whether the mean error of the newest quarter of the window is more than the wind's."""
        newest_s = self.state.rows[-1][0] - 0.25 * self.params.window_s
        latest = [row[1] for row in self.state.rows if row[0] >= newest_s]
        floor = self.params.unmodelled_beamwidths * self.params.half_power_beamwidth_rad
        return abs(sum(latest)) / len(latest) >= self.params.grown * floor

    def _level_fault(self, error: PointingError, sensed: complex, expected_db_hz: float | None) -> str:
        if expected_db_hz is None or abs(sensed) > 0.3 * self.params.half_power_beamwidth_rad:
            return ""
        drop = expected_db_hz - error.carrier_to_noise_db_hz
        if drop > self.params.level_drop_db:
            return f"sidelobe: C/N0 is {drop:.1f} dB below the link's with a small error"
        return ""

    def _response_fault(self) -> str:
        found = self.response()
        if found is None or found.sigma > self.params.largest_sigma:
            return ""
        turned = abs(found.phase_rad)
        if self._grown() and turned - self.params.sigmas * found.phase_sigma_rad > self.params.largest_turn_rad:
            if turned > SIGN_FLIP_RAD:
                return f"sign flip: the error grows while it is corrected (response {found.value.real:.1f}, must be 1)"
            return f"phase: the error is turned by {math.degrees(turned):.0f} deg"
        if abs(found.value) - self.params.sigmas * found.sigma > self.params.steepest:
            return f"sidelobe: the error changes {abs(found.value):.1f} times as fast as the beam moves"
        return ""
