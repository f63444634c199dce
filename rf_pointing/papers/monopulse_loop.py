"""A Ka-band pass with everything real: servo, wind, squinted feed, receiver noise, monopulse
tracker, integrator.

Per 20-ms tick: trajectory, radio offset, command preprocessor, position loops, wind, plant, one
receiver sample; every 5 samples a cluster, whose error acts one cluster later (BWG Fig. 12).
"""

import math
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from rf_pointing.controllers import (
    CommandPreprocessor,
    CommandPreprocessorParams,
    PositionLoop,
    PositionLoopParams,
    TrackerIntegrator,
    TrackerIntegratorParams,
)
from rf_pointing.core import AXES, random_stream
from rf_pointing.core.types import Array
from rf_pointing.papers.bare_antenna import BareAntenna, LawsOnCommand
from rf_pointing.papers.servo_trajectory import LowOrbitPass, MotionTable
from rf_pointing.rf import (
    Beam,
    BeamParams,
    MonopulseFeed,
    MonopulseFeedParams,
    Receiver,
    ReceiverParams,
)
from rf_pointing.servo import AntennaPlant, PlantParams, Wind, WindParams, dss13_plant
from rf_pointing.simulation.closed_loop import ticks
from rf_pointing.tracking import LockWatch, LockWatchParams, MonopulseParams, MonopulseTracker

TICK_S = 0.02
CLUSTER = 5
KA = BeamParams.for_band("Ka")


@dataclass(frozen=True, kw_only=True)
class MonopulsePass:
    """Parts of a pass; `late_s` is how far the satellite runs behind the ephemeris."""

    plant: PlantParams = field(default_factory=dss13_plant)
    loop: PositionLoopParams = field(default_factory=PositionLoopParams)
    orbit: LowOrbitPass = field(default_factory=LowOrbitPass)
    start_s: float = -60.0
    end_s: float = 40.0
    late_s: float = 0.01
    wind_m_s: float = 0.0
    settle_s: float = 30.0
    seed: int = 1

    def ephemeris(self) -> MotionTable:
        """Return the predicted motion at every tick."""
        count = round((self.end_s - self.start_s) / TICK_S)
        return self.orbit.at(self.start_s + TICK_S * np.arange(count + 1))


@dataclass(frozen=True, slots=True)
class PassLog:
    """Target minus beam (n, 2) in cross-elevation and elevation, and the command's velocity (n, 2),
    at `t_s` (n,).
    """

    t_s: Array
    error_rad: Array
    command_velocity_rad_s: Array
    transparent: NDArray[np.bool_]

    def rms_rad(self, settle_s: float) -> tuple[Array, float]:
        """Return the rms error of each axis (2,) and the radial one, from `settle_s` after the
        start.
        """
        late = self.error_rad[self.t_s >= self.t_s[0] + settle_s]
        return np.sqrt(np.mean(late**2, axis=0)), float(np.sqrt(np.mean(np.sum(late**2, axis=1))))


class Radio(Protocol):
    """Radio side of the pass; `stop` ends the pass."""

    stop: bool

    def offset(self, k: int) -> tuple[Array, Array]:
        """Return what to add to the ephemeris at tick `k`, on the sky, and its rate, each (2,)."""
        ...

    def sample(self, k: int, miss_rad: Array, beam_rad: Array) -> None:
        """Take target minus beam and, from the encoders, beam minus ephemeris, both (2,) on the
        sky, at tick `k`.
        """
        ...


def ka_receiver(seed: int, phase_rad: float = 0.0) -> Receiver:
    """Return a Ka-band receiver whose differences are turned by `phase_rad` (pi: the sign is
    flipped).
    """
    feed = MonopulseFeed(MonopulseFeedParams(difference_phase_rad=(phase_rad, phase_rad)), KA)
    return Receiver(ReceiverParams(), Beam(KA), feed, random_stream(seed, "receiver"))


