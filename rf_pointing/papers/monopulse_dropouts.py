"""A Ka-band pass with random carrier dropouts: state table, trim filter, coast, search, monopulse.

While the carrier is there the integrator of the sensed error carries the whole offset, and the trim
filter learns from it.  Without a carrier the offset follows the filter, from the integrator's last
value: offset = trim + (last - trim) e^(-t/3 s).
"""

import math

import numpy as np

from rf_pointing.controllers import TrackerIntegrator, TrackerIntegratorParams
from rf_pointing.core import MDEG, PointingError, Sensor, random_stream
from rf_pointing.core.types import Array
from rf_pointing.papers.monopulse_loop import CLUSTER, TICK_S, MonopulsePass, ka_receiver
from rf_pointing.rf import HALF_POWER_BEAMWIDTH_RAD, DropoutParams, Dropouts
from rf_pointing.tracking import (
    Autotrack,
    AutotrackInputs,
    AutotrackParams,
    AutotrackState,
    MonopulseParams,
    MonopulseTracker,
    SkyMotion,
    SpiralParams,
    SpiralSearch,
    TrimFilter,
    TrimParams,
)
from rf_pointing.tracking.trim import Trim

BEAM_RAD = HALF_POWER_BEAMWIDTH_RAD["Ka"]
# Long against the antenna's response, short against a pass: the command stays smooth without
# keeping an old error.
FORGET_S = 3.0
EARTH_M = 6.371e6


