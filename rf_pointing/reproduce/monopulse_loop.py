"""A Ka-band pass with everything real: servo, wind, squinted feed, receiver noise, monopulse tracker, integrator.

Per 20-ms tick: trajectory, radio offset, position loops, wind, plant, one receiver sample; every 5 samples a cluster,
whose error acts one cluster later (BWG Fig. 12).
"""

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from rf_pointing.controllers import PositionLoop, PositionLoopParams, TrackerIntegrator, TrackerIntegratorParams
from rf_pointing.geometry import random_stream
from rf_pointing.reproduce.servo_trajectory import LowOrbitPass
from rf_pointing.rf import Beam, BeamParams, MonopulseFeed, MonopulseFeedParams, Receiver, ReceiverParams
from rf_pointing.servo import AntennaPlant, PlantParams, Wind, WindParams, dss13_plant
from rf_pointing.tracking import LockWatch, LockWatchParams, MonopulseParams, MonopulseTracker

__all__ = ["MonopulsePass", "PassResult", "fly_monopulse"]

Array = NDArray[np.float64]

TICK_S = 0.02
CLUSTER = 5


@dataclass(frozen=True, kw_only=True)
class MonopulsePass:
    """What a pass is made of; `late_s` is how far the satellite runs behind the ephemeris.

    From `flip_s` on the receiver gives both differences with the wrong sign.
    """

    plant: PlantParams = field(default_factory=dss13_plant)
    loop: PositionLoopParams = field(default_factory=PositionLoopParams)
    orbit: LowOrbitPass = field(default_factory=LowOrbitPass)
    start_s: float = -120.0
    end_s: float = 120.0
    bandwidth_hz: float = 0.0
    level_db_hz: float = 45.0
    late_s: float = 0.0
    wind_m_s: float = 0.0
    flip_s: float = math.inf
    settle_s: float = 30.0
    seed: int = 1


@dataclass(frozen=True, slots=True)
class PassResult:
    """Target minus beam (n, 2) in cross-elevation and elevation after settling, valid share, first fault and its time."""

    error_rad: Array
    valid_share: float
    fault: str
    fault_s: float

    @property
    def radial_rms_rad(self) -> float:
        """Total radial error, rms."""
        return float(np.sqrt(np.mean(np.sum(self.error_rad**2, axis=1))))

    @property
    def axis_rms_rad(self) -> Array:
        """Error of each axis, rms (2,)."""
        return np.asarray(np.sqrt(np.mean(self.error_rad**2, axis=0)))


class _Radio:
    """Receiver, tracker, watch and integrator of one pass; the last error waits one cluster before it acts."""

    def __init__(self, setup: MonopulsePass) -> None:
        beam = BeamParams.for_band("Ka")
        h = beam.half_power_beamwidth_rad
        random = random_stream(setup.seed, "receiver")
        feeds = [MonopulseFeed(MonopulseFeedParams(difference_phase_rad=(p, p)), beam) for p in (0.0, math.pi)]
        self._receiver = Receiver(ReceiverParams(), Beam(beam), feeds[0], random)
        self._flipped = feeds[1]
        self._tracker = MonopulseTracker(MonopulseParams(half_power_beamwidth_rad=h))
        self._watch = LockWatch(LockWatchParams(half_power_beamwidth_rad=h))
        self.integrator = TrackerIntegrator(
            TrackerIntegratorParams(bandwidth_hz=setup.bandwidth_hz, sample_s=CLUSTER * TICK_S)
        )
        self.integrator.reset(setup.start_s)
        self._setup = setup
        self._samples: list[tuple[float, float, float, float, float]] = []
        self._pending: Array | None = None
        self.used = self.taken = 0
        self.fault, self.fault_s = "", math.inf

    def sample(self, t_s: float, miss: Array, beam_from_ephemeris: Array) -> None:
        self._samples.append((t_s, *miss, *beam_from_ephemeris))
        if len(self._samples) < CLUSTER:
            return
        if t_s >= self._setup.flip_s:
            self._receiver.feed = self._flipped
        times, x, y, u, v = np.array(self._samples).T
        self._samples.clear()
        cluster = self._receiver.cluster(times, x, y, self._setup.level_db_hz, TICK_S)
        error = self._tracker.measure(cluster)
        if self._pending is not None:
            self.integrator.update(t_s, self._pending)
        self._pending = np.array([error.cross_elevation_rad, error.elevation_rad]) if error.valid else None
        self.taken, self.used = self.taken + 1, self.used + error.valid
        fault = self._watch.add(error, float(u.mean()), float(v.mean()))
        if fault and not self.fault:
            self.fault, self.fault_s = fault, t_s


def fly_monopulse(setup: MonopulsePass) -> PassResult:
    """Run one pass; it ends early at the first fault the watch reports."""
    count = round((setup.end_s - setup.start_s) / TICK_S)
    times = setup.start_s + TICK_S * np.arange(count + 1)
    ephemeris, truth = setup.orbit.at(times), setup.orbit.at(times - setup.late_s)
    plant = AntennaPlant(setup.plant, random_stream(setup.seed, "encoder"), ephemeris.position_rad[0])
    wind = Wind(WindParams(mean_speed_m_s=setup.wind_m_s), random_stream(setup.seed, "wind"))
    loops = [PositionLoop(setup.loop, TICK_S) for _ in (0, 1)]
    radio = _Radio(setup)
    state = plant.state
    state.x[2:4] = ephemeris.velocity_rad_s[0]
    plant.state = state
    for axis, loop in enumerate(loops):
        start, rate = ephemeris.position_rad[0, axis], ephemeris.velocity_rad_s[0, axis]
        loop.reset(start, rate, start, rate)
    errors = np.empty((count, 2))
    for k in range(count):
        position, velocity = ephemeris.position_rad[k], ephemeris.velocity_rad_s[k]
        measured = plant.encoder_rad
        offset, rate = radio.integrator.at(float(times[k]))
        cosine = math.cos(position[1])
        climb = velocity[1] * math.tan(position[1])
        command = position + offset / (cosine, 1.0)
        command_rate = velocity + (rate + offset * (climb, 0.0)) / (cosine, 1.0)
        applied = [
            loop.output(command[i], command_rate[i], measured[i], ephemeris.acceleration_rad_s2[k, i])
            for i, loop in enumerate(loops)
        ]
        plant.step(applied, wind.step(TICK_S, position[0], position[1]), TICK_S)
        for loop, got in zip(loops, applied, strict=True):
            loop.update(TICK_S, got)
        sky = np.array([math.cos(truth.position_rad[k + 1, 1]), 1.0])
        errors[k] = (truth.position_rad[k + 1] - plant.beam_rad) * sky
        radio.sample(float(times[k + 1]), errors[k], (plant.encoder_rad - ephemeris.position_rad[k + 1]) * sky)
        if radio.fault:
            errors = errors[: k + 1]
            break
    settled = errors[round(setup.settle_s / TICK_S) :]
    return PassResult(settled, radio.used / max(radio.taken, 1), radio.fault, radio.fault_s)