class PlainRadio:
    """Monopulse and integrator, without a state table; from `flip_s` on both differences have the
    wrong sign.
    """

    def __init__(
        self,
        setup: MonopulsePass,
        bandwidth_hz: float,
        level_db_hz: float = 45.0,
        flip_s: float = math.inf,
    ) -> None:
        h = KA.half_power_beamwidth_rad
        self._receiver = ka_receiver(setup.seed)
        self._flipped = ka_receiver(setup.seed, math.pi).feed
        self._tracker = MonopulseTracker(MonopulseParams(half_power_beamwidth_rad=h))
        self._watch = LockWatch(LockWatchParams(half_power_beamwidth_rad=h))
        self._integrator = TrackerIntegrator(
            TrackerIntegratorParams(bandwidth_hz=bandwidth_hz, sample_s=CLUSTER * TICK_S)
        )
        self._level_db_hz, self._flip_s = level_db_hz, flip_s
        self._samples: list[tuple[float, ...]] = []
        self._pending: Array | None = None
        self.fault, self.fault_s, self.stop = "", math.inf, False

    def offset(self, k: int) -> tuple[Array, Array]:
        """Return the integrator's offset."""
        return self._integrator.at(k * TICK_S)

    def sample(self, k: int, miss_rad: Array, beam_rad: Array) -> None:
        """Collect a cluster; measure it, let the error before act, watch for a false lock."""
        self._samples.append((k * TICK_S, *miss_rad, *beam_rad))
        if len(self._samples) < CLUSTER:
            return
        times, x, y, u, v = np.array(self._samples).T
        self._samples.clear()
        if k * TICK_S >= self._flip_s:
            self._receiver.feed = self._flipped
        error = self._tracker.measure(
            self._receiver.cluster(times, x, y, self._level_db_hz, TICK_S)
        )
        if self._pending is not None:
            self._integrator.update(k * TICK_S, self._pending)
        self._pending = (
            np.array([error.cross_elevation_rad, error.elevation_rad]) if error.valid else None
        )
        self.fault = self._watch.add(error, float(u.mean()), float(v.mean()))
        if self.fault:
            self.fault_s, self.stop = k * TICK_S, True


def fly(setup: MonopulsePass, radio: Radio) -> PassLog:
    """Run one pass to its end, or until the radio stops it."""
    ephemeris, truth = setup.ephemeris(), setup.orbit.at(setup.ephemeris().t_s - setup.late_s)
    count = len(ephemeris.t_s) - 1
    plant = AntennaPlant(
        setup.plant, random_stream(setup.seed, "encoder"), ephemeris.position_rad[0]
    )
    wind = Wind(WindParams(mean_speed_m_s=setup.wind_m_s), random_stream(setup.seed, "wind"))
    preprocessor = CommandPreprocessor(CommandPreprocessorParams())

    def command(k: int) -> tuple[Array, Array, Array]:
        """Return what the axes can do of ephemeris plus radio offset."""
        return preprocessor.step(*_command(ephemeris, k, *radio.offset(k)), TICK_S)

    laws = LawsOnCommand([PositionLoop(setup.loop, TICK_S) for _ in AXES], TICK_S, command)
    preprocessor.reset(ephemeris.position_rad[0], ephemeris.velocity_rad_s[0])
    laws.settle(plant, ephemeris.position_rad[0], ephemeris.velocity_rad_s[0])
    errors, velocities, transparent = (
        np.empty((count, 2)),
        np.empty((count, 2)),
        np.empty(count, dtype=bool),
    )
    for k, _ in ticks(
        BareAntenna(plant, wind, TICK_S, laws, lambda k: ephemeris.position_rad[k]), count
    ):
        # A copy of all of it, at each look.
        done = preprocessor.state
        velocities[k], transparent[k] = done.velocity_rad_s, all(done.transparent)
        sky = np.array([math.cos(truth.position_rad[k + 1, 1]), 1.0])
        errors[k] = (truth.position_rad[k + 1] - plant.beam_rad) * sky
        radio.sample(k + 1, errors[k], (plant.encoder_rad - ephemeris.position_rad[k + 1]) * sky)
        if radio.stop:
            return PassLog(
                ephemeris.t_s[1 : k + 2], errors[: k + 1], velocities[: k + 1], transparent[: k + 1]
            )
    return PassLog(ephemeris.t_s[1:], errors, velocities, transparent)


def _command(
    ephemeris: MotionTable, k: int, offset: Array, rate: Array
) -> tuple[Array, Array, Array]:
    """Ephemeris plus sky offset at tick `k`, in axis angles."""
    position, velocity = ephemeris.position_rad[k], ephemeris.velocity_rad_s[k]
    cosine = math.cos(position[1])
    turn = rate[0] + offset[0] * velocity[1] * math.tan(position[1])
    return (
        position + np.array([offset[0] / cosine, offset[1]]),
        velocity + np.array([turn / cosine, rate[1]]),
        ephemeris.acceleration_rad_s2[k],
    )
