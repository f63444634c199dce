"""What is kept of the samples of a target: their order, their edges, and what a profile fills in behind them."""

import numpy as np
import pytest

from rf_pointing.core import Target
from rf_pointing.planning import PassProfile
from rf_pointing.station.pointing.prediction import TargetBuffer

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


@pytest.mark.parametrize(
    ("begin_s", "end_s", "covered"),
    [(0.0, 1.0, True), (0.2, 0.9, True), (1.0, 1.0, True), (0.5, 1.1, False), (1.1, 1.2, False), (3.9, 4.2, False),
     (4.0, 4.0, True), (4.0, 5.0, True), (4.5, 4.5, True), (0.0, 5.0, False), (1.0, 4.0, False)],
)  # fmt: skip
def test_a_gap_is_not_covered_from_any_side(begin_s: float, end_s: float, covered: bool) -> None:
    assert holding(0.0, 1.0, 4.0, 5.0).covers(START_S + begin_s, START_S + end_s) is covered


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
    assert [buffer.path(t_s)[1] for t_s in times[1:4]] == pytest.approx([-9.0, -2.0, -1.5])
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


def test_a_sample_is_late_that_lags_what_is_usual_by_a_period_and_one_that_has_ended_is_not() -> None:
    buffer = TargetBuffer()
    assert not buffer.late(START_S), "nothing has arrived yet"
    for period in range(5):
        buffer.add(sample(START_S + 2.0 + 0.1 * period))
        assert not buffer.late(START_S + 0.1 * period)
    assert [buffer.late(START_S + 0.1 * period) for period in (5, 6, 13, 15)] == [True, True, True, False]
    buffer.clear()
    assert not buffer.late(START_S)
