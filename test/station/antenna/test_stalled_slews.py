"""A process that stalls in a slew on a drive that goes on: no fault, and the antenna arrives."""

import math
from collections.abc import Callable, Iterator

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from rf_pointing.core.parameters import leaves, to_degrees, with_leaves
from rf_pointing.drives import Capabilities, Drive, DriveParams, DriveReading
from rf_pointing.planning import DriveWatchParams
from rf_pointing.ros.lifecycle import Schedule
from rf_pointing.station.antenna.drive_antenna import DriveAntenna
from rf_pointing.station.antenna.loops import LoopParams
from rf_pointing.station.antenna.memory import AntennaMemory
from rf_pointing.station.antenna.operation import AntennaOperation
from rf_pointing.station.antenna.simulated_antenna import AntennaParams
from test.drives.benches import TICK_S, Bench
from test.station.driven_antenna import MOTION, UNWATCHED, ZERO_RAD

FAST = math.radians(6.0)
SAFETY = UNWATCHED.replace(drive=DriveWatchParams(acceleration_limit_rad_s2=FAST, rate_limit_rad_s=1.2 * FAST))
STEP_S = 0.01
"""Between two looks of the world at a device; the process looks when its timer fires."""


class RateDevice(Drive):
    """A rate loop of 20 rad/s whose state is published every `period_s`, as a vendor's node does."""

    def __init__(self, period_s: float) -> None:
        rate = (FAST, FAST)
        self.capabilities = Capabilities(
            set_points="rate", resolution_rad=(1e-4, 1e-4), rate_rad_s=rate, period_s=period_s, latency_s=0.05
        )
        self.position, self.rate, self.command = np.radians([-60.0, 45.0]), np.zeros(2), np.zeros(2)
        self.t_s: float | None = None
        self.published = DriveReading(t_s=0.0, position_rad=(0.0, 0.0))

    def live(self, t_s: float) -> None:
        if self.t_s is None:
            self.t_s = t_s
        dt_s = t_s - self.t_s
        change = (1.0 - math.exp(-20.0 * dt_s)) * (self.command - self.rate)
        most = FAST * dt_s
        self.rate = self.rate + np.clip(change, -most, most)
        self.position, self.t_s = self.position + self.rate * dt_s, t_s
        if t_s - self.published.t_s >= self.capabilities.period_s - 1e-6:
            first, second = self.position.tolist()
            rates = (float(self.rate[0]), float(self.rate[1]))
            self.published = DriveReading(t_s=t_s, position_rad=(first, second), rate_rad_s=rates)

    def step(self, _t_s: float) -> DriveReading:
        return self.published

    def turn(self, rate_rad_s: tuple[float, float]) -> None:
        self.command = np.array(rate_rad_s)

    def stop(self) -> None:
        self.command = np.zeros(2)


class Slew:
    """An antenna in operation whose ticks are those of a timer on a process that stalls."""

    def __init__(self, drive: Drive, params: DriveParams, live: Callable[[float], None], t_s: float) -> None:
        self.live, self.t_s, self.device = live, t_s, drive
        self.ahead_s = 0.0
        """By which the clock was stepped; `t_s` goes on steadily, as the device does."""
        live(t_s)
        azimuth, elevation = (
            loop.replace(proportional_gain=1.0, integral_gain=0.2, rate_limit_rad_s=1.2 * FAST)
            for loop in (LoopParams().azimuth, LoopParams().elevation)
        )
        # A drive that is read at 10 Hz lags by half a degree while it gathers speed.
        calm = LoopParams().oscillation.replace(largest_rad=1.0)
        self.loops = LoopParams(preprocessor=MOTION, azimuth=azimuth, elevation=elevation, oscillation=calm)
        self.antenna = DriveAntenna(AntennaParams(drive=params, loops=self.loops, safety=SAFETY), drive, t_s)
        drive.now_s = lambda: self.t_s + self.ahead_s
        self.operation = AntennaOperation(self.antenna, AntennaMemory(""), "")
        self.operation.start(t_s)
        self.schedule = Schedule(t_s, TICK_S, t_s, catches_up=False)

    def run(self, seconds: float, stall_s: float = 0.0) -> None:
        """Let time pass; in the first `stall_s` of it the process stands."""
        begun_s = self.t_s
        for step in range(1, round(seconds / STEP_S) + 1):
            self.t_s = round(begun_s + step * STEP_S, 6)
            self.live(self.t_s)
            now_s = self.t_s + self.ahead_s
            for t_s in self.schedule.due(now_s, self.t_s) if self.t_s - begun_s >= stall_s else ():
                wall = self.schedule.jumped_s, self.schedule.stalled_s, self.schedule.stepped_s
                self.operation.tick(t_s, now_s, self.t_s, *wall)


