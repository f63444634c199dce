import math
import pickle

import numpy as np
import pytest

from rf_pointing.calibration import TERM_NAMES, TERMS, BiasModel
from rf_pointing.calibration.mount import Skew, axes_from_sky, sky_from_axes
from rf_pointing.core import MDEG

CLOSURE_RAD = 1e-12
STILL = (0.0, 0.0, 0.0, 0.0)
ROTATIONS = ("non_orthogonality", "collimation", "mislevel_east", "mislevel_north")


def random_model(random, scale=1.0):
    sizes = {"rad": math.radians(0.3), "s": 1.0, "s^2": 1.0}
    return BiasModel({term.name: scale * sizes[term.unit] * random.uniform(-1.0, 1.0) for term in TERMS})


def grid(low_deg=5.0, high_deg=89.0):
    azimuth, elevation = np.meshgrid(np.linspace(-270.0, 270.0, 37), np.linspace(low_deg, high_deg, 43))
    return np.radians(azimuth), np.radians(elevation)


def rates(random, shape):
    return [random.uniform(-size, size, shape) for size in (5e-3, 5e-3, 1e-4, 1e-4)]


def test_every_coefficient_enters_equations_1_and_2_as_printed():
    az, el, az_rate, el_rate, az_acc, el_acc = 0.7, 0.5, 2e-3, 3e-3, 4e-5, 5e-5
    x = {term.number: 0.001 * (term.number + 1) for term in TERMS}
    model = BiasModel({term.name: x[term.number] for term in TERMS})
    sa, ca, te, se, ce = math.sin(az), math.cos(az), math.tan(el), math.sin(el), math.cos(el)
    d_az = x[1] + x[2] * te + x[3] / ce + x[4] * sa + x[5] * ca + x[6] * az_rate + x[7] * az_acc
    d_az += x[8] * sa * te - x[9] * ca * te
    d_el = x[8] * ca + x[9] * sa + x[10] + x[11] * ce + x[12] * se + x[13] * el_rate + x[14] * el_acc
    offset = model.offset_rad(az, el, az_rate, el_rate, az_acc, el_acc)
    assert float(offset[0]) == pytest.approx(d_az, rel=1e-14)
    assert float(offset[1]) == pytest.approx(d_el, rel=1e-14)


@pytest.mark.parametrize("elevation_deg", [(5.0, 89.0), (95.0, 170.0)], ids=["whole sky", "plunged branch"])
def test_remove_undoes_apply_with_random_coefficients(random, elevation_deg):
    azimuth, elevation = grid(*elevation_deg)
    for _ in range(5):
        model = random_model(random)
        # Within the mount's hole around the zenith there is nothing to close; 0.6 deg bounds it here.
        motion = rates(random, azimuth.shape)
        back = model.remove(*model.apply(azimuth, elevation, *motion), *motion)
        assert np.max(np.abs(back[0] - azimuth)) < CLOSURE_RAD
        assert np.max(np.abs(back[1] - elevation)) < CLOSURE_RAD


def test_axes_in_motion_have_one_beam_at_the_zenith_too(random):
    """Within 0.25 deg of it, with lags of a second, `remove` may return another that has the same angles."""
    azimuth, elevation = random.uniform(-np.pi, np.pi, 2000), np.radians(random.uniform(88.5, 89.9, 2000))
    motion = [random.uniform(-size, size, 2000) for size in (0.1, 0.1, 0.01, 0.01)]
    for _ in range(5):
        model = random_model(random).replace(**dict.fromkeys(ROTATIONS, 0.0))
        x = model.coefficients
        beam = model.beam_at(azimuth, elevation, *motion)
        back = model.apply(*beam, *STILL)
        for axis, name in enumerate(("azimuth", "elevation")):
            lag = x[f"{name}_velocity_lag"] * motion[axis] + x[f"{name}_acceleration_lag"] * motion[axis + 2]
            assert back[axis] + lag == pytest.approx((azimuth, elevation)[axis], abs=CLOSURE_RAD)


def test_joint_velocity_and_acceleration_are_the_derivatives_of_the_joint_position(random):
    model = random_model(random)
    start, rate = np.array([0.7, 0.9]), np.array([0.02, -0.01])
    acceleration = np.array([3e-3, 1e-3])
    step = 1e-3

    def joint(t):
        return model.apply_moving(start + rate * t + acceleration * t**2 / 2, rate + acceleration * t, acceleration)

    before, now, after = (joint(t) for t in (-step, 0.0, step))
    assert (after[0] - before[0]) / (2 * step) == pytest.approx(now[1], abs=1e-9)
    assert (after[1] - before[1]) / (2 * step) == pytest.approx(now[2], abs=1e-9)


