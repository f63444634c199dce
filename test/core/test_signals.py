"""The nouns on the arrows refuse what no part of a station could use."""

import math
from typing import Any

import numpy as np
import pytest

from rf_pointing.core import Boresight, JointReading, JointTrajectory, PointingError, Target
from rf_pointing.core.signals import BeamPosition

TARGET: dict[str, Any] = {
    "t_s": 10.0, "name": "bird", "azimuth_rad": 1.0, "elevation_rad": 0.5,
    "azimuth_rate_rad_s": 0.01, "elevation_rate_rad_s": -0.002, "azimuth_acceleration_rad_s2": 1e-4,
    "elevation_acceleration_rad_s2": -1e-5, "range_m": 9e5, "range_rate_m_s": -3e3,
    "refraction_rad": 1e-4,
}  # fmt: skip


def trajectory(**changes: Any) -> JointTrajectory:
    values = {"t_s": [1.0, 2.0, 3.0], **{name: np.ones((3, 2)) for name in ("position_rad", "velocity_rad_s")}}
    return JointTrajectory(**{**values, "acceleration_rad_s2": np.ones((3, 2)), **changes})


@pytest.mark.parametrize("name", [name for name in TARGET if name != "name"])
@pytest.mark.parametrize("bad", [math.nan, math.inf])
def test_a_target_with_a_number_that_is_not_finite_is_refused_by_its_name(name: str, bad: float) -> None:
    Target(**TARGET)
    with pytest.raises(ValueError, match=f"^{name}={bad} must be finite$"):
        Target(**{**TARGET, name: bad})
    with pytest.raises(ValueError, match=r"^range_m=-1e-153 must be >= 1\.0$"):
        Target(**{**TARGET, "range_m": -1e-153})


@pytest.mark.parametrize("name", ["position_rad", "velocity_rad_s"])
@pytest.mark.parametrize(("value", "complaint"), [([1.0], "has shape"), ([1.0, math.nan], "must be finite")])
def test_a_reading_needs_two_finite_values_each(name: str, value: list[float], complaint: str) -> None:
    good = {"t_s": 1.0, "position_rad": [0.1, 0.2], "velocity_rad_s": [0.0, 0.0]}
    assert JointReading(**good).position_rad.dtype == np.float64
    with pytest.raises(ValueError, match=f"^{name}.*{complaint}"):
        JointReading(**{**good, name: value})


def test_a_reading_without_a_time_is_refused() -> None:
    with pytest.raises(ValueError, match=r"^t_s=nan must be finite$"):
        JointReading(t_s=math.nan, position_rad=[0.0, 0.0], velocity_rad_s=[0.0, 0.0])


@pytest.mark.parametrize("name", ["position_rad", "velocity_rad_s", "acceleration_rad_s2"])
@pytest.mark.parametrize(
    ("value", "complaint"),
    [
        (np.ones((2, 2)), r"has shape \(2, 2\), must be \(3, 2\)"),
        (np.ones((3, 3)), r"has shape \(3, 3\), must be \(3, 2\)"),
        (np.full((3, 2), np.inf), "must be finite"),
    ],
)
def test_a_trajectory_needs_two_finite_values_per_point(name: str, value: np.ndarray, complaint: str) -> None:
    trajectory()
    with pytest.raises(ValueError, match=f"^{name}(.|\n)*{complaint}"):
        trajectory(**{name: value})


@pytest.mark.parametrize("t_s", [[1.0, 1.0, 2.0], [1.0, 3.0, 2.0]])
def test_the_times_of_a_trajectory_must_increase(t_s: list[float]) -> None:
    with pytest.raises(ValueError, match="t_s must increase from point to point"):
        trajectory(t_s=t_s)


def test_a_trajectory_without_points_is_refused() -> None:
    empty = np.zeros((0, 2))
    with pytest.raises(ValueError, match="t_s has 0 points, must have at least 1"):
        trajectory(t_s=[], position_rad=empty, velocity_rad_s=empty, acceleration_rad_s2=empty)


@pytest.mark.parametrize("name", ["t_s", "cross_elevation_rad", "elevation_rad", "carrier_to_noise_db_hz"])
@pytest.mark.parametrize("bad", [math.nan, -math.inf])
def test_a_pointing_error_with_a_number_that_is_not_finite_is_refused(name: str, bad: float) -> None:
    good = {"t_s": 1.0, "sensor": "monopulse", "cross_elevation_rad": 0.0, "elevation_rad": 0.0}
    with pytest.raises(ValueError, match=f"^{name}={bad} must be finite$"):
        PointingError(**{**good, name: bad})


