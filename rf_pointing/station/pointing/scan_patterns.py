"""Motions added to look for more: search, scans of the sensors, calibration and probe circles.

A search covers three standard deviations of what the filter knows of the ephemeris.  A spiral does,
unless it would take too long and the target is far likelier early or late than off its track:
then the track is swept in strips.
"""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from rf_pointing.controllers import TrackerIntegratorParams
from rf_pointing.core import MU, Array, Mode, Motion, Pair, random_stream, received_power
from rf_pointing.planning import AxisRates, SensorCost
from rf_pointing.rf.dish_array import DishArrayParams, direction_sigmas_rad
from rf_pointing.tracking import (
    AutotrackParams,
    SkyMotion,
    SpiralParams,
    SpiralSearch,
    StripSearch,
    TrackPath,
    TrimFilter,
    TrimParams,
    direction_rows,
)
from rf_pointing.tracking.scan import Pattern, Scan, ScanParams
from rf_pointing.tracking.scan_program import ScanProgram
from rf_pointing.tracking.sensors import SENSORS, SensorTraits

# A longer spiral would cost more of a pass than strips along the track.
LONGEST_SPIRAL_S = 30.0
# However sure the filter is: the target was not there.
LEAST_SIGMA_BEAMWIDTHS = 0.25
# A longer spiral would not end within a pass.
MOST_TURNS, LARGEST_SIGMA_RAD = 150.0, 0.2
# Speed on the sky below which there is no track to search along.
SLOWEST_RAD_S = 1e-5
# Transport, servo and messages, on top of the age of the oldest samples.
SPARE_S = 2.0
# Time from a command's to the errors that the beam then has: transport, servo, cluster and the
# period of the controller.
UNDERWAY_S = 0.5
# Directions of the target that stand for all: quantiles of the distance times even angles.
RINGS, SPOKES = 10, 12
# What certificates promise.
PROMISED = 0.9
# Steps in which a search and a scan are sampled.
SAMPLE_S = 0.05
# A scan of this length, after its ramp, has the mean power of any.
SCAN_S, RAMPED_S = 60.0, 10.0
# Quantiles of the C/N0 of a pass, and loops that are flown at each.
PARTS, COPIES = 6, 8


class Scans:
    """The search, the scans of all registered sensors, and the circles of other modes.

    A sensor's own scan is that of its traits, else the parameter set of its name in `sets`, those
    of the controller.  `probe` is the circle that tests the lock of a watched sensor, or None.
    """

    def __init__(self, spiral: SpiralParams, calibration: ScanParams, probe: ScanParams | None, sets: Any) -> None:
        self.spiral = spiral
        self._demands: dict[str, Pair] = {}
        self.sensors: dict[str, Scan] = {
            traits.name: traits.scan or getattr(sets, traits.name) for traits in SENSORS.values() if traits.scans
        }
        self.program: ScanProgram | None = None
        """The scan on command of the pass in hand: the program track is scanned with it."""
        self.latitude_rad, self.mount = sets.sun.site.latitude_rad, sets.kinematics
        self.circles: dict[str, ScanParams] = {Mode.CALIBRATE: calibration}
        if probe is not None:
            self.circles |= {traits.name: probe for traits in SENSORS.values() if traits.watched}

    def age_s(self, sensor: str) -> float:
        """Return how long before the stamp of an error its samples lie, on average."""
        return self.sensors[sensor].age_s if sensor in self.sensors else 0.0

    def demand(self, mode: str) -> Pair:
        """Return the largest rate and acceleration across the line of sight of a mode's scan."""
        if mode == Mode.PROGRAM_TRACK and self.program is not None:
            return self.program.demand
        if mode not in self._demands:
            scan = self.sensors.get(mode) or self.circles[mode]
            pattern, times = scan.pattern(), RAMPED_S + np.arange(0.0, SCAN_S, SAMPLE_S)
            rates = np.array([pattern(float(t))[2] for t in times])
            bends = np.diff(rates) / SAMPLE_S
            self._demands[mode] = float(np.abs(rates).max()), float(np.abs(bends).max())
        return self._demands[mode]

    @property
    def memory_s(self) -> float:
        """Time for which the offsets of the past must be known."""
        return SPARE_S + max((scan.age_s for scan in self.sensors.values()), default=0.0)


