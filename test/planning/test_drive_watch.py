"""A drive held against its model: how soon one that runs away is found, and what a sound one may do."""

import math

import numpy as np
import pytest

from rf_pointing.planning import DriveWatch, DriveWatchParams

DEG = math.pi / 180.0
TICK_S = 0.02
PARAMS = DriveWatchParams()
SUBSTEPS = 20


class Drive:
    """A first-order rate loop with bounded acceleration, integrated finely; watched in azimuth, standing in elevation."""

    def __init__(self, params: DriveWatchParams = PARAMS, gain: float = 1.0, strength: float = 1.0) -> None:
        self.watch = DriveWatch(params, TICK_S)
        self.bandwidth = gain * 2.0 * math.pi * PARAMS.bandwidth_hz
        self.hard = strength * PARAMS.acceleration_limit_rad_s2
        self.rate = 0.0

    def tick(self, command: float, obeys: float | None = None, wind: float = 0.0, tachometer: float = 0.0) -> str:
        """Follow `command`, or run to `obeys` instead; return what the watch says of what the tachometer shows."""
        goal = command if obeys is None else obeys
        for _ in range(SUBSTEPS):
            pull = min(max((goal - self.rate) * self.bandwidth, -self.hard), self.hard)
            self.rate += (pull + wind) * TICK_S / SUBSTEPS
        return self.watch.step((self.rate + tachometer, 0.0), (command, 0.0))


def settled(command: float, wind: float = 0.0, **drive: float) -> Drive:
    made = Drive(**drive)
    made.rate = command
    for _ in range(250):
        assert made.tick(command, wind=wind) == ""
    return made


@pytest.mark.parametrize("command_deg_s", [0.0, 0.004, 0.3, -1.2])
@pytest.mark.parametrize("wind_deg_s2", [0.0, 0.6])
@pytest.mark.parametrize("beyond_deg_s", [0.5, 2.5, -0.5, -2.5])
def test_a_runaway_is_found_at_its_second_sample(command_deg_s: float, wind_deg_s2: float, beyond_deg_s: float) -> None:
    drive = settled(command_deg_s * DEG, math.copysign(wind_deg_s2, beyond_deg_s) * DEG)
    obeys = (command_deg_s + beyond_deg_s) * DEG
    wind = math.copysign(wind_deg_s2, beyond_deg_s) * DEG
    assert drive.tick(command_deg_s * DEG, obeys, wind) == ""
    assert f"commanded {command_deg_s:.2f} deg/s" in drive.tick(command_deg_s * DEG, obeys, wind)


def test_a_runaway_against_the_wind_is_found_within_100_ms() -> None:
    drive = settled(0.0, -0.6 * DEG)
    said = [drive.tick(0.0, 2.0 * DEG, -0.6 * DEG) for _ in range(5)]
    assert any(said)


def test_a_drive_that_creeps_away_is_found_when_it_is_half_a_degree_per_second_off() -> None:
    drive = settled(0.1 * DEG)
    for tick in range(400):
        words = drive.tick(0.1 * DEG, (0.1 + 0.002 * tick) * DEG)
        if words:
            break
    assert 0.5 < drive.rate / DEG - 0.1 < 0.53


def test_a_drive_above_its_largest_rate_has_run_away_whatever_was_commanded() -> None:
    drive = settled(1.9 * DEG)
    said = []
    for _ in range(40):
        drive.rate += 0.012 * DEG
        said.append(drive.watch.step((drive.rate, 0.0), (5.0 * DEG, 0.0)))
    assert drive.rate > 2.2 * DEG
    assert said[-1]


@pytest.mark.parametrize(("gain", "strength"), [(1.0, 1.0), (0.7, 1.0), (1.4, 1.0), (1.0, 0.5), (1.0, 1.2)])
def test_no_command_makes_a_sound_drive_a_runaway(gain: float, strength: float, random: np.random.Generator) -> None:
    """Steps up to the limit and back, white noise, ramps; the drive faster, slower, weaker, stronger than its model."""
    drive = Drive(gain=gain, strength=strength)
    for block in range(60):
        size, base = random.uniform(0.0, 1.0) * DEG, random.uniform(-2.0, 2.0) * DEG
        for tick in range(60):
            command = (base, size * random.standard_normal(), base * tick / 60.0)[block % 3]
            assert drive.tick(command) == "", (block, tick)


def test_a_noisy_tachometer_and_a_single_wrong_reading_are_no_runaway(random: np.random.Generator) -> None:
    drive = settled(0.3 * DEG)
    for _ in range(2000):
        assert drive.tick(0.3 * DEG, tachometer=0.003 * DEG * random.standard_normal()) == ""
    for spike in (1.5, -1.5):
        assert drive.tick(0.3 * DEG, tachometer=spike * DEG) == ""
        for _ in range(50):
            assert drive.tick(0.3 * DEG) == ""


def test_a_dead_time_is_allowed_for_when_it_is_known() -> None:
    for delay_s, sound in ((0.1, True), (0.0, False)):
        drive = Drive(PARAMS.replace(delay_s=delay_s))
        commands = [0.0] * 50 + [0.6 * DEG, -0.6 * DEG] * 1
        commands += [(-0.6 if step // 10 % 2 else 0.6) * DEG for step in range(200)]
        said = [drive.tick(commands[index], commands[max(0, index - 5)]) for index in range(len(commands))]
        assert (not any(said)) == sound


def test_a_tachometer_that_gives_no_number_is_a_fault() -> None:
    drive = settled(0.3 * DEG)
    assert "azimuth tachometer gives no number" in drive.tick(0.3 * DEG, tachometer=math.nan)
