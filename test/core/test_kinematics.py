"""Kinematics of every mount: directions at which the axes are known, inverses, exact rates, poles."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rf_pointing.core import unit_vector_from_azel
from rf_pointing.core.kinematics import CHAINS, LEVEL, Kinematics, motion_of_vectors, vectors_of_motion
from rf_pointing.core.mount_types import LOWER_AXES, MOUNTS

DEG = math.pi / 180.0
CLOSURE = 1e-12
HALF_TURN = st.floats(-math.pi, math.pi)
MOUNTED = st.builds(
    Kinematics, type=st.sampled_from(sorted(MOUNTS)), lower_axis=st.sampled_from(LOWER_AXES),
    latitude_rad=st.floats(-89.0 * DEG, 89.0 * DEG), tilt_rad=st.floats(0.0, 0.7),
    train_rad=HALF_TURN,
)  # fmt: skip
# As near to a keyhole as its radius in powers of ten says.
NEARNESS = st.floats(-8.0, 0.0)


def near_a_pole(mount: Kinematics, nearness: float, around: float, side: float) -> np.ndarray:
    """A direction (1, 2) of the sky so near to an end of the mount's pole."""
    return mount.skies(np.array([[around, side * (0.5 * math.pi - 10.0**nearness)]]))


def test_every_type_has_its_chain() -> None:
    assert CHAINS.keys() == MOUNTS.keys()


@pytest.mark.parametrize(
    ("mount", "sky_deg", "axes_deg"),
    [
        # X and Y are 0 at the zenith; the lower axis is the pole of the upper one.
        (Kinematics(type="x_y"), (0.0, 60.0), (30.0, 0.0)),
        (Kinematics(type="x_y"), (90.0, 60.0), (0.0, 30.0)),
        (Kinematics(type="x_y", lower_axis="north_south"), (90.0, 60.0), (30.0, 0.0)),
        (Kinematics(type="x_y", lower_axis="north_south"), (0.0, 60.0), (0.0, 30.0)),
        # On the meridian the declination is the latitude less the zenith angle to the south.
        (Kinematics(type="ha_dec", latitude_rad=35.0 * DEG), (180.0, 60.0), (0.0, 5.0)),
        (Kinematics(type="ha_dec", latitude_rad=-31.0 * DEG), (0.0, 50.0), (0.0, 9.0)),
        # West point: 6 h on the equator, at any latitude.
        (Kinematics(type="ha_dec", latitude_rad=48.0 * DEG), (270.0, 0.0), (90.0, 0.0)),
        (Kinematics(type="ha_dec", latitude_rad=-48.0 * DEG), (270.0, 0.0), (90.0, 0.0)),
        # Towards the side that it leans to the axes stand higher by the tilt.
        (Kinematics(type="azimuth_elevation_tilt", tilt_rad=7.0 * DEG, train_rad=40.0 * DEG), (40.0, 60.0), (0.0, 67.0)),
        (Kinematics(type="azimuth_elevation_tilt", tilt_rad=7.0 * DEG, train_rad=40.0 * DEG), (220.0, 60.0),
         (180.0, 53.0)),
    ],
)  # fmt: skip
def test_axes_are_where_they_are_known(
    mount: Kinematics, sky_deg: tuple[float, float], axes_deg: tuple[float, float]
) -> None:
    first, second = mount.axes_at(*(angle * DEG for angle in sky_deg))
    assert math.remainder(first - axes_deg[0] * DEG, math.tau) == pytest.approx(0.0, abs=CLOSURE)
    assert second == pytest.approx(axes_deg[1] * DEG, abs=CLOSURE)


@given(latitude=st.floats(-89.0, 89.0), azimuth=HALF_TURN, elevation=st.floats(-1.5, 1.5))
def test_hour_angle_and_declination_are_those_of_spherical_astronomy(
    latitude: float, azimuth: float, elevation: float
) -> None:
    """sin d = sin p sin h + cos p cos h cos A;  tan H = -sin A cos h / (sin h cos p - cos A cos h sin p)."""
    mount = Kinematics(type="ha_dec", latitude_rad=latitude * DEG)
    hour, declination = mount.axes_at(azimuth, elevation)
    p, sine = latitude * DEG, math.sin(elevation)
    level = math.cos(elevation)
    assert math.sin(declination) == pytest.approx(
        math.sin(p) * sine + math.cos(p) * level * math.cos(azimuth), abs=CLOSURE
    )
    expected = math.atan2(-math.sin(azimuth) * level, sine * math.cos(p) - math.cos(azimuth) * level * math.sin(p))
    assert math.remainder(hour - expected, math.tau) * math.cos(declination) == pytest.approx(0.0, abs=CLOSURE)


@given(mount=MOUNTED, first=HALF_TURN, second=st.floats(-3.0, 3.0))
def test_every_direction_closes_also_with_the_dish_over_its_back(
    mount: Kinematics, first: float, second: float
) -> None:
    sky = mount.sky_at(first, second)
    back = mount.axes_at(*sky)
    apart = unit_vector_from_azel(*back) - unit_vector_from_azel(first, second)
    assert np.linalg.norm(apart) < CLOSURE
    over = mount.sky_at(first + math.pi, math.pi - second)
    assert np.linalg.norm(unit_vector_from_azel(*over) - unit_vector_from_azel(*sky)) < CLOSURE
    assert mount.skies(np.array([[first, second]]))[0] == pytest.approx(np.array(sky), abs=1e-15) or mount.level


