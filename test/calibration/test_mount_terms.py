"""Terms of mounts other than azimuth and elevation: one chain of rotations, exact and linear."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rf_pointing.calibration import BiasModel
from rf_pointing.calibration.terms import FURTHER_TERMS, MOUNT_TERMS, names_of
from rf_pointing.core import LEVEL, Kinematics, unit_vector_from_azel

MOUNTS = (
    Kinematics(type="x_y", lower_axis="east_west"),
    Kinematics(type="x_y", lower_axis="north_south"),
    Kinematics(type="ha_dec", latitude_rad=math.radians(47.9)),
    Kinematics(type="ha_dec", latitude_rad=math.radians(-33.0)),
    Kinematics(type="azimuth_elevation_tilt", tilt_rad=math.radians(7.0), train_rad=1.3),
)
ANGLE = st.tuples(st.floats(-3.0, 3.0), st.floats(-1.2, 1.2))
RATES = st.tuples(*[st.floats(-0.02, 0.02)] * 2, *[st.floats(-5e-4, 5e-4)] * 2)


@pytest.mark.parametrize("mount", MOUNTS, ids=lambda each: each.words)
@given(angles=ANGLE, rates=RATES)
@settings(max_examples=20, deadline=None)
def test_each_linear_term_is_the_derivative_of_the_exact_chain(mount, angles, rates):
    step = 1e-6
    for term in (*MOUNT_TERMS[mount.type], *FURTHER_TERMS[mount.type]):
        model = BiasModel.zero(mount).replace(**{term.name: step})
        exact = (np.array(model.apply(*angles, *rates, temperature_k=288.15)) - angles) / step
        linear = np.array(model.offset_rad(*angles, *rates, temperature_k=288.15)) / step
        np.testing.assert_allclose(exact, linear, atol=3e-5 * (1.0 + np.max(np.abs(linear)) ** 2), err_msg=term.name)


@pytest.mark.parametrize("mount", MOUNTS, ids=lambda each: each.words)
@given(angles=ANGLE, rates=RATES, size=st.lists(st.floats(-2e-3, 2e-3), min_size=14, max_size=14))
@settings(max_examples=20, deadline=None)
def test_the_beam_of_the_axes_that_point_there_is_the_direction(mount, angles, rates, size):
    model = BiasModel(dict(zip(names_of(mount.type), size, strict=True)), mount)
    np.testing.assert_allclose(model.remove(*model.apply(*angles, *rates), *rates), angles, atol=2e-12)


@pytest.mark.parametrize("mount", MOUNTS, ids=lambda each: each.words)
@given(angles=ANGLE, size=st.floats(-0.05, 0.05))
def test_gravity_bends_the_beam_in_its_vertical_plane(mount, angles, size):
    """The axes must point higher on the sky where the beam sags, and at the same azimuth."""
    sky, command = (
        unit_vector_from_azel(*mount.sky_at(*map(float, each)))
        for each in (angles, BiasModel.zero(mount).replace(flexure=size).apply(*angles, *[0.0] * 4))
    )
    up = np.array([0.0, 0.0, 1.0])
    assert abs(np.linalg.det([sky, command, up])) < 1e-12
    turned = math.atan2(np.linalg.norm(np.cross(sky, command)), sky @ command)
    lower = math.hypot(sky[0], sky[1])
    assert turned == pytest.approx(math.atan2(abs(size) * lower, 1.0 + size * sky[2]), abs=1e-12)
    assert (command[2] - sky[2]) * size >= -1e-15


@pytest.mark.parametrize(("latitude_deg", "lean"), [(47.9, 1.0), (20.0, -1.0)])
def test_polar_misalignment_is_that_of_the_pole_of_the_axis(latitude_deg, lean):
    """With polar_altitude the axis of the mount points higher, with polar_azimuth west of north."""
    mount = Kinematics(type="ha_dec", latitude_rad=math.radians(latitude_deg))
    pole = (0.3, 0.5 * math.pi - 1e-9)
    for name, axis, sign in (("polar_altitude", 1, 1.0), ("polar_azimuth", 0, -1.0)):
        model = BiasModel.zero(mount).replace(**{name: lean * 1e-3})
        seen = mount.sky_at(*(float(each) for each in model.remove(*pole, *[0.0] * 4)))
        off = (math.remainder(seen[0], math.tau) * math.cos(seen[1]), seen[1] - mount.latitude_rad)
        assert off[axis] == pytest.approx(sign * lean * 1e-3, rel=1e-3)
        assert abs(off[1 - axis]) < 1e-6


def test_a_model_is_refused_on_another_mount_and_without_its_vertical():
    x_y, turned, polar = MOUNTS[0], MOUNTS[1], MOUNTS[2]
    flexible = BiasModel({**BiasModel.zero(x_y).coefficients, "flexure": 1e-3})
    with pytest.raises(ValueError, match="must be put on its mount"):
        flexible.apply(0.1, 0.2, 0.0, 0.0, 0.0, 0.0)
    for other in (turned, polar, LEVEL):
        with pytest.raises(ValueError, match=f"is of a mount of type x_y .*must be of one {other.words}"):
            flexible.on(x_y).on(other)
    with pytest.raises(ValueError, match="has no term azimuth_offset"):
        BiasModel({**BiasModel.zero(x_y).coefficients, "azimuth_offset": 0.0}, x_y)
    assert BiasModel.zero().on(polar) == BiasModel.zero(polar)
