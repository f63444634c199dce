"""What is kept of the samples of a target: their order, their edges, and what a profile fills in behind them."""

import math

import numpy as np
import pytest

from rf_pointing.core import Target
from rf_pointing.planning import PassProfile
from rf_pointing.station.pointing.prediction import KEPT_S, LARGEST_GAP_S, TargetBuffer, time_key

START_S = 1000.0


def sample(t_s: float, azimuth_rad: float = 1.0, range_m: float = 1e6, gain_db: float = 0.0) -> Target:
    return Target(
        t_s=t_s, name="A", azimuth_rad=azimuth_rad, elevation_rad=0.5, azimuth_rate_rad_s=0.0,
        elevation_rate_rad_s=0.0, azimuth_acceleration_rad_s2=0.0, elevation_acceleration_rad_s2=0.0, range_m=range_m,
        range_rate_m_s=0.0, refraction_rad=0.0, satellite_gain_db=gain_db,
    )  # fmt: skip


def holding(*times: float) -> TargetBuffer:
    """Samples whose distance and gain tell their place: 1000 km + 1 km and -1 dB each."""
    buffer = TargetBuffer()
    for k, t_s in enumerate(times):
        buffer.add(sample(START_S + t_s, range_m=1e6 + 1e3 * k, gain_db=-float(k)))
    return buffer


def profile(times: np.ndarray, slope: tuple[float, float] = (0.02, -0.01)) -> PassProfile:
    """A pass on a straight line, the gain of its antenna -3 dB and 0.5 dB more every second."""
    since = times - times[0]
    return PassProfile(
        name="A", t_s=times, position_rad=np.array([2.0, 0.6]) + np.outer(since, slope),
        velocity_rad_s=np.tile(slope, (len(times), 1)), acceleration_rad_s2=np.zeros((len(times), 2)),
        sun_rad=np.full((len(times), 2), 0.1), range_m=np.full(len(times), 1e6), satellite_gain_db=-3.0 + 0.5 * since,
    )  # fmt: skip


def test_after_a_clear_nothing_of_the_old_target_is_left() -> None:
    buffer = holding(0.0, 1.0, 2.0)
    buffer.clear()
    assert (buffer.received_until_s, buffer.known_until_s) == (-math.inf, -math.inf)
    # Neither its turn of azimuth nor its distances and gains, which are matched by their order.
    for k in range(2):
        buffer.add(sample(START_S + k, azimuth_rad=8.0, range_m=5e6 + 1e5 * k, gain_db=-7.0 - k))
    assert buffer.at([START_S]).position[0, 0] == 8.0
    assert buffer.range_m(START_S + 0.5) == pytest.approx(5.05e6)
    assert buffer.satellite_gain_db(START_S + 0.5) == pytest.approx(-7.5)


def test_the_azimuth_is_on_the_turn_of_the_sample_before() -> None:
    buffer = TargetBuffer()
    buffer.add(sample(START_S, 6.2))
    buffer.add(sample(START_S + 1.0, 0.1))
    buffer.add(sample(START_S + 2.0, 0.3))
    assert buffer.at(START_S + np.arange(3.0)).position[:, 0] == pytest.approx(
        [6.2, 0.1 + 2.0 * math.pi, 0.3 + 2.0 * math.pi]
    )


def test_what_was_received_last_is_the_latest_time_of_a_message_and_not_of_a_profile() -> None:
    buffer = holding(0.0, 1.0)
    buffer.add(sample(START_S + 0.5))
    assert buffer.received_until_s == START_S + 1.0
    buffer.fill(profile(START_S + np.arange(9.0)), START_S + 1.0, START_S + 4.0, 1e6)
    assert (buffer.received_until_s, buffer.known_until_s) == (START_S + 1.0, START_S + 4.0)


