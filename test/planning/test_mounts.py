"""Passes on any mount: what an azimuth-elevation mount does at its zenith, others do at their poles."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rf_pointing.core import gaussian_gain
from rf_pointing.core.kinematics import LEVEL, Kinematics, motion_of_vectors
from rf_pointing.core.mount_types import LOWER_AXES, MOUNTS
from rf_pointing.planning import (
    AxisLimits,
    AxisRates,
    Certificate,
    Gate,
    GateParams,
    HorizonMask,
    MachineParams,
    PassProfile,
    certificate_lines,
    certify,
)
from rf_pointing.planning.forbidden_sky import ForbiddenSky
from rf_pointing.planning.limits import slew_time_s
from rf_pointing.planning.slew import Moving, slew_path

DEG = math.pi / 180.0
X_Y = Kinematics(type="x_y")
HA_DEC = Kinematics(type="ha_dec", latitude_rad=-35.0 * DEG)
TILT = Kinematics(type="azimuth_elevation_tilt", tilt_rad=7.0 * DEG, train_rate_rad_s=DEG)
EVERY = [X_Y, Kinematics(type="x_y", lower_axis=LOWER_AXES[1]), HA_DEC, TILT.replace(train_rad=0.7)]
HILLS = HorizonMask(
    azimuth_rad=tuple(x * DEG for x in (0.0, 50.0, 60.0, 70.0, 150.0, 200.0, 201.0, 202.0, 300.0)),
    elevation_rad=tuple(x * DEG for x in (2.0, 4.0, 25.0, 5.0, 3.0, 2.0, 18.0, 2.0, 6.0)),
)
WIDE = AxisLimits(
    azimuth_min_rad=-6.5, azimuth_max_rad=6.5, elevation_min_rad=-89.9 * DEG, elevation_max_rad=89.9 * DEG
)
MACHINE = MachineParams(
    rate_limit_rad_s=(3.0 * DEG,) * 2, acceleration_limit_rad_s2=(3.0 * DEG,) * 2,
    half_power_beamwidth_rad=0.3 * DEG, least_share=0.0, sun_radius_rad=0.0,
)  # fmt: skip


def circle(culminates_deg: tuple[float, float], rate_deg_s: float, seconds: float, heading_deg: float = 90.0,
           mount: Kinematics = LEVEL) -> PassProfile:  # fmt: skip
    """A target on a great circle: half way at a direction of the mount's axes, moving across its first one.

    Returned on the sky; `heading_deg` is 90 for a track along the mount's parallel.
    """
    t = np.linspace(0.0, seconds, round(10.0 * seconds) + 1)
    first, second = (angle * DEG for angle in culminates_deg)
    centre = np.array([math.cos(second) * math.sin(first), math.cos(second) * math.cos(first), math.sin(second)])
    right = np.array([math.cos(first), -math.sin(first), 0.0])
    ahead = math.sin(heading_deg * DEG) * right + math.cos(heading_deg * DEG) * np.cross(right, centre)
    w, phase = rate_deg_s * DEG, rate_deg_s * DEG * (t - 0.5 * seconds)
    u = np.outer(np.cos(phase), centre) + np.outer(np.sin(phase), ahead)
    du = w * (np.outer(np.cos(phase), ahead) - np.outer(np.sin(phase), centre))
    position, velocity, acceleration = motion_of_vectors(u, du, -(w**2) * u)
    position[:, 0] = np.unwrap(position[:, 0])
    position, velocity, acceleration = mount.to_sky(position, velocity, acceleration)
    return PassProfile(
        name="bird", t_s=t, position_rad=position, velocity_rad_s=velocity, acceleration_rad_s2=acceleration,
        sun_rad=np.tile([0.0, -1.2], (len(t), 1)), range_m=np.full(len(t), 1e6), satellite_gain_db=np.zeros(len(t)),
    )  # fmt: skip


def certified(profile: PassProfile, mount: Kinematics, machine: MachineParams = MACHINE,
              limits: AxisLimits = WIDE) -> Certificate:  # fmt: skip
    seen = profile.on(mount)
    motion = (seen.position_rad, seen.velocity_rad_s, seen.acceleration_rad_s2)
    gain = lambda error: gaussian_gain(error, machine.half_power_beamwidth_rad)  # noqa: E731
    flat = HorizonMask(elevation_rad=(-0.2,))
    start = tuple(seen.position_rad[0].tolist())
    return certify(seen, {False: motion}, -100.0, start, machine, limits, flat, gain, mount=mount)


@pytest.mark.parametrize("mount", EVERY)
@pytest.mark.parametrize("miss_deg", [0.3, 2.0, 6.0])
def test_past_its_pole_every_mount_loses_what_azimuth_and_elevation_lose_at_the_zenith(
    mount: Kinematics, miss_deg: float
) -> None:
    """The same motion of the axes: the certificate is the same, whatever the axes are called."""
    above = certified(circle((10.0, 90.0 - miss_deg), 0.8, 160.0), LEVEL)
    rotated = certified(circle((10.0, 90.0 - miss_deg), 0.8, 160.0, mount=mount), mount)
    for name in ("keyhole_s", "lost_s", "lost_signal_s", "peak_loss_db"):
        assert getattr(rotated.branches[0], name) == pytest.approx(getattr(above.branches[0], name), abs=1e-6)
    assert above.branches[0].keyhole_s > 1.0


@pytest.mark.parametrize("mount", EVERY)
def test_the_pole_below_is_that_above_in_a_mirror(mount: Kinematics) -> None:
    above, below = (certified(circle((10.0, side * 88.5), 0.8, 160.0, mount=mount), mount) for side in (1.0, -1.0))
    assert below.branches[0].lost_signal_s == pytest.approx(above.branches[0].lost_signal_s, abs=1e-6)
    assert below.branches[0].elevation_range_rad[0] == pytest.approx(-above.branches[0].elevation_range_rad[1])


def test_a_pass_by_both_poles_loses_at_both_and_is_on_the_target_between() -> None:
    """Half a turn of a great circle that misses both ends of the pole by 1.5 deg."""
    both_x = certified(circle((20.0, 0.0), 0.8, 380.0, heading_deg=1.5, mount=X_Y), X_Y).branches[0]
    one = certified(circle((0.0, 88.5), 0.8, 160.0, mount=X_Y), X_Y).branches[0]
    assert both_x.crossing is not None
    assert both_x.lost_signal_s == pytest.approx(2.0 * one.lost_signal_s, rel=0.05)
    middle = np.abs(both_x.crossing.t_s - 190.0) < 30.0
    assert np.max(both_x.crossing.error_rad[middle]) < 1e-9


def test_x_and_y_have_no_keyhole_at_the_zenith_and_two_at_the_horizon() -> None:
    for miss_deg in (0.001, 0.1, 3.0):
        overhead = circle((40.0, 90.0 - miss_deg), 1.1, 140.0)
        assert certified(overhead, X_Y).branches[0].keyhole_s == 0.0
        assert certified(overhead, LEVEL).branches[0].keyhole_s > 0.0
    lost = {
        bearing: certified(circle((bearing, 1.0), 0.5, 100.0), X_Y).branches[0].keyhole_s
        for bearing in (0.0, 45.0, 90.0, 180.0, 270.0)
    }
    assert {bearing for bearing, keyhole_s in lost.items() if keyhole_s > 0.0} == {90.0, 270.0}


def test_a_tilt_axis_of_7_deg_removes_the_keyhole_of_6_deg_a_second() -> None:
    """0.65 deg/s past a pole at 7 deg is 5.3 deg/s of azimuth; overhead it is any rate."""
    machine = MACHINE.replace(rate_limit_rad_s=(6.0 * DEG,) * 2, acceleration_limit_rad_s2=(6.0 * DEG,) * 2)
    for miss_deg in (0.001, 0.5, 3.0, 5.0):
        profile = circle((60.0, 90.0 - miss_deg), 0.65, 180.0)
        top = float(profile.position_rad[np.argmax(profile.position_rad[:, 1]), 0])
        assert certified(profile, LEVEL, machine).branches[0].keyhole_s > 0.0
        leaning = [certified(profile, mount, machine) for mount in TILT.leaning_from(top)]
        found = min(leaning, key=lambda one: one.branches[0].keyhole_s)
        assert found.branches[0].keyhole_s == 0.0
        assert found.branches[0].peak_rate_rad_s[0] <= 0.65 * DEG / math.sin((miss_deg + 7.0) * DEG) * 1.001
        text = "\n".join(certificate_lines(found))
        assert "mount azimuth_elevation_tilt leaning to" in text


def test_the_certificate_names_the_axes_and_their_limits() -> None:
    narrow = WIDE.replace(azimuth_min_rad=-80.0 * DEG, azimuth_max_rad=80.0 * DEG)
    found = certified(circle((0.0, 88.0), 0.8, 215.0, heading_deg=0.0), X_Y, limits=narrow)
    assert "x deg" in certificate_lines(found)[1]
    assert "past the limit x " in "".join(sum((one.reasons for one in found.branches), ()))
    assert certified(circle((0.0, 60.0), 0.3, 60.0), HA_DEC).branches[0].closest_limit.startswith("declination ")


@given(
    kind=st.sampled_from(sorted(MOUNTS)), azimuth=st.floats(0.0, 6.2), elevation=st.floats(-0.3, 1.5),
    over=st.booleans(),
)  # fmt: skip
def test_the_horizon_stays_in_the_sky(kind: str, azimuth: float, elevation: float, over: bool) -> None:
    mount = Kinematics(type=kind, latitude_rad=0.6, tilt_rad=0.1, train_rad=2.0)
    sky = ForbiddenSky(HILLS, 0.0, mount)
    first, second = mount.axes_at(azimuth, elevation)
    place = (first + math.pi, math.pi - second) if over else (first, second)
    wanted = HILLS.lowest_rad(azimuth) - elevation
    assert sky.under_mask(*place) == pytest.approx(wanted, abs=1e-9)
    assert float(sky.under_mask_all(np.array(place))) == pytest.approx(wanted, abs=1e-9)


def test_what_is_free_by_the_path_is_free_everywhere_on_it(random: np.random.Generator) -> None:
    """Straight slews judged by their chords, and looked at in steps of 0.002 deg; detours likewise."""
    axes = AxisRates((3.0 * DEG,) * 2, (3.0 * DEG,) * 2)
    detours = straight = 0
    for trial in range(60):
        mount = EVERY[trial % len(EVERY)]
        gate = Gate(GateParams(sun_radius_rad=3.0 * DEG), WIDE, HILLS, axes, mount)
        sky = ForbiddenSky(HILLS, 3.0 * DEG, mount)
        ends: list[tuple[float, float]] = []
        while len(ends) < 2:
            azimuth, elevation = (random.uniform(0.0, math.tau), random.uniform(2.0 * DEG, 40.0 * DEG))
            if elevation > HILLS.lowest_rad(azimuth) + 1.0 * DEG:
                ends.append(mount.axes_at(azimuth, elevation))
        start, goal = ((math.remainder(first, math.tau), second) for first, second in ends)
        sun = mount.axes_at(random.uniform(0.0, math.tau), random.uniform(0.2, 1.0))
        decision = gate.check("slew", start, np.array([goal]), sun_rad=sun)
        if not decision.allowed:
            continue
        detours, straight = detours + bool(decision.way), straight + (not decision.way)
        here, begun = (start, min(3.0 * DEG, sky.sun_distance(*start, sun), sky.sun_distance(*goal, sun)))
        for corner in decision.way or [goal]:
            times, positions, _ = slew_path(Moving(1.0, here), corner, axes)
            fine = np.linspace(0.0, times[-1], 20_000)
            dense = np.column_stack([np.interp(fine, times, column) for column in positions.T])
            assert np.max(sky.under_mask_all(dense)) < 0.02 * DEG
            assert min(sky.sun_distance(*place, sun) for place in dense[::40].tolist()) > begun - 0.02 * DEG
            here = corner
    assert straight > 20
    assert detours > 5


def test_the_gate_speaks_of_the_axes_of_its_mount_and_of_the_sky() -> None:
    limits = WIDE.replace(azimuth_min_rad=-85.0 * DEG, azimuth_max_rad=85.0 * DEG)
    gate = Gate(GateParams(), limits, HILLS, AxisRates((1.0,) * 2, (1.0,) * 2), X_Y)
    assert gate.position(86.0 * DEG, 0.0) == "x 86.000 deg is 1.000 deg past the limit 85.000 deg"
    # X to the north, Y to the east: 84 deg of X alone look north, at 6 deg.
    assert gate.position(84.0 * DEG, 0.0) == ""
    low = gate.position(*(math.remainder(angle, math.tau) for angle in X_Y.axes_at(60.0 * DEG, 20.0 * DEG)))
    assert low == "elevation 20.000 deg at azimuth 60.0 deg is 5.000 deg below the horizon mask"
    assert gate.too_low_to_send(0.0, 0.0) == ""
    assert "elevation 6.00 deg is below the 10.00 deg" in gate.too_low_to_send(84.0 * DEG, 0.0)
    assert gate.warning(84.0 * DEG, 0.0) == "x 1.00 deg inside its limit"


def test_a_slew_through_the_zenith_is_straight_for_x_and_y() -> None:
    """From north to south across the zenith X alone moves; azimuth would turn by half a turn."""
    axes = AxisRates((3.0 * DEG,) * 2, (3.0 * DEG,) * 2)
    gate = Gate(GateParams(), WIDE, HILLS, axes, X_Y)
    start, goal = X_Y.axes_at(0.0, 20.0 * DEG), X_Y.axes_at(math.pi, 20.0 * DEG)
    needed_s, barred = gate.slew(start, (math.remainder(goal[0], math.tau), goal[1]))
    assert (needed_s, barred) == (pytest.approx(slew_time_s(140.0 * DEG, *(each[0] for each in axes))), "")
