"""Messages sent ahead: merging, refusing, interpolating, running dry."""

import math

import numpy as np
import pytest

from rf_pointing.controllers import TrajectoryBuffer, TrajectoryBufferParams
from rf_pointing.core import MDEG, JointTrajectory

NANORADIAN = 1e-9


def motion(t_s: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A smooth two-axis motion of the size of a fast pass."""
    t = np.atleast_1d(t_s)[:, None]
    rate, phase = np.array([0.02, 0.013]), np.array([0.3, 1.1])
    argument = rate * t + phase
    return np.sin(argument), rate * np.cos(argument), -(rate**2) * np.sin(argument)


def message(begin_s: float, end_s: float, step_s: float = 0.1, shift_rad: float = 0.0) -> JointTrajectory:
    t_s = np.arange(begin_s, end_s + 1e-9, step_s)
    position, velocity, acceleration = motion(t_s)
    return JointTrajectory(
        t_s=t_s, position_rad=position + shift_rad, velocity_rad_s=velocity, acceleration_rad_s2=acceleration
    )


def buffer(**changes: float) -> TrajectoryBuffer:
    return TrajectoryBuffer(TrajectoryBufferParams(**changes))


def test_interpolation_of_a_two_second_table_is_exact_to_a_nanoradian() -> None:
    table = buffer(horizon_s=20.0)
    assert table.accept(message(0.0, 20.0, 2.0), 0.0) == ""
    for t_s in np.arange(0.0, 20.0, 0.37):
        sample = table.at(t_s)
        position, velocity, acceleration = motion(t_s)
        np.testing.assert_allclose(sample.position_rad, position[0], atol=NANORADIAN)
        np.testing.assert_allclose(sample.velocity_rad_s, velocity[0], atol=NANORADIAN)
        np.testing.assert_allclose(sample.acceleration_rad_s2, acceleration[0], atol=2.0 * NANORADIAN)


def test_places_larger_than_the_times_are_interpolated_alike() -> None:
    """Azimuths of several radians in the first second: a time is not taken for an angle."""
    table = buffer()
    table.accept(message(0.0, 1.0, shift_rad=6.0), 0.0)
    table.accept(message(0.5, 2.0, shift_rad=6.001), 0.0)
    for t_s in [*np.arange(0.0, 0.4, 0.03), *np.arange(0.5, 2.0, 0.03)]:
        shift_rad = 6.0 if t_s < 0.45 else 6.001
        np.testing.assert_allclose(table.at(t_s).position_rad, motion(t_s)[0][0] + shift_rad, atol=NANORADIAN)


def test_a_newer_message_replaces_the_overlapping_future_only() -> None:
    table = buffer()
    table.accept(message(0.0, 1.0), 0.0)
    table.accept(message(0.5, 1.5, shift_rad=1e-3), 0.2)
    np.testing.assert_allclose(table.at(0.35).position_rad, motion(0.35)[0][0], atol=NANORADIAN)
    np.testing.assert_allclose(table.at(0.7).position_rad, motion(0.7)[0][0] + 1e-3, atol=NANORADIAN)
    assert table.lead_s(0.2) == pytest.approx(1.3)


@pytest.mark.parametrize(
    ("begin_s", "end_s", "now_s", "words"),
    [
        (0.0, 1.0, 5.0, "stale: its last point is 4.000 s in the past"),
        (100.0, 101.0, 5.0, "future: it begins 95.000 s ahead, must be <= 3.0 s"),
        (5.1, 21.0, 5.0, "future: it ends 16.000 s ahead, must be <= 15.0 s"),
        (5.1, 70.0, 5.0, "too long: it has 650 points, must have <= 600"),
        (0.1, 9.0, 5.0, "out of order: it begins 3.900 s before"),
        (4.0, 6.0, 5.0, "duplicate"),
    ],
)
def test_messages_out_of_time_are_refused_with_the_reason(
    begin_s: float, end_s: float, now_s: float, words: str
) -> None:
    table = buffer()
    table.accept(message(4.0, 6.0), 4.0)
    assert table.accept(message(begin_s, end_s), now_s).startswith(words)
    assert table.lead_s(5.0) == pytest.approx(1.0)


def test_a_dry_table_extrapolates_for_its_limit_and_then_says_so() -> None:
    table = buffer(extrapolation_s=1.0)
    table.accept(message(0.0, 1.0), 0.0)
    np.testing.assert_allclose(table.at(1.5).position_rad, motion(1.5)[0][0], atol=0.05 * MDEG)
    dry = table.at(2.01)
    assert dry.source == "dry"
    np.testing.assert_array_equal(dry.velocity_rad_s, np.zeros(2))
    np.testing.assert_allclose(dry.position_rad, table.at(2.0).position_rad, atol=1e-12)
    assert table.lead_s(2.0) == pytest.approx(-1.0)


def test_a_long_gap_is_not_bridged() -> None:
    table = buffer(max_gap_s=2.0, extrapolation_s=1.0, max_lead_s=10.0)
    table.accept(message(0.0, 1.0), 0.0)
    table.accept(message(10.0, 11.0), 0.5)
    assert [table.at(t).source for t in (0.5, 1.0, 1.9, 2.1, 9.9, 10.5)] == [
        "table",
        "table",
        "extrapolated",
        "early",
        "early",
        "table",
    ]


def test_old_points_are_forgotten_and_the_present_stays() -> None:
    table = buffer(keep_s=1.05)
    for k in range(300):
        assert table.accept(message(0.1 * k, 0.1 * k + 1.0), 0.1 * k) == ""
    assert len(table.state[0]) < 25
    np.testing.assert_allclose(table.at(29.93).position_rad, motion(29.93)[0][0], atol=NANORADIAN)
    # What is newer than 1.05 s at the latest message, 29.9 s, and the point before.
    times = table.state[0][:, 0]
    assert times[0] == pytest.approx(28.8)
    assert times[-1] == pytest.approx(30.9)
    np.testing.assert_allclose(table.at(28.95).position_rad, motion(28.95)[0][0], atol=NANORADIAN)


def test_an_empty_buffer_has_no_lead_and_refuses_to_answer() -> None:
    table = buffer()
    assert table.empty
    assert table.lead_s(0.0) == -math.inf
    with pytest.raises(ValueError, match="empty"):
        table.at(0.0)
    table.accept(message(0.0, 1.0), 0.0)
    table.clear()
    assert table.empty


def test_only_the_table_and_its_extrapolation_are_to_be_followed() -> None:
    table = buffer(extrapolation_s=1.0)
    table.accept(message(2.0, 4.0), 0.0)
    samples = [table.at(t_s) for t_s in (1.0, 2.0, 3.0, 4.0, 4.5, 5.5)]
    assert [each.source for each in samples] == ["early", "table", "table", "table", "extrapolated", "dry"]
    assert [each.valid for each in samples] == [False, True, True, True, True, False]
    np.testing.assert_allclose(samples[0].position_rad, motion(2.0)[0][0])
    np.testing.assert_array_equal(samples[0].velocity_rad_s, np.zeros(2))


def test_an_extrapolation_is_a_parabola() -> None:
    table = buffer(extrapolation_s=3.0)
    table.accept(message(0.0, 1.0), 0.0)
    position, velocity, acceleration = (part[0] for part in motion(1.0))
    for past in (0.0, 0.4, 2.5):
        sample = table.at(1.0 + past)
        expected = position + past * velocity + 0.5 * past * past * acceleration
        np.testing.assert_allclose(sample.position_rad, expected, atol=1e-14)
        np.testing.assert_allclose(sample.velocity_rad_s, velocity + past * acceleration, atol=1e-14)
        np.testing.assert_allclose(sample.acceleration_rad_s2, acceleration, atol=1e-14)
