"""Fly random dishes and count what the watches say: false faults in passes, and injected faults that are found late.

scripts/run-python benchmarks/random_dishes.py [DISHES] [PASSES]

A dish has 1 to 70 m of diameter, encoders of 14 to 24 bits, the rates of a mount of its size, a band that its encoders
can point, wind up to 10 m/s, a site anywhere, and scans conically, steps or tracks the ephemeris. Each pass is
36 s of a CBERS-2 pass above 25 deg. Then each fault is injected into the azimuth axis in steady motion.
"""

import dataclasses
import math
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np

from rf_pointing.core import JointTrajectory
from rf_pointing.ephemeris import Pass, find_passes
from rf_pointing.ephemeris.source import SourceParams, load_elements
from rf_pointing.simulation import StationSetup, simulate_pass
from rf_pointing.station.antenna.modes import AntennaMode
from rf_pointing.station.antenna.simulated_antenna import SimulatedAntenna
from rf_pointing.station.description import StationDescription, station_from

Random = np.random.Generator
SECONDS, EARLY_S = 36.0, 4.0
BANDS_MHZ = {"Ka": 26500.0, "X": 8200.0, "S": 2250.0, "L": 1690.0}
SENSORS = ("[conscan]", "[steptrack]", "[]")
FEWEST_STEPS = 6.0
"""Encoder steps in a beam: with fewer the encoders are no match for the band."""


def random_dish(random: Random, sensors: str) -> str:
    """Return the description of a dish, as its user would write it."""
    diameter = round(math.exp(random.uniform(0.0, math.log(70.0))), 2)
    rate = round(min(8.0, 12.0 / diameter**0.6) * random.uniform(0.7, 1.4), 3)
    bits = int(random.integers(14, 25))
    fits = [
        name for name, mhz in BANDS_MHZ.items() if 66.0 * 299.8 / mhz / diameter * 2.0**bits / 360.0 >= FEWEST_STEPS
    ] or ["L"]
    band = fits[int(random.integers(len(fits)))]
    axis = f"rate_deg_s: {rate}, acceleration_deg_s2: {round(rate * random.uniform(0.6, 1.5), 3)}, encoder_bits: {bits}"
    return f"""version: 1
name: Dish of {diameter} m
site: {{latitude_deg: {random.uniform(-60.0, 60.0):.4f}, longitude_deg: {random.uniform(-180.0, 180.0):.4f}}}
dish: {{diameter_m: {diameter}}}
mount:
  azimuth: {{travel_deg: [-270, 270], {axis}}}
  elevation: {{travel_deg: [2, 90], {axis}}}
sun: {{radius_deg: 0}}
bands:
  {band}: {{frequency_mhz: {BANDS_MHZ[band]}, sensors: {sensors}}}
simulation:
  wind: {{mean_speed_m_s: {random.uniform(0.0, 10.0):.2f}, from_azimuth_deg: {random.uniform(0.0, 360.0):.1f}}}
"""


def dishes(count: int, seed: int) -> Iterator[StationDescription]:
    """Yield descriptions that their reader takes."""
    random = np.random.default_rng(seed)
    for index in range(count):
        yield station_from(Path(f"dish{index}.yaml"), random_dish(random, SENSORS[index % len(SENSORS)]))


class Flight:
    """One pass of one dish, with the antenna that flew it."""

    def __init__(self, station: StationDescription, window: Pass, seed: int) -> None:
        self.window = dataclasses.replace(window, los_t_s=min(window.los_t_s, window.aos_t_s + SECONDS))
        changes: dict[str, dict[str, object]] = {
            "antenna_servo": {
                "antenna.seed": seed,
                "antenna.start_azimuth_deg": math.degrees(math.remainder(window.aos_azimuth_rad, 2.0 * math.pi)),
                "antenna.start_elevation_deg": math.degrees(window.aos_elevation_rad),
            },
            "rf_receiver": {"signal.seed": seed},
        }
        self.setup = StationSetup(station, changes=changes)
        self.antenna = self.setup.antenna()

    def fault(self) -> str:
        """Return "" or what stopped the antenna."""
        antenna = self.antenna
        self.setup.antenna = lambda: antenna  # type: ignore[method-assign]
        simulate_pass(self.setup, self.window, self.window.aos_t_s - EARLY_S)
        if antenna.safety.latch.text:
            return antenna.safety.latch.text
        return "" if antenna.mode == AntennaMode.TRACKING else f"ends in mode {antenna.mode}"


def windows(station: StationDescription, count: int) -> list[Pass]:
    """Return passes above 25 deg that peak where the mount can follow them."""
    begin_s = load_elements(SourceParams()).epoch_t_s
    rate = station.parameters("pointing_controller")["machine.rate_limit_deg_s"][0]
    # 0.5 deg/s on the sky, 1 / cos(elevation) in azimuth.
    highest = min(80.0, math.degrees(math.acos(min(0.9, 0.6 / rate))))
    found = find_passes(StationSetup(station).track(), begin_s, 8.0 * 86400.0, math.radians(25.0))
    fitting = [one for one in found if math.degrees(one.peak_elevation_rad) < highest and one.duration_s > SECONDS]
    return fitting[:count]