class ScanPatterns:
    """The pattern of the mode in force; `running` is that mode, "" while nothing is added."""

    def __init__(self, scans: Scans) -> None:
        self._scans = scans
        self.running = ""
        self._start_s = 0.0
        self._pattern: Pattern | None = None
        self._per_track: Pair | None = None
        self._path: TrackPath | None = None
        self._ahead_s = 0.0

    def begin(
        self, mode: str, start_s: float, known: TrimFilter, sky: SkyMotion | None, path: TrackPath | None = None,
        uncertain: bool = False, wider: int = 1,
    ) -> None:  # fmt: skip
        """Begin what `mode` needs at `start_s`; `sky` (1,) is the target's motion there.

        The search of an `uncertain` target is as large as the filter says, that of any other at
        most as large as configured; it goes along the `path` of the pass where that is given, and
        is `wider` so many times.
        """
        self._start_s, self._per_track = start_s, None
        self._path, self._ahead_s = path, float(known.state.mean[0])
        scan = self._scans.sensors.get(mode) or self._scans.circles.get(mode)
        if mode == Mode.SEARCH:
            self._pattern = self._search(start_s, known, sky, wider, uncertain)
        elif mode == Mode.PROGRAM_TRACK:
            self._pattern = self._scans.program.offset if self._scans.program else None
        else:
            self._pattern = None if scan is None else scan.pattern()
        self.running = mode if self._pattern is not None else ""

    def share(self, target: Motion, limits: AxisRates) -> Array:
        """Return the share (n,) of the running scan that the azimuth can add to the motion.

        Near the zenith a step across the line of sight is 1 / cos(elevation) of azimuth, and the
        target needs the axis for itself.  A search is not a scan: its way must not change.
        """
        if self.running == Mode.SEARCH:
            return np.ones(len(target.position))
        left = [
            most - np.abs(part[:, 0])
            for most, part in zip((limits.rate_rad_s[0], limits.acceleration_rad_s2[0]), target[1:], strict=True)
        ]
        needed = np.array(self._scans.demand(self.running))[:, None]
        room = np.array(left) * np.abs(np.cos(target.position[:, 1])) / np.maximum(needed, 1e-12)
        return np.asarray(np.clip(room.min(axis=0), 0.0, 1.0))

    @property
    def end_s(self) -> float:
        """When the scan on command that runs is over, infinite without one."""
        program = self._scans.program if self.running == Mode.PROGRAM_TRACK else None
        return math.inf if program is None else self._start_s + program.duration_s

    def at(self, times: Array, sky: SkyMotion | None) -> tuple[Array, Array]:
        """Return offset and rate (n, 2) at `times` (n,), `sky` (n,) the target's motion there."""
        assert self._pattern is not None
        values = np.array([self._pattern(float(t) - self._start_s) for t in times])
        if self._per_track is None or sky is None:
            return values[:, :2], values[:, 2:]
        state = values * np.array([*self._per_track, *self._per_track])
        if self._path is not None:
            return self._along_path(times, state, sky)
        rows = direction_rows(sky)[:, :, :2]
        offset, rate = (np.einsum("nij,nj->ni", rows, part) for part in (state[:, :2], state[:, 2:]))
        # The track turns while it is searched along.
        if len(times) > 2:
            rate = rate + np.einsum("nij,nj->ni", np.gradient(rows, times, axis=0, edge_order=2), state[:, :2])
        return offset, rate

    def _along_path(self, times: Array, state: Array, sky: SkyMotion) -> tuple[Array, Array]:
        """Return offset and rate (n, 2) of a search in s along and m left of the pass."""
        assert self._path is not None
        known, motion = self._path.moved(times, self._ahead_s)
        there, moved = self._path.moved(times, self._ahead_s + state[:, 0])
        left = direction_rows(SkyMotion(moved[:, 0], moved[:, 1], sky.range_m))[:, :, 1]
        offset = there - known + left * state[:, 1:2]
        return offset, moved * (1.0 + state[:, 2:3]) - motion + left * state[:, 3:4]

    def _search(
        self, t_s: float, known: TrimFilter, sky: SkyMotion | None, wider: int, uncertain: bool
    ) -> Pattern:  # fmt: skip
        params = self._scans.spiral
        params = params.replace(sigmas=min(wider * params.sigmas, 10.0))
        beamwidth = params.half_power_beamwidth_rad
        if (known.state.used or uncertain) and sky is not None:
            sigma = math.sqrt(
                float(np.max(np.linalg.eigvalsh(known.trim(t_s, SkyMotion(*_first(sky))).covariance_rad2)))
            )
            # Where the target stands a spiral is all there is, however long.
            longest = min(MOST_TURNS * params.pitch_beamwidths * beamwidth / params.sigmas, LARGEST_SIGMA_RAD)
            most = longest if uncertain else params.uncertainty_rad
            params = params.replace(uncertainty_rad=min(max(sigma, LEAST_SIGMA_BEAMWIDTHS * beamwidth), most))
        spiral = SpiralSearch(params)
        if spiral.duration_s <= LONGEST_SPIRAL_S or sky is None:
            return spiral.offset
        return self._strips(t_s, known, sky, params) or spiral.offset

    def _strips(self, t_s: float, known: TrimFilter, sky: SkyMotion, params: SpiralParams) -> Pattern | None:
        """Return the search in strips: seconds along the track, metres across it."""
        right, up, range_m = _first(sky)
        speed = math.hypot(right, up)
        if speed < SLOWEST_RAD_S:
            return None
        covariance, least = known.trim(t_s, SkyMotion(right, up, range_m)).covariance_rad2, LEAST_SIGMA_BEAMWIDTHS
        ahead, left = np.array([right, up]) / speed, np.array([-up, right]) / speed
        along, across = (
            params.sigmas * max(math.sqrt(float(axis @ covariance @ axis)), least * params.half_power_beamwidth_rad)
            for axis in (ahead, left)
        )
        pitch = params.pitch_beamwidths * params.half_power_beamwidth_rad
        self._per_track = 1.0 / speed, range_m
        return StripSearch(along, across, pitch, params.rate_rad_s, params.acceleration_rad_s2).offset


