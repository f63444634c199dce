"""What is added to the target's direction on the sky: what was learned of the ephemeris, the tracking loop, the scans.

    offset = trim(t) + residual(t) + scan(t) + blend(t)

The trim is the Kalman filter's along-track, cross-track and bias error, carried along the target's own motion; the
residual is what the fast loop found beyond it, and fades while no sensor tracks, so that a coast follows what was learned.
A new estimate of the filter moves trim and residual against each other and nothing else.  Offsets are cross-elevation and
elevation; azimuth = cross-elevation / cos(elevation), with the rates that belong to it.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rf_pointing.controllers import TrackerIntegrator, TrackerIntegratorParams
from rf_pointing.core import Mode, Motion, PointingError
from rf_pointing.core.time_buffer import TimeBuffer
from rf_pointing.station.pointing.scan_patterns import ScanPatterns, Scans
from rf_pointing.station.pointing.transition import OffsetTransition
from rf_pointing.tracking import AutotrackState, SkyMotion, TrimFilter, TrimParams, direction_rows
from rf_pointing.tracking.sensors import SENSORS

__all__ = ["PointingCorrections"]

Array = NDArray[np.float64]
OVER = np.array([1.0, -1.0])
"""What becomes of an error of the dish (cross-elevation, elevation) on the sky when it goes over the top: encoders and
elevation axis point the other way.  That of the azimuth axis stays."""
FADE_S = 3.0
"""Time in which a coast forgets what the trim does not explain."""
FOUND_SIGMA_BEAMWIDTHS = 0.25
"""How well the strongest carrier of a search says where the target is."""
UNDERWAY_S = 0.5
"""Time from a command's to the errors that the beam then has: transport, servo, cluster and the period of the controller."""
STEEPEST_RAD = math.radians(88.0)
"""Elevation above which cross-elevation is no longer turned into ever larger azimuth."""


@dataclass(frozen=True)
class _Found:
    """Where a search heard the carrier: target minus prediction (2,), its variance, the target's motion, the level."""

    t_s: float
    direction_rad: Array
    covariance_rad2: Array
    sky: SkyMotion
    level_db_hz: float