FAULTS = ("encoder_frozen", "encoder_jump", "encoder_lie", "encoder_nan", "runaway")
MOTION_S, PATIENCE_S = 4.0, 4.0


def time_to_find_s(
    station: StationDescription, kind: str, seed: int, changes: Mapping[str, object] | None = None
) -> tuple[float, float]:
    """Return the time from a fault to its latch, infinite without one, and the time that it may take.

    The antenna moves at 0.3 of its rate. A frozen encoder may take until the axis has moved by the watch's threshold, a
    lying one (0.3 of the rate) until it has lied by it; everything else is found within 0.1 s, a runaway within 0.25 s.
    """
    setup = StationSetup(station, changes={"antenna_servo": {"antenna.seed": seed, **(changes or {})}})
    antenna, sets = setup.antenna(), setup.sets("antenna_servo")
    rate, watch = 0.3 * sets["loops"].preprocessor.rate_limit_rad_s[0], sets["safety"].watch
    clock = _Moving(antenna, rate)
    clock.run(MOTION_S)
    if antenna.safety.latch.text:
        raise ValueError(f"{station.name}: {antenna.safety.latch.text}")
    lie = max(rate, 1.5 * watch.drift_rad / watch.window_s)
    values = {
        "encoder_jump": 2.0 * watch.jump_rad,
        "encoder_lie": lie,
        "runaway": -sets["plant"].azimuth.rate_limit_rad_s,
    }
    value = values.get(kind, 0.0)
    bounds = {
        "encoder_frozen": watch.frozen_rad / rate + 0.1,
        "encoder_lie": watch.drift_rad / lie + 0.1,
        "runaway": 0.25,
    }
    bound = bounds.get(kind, 0.1)
    antenna.injected.inject(kind, value)
    return clock.run(PATIENCE_S + bound, until_fault=True), bound


class _Moving:
    """An antenna that a commander moves at a steady rate."""

    def __init__(self, antenna: SimulatedAntenna, rate_rad_s: float) -> None:
        self._antenna, self._rate, self._tick = antenna, rate_rad_s, 0
        self._start = np.array(antenna.params.start_rad)
        antenna.enable()

    def run(self, seconds: float, *, until_fault: bool = False) -> float:
        """Return the time until a fault was latched, infinite for none."""
        tick_s = self._antenna.params.tick_s
        for count in range(1, round(seconds / tick_s) + 1):
            self._tick += 1
            t_s = 1.0e9 + self._tick * tick_s
            self._antenna.step(t_s)
            if self._tick % 5 == 1:
                self._antenna.accept(self._command(t_s), t_s)
            if until_fault and self._antenna.safety.latch.text:
                return count * tick_s
        return math.inf

    def _command(self, t_s: float) -> JointTrajectory:
        times = t_s + 0.1 * np.arange(1, 11)
        rates = np.tile([self._rate, 0.0], (len(times), 1))
        return JointTrajectory(
            t_s=times,
            position_rad=self._start + rates * (times - 1.0e9)[:, None],
            velocity_rad_s=rates,
            acceleration_rad_s2=np.zeros_like(rates),
        )


def main(count: int = 20, passes: int = 100) -> None:
    """Print a line for each dish, and what was found."""
    flown, faults, late = 0, 0, 0
    for index, station in enumerate(dishes(count, seed=1)):
        band = station.default_band
        values = station.parameters("antenna_servo")
        print(
            f"{station.name:18} {band:3} {values['plant.azimuth.encoder_bits']:3} bits {station.chosen_sensor():10}",
            end=" ",
            flush=True,
        )
        for number, window in enumerate(windows(station, round(passes / count))):
            flown += 1
            try:
                reason = Flight(station, window, seed=100 * index + number).fault()
            except ValueError as error:
                reason = str(error)
            faults += bool(reason)
            print("." if not reason else f"\n    pass {number}: {reason}\n   ", end="", flush=True)
        for kind in FAULTS:
            found_s, bound_s = time_to_find_s(station, kind, seed=index)
            late += found_s > bound_s
            if found_s > bound_s:
                print(f"\n    {kind}: found after {found_s:.2f} s, must be <= {bound_s:.2f} s", end="", flush=True)
        print(flush=True)
    print(
        f"{flown} passes of {count} dishes: {faults} false faults; {late} of {count * len(FAULTS)} injected faults late"
    )
    # Passes that were never flown prove nothing.
    if not flown or faults or late:
        sys.exit("no pass was flown" if not flown else 1)


if __name__ == "__main__":
    main(*(int(argument) for argument in sys.argv[1:]))