def _first(sky: SkyMotion) -> tuple[float, float, float]:
    right, up, range_m = (float(np.ravel(np.asarray(part))[0]) for part in sky)
    return right, up, range_m


def sensor_cost(
    sensor: SensorTraits | None, scans: Scans, trim: TrimParams, table: AutotrackParams, sky: SkyMotion
) -> SensorCost:
    """Return what a sensor costs on a pass that rises with the motion `sky`; None: ephemeris only.

    The target is looked for where the filter expects it before anything was received: a normal
    distribution, whose search is flown to `RINGS` x `SPOKES` of its directions.  Without a sensor
    the error of the prediction stays: E[g] = det(1 + 2 mu Sigma / h^2)^(-1/2).
    """
    beamwidth, prior = scans.spiral.half_power_beamwidth_rad, TrimFilter(trim)
    covariance = prior.trim(0.0, SkyMotion(*_first(sky))).covariance_rad2
    if sensor is None:
        # Nine targets of ten are nearer than this, if both axes are as wide as the wider one.
        sigma = math.sqrt(float(np.linalg.eigvalsh(covariance)[-1]))
        power = _mean_power(covariance, beamwidth)
        worst = float(received_power(math.sqrt(-2.0 * math.log(0.1)) * sigma, beamwidth))
        return SensorCost(power=power, power_90=min(worst, power))
    search = ScanPatterns(scans)
    search.begin(Mode.SEARCH, 0.0, prior, sky)
    # A scan begins with a carrier as weak as `beam_drop_db`, a stare within half power.
    dropped = math.sqrt(table.beam_drop_db * math.log(10.0) / (10.0 * MU))
    at_once = beamwidth * dropped if sensor.scans else 0.5 * beamwidth
    times = np.arange(0.0, table.search_s, SAMPLE_S)
    track = search.at(times, SkyMotion(*(np.full(len(times), part) for part in _first(sky))))[0]
    taken = []
    for target in (np.linalg.cholesky(covariance + 1e-18 * np.eye(2)) @ unit_targets()).T:
        if float(np.hypot(*target)) <= at_once:
            taken.append(0.0)
            continue
        passed = np.hypot(*(track - target).T) <= 0.5 * beamwidth
        found_s = float(times[np.argmax(passed)]) if passed.any() else table.search_s
        # Only one turn later is it known that the carrier was strongest there.
        taken.append(table.settle_s + found_s + (table.search_turn_s if sensor.scans else 0.0))
    return held_cost(sensor, scans, prior, table, taken)


def unit_targets() -> Array:
    """Return the directions (2, targets) that stand for all, in sigmas."""
    quantiles = (np.arange(RINGS) + 0.5) / RINGS
    radius, angle = np.sqrt(-2.0 * np.log1p(-quantiles)), 2.0 * math.pi * (np.arange(SPOKES) + 0.5) / SPOKES
    return np.stack([np.outer(radius, np.cos(angle)).ravel(), np.outer(radius, np.sin(angle)).ravel()])