def test_a_microsecond_is_one_time_and_three_are_two() -> None:
    for off_s in (-0.8e-6, 0.8e-6):
        buffer = holding(0.0, 1.0, 2.0)
        buffer.add(sample(START_S + 1.0 + off_s, azimuth_rad=1.3, range_m=3e6, gain_db=-9.0))
        assert buffer.range_m(START_S + 1.5) == pytest.approx(0.5 * (3e6 + 1.002e6))
        assert buffer.range_m(START_S + 0.5) == pytest.approx(0.5 * (3e6 + 1e6))
        assert buffer.satellite_gain_db(START_S + 1.0) == -9.0
        assert buffer.at([START_S + 1.0]).position[0, 0] == 1.3
    for off_s in (-3e-6, 3e-6):
        buffer = holding(0.0, 1.0, 2.0)
        buffer.add(sample(START_S + 1.0 + off_s, azimuth_rad=1.3, range_m=3e6, gain_db=-9.0))
        assert buffer.range_m([START_S + 1.0, START_S + 1.0 + off_s]) == pytest.approx([1.001e6, 3e6])
        assert buffer.at([START_S + 1.0]).position[0, 0] == 1.0


def test_what_lies_a_microsecond_outside_is_covered_and_what_lies_further_is_not() -> None:
    buffer = holding(0.0, 1.0, 2.0)
    for off_s, covered in ((0.8e-6, True), (3e-6, False)):
        assert buffer.covers(START_S - off_s, START_S + 1.0) is covered
        assert buffer.covers(START_S + 1.0, START_S + 2.0 + off_s) is covered
    at_the_edge = buffer.at([START_S - 0.8e-6, START_S + 2.0 + 0.8e-6]).position
    np.testing.assert_array_equal(at_the_edge, [[1.0, 0.5], [1.0, 0.5]])


@pytest.mark.parametrize(
    ("begin_s", "end_s", "covered"),
    [(0.0, 1.0, True), (0.2, 0.9, True), (1.0, 1.0, True), (0.5, 1.1, False), (1.1, 1.2, False), (3.9, 4.2, False),
     (4.0, 4.0, True), (4.0, 5.0, True), (4.5, 4.5, True), (0.0, 5.0, False), (1.0, 4.0, False)],
)  # fmt: skip
def test_a_gap_is_not_covered_from_any_side(begin_s: float, end_s: float, covered: bool) -> None:
    assert holding(0.0, 1.0, 4.0, 5.0).covers(START_S + begin_s, START_S + end_s) is covered


def test_the_longest_gap_itself_is_covered() -> None:
    assert holding(0.0, LARGEST_GAP_S).covers(START_S + 1.0, START_S + 2.0)
    assert not holding(0.0, LARGEST_GAP_S + 0.001).covers(START_S + 1.0, START_S + 2.0)


def test_two_samples_are_kept_however_far_apart_and_no_third_that_is_old() -> None:
    assert holding(0.0, 3.0 * KEPT_S).range_m(START_S) == 1e6
    assert holding(0.0, 2.0 * KEPT_S, 2.0 * KEPT_S + 1.0).range_m(START_S) == 1.001e6
    assert holding(0.0, 2.0, KEPT_S).range_m(START_S) == 1e6
    assert holding(0.0, 2.0, KEPT_S + 0.1).range_m(START_S) == 1.001e6


def test_a_quintic_meets_positions_rates_and_accelerations_of_both_samples() -> None:
    """x^5 - x^3 + 2 x over the first 2 s is the only quintic with these six values."""

    def motion(x: float) -> tuple[float, float, float]:
        return x**5 - x**3 + 2.0 * x, 5.0 * x**4 - 3.0 * x**2 + 2.0, 20.0 * x**3 - 6.0 * x

    buffer = TargetBuffer()
    for x in (0.0, 0.8):
        place, rate, acceleration = motion(x)
        buffer.add(
            Target(
                t_s=START_S + x, name="A", azimuth_rad=0.1 * place, elevation_rad=0.2 * place,
                azimuth_rate_rad_s=0.1 * rate, elevation_rate_rad_s=0.2 * rate,
                azimuth_acceleration_rad_s2=0.1 * acceleration, elevation_acceleration_rad_s2=0.2 * acceleration,
                range_m=1e6, range_rate_m_s=0.0, refraction_rad=0.0,
            )
        )  # fmt: skip
    for x in (0.1, 0.33, 0.7):
        found = buffer.at([START_S + x])
        for part, value in zip(found, motion(x), strict=True):
            # Times of 1000 s are exact to 1e-13 s.
            np.testing.assert_allclose(part[0], [0.1 * value, 0.2 * value], atol=1e-10)