def on_a_rotator(name: str) -> tuple[Slew, Callable[[], None]]:
    travel = {"zero_rad": ZERO_RAD, "travel_min_rad": MOTION.travel_min_rad, "travel_max_rad": MOTION.travel_max_rad}
    bench = Bench(name, None, **travel)
    return Slew(bench.drive, bench.params, bench.device.step, bench.t_s), bench.device.close


def on_a_rate_drive(period_s: float) -> tuple[Slew, Callable[[], None]]:
    device = RateDevice(period_s)
    rotator = DriveParams().rotator.replace(travel_min_rad=(-4.0, 0.0), travel_max_rad=(5.0, 3.2))
    return Slew(device, DriveParams(type="own", rotator=rotator), device.live, 100.0), lambda: None


STANDS: dict[str, Callable[[], tuple[Slew, Callable[[], None]]]] = {
    "hamlib": lambda: on_a_rotator("hamlib"),
    "gs232": lambda: on_a_rotator("gs232"),
    "easycomm": lambda: on_a_rotator("easycomm 2"),
    "rates at every tick": lambda: on_a_rate_drive(TICK_S),
    "rates at 10 Hz": lambda: on_a_rate_drive(0.1),
}


@pytest.mark.parametrize("stand", STANDS)
@given(
    stalls=st.lists(st.tuples(st.floats(0.0, 1.5), st.floats(0.05, 0.9)), min_size=1, max_size=3),
    moved_deg=st.floats(-40.0, 40.0),
)
@example(stalls=[(0.0, 0.78125), (0.53125, 0.875)], moved_deg=0.0)
@settings(deadline=None, max_examples=15)
def test_stalls_in_a_slew_are_no_fault_and_the_antenna_arrives(
    stand: str, stalls: list[tuple[float, float]], moved_deg: float
) -> None:
    slew, close = STANDS[stand]()
    try:
        slew.run(0.5)
        goal = math.radians(-60.0 + moved_deg), math.radians(35.0)
        assert slew.antenna.go_to(goal) == ""
        for before_s, stall_s in stalls:
            slew.run(before_s)
            slew.run(stall_s + 0.1, stall_s)
        slew.run(12.0)
        assert slew.antenna.safety.latch.text == ""
        np.testing.assert_allclose(slew.antenna.axes.encoder_rad, goal, atol=math.radians(1.1))
    finally:
        slew.antenna.close()
        close()


@pytest.mark.parametrize("stand", ["hamlib", "gs232", "easycomm"])
@given(
    steps_s=st.lists(st.floats(-0.3, 0.3) | st.floats(-1e5, 1e5), min_size=1, max_size=3), before_s=st.floats(0.0, 3.0)
)
@settings(deadline=None, max_examples=12)
def test_after_steps_of_the_clock_in_a_slew_the_next_one_is_carried_out(
    stand: str, steps_s: list[float], before_s: float
) -> None:
    """Without a false fault, and without set points that wait until the clock is where it was."""
    slew, close = STANDS[stand]()
    try:
        slew.run(0.5)
        assert slew.antenna.go_to((math.radians(-30.0), math.radians(35.0))) == ""
        slew.run(before_s)
        for step_s in steps_s:
            slew.ahead_s += step_s
            slew.run(6.0)
            fault = slew.antenna.safety.latch.text
            assert fault == "" if abs(step_s) <= 0.3 else fault == "" or "the clock jumped by" in fault
            assert fault.count(";") == 0, "nothing but the clock"
            if fault:
                assert slew.antenna.reset_fault() == ""
        goal = math.radians(-60.0), math.radians(50.0)
        assert slew.antenna.go_to(goal) == ""
        slew.run(15.0)
        np.testing.assert_allclose(slew.antenna.axes.encoder_rad, goal, atol=math.radians(1.1))
        assert slew.antenna.safety.latch.text == ""
    finally:
        slew.antenna.close()
        close()


