"""The gate before the drives: whatever a commander asks for, mask, Sun and travel hold, and the way in stays open."""

import math
from typing import Any

import numpy as np
import pytest

from rf_pointing.core import JointTrajectory
from rf_pointing.ephemeris.solar import SolarDirection, SunParams
from rf_pointing.planning import DriveWatchParams, Gate, GateParams, HorizonMask
from rf_pointing.planning.forbidden_sky import ForbiddenSky
from rf_pointing.planning.gate import GUARD_RAD
from rf_pointing.servo import dss13_plant
from rf_pointing.station.antenna.loops import LoopParams
from rf_pointing.station.antenna.safety import SafetyParams
from rf_pointing.station.antenna.simulated_antenna import AntennaParams, SimulatedAntenna, SimulationParams

DEG = math.pi / 180.0
START_S = 1_151_384_000.0 + 12.0 * 3600.0
"""Morning at Goldstone: the Sun stands at 50 deg."""
TICK_S = SimulationParams().tick_s
HILL = HorizonMask(
    azimuth_rad=(0.0, 60.0 * DEG, 70.0 * DEG, 80.0 * DEG, 90.0 * DEG),
    elevation_rad=(0.0, 0.0, 35.0 * DEG, 35.0 * DEG, 0.0),
)
SERVO_RAD = (0.05 + 4.5 * 0.02) * DEG
"""The guard's 0.05 deg, and the drives' overshoot of 0.02 deg in each axis on a hill that rises by 3.5 deg in a degree."""


class Station:
    """An antenna with a hill in the east and the real Sun, stepped tick by tick."""

    def __init__(self, azimuth_deg: float, elevation_deg: float, **safety: Any) -> None:
        params = SimulationParams(start_azimuth_rad=azimuth_deg * DEG, start_elevation_rad=elevation_deg * DEG)
        chosen = {"mask": HILL, "sun": SunParams(watched=False), **safety}
        self.antenna = SimulatedAntenna(AntennaParams(antenna=params, safety=SafetyParams(**chosen)))
        self.sky = ForbiddenSky(chosen["mask"], self.antenna.safety.params.gate.sun_radius_rad)
        self.sun = SolarDirection(chosen["sun"])
        self.ticks, self.deepest, self.deepest_command, self.nearest = 0, -math.inf, -math.inf, math.inf
        self.antenna.enable()

    @property
    def t_s(self) -> float:
        return round(START_S + self.ticks * TICK_S, 6)

    @property
    def axes_deg(self) -> np.ndarray:
        return self.antenna.axes.hardware.true_joint_rad / DEG

    def run(self, seconds: float) -> None:
        for _ in range(round(seconds / TICK_S)):
            self.ticks += 1
            self.antenna.step(self.t_s)
            here = self.antenna.axes.hardware.true_joint_rad.tolist()
            self.deepest = max(self.deepest, self.sky.under_mask(*here))
            commanded = self.antenna.status(self.t_s).commanded_rad.tolist()
            self.deepest_command = max(self.deepest_command, self.sky.under_mask(*commanded))
            solar = self.sun.at(self.t_s)
            if solar is not None:
                self.nearest = min(self.nearest, self.sky.sun_distance(*here, solar))

    def command(self, azimuth_deg: float, elevation_deg: float, rate_deg_s: tuple[float, float] = (0.0, 0.0),
                points: int = 9) -> str:  # fmt: skip
        """Give a second of steady motion that starts there 0.1 s from now."""
        times = self.t_s + 0.1 * np.arange(1, points + 1)
        rates = np.tile(np.array(rate_deg_s) * DEG, (points, 1))
        position = np.array([azimuth_deg, elevation_deg]) * DEG + rates * 0.1 * np.arange(points)[:, None]
        return self.antenna.accept(JointTrajectory(
            t_s=times, position_rad=position, velocity_rad_s=rates, acceleration_rad_s2=np.zeros_like(rates)
        ), self.t_s, "foreign")  # fmt: skip

    def go(self, azimuth_deg: float, elevation_deg: float, seconds: float) -> str:
        """Repeat a position ten times a second for a while, as a commander does; return the last refusal."""
        refused = ""
        for _ in range(round(seconds * 10.0)):
            refused = self.command(azimuth_deg, elevation_deg) or refused
            self.run(0.1)
        return refused


