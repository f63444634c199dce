"""A control unit on a drive with a simulated device behind it, stepped together, and passes for it."""

import math
import time
from collections.abc import Callable

import numpy as np
from scipy.interpolate import CubicSpline

from rf_pointing.controllers import CommandPreprocessorParams
from rf_pointing.core import JointTrajectory
from rf_pointing.ephemeris import Pass, TopocentricTrack
from rf_pointing.planning import WindWatchParams
from rf_pointing.station.antenna.drive_antenna import DriveAntenna
from rf_pointing.station.antenna.loops import LoopParams
from rf_pointing.station.antenna.safety import SafetyParams
from rf_pointing.station.antenna.simulated_antenna import AntennaParams
from test.drives.benches import TICK_S, Bench
from test.drives.simulators import Simulator

SPEED_DEG_S = 6.0
MOTION = CommandPreprocessorParams(
    rate_limit_rad_s=(math.radians(SPEED_DEG_S),) * 2,
    acceleration_limit_rad_s2=(math.radians(6.0),) * 2,
    travel_min_rad=(math.radians(-180.0), 0.0),
    travel_max_rad=(math.radians(270.0), math.radians(180.0)),
)
UNWATCHED = SafetyParams(wind=WindWatchParams(watched=False))
"""A station without an anemometer."""
ZERO_RAD = (-math.pi, 0.0)
"""A controller of 0 to 450 deg whose stop is in the south: it reads 0 where the azimuth is -180 deg."""


class Driven:
    """One antenna on one drive; `run` steps device and antenna, with a table of commands every 0.1 s."""

    def __init__(self, name: str, device: Simulator | None = None, safety: SafetyParams | None = None,
                 motion: CommandPreprocessorParams = MOTION, **rotator: object) -> None:  # fmt: skip
        south = {"zero_rad": ZERO_RAD, "travel_min_rad": motion.travel_min_rad, "travel_max_rad": motion.travel_max_rad}
        self.bench = Bench(name, device, **south | rotator)
        self.device = self.bench.device
        loops = LoopParams(preprocessor=motion)
        params = AntennaParams(drive=self.bench.params, loops=loops, safety=safety or UNWATCHED)
        self.antenna = DriveAntenna(params, self.bench.drive, self.bench.t_s)
        self.ticks = 0
        self.path: Callable[[float], tuple[np.ndarray, np.ndarray]] | None = None
        self.silent = False
        self.rows: list[tuple[float, ...]] = []

    @property
    def t_s(self) -> float:
        return self.bench.t_s

    @property
    def mode(self) -> str:
        return str(self.antenna.mode)

    @property
    def fault(self) -> str:
        return self.antenna.safety.latch.text

    def enabled(self) -> "Driven":
        self.antenna.enable()
        self.run(0.5)
        return self

    def run(self, seconds: float, until: Callable[[], bool] = lambda: False) -> float:
        """Step; return the time that it took until the condition was true, or all of it."""
        begun_s, count = self.t_s, round(seconds / TICK_S)
        for _ in range(count):
            self.tick()
            if until():
                break
        return self.t_s - begun_s

    def tick(self) -> None:
        self.bench.t_s = round(self.bench.t_s + TICK_S, 6)
        self.device.step(self.t_s)
        self.reading, _ = self.antenna.step(self.t_s)
        self.ticks += 1
        if self.path is not None and self.ticks % 5 == 0 and not self.silent:
            self.refused = self.antenna.accept(self.table(), self.t_s, "test")

    def wait(self, seconds: float, until: Callable[[], bool]) -> bool:
        """Step at most so long, with real time for what opens in a thread."""
        for _ in range(round(seconds / TICK_S)):
            self.tick()
            time.sleep(0.0005)
            if until():
                return True
        return False

    def table(self) -> JointTrajectory:
        assert self.path is not None
        times = self.t_s + 0.1 * np.arange(1, 10)
        position, velocity = (np.array(part) for part in zip(*map(self.path, times), strict=True))
        acceleration = np.gradient(velocity, times, axis=0)
        return JointTrajectory(
            t_s=times, position_rad=position, velocity_rad_s=velocity, acceleration_rad_s2=acceleration
        )

    def go(self, azimuth_deg: float, elevation_deg: float) -> None:
        """Command a place."""
        place = np.radians([azimuth_deg, elevation_deg])
        self.path = lambda _: (place, np.zeros(2))

    def move(self, rate_deg_s: tuple[float, float] = (1.0, 0.3)) -> None:
        """Command a steady motion from here."""
        begun_s, start, rate = self.t_s, np.array(self.antenna.axes.encoder_rad), np.radians(rate_deg_s)
        self.path = lambda t_s: (start + rate * (t_s - begun_s), rate)

    @property
    def true_deg(self) -> np.ndarray:
        """Where the device really is."""
        return np.degrees(self.device.model.position_rad) + np.degrees(self.bench.params.rotator.zero_rad)

    def close(self) -> None:
        self.antenna.close()
        self.device.close()


def pass_path(
    track: TopocentricTrack, window: Pass, begin_s: float, over_the_top: bool = False
) -> Callable[[float], tuple[np.ndarray, np.ndarray]]:
    """Return the path of a pass in joint angles of -180 to 270 deg; it rises at `begin_s` of the bench's time.

    Over the top the antenna looks over its back: azimuth + 180 deg, 180 deg - elevation.
    """
    times = np.arange(-2.0, window.los_t_s - window.aos_t_s + 4.0, 0.1)
    targets = [track.target_at(round(window.aos_t_s + t_s, 6)) for t_s in times]
    azimuth = np.unwrap([target.azimuth_rad for target in targets])
    elevation = np.array([target.elevation_rad for target in targets])
    if over_the_top:
        azimuth, elevation = azimuth + math.pi, math.pi - elevation
    azimuth += 2.0 * math.pi * math.ceil((-math.pi - azimuth.min()) / (2.0 * math.pi))
    curve = CubicSpline(times, np.column_stack([azimuth, elevation]))
    rate = curve.derivative()
    # Before it the antenna waits where the pass begins.
    return lambda t_s: (curve(max(t_s - begin_s, 0.0)), rate(t_s - begin_s) if t_s > begin_s else np.zeros(2))