class AutotrackRadio:
    """The radio side of a pass under the state table; `dropouts` take the carrier away."""

    stop = False

    def __init__(
        self, setup: MonopulsePass, bandwidth_hz: float, level_db_hz: float, dropouts: Dropouts
    ) -> None:
        self._ephemeris, self._height_m = setup.ephemeris(), setup.orbit.altitude_m
        self._level_db_hz, self._dropouts = level_db_hz, dropouts
        self._receiver = ka_receiver(setup.seed)
        self._tracker = MonopulseTracker(MonopulseParams(half_power_beamwidth_rad=BEAM_RAD))
        self._integrator = TrackerIntegrator(
            TrackerIntegratorParams(bandwidth_hz=bandwidth_hz, sample_s=CLUSTER * TICK_S)
        )
        self._filter = TrimFilter(TrimParams())
        self._table = Autotrack(AutotrackParams(sensor="monopulse"))
        self.state = AutotrackState(mode="program_track")
        self._samples: list[tuple[float, ...]] = []
        self._pending: Array | None = None
        self._held, self._held_s = np.zeros(2), 0.0
        self._spiral: SpiralSearch | None = None
        self._spiral_s = 0.0
        self.modes: list[tuple[float, str]] = []

    def offset(self, k: int) -> tuple[Array, Array]:
        """Return the integrator's offset while tracking, else trim, what is left of the
        integrator's, and spiral.
        """
        if self.state.integrating:
            return self._integrator.at(k * TICK_S)
        now, later = self._free(k), self._free(k + 1)
        return now, (later - now) / TICK_S

    def sample(self, k: int, miss_rad: Array, beam_rad: Array) -> None:
        """Collect a cluster; measure it and let the table decide."""
        t_s = float(self._ephemeris.t_s[k])
        self._samples.append((t_s, *miss_rad, *beam_rad))
        if len(self._samples) < CLUSTER:
            return
        times, x, y, u, v = np.array(self._samples).T
        self._samples.clear()
        level = self._dropouts.level_db_hz(times, np.full(CLUSTER, self._level_db_hz))
        error = self._tracker.measure(self._receiver.cluster(times, x, y, level, TICK_S))
        self._decide(k, error)
        if self.state.integrating and self._pending is not None:
            self._integrator.update(k * TICK_S, self._pending)
        self._pending = None
        if self.state.integrating and error.valid:
            self._pending = np.array([error.cross_elevation_rad, error.elevation_rad])
            seen = np.array([u.mean(), v.mean()]) + self._pending
            self._filter.update(error.t_s, seen, error.covariance_rad2, self._sky(k))

    def _decide(self, k: int, error: PointingError) -> None:
        # The simulated station is always on target here: this run measures the radio side alone.
        inputs = AutotrackInputs(
            t_s=float(self._ephemeris.t_s[k]), request="track", target_available=True, on_target=True,
            carrier_to_noise_db_hz=error.carrier_to_noise_db_hz,
            valid=frozenset({Sensor.MONOPULSE, Sensor.CONSCAN} if error.valid else {Sensor.CONSCAN}),
        )  # fmt: skip
        before = self.state
        # Not by `offset`, whose rate needs the next tick: the last one of a pass has none.
        total = self._integrator.at(k * TICK_S)[0] if before.integrating else self._free(k)
        self.state = self._table.step(before, inputs)
        if self.state.mode == before.mode and self.state.integrating == before.integrating:
            return
        self.modes.append((inputs.t_s, self.state.mode))
        if self.state.integrating:
            self._integrator.reset(k * TICK_S, total)
            self._spiral = None
            return
        self._spiral = None
        # The offset continues from where it is: only the difference to the trim filter fades.
        self._held, self._held_s = total - self._trim(k).offset_rad, k * TICK_S
        if self.state.mode == "search":
            self._spiral, self._spiral_s = self._search(k), k * TICK_S

    def _search(self, k: int) -> SpiralSearch:
        """Return a spiral sized from what the filter knows, slow enough for the structure of a 34-m
        dish.
        """
        sigma = math.sqrt(float(np.max(np.linalg.eigvalsh(self._trim(k).covariance_rad2))))
        return SpiralSearch(
            SpiralParams(
                half_power_beamwidth_rad=BEAM_RAD, uncertainty_rad=sigma, rate_rad_s=20.0 * MDEG,
                acceleration_rad_s2=20.0 * MDEG,
            )
        )  # fmt: skip

    def _free(self, k: int) -> Array:
        t_s = k * TICK_S
        fading = self._held * math.exp(-max(t_s - self._held_s, 0.0) / FORGET_S)
        spiral = (
            np.zeros(2)
            if self._spiral is None
            else np.array(self._spiral.offset(t_s - self._spiral_s)[:2])
        )
        return np.asarray(self._trim(k).offset_rad + fading + spiral)

    def _trim(self, k: int) -> Trim:
        return self._filter.trim(float(self._ephemeris.t_s[k]), self._sky(k))

    def _sky(self, k: int) -> SkyMotion:
        elevation = float(self._ephemeris.position_rad[k, 1])
        azimuth_rate, elevation_rate = self._ephemeris.velocity_rad_s[k]
        # Range from elevation and height over a spherical Earth: the filter needs its order of size
        # only.
        up = EARTH_M * math.sin(elevation)
        range_m = math.sqrt(up**2 + 2.0 * EARTH_M * self._height_m + self._height_m**2) - up
        return SkyMotion(float(azimuth_rate) * math.cos(elevation), float(elevation_rate), range_m)


def draw_dropouts(setup: MonopulsePass, count: int) -> Dropouts:
    """Return random dropouts of 0.5 to 20 s over the pass, the first 40 s left free."""
    return Dropouts(
        DropoutParams(count=count, gap_s=8.0),
        setup.start_s + 40.0,
        setup.end_s,
        random_stream(setup.seed, "dropouts"),
    )


def reacquisition_times_s(modes: list[tuple[float, str]], dropouts: Dropouts) -> Array:
    """Return, per dropout, the time from its end until monopulse tracks.

    `modes` are the changes of mode.
    """
    found = []
    for stop_s in dropouts.stop_s:
        # A dropout shorter than the coast may end before the mode was ever left.
        before = [mode for t_s, mode in modes if t_s <= stop_s]
        later = [t_s - stop_s for t_s, mode in modes if t_s > stop_s and mode == "monopulse"]
        found.append(0.0 if before[-1:] == ["monopulse"] else min(later, default=math.inf))
    return np.array(found)
