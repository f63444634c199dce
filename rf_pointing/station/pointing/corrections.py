"""Corrections of the target's direction: the learned ephemeris error, the loop, the scans.

    offset = ephemeris correction + tracking correction + scan + transition

The ephemeris correction is the Kalman filter's along-track, cross-track and bias error
(`tracking/trim.py`), carried along the target's own motion.  The tracking correction is what the
fast loop found beyond it; it fades while no sensor tracks, so that a coast follows what was
learned.  A new estimate of the filter moves the two against each other and nothing else.  Offsets
are cross-elevation and elevation; azimuth = cross-elevation / cos(elevation), with the rates that
belong to it.
"""

import math
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from rf_pointing.controllers import TrackerIntegrator, TrackerIntegratorParams
from rf_pointing.core import Array, BoolArray, Mode, Motion, PointingError, Quintic, SkyUncertainty
from rf_pointing.core.signals import TimeBuffer
from rf_pointing.planning import AxisRates
from rf_pointing.station.pointing.scan_patterns import UNDERWAY_S, ScanPatterns, Scans
from rf_pointing.tracking import AutotrackState, SkyMotion, TrackPath, TrimFilter, TrimParams, direction_rows, prior_for
from rf_pointing.tracking.sensors import SENSORS
from rf_pointing.tracking.trim import STEEPEST_RAD

# A transition of no distance still needs a few points of the trajectory.
SHORTEST_TRANSITION_S = 0.5
AT_REST = np.zeros(2)
# What becomes of an error of the dish (cross-elevation, elevation) on the sky when it goes over the
# top: encoders and elevation axis point the other way. That of the azimuth axis stays.
OVER = np.array([1.0, -1.0])
# Time in which a coast forgets what the filter does not explain.
FADE_S = 3.0
# How well the strongest carrier of a search says where the target is.
FOUND_SIGMA_BEAMWIDTHS = 0.25
# How far a target may move within the window of a scan against the offset that is reported.
LARGEST_BLUR_BEAMWIDTHS = 0.08
# How many times less certain a target is taken to be that is not where it could be.
SURPRISE = 8.0
# Turns of the filter's equations about where they lead, for a target far from the straight line.
TURNS = 3


@dataclass(frozen=True)
class OffsetTransition:
    """Offset and rate (2,) left over at `start_s`, taken out by a quintic in `duration_s`.

    A mode that ends leaves the beam off its new path, and moving.  The duration is such that
    |acceleration| <= 4 v/T + 5.8 d/T^2 stays below a bound, d and v the distance and the speed left
    over.
    """

    start_s: float = 0.0
    duration_s: float = SHORTEST_TRANSITION_S
    offset_rad: Array | None = None
    rate_rad_s: Array | None = None

    @classmethod
    def within(cls, start_s: float, offset_rad: Array, rate_rad_s: Array, acceleration_rad_s2: float) -> Self:
        """Return the transition that needs no more than this acceleration."""
        distance, speed = float(np.hypot(*offset_rad)), float(np.hypot(*rate_rad_s))
        bound = 4.0 * speed + math.sqrt(16.0 * speed**2 + 23.2 * acceleration_rad_s2 * distance)
        return cls(start_s, max(SHORTEST_TRANSITION_S, bound / (2.0 * acceleration_rad_s2)), offset_rad, rate_rad_s)

    @property
    def end_s(self) -> float:
        """When nothing is left of it; the infinite past for nothing at all."""
        return -math.inf if self.offset_rad is None else self.start_s + self.duration_s

    def at(self, t_s: Array) -> tuple[Array, Array]:
        """Return offset and rate (n, 2) at the times (n,), none of them before the start."""
        if self.offset_rad is None or self.rate_rad_s is None or t_s[0] >= self.start_s + self.duration_s:
            return np.zeros((len(t_s), 2)), np.zeros((len(t_s), 2))
        since = np.clip(t_s - self.start_s, 0.0, self.duration_s)
        start, end = Motion(self.offset_rad, self.rate_rad_s, AT_REST), Motion(AT_REST, AT_REST, AT_REST)
        motion = Quintic(start, end, self.duration_s).at(since)
        return motion.position, motion.velocity


@dataclass(frozen=True)
class _Found:
    """Strongest carrier of a search: target minus prediction (2,), variance, motion, level."""

    t_s: float
    direction_rad: Array
    covariance_rad2: Array
    sky: SkyMotion
    level_db_hz: float


