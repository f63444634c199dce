import numpy as np
import pytest

from rf_pointing.array_sensors.interferometer.frames import attitude_from_euler, frame_rotation
from rf_pointing.array_sensors.interferometer.motion import (
    DockingApproach,
    RelativeMotion,
    crude_attitude_rate,
    moved,
    require_motion,
)


def motion(rate=(0.02, -0.01, 0.03)) -> RelativeMotion:
    return RelativeMotion(
        position_m=np.array([100.0, 5.0, -3.0]), velocity_m_s=np.array([-0.5, 0.1, 0.2]),
        attitude=attitude_from_euler(0.1, 0.2, 3.1), rate_rad_s=np.array(rate),
    )  # fmt: skip


def test_differences_of_successive_poses_return_constant_rates() -> None:
    first, later = motion(), moved(motion(), 4.0)
    rate = crude_attitude_rate(first.attitude, later.attitude, 4.0)
    np.testing.assert_allclose(rate, first.rate_rad_s, atol=1e-14)


def test_rates_through_half_a_turn_of_attitude_are_continuous() -> None:
    before = attitude_from_euler(0.0, 0.0, np.pi - 0.01)
    after = attitude_from_euler(0.0, 0.0, -np.pi + 0.01)
    np.testing.assert_allclose(crude_attitude_rate(before, after, 0.1), [0.2, 0.0, 0.0], atol=1e-12)


def test_moved_stacks_over_times() -> None:
    slots = moved(motion(), np.array([-1.0, 0.0, 2.0]))
    assert slots.position_m.shape == slots.velocity_m_s.shape == slots.rate_rad_s.shape == (3, 3)
    np.testing.assert_allclose(slots.attitude[1], motion().attitude)
    np.testing.assert_allclose(slots.attitude[2], moved(motion(), 2.0).attitude)


@pytest.mark.parametrize("name", ["position_m", "velocity_m_s", "attitude", "rate_rad_s"])
def test_a_motion_that_is_not_finite_is_refused_by_name(name: str) -> None:
    fields = {key: getattr(motion(), key).copy() for key in ("position_m", "velocity_m_s", "attitude", "rate_rad_s")}
    fields[name][0] = np.nan
    with pytest.raises(ValueError, match=name):
        require_motion(RelativeMotion(**fields))


def test_approach_starts_and_ends_at_its_ranges_and_its_rates_fit_its_poses() -> None:
    approach = DockingApproach()
    assert np.linalg.norm(approach.pose_at(0.0)[0]) == pytest.approx(approach.start_range_m, abs=2.0)
    assert np.linalg.norm(approach.pose_at(1e5)[0]) == pytest.approx(approach.dock_range_m, abs=0.6)
    for t_s in (10.0, 777.0):
        now, soon = approach.motion_at(t_s), approach.pose_at(t_s + 0.05)
        ahead = moved(now, 0.05)
        np.testing.assert_allclose(ahead.position_m, soon[0], atol=1e-5)
        np.testing.assert_allclose(ahead.attitude, soon[1], atol=1e-6)


def test_an_approach_that_moves_away_is_refused() -> None:
    with pytest.raises(ValueError, match=r"dock_range_m=50.0 must be < start_range_m=20.0"):
        DockingApproach(start_range_m=20.0, dock_range_m=50.0)


def test_a_turn_up_to_90_degrees_between_samples_has_a_rate() -> None:
    turn = np.radians(89.9) * np.array([0.0, 0.6, 0.8])
    np.testing.assert_allclose(crude_attitude_rate(np.eye(3), frame_rotation(turn), 4.0), turn / 4.0, atol=1e-12)
    with pytest.raises(ValueError, match=r"attitude changed by 90\.1 deg"):
        crude_attitude_rate(np.eye(3), frame_rotation(np.radians(90.1) * np.array([0.0, 0.6, 0.8])), 4.0)
    for dt_s, words in ((0.0, r"dt_s=0\.0 must be > 0"), (-1.0, r"dt_s=-1\.0 must be > 0"), (np.nan, "must be finite")):
        with pytest.raises(ValueError, match=words):
            crude_attitude_rate(np.eye(3), np.eye(3), dt_s)
