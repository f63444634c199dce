"""A pass with the real code: plant, position loops and radio integrator at their sampling rates,
wind and noise.

Per 20-ms tick: trajectory, radio offset, position loops on the encoders, wind, plant.  The radio
error is measured at its own period and acts after its delay (BWG Fig. 12).
"""

import math
from dataclasses import dataclass, field

import numpy as np

from rf_pointing.controllers import (
    LqgDesign,
    LqgLoop,
    LqgLoopParams,
    PositionLoop,
    PositionLoopParams,
    TrackerIntegrator,
    TrackerIntegratorParams,
)
from rf_pointing.core import random_stream
from rf_pointing.core.second_stage import SecondStageParams
from rf_pointing.core.types import Array
from rf_pointing.papers.bare_antenna import BareAntenna, LawsOnCommand
from rf_pointing.papers.servo_trajectory import LowOrbitPass
from rf_pointing.servo import AntennaPlant, PlantParams, Wind, WindParams, dss13_plant
from rf_pointing.servo.second_stage import StagePlant
from rf_pointing.simulation.closed_loop import ticks
from rf_pointing.station.antenna.second_stage import StageLoop
from rf_pointing.station.antenna.stage_design import StageDesign

Law = PositionLoopParams | tuple[LqgDesign, LqgLoopParams]

TICK_S = 0.02


@dataclass(frozen=True, kw_only=True)
class PassSetup:
    """Parts of a run; `late_s` is how far the target's azimuth and elevation run behind the
    ephemeris.

    `cluster` is the number of latest radio samples that are averaged, 0 or 1 for none, `mean_of`
    that of latest errors.  `settled` starts the antenna in motion with the target; otherwise it
    starts at rest on the first point.
    """

    plant: PlantParams = field(default_factory=lambda: dss13_plant(ideal=True))
    loops: tuple[Law, Law] = (PositionLoopParams(), PositionLoopParams())
    orbit: LowOrbitPass = field(default_factory=LowOrbitPass)
    start_s: float = -300.0
    end_s: float = 300.0
    bandwidth_hz: float = 0.0
    radio_period_s: float = 0.1
    radio_delay_s: float = 0.1
    radio_noise_rad: float = 0.0
    cluster: int = 0
    mean_of: int = 1
    late_s: tuple[float, float] = (0.0, 0.0)
    wind: WindParams = field(default_factory=WindParams)
    settled: bool = True
    stage: StageDesign | None = None
    seed: int = 1


@dataclass(frozen=True, slots=True)
class PassErrors:
    """Errors (n, 2) in radians, order cross-elevation, elevation, at `t_s` (n,): target minus beam
    and minus encoder.

    `deviation_rad` is target minus ephemeris, `radio_rad` (m, 2) the radio errors as they reached
    the integrator.
    """

    t_s: Array
    beam_rad: Array
    encoder_rad: Array
    deviation_rad: Array
    radio_rad: Array

    def after(self, t_s: float) -> "PassErrors":
        """Return the part from `t_s` on."""
        late = self.t_s >= t_s
        return PassErrors(
            self.t_s[late],
            self.beam_rad[late],
            self.encoder_rad[late],
            self.deviation_rad[late],
            self.radio_rad,
        )


