"""A drive that runs away on the whole simulated antenna, and none that does in hours of wind and hard motion."""

import math

import numpy as np
import pytest

from rf_pointing.core import JointTrajectory
from rf_pointing.identification import ExcitationParams, IdentificationExperiment
from rf_pointing.planning import DriveWatchParams
from rf_pointing.servo import WindParams
from rf_pointing.station.antenna.simulated_antenna import AntennaParams, SimulatedAntenna, SimulationParams

DEG = math.pi / 180.0
START_S = 1_151_384_000.0
TICK_S = SimulationParams().tick_s
WITHIN_S = 0.05


class Subject:
    """An antenna in wind under a commander that gives it something else to do every few seconds."""

    def __init__(self, wind_m_s: float, random: np.random.Generator) -> None:
        params = SimulationParams(
            start_azimuth_rad=0.0, start_elevation_rad=40.0 * DEG, seed=int(random.integers(1000))
        )
        wind = WindParams(mean_speed_m_s=wind_m_s, from_azimuth_rad=random.uniform(-3.0, 3.0))
        self.antenna = SimulatedAntenna(AntennaParams(antenna=params, wind=wind))
        self.random, self.ticks, self.most_gained = random, 0, 0.0
        self.antenna.enable()
        self.turn("stop")

    @property
    def t_s(self) -> float:
        return round(START_S + self.ticks * TICK_S, 6)

    def turn(self, what: str) -> None:
        """Begin a motion: slew to somewhere, oval, fast scan, stop, identification."""
        random, self.what, self.since_s = self.random, what, self.t_s
        self.start = self.antenna.reading(self.t_s).position_rad
        self.goal = np.array([random.uniform(-200.0, 200.0), random.uniform(10.0, 85.0)]) * DEG
        self.pace, self.size = (3.0, 0.03 * DEG) if what == "scan" else (random.uniform(0.1, 1.0), 0.5 * DEG)
        if what == "stop":
            self.antenna.stop()
        if what == "identify":
            shake = ExcitationParams(sample_s=TICK_S)
            self.antenna.identify(
                IdentificationExperiment(
                    shake, "elevation", 1, float(self.start[1]), self.antenna.axes.travel_rad[1], random
                )
            )

    def command(self) -> None:
        times = self.t_s + 0.1 * np.arange(1, 9)
        position, rate = np.tile(self.goal, (8, 1)), np.zeros((8, 2))
        if self.what != "slew":
            angle = self.pace * (times - self.since_s)
            position = self.start + self.size * np.stack([np.sin(angle), 1.0 - np.cos(angle)], axis=1)
            rate = self.size * self.pace * np.stack([np.cos(angle), np.sin(angle)], axis=1)
        self.antenna.accept(JointTrajectory(
            t_s=times, position_rad=position, velocity_rad_s=rate, acceleration_rad_s2=np.zeros((8, 2))
        ), self.t_s, "test")  # fmt: skip

    def run(self, seconds: float) -> None:
        for _ in range(round(seconds / TICK_S)):
            if self.ticks % 5 == 0 and self.what in ("slew", "oval", "scan") and self.antenna.mode != "manual_rate":
                self.command()
            self.ticks += 1
            self.antenna.step(self.t_s)
            gained = [max(drive.gained) for drive in self.antenna.safety.drive._drives]
            self.most_gained = max(self.most_gained, *gained)


@pytest.mark.parametrize("wind_m_s", [8.0, 16.0])
def test_no_wind_and_no_motion_is_taken_for_a_runaway(wind_m_s: float, random: np.random.Generator) -> None:
    """Friction, gear play, encoder steps and gusts as they are."""
    subject = Subject(wind_m_s, random)
    for block in range(12):
        subject.turn(("slew", "slew", "oval", "scan", "stop", "identify")[block % 6])
        subject.run(10.0)
        assert subject.antenna.status(subject.t_s).fault == "", subject.what
    assert subject.most_gained < DriveWatchParams().gained_rad_s


@pytest.mark.parametrize("wind_m_s", [0.0, 12.0])
@pytest.mark.parametrize("runs_deg_s", [1.9, -1.9])
def test_brakes_are_set_within_50_ms_of_a_runaways_first_motion(
    wind_m_s: float, runs_deg_s: float, random: np.random.Generator
) -> None:
    """From standing, from slow and fast motion, at any moment of it."""
    subject = Subject(wind_m_s, random)
    for what in ("stop", "oval", "oval", "scan", "scan"):
        subject.turn(what)
        subject.run(float(random.uniform(2.0, 4.0)))
        plant = subject.antenna.axes.hardware
        begun_s, where = round(subject.t_s + TICK_S, 6), plant.true_joint_rad[0] / DEG
        before = plant.velocity_rad_s[0] / DEG
        subject.antenna.injected.inject("runaway", runs_deg_s * DEG)
        while plant.powered:
            subject.run(TICK_S)
        took_s = subject.t_s + TICK_S - begun_s
        assert took_s <= WITHIN_S, what
        assert "azimuth drive runs at" in subject.antenna.status(subject.t_s).fault
        assert abs(plant.true_joint_rad[0] / DEG - where - before * took_s) < 0.003
        subject.antenna.injected.inject("none", 0.0)
        subject.run(2.0)
        assert subject.antenna.reset_fault() == ""