def test_a_position_behind_a_hill_is_reached_over_it() -> None:
    station = Station(40.0, 10.0)
    assert station.go(110.0, 10.0, 120.0) == ""
    assert station.axes_deg == pytest.approx([110.0, 10.0], abs=0.01)
    assert station.deepest <= 0.0
    assert station.antenna.status(station.t_s).fault == ""


@pytest.mark.parametrize("rate_deg_s", [0.05, 0.5, 1.7])
def test_a_motion_that_runs_on_towards_a_hill_is_stopped_before_it_and_says_why(rate_deg_s: float) -> None:
    """Each message ends clear of the hill; where the last one would be carried on to is what only the guard sees."""
    station = Station(66.0, 39.0)
    azimuth = 66.0
    while station.command(azimuth, 39.0 - (azimuth - 66.0), (rate_deg_s, -rate_deg_s)) == "":
        azimuth += 0.1 * rate_deg_s
        station.run(0.1)
    station.run(8.0)
    status = station.antenna.status(station.t_s)
    assert status.mode == "fault"
    assert "would not come to rest in time" in status.fault
    assert "below the horizon mask" in status.fault
    assert station.deepest_command <= GUARD_RAD
    assert station.deepest <= SERVO_RAD


def test_from_below_the_mask_only_the_way_out_is_open_and_it_is_no_fault() -> None:
    station = Station(75.0, 30.0)
    assert "below the horizon mask" in station.go(75.0, 29.5, 0.5)
    assert station.go(75.0, 36.0, 20.0) == ""
    assert station.axes_deg == pytest.approx([75.0, 36.0], abs=0.01)
    assert station.antenna.status(station.t_s).fault == ""


def test_slightly_outside_the_travel_the_servo_moves_inward_only() -> None:
    limits = LoopParams().preprocessor
    high_deg = limits.travel_max_rad[0] / DEG
    station = Station(high_deg + 0.02, 40.0)
    assert "past the limit" in station.command(high_deg + 0.1, 40.0)
    assert station.go(high_deg - 3.0, 40.0, 20.0) == ""
    assert station.axes_deg[0] == pytest.approx(high_deg - 3.0, abs=0.01)


def test_an_antenna_cut_off_at_its_hard_limit_is_released_where_it_stands_and_comes_in_on_command() -> None:
    """Released brakes leave the structure swinging about where it stands; that is no running out of the limit.

    The watch over the drives is off: it would not let one get so far.
    """
    blind = DriveWatchParams(gained_rad_s=1.0, excess_rad_s=1.0)
    station = Station(120.0, 60.0, mask=HorizonMask(), drive=blind)
    station.run(0.1)
    loops = LoopParams()
    narrow = loops.replace(preprocessor=loops.preprocessor.replace(travel_max_rad=(120.5 * DEG, 91.0 * DEG)))
    station.antenna.retune(dss13_plant(), narrow)
    station.antenna.injected.inject("runaway", 0.2 * DEG)
    while station.antenna.mode != "fault":
        station.run(TICK_S)
    assert "past the hard limit 120.750 deg" in station.antenna.status(station.t_s).fault
    station.antenna.injected.inject("none", 0.0)
    station.run(1.0)
    outside = station.axes_deg[0]
    assert 120.75 <= outside < 121.0
    assert station.antenna.reset_fault() == ""
    station.run(10.0)
    assert station.antenna.mode == "holding"
    assert station.axes_deg[0] == pytest.approx(outside, abs=0.01), "a reset moves nothing"
    assert "past the limit" in station.command(outside + 0.1, 60.0)
    assert station.go(119.0, 60.0, 8.0) == ""
    assert station.axes_deg[0] == pytest.approx(119.0, abs=0.01)