@pytest.mark.parametrize("covariance", [np.zeros(4), np.zeros((3, 3)), [[math.nan, 0.0], [0.0, 1.0]]])
def test_a_pointing_error_needs_a_finite_covariance_of_two_axes(covariance: Any) -> None:
    with pytest.raises(ValueError, match=r"(?s)^covariance_rad2"):
        pointing_error(covariance)


@pytest.mark.parametrize("name", ["t_s", "azimuth_rad", "elevation_rad"])
def test_a_boresight_that_is_not_finite_is_refused(name: str) -> None:
    with pytest.raises(ValueError, match=f"^{name}=nan must be finite$"):
        Boresight(**{"t_s": 1.0, "azimuth_rad": 0.0, "elevation_rad": 0.5, name: math.nan})


def test_signals_cannot_be_changed_and_share_no_default() -> None:
    error = PointingError(t_s=1.0, sensor="monopulse", cross_elevation_rad=0.0, elevation_rad=0.0)
    with pytest.raises(AttributeError):
        error.t_s = 2.0  # type: ignore[misc]
    other = PointingError(t_s=1.0, sensor="monopulse", cross_elevation_rad=0.0, elevation_rad=0.0)
    assert error.covariance_rad2 is not other.covariance_rad2


def test_an_angle_of_many_turns_is_no_reading() -> None:
    turned = 9.9 * 2.0 * math.pi
    assert JointReading(t_s=0.0, position_rad=[turned, -turned], velocity_rad_s=[0.0, 0.0]).position_rad[0] == turned
    with pytest.raises(ValueError, match="position_rad of elevation=3.6e"):
        JointReading(t_s=0.0, position_rad=[turned, 3.6e25], velocity_rad_s=[0.0, 0.0])


def test_light_time_and_doppler_are_those_of_range_and_its_rate() -> None:
    target = Target(**{**TARGET, "range_m": 599_584_916.0, "range_rate_m_s": -2997.92458})
    assert target.light_time_s == pytest.approx(2.0)
    assert target.doppler_factor == pytest.approx(1.00001, rel=1e-12)
    assert target.satellite_gain_db == 0.0


def pointing_error(covariance: Any) -> PointingError:
    return PointingError(
        t_s=1.0, sensor="conscan", cross_elevation_rad=0.0, elevation_rad=0.0, covariance_rad2=covariance
    )


@pytest.mark.parametrize(
    ("covariance", "real"),
    [
        ([[4.0, 0.0], [0.0, 9.0]], True),
        ([[4.0, 6.0], [6.0, 9.0]], True),
        ([[4.0, -6.0], [-6.0, 9.0]], True),
        ([[4.0, 6.0 * (1.0 + 4e-10)], [6.0 * (1.0 + 4e-10), 9.0]], True),
        ([[4.0, 6.001], [6.001, 9.0]], False),
        ([[4.0, -6.001], [-6.001, 9.0]], False),
        ([[-1e-9, 0.0], [0.0, 9.0]], False),
        ([[4.0, 0.0], [0.0, -1e-9]], False),
        ([[-4.0, 0.0], [0.0, -9.0]], False),
        ([[0.0, 0.0], [0.0, 0.0]], True),
    ],
)
def test_a_covariance_is_that_of_two_real_axes(covariance: list[list[float]], real: bool) -> None:
    if real:
        assert pointing_error(covariance).covariance_rad2.tolist() == covariance
        return
    with pytest.raises(ValueError, match="must be that of two real axes: no negative variance"):
        pointing_error(covariance)


def test_a_time_before_all_that_is_known_of_beam_or_centre_is_too_old() -> None:
    beam = BeamPosition()
    assert not beam.too_old(0.0)
    for t_s in (10.0, 11.0):
        beam.take_joints(JointReading(t_s=t_s, position_rad=np.zeros(2), velocity_rad_s=np.zeros(2)))
    assert [beam.too_old(t_s) for t_s in (9.9, 10.0, 12.0)] == [True, False, False]
    beam.take_centre(10.5, np.zeros(2))
    assert [beam.too_old(t_s) for t_s in (10.4, 10.5, 12.0)] == [True, False, False]
