"""Sides of the zenith, crossing and turns of a branch, against directions on the sky and differences."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from rf_pointing.core import JointReading, JointTrajectory, Motion, unit_vector_from_azel
from rf_pointing.planning import plunged
from rf_pointing.planning.crossing import Crossing
from rf_pointing.station.pointing.branch import TrackingBranch

BEGIN_S, OVER_S, END_S = 100.0, 104.0, 110.0
STEP_S = 0.5


def path(t_s: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Direct angles that are cubic in time, with their derivatives."""
    x = t_s - BEGIN_S
    position = np.array([0.5 + 0.3 * x - 0.01 * x**2 + 0.002 * x**3, 1.2 + 0.05 * x - 0.004 * x**2])
    velocity = np.array([0.3 - 0.02 * x + 0.006 * x**2, 0.05 - 0.008 * x])
    return position, velocity, np.array([-0.02 + 0.012 * x, -0.008])


def branch(*, plunge: bool = False, over: bool = True, turns: int = 0) -> TrackingBranch:
    times = np.arange(BEGIN_S, END_S + 0.01, STEP_S)
    rows = []
    for t_s in times:
        # The table of a crossing holds the axes' own angles.
        direct = path(float(t_s))
        rows.append(plunged(*direct) if plunge != (over and t_s >= OVER_S) else direct)
    position, velocity, acceleration = (np.array(column) for column in zip(*rows, strict=True))
    crossing = Crossing(
        times, position, velocity, acceleration, 1e-3 * (times - BEGIN_S), OVER_S if over else None, 2.0 * math.pi
    )
    return TrackingBranch(SimpleNamespace(turns=turns, plunge=plunge, crossing=crossing))  # type: ignore[arg-type]


@pytest.mark.parametrize("plunge", [False, True])
def test_the_axes_look_where_the_direct_angles_do_and_readings_come_back(plunge: bool) -> None:
    course = branch(plunge=plunge)
    times = np.array([90.0, OVER_S - 1.0, OVER_S, 120.0])
    rng = np.random.default_rng(2)
    position, velocity, acceleration = rng.uniform(0.2, 1.3, (4, 2)), rng.normal(size=(4, 2)), rng.normal(size=(4, 2))
    direct = JointTrajectory(
        t_s=times, position_rad=position, velocity_rad_s=velocity, acceleration_rad_s2=acceleration
    )
    axes = course.to_axes(direct)
    for row, t_s in enumerate(times):
        over = course.plunge_at(float(t_s))
        assert (axes.position_rad[row, 1] > 0.5 * math.pi) == over
        np.testing.assert_allclose(
            unit_vector_from_azel(*axes.position_rad[row]), unit_vector_from_azel(*direct.position_rad[row]), atol=1e-14
        )
        np.testing.assert_array_equal(course.axes_rad(float(t_s), direct.position_rad[row]), axes.position_rad[row])
        # An elevation over the top falls where the target rises.
        np.testing.assert_array_equal(axes.velocity_rad_s[row] * direct.velocity_rad_s[row] > 0.0, [True, not over])
        np.testing.assert_array_equal(
            np.sign(axes.acceleration_rad_s2[row] / direct.acceleration_rad_s2[row]), [1.0, -1.0 if over else 1.0]
        )
        back = course.from_axes(
            JointReading(t_s=float(t_s), position_rad=axes.position_rad[row], velocity_rad_s=axes.velocity_rad_s[row])
        )
        np.testing.assert_allclose(back.position_rad, direct.position_rad[row], atol=1e-14)
        np.testing.assert_allclose(back.velocity_rad_s, direct.velocity_rad_s[row], atol=1e-14)


@pytest.mark.parametrize("plunge", [False, True])
def test_during_the_crossing_its_motion_replaces_the_targets(plunge: bool) -> None:
    """In direct angles on both sides; outside, the motion is untouched."""
    course = branch(plunge=plunge)
    # Not across the instant that goes over, which only the axes' own angles pass continuously.
    times = np.array([99.9, BEGIN_S, 101.23, 103.4, 104.6, 108.77, END_S, 110.1])
    target = Motion(*(np.full((len(times), 2), 7.0 + part) for part in range(3)))
    found = course.detour(times, target)
    for row, t_s in enumerate(times):
        inside = BEGIN_S <= t_s <= END_S
        wanted = path(float(t_s)) if inside else [part[row] for part in target]
        for part, value in zip(found, wanted, strict=True):
            np.testing.assert_allclose(part[row], value, atol=1e-9)
    ends = course.ends_of_crossing(times)
    assert ends is not None
    motion, over = ends
    assert over.tolist() == [plunge, not plunge]
    for row, t_s in enumerate((BEGIN_S, END_S)):
        for part, value in zip(motion, path(t_s), strict=True):
            np.testing.assert_allclose(part[row], value, atol=1e-9)
    assert course.ends_of_crossing(times[[0, -1]]) is None


def test_offsets_go_over_from_one_end_of_a_crossing_to_the_other_without_a_jump() -> None:
    """Whole at both ends, at rest there against the predicted motion, and rates are those of the positions."""
    course, offsets = branch(over=False), np.array([[2e-3, -1e-3], [-4e-3, 3e-3]])
    step_s = 1e-3
    times = np.array([99.0, BEGIN_S, END_S, 111.0, *(103.7 + step_s * np.arange(-1, 2))])
    predicted = Motion(*(np.array(column) for column in zip(*map(path, times.tolist()), strict=True)))
    corrected = Motion(*(np.full((len(times), 2), 9.0) for _ in range(3)))
    found = course.carry(times, predicted, corrected, offsets)
    off = [a - b for a, b in zip(found, predicted, strict=True)]
    for row in (0, 3):
        assert all(np.all(part[row] == 9.0) for part in found)
    np.testing.assert_allclose(off[0][[1, 2]], offsets, atol=1e-15)
    np.testing.assert_allclose(off[1][[1, 2]], 0.0, atol=1e-15)
    before, here, after = off[0][4:]
    np.testing.assert_allclose(off[1][5], (after - before) / (2.0 * step_s), rtol=1e-5)
    np.testing.assert_allclose(off[2][5], (after - 2.0 * here + before) / step_s**2, rtol=1e-4)


def test_offsets_of_the_axes_change_their_sign_over_the_top() -> None:
    """The same offset of the encoders at both ends is carried as the same offset of the encoders."""
    course, axes_offset = branch(), np.array([1e-3, 2e-3])
    times = np.array([BEGIN_S, 103.0, 105.0, END_S])
    predicted = Motion(*(np.array(column) for column in zip(*map(path, times.tolist()), strict=True)))
    direct_ends = np.array([axes_offset, axes_offset * [1.0, -1.0]])
    found = course.carry(times, predicted, predicted, direct_ends)
    for row, t_s in enumerate(times.tolist()):
        moved = course.axes_rad(t_s, found.position[row]) - course.axes_rad(t_s, predicted.position[row])
        np.testing.assert_allclose(moved, axes_offset, atol=1e-14)
