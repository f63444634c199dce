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
            resolution_rad=(resolution_deg * DEG,) * 2, minimum_interval_s=interval_s,
            dead_band_rad=(dead_band_deg * DEG,) * 2, latency_s=latency_s, **{**TRAVEL, **changes},
        )  # fmt: skip
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


def test_a_moving_target_gets_a_set_point_an_interval_whatever_the_ticks_round_to() -> None:
    """Ticks of 0.02 s add up to an interval of 0.5 s only to rounding; none may cost another tick."""
    track = Track(0.1, interval_s=0.5)
    track.follow(steady(1.7), 5.0)
    track.rotator.count_anew()
    track.follow(steady(1.7), 40.0)
    assert track.rotator.counts.commands == pytest.approx(80, abs=1)


def test_noise_of_a_tracking_loop_starts_no_relay(random: np.random.Generator) -> None:
    """A target that stands, with corrections of a fifth of a step to either side."""
    track = Track(1.0)
    noise = 0.2 * DEG * random.uniform(-1.0, 1.0, 1000)
    track.follow(lambda _: ([0.5, 0.5], [0.0, 0.0], [0.0, 0.0]), 10.0)
    track.rotator.count_anew()
    # 600 corrections: the first ones may be past the middle between two steps.
    path = lambda t_s: ([0.5 + noise[int(10.0 * t_s)]] * 2, [noise[int(10.0 * t_s) + 1]] * 2, [0.0, 0.0])  # noqa: E731
    track.follow(path, 60.0)
    assert max(track.rotator.counts.starts) <= 2


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
    assert track.rotator.counts.commands == 0


class Shown(Drive):
    """A device that shows given angles at given times, then what `shows` says, and keeps its set points."""

    def __init__(self, *rows: tuple[float, float, float], step_rad: float = 1e-3, **stated: object) -> None:
        usual = {"resolution_rad": (step_rad, step_rad), "rate_rad_s": (0.1, 0.1), "period_s": 0.2}
        self.capabilities = Capabilities(set_points=POSITION, **{**usual, **stated})
        self.rows, self.shows = iter(rows), rows[-1][1:]
        self.sent: list[tuple[float, float]] = []
        self.stopped = 0

    def go_to(self, position_rad: tuple[float, float]) -> None:
        self.sent.append(position_rad)

    def step(self, t_s: float) -> DriveReading:
        row = next(self.rows, (t_s, *self.shows))
        return DriveReading(t_s=row[0], position_rad=row[1:])

    def stop(self) -> None:
        self.stopped += 1


def standing(azimuth: float, elevation: float, step_rad: float = 1e-6) -> Shown:
    return Shown((0.0, azimuth, elevation), step_rad=step_rad, period_s=0.02)


def test_the_rate_is_the_way_over_the_time_from_the_first_readings_on() -> None:
    rotator = Rotator(Shown((5.0, 0.50, 0.60), (5.2, 0.51, 0.58), (5.4, 0.53, 0.54)), RotatorParams(**TRAVEL))
    assert rotator.position_rad == (0.0, 0.0)
    rotator.step(5.0)
    assert rotator.rate_rad_s == (0.0, 0.0)
    rotator.step(5.2)
    assert rotator.rate_rad_s == pytest.approx((0.05, -0.1))
    rotator.step(5.4)
    assert rotator.rate_rad_s == pytest.approx((0.075, -0.15))


def test_two_readings_of_one_time_are_no_motion() -> None:
    rotator = Rotator(Shown((5.0, 0.5, 0.6), (5.0, 0.7, 0.9)), RotatorParams(**TRAVEL))
    for _ in range(2):
        rotator.step(5.0)
    assert rotator.position_rad == (0.7, 0.9)
    assert rotator.rate_rad_s == (0.0, 0.0)


def test_an_elevation_that_the_device_does_not_have_is_level_until_it_is_set() -> None:
    rotator = Rotator(Shown((5.0, 0.5, 0.6), has_elevation=False), RotatorParams(**TRAVEL))
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


def at_rest(azimuth: float, elevation: float) -> Motion:
    return Motion(np.array([azimuth, elevation]), np.zeros(2), np.zeros(2))