@given(
    mount=MOUNTED, nearness=NEARNESS, around=HALF_TURN, side=st.sampled_from([-1.0, 1.0]), rate=st.floats(-0.02, 0.02)
)
def test_motions_close_with_rates_and_accelerations_near_every_pole(
    mount: Kinematics, nearness: float, around: float, side: float, rate: float
) -> None:
    """As vectors: the angle about a pole has no meaning closer to it than the rounding."""
    sky = near_a_pole(mount, nearness, around, side)
    motion = (sky, np.array([[rate, 0.5 * rate]]), np.array([[rate**2, -rate]]))
    own = mount.to_axes(*motion)
    back = mount.to_sky(*own)
    # An angle about a pole is known to the rounding over the distance from it, its rates likewise.
    near = min(math.cos(sky[0, 1]), math.cos(own[0][0, 1]), 10.0**nearness)
    rounding = 1e-14 * np.array([0.0, abs(rate) / near, rate**2 / near**2 + abs(rate) / near])
    for one, other, more in zip(vectors_of_motion(*back), vectors_of_motion(*motion), rounding, strict=True):
        assert np.max(np.abs(one - other)) < CLOSURE + more


@given(mount=MOUNTED, first=HALF_TURN, second=st.floats(-1.4, 1.4), swing=st.floats(0.1, 1.0))
def test_rates_are_the_derivatives_of_the_angles(mount: Kinematics, first: float, second: float, swing: float) -> None:
    """A target on a great circle, u = c cos wt + s sin wt: its angles by complex steps of the time."""
    centre, side = unit_vector_from_azel(first, second), np.array([0.0, 0.0, 1.0])
    side = np.cross(centre, side) / np.linalg.norm(np.cross(centre, side))

    def angles(t: complex) -> np.ndarray:
        u = mount.matrix.T @ (centre * np.cos(swing * t) + side * np.sin(swing * t))
        return np.array([np.arctan(u[0] / u[1]), np.arcsin(u[2])])

    sky = motion_of_vectors(centre[None], swing * side[None], -(swing**2) * centre[None])
    own = mount.matrix.T @ centre
    if abs(own[2]) > 0.99 or abs(own[1]) < 1e-3 or abs(centre[2]) > 0.99:
        return
    found = mount.to_axes(*sky)
    np.testing.assert_allclose(found[1][0], angles(1e-30j).imag / 1e-30, rtol=1e-9, atol=1e-9)


@given(mount=MOUNTED, azimuth=HALF_TURN, elevation=st.floats(0.1, 1.4))
def test_offsets_are_turned_without_being_stretched(mount: Kinematics, azimuth: float, elevation: float) -> None:
    across = mount.across(azimuth, elevation)
    np.testing.assert_allclose(across @ across.T, np.eye(2), atol=CLOSURE)
    first, second = mount.axes_at(azimuth, elevation)
    if abs(second) > 1.5:
        return
    step = 1e-7
    moved = mount.axes_at(azimuth + step / math.cos(elevation), elevation)
    own = np.array([math.remainder(moved[0] - first, math.tau) * math.cos(second), moved[1] - second]) / step
    np.testing.assert_allclose(own, across[:, 0], atol=1e-5)


def test_keyholes_are_the_ends_of_the_pole_above_the_horizon() -> None:
    assert [angle / DEG for angle in LEVEL.keyholes_rad()[0]][1] == pytest.approx(90.0)
    for lower, bearings in (("east_west", {90, 270}), ("north_south", {0, 180})):
        found = Kinematics(type="x_y", lower_axis=lower).keyholes_rad()
        assert {round(azimuth / DEG) % 360 for azimuth, _ in found} == bearings
        assert all(abs(elevation) < CLOSURE for _, elevation in found)
    for latitude, bearing in ((52.0, 0), (-35.0, 180)):
        ((azimuth, elevation),) = Kinematics(type="ha_dec", latitude_rad=latitude * DEG).keyholes_rad()
        assert (round(azimuth / DEG) % 360, elevation / DEG) == (bearing, pytest.approx(abs(latitude)))


def test_a_tilt_axis_leans_away_from_a_pass_or_towards_it() -> None:
    mount = Kinematics(type="azimuth_elevation_tilt", tilt_rad=7.0 * DEG, train_rate_rad_s=2.0 * DEG)
    assert mount.leaning_s == pytest.approx(90.0)
    stands = mount.replace(train_rate_rad_s=0.0)
    assert (stands.leaning_from(1.0), stands.leaning_s) == ((stands,), 0.0)
    away, towards = mount.leaning_from(100.0 * DEG)
    for one, bearing in ((away, 280), (towards, 100)):
        ((azimuth, elevation),) = one.keyholes_rad()
        assert (round(azimuth / DEG) % 360, elevation / DEG) == (bearing, pytest.approx(83.0))
    assert LEVEL.leaning_from(1.0) == (LEVEL,)


@pytest.mark.parametrize("latitude_deg", [90.0, -90.0])
def test_a_polar_mount_at_a_pole_is_refused(latitude_deg: float) -> None:
    with pytest.raises(ValueError, match="nearer to a pole of the Earth the hour angle has no zero"):
        Kinematics(type="ha_dec", latitude_rad=latitude_deg * DEG)