def held_cost(
    sensor: SensorTraits, scans: Scans, prior: TrimFilter, table: AutotrackParams, taken: Sequence[float] | Array
) -> SensorCost:
    """Return what a sensor costs that needs these times (targets,) until it holds its target."""
    scan, power = ScanPatterns(scans), 1.0
    scan.begin(sensor.name, 0.0, prior, None)
    if scan.running:
        offsets = scan.at(RAMPED_S + np.arange(0.0, SCAN_S, SAMPLE_S), None)[0]
        power = float(np.mean(received_power(np.hypot(*offsets.T), scans.spiral.half_power_beamwidth_rad)))
    mean_s, most_s = float(np.mean(taken)), float(np.quantile(taken, PROMISED))
    return SensorCost(
        acquisition_s=mean_s, power=power, memory_s=table.coast_s, unheld_s=mean_s, unheld_90_s=most_s, power_90=power,
        search_rad_s=scans.spiral.rate_rad_s,
    )  # fmt: skip


def array_cost(
    array: DishArrayParams, loop: TrackerIntegratorParams, table: AutotrackParams, levels_db_hz: list[float],
    beamwidth_rad: float, program: SensorCost,
) -> SensorCost:  # fmt: skip
    """Return what an array on the dish costs on a pass whose link gives these C/N0, even in time.

    The loop is flown against the noise of the array at the quantiles of the C/N0: noise beyond
    `acceleration_rad_s2` makes the loop slower than its bandwidth, and less damped.  Where the
    array has no carrier the pass costs what `program` track does.  An array needs no search: it
    sees most of the sky.
    """
    shares = (np.arange(PARTS) + 0.5) / PARTS
    parts = np.quantile(levels_db_hz, shares)
    heard = parts + table.array_gain_db >= table.array_off_db_hz
    powers = np.full(PARTS, program.power)
    if heard.any():
        noise, bias = np.array([direction_sigmas_rad(array, level) for level in parts[heard].tolist()]).T
        drawn = random_stream(1, "array_cost").standard_normal((round(SCAN_S / loop.sample_s), 2 * COPIES, len(noise)))
        settled = loop_offsets_rad(loop, noise * drawn)[round(RAMPED_S / loop.sample_s) :]
        variance = np.mean(np.square(settled), axis=(0, 1))
        powers[heard] = [_mean_power(each * np.eye(2), beamwidth_rad) for each in (variance + bias**2).tolist()]
    return SensorCost(power=float(np.mean(powers)), power_90=float(np.min(powers)))


def loop_offsets_rad(params: TrackerIntegratorParams, noise_rad: Array) -> Array:
    """Return the offsets of many loops with these errors, both (n, 2 k, m) with n the samples.

    Each is what `TrackerIntegrator` makes of a target at rest, one error every `sample_s`: a row of
    the first half of the second axis is the cross-elevation of one antenna, its elevation is in the
    other half.
    """
    underway = max(round(UNDERWAY_S / params.sample_s), 1)
    offsets, errors = np.zeros_like(noise_rad), np.zeros_like(noise_rad)
    largest, most = params.acceleration_rad_s2 * params.sample_s, params.offset_limit_rad
    rate = np.zeros_like(noise_rad[0])
    for k in range(len(noise_rad)):
        if k:
            offsets[k] = np.clip(offsets[k - 1] + params.sample_s * rate, -most, most)
        errors[k] = noise_rad[k] - (offsets[k - underway] if k >= underway else 0.0)
        mean = errors[max(k + 1 - params.mean_of, 0) : k + 1].mean(axis=0)
        size = np.hypot(*np.split(mean, 2))
        acting = np.where(np.concatenate([size, size]) <= params.mean_within_rad, mean, errors[k])
        rate += np.clip(2.0 * math.pi * params.bandwidth_hz * acting - rate, -largest, largest)
    return offsets


def _mean_power(covariance_rad2: Array, beamwidth_rad: float) -> float:
    """Return E[g] of an error that is normally distributed with this covariance (2, 2)."""
    spread = np.eye(2) + 2.0 * MU * covariance_rad2 / beamwidth_rad**2
    return 1.0 / math.sqrt(float(np.linalg.det(spread)))