@given(ways_deg=st.lists(st.floats(4.0, 16.0), min_size=6, max_size=8), share=st.floats(0.6, 1.0))
@settings(deadline=None, max_examples=10)
def test_slews_to_and_fro_on_a_device_that_falls_behind_are_no_oscillation(ways_deg: list[float], share: float) -> None:
    """Hamlib's dummy falls 1 to 3 deg behind in a slew; a device may be slower than its maker says."""
    bench = Bench("hamlib", None, zero_rad=ZERO_RAD, travel_min_rad=MOTION.travel_min_rad,
                  travel_max_rad=MOTION.travel_max_rad)  # fmt: skip
    slew = Slew(bench.drive, bench.params, bench.device.step, bench.t_s)
    rates = slew.antenna.drive_params.rotator.rate_rad_s
    bench.device.model.params = bench.device.model.params.replace(rate_rad_s=(share * rates[0], share * rates[1]))
    try:
        slew.run(0.5)
        for index, way_deg in enumerate(ways_deg):
            side = 1.0 if index % 2 else -1.0
            goal = math.radians(-60.0 + side * way_deg), math.radians(45.0 + 0.5 * side * way_deg)
            assert slew.antenna.go_to(goal) == ""
            slew.run(2.0 * way_deg / (6.0 * share))
            assert slew.antenna.safety.latch.text == ""
    finally:
        slew.antenna.close()
        bench.device.close()


@pytest.fixture
def hamlib() -> Iterator[Slew]:
    slew, close = STANDS["hamlib"]()
    yield slew
    slew.antenna.close()
    close()


def test_a_first_tick_that_comes_late_is_no_jump_of_the_clock(hamlib: Slew) -> None:
    hamlib.run(0.9, 0.8)
    assert hamlib.antenna.safety.latch.text == ""


@given(data=st.data())
@settings(deadline=None, max_examples=25)
def test_parameters_at_their_extremes_in_motion_move_nothing_beyond_the_gate(data: st.DataObject) -> None:
    """On a drive of rates: what is taken in motion keeps the axes within travel and rate, or is a fault."""
    slew, _ = on_a_rate_drive(TICK_S)
    device, antenna, loops, plant = slew.device, slew.antenna, slew.loops, AntennaParams().plant
    assert antenna.go_to((math.radians(-100.0), math.radians(80.0))) == ""
    for _ in range(6):
        edges = leaves(loops)
        edge = data.draw(st.sampled_from(sorted(edges)))
        item, _ = edges[edge]
        bounds = [to_degrees(item.name, item.metadata.get(side))[1] for side in ("low", "high")]
        value = data.draw(st.sampled_from([bound for bound in bounds if bound is not None] or [None]))
        try:
            wanted = with_leaves(loops, {edge: value})
            slew.operation.check(loops, {"plant": plant, "loops": wanted}, active=True, holder="")
            antenna.retune(plant, wanted)
        except (ValueError, TypeError):
            continue
        finally:
            for _ in range(20):
                slew.run(0.05)
                azimuth, elevation = device.position.tolist()
                assert MOTION.travel_min_rad[0] <= azimuth <= MOTION.travel_max_rad[0]
                assert MOTION.travel_min_rad[1] <= elevation <= MOTION.travel_max_rad[1]
                assert np.max(np.abs(device.rate)) <= 1.25 * FAST
        loops = wanted
