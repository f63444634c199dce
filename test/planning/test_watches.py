"""Sensors held against each other: how soon a fault is seen, and that a sound antenna has none.

A drive held against its model: how soon one that runs away is found, and what a sound one may do.

High wind: gust, mean, hysteresis, and an anemometer that says nothing.
"""

import math

import numpy as np
import pytest

from rf_pointing.planning import AxisWatch, AxisWatchParams, DriveWatch, DriveWatchParams, WindWatch, WindWatchParams

DEG = math.pi / 180.0
TICK_S = 0.02
AXIS_PARAMS = AxisWatchParams()


class Axis:
    """An azimuth that moves at a steady rate under watch; the elevation stands."""

    def __init__(self, rate_deg_s: float) -> None:
        self.watch = AxisWatch(AXIS_PARAMS, TICK_S)
        self.rate, self.ticks = rate_deg_s * DEG, 0

    @property
    def angle(self) -> float:
        return 1.0 + self.rate * self.ticks * TICK_S

    def tick(self, shown: float | None = None) -> tuple[float, str]:
        self.ticks += 1
        used, reason = self.watch.step((self.angle if shown is None else shown, 0.5), (self.rate, 0.0))
        return used[0], reason


def moving(rate_deg_s: float) -> Axis:
    axis = Axis(rate_deg_s)
    for _ in range(50):
        assert axis.tick()[1] == ""
    return axis


@pytest.mark.parametrize("count", [1, 2, 3])
@pytest.mark.parametrize("wrong", [math.nan, math.inf, 30.0 * DEG, -0.05 * DEG])
def test_up_to_three_wrong_samples_are_bridged(count: int, wrong: float) -> None:
    axis = moving(0.5)
    for _ in range(count):
        used, reason = axis.tick(axis.angle + wrong)
        assert reason == ""
        assert used == pytest.approx(axis.angle, abs=1e-9)
    for _ in range(20):
        assert axis.tick()[1] == ""


@pytest.mark.parametrize(
    ("wrong", "words"), [(5.0 * DEG, "encoder jumped by"), (math.nan, "reads nan, must be a number")]
)
def test_the_fourth_wrong_sample_is_a_fault(wrong: float, words: str) -> None:
    axis = moving(0.5)
    said = [axis.tick(axis.angle + wrong)[1] for _ in range(4)]
    assert said[:3] == ["", "", ""]
    assert words in said[3]


@pytest.mark.parametrize("rate_deg_s", [0.05, 0.3, -2.0])
def test_a_frozen_encoder_is_seen_within_200_ms(rate_deg_s: float) -> None:
    axis = moving(rate_deg_s)
    frozen = axis.angle
    said = [axis.tick(frozen)[1] for _ in range(10)]
    assert any("encoder stands still" in words or "jumped" in words for words in said)


@pytest.mark.parametrize("lie_deg_s", [0.3, -1.0])
def test_a_lying_encoder_is_seen_within_200_ms(lie_deg_s: float) -> None:
    axis = moving(0.2)
    said = [axis.tick(axis.angle + axis.rate * TICK_S + lie_deg_s * DEG * TICK_S * (tick + 1))[1] for tick in range(10)]
    assert any("more than the drive" in words for words in said)


def test_an_encoder_that_gives_no_number_from_the_start_is_taken_for_zero_with_the_reason() -> None:
    watch = AxisWatch(AXIS_PARAMS, TICK_S)
    assert watch.step((math.nan, 0.5), (0.0, 0.0)) == ((0.0, 0.5), "azimuth encoder reads nan, must be a number")
    assert watch.step((1.2, 0.5), (0.0, 0.0)) == ((1.2, 0.5), "")


def test_encoder_noise_is_no_fault(random: np.random.Generator) -> None:
    watch = AxisWatch(AXIS_PARAMS, TICK_S)
    angle = 0.0
    for tick in range(5000):
        rate = 2.0 * DEG * math.sin(0.3 * tick * TICK_S)
        angle += rate * TICK_S
        assert watch.step((angle + 2e-6 * random.standard_normal(), 0.0), (rate, 0.0))[1] == ""


def test_the_cause_is_gone_when_the_sensors_agree_again() -> None:
    axis = moving(0.5)
    for _ in range(6):
        axis.tick(math.nan)
    assert axis.watch.cause == "azimuth encoder reads nan, must be a number"
    for _ in range(10):
        axis.tick()
    assert axis.watch.cause == ""
    jumped = moving(0.5)
    for _ in range(4):
        jumped.tick(jumped.angle + 5.0 * DEG)
    assert "more than the drive" in jumped.watch.cause


