"""An antenna that tests step through time, and commands for it."""

import math
from typing import Any

import numpy as np

from rf_pointing.core import MDEG, JointTrajectory
from rf_pointing.servo import WindParams
from rf_pointing.station.antenna.simulated_antenna import AntennaParams, SimulatedAntenna, SimulationParams

TICK_S = SimulationParams().tick_s
START_S = 1_151_384_000.0
STANDING = np.radians([120.0, 60.0])
CALM = WindParams(mean_speed_m_s=0.0)
ENCODER_RAD = 0.2 * MDEG
"""An antenna that holds in calm air stays within its encoder's quantisation and noise."""
SETTLING_S = 30.0
"""The position loop of the paper's gains (0.5, 1.8) rings at 1.34 rad/s and decays with 0.25 1/s."""


def antenna(wind: WindParams = CALM, **changes: Any) -> SimulatedAntenna:
    start = SimulationParams(start_azimuth_rad=STANDING[0], start_elevation_rad=STANDING[1])
    return SimulatedAntenna(AntennaParams(**{"antenna": start, "wind": wind, **changes}))


class Clock:
    """Steps an antenna from `START_S` on and keeps what it said."""

    def __init__(self, stepped: SimulatedAntenna) -> None:
        self.antenna, self.ticks = stepped, 0
        self.position: list[np.ndarray] = []
        self.commanded: list[np.ndarray] = []
        self.modes: list[str] = []

    @property
    def t_s(self) -> float:
        return round(START_S + self.ticks * TICK_S, 6)

    def run(self, seconds: float) -> None:
        for _ in range(round(seconds / TICK_S)):
            self.ticks += 1
            self.antenna.step(self.t_s)
            self.position.append(self.antenna.reading(self.t_s).position_rad)
            self.commanded.append(self.antenna.status(self.t_s).commanded_rad)
            self.modes.append(self.antenna.mode)

    def rates(self) -> np.ndarray:
        return np.diff(np.array(self.commanded), axis=0) / TICK_S


def ramp(
    begin_s: float, seconds: float = 1.0, rate_rad_s: float = math.radians(0.3), lead_s: float = 0.1
) -> JointTrajectory:
    """A command that starts at the standing position at `START_S` and moves both axes at a steady rate."""
    times = begin_s + lead_s + np.arange(0.0, seconds - lead_s + 1e-9, 0.1)
    rates = np.tile([rate_rad_s, -rate_rad_s], (len(times), 1))
    return JointTrajectory(
        t_s=times, position_rad=STANDING + rates * (times - START_S)[:, None], velocity_rad_s=rates,
        acceleration_rad_s2=np.zeros_like(rates),
    )  # fmt: skip


def hold_at(t_s: float, position: np.ndarray) -> JointTrajectory:
    zero = np.zeros((1, 2))
    return JointTrajectory(t_s=[t_s], position_rad=position[None, :], velocity_rad_s=zero, acceleration_rad_s2=zero)


def enabled(**changes: Any) -> Clock:
    clock = Clock(antenna(**changes))
    clock.antenna.enable()
    return clock
