"""The scene: nadir is held exactly by the torque the filter is told, and the geometry is the paper's."""

import numpy as np
import pytest

from rf_pointing.array_sensors.attitude.quaternion import rotation_angle_between_rad
from rf_pointing.array_sensors.attitude.rigid_body import KnownTorque, propagate
from rf_pointing.papers.doa_study.scene import STEP_S, nadir_scene


def test_stated_torque_holds_nadir_exactly() -> None:
    scene = nadir_scene(300.0)
    quaternion, rate, none = np.array([0.0, 0.0, 0.0, 1.0]), scene.frame_rate[0], np.zeros(3)
    for k in range(len(scene.t_s) - 1):
        known = KnownTorque(control_n_m=scene.control_n_m[k], wheel_momentum_n_m_s=none, wheel_momentum_rate_n_m=none)
        quaternion, rate = propagate(scene.inertia, quaternion, rate, known, scene.frame_rate[k], STEP_S)
    assert float(rotation_angle_between_rad(quaternion, [0, 0, 0, 1])) < 1e-6
    assert rate == pytest.approx(scene.frame_rate[-1], abs=1e-9)


def test_directions_stay_within_61_degrees_of_nadir_and_change_at_hand_offs() -> None:
    scene = nadir_scene()
    nadir = np.degrees(np.arctan2(np.hypot(scene.reference[:, 0], scene.reference[:, 1]), scene.reference[:, 2]))
    assert len(scene.t_s) == 20_000
    assert (nadir.min(), nadir.max()) == (pytest.approx(9.0, abs=0.2), pytest.approx(61.0, abs=0.1))
    jumps = np.degrees(np.arccos(np.sum(scene.reference[1:] * scene.reference[:-1], axis=1).clip(-1, 1)))
    assert np.count_nonzero(jumps > 60.0) == 7
    assert list(np.unique(scene.station)) == list(range(8))


def test_time_without_a_station_in_view_is_refused() -> None:
    with pytest.raises(ValueError, match="elevation_rad="):
        nadir_scene(5000.0, start_s=1000.0)


@pytest.mark.parametrize("duration_s", [0.9, 5000.3])
def test_a_scene_shorter_than_a_second_or_longer_than_the_papers_is_refused(duration_s: float) -> None:
    with pytest.raises(ValueError, match="duration_s="):
        nadir_scene(duration_s)
