"""Set points of a rotator: where it stands on the mean, how often its relays are closed, and its turns."""

import math

import numpy as np
import pytest

from rf_pointing.core import Motion
from rf_pointing.drives import DriveParams, DriveReading, LinkParams, Rotator, RotatorParams, SimulatedRotator
from rf_pointing.drives.drive import POSITION, Capabilities, Drive
from rf_pointing.drives.rotator import MoveCounts

TICK_S = 0.02
TRAVEL = {"travel_min_rad": (-math.pi, 0.0), "travel_max_rad": (1.5 * math.pi, math.pi)}
DEG = math.pi / 180.0


class Track:
    """A rotator along a given motion."""

    def __init__(self, resolution_deg: float, interval_s: float = 0.5, dead_band_deg: float = 0.0,
                 stated_latency_s: float = 0.2, latency_s: float = 0.2, **changes: object) -> None:  # fmt: skip
        params = RotatorParams(
            resolution_rad=(resolution_deg * DEG,) * 2,
            minimum_interval_s=interval_s,
            dead_band_rad=(dead_band_deg * DEG,) * 2,
            latency_s=latency_s,
            **{**TRAVEL, **changes},
        )
        drive_params = DriveParams(type="simulated_rotator", link=LinkParams(poll_period_s=0.2), rotator=params)
        self.drive = SimulatedRotator(drive_params, (0.5, 0.5))
        self.rotator = Rotator(self.drive, params.replace(latency_s=stated_latency_s))
        self.t_s, self.error, self.moved = 0.0, [], []
        self.rotator.step(0.0)

    def follow(self, path, seconds: float, goal=None) -> None:
        for _ in range(round(seconds / TICK_S)):
            self.t_s += TICK_S
            self.rotator.step(self.t_s)
            motion = Motion(*(np.array(part) for part in path(self.t_s)))
            self.rotator.follow(self.t_s, motion, goal or Motion(*motion))
            self.error.append(np.array(self.drive.model.position_rad) - motion.position)
            self.moved.append(tuple(self.drive.model.position_rad))


def steady(rate_deg_s: float, from_rad: float = 0.5):
    rate = rate_deg_s * DEG
    return lambda t_s: ([from_rad + rate * t_s] * 2, [rate] * 2, [0.0, 0.0])


@pytest.mark.parametrize("latency_s", [0.05, 0.2, 0.4])
@pytest.mark.parametrize("resolution_deg", [0.1, 1.0])
@pytest.mark.parametrize("rate_deg_s", [0.05, 0.3, 0.9, 1.7, -1.3])
def test_the_mean_error_is_least_and_the_largest_is_half_a_step(
    rate_deg_s: float, resolution_deg: float, latency_s: float
) -> None:
    """The latency is measured: it is stated wrongly.  No rate here gives whole steps in an interval."""
    track = Track(resolution_deg, latency_s=latency_s)
    seconds = 40.0 + 10.0 * resolution_deg / abs(rate_deg_s)
    start = 2.5 if rate_deg_s < 0.0 else 0.5
    track.follow(lambda _: ([start, start], [0.0, 0.0], [0.0, 0.0]), 12.0)
    begun_s = track.t_s
    path = steady(rate_deg_s, start)
    track.follow(lambda t_s: path(t_s - begun_s), 20.0)
    track.error.clear()
    track.follow(lambda t_s: path(t_s - begun_s), seconds)
    error = np.array(track.error) / DEG
    half = 0.5 * max(resolution_deg, abs(rate_deg_s) * 0.5)
    # Readings a poll period apart tell the latency to half of it.
    assert track.rotator.latency_s == pytest.approx(latency_s, abs=0.1 + TICK_S)
    assert np.max(np.abs(np.mean(error, axis=0))) < 0.1 * abs(rate_deg_s) + 0.15 * half
    assert np.max(np.abs(error)) < 0.5 * resolution_deg + abs(rate_deg_s) * (0.25 + 0.1 + TICK_S)


def culmination(t_s: float) -> tuple[list[float], list[float], list[float]]:
    """Up to 40 deg and down again; the azimuth goes on."""
    width_s = 120.0
    phase = math.pi * t_s / width_s
    elevation = [0.5 * math.sin(phase), 0.5 * math.cos(phase) * math.pi / width_s,
                 -0.5 * math.sin(phase) * (math.pi / width_s) ** 2]  # fmt: skip
    return [0.01 * t_s, elevation[0]], [0.01, elevation[1]], [0.0, elevation[2]]