def test_rotation_form_is_the_printed_form_to_first_order(random):
    azimuth, elevation = grid(5.0, 80.0)
    motion = rates(random, azimuth.shape)
    model = random_model(random)
    for scale in (1e-2, 1e-3):
        small = BiasModel({name: scale * value for name, value in model.coefficients.items()})
        exact, printed = small.apply(azimuth, elevation, *motion), small.offset_rad(azimuth, elevation, *motion)
        difference = max(
            np.max(np.abs(exact[0] - azimuth - printed[0])), np.max(np.abs(exact[1] - elevation - printed[1]))
        )
        assert difference < 5e-3 * scale**2


def test_printed_form_agrees_below_80_deg_and_is_off_by_a_millidegree_near_the_zenith(table_1):
    def on_sky(elevation_deg):
        azimuth, elevation = np.radians(np.arange(0.0, 360.0, 5.0)), np.radians(elevation_deg)
        exact, printed = table_1.apply(azimuth, elevation, *STILL), table_1.offset_rad(azimuth, elevation, *STILL)
        return np.max(
            np.hypot((exact[0] - azimuth - printed[0]) * np.cos(elevation), exact[1] - elevation - printed[1]) / MDEG
        )

    assert max(on_sky(e) for e in np.arange(5.0, 80.1, 5.0)) < 0.25
    assert on_sky(87.0) < 1.0 < on_sky(88.0)


def test_unknown_and_missing_coefficients_are_errors():
    full = dict.fromkeys(TERM_NAMES, 0.0)
    with pytest.raises(ValueError, match="no term squint"):
        BiasModel({**full, "squint": 0.0})
    del full["droop"]
    with pytest.raises(ValueError, match="needs droop"):
        BiasModel(full)


def test_degrees_given_as_radians_are_refused_by_name():
    with pytest.raises(ValueError, match=r"azimuth_offset=0\.178 must be <= 0\.1"):
        BiasModel.zero().replace(azimuth_offset=0.178)


def test_temperature_term_without_a_temperature_is_refused():
    model = BiasModel.zero().replace(elevation_temperature=1e-5)
    with pytest.raises(ValueError, match="temperature_k=None"):
        model.apply(0.1, 0.5, *STILL)
    assert float(model.apply(0.1, 0.5, *STILL, temperature_k=298.15)[1]) == pytest.approx(0.5001, abs=1e-12)


def test_lags_too_long_for_the_rates_near_the_zenith_raise_instead_of_guessing():
    model = BiasModel.zero().replace(azimuth_velocity_lag=10.0, mislevel_east=0.02)
    with pytest.raises(ValueError, match="remove"):
        model.remove(0.3, math.radians(88.7), 0.5, 0.0, 0.0, 0.0)


def test_offset_is_the_partials_times_the_coefficients(partials, random):
    azimuth, elevation = grid(5.0, 80.0)
    motion = rates(random, azimuth.shape)
    model = random_model(random)
    values = np.array(list(model.coefficients.values()))
    offset = model.offset_rad(azimuth, elevation, *motion)
    for part, expected in zip(partials((azimuth, elevation, *motion), model.coefficients), offset, strict=True):
        assert part @ values == pytest.approx(expected, abs=1e-14)


def test_a_model_survives_pickling(table_1):
    assert pickle.loads(pickle.dumps(table_1)) == table_1


def test_a_thermal_model_at_one_temperature_is_the_model_without_its_thermal_terms(random: np.random.Generator) -> None:
    model = BiasModel.zero().replace(
        azimuth_offset=1e-4, elevation_offset=-2e-4, droop=3e-4, azimuth_temperature=1e-5, elevation_temperature=-2e-5
    )
    motion = (*random.uniform(0.1, 1.3, (2, 50)), *random.uniform(-0.01, 0.01, (4, 50)))
    for temperature_k in (258.0, 288.15, 311.0):
        folded = model.at_temperature(temperature_k)
        np.testing.assert_allclose(
            folded.apply(*motion), model.apply(*motion, temperature_k=temperature_k), rtol=0.0, atol=1e-12
        )
    with pytest.raises(
        ValueError, match="azimuth_temperature, elevation_temperature, and no temperature has been received"
    ):
        model.at_temperature(None)
    plain = BiasModel.zero().replace(droop=1e-4)
    assert plain.at_temperature(None) is plain