DRIVE_PARAMS = DriveWatchParams()
SUBSTEPS = 20


class Drive:
    """A first-order rate loop with bounded acceleration, integrated finely; watched in azimuth, standing in elevation."""

    def __init__(self, params: DriveWatchParams = DRIVE_PARAMS, gain: float = 1.0, strength: float = 1.0) -> None:
        self.watch = DriveWatch(params, TICK_S)
        self.bandwidth = gain * 2.0 * math.pi * DRIVE_PARAMS.bandwidth_hz
        self.hard = strength * DRIVE_PARAMS.acceleration_limit_rad_s2
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
        drive = Drive(DRIVE_PARAMS.replace(delay_s=delay_s))
        commands = [0.0] * 50 + [0.6 * DEG, -0.6 * DEG] * 1
        commands += [(-0.6 if step // 10 % 2 else 0.6) * DEG for step in range(200)]
        said = [drive.tick(commands[index], commands[max(0, index - 5)]) for index in range(len(commands))]
        assert (not any(said)) == sound


def test_a_tachometer_that_gives_no_number_is_a_fault() -> None:
    drive = settled(0.3 * DEG)
    assert "azimuth tachometer reads nan, must be a number" in drive.tick(0.3 * DEG, tachometer=math.nan)


WIND_PARAMS = WindWatchParams(
    gust_limit_m_s=25.0, mean_limit_m_s=18.0, release_share=0.8, release_s=60.0, silence_s=5.0
)


def blow(watch: WindWatch, start_s: float, seconds: float, speed: float) -> tuple[float, str]:
    for t_s in np.arange(start_s, start_s + seconds, 0.1).tolist():
        watch.take(t_s, speed)
        reason = watch.step(t_s)
    return start_s + seconds, reason


def test_a_spike_shorter_than_a_gust_is_no_high_wind_and_a_gust_is() -> None:
    watch = WindWatch(WIND_PARAMS)
    t_s, reason = blow(watch, 0.0, 30.0, 10.0)
    t_s, reason = blow(watch, t_s, 0.5, 40.0)
    assert reason == ""
    t_s, reason = blow(watch, t_s, 3.0, 30.0)
    assert reason.startswith("gust ")


def test_a_steady_wind_below_the_gust_limit_stows_by_its_mean() -> None:
    watch = WindWatch(WIND_PARAMS)
    t_s, reason = blow(watch, 0.0, 600.0, 10.0)
    t_s, reason = blow(watch, t_s, 300.0, 20.0)
    assert reason == ""
    t_s, reason = blow(watch, t_s, 170.0, 20.0)
    assert reason == "", "480 s of it make a mean of 18 m/s"
    _, reason = blow(watch, t_s, 15.0, 20.0)
    assert reason.startswith("10-min mean 18.")


def test_the_antenna_comes_out_only_after_a_minute_well_below() -> None:
    watch = WindWatch(WIND_PARAMS)
    t_s, _ = blow(watch, 0.0, 10.0, 26.0)
    t_s, reason = blow(watch, t_s, 590.0, 21.0)
    assert reason, "between release and limit it stays in"
    t_s, reason = blow(watch, t_s, 400.0, 5.0)
    t_s, reason = blow(watch, t_s, 100.0, 5.0)
    assert reason == ""


def test_silence_is_high_wind_and_so_is_nonsense() -> None:
    watch = WindWatch(WIND_PARAMS)
    assert watch.step(0.0) == "", "an instrument may need a moment before its first reading"
    assert "has not been received" in watch.step(WIND_PARAMS.silence_s + 0.1)
    watch = WindWatch(WIND_PARAMS)
    t_s, reason = blow(watch, 0.0, 20.0, 3.0)
    assert reason == ""
    for step in range(60):
        watch.take(t_s + 0.1 * step, (math.nan, -1.0, 1e9)[step % 3])
    assert "silent for 5." in watch.step(t_s + 5.5)


@pytest.mark.parametrize("step_s", [-86400.0, -3.0, 5.0, 86400.0])
def test_a_step_of_the_clock_is_neither_silence_nor_calm(step_s: float) -> None:
    watch, unstepped = WindWatch(WIND_PARAMS), WindWatch(WIND_PARAMS)
    for each in (watch, unstepped):
        blow(each, 0.0, 20.0, 5.0)
        blow(each, 20.0, 300.0, 19.0)
    watch.clock_stepped(step_s)
    for t_s in np.arange(320.0, 420.0, 0.5).tolist():
        for each, by_s in ((watch, step_s), (unstepped, 0.0)):
            each.take(t_s + by_s, 19.0)
        assert watch.step(t_s + step_s) == unstepped.step(t_s)


def test_calm_must_last_for_the_release_time_and_begins_anew_with_every_gust() -> None:
    watch = WindWatch(WIND_PARAMS)
    t_s, _ = blow(watch, 0.0, 20.0, 5.0)
    t_s, reason = blow(watch, t_s, 4.0, 26.0)
    assert reason.startswith("gust ")
    t_s, reason = blow(watch, t_s, 40.0, 5.0)
    t_s, reason = blow(watch, t_s, 4.0, 26.0)
    # The 3-s mean is below 20 m/s after 0.9 s of it.
    t_s, reason = blow(watch, t_s, 60.5, 5.0)
    assert reason.startswith("gust ")
    _, reason = blow(watch, t_s, 1.0, 5.0)
    assert reason == ""


@pytest.mark.parametrize(("tick_s", "window_s", "differences"), [(0.02, 0.1, 5), (0.02, 0.16, 8), (0.1, 0.02, 1)])
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_drift_counts_over_the_window_and_no_longer(
    tick_s: float, window_s: float, differences: int, side: float
) -> None:
    params = AxisWatchParams(jump_rad=1.0, drift_rad=0.01, window_s=window_s)
    for share, found in ((1.05, True), (0.95, False)):
        watch, rate = AxisWatch(params, tick_s), 0.03
        step = side * share * 0.01 / differences
        said = []
        for tick in range(4 * differences + 1):
            encoder = 1.0 + tick * (rate * tick_s + step)
            said.append(watch.step((encoder, 0.5), (rate, 0.0))[1])
        # The first difference is between the second sample and the third: the first one is only trusted.
        assert [bool(words) for words in said] == [False] * (differences + 1) + [found] * (3 * differences)
        if found:
            wanted = math.degrees(side * share * 0.01)
            assert said[-1] == f"azimuth encoder moved {wanted:.3f} deg more than the drive, at most 0.573 deg"
        assert watch.cause == said[-1], "by the last window alone it is the same"


def test_without_a_tachometer_the_encoder_is_on_its_own() -> None:
    watch = AxisWatch(AXIS_PARAMS, TICK_S)
    for tick in range(8):
        place = 1.0 + 5e-5 * tick
        assert watch.step((place, 0.5), (math.nan, 0.0)) == ((place, 0.5), "")


@pytest.mark.parametrize(
    ("rates_deg_s", "command_deg_s", "found"),
    [
        ([0.6, 0.6, 0.6], 0.0, True),
        ([-0.6, -0.6, -0.6], 0.0, True),
        ([0.6, 0.4, 0.6], 0.0, False),  # once is no runaway
        ([0.45, 0.45, 0.45], 0.0, False),
        ([1.0, 0.98, 0.96], 0.0, False),  # it slows down
        ([0.0, 0.0, 0.0], 1.0, False),  # it stands still
        ([2.21, 2.21, 2.21], 5.0, True),
        ([2.19, 2.19, 2.19], 5.0, False),
        ([-2.21, -2.21, -2.21], -5.0, True),
    ],
)
def test_a_drive_too_fast_for_command_or_machine_twice_in_a_row_has_run_away(
    rates_deg_s: list[float], command_deg_s: float, found: bool
) -> None:
    watch = DriveWatch(DRIVE_PARAMS.replace(gained_rad_s=1.0), TICK_S)
    for rate in rates_deg_s:
        said = watch.step((0.0, rate * DEG), (0.0, command_deg_s * DEG))
    assert bool(said) is found
    if found:
        rate, overspeed = f"elevation drive runs at {rates_deg_s[-1]:.2f} deg/s", abs(rates_deg_s[-1]) > 2.2
        bound = "must be <= 2.20 deg/s" if overspeed else "commanded 0.00 deg/s, must be within 0.50 deg/s of it"
        assert said == watch.reason == f"{rate}, {bound}"
    watch.reset()
    assert watch.reason == ""


def test_after_a_step_back_in_time_old_readings_mean_nothing() -> None:
    watch = WindWatch(WIND_PARAMS)
    for t_s, speed in ((99.0, 20.0), (100.0, 24.0), (50.0, 3.0), (51.0, 4.0)):
        watch.take(t_s, speed)
    assert (watch.gust_m_s, watch.mean_m_s) == (3.5, 3.5)
    watch.take(51.0, 8.0)
    assert (watch.gust_m_s, watch.mean_m_s) == (8.0, 8.0)
    for nonsense in (150.0, -0.1, math.inf, math.nan):
        watch.take(52.0, nonsense)
    watch.take(52.0, 149.0)
    assert watch.gust_m_s == 78.5