def test_the_sun_is_gone_round_and_a_command_into_it_is_refused() -> None:
    gate = GateParams(sun_radius_rad=4.0 * DEG)
    sun = SolarDirection(SunParams()).at(START_S + 25.0)
    assert sun is not None
    azimuth, elevation = sun[0] / DEG, sun[1] / DEG
    assert elevation > 10.0
    station = Station(azimuth - 20.0, elevation, mask=HorizonMask(), gate=gate, sun=SunParams())
    assert "deg from the Sun, must be >= 4.000 deg" in station.go(azimuth, elevation + 1.0, 0.2)
    assert station.go(azimuth + 20.0, elevation, 80.0) == ""
    assert station.axes_deg == pytest.approx([azimuth + 20.0, elevation], abs=0.01)
    assert station.nearest > 4.0 * DEG
    assert station.antenna.status(station.t_s).fault == ""


def test_a_steady_motion_towards_the_sun_is_stopped_at_its_zone() -> None:
    gate = GateParams(sun_radius_rad=4.0 * DEG)
    sun = SolarDirection(SunParams()).at(START_S + 10.0)
    assert sun is not None
    azimuth, elevation = sun[0] / DEG - 10.0 / math.cos(sun[1]), sun[1] / DEG
    station = Station(azimuth, elevation, mask=HorizonMask(), gate=gate, sun=SunParams())
    while station.command(azimuth, elevation, (1.0, 0.0)) == "":
        azimuth += 0.1
        station.run(0.1)
    station.run(6.0)
    assert "from the Sun" in station.antenna.status(station.t_s).fault
    assert 4.0 * DEG - GUARD_RAD < station.nearest < 5.5 * DEG


def follow(station: Station, path: list[tuple[float, float]]) -> None:
    for azimuth, elevation in path:
        assert station.command(azimuth, elevation) == ""
        station.run(0.1)


def test_after_a_pause_the_antenna_goes_round_the_hill_that_the_commands_have_gone_over() -> None:
    """Paused before the hill; the commands climb over it and come down behind: the straight way leads through it."""
    station = Station(50.0, 20.0)
    follow(station, [(50.0, 20.0)] * 5)
    assert station.antenna.pause() == ""
    up = [(50.0, 20.0 + 0.4 * step) for step in range(61)]
    across = [(50.0 + 0.4 * step, 44.0) for step in range(126)]
    follow(station, [*up, *across, *((100.0, elevation) for _, elevation in reversed(up))])
    np.testing.assert_allclose(station.axes_deg, [50.0, 20.0], atol=0.01)
    assert station.antenna.resume() == ""
    follow(station, [(100.0, 20.0)] * 900)
    assert station.antenna.safety.latch.text == ""
    np.testing.assert_allclose(station.axes_deg, [100.0, 20.0], atol=0.01)
    assert station.deepest <= 0.0


def test_a_pause_does_not_end_where_no_way_leads_back() -> None:
    """A wall to the zenith has come between: nothing moves and the pause goes on."""
    walls = HorizonMask(
        azimuth_rad=tuple(x * DEG for x in (0.0, 60.0, 61.0, 62.0, 240.0, 241.0, 242.0)),
        elevation_rad=tuple(x * DEG for x in (0.0, 0.0, 85.5, 0.0, 0.0, 85.5, 0.0)),
    )
    station = Station(50.0, 20.0, mask=walls)
    station.antenna.safety.gate = Gate(
        station.antenna.safety.gate.params, station.antenna.safety.gate.limits.replace(elevation_max_rad=80.0 * DEG), walls,
        station.antenna.safety.gate.axes,
    )  # fmt: skip
    follow(station, [(50.0, 20.0)] * 5)
    assert station.antenna.pause() == ""
    follow(station, [(50.0 + 0.1 * step, 20.0) for step in range(90)])
    table = station.antenna.axes.path.table
    table.clear()
    table.accept(
        JointTrajectory(t_s=[station.t_s + 0.1], position_rad=np.array([[90.0, 20.0]]) * DEG, velocity_rad_s=np.zeros((1, 2)),
                        acceleration_rad_s2=np.zeros((1, 2))), station.t_s,
    )  # fmt: skip
    assert "below the horizon mask on the way, and no detour is free" in station.antenna.resume()
    assert station.antenna.mode == "paused"