@pytest.mark.parametrize("elevation_rad", [0.4, 1.3, 2.2])
def test_the_axes_of_a_moving_beam_give_its_motion_back_rates_included(elevation_rad):
    skew = Skew(collimation=0.01, non_orthogonality=-0.02, mislevel_east=0.003, mislevel_north=-0.004)
    azimuth, elevation = np.array([[0.7], [0.02], [1e-3]]), np.array([[elevation_rad], [-0.01], [2e-3]])
    back = sky_from_axes(*axes_from_sky(azimuth, elevation, skew), skew)
    np.testing.assert_allclose(back, (azimuth, elevation), atol=1e-12)


def test_the_departure_is_the_greatest_angle_between_beam_and_axes():
    turned = BiasModel.zero().replace(azimuth_offset=0.02)
    # An angle of azimuth is smaller on the sky by the cosine of the elevation.
    apart, _, elevation = turned.departure()
    assert np.degrees(elevation) == pytest.approx(5.0)
    assert apart == pytest.approx(0.02 * np.cos(np.radians(5.0)), rel=1e-4)
    tilted = BiasModel.zero().replace(azimuth_offset=0.0, elevation_offset=-0.003)
    assert tilted.departure()[0] == pytest.approx(0.003, rel=1e-9)
    assert BiasModel.zero().departure()[0] < 1e-12


@pytest.mark.parametrize("turns", [-4, -2, 3, 5])
def test_axes_stay_on_the_turn_of_the_direction(random, turns):
    azimuth, elevation = grid()
    model, shift = random_model(random), 2.0 * np.pi * turns
    plain, turned = model.apply(azimuth, elevation, *STILL), model.apply(azimuth + shift, elevation, *STILL)
    np.testing.assert_allclose(turned[0] - shift, plain[0], atol=1e-9)
    np.testing.assert_allclose(turned[1], plain[1], atol=1e-9)
    back = model.remove(*turned, *STILL)
    np.testing.assert_allclose(back[0], azimuth + shift, atol=1e-8)


@pytest.mark.parametrize(("skew_rad", "collimation_rad"), [(0.03, 0.01), (0.03, -0.02), (-0.02, -0.03), (-0.01, 0.03)])
def test_the_hole_about_the_zenith_is_as_wide_as_skew_and_collimation_together(skew_rad, collimation_rad):
    """To their third order, a part in a thousand here."""
    skew = Skew(skew_rad, collimation_rad, 0.0, 0.0)
    assert skew.cone_rad == pytest.approx(abs(skew_rad + collimation_rad))
    azimuth = np.array([[0.7]])
    with pytest.raises(ValueError, match="of the mount's zenith"):
        axes_from_sky(azimuth, np.array([[0.5 * np.pi - 0.998 * skew.cone_rad]]), skew)
    axes_from_sky(azimuth, np.array([[0.5 * np.pi - 1.002 * skew.cone_rad]]), skew)


def test_a_lean_turns_the_axes_rigidly_about_the_horizontal_by_its_size():
    tilt = Skew(0.0, 0.0, 0.03, -0.04).tilt()
    np.testing.assert_allclose(tilt @ tilt.T, np.eye(3), atol=1e-15)
    assert np.linalg.det(tilt) == pytest.approx(1.0)
    # The azimuth axis leans by 30 mrad to the north and by -40 mrad to the east, 50 mrad in all.
    np.testing.assert_allclose(tilt[:, 2], [-0.8 * np.sin(0.05), 0.6 * np.sin(0.05), np.cos(0.05)], atol=1e-15)
    np.testing.assert_allclose(tilt @ [-0.6, -0.8, 0.0], [-0.6, -0.8, 0.0], atol=1e-15)


def test_degrees_become_radians_and_seconds_stay(table_1):
    given = {
        **dict.fromkeys(TERM_NAMES, 0.0), "droop": -0.3, "azimuth_velocity_lag": 0.7,
        "elevation_acceleration_lag": 0.4,
    }  # fmt: skip
    model = BiasModel.from_degrees({**given, "azimuth_temperature": 0.001})
    assert model.coefficients["droop"] == pytest.approx(-0.3 * np.pi / 180.0)
    assert model.coefficients["azimuth_temperature"] == pytest.approx(0.001 * np.pi / 180.0)
    assert model.coefficients["azimuth_velocity_lag"] == 0.7
    assert model.coefficients["elevation_acceleration_lag"] == 0.4
    assert (model.has_lags, BiasModel.zero().replace(droop=1e-3).has_lags) == (True, False)