@dataclass(frozen=True)
class _Ahead:
    """The last trajectory: times (n,), motion (n, 3), slopes by the filter's state (n, 2, 4).

    `place` (n, 2) are the angles of the target.
    """

    t_s: Array
    sky: Array
    rows: Array
    place: Array


class PointingCorrections:
    """Offsets of one pass; times are command times unless an error's own is meant."""

    def __init__(self, integrator: TrackerIntegratorParams, scans: Scans, trim: TrimParams) -> None:
        self._loop, self._loops = integrator, _loops(integrator, scans)
        self._trim_params, self._scan_params = trim, scans
        self._path: TrackPath | None = None
        self._whole: TrackPath | None = None
        self.half_power_beamwidth_rad = scans.spiral.half_power_beamwidth_rad
        self.restart(0.0)

    def restart(self, t_s: float) -> None:
        """Begin without any offset."""
        self._integrator = TrackerIntegrator(self._loop)
        self._integrator.freeze(t_s)
        self._over = False
        self._prior, self._path, self._fruitless = self._trim_params, None, 0
        self._stated: tuple[TrimParams, TrackPath | None] = self._trim_params, None
        self._shown_s, self._whole = 0.0, None
        self.surprises = 0
        """How often the target was too far off for what was known of it: a manoeuvre, perhaps."""
        self.filter = TrimFilter(self._prior)
        self._scans = ScanPatterns(self._scan_params)
        self._transition = OffsetTransition()
        self._share: tuple[Array, Array] = np.array([t_s]), np.ones(1)
        self.arrived_s = -math.inf
        """When the beam is where the last mode sent it; before, it may still be on its way."""
        self._past = TimeBuffer(kept_s=self._scan_params.memory_s)
        self._ahead: _Ahead | None = None
        self._fade_s: float | None = None
        self._used_s = self._learned_s = -math.inf
        self._found: _Found | None = None
        self._unseen = False

    def know(self, known: SkyUncertainty, sky: SkyMotion, path: TrackPath | None) -> None:
        """Take how uncertain the target is until something is measured; `path` is its pass."""
        self._whole = path
        if self.filter.state.used or self.surprises:
            return
        prior = prior_for(self._trim_params, known, sky)
        if prior != self._prior:
            self._prior, self.filter = prior, TrimFilter(prior)
        # Where the elements are as good as usual a straight line is, too.
        self._path = path if prior.along_track_s > self._trim_params.along_track_s else None

    def use_band(self, command_s: float, integrator: TrackerIntegratorParams, scans: Scans, trim: TrimParams) -> None:
        """Go on with another beam and its scans: what the filter learned of the target stays."""
        self._change_mode(command_s, Mode.COAST)
        self._loop, self._loops, self._scan_params = integrator, _loops(integrator, scans), scans
        self.half_power_beamwidth_rad = scans.spiral.half_power_beamwidth_rad
        if self.filter.state.used:
            # Both feeds were calibrated apart: what their models leave differs.
            differ_rad = min(trim.bias_rad, FOUND_SIGMA_BEAMWIDTHS * self.half_power_beamwidth_rad)
            spread = np.diag([0.0, 0.0, differ_rad**2, differ_rad**2])
            self.filter.state = replace(self.filter.state, covariance=self.filter.state.covariance + spread)
        self._scans = ScanPatterns(scans)

    def learned_sigma_rad(self) -> float:
        """Return the standard deviation of the target's direction, infinite before it is seen."""
        if self._ahead is None or not self.filter.state.used:
            return math.inf
        t_s = float(self._ahead.t_s[0])
        _, sky = self._about(t_s, float(self.filter.state.mean[0]), SkyMotion(*self._ahead.sky[0].tolist()))
        return math.sqrt(float(np.linalg.eigvalsh(self.filter.trim(t_s, sky).covariance_rad2)[-1]))

    def update(
        self, command_s: float, mode_before: str, state: AutotrackState, error: PointingError | None, beam: Array | None
    ) -> None:
        """Use the mode and the newest error of the period for commands from `command_s` on.

        `beam` (2,) is where the beam really was from the prediction when that error was measured.
        """
        fresh = error is not None and error.t_s > self._used_s
        if fresh and error is not None:
            self._used_s = error.t_s
            if mode_before == Mode.SEARCH and beam is not None:
                self._consider(error, beam)
        if state.mode != mode_before:
            self._change_mode(command_s, state.mode)
            return
        follow = error is not None and error.valid and error.sensor == state.mode and state.carrier
        if fresh and follow and error is not None:
            self._correct(command_s, error, beam)
        elif not state.integrating and not self._integrator.frozen:
            # The loop may have an update that lies ahead of this command.
            self._integrator.freeze(max(command_s, self._integrator.state.t_s))

    def correction_rad(self, t_s: float) -> Array:
        """Return what is added to the prediction at `t_s` (2,) without scans, zero if not known."""
        past = self._past.at(t_s)
        return np.zeros(2) if past is None else past[3:5]

    def add_corrections(self, times: Array, target: Motion, range_m: Array) -> Motion:
        """Return the target's motion (n, 2) with both corrections; `range_m` is (n,)."""
        sky = np.empty((len(times), 3))
        sky[:, 0] = target.velocity[:, 0] * np.cos(target.position[:, 1])
        sky[:, 1], sky[:, 2] = target.velocity[:, 1], range_m
        self._ahead = _Ahead(times, sky, direction_rows(SkyMotion(*sky.T)), target.position)
        offset, rate = self._corrections(times)
        self._past.add(float(times[0]), np.concatenate([sky[0], offset[0]]))
        return added(target, offset, rate)

    def add_scan(self, times: Array, sky: Motion, limits: AxisRates) -> Motion:
        """Return the motion (n, 2) with the running scan and what is left of the one before.

        The scan is as large as the axes with these limits allow.
        """
        self._share = times, self._scans.share(sky, limits) if self._scans.running else np.ones(len(times))
        return added(sky, *self._scan(times))

    @property
    def searching(self) -> bool:
        """Whether the beam looks for the target."""
        return self._scans.running == Mode.SEARCH

    @property
    def scan_end_s(self) -> float:
        """When the beam is back on the target after a scan on command, infinite without one."""
        return self._scans.end_s + UNDERWAY_S

    def cross(self, command_s: float, mode: str) -> None:
        """Coast through a crossing of the zenith: what was learned stays as it is."""
        self._change_mode(command_s, mode)
        self._fade_s = None

    def turn_over(self, over: bool) -> None:
        """Note the side of the zenith; a change turns what was learned of the dish."""
        if over == self._over:
            return
        self._over = over
        self.filter.turn(OVER)
        self._integrator.change(signs=OVER)

    def axis_offsets_rad(self, target: Motion, over: BoolArray, range_m: float) -> Array:
        """Return how far (n, 2) the corrections move the axes off the target's motion (n, 2).

        `over` (n,) says where the dish is then over the top.
        """
        rates = target.velocity * np.column_stack([np.cos(target.position[:, 1]), np.ones(len(target.position))])
        sky = SkyMotion(*np.column_stack([rates, np.full(len(rates), range_m)]).T)
        turned = np.where((over != self._over)[:, None], OVER, 1.0)
        learned = self.filter.state.mean * np.column_stack([np.ones_like(turned), turned])
        tracking = self._tracking_correction(np.array([self._integrator.state.t_s]))[0] * turned
        offset = tracking + np.einsum("nij,nj->ni", direction_rows(sky), learned)
        moved: Array = added(target, offset, np.zeros_like(offset)).position - target.position
        return moved

    def _displaced(self, command_s: float, t_s: float, past: Array | None, beam: Array | None) -> Array:
        """Return how far the beam was from the centre on purpose (2,), not to be corrected."""
        # While it is on its way the encoders show that. Once there, what they show is the wind,
        # which is to be corrected, and only the circle that tests the lock was meant.
        if past is not None and beam is not None and command_s < self.arrived_s:
            return np.asarray(beam - past[3:5])
        return self._scanned(np.array([t_s]), None)[0][0] if self._scans.running else np.zeros(2)

    def _correct(self, command_s: float, error: PointingError, beam: Array | None) -> None:
        """Use one valid error: in the loop at once, in the filter with its weight."""
        self._unseen = False
        past, sensed = self._past.at(error.t_s), _measured(error)
        scans = SENSORS[error.sensor].scans
        age_s = self._scan_params.age_s(error.sensor) if scans else 0.0
        then = self._past.at(error.t_s - age_s) if scans else past
        direction: Array | None = None
        if scans:
            mean_s, turning = error.t_s - age_s, not SENSORS[error.sensor].once_a_round
            frame = self._led(mean_s, error.t_s, self._shown_s) if turning else self._led(mean_s, error.t_s)
            self._integrator.update(command_s, sensed + self._led(mean_s, error.t_s) - frame)
            direction = None if past is None else past[3:5] + sensed - frame
        else:
            self._integrator.update(command_s, sensed + self._displaced(command_s, error.t_s, past, beam))
            direction = None if beam is None else beam + sensed
        # Estimates of a sliding scan share their samples: the filter gets one per window.
        rested = error.t_s - self._learned_s >= 2.0 * age_s
        if direction is not None and then is not None and rested:
            self._learned_s = error.t_s
            sky = SkyMotion(*then[:3].tolist())
            self._learn(command_s, error.t_s - age_s, direction, error.covariance_rad2, sky)
            if scans:
                self._show_ahead(error.t_s, error.sensor)

    def _led(self, from_s: float, to_s: float, ahead_s: float | None = None) -> Array:
        """Return how far (2,) a target so far ahead went off the prediction; by default as learned.

        A scan says where it was on average: seconds off its elements it would drag the loop behind.
        """
        if self._path is None:
            return AT_REST
        learned_s = float(self.filter.state.mean[0]) if ahead_s is None else ahead_s
        offset, _ = self._path.moved(np.array([from_s, to_s]), learned_s)
        return np.asarray(offset[1] - offset[0])

    def shown_rad(self, t_s: float) -> Array:
        """Return the correction (2,) beyond the prediction that is reported, without scans.

        A scan takes its target to stand still against this.  One that is seconds off its
        elements does not: then the prediction goes ahead with what was learned.
        """
        if self._path is None or not self._shown_s:
            return self.correction_rad(t_s)
        return np.asarray(self.correction_rad(t_s) - self._path.moved(np.array([t_s]), self._shown_s)[0][0])

    def _show_ahead(self, t_s: float, sensor: str) -> None:
        """Let the prediction go ahead once what it lacks would blur the sensor's scan."""
        learned_s = float(self.filter.state.mean[0])
        if self._path is None or learned_s == self._shown_s:
            return
        # The errors are of the middle of a window: twice that is all of it.
        begin_s = t_s - 2.0 * self._scan_params.age_s(sensor)
        blur = self._led(begin_s, t_s, learned_s) - self._led(begin_s, t_s, self._shown_s)
        if float(np.hypot(*blur)) > LARGEST_BLUR_BEAMWIDTHS * self.half_power_beamwidth_rad:
            self._shown_s = learned_s

    def _learn(self, command_s: float, t_s: float, direction: Array, covariance: Array, sky: SkyMotion) -> None:
        """Update the filter; what one correction gains at `command_s` the other loses."""
        # A scan's estimate may be about a time before that of the sensor before it.
        if self.filter.state.t_s is not None and t_s < self.filter.state.t_s:
            return
        now = np.array([command_s])
        before, refused = self._learned(now), self.filter.state.refused
        self._fuse(t_s, direction, covariance, sky)
        if self.filter.state.refused > refused and not self.filter.state.refused_in_a_row:
            self._be_surprised()
        self._integrator.change((before - self._learned(now))[0])

    def _be_surprised(self) -> None:
        """Take the target to be less certain than stated: its filter has refused what it sees."""
        if not self.surprises:
            self._stated = self._prior, self._path
        self.surprises += 1
        along_s, cross_m = SURPRISE * self._prior.along_track_s, SURPRISE * self._prior.cross_track_m
        self._prior = self._prior.replace(along_track_s=min(along_s, 60.0), cross_track_m=min(cross_m, 1e6))
        self.filter, self._path = TrimFilter(self._prior), self._whole

    def _fuse(self, t_s: float, direction: Array, covariance: Array, sky: SkyMotion) -> None:
        """Update the filter with target minus prediction (2,), along the path where it bends."""
        if self._path is None:
            self.filter.update(t_s, direction, covariance, sky)
            return
        before = self.filter.state
        for _ in range(TURNS):
            about_s = float(self.filter.state.mean[0])
            offset, motion = self._about(t_s, about_s, sky)
            straight = np.array(motion[:2], dtype=np.float64) * about_s
            self.filter.state = before
            if not self.filter.update(t_s, direction - offset + straight, covariance, motion):
                return

    def _about(self, t_s: float, ahead_s: float, sky: SkyMotion) -> tuple[Array, SkyMotion]:
        """Return where the target is if it is early, and how it moves there: what the filter adds.

        On a straight line that is its rate times the time; the path knows better.
        """
        if self._path is None:
            return np.array(sky[:2], dtype=np.float64) * ahead_s, sky
        offset, rate = self._path.moved(np.array([t_s]), ahead_s)
        return offset[0], SkyMotion(float(rate[0, 0]), float(rate[0, 1]), sky.range_m)

    def _change_mode(self, command_s: float, mode: str) -> None:
        """Change what belongs to the modes; neither place nor speed of the command jumps."""
        now = np.array([command_s])
        before = [a + b for a, b in zip(self._corrections(now), self._scan(now), strict=True)]
        tracking = self._tracking_correction(now)[0][0]
        if mode == Mode.HOLD_OFF:
            # What a false lock taught is wrong, all of it, also that the target surprises.
            self._prior, self._path = self._stated
            self.surprises = 0
            self.filter, tracking = TrimFilter(self._prior), np.zeros(2)
        searched = self._scans.running == Mode.SEARCH
        found = self._found if searched and (mode in SENSORS or mode == Mode.COAST) else None
        # A search that found nothing was too small.
        self._fruitless = 0 if mode in SENSORS else self._fruitless + (searched and mode == Mode.PROGRAM_TRACK)
        if found is not None:
            # The filter may have had no sensor yet: then this is all it knows.
            self._fuse(found.t_s, found.direction_rad, found.covariance_rad2, found.sky)
            tracking = found.direction_rad - self._learned_on(np.array([found.t_s]), found.sky)[0]
            self._unseen = True
        self._found = None
        if mode in SENSORS:
            self._integrator.retune(self._loops.get(mode, self._loop))
        self._integrator.reset(command_s, tracking)
        self._fade_s = None
        if mode not in SENSORS:
            self._integrator.freeze(command_s)
            # The direction that a search found is kept until a sensor has looked at it.
            self._fade_s = command_s if self.filter.state.used and not self._unseen else None
        # The scan begins at once; the transition takes out what jumps in place and speed.
        self._scans.begin(
            mode, command_s, self.filter, self._sky_at(now), self._path,
            uncertain=self._prior is not self._trim_params, wider=1 + self._fruitless,
        )  # fmt: skip
        self._transition = OffsetTransition()
        after = [a + b for a, b in zip(self._corrections(now), self._scan(now), strict=True)]
        left = [(b - a)[0] for a, b in zip(after, before, strict=True)]
        acceleration = self._scan_params.spiral.acceleration_rad_s2
        self._transition = OffsetTransition.within(command_s, left[0], left[1], acceleration)
        self.arrived_s = self._transition.end_s + UNDERWAY_S

    def _consider(self, error: PointingError, beam: Array) -> None:
        """Keep where a search found the strongest carrier; a valid error refines the direction."""
        past = self._past.at(error.t_s)
        if past is None or (self._found and error.carrier_to_noise_db_hz <= self._found.level_db_hz):
            return
        sigma_rad = FOUND_SIGMA_BEAMWIDTHS * self.half_power_beamwidth_rad
        direction, covariance = beam, np.eye(2) * sigma_rad**2
        if error.valid:
            direction, covariance = beam + _measured(error), error.covariance_rad2
        sky = SkyMotion(*past[:3].tolist())
        self._found = _Found(error.t_s, direction, covariance, sky, error.carrier_to_noise_db_hz)

    def _corrections(self, times: Array) -> tuple[Array, Array]:
        """Return the sum of both corrections (n, 2), and its rate."""
        ephemeris, ephemeris_rate = self._ephemeris_correction(times)
        tracking, tracking_rate = self._tracking_correction(times)
        return ephemeris + tracking, ephemeris_rate + tracking_rate

    def _ephemeris_correction(self, times: Array) -> tuple[Array, Array]:
        """Return what the filter learned (n, 2), and its rate; zero before a measurement."""
        if self._ahead is None or self.filter.state.used == 0:
            still = np.zeros((len(times), 2))
            return still, still
        known = self._ahead.t_s
        rates = np.gradient(self._learned_ahead(self._ahead), known, axis=0, edge_order=2)
        return self._learned(times), _interpolated(times, known, rates)

    def _learned_ahead(self, ahead: "_Ahead") -> Array:
        """Return what the filter learned (n, 2) along the last trajectory."""
        if self._path is None:
            return np.asarray(ahead.rows @ self.filter.state.mean)
        return self._learned_on(ahead.t_s, SkyMotion(*ahead.sky.T))

    def _learned_on(self, times: Array, sky: SkyMotion) -> Array:
        """Return what the filter learned (n, 2) for a target that moves like `sky` at `times`."""
        mean = self.filter.state.mean
        if self._path is None:
            return np.atleast_2d(direction_rows(sky) @ mean)
        offset, rate = self._path.moved(times, float(mean[0]))
        moved = SkyMotion(rate[:, 0], rate[:, 1], np.broadcast_to(sky.range_m, times.shape))
        return np.asarray(offset + direction_rows(moved)[:, :, 1:] @ mean[1:])

    def _learned(self, times: Array) -> Array:
        """Return what the filter learned (n, 2), zero before a measurement."""
        if self._ahead is None or self.filter.state.used == 0:
            return np.zeros((len(times), 2))
        return _interpolated(times, self._ahead.t_s, self._learned_ahead(self._ahead))

    def _tracking_correction(self, times: Array) -> tuple[Array, Array]:
        """Return what the loop found (n, 2), and its rate."""
        offset, rate = self._integrator.along(times)
        if self._fade_s is None:
            return offset, rate
        left = np.exp(-np.maximum(times - self._fade_s, 0.0) / FADE_S)[:, None]
        return offset * left, offset * left * (-1.0 / FADE_S)

    def _scan(self, times: Array) -> tuple[Array, Array]:
        """Return the running scan and what is left of an earlier one (n, 2), and their rates."""
        offset, rate = self._transition.at(times)
        if not self._scans.running:
            return offset, rate
        rows = self._scanned(times, self._sky_at(times))
        return offset + rows[0], rate + rows[1]

    def _scanned(self, times: Array, sky: SkyMotion | None) -> tuple[Array, Array]:
        """Return the running scan (n, 2) as far as the axes can make it, and its rate."""
        offset, rate = self._scans.at(times, sky)
        program = self._scan_params.program
        if program is not None and math.isfinite(self._scans.end_s) and self._ahead is not None:
            place = _interpolated(times, self._ahead.t_s, self._ahead.place)
            turn = program.axes(place, self._scan_params.latitude_rad, self._scan_params.mount)
            # The axes of a frame turn slowly against the scan: their rates are left to the servo.
            offset, rate = (np.einsum("nij,nj->ni", turn, part) for part in (offset, rate))
        share = np.interp(times, *self._share)
        if np.all(share == 1.0):
            return offset, rate
        change = np.gradient(share, times) if len(times) > 1 else np.zeros(1)
        return offset * share[:, None], rate * share[:, None] + offset * change[:, None]

    def _sky_at(self, times: Array) -> SkyMotion | None:
        if self._ahead is None:
            return None
        return SkyMotion(*_interpolated(times, self._ahead.t_s, self._ahead.sky).T)


