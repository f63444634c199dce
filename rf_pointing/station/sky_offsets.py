"""What is added to the target's direction on the sky: the tracking loop's trim, and the scans that look for more.

Offsets are cross-elevation and elevation; azimuth = cross-elevation / cos(elevation), with the rates that belong to it.
"""

import math

import numpy as np
from numpy.typing import NDArray

from rf_pointing.controllers import TrackerIntegrator, TrackerIntegratorParams
from rf_pointing.geometry import Motion, PointingError
from rf_pointing.tracking import AutotrackState, ConscanParams, SpiralParams, SpiralSearch, circle_offset

__all__ = ["SkyOffsets"]

Array = NDArray[np.float64]
CONSCAN_GAIN = 0.7
CONSCAN_RAMP_S = 1.0
"""A conscan result moves the trim by this share of itself, spread over this time."""
STEEPEST_RAD = math.radians(88.0)
"""Elevation above which cross-elevation is no longer turned into ever larger azimuth."""


class SkyOffsets:
    """The trim (an integrator of the sensed error), the search spiral and the conscan circle; times are command times."""

    def __init__(self, integrator: TrackerIntegratorParams, spiral: SpiralParams, conscan: ConscanParams) -> None:
        self._monopulse = integrator
        self._conscan_loop = integrator.replace(
            bandwidth_hz=CONSCAN_GAIN / (2.0 * math.pi * CONSCAN_RAMP_S), sample_s=CONSCAN_RAMP_S
        )
        self._integrator = TrackerIntegrator(integrator)
        self._spiral = SpiralSearch(spiral)
        self._conscan = conscan
        self._scan_start_s: float | None = None
        self._scan = ""
        self._used_s = -math.inf
        self._found: Array | None = None
        self._best_db_hz = -math.inf

    @property
    def half_power_beamwidth_rad(self) -> float:
        """Beamwidth that the scans are laid out for."""
        return self._conscan.half_power_beamwidth_rad

    def restart(self, t_s: float) -> None:
        """Begin without any trim."""
        self._integrator.reset(t_s)
        self._scan, self._scan_start_s, self._used_s = "", None, -math.inf
        self._found, self._best_db_hz = None, -math.inf

    def listen(
        self,
        command_s: float,
        mode_before: str,
        state: AutotrackState,
        error: PointingError | None,
        beam_offset_rad: Array | None,
    ) -> None:
        """Take what the period brought, for commands from `command_s` on: the mode, and the newest error.

        `beam_offset_rad` is where the beam really was from the scan centre when that error was measured.
        """
        fresh = error is not None and error.t_s > self._used_s
        if fresh and error is not None:
            self._used_s = error.t_s
            if mode_before == "search" and beam_offset_rad is not None:
                self._consider(error, beam_offset_rad)
        if state.mode != mode_before:
            self._change_mode(command_s, state.mode)
        elif fresh and error is not None and error.valid and state.integrating:
            self._integrator.update(command_s, _measured(error))

    def trim(self, t_s: float) -> Array:
        """Return the tracking offset (2,) at `t_s`, or the oldest one still known."""
        return self._integrator.at(max(t_s, self._integrator.state.t_s))[0]

    def add_trim(self, times: Array, target: Motion) -> Motion:
        """Return the target's motion (n, 2) with the tracking offset added."""
        known_s = self._integrator.state.t_s
        pairs = [self._integrator.at(max(float(t), known_s)) for t in times]
        return _added(target, np.array([pair[0] for pair in pairs]), np.array([pair[1] for pair in pairs]))

    def add_scan(self, times: Array, sky: Motion) -> Motion:
        """Return the motion (n, 2) with the running scan added, if one runs."""
        if not self._scan:
            return sky
        pairs = np.array([self._scan_offset(float(t)) for t in times])
        return _added(sky, pairs[:, :2], pairs[:, 2:])

    def _change_mode(self, command_s: float, mode: str) -> None:
        if mode == "hand_back":
            self._integrator.reset(command_s)
        if self._scan == "search" and self._found is not None and mode in ("monopulse", "conscan", "coast"):
            self._integrator.reset(command_s, self._found)
        scanning = mode if mode in ("search", "conscan") else ""
        if scanning != self._scan:
            self._scan, self._scan_start_s = scanning, command_s
            self._found, self._best_db_hz = None, -math.inf
        if mode in ("monopulse", "conscan"):
            self._integrator.retune(self._monopulse if mode == "monopulse" else self._conscan_loop)
            self._integrator.unfreeze()
        else:
            self._integrator.freeze(max(command_s, self._integrator.state.t_s))

    def _consider(self, error: PointingError, beam_offset_rad: Array) -> None:
        """Keep where the carrier was strongest during a search; a valid error says how far the target was from there."""
        if error.carrier_to_noise_db_hz > self._best_db_hz:
            self._best_db_hz = error.carrier_to_noise_db_hz
            beam = self.trim(error.t_s) + beam_offset_rad
            self._found = beam + _measured(error) if error.valid else beam

    def _scan_offset(self, t_s: float) -> tuple[float, float, float, float]:
        assert self._scan_start_s is not None
        since_s = t_s - self._scan_start_s
        return self._spiral.offset(since_s) if self._scan == "search" else circle_offset(self._conscan.scan, since_s)


def _measured(error: PointingError) -> Array:
    return np.array([error.cross_elevation_rad, error.elevation_rad])


def _added(target: Motion, offset: Array, rate: Array) -> Motion:
    """Add offsets (n, 2) and their rates; the offsets' own accelerations are left to the servo."""
    elevation = np.minimum(np.abs(target.position[:, 1]), STEEPEST_RAD)
    secant, tangent = 1.0 / np.cos(elevation), np.tan(elevation)
    climb = target.velocity[:, 1]
    azimuth = offset[:, 0] * secant
    azimuth_rate = secant * (rate[:, 0] + offset[:, 0] * tangent * climb)
    return Motion(
        target.position + np.stack([azimuth, offset[:, 1]], axis=-1),
        target.velocity + np.stack([azimuth_rate, rate[:, 1]], axis=-1),
        target.acceleration,
    )