@pytest.mark.parametrize(
    ("stated_s", "row", "latency_s"),
    [
        # 0.03 rad on its way at 0.1 rad/s at 10.9: it began at 10.6, half a step earlier or later.
        (0.2, (10.9, 0.53, 0.6), 0.595), (0.597, (10.9, 0.53, 0.6), 0.597),
        (1.5, (10.9, 0.53, 0.6), 0.605),
        # Arrived by 10.9 after 0.4 s on its way, still at rest at 10.5.
        (0.1, (10.9, 0.54, 0.6), 0.495), (0.5, (10.9, 0.54, 0.6), 0.5),
        (2.0, (10.9, 0.54, 0.6), 0.505),
        # A whole step from its goal it has not arrived: it began at 10.51; nor six tenths of one: 10.506.
        (0.1, (10.9, 0.539, 0.6), 0.505), (0.1, (10.9, 0.5394, 0.6), 0.501),
    ],
)  # fmt: skip
def test_the_latency_is_moved_into_what_the_first_reading_of_a_motion_leaves_open(
    stated_s: float, row: tuple[float, float, float], latency_s: float
) -> None:
    params = RotatorParams(latency_s=stated_s, rate_rad_s=(0.1, 0.1), minimum_interval_s=0.0, **TRAVEL)
    drive = Shown((9.7, 0.5, 0.6), (9.9, 0.5, 0.6), (10.1, 0.5, 0.6), (10.3, 0.5, 0.6), (10.5, 0.5, 0.6), row)
    rotator = Rotator(drive, params)
    for t_s in (9.7, 9.9):
        rotator.step(t_s)
    rotator.follow(10.0, at_rest(0.54, 0.6), at_rest(0.54, 0.6))
    assert drive.sent == [pytest.approx((0.54, 0.6))]
    for t_s in (10.1, 10.3, 10.5, row[0]):
        rotator.step(t_s)
    assert rotator.latency_s == pytest.approx(latency_s, abs=1e-9)


def test_a_simulated_rotator_does_not_start_within_its_dead_band_and_counts_starts_and_turns() -> None:
    params = RotatorParams(
        rate_rad_s=(0.1, 0.1), latency_s=0.0, resolution_rad=(1e-3, 1e-3), dead_band_rad=(0.02, 0.0), **TRAVEL
    )
    drive = SimulatedRotator(DriveParams(type="simulated_rotator", rotator=params), (0.5, 0.5))
    model, t_s = drive.model, 0.0

    def go(*goal: float, seconds: float = 10.0) -> None:
        nonlocal t_s
        drive.step(t_s)
        drive.go_to((goal[0], goal[1]))
        t_s += seconds
        drive.step(t_s)

    go(0.519, 0.499)
    assert drive.truth_rad == pytest.approx((0.5, 0.499))
    assert (model.starts, model.reversals) == ([0, 1], [0, 0])
    # The first motion of an axis is no change of direction, whichever way it goes.
    go(0.4, 0.499)
    assert drive.truth_rad == pytest.approx((0.4, 0.499))
    assert (model.starts, model.reversals) == ([1, 1], [0, 0])
    # On in the same direction while it moves is no start; back is both.
    go(0.2, 0.499, seconds=1.0)
    go(0.1, 0.499, seconds=1.0)
    assert (model.starts, model.reversals, model.moving) == ([2, 1], [0, 0], True)
    go(0.3, 0.6)
    assert (model.starts, model.reversals, model.moving) == ([3, 2], [1, 1], False)
    assert drive.truth_rad == pytest.approx((0.3, 0.6))
    # Beyond its travel it goes to the end.
    go(-9.0, 9.0, seconds=100.0)
    assert drive.truth_rad == pytest.approx((TRAVEL["travel_min_rad"][0], TRAVEL["travel_max_rad"][1]))


def test_a_simulated_rotator_is_read_in_whole_steps_within_a_turn_once_a_poll() -> None:
    params = RotatorParams(resolution_rad=(0.1, 0.2), zero_rad=(0.5, 0.0), reads_one_turn=True, latency_s=0.3, **TRAVEL)
    drive = SimulatedRotator(
        DriveParams(type="simulated_rotator", rotator=params, link=LinkParams(poll_period_s=0.5)), (0.34, 0.53)
    )
    readings = [drive.step(0.02 * k) for k in range(101)]
    times = sorted({reading.t_s for reading in readings})
    assert times == pytest.approx([0.0, 0.5, 1.0, 1.5, 2.0])
    plain = SimulatedRotator(DriveParams(type="simulated_rotator"), (0.5, 0.5))
    assert plain.capabilities.resolution_rad == pytest.approx((DEG, DEG)), "where no steps are stated"
    # -0.16 of the device is -0.2 in its steps, and that is a turn less 0.2.
    assert readings[-1].position_rad == pytest.approx((2.0 * math.pi - 0.2, 0.6))
    assert drive.truth_rad == pytest.approx((-0.16, 0.53))
    assert (drive.capabilities.period_s, drive.capabilities.latency_s) == (0.5, 0.3)
    # A clock that goes back moves nothing.
    drive.go_to((1.0, 0.53))
    drive.step(3.0)
    before = drive.truth_rad
    drive.step(2.0)
    assert drive.truth_rad == before