class PointingCorrections:
    """Offsets of one pass; times are command times unless an error's own is meant."""

    def __init__(self, integrator: TrackerIntegratorParams, scans: Scans, trim: TrimParams) -> None:
        self._loop, self._loops = integrator, _loops(integrator, scans)
        self._trim_params, self._scan_params = trim, scans
        self.restart(0.0)

    @property
    def half_power_beamwidth_rad(self) -> float:
        """Beamwidth that the scans are laid out for."""
        return self._scan_params.spiral.half_power_beamwidth_rad

    @property
    def filter(self) -> TrimFilter:
        """What was learned of the ephemeris."""
        return self._filter

    def restart(self, t_s: float) -> None:
        """Begin without any offset."""
        self._integrator = TrackerIntegrator(self._loop)
        self._integrator.reset(t_s)
        self._integrator.freeze(t_s)
        self._over = False
        self._filter = TrimFilter(self._trim_params)
        self._scans = ScanPatterns(self._scan_params)
        self._blend = OffsetTransition()
        self._past = TimeBuffer(kept_s=self._scan_params.memory_s)
        self._ahead: tuple[Array, Array] | None = None
        self._fade_s: float | None = None
        self._used_s = self._learned_s = -math.inf
        self._found: _Found | None = None
        self._unseen = False

    def arriving(self, t_s: float) -> bool:
        """Whether the errors of `t_s` may still be those of the way to where the last change of mode sent the beam."""
        return t_s < self._blend.end_s + UNDERWAY_S

    def update(
        self, command_s: float, mode_before: str, state: AutotrackState, error: PointingError | None, beam: Array | None
    ) -> None:
        """Take what the period brought, for commands from `command_s` on: the mode, and the newest error.

        `beam` (2,) is where the beam really was from the prediction when that error was measured.
        """
        fresh = error is not None and error.t_s > self._used_s
        if fresh and error is not None:
            self._used_s = error.t_s
            if mode_before == Mode.SEARCH and beam is not None:
                self._consider(error, beam)
        if state.mode != mode_before:
            self._change_mode(command_s, state.mode)
        elif fresh and error is not None and error.valid and state.integrating and error.sensor == state.mode:
            self._correct(command_s, error, beam)
        elif not state.integrating and not self._integrator.frozen:
            self._integrator.freeze(max(command_s, self._integrator.state.t_s))

    def trim(self, t_s: float) -> Array:
        """Return what is added to the prediction at `t_s` without the scans (2,), zero where that is not known."""
        past = self._past.at(t_s)
        return np.zeros(2) if past is None else past[3:5]

    def _displaced(self, command_s: float, t_s: float, past: Array | None, beam: Array | None) -> Array:
        """Return where the beam was from the centre on purpose (2,) at `t_s`: no error of the centre, nothing to correct.

        While it is on its way the encoders tell; once there, what they see is the wind, which is to be corrected, and only
        the circle that tests the lock was meant.
        """
        if past is not None and beam is not None and self.arriving(command_s):
            return np.asarray(beam - past[3:5])
        return self._scans.at(np.array([t_s]), None)[0][0] if self._scans.running else np.zeros(2)

    def add_trim(self, times: Array, target: Motion, range_m: Array) -> Motion:
        """Return the target's motion (n, 2) with trim and residual added; `range_m` (n,) is its distance."""
        rates = target.velocity * np.column_stack([np.cos(target.position[:, 1]), np.ones(len(times))])
        self._ahead = (times, np.column_stack([rates, range_m]))
        offset, rate = self._centre(times)
        self._past.add(float(times[0]), np.concatenate([self._ahead[1][0], offset[0]]))
        return added(target, offset, rate)

    def stand(self, over: bool) -> None:
        """Note whether the dish stands over the top; when it has gone over, what was learned of the dish is turned with it."""
        if over == self._over:
            return
        self._over = over
        self._filter.turn(OVER)
        state = self._integrator.state
        state.offset_rad, state.rate_rad_s = state.offset_rad * OVER, state.rate_rad_s * OVER
        self._integrator.state = state

    def beside(self, target: Motion, over: Array, range_m: float) -> Array:
        """Return by how much (n, 2) trim and residual move the axes off the target's motion (n, 2); nothing is noted.

        `over` (n,) says where the dish then stands over the top.
        """
        rates = target.velocity * np.column_stack([np.cos(target.position[:, 1]), np.ones(len(target.position))])
        sky = SkyMotion(*np.column_stack([rates, np.full(len(rates), range_m)]).T)
        turned = np.where((over != self._over)[:, None], OVER, 1.0)
        learned = self._filter.state.mean * np.column_stack([np.ones_like(turned), turned])
        residual = self._residual(np.array([self._integrator.state.t_s]))[0] * turned
        offset = residual + np.einsum("nij,nj->ni", direction_rows(sky), learned)
        moved: Array = added(target, offset, np.zeros_like(offset)).position - target.position
        return moved

    def add_scan(self, times: Array, sky: Motion) -> Motion:
        """Return the motion (n, 2) with the running scan added, and what is left of the one before."""
        return added(sky, *self._scan(times))

    def _correct(self, command_s: float, error: PointingError, beam: Array | None) -> None:
        """Let one valid error act: on the loop at once, on the filter with the weight that it deserves."""
        self._unseen = False
        past, sensed = self._past.at(error.t_s), _measured(error)
        if not SENSORS[error.sensor].scans:
            self._integrator.update(command_s, sensed + self._displaced(command_s, error.t_s, past, beam))
            direction, age_s, pause_s = None if beam is None else beam + sensed, 0.0, 0.0
        else:
            self._integrator.update(command_s, sensed)
            age_s = self._scan_params.age_s(error.sensor)
            direction, pause_s = None if past is None else past[3:5] + sensed, 2.0 * age_s
        then = self._past.at(error.t_s - age_s)
        if direction is not None and then is not None and error.t_s - self._learned_s >= pause_s:
            self._learned_s = error.t_s
            self._learn(command_s, error.t_s - age_s, direction, error.covariance_rad2, _sky(then))

    def _learn(self, command_s: float, t_s: float, direction: Array, covariance: Array, sky: SkyMotion) -> None:
        """Update the filter; what the trim gains at `command_s` the residual loses."""
        if self._filter.state.t_s is not None and t_s < self._filter.state.t_s:
            return
        before = self._trim_at(np.array([command_s]))[0]
        self._filter.update(t_s, direction, covariance, sky)
        state = self._integrator.state
        state.offset_rad = state.offset_rad + (before - self._trim_at(np.array([command_s]))[0])[0]
        self._integrator.state = state

    def _change_mode(self, command_s: float, mode: str) -> None:
        """Begin and end what belongs to the modes; the command goes on from where it is, at the speed it has."""
        now = np.array([command_s])
        before = [a + b for a, b in zip(self._centre(now), self._scan(now), strict=True)]
        residual = self._residual(now)[0][0]
        if mode == Mode.HOLD_OFF:
            self._filter, residual = TrimFilter(self._trim_params), np.zeros(2)
        found = self._found if self._scans.running == Mode.SEARCH and (mode in SENSORS or mode == Mode.COAST) else None
        if found is not None:
            # The filter may never have heard a sensor before: then this is all it knows.
            self._filter.update(found.t_s, found.direction_rad, found.covariance_rad2, found.sky)
            residual = found.direction_rad - direction_rows(found.sky) @ self._filter.state.mean
            self._unseen = True
        self._found = None
        self._integrator.retune(self._loop_of(mode))
        self._integrator.reset(command_s, residual)
        self._fade_s = None
        if mode not in SENSORS:
            self._integrator.freeze(command_s)
            # Where a search heard the carrier is kept until a sensor has looked at it.
            self._fade_s = command_s if self._filter.state.used and not self._unseen else None
        self._scans.begin(mode, command_s, self._filter, self._sky_at(now))
        self._blend = OffsetTransition()
        after = [a + b for a, b in zip(self._centre(now), self._scan(now), strict=True)]
        left = [(b - a)[0] for a, b in zip(after, before, strict=True)]
        self._blend = OffsetTransition.within(command_s, left[0], left[1], self._scan_params.spiral.acceleration_rad_s2)

    def _loop_of(self, mode: str) -> TrackerIntegratorParams:
        if mode not in SENSORS:
            return self._integrator.params
        return self._loops.get(mode, self._loop)

    def _consider(self, error: PointingError, beam: Array) -> None:
        """Keep where the carrier was strongest during a search; a valid error says how far the target was from there."""
        past = self._past.at(error.t_s)
        if past is None or (self._found and error.carrier_to_noise_db_hz <= self._found.level_db_hz):
            return
        sigma_rad = FOUND_SIGMA_BEAMWIDTHS * self.half_power_beamwidth_rad
        direction, covariance = beam, np.eye(2) * sigma_rad**2
        if error.valid:
            direction, covariance = beam + _measured(error), error.covariance_rad2
        self._found = _Found(error.t_s, direction, covariance, _sky(past), error.carrier_to_noise_db_hz)

    def _centre(self, times: Array) -> tuple[Array, Array]:
        """Return trim and residual (n, 2), and their rates."""
        (trim, trim_rate), (residual, residual_rate) = self._trim_at(times), self._residual(times)
        return trim + residual, trim_rate + residual_rate

    def _trim_at(self, times: Array) -> tuple[Array, Array]:
        still = np.zeros((len(times), 2))
        if self._ahead is None or self._filter.state.used == 0:
            return still, still
        known, motion = self._ahead
        offsets = direction_rows(SkyMotion(*motion.T)) @ self._filter.state.mean
        rates = np.gradient(offsets, known, axis=0, edge_order=2)
        if len(times) == len(known) and times[0] == known[0]:
            return offsets, rates
        return _interpolated(times, known, offsets), _interpolated(times, known, rates)

    def _residual(self, times: Array) -> tuple[Array, Array]:
        known_s = self._integrator.state.t_s
        pairs = np.array([self._integrator.at(max(float(t), known_s)) for t in times])
        if self._fade_s is None:
            return pairs[:, 0], pairs[:, 1]
        left = np.exp(-np.maximum(times - self._fade_s, 0.0) / FADE_S)[:, None]
        return pairs[:, 0] * left, pairs[:, 0] * left * (-1.0 / FADE_S)

    def _scan(self, times: Array) -> tuple[Array, Array]:
        """Return the running scan and what is left of an earlier one (n, 2), and their rates."""
        offset, rate = self._blend.at(times)
        if not self._scans.running:
            return offset, rate
        rows = self._scans.at(times, self._sky_at(times))
        return offset + rows[0], rate + rows[1]

    def _sky_at(self, times: Array) -> SkyMotion | None:
        if self._ahead is None:
            return None
        return SkyMotion(*_interpolated(times, *self._ahead).T)


def _loops(integrator: TrackerIntegratorParams, scans: Scans) -> dict[str, TrackerIntegratorParams]:
    """Return the integrator of each sensor that scans; the others have the one that is configured."""
    loops = {}
    for name, scan in scans.sensors.items():
        bandwidth_hz, sample_s = scan.loop
        kept = integrator.sample_s if sample_s is None else sample_s
        # A scan's estimates are means of many samples already.
        loops[name] = integrator.replace(mean_of=1, bandwidth_hz=bandwidth_hz, sample_s=kept)
    return loops


def _measured(error: PointingError) -> Array:
    return np.array([error.cross_elevation_rad, error.elevation_rad])


def _sky(past: Array) -> SkyMotion:
    return SkyMotion(float(past[0]), float(past[1]), float(past[2]))


def _interpolated(times: Array, known: Array, values: Array) -> Array:
    return np.column_stack([np.interp(times, known, column) for column in values.T])


def added(target: Motion, offset: Array, rate: Array) -> Motion:
    """Add offsets (n, 2) on the sky and their rates; the offsets' own accelerations are left to the servo."""
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
