import numpy as np
import pytest

from rf_pointing.array_sensors.interferometer.coupling import (
    coupling_amplitudes,
    coupling_from_two_way,
    coupling_matrix,
    roll_from_polarisation,
    tracking_frame_dipole,
)
from rf_pointing.array_sensors.interferometer.frames import attitude_from_euler, direction_from_angles, forward_angles
from rf_pointing.array_sensors.interferometer.relative_pose import (
    attitude_from_two_way,
    reverse_direction,
    roll_from_directions,
)


def test_worked_example_of_coupling_roll_and_elevation(worked_example) -> None:
    xi, attitude = worked_example
    amplitudes = coupling_amplitudes(xi, attitude)
    np.testing.assert_allclose(amplitudes, [[0.847668, -0.155115], [0.427055, 0.655722]], atol=5e-7)
    np.testing.assert_allclose(tracking_frame_dipole(amplitudes[:, 1], xi), [-0.316904, 0.697805], atol=5e-7)
    assert np.degrees(roll_from_polarisation(amplitudes, xi)) == pytest.approx(24.424864, abs=1e-6)


def test_listing_form_with_the_projector_in_the_tracking_frame_is_the_same(worked_example) -> None:
    xi, attitude = worked_example
    to_tracking = attitude_from_euler(*forward_angles(xi), 0.0)
    listing = to_tracking.T @ np.diag([0.0, 1.0, 1.0]) @ to_tracking @ attitude.T
    np.testing.assert_allclose(coupling_matrix(xi, attitude), listing, atol=1e-15)


def test_two_routes_to_the_roll_agree_on_random_poses(poses) -> None:
    directions, attitudes = poses
    by_frames = roll_from_directions(directions, reverse_direction(directions, attitudes), attitudes)
    by_field = roll_from_polarisation(0.37 * coupling_amplitudes(directions, attitudes), directions)
    np.testing.assert_allclose(by_field, by_frames, atol=1e-12)


def test_on_boresight_the_coupling_is_the_plane_rotation_by_the_roll() -> None:
    roll = 0.4
    attitude = attitude_from_two_way(0.0, 0.0, np.pi, 0.0, roll)
    expected = [[np.cos(roll), -np.sin(roll)], [np.sin(roll), np.cos(roll)]]
    np.testing.assert_allclose(coupling_amplitudes([1.0, 0.0, 0.0], attitude), expected, atol=1e-15)


def test_coupling_from_the_two_way_set_is_that_of_the_attitude(worked_example) -> None:
    xi, attitude = worked_example
    reverse = reverse_direction(xi, attitude)
    roll = roll_from_directions(xi, reverse, attitude)
    expected = coupling_amplitudes(xi, attitude)
    np.testing.assert_allclose(coupling_from_two_way(xi, reverse, roll), expected, atol=1e-14)


def test_singular_geometry_and_impossible_amplitudes_are_refused(worked_example) -> None:
    xi, _ = worked_example
    with pytest.raises(ValueError, match=r"azimuth1 or elevation1 is \+-90 deg"):
        roll_from_polarisation(np.eye(2), [0.0, 1.0, 0.0])
    with pytest.raises(ValueError, match="couplings vanish"):
        roll_from_polarisation(np.array([[1.0, 0.0], [0.0, 0.0]]), xi)


def test_dipoles_are_read_unless_the_path_is_along_one_of_them() -> None:
    for azimuth, elevation in ((np.pi / 2.0, 0.2), (0.3, np.pi / 2.0), (0.3, -np.pi / 2.0)):
        with pytest.raises(ValueError, match=r"azimuth1 or elevation1 is \+-90 deg"):
            tracking_frame_dipole([0.1, 0.2], direction_from_angles(azimuth, elevation))
    # The other way round: eq. (3-42) and (3-43) hold behind the array too.
    behind = direction_from_angles(2.5, 0.2)
    across = tracking_frame_dipole([0.1, 0.2], behind)
    z = 0.2 / np.cos(0.2)
    np.testing.assert_allclose(across, [(0.1 - np.sin(0.2) * np.sin(2.5) * z) / np.cos(2.5), z], rtol=1e-12)