@pytest.mark.parametrize("dead_band_deg", [0.0, 2.0])
def test_a_relay_rotator_turns_back_once_and_starts_once_a_step(dead_band_deg: float) -> None:
    track = Track(1.0, dead_band_deg=dead_band_deg)
    track.follow(lambda _: culmination(0.0), 10.0)
    track.rotator.count_anew()
    model, begun_s = track.drive.model, track.t_s
    starts, model.reversals, model._direction = list(model.starts), [0, 0], [0.0, 0.0]
    track.follow(lambda t_s: culmination(t_s - begun_s), 120.0)
    counts = track.rotator.counts()
    assert counts.reversals == (0, 1)
    assert model.reversals == [0, 1]
    assert counts.starts == pytest.approx([a - b for a, b in zip(model.starts, starts, strict=True)], abs=1)
    assert counts.commands <= 2.0 * 120.0
    step_deg = max(1.0, dead_band_deg)
    assert counts.starts[0] <= math.degrees(1.2) / step_deg + 2
    assert counts.starts[1] <= 2.0 * math.degrees(0.5) / step_deg + 2
    # Another pass counts from here.
    track.rotator.count_anew()
    assert track.rotator.counts() == MoveCounts()


def test_a_moving_target_gets_a_set_point_an_interval_whatever_the_ticks_round_to() -> None:
    """Ticks of 0.02 s add up to an interval of 0.5 s only to rounding; none may cost another tick."""
    track = Track(0.1, interval_s=0.5)
    track.follow(steady(1.7), 5.0)
    track.rotator.count_anew()
    track.follow(steady(1.7), 40.0)
    assert track.rotator.counts().commands == pytest.approx(80, abs=1)


def test_a_simulated_rotator_without_a_stated_resolution_has_steps_of_a_degree() -> None:
    drive = SimulatedRotator(DriveParams(type="simulated_rotator"), (0.5, 0.5))
    assert drive.capabilities.resolution_rad == pytest.approx((DEG, DEG))


def test_noise_of_a_tracking_loop_starts_no_relay(random: np.random.Generator) -> None:
    """A target that stands, with corrections of a fifth of a step to either side."""
    track = Track(1.0)
    noise = 0.2 * DEG * random.uniform(-1.0, 1.0, 1000)
    track.follow(lambda _: ([0.5, 0.5], [0.0, 0.0], [0.0, 0.0]), 10.0)
    track.rotator.count_anew()
    # 600 corrections: the first ones may be past the middle between two steps.
    path = lambda t_s: ([0.5 + noise[int(10.0 * t_s)]] * 2, [noise[int(10.0 * t_s) + 1]] * 2, [0.0, 0.0])  # noqa: E731
    track.follow(path, 60.0)
    assert max(track.rotator.counts().starts) <= 2


def test_a_slew_ends_where_it_leads_and_passes_it_never() -> None:
    """At the device's own speed it moves in one go: a start for each axis, and no way back."""
    track, goal = Track(1.0), np.array([2.0, 1.0])
    rate, acceleration = 6.0 * DEG, 6.0 * DEG

    def slew(t_s: float):
        length = goal - 0.5
        rows = []
        for size in length:
            full = size / rate + rate / acceleration
            t = min(t_s, full)
            if t < rate / acceleration:
                rows.append((0.5 * acceleration * t * t, acceleration * t, acceleration))
            elif t < size / rate:
                rows.append((rate * (t - 0.5 * rate / acceleration), rate, 0.0))
            else:
                left = full - t
                rows.append(
                    (size - 0.5 * acceleration * left * left, acceleration * left, -acceleration * (left > 0.0))
                )
        position, velocity, change = (np.array(part) for part in zip(*rows, strict=True))
        return position + 0.5, velocity, change

    track.follow(slew, 30.0, Motion(goal, np.zeros(2), np.zeros(2)))
    moved = np.array(track.moved)
    assert np.max(moved - goal) <= 0.5 * DEG
    assert np.max(np.abs(moved[-1] - goal)) <= 0.51 * DEG
    assert track.drive.model.reversals == [0, 0]
    assert max(track.drive.model.starts) <= 3


def test_an_azimuth_read_modulo_a_turn_is_continuous_and_keeps_its_turn() -> None:
    track = Track(1.0, reads_one_turn=True)
    track.rotator.place(0.5)
    track.follow(steady(3.0), 100.0)
    assert track.rotator.position_rad[0] == pytest.approx(1.5 * math.pi, abs=2.0 * DEG), "the end of the travel"
    assert track.drive.step(track.t_s).position_rad[0] < 2.0 * math.pi
    track.rotator.place(track.rotator.position_rad[0] - 2.0 * math.pi)
    assert track.rotator.position_rad[0] == pytest.approx(-0.5 * math.pi, abs=2.0 * DEG)


