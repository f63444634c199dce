"""Drift of the difference channels against the sum since the receiver's start.

What gain and phase they have is measured by the tracker: its calibration scan fits the complex
response of both channels on the carrier (`tracking/monopulse_scan.py`).  Afterwards they drift.
Gain: the noise of each channel against the sum's keeps its ratio, for its amplifiers do.  Phase: a
real error is in phase with the sum; the slope of the quadrature against the in-phase part is the
tangent of the drift.
"""

import math

import numpy as np

from rf_pointing.core.types import Array, ComplexArray

WATCHED = 600
"""Integrations that the drift is judged by: a minute of 0.1-s reports."""
FEWEST = 50
DRIFT_DB, DRIFT_RAD = 0.5, math.radians(10.0)


class ChannelBalance:
    """Watches gain and phase of the differences."""

    def __init__(self) -> None:
        self._reference: Array | None = None
        self._ratios: list[ComplexArray] = []
        self._noise: Array | None = None

    def take(self, prompts: ComplexArray, noise: Array) -> None:
        """Take integrations (n, 3) of the channels, and their noise powers (3,)."""
        share = noise[1:] / noise[0]
        self._noise = share if self._noise is None else self._noise + 0.05 * (share - self._noise)
        if self._reference is None:
            self._reference = share
        total = np.mean(np.abs(prompts[:, 0]) ** 2)
        self._ratios.append(np.conj(prompts[:, 0]) @ prompts[:, 1:] / len(prompts) / total)
        del self._ratios[:-WATCHED]

    @property
    def gain_drift_db(self) -> Array:
        """Drift of the differences' gains since the start, dB (2,)."""
        if self._noise is None or self._reference is None:
            return np.zeros(2)
        return np.asarray(10.0 * np.log10(self._noise / self._reference))

    @property
    def phase_drift_rad(self) -> Array:
        """Drift of the differences' phases, rad (2,); 0 while the errors are too small to tell."""
        if len(self._ratios) < FEWEST:
            return np.zeros(2)
        ratios = np.array(self._ratios)
        across = np.sum(ratios.real * ratios.imag, axis=0)
        along, quadrature = np.sum(ratios.real**2, axis=0), np.sum(ratios.imag**2, axis=0)
        # Phase of the principal axis; noise is the same in both directions and does not turn it.
        angle = 0.5 * np.arctan2(2.0 * across, along - quadrature)
        sure = (along - quadrature) ** 2 + 4.0 * across**2 > 0.25 * (along + quadrature) ** 2
        return np.asarray(np.where(sure, angle, 0.0))

    @property
    def problem(self) -> str:
        """Why the channels need a calibration, "" if they do not."""
        words = [
            f"{name}: gain {gain_db:+.1f} dB, phase {math.degrees(phase):+.0f} deg"
            for name, gain_db, phase in zip(
                ("cross-elevation", "elevation"), self.gain_drift_db, self.phase_drift_rad,
                strict=True,
            )
            if abs(gain_db) > DRIFT_DB or abs(phase) > DRIFT_RAD
        ]  # fmt: skip
        return f"difference channels have drifted, calibrate: {'; '.join(words)}" if words else ""
