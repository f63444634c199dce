"""What both axes follow: corners first, then a table or a goal, and when a table leads away from the present path."""

import numpy as np
import pytest

from rf_pointing.core import JointTrajectory
from rf_pointing.station.antenna.axes import SlewPath
from rf_pointing.station.antenna.loops import LoopParams
from test.station.stepped_antenna import START_S, TICK_S

HERE = (1.0, 0.7)
FAR = (1.5, 0.9)


def table(begin_s: float, place: tuple[float, float], rate: tuple[float, float] = (0.0, 0.0)) -> JointTrajectory:
    times = begin_s + 0.1 * np.arange(10)
    rates = np.tile(rate, (10, 1))
    return JointTrajectory(
        t_s=times, position_rad=np.array(place) + rates * (times - begin_s)[:, None], velocity_rad_s=rates,
        acceleration_rad_s2=np.zeros((10, 2)),
    )  # fmt: skip


def test_corners_come_before_a_table_and_a_goal_and_are_passed_by_axes_at_rest() -> None:
    path = SlewPath(LoopParams(), HERE, 0.0)
    path.table.accept(table(START_S, FAR, (0.001, -0.002)), START_S)
    sample = path.table.at(START_S + 0.2)
    corner = (1.2, 1.0)
    path.preprocessor.follow()
    for corners, encoder, wanted, rate in (
        ((corner,), HERE, corner, (0.0, 0.0)),
        ((corner,), corner, sample.position_rad, (0.001, -0.002)),
        ((), HERE, sample.position_rad, (0.001, -0.002)),
    ):
        path.preprocessor.reset(HERE)
        path.go_round(corners)
        path.step(sample, encoder, TICK_S)
        assert path.following is not None
        _, chased = path.following
        np.testing.assert_allclose(chased.position, wanted)
        np.testing.assert_allclose(chased.velocity, rate, atol=1e-9)
    # A command under way is not at its corner, wherever the encoders are.
    path.go_round((corner,))
    path.step(sample, corner, TICK_S)
    np.testing.assert_allclose(path.following[1].position, corner)
    # Without a sample it is the goal; a stop has no goal but its own end.
    path.go(FAR, ())
    assert path.table.empty
    motion = path.step(None, HERE, TICK_S)
    np.testing.assert_array_equal(path.following[1].position, FAR)
    assert np.all(motion.velocity > 0.0)
    path.go_round((corner,))
    path.stop()
    motion = path.step(None, HERE, TICK_S)
    assert path.following[1] is path.following[0] is motion
    path.preprocessor.follow()
    path.step(None, HERE, TICK_S)
    np.testing.assert_array_equal(path.following[1].position, FAR, "the corners are forgotten")


@pytest.mark.parametrize(("settled_deg", "near_deg"), [(0.02, 0.3), (1.1, 1.1)])
def test_a_corner_is_reached_where_the_drive_comes_to_rest(settled_deg: float, near_deg: float) -> None:
    """A rotator of whole degrees stops up to one of them away."""
    path, corner = SlewPath(LoopParams(), HERE, np.radians(settled_deg)), (1.2, 1.0)
    path.go(FAR, (corner,))
    for share, goal in ((1.01, corner), (0.99, FAR)):
        path.preprocessor.reset(corner)
        path.step(None, (corner[0], corner[1] - share * np.radians(near_deg)), TICK_S)
        np.testing.assert_array_equal(path.following[1].position, goal)


@pytest.mark.parametrize("axis", [0, 1])
@pytest.mark.parametrize("way", [1.0, -1.0])
def test_a_table_leaves_the_path_half_a_degree_from_where_it_would_go_on(axis: int, way: float) -> None:
    """From the table that it replaces while that is followed, else from the axes."""
    for off_deg, leaves in ((0.49, False), (0.51, True)):
        off = np.radians(way * off_deg) * np.eye(2)[axis]
        path = SlewPath(LoopParams(), HERE, 0.0)
        near_axes = table(START_S, tuple(np.array(HERE) + off))
        assert path.leaves(near_axes, np.array(HERE), True) is leaves, "no table is followed"
        path.table.accept(table(START_S, FAR), START_S)
        assert path.leaves(near_axes, np.array(HERE), False) is leaves
        near_table = table(START_S + 0.2, tuple(np.array(FAR) + off))
        assert path.leaves(near_table, np.array(HERE), True) is leaves
        assert path.leaves(near_table, np.array(HERE), False)