def test_set_points_of_a_controller_of_one_turn_are_folded() -> None:
    sent = []
    track = Track(1.0, takes_one_turn=True, reads_one_turn=True)
    track.drive.go_to = sent.append
    track.follow(lambda _: ([-1.0, 0.5], [0.0, 0.0], [0.0, 0.0]), 1.0)
    assert sent[-1][0] == pytest.approx(2.0 * math.pi - 1.0, abs=0.51 * DEG)


def test_between_two_readings_the_estimate_is_where_the_device_is() -> None:
    track = Track(0.1)
    worst = []
    path = steady(2.0)
    for _ in range(2000):
        track.follow(path, TICK_S)
        worst.append(np.max(np.abs(np.array(track.rotator.estimate(track.t_s)) - track.drive.model.position_rad)))
    assert math.degrees(max(worst[100:])) < 0.1 + 6.0 * 0.05


def test_without_a_reading_nothing_is_commanded() -> None:
    track = Track(1.0)
    track.rotator.reading = None
    track.drive.step = lambda _: None
    track.follow(steady(3.0), 2.0)
    assert track.rotator.counts().commands == 0


def test_a_reading_knows_its_age() -> None:
    assert DriveReading(t_s=1.0, position_rad=(0.0, 0.0)).age_s(1.5) == 0.5


class Readings(Drive):
    """A device that shows given angles at given times."""

    def __init__(self, *rows: tuple[float, float, float], has_elevation: bool = True) -> None:
        self.capabilities = Capabilities(
            set_points=POSITION, resolution_rad=(1e-3, 1e-3), rate_rad_s=(0.1, 0.1), period_s=0.2,
            has_elevation=has_elevation,
        )  # fmt: skip
        self.rows = iter(rows)

    def step(self, _t_s: float) -> DriveReading | None:
        row = next(self.rows, None)
        return None if row is None else DriveReading(t_s=row[0], position_rad=row[1:])


def test_the_rate_is_the_way_over_the_time_from_the_first_readings_on() -> None:
    rotator = Rotator(Readings((5.0, 0.50, 0.60), (5.2, 0.51, 0.58), (5.4, 0.53, 0.54)), RotatorParams(**TRAVEL))
    assert rotator.position_rad == (0.0, 0.0)
    rotator.step(5.0)
    assert rotator.rate_rad_s == (0.0, 0.0)
    rotator.step(5.2)
    assert rotator.rate_rad_s == pytest.approx((0.05, -0.1))
    rotator.step(5.4)
    assert rotator.rate_rad_s == pytest.approx((0.075, -0.15))


def test_two_readings_of_one_time_are_no_motion() -> None:
    rotator = Rotator(Readings((5.0, 0.5, 0.6), (5.0, 0.7, 0.9)), RotatorParams(**TRAVEL))
    for _ in range(2):
        rotator.step(5.0)
    assert rotator.position_rad == (0.7, 0.9)
    assert rotator.rate_rad_s == (0.0, 0.0)


def test_an_elevation_that_the_device_does_not_have_is_level_until_it_is_set() -> None:
    rotator = Rotator(Readings((5.0, 0.5, 0.6), has_elevation=False), RotatorParams(**TRAVEL))
    rotator.step(5.0)
    assert rotator.position_rad == (0.5, 0.0)


def test_a_simulated_set_point_acts_after_its_latency_within_a_long_step_too_and_a_stop_at_once() -> None:
    params = RotatorParams(rate_rad_s=(0.1, 0.05), latency_s=0.2, resolution_rad=(1e-3, 1e-3), **TRAVEL)
    drive = SimulatedRotator(DriveParams(type="simulated_rotator", rotator=params), (0.5, 0.5))
    drive.step(0.0)
    drive.go_to((1.5, 1.5))
    drive.step(1.0)
    # 0.8 s of the second: the rest is latency.
    assert drive.truth_rad == pytest.approx((0.58, 0.54))
    drive.go_to((0.0, 0.0))
    drive.step(2.0)
    # On for 0.2 s, then back for 0.8 s.
    assert drive.truth_rad == pytest.approx((0.52, 0.51))
    drive.stop()
    drive.step(3.0)
    assert drive.truth_rad == pytest.approx((0.52, 0.51))