class Chase:
    """A rotator of 0.1 rad/s without latency that follows one path on both axes, 0.02 s a tick; steps of a microradian."""

    def __init__(self, start: float = 1.0, **params: object) -> None:
        usual = {
            "rate_rad_s": (0.1, 0.1), "latency_s": 0.0, "minimum_interval_s": 0.5,
            "minimum_move_rad": (0.01, 0.01),
        }  # fmt: skip
        self.drive = standing(start, start)
        self.rotator = Rotator(self.drive, RotatorParams(**{**TRAVEL, **usual, **params}))
        self.t_s, self.place = 10.0, start
        self.rotator.step(self.t_s)

    def go(self, rate: float, seconds: float, goal: float | None = None) -> list[tuple[float, float]]:
        """Move the target on; return where it was at each new set point of the azimuth, and that."""
        found = []
        for _ in range(round(seconds / TICK_S)):
            self.t_s += TICK_S
            self.place += rate * TICK_S
            self.rotator.step(self.t_s)
            motion = Motion(np.full(2, self.place), np.full(2, rate), np.zeros(2))
            before = self.rotator.set_point_rad[0]
            self.rotator.follow(self.t_s, motion, Motion(*motion) if goal is None else at_rest(goal, goal))
            self.rotator.latency_s = 0.0
            after = self.rotator.set_point_rad[0]
            if after != before:
                found.append((self.place, after))
        return found


def test_no_set_point_passes_a_goal_that_stands() -> None:
    chase = Chase()
    found = [after for _, after in chase.go(0.03, 1.2, goal=1.0393)]
    # Half a step ahead of a target at 1.037 rad would be at 1.045.
    assert found == [pytest.approx(each, abs=7e-4) for each in (1.0150, 1.0300, 1.0393)]
    assert found[-1] == pytest.approx(1.0393, abs=1e-6)


def test_the_end_of_the_travel_is_reached_also_where_it_is_no_whole_step() -> None:
    drive = standing(0.0, 0.0, step_rad=0.01)
    params = RotatorParams(
        rate_rad_s=(0.1, 0.1), minimum_interval_s=0.0, latency_s=0.0, travel_min_rad=(0.0, 0.0),
        travel_max_rad=(0.106, 0.5),
    )  # fmt: skip
    rotator = Rotator(drive, params)
    for k, goal in enumerate((0.1, 0.2)):
        rotator.step(10.0 + k)
        rotator.follow(10.0 + k, at_rest(goal, goal), at_rest(goal, goal))
    assert [first for first, _ in drive.sent] == pytest.approx([0.1, 0.106])


def test_starts_and_changes_of_direction_are_counted_by_axis_from_each_beginning() -> None:
    drive = standing(1.0, 1.0)
    params = RotatorParams(rate_rad_s=(0.1, 0.1), minimum_interval_s=0.0, latency_s=0.0, **TRAVEL)
    rotator = Rotator(drive, params)

    def go(t_s: float, azimuth: float, elevation: float) -> MoveCounts:
        rotator.step(t_s)
        motion = at_rest(azimuth, elevation)
        rotator.follow(t_s, motion, at_rest(azimuth, elevation))
        drive.shows = (azimuth, elevation)
        return rotator.counts

    assert go(10.0, 0.9, 0.9) == MoveCounts(1, [1, 1], [0, 0]), "the first motion is no change of direction"
    assert go(20.0, 1.2, 0.8) == MoveCounts(2, [2, 2], [1, 0])
    assert go(30.0, 1.1, 0.7) == MoveCounts(3, [3, 3], [2, 0])
    rotator.count_anew()
    assert rotator.counts == MoveCounts(0, [0, 0], [0, 0])
    assert go(40.0, 1.3, 0.6) == MoveCounts(1, [1, 1], [0, 0]), "nor the first of a pass"
    assert go(50.0, 1.2, 0.7) == MoveCounts(2, [2, 2], [1, 1])
    rotator.stop()
    assert (drive.stopped, rotator.set_point_rad) == (1, (None, None))
    assert go(60.0, 1.3, 0.6) == MoveCounts(3, [3, 3], [1, 1]), "nor the first after a stop"
    rotator.count_anew()
    assert go(70.0, 1.2, 0.7) == MoveCounts(1, [1, 1], [0, 0])


def test_a_reading_that_is_not_trusted_is_replaced_in_place_and_rate() -> None:
    rotator = Rotator(Shown((5.0, 0.5, 0.6), (5.25, 0.6, 0.7), (5.5, 3.0, 3.0)), RotatorParams(**TRAVEL))
    for t_s in (5.0, 5.25, 5.5):
        rotator.step(t_s)
    rotator.correct((0.7, 0.5))
    assert rotator.position_rad == (0.7, 0.5)
    assert rotator.rate_rad_s == pytest.approx((0.4, -0.2))