# What a profile fills in


def test_a_profile_fills_one_row_beyond_either_end_and_no_more() -> None:
    buffer = TargetBuffer()
    buffer.fill(profile(START_S + np.arange(12.0)), START_S + 3.5, START_S + 5.5, 1e6)
    assert buffer.covers(START_S + 3.0, START_S + 6.0)
    assert not buffer.covers(START_S + 2.9, START_S + 3.0)
    assert buffer.known_until_s == START_S + 6.0
    # The whole of it, and no row before its first.
    short = TargetBuffer()
    short.fill(profile(START_S + np.arange(4.0)), START_S - 2.0, START_S + 9.0, 1e6)
    assert short.covers(START_S, START_S + 3.0)
    assert short.known_until_s == START_S + 3.0


def test_a_profile_replaces_no_sample_and_brings_its_motion_and_gain() -> None:
    times = START_S + np.arange(8.0)
    buffer, rows = TargetBuffer(), profile(times)
    buffer.add(sample(START_S + 1.0, azimuth_rad=2.5, gain_db=-9.0))
    buffer.fill(rows, START_S + 1.0, START_S + 3.0, 1e6)
    found = buffer.at(times[1:4])
    # From the sample on: 2.5 rad there, where the profile has 2.02 rad; 0.5 rad, where it has 0.59 rad.
    np.testing.assert_allclose(found.position, [[2.5, 0.5], [2.52, 0.49], [2.54, 0.48]], atol=1e-12)
    np.testing.assert_allclose(found.velocity, [[0.0, 0.0], [0.02, -0.01], [0.02, -0.01]])
    assert [buffer.satellite_gain_db(t_s) for t_s in times[1:4]] == pytest.approx([-9.0, -2.0, -1.5])
    # One sample does not tell how the distance changes.
    np.testing.assert_array_equal(buffer.range_m(times[1:4]), [1e6, 1e6, 1e6])


@pytest.mark.parametrize("ahead_s", [-1.0, 0.0, 7.0, 7.5])
def test_a_sample_outside_the_profile_does_not_move_it(ahead_s: float) -> None:
    times = START_S + 10.0 + np.arange(8.0)
    buffer = TargetBuffer()
    at_s = float(times[0]) + ahead_s
    buffer.add(sample(at_s, azimuth_rad=2.5))
    begin_s = float(times[6])
    buffer.fill(profile(times), begin_s, begin_s + 0.5, 1e6)
    shift = (0.5 - 0.02 * ahead_s) if 0.0 <= ahead_s <= 7.0 else 0.0
    # The row before, which is no mixture with the sample.
    assert buffer.at([begin_s - 1.0]).position[0, 0] == pytest.approx(2.0 + 0.1 + shift)


def test_a_distance_that_goes_on_falling_ends_at_one_metre() -> None:
    buffer = TargetBuffer()
    for k, range_m in enumerate((3000.0, 2000.0)):
        buffer.add(sample(START_S + k, range_m=range_m))
    buffer.fill(profile(START_S + np.arange(9.0)), START_S + 1.0, START_S + 4.0, 1e6)
    np.testing.assert_allclose(buffer.range_m(START_S + np.arange(2.0, 5.0)), [1000.0, 1.0, 1.0])


def test_instants_are_compared_by_whole_milliseconds() -> None:
    assert time_key(1.2344) == 1234
    assert time_key(1.2346) == 1235
    assert time_key(1_151_384_000.1 + 0.1) == time_key(1_151_384_000.2) == 1_151_384_000_200