def fly(setup: PassSetup) -> PassErrors:
    """Run one pass and return its errors at every tick."""
    count = round((setup.end_s - setup.start_s) / TICK_S)
    times = setup.start_s + TICK_S * np.arange(count + 1)
    ephemeris = setup.orbit.at(times)
    truth = np.column_stack(
        [
            setup.orbit.at(times - late).position_rad[:, axis]
            for axis, late in enumerate(setup.late_s)
        ]
    )
    radio = _Radio(setup)
    device = StagePlant(setup.stage.params if setup.stage else SecondStageParams())
    stage = StageLoop(device, setup.stage) if setup.stage else None
    plant = AntennaPlant(
        setup.plant, random_stream(setup.seed, "encoder"), ephemeris.position_rad[0]
    )
    wind = Wind(setup.wind, random_stream(setup.seed, "wind"))

    def beam_rad() -> Array:
        """Return the axis angles (2,) of the beam, a second stage's part included."""
        angles = plant.beam_rad
        return angles if stage is None else angles + stage.axes_rad(float(angles[1]))

    def command(k: int) -> tuple[Array, Array, Array]:
        """Return ephemeris plus radio offset in axis angles, after the radio has measured at this
        tick.
        """
        radio.tick(k, truth[k] - beam_rad(), math.cos(ephemeris.position_rad[k, 1]))
        offset, rate = radio.at(k)
        if stage is not None:
            wanted = ephemeris.position_rad[k] + offset
            stage.tick(TICK_S, wanted, plant.encoder_rad, tracking=True)
        return (
            ephemeris.position_rad[k] + offset,
            ephemeris.velocity_rad_s[k] + rate,
            ephemeris.acceleration_rad_s2[k],
        )

    laws = LawsOnCommand(
        [
            PositionLoop(law, TICK_S) if isinstance(law, PositionLoopParams) else LqgLoop(*law)
            for law in setup.loops
        ],
        TICK_S,
        command,
    )
    if setup.settled:
        laws.settle(plant, ephemeris.position_rad[0], ephemeris.velocity_rad_s[0])
    beam, encoder = np.zeros((count, 2)), np.zeros((count, 2))
    for k, _ in ticks(
        BareAntenna(plant, wind, TICK_S, laws, lambda k: ephemeris.position_rad[k]), count
    ):
        if stage is not None:
            device.step(TICK_S)
        beam[k] = truth[k + 1] - beam_rad()
        encoder[k] = ephemeris.position_rad[k + 1] - plant.true_joint_rad
    later = slice(1, count + 1)
    sky = np.column_stack([np.cos(truth[later, 1]), np.ones(count)])
    deviation = (truth - ephemeris.position_rad)[later]
    return PassErrors(
        np.asarray(times[later]),
        beam * sky,
        encoder * sky,
        deviation * sky,
        np.array(radio.taken).reshape(-1, 2),
    )


class _Radio:
    """Radio errors from measurement to command: noise, cluster average, delay, integrator."""

    def __init__(self, setup: PassSetup) -> None:
        self._setup = setup
        self._period = round(setup.radio_period_s / TICK_S)
        self._delay = round(setup.radio_delay_s / TICK_S)
        self._random = random_stream(setup.seed, "radio")
        self._on = setup.bandwidth_hz > 0.0
        self._integrator = TrackerIntegrator(
            TrackerIntegratorParams(
                bandwidth_hz=setup.bandwidth_hz,
                sample_s=setup.radio_period_s,
                mean_of=setup.mean_of,
            )
        )
        self._samples: list[Array] = []
        self._due: list[tuple[int, Array]] = []
        self.taken: list[Array] = []

    def tick(self, k: int, joint_error: Array, scale: float) -> None:
        """Measure at tick `k` the error (2,) of the axes; hand on what has waited out the delay."""
        if not self._on:
            return
        noise = self._setup.radio_noise_rad
        if noise > 0.0:
            joint_error = joint_error + noise * self._random.standard_normal(2) / np.array(
                [scale, 1.0]
            )
        self._samples.append(joint_error)
        if (k + 1) % self._period == 0:
            last = self._samples[-max(1, self._setup.cluster) :]
            self._due.append((k + self._delay, np.mean(last, axis=0)))
            self._samples.clear()
        while self._due and self._due[0][0] <= k:
            error = self._due.pop(0)[1]
            self.taken.append(error)
            self._integrator.update(k * TICK_S, error)

    def at(self, k: int) -> tuple[Array, Array]:
        """Return the offsets (2,) and their rates (2,) of both axes at tick `k`."""
        return self._integrator.at(k * TICK_S) if self._on else (np.zeros(2), np.zeros(2))