def _loops(integrator: TrackerIntegratorParams, scans: Scans) -> dict[str, TrackerIntegratorParams]:
    """Return the integrator of each sensor that scans; others have the configured one."""
    loops = {}
    for name, scan in scans.sensors.items():
        bandwidth_hz, sample_s = scan.loop
        kept = integrator.sample_s if sample_s is None else sample_s
        # A scan's estimates are means of many samples already.
        loops[name] = integrator.replace(mean_of=1, bandwidth_hz=bandwidth_hz, sample_s=kept)
    return loops


def _measured(error: PointingError) -> Array:
    return np.array([error.cross_elevation_rad, error.elevation_rad])


def _interpolated(times: Array, known: Array, values: Array) -> Array:
    if times is known:
        return values
    columns: Array = np.array([np.interp(times, known, column) for column in values.T]).T
    return columns


def added(target: Motion, offset: Array, rate: Array) -> Motion:
    """Add offsets (n, 2) on the sky and their rates; their accelerations are left to the servo."""
    # Within 2 deg of the zenith azimuth would run away for any offset.
    elevation = np.minimum(np.abs(target.position[:, 1]), STEEPEST_RAD)
    secant, tangent = 1.0 / np.cos(elevation), np.tan(elevation)
    climb = target.velocity[:, 1]
    position, velocity = target.position.copy(), target.velocity.copy()
    position[:, 0] += offset[:, 0] * secant
    velocity[:, 0] += secant * (rate[:, 0] + offset[:, 0] * tangent * climb)
    position[:, 1] += offset[:, 1]
    velocity[:, 1] += rate[:, 1]
    return Motion(position, velocity, target.acceleration)
